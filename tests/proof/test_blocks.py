"""Bounds over blocks of rows; oracle: the formulas of docs/certificate.md in numpy."""

from dataclasses import dataclass

import numpy as np
import pytest
from oracles.plain import plain
from oracles.shortcuts import prove, start_proof
from oracles.tree_queries import random_path, random_tree, unit

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import RADIUS
from vdsm_pin.geometry.convex import FlatCylinder, Hull
from vdsm_pin.proof import bends as slices
from vdsm_pin.proof.bodies import Body, ErrorBox, Pair, PairTable
from vdsm_pin.proof.boxes import body_box, box_gaps, box_reaches
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.cached_planes import served
from vdsm_pin.proof.error_growth import crude_growth, grow_corners, set_direction
from vdsm_pin.proof.layouts import OWN_POINT, POINT, SUPPORT
from vdsm_pin.proof.packing import pack_task, with_errors
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.plane_bounds import (
    bound_above,
    bound_below,
    place_disc,
    place_own,
    take_disc,
)
from vdsm_pin.proof.proving import dense_rows
from vdsm_pin.proof.results import count_the_rest
from vdsm_pin.proof.row_places import fill_rows
from vdsm_pin.proof.rows import BLOCK
from vdsm_pin.proof.terms import CERTIFIED, UNDECIDED, Rules, Task, mover_of
from vdsm_pin.proof.tree import Joint, Kind, Tree
from vdsm_pin.proof.workspace import new_workspace

new_bends, bend_between = plain(slices.new_bends), plain(slices.bend_between)

RULES = Rules(True, True, 1e-11, 1e-9, 1e-6, 0.02, np.inf)
INTERVALS = 3
EXACT = {"rtol": 1e-11, "atol": 1e-12}


@dataclass(frozen=True)
class Bounds:
    """Of the joints over each interval: value, rate, change, shape (n, n_joints)."""

    value: FloatArray
    rate: FloatArray
    change: FloatArray

    @classmethod
    def of(cls, tree: Tree, path: Path) -> "Bounds":
        """The largest control points of a polynomial and its derivatives."""
        controls = path.controls  # (n_intervals, degree + 1, n_columns)
        degree, found = controls.shape[1] - 1, []
        for order in range(3):
            found.append(np.zeros((len(controls), len(tree.joints))))
            for j, joint in enumerate(tree.joints):
                if joint.column is not None and degree >= order:
                    most = np.abs(controls[:, :, joint.column]).max(axis=1)
                    found[-1][:, j] = abs(joint.ratio) * most
                if order == 0:
                    found[-1][:, j] += abs(joint.offset)
            controls = (degree - order) * np.diff(controls, axis=1)
        return cls(*found)


@dataclass
class Way:
    """What lies between two frames: M, W, A, D, Q, E, C, by interval or one number."""

    bend: FloatArray
    turn: FloatArray
    swing: FloatArray
    drift: FloatArray
    second: float = 0.0
    erring: float = 0.0
    turned: float = 0.0

    def segment(self, length: FloatArray | float, longest: float) -> None:
        """A segment in the frame reached so far."""
        self.bend = self.bend + length * (self.turn**2 + self.swing)
        self.drift = self.drift + length * self.erring * self.turn
        self.second += 0.5 * longest * self.turned**2


def way_of(
    tree: Tree, path: Path, box: ErrorBox, rest: int, frame: int, lever: float
) -> Way:
    """From one frame to a point of another, so far from its origin."""
    bounds, n = Bounds.of(tree, path), len(path.knots) - 1
    way = Way(*np.zeros((4, n)))
    up, down = tree.way(rest, frame)
    for j, upwards in [*((j, True) for j in up), *((j, False) for j in down)]:
        joint = tree.joints[j]
        shift = float(np.linalg.norm(np.asarray(joint.placement)[:3, 3]))
        if not upwards:
            way.segment(shift, shift)
        if joint.kind is Kind.REVOLUTE:
            way.turn = way.turn + bounds.rate[:, j]
            way.swing = way.swing + bounds.change[:, j]
            way.erring += box.joints[j]
            way.turned += box.joints[j]
        way.turned += box.tilts[j]
        if upwards:
            way.segment(shift, shift)
        if joint.kind is Kind.PRISMATIC:
            stroke = abs(joint.offset)
            if joint.column is not None:
                stroke += abs(joint.ratio) * float(path.reach[joint.column])
            way.segment(bounds.value[:, j], stroke)
            rate = bounds.rate[:, j]
            way.bend = way.bend + 2.0 * way.turn * rate + bounds.change[:, j]
            way.drift = way.drift + way.erring * rate
    way.segment(lever, lever)
    return way


def first_order(
    tree: Tree, box: ErrorBox, poses: FloatArray, ends: tuple[int, int, FloatArray],
    n: FloatArray,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """G and T of a point of a frame along n of another, shape (n_rows,) each."""
    rest, frame, at = ends
    p = poses[:, frame, :3, :3] @ at + poses[:, frame, :3, 3]
    toward = poses[:, rest, :3, :3] @ n
    g, t = np.zeros((2, len(poses)))
    for j in np.concatenate(tree.way(rest, frame)).tolist():
        joint = tree.joints[j]
        placed = poses[:, joint.parent] @ joint.placement
        arm = p - placed[:, :3, 3]
        axis = placed[:, :3, :3] @ np.asarray(joint.axis)
        if joint.kind is Kind.REVOLUTE:
            g += box.joints[j] * np.abs((toward * np.cross(axis, arm)).sum(axis=1))
        t += box.tilts[j] * np.linalg.norm(arm, axis=1)
    return g, t


@dataclass(frozen=True)
class Case:
    """A body past a point at rest in another frame, over a block."""

    tree: Tree
    path: Path
    box: ErrorBox
    task: Task
    poses: FloatArray


def random_case(rng: np.random.Generator, degree: int, resting: int | None) -> Case:
    """A tree of joints, some in one origin and some 1 m apart, and a body on it."""
    tree = random_tree(rng, int(rng.integers(2, 9)))
    joints = list(tree.joints)
    for j, joint in enumerate(joints):
        if kind := rng.integers(4):  # half of them where the frame is they hang on
            placed = np.array(joint.placement)
            placed[:3, 3] = np.eye(3)[rng.integers(3)] if kind == 3 else 0.0
            fields = {n: getattr(joint, n) for n in joint.__dataclass_fields__}
            joints[j] = Joint(**(fields | {"placement": placed}))
    tree = Tree(tuple(joints))
    frame, rest = rng.choice(tree.n_frames, 2, replace=False).tolist()
    if resting is not None:
        rest, frame = resting, int(rng.integers(1, tree.n_frames))
    corners = rng.uniform(-0.3, 0.3, (int(rng.integers(1, 5)), 3))
    solid: Hull | FlatCylinder = Hull(corners, 0.03)
    if rng.integers(3) == 0:
        solid = FlatCylinder(corners[0], unit(rng), 0.1, 0.05)
    bodies = [Body(frame, (solid,)), Body(rest, (Hull(np.zeros((1, 3))),))]
    path = random_path(rng, tree, INTERVALS + 1, degree)
    n = len(tree.joints)
    box = ErrorBox(
        rng.choice([0.0, 0.01, 0.02], n), np.zeros(n), rng.choice([0.0, 0.0, 0.01], n)
    )
    table = PairTable.of([Pair(0, 1)])
    task = with_errors(pack_task(tree, bodies, table, RULES, path.reach), box)
    return Case(tree, path, box, task, tree.poses(path.knots))


def seen(case: Case, place: int) -> FloatArray:
    """A place in the frame from which it is seen, by row."""
    ways, places = case.task.ways, case.task.places
    way = places.way[place]
    rest, frame = case.poses[:, ways.rest[way]], case.poses[:, ways.frame[way]]
    moved = np.linalg.inv(rest) @ frame
    return np.asarray(moved[:, :3, :3] @ places.at[place] + moved[:, :3, 3])


@pytest.mark.parametrize("degree", [1, 3, 5])
@pytest.mark.parametrize("seed", range(4))
def test_a_block_has_the_bounds_of_the_formula(degree: int, seed: int) -> None:
    rng = np.random.default_rng([degree, seed])
    for _ in range(12):
        case = random_case(rng, degree, None)
        task, mover, n = case.task, mover_of(case.task, 0), unit(rng)
        work = new_workspace(task, case.tree.n_columns, 1)
        rows, runs, plane = work.rows, work.runs, work.planes[0]
        fill_rows(task, case.path.packed(), rows, 0, INTERVALS)
        plane[:3], plane[SUPPORT] = n, 2.0
        set_direction(rows, mover.rest, n, 0, INTERVALS + 1, runs.toward)
        toward = runs.toward[:, : INTERVALS + 1]
        grow_corners(task, mover, rows, toward, 0, False, runs.growth)
        disc, most = mover.disc[RADIUS], np.full(INTERVALS, -np.inf)
        for k, place in enumerate(mover.slots.tolist()):
            ends = (
                task.ways.rest[task.places.way[place]],
                (task.ways.frame[task.places.way[place]]),
            )
            at = task.places.at[place]
            way = way_of(
                case.tree, case.path, case.box, *ends, task.places.lever[place]
            )
            check_slices(case, int(task.places.way[place]), ends)
            points = seen(case, place)
            found = rows.tracks.places[place, :, : INTERVALS + 1].T
            np.testing.assert_allclose(found, points, **EXACT)
            sags = rows.tracks.sags[place, :INTERVALS]
            np.testing.assert_allclose(sags, way.bend / 8.0, **EXACT)
            g, t = first_order(case.tree, case.box, case.poses, (*ends, at), n)
            grown = 0.5 * (g[1:] + g[:-1] + way.drift) + way.second + disc * way.turned
            grown += np.maximum(t[1:], t[:-1])
            grown += (way.turned - way.erring) * sags
            if not task.rules.steady:
                np.testing.assert_allclose(runs.growth[k, :INTERVALS], grown, **EXACT)
            along = points @ n
            most = np.maximum(most, np.maximum(along[1:], along[:-1]) + sags + grown)
        bound_below(mover, rows.tracks, runs, plane, 0, INTERVALS)
        place_disc(mover, rows, runs, INTERVALS)
        lost = most + mover.lost
        if disc > 0.0:
            take_disc(runs.axis, plane, disc, 0, INTERVALS, runs.lower)
            rest, frame = case.poses[:, mover.rest], case.poses[:, mover.frame]
            axis = (np.linalg.inv(rest) @ frame)[:, :3, :3] @ mover.disc[:3]
            wide = disc * np.linalg.norm(np.cross(axis, n), axis=1)
            lost = lost + np.maximum(wide[1:], wide[:-1])
        np.testing.assert_allclose(runs.lower[:INTERVALS], 2.0 - lost, **EXACT)


def check_slices(case: Case, number: int, ends: tuple[int, int]) -> None:
    """The same of a way over whole intervals, as subdivision has it."""
    bends = new_bends(len(case.task.ways.rest), case.tree.n_frames)
    way = way_of(case.tree, case.path, case.box, *ends, 0.0)
    truth = np.stack([way.bend, way.turn, way.swing, way.drift])
    for k in range(INTERVALS):
        bend_between(case.task, case.path.packed(), bends, number, k, 0.0, 1.0)
        found = [part[number] for part in bends[:4]]
        np.testing.assert_allclose(found, truth[:, k], **EXACT)


@pytest.mark.parametrize("seed", range(4))
def test_a_witness_bounds_a_block_from_above(seed: int) -> None:
    """The distance of two points, or of a point and a segment, at the nearer row."""
    rng = np.random.default_rng([7, seed])
    for _ in range(12):
        case = random_case(rng, 1, None)
        task, mover = case.task, mover_of(case.task, 0)
        work = new_workspace(task, case.tree.n_columns, 1)
        plane, own, other = work.planes[0], *rng.uniform(-0.3, 0.3, (2, 3))
        plane[OWN_POINT : OWN_POINT + 3], plane[POINT : POINT + 3] = own, other
        fill_rows(task, case.path.packed(), work.rows, 0, INTERVALS)
        place_own(mover, work.rows, work.runs, plane, INTERVALS)
        bound_above(mover, work.rows.tracks, work.runs, plane, 0, INTERVALS)
        moved = np.linalg.inv(case.poses[:, mover.rest]) @ case.poses[:, mover.frame]
        ends = mover.corners if mover.inverse >= 0.0 else np.array([own, own])
        a, b = (moved[:, :3, :3] @ p + moved[:, :3, 3] for p in (ends[0], ends[-1]))
        d, squared = b - a, ((b - a) ** 2).sum(axis=1)
        share = ((other - a) * d).sum(axis=1) / np.where(squared > 0.0, squared, 1.0)
        nearest = a + np.clip(share, 0.0, 1.0)[:, None] * d
        away = np.linalg.norm(nearest - other, axis=1)
        upper = mover.rise + np.minimum(away[1:], away[:-1])
        np.testing.assert_allclose(work.runs.upper[:INTERVALS], upper, **EXACT)


@pytest.mark.parametrize("seed", range(4))
def test_a_box_holds_the_corners_and_no_more(seed: int) -> None:
    rng = np.random.default_rng([8, seed])
    for _ in range(12):
        case = random_case(rng, int(rng.choice([1, 3])), 0)
        task, mover = case.task, mover_of(case.task, 0)
        work = new_workspace(task, case.tree.n_columns, 1)
        fill_rows(task, case.path.packed(), work.rows, 0, INTERVALS)
        low, high = np.zeros((2, 3))
        size = body_box(task, work.rows, (0, INTERVALS), 0, low, high)
        least, most = np.full(3, np.inf), np.full(3, -np.inf)
        for place in mover.slots.tolist():
            number, lever = task.places.way[place], task.places.lever[place]
            way = way_of(
                case.tree, case.path, case.box, 0, task.ways.frame[number], lever
            )
            grown = mover.disc[RADIUS] + way.bend.max() / 8.0
            if not task.rules.steady:
                grown += 0.5 * way.drift.max()
                grown += crude_growth(task.errors, number, lever)
            least = np.minimum(least, seen(case, place).min(axis=0) - grown)
            most = np.maximum(most, seen(case, place).max(axis=0) + grown)
        np.testing.assert_allclose([low, high], [least, most], **EXACT)
        assert size == pytest.approx((most - least).sum(), rel=1e-12)


def test_boxes_are_as_far_apart_as_their_nearest_points() -> None:
    rng, n = np.random.default_rng(2), 200
    box = np.sort(rng.uniform(-1.0, 1.0, (2, 3, n)), axis=0)
    low, high = np.sort(rng.uniform(-1.0, 1.0, (2, 3)), axis=0)
    point = rng.uniform(-1.0, 1.0, (3, n))
    gap, reach = np.zeros((2, n))
    box_gaps(box, low, high, gap)
    box_reaches(point, low, high, 0.1, reach)
    apart = np.maximum(box[0] - high[:, None], low[:, None] - box[1])
    np.testing.assert_allclose(gap, np.linalg.norm(apart.clip(0.0), axis=0), **EXACT)
    corners = np.stack(np.meshgrid(*np.stack([low, high]).T)).reshape(3, 8, 1)
    away = np.linalg.norm(corners - point[:, None], axis=0).max(axis=0)
    np.testing.assert_allclose(reach, away + 0.1, **EXACT)


def test_errors_of_axes_that_meet_are_a_sum_of_vectors() -> None:
    """At right angles a point moves by the square root of both squares at most."""
    turns = (
        Joint(0, Kind.REVOLUTE, (0.0, 0.0, 1.0), column=0),
        Joint(1, Kind.REVOLUTE, (0.0, 1.0, 0.0), column=1),
    )
    tree, path = Tree(turns), Path(np.zeros((2, 2)))
    bodies = [
        Body(2, (Hull(np.array([[2.0, 0, 0]])),)),
        Body(0, (Hull(np.zeros((1, 3))),)),
    ]
    task = pack_task(tree, bodies, PairTable.of([Pair(0, 1)]), RULES, path.reach)
    task = with_errors(task, ErrorBox(np.array([0.003, 0.004]), *np.zeros((2, 2))))
    way = int(task.pairs.way[0])
    assert task.errors.swing[way] == pytest.approx(0.005, abs=1e-15)
    second = 0.5 * 2.0 * 0.007**2
    assert crude_growth(task.errors, way, 2.0) == pytest.approx(
        0.01 + second, abs=1e-15
    )


# ---- what is noted of a block ----------------------------------------------------


def approaching(n_intervals: int) -> tuple[Tree, Path]:
    """A frame that comes nearer from row to row, most between the last two."""
    tree = Tree((Joint(0, Kind.PRISMATIC, (1.0, 0.0, 0.0), column=0),))
    return tree, Path(np.append(np.linspace(0.0, 0.2, n_intervals), 0.5)[:, None])


def ball(frame: int, x: float, y: float = 0.0) -> Body:
    return Body(frame, (Hull(np.array([[x, y, 0.0]]), 0.1),))


@pytest.mark.parametrize("n_intervals", [1, BLOCK - 1, BLOCK, BLOCK + 1, 2 * BLOCK + 1])
def test_the_last_row_counts_wherever_a_block_ends(n_intervals: int) -> None:
    tree, path = approaching(n_intervals)
    bodies = [ball(1, 0.0), ball(0, 2.0), ball(0, 2.0, 1.0)]
    columns = np.array([0, 1, 2])
    proof = prove(tree, bodies, path, [Pair(0, 1), Pair(0, 2)], columns=columns)
    gaps = np.array([1.5, np.hypot(1.5, 1.0)]) - 0.2
    held(proof.lower, proof.upper, gaps)
    assert proof.upper[0] == pytest.approx(1.3, abs=1e-8)
    np.testing.assert_array_equal(proof.interval, n_intervals - 1)
    np.testing.assert_array_equal(proof.share, 1.0)
    assert proof.stride == 1
    rows = 2.0 - path.knots[1:, 0]
    gaps = np.array([rows, rows, np.hypot(rows, 1.0)]) - 0.2
    held(*proof.profile, gaps)


def held(lower: FloatArray, upper: FloatArray, gaps: FloatArray) -> None:
    """Brackets hold the gaps and are as narrow as two of a hundred parts."""
    assert (lower <= gaps).all() and (lower >= 0.97 * gaps).all()
    assert (upper >= gaps).all() and (upper <= 1.03 * gaps).all()


def test_a_profile_of_few_bins_holds_the_least_of_each() -> None:
    tree, path = approaching(100)
    asked = {"columns": np.array([0, 1]), "budget": Budget(profile=40)}
    proof = prove(tree, [ball(1, 0.0), ball(0, 2.0)], path, [Pair(0, 1)], **asked)
    assert (proof.stride, proof.profile.shape) == (10, (2, 2, 10))
    rows = 2.0 - path.knots[10::10, 0]
    held(*proof.profile[:, 1], rows - 0.2)


def test_how_much_is_judged_is_told_while_it_is() -> None:
    tree, path = approaching(4 * BLOCK)
    bodies, table = (
        [ball(1, 0.0), ball(0, 2.0), ball(0, 3.0)],
        PairTable.of([Pair(0, 1), Pair(0, 2)]),
    )
    proving = start_proof(tree, bodies, path, table)
    assert (proving.n_intervals, proving.share) == (4 * BLOCK, 0.0)
    assert proving.new_results().profile.shape == proving.results.profile.shape
    proving.sweep(0, BLOCK)
    assert proving.share == 0.25
    proving.sweep(BLOCK, 4 * BLOCK)
    assert proving.share == 1.0


@pytest.mark.parametrize(
    "judged", [(BLOCK, 0), (0, BLOCK), (BLOCK, BLOCK), (0, 0), (BLOCK - 1, BLOCK)]
)
def test_each_pair_owns_up_to_what_it_was_not_judged(judged: tuple[int, int]) -> None:
    """Time may end between two pairs of one block, or before the first."""
    tree, path = approaching(BLOCK)
    bodies, table = (
        [ball(1, 0.0), ball(0, 2.0), ball(0, 3.0)],
        PairTable.of([Pair(0, 1), Pair(0, 2)]),
    )
    proving = start_proof(tree, bodies, path, table)
    results = proving.results
    results.counts[:, CERTIFIED] = judged
    results.best[:, 0] = 1.0
    results.profile[:] = 1.0
    count_the_rest(results, BLOCK)
    left = BLOCK - np.array(judged)
    np.testing.assert_array_equal(results.counts[:, UNDECIDED], left)
    assert (results.best[left > 0, 0] == -np.inf).all()
    assert (results.best[left == 0, 0] == 1.0).all()
    expected = -np.inf if left.any() else 1.0
    assert (results.profile[0] == expected).all()
    over = start_proof(tree, bodies, path, table, budget=Budget(until=0.0))
    assert not over.prove().in_time
    assert (over.results.counts[:, UNDECIDED] == BLOCK).all()
    assert (over.results.best[:, 0] == -np.inf).all()


def test_a_plane_serves_up_to_the_first_bound_that_is_too_low_or_too_wide() -> None:
    rng = np.random.default_rng(8)
    for _ in range(200):
        size = rng.integers(1, 5)
        lower = rng.normal(0.5, 0.3, size)
        upper = lower + rng.choice([0.1, 0.3], size)
        slack, width = rng.choice([0.0, 0.2]), 0.15
        bar = rng.choice([0.2, -1.0])
        lower[0] -= rng.integers(2)
        far = rng.choice([0.4, np.inf])
        part = np.where(lower < far, slack, 0.5)
        good = (lower >= bar) & (upper - lower <= width + part * upper)
        first = int(np.argmin([*good, False]))
        assert served(lower, upper, bar, slack, width, far) == first


def test_dense_rows_have_room_for_a_point_on_either_side() -> None:
    dense = dense_rows(5, 2)
    assert dense.own.shape == dense.other.shape == (5, 2, 3)
    flat = dense.lower, dense.upper, dense.time, dense.verdict
    assert {part.shape for part in flat} == {(5, 2)}


@pytest.mark.parametrize("block", range(3))
@pytest.mark.parametrize("place", [5, 40])
def test_candidates_of_several_blocks_are_looked_at_where_they_are(
    block: int, place: int
) -> None:
    """Between two rows of one block a ball comes nearer than at rows of the others."""
    turns = np.full(3 * BLOCK + 1, 1.0)
    for k in range(3):
        row = k * BLOCK + place + 7 * k
        turns[row : row + 2] = (-0.3, 0.3) if k == block else (0.5, 0.02)
    tree = Tree((Joint(0, Kind.REVOLUTE, column=0),))
    bodies = [ball(1, 1.0), ball(0, 2.0)]
    proof = prove(tree, bodies, Path(turns[:, None]), [Pair(0, 1)])
    assert proof.lower[0] <= 0.8 <= proof.upper[0]
    assert proof.upper[0] - proof.lower[0] < 1.1e-6


@pytest.mark.parametrize("before", [0, BLOCK - 2, BLOCK - 1, BLOCK])
def test_errors_count_in_every_interval_of_a_block(before: int) -> None:
    """The last intervals of a full block as much as the same motion alone."""
    tree = Tree((Joint(0, Kind.REVOLUTE, column=0),))
    none, bodies = np.zeros(1), [ball(1, 1.0), ball(0, 2.0)]
    errors = ErrorBox(np.array([0.1]), none, none)
    turns = np.append(np.full(before, 1.5), [1.5, 1.2, 0.9])
    found = prove(tree, bodies, Path(turns[:, None]), [Pair(0, 1)], errors)
    ends = np.array([np.cos(0.8), np.sin(0.8)])
    gap = np.hypot(*(ends - [2.0, 0.0])) - 0.2
    assert gap - 0.01 < found.lower[0] <= gap


def test_columns_of_a_profile_are_as_many_as_are_named() -> None:
    tree, path = approaching(3)
    for columns in ([0, 0], [0, 1], [1, 0]):
        proof = prove(
            tree, [ball(1, 0.0), ball(0, 2.0)], path, [Pair(0, 1)],
            columns=np.array(columns),
        )  # fmt: skip
        assert proof.profile.shape[1] == max(columns) + 1


def test_a_joint_keeps_its_place_whatever_becomes_of_what_it_was_made_of() -> None:
    placement, axis = np.eye(4), np.array([1.0, 0.0, 0.0])
    joint = Joint(0, Kind.PRISMATIC, axis, placement, column=0)
    placement[0, 3] = axis[0] = 7.0
    assert joint.placement[0, 3] == 0.0 and joint.axis[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        joint.placement[0, 3] = 1.0
