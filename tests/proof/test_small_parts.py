"""Each small function of the proof against a formula of its own."""

from fractions import Fraction
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from oracles.plain import plain
from oracles.tree_queries import random_box, random_path, random_tree, unit

from vdsm_pin.geometry import bernstein
from vdsm_pin.geometry.arrays import PAGES, FloatArray, paged_zeros
from vdsm_pin.geometry.bodies import new_body
from vdsm_pin.geometry.convex import FlatCylinder, Hull
from vdsm_pin.geometry.kernels import LOWER, NORMAL
from vdsm_pin.proof import (
    bends,
    cached_clearances,
    far_pairs,
    heaps,
    motions,
    packed_tree,
    plane_bounds,
    results,
    rows,
    search,
    slices,
    swept_bodies,
    terms,
    witnesses,
)
from vdsm_pin.proof.bodies import Body, ErrorBox, Pair, PairTable
from vdsm_pin.proof.budget import Budget, rounding_pad
from vdsm_pin.proof.layouts import (
    AT_LOWER,
    AT_UPPER,
    CANDIDATES,
    END,
    HELD_AT,
    HELD_CLEARANCE,
    INTERVAL,
    KEY,
    LOST,
    LOW,
    OTHER,
    OWN,
    SLICE,
    START,
    SUPPORT,
    TIME,
    UP,
)
from vdsm_pin.proof.packed_tree import pack_tree
from vdsm_pin.proof.packing import pack_task, with_errors
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.proofs import RANK
from vdsm_pin.proof.proving import new_results, room_for
from vdsm_pin.proof.results import Results
from vdsm_pin.proof.rows import new_tracks
from vdsm_pin.proof.terms import (
    ACROSS,
    CERTIFIED,
    REFUTED,
    UNDECIDED,
    WITHIN,
    Rules,
    Task,
    mover_of,
)
from vdsm_pin.proof.tree import Joint, Kind, Tree
from vdsm_pin.proof.ways import WayTable, way_errors
from vdsm_pin.tolerances import TOLERANCES

push, pop = plain(heaps.push), plain(heaps.pop)
largest_between, interpolate = (
    plain(motions.largest_between),
    plain(motions.interpolate),
)
bound_column, carry = plain(motions.bound_column), plain(rows.carry)
new_pose, place_tree = plain(packed_tree.new_pose), plain(packed_tree.place_tree)
place_two, turn_back = plain(packed_tree.place_two), plain(swept_bodies.turn_back)
place_point, to_body = plain(swept_bodies.place_point), plain(swept_bodies.to_body)
local_point, finer = plain(swept_bodies.local_point), plain(terms.finer)
new_bends, stay = plain(bends.new_bends), plain(bends.stay)
bend_between = plain(bends.bend_between)
cache_clearance = plain(cached_clearances.cache_clearance)
raise_to_held = plain(cached_clearances.raise_to_held)
keep_least, new_runs = plain(far_pairs.keep_least), plain(plane_bounds.new_runs)
bound_below = plain(plane_bounds.bound_below)
any_below, nominate = plain(results.any_below), plain(results.nominate)
note_block, note_upper = plain(results.note_block), plain(results.note_upper)
witness_at, mover_in = plain(witnesses.witness_at), plain(mover_of)
place_pair = plain(search.place_pair)
new_space, loaded_bound = plain(slices.new_space), plain(slices.loaded_bound)
new_ends, load_body = plain(swept_bodies.new_ends), plain(swept_bodies.load_body)
errors_along, loaded_body = plain(way_errors), plain(new_body)

RULES = Rules(True, True, 1e-11, 1e-9, 1e-6, 0.02, np.inf)
EXACT: dict[str, Any] = {"rtol": 1e-12, "atol": 1e-14}


# ---- heaps -----------------------------------------------------------------------


def test_a_heap_gives_the_least_first() -> None:
    """Of few distinct keys, so that many are alike; whole rows go in and out."""
    rng = np.random.default_rng(1)
    for _ in range(40):
        size, count = int(rng.integers(1, 24)), 0
        heap, inside, row = (
            np.zeros((size, SLICE)),
            list[list[float]](),
            np.zeros(SLICE),
        )
        for _ in range(80):
            if count == 0 or (count < size and rng.random() < 0.55):
                added = np.append(rng.integers(0, 6), rng.normal(size=SLICE - 1))
                count = push(heap, count, added)
                inside.append(added.tolist())
            else:
                count = pop(heap, count, row)
                assert row[KEY] == min(one[KEY] for one in inside)
                inside.remove(row.tolist())
            assert count == len(inside)
            assert sorted(heap[:count].tolist()) == sorted(inside)
            for k in range(1, count):
                assert heap[(k - 1) // 2, KEY] <= heap[k, KEY]


# ---- polynomials -----------------------------------------------------------------


def exact_part(control: FloatArray, start: float, end: float) -> list[Fraction]:
    """Control points over [start, end] by the blossom of the polynomial."""
    points, low, high = (
        [Fraction(float(x)) for x in control],
        *map(Fraction, (start, end)),
    )
    found = []
    for k in range(len(points)):
        now = points
        for t in [high] * k + [low] * (len(points) - 1 - k):
            now = [(1 - t) * a + t * b for a, b in pairwise(now)]
        found.append(now[0])
    return found


@pytest.mark.parametrize("degree", [0, 1, 2, 3, 4, 5])
def test_a_polynomial_is_as_large_as_its_control_points(degree: int) -> None:
    rng = np.random.default_rng(degree)
    for start, end in [(0.0, 1.0), (0.0, 0.3), (0.4, 1.0), (0.25, 0.75), (0.5, 0.5)]:
        for _ in range(4):
            control = rng.normal(size=degree + 1) * rng.choice([-1.0, 1.0])
            room = np.append(control, rng.normal(size=2))  # what follows is not read
            most = largest_between(room, degree, start, end)
            truth = [float(x) for x in exact_part(control, start, end)]
            np.testing.assert_allclose(room[: degree + 1], truth, **EXACT)
            assert most == np.abs(room[: degree + 1]).max()


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_columns_are_bounded_by_their_control_points(degree: int) -> None:
    rng, out = np.random.default_rng(degree), np.zeros(3)
    tree = random_tree(rng, 4)
    path = random_path(rng, tree, 4, degree)
    for k in range(3):
        for column in range(tree.n_columns):
            start, end = np.sort(rng.uniform(size=2))
            bound_column(path.packed(), k, column, start, end, out)
            controls = path.controls[k, None, :, column, None]
            for order in range(3):
                # A straight line is bounded over its whole interval.
                ends = (0.0, 1.0) if degree == 1 else (start, end)
                part = bernstein.part(controls, *np.array(ends)[:, None])
                most = np.abs(part).max() if part.size else 0.0
                assert out[order] == pytest.approx(most, rel=1e-12, abs=1e-14)
                controls = bernstein.derivative(controls)
                controls = controls if controls.size else np.zeros((1, 1, 1))


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_rows_are_met_exactly_and_what_lies_between_by_the_polynomial(
    degree: int,
) -> None:
    rng = np.random.default_rng(degree)
    path = random_path(rng, random_tree(rng, 4), 4, degree)
    motion, q = path.packed(), np.zeros(path.knots.shape[1])
    for k in range(3):
        for t, row in ((0.0, k), (1.0, k + 1)):
            interpolate(motion, k, t, q)
            assert np.array_equal(q, path.knots[row])
        for t in (1e-9, 0.3, 0.5, 0.75, 1.0 - 1e-9):
            interpolate(motion, k, t, q)
            found = bernstein.value(path.controls[k, None], np.array([t]))[0]
            np.testing.assert_allclose(q, found, **EXACT)
    knots = rng.normal(size=(2, 40)) * 10.0 ** rng.integers(-6, 6, (2, 40))
    far, all_q = Path(knots).packed(), np.zeros(40)
    for t, row in ((0.0, 0), (1.0, 1)):  # rows whose differences are rounded
        interpolate(far, 0, t, all_q)
        assert np.array_equal(all_q, knots[row])
    for t in (0.0, 0.4, 1.0):  # past the last row everything rests
        interpolate(motion, 3, t, q)
        assert np.array_equal(q, path.knots[3])


# ---- frames ----------------------------------------------------------------------


def random_packed(rng: np.random.Generator, n: int) -> tuple[Tree, FloatArray, Any]:
    """A tree, poses of one row by numpy, and the same as compiled code has them."""
    tree = random_tree(rng, n)
    q = rng.normal(size=tree.n_columns)
    pose = new_pose(tree.n_frames)
    place_tree(pack_tree(tree), q, pose)
    return tree, tree.poses(q[None])[0], pose


def test_points_go_from_frame_to_frame() -> None:
    rng = np.random.default_rng(3)
    for _ in range(30):
        tree, poses, pose = random_packed(rng, 5)
        for frame in range(tree.n_frames):
            at, out, n = rng.normal(size=3), np.zeros(3), rng.normal(size=3)
            place_point(pose, frame, at, out)
            np.testing.assert_allclose(out, (poses[frame] @ [*at, 1.0])[:3], atol=1e-13)
            local_point(pose, frame, out)
            np.testing.assert_allclose(out, at, atol=1e-13)
            back = n.copy()
            turn_back(pose, frame, back)
            np.testing.assert_allclose(back, poses[frame, :3, :3].T @ n, atol=1e-13)


def test_two_frames_stand_where_all_do() -> None:
    rng = np.random.default_rng(4)
    for _ in range(60):
        tree, _, pose = random_packed(rng, int(rng.integers(1, 9)))
        packed, two = pack_tree(tree), new_pose(tree.n_frames)
        q = rng.normal(size=tree.n_columns)
        place_tree(packed, q, pose)
        frames = tuple(rng.integers(0, tree.n_frames, 2).tolist())
        two.origins[1:] = two.frames[1:] = np.nan
        place_two(packed, q, frames, np.zeros(tree.n_frames, np.int64), two)
        needed = {0}
        for now in frames:
            while now:
                needed.add(now)
                now = tree.joints[now - 1].parent  # noqa: PLW2901
        for frame in range(tree.n_frames):
            if frame in needed:
                assert np.array_equal(two.origins[frame], pose.origins[frame])
                assert np.array_equal(two.frames[frame], pose.frames[frame])
            else:
                assert np.isnan(two.origins[frame]).all()


def test_a_point_is_carried_wherever_it_lies_on_its_axes() -> None:
    """Coordinates of 0 are left out; out of n rows no more than n are written."""
    rng = np.random.default_rng(5)
    origins, frames = rng.normal(size=(3, 6)), rng.normal(size=(3, 3, 6))
    for at in np.stack(np.meshgrid(*[[0.0, 0.7]] * 3), axis=-1).reshape(-1, 3):
        out = np.full((3, 6), np.nan)
        carry(origins, frames, at * [1.0, -2.0, 3.0], 4, out)
        truth = origins + np.einsum("ijr,j->ir", frames, at * [1.0, -2.0, 3.0])
        np.testing.assert_allclose(out[:, :4], truth[:, :4], **EXACT)
        assert np.isnan(out[:, 4:]).all()


# ---- ways ------------------------------------------------------------------------


def test_ways_go_on_from_ways_joint_by_joint() -> None:
    rng = np.random.default_rng(6)
    for _ in range(30):
        tree = random_tree(rng, int(rng.integers(1, 9)))
        table, asked = WayTable(pack_tree(tree).parent), {}
        for _ in range(12):
            rest, frame = rng.integers(0, tree.n_frames, 2).tolist()
            number = table.number(rest, frame)
            assert asked.setdefault((rest, frame), number) == number
        ways = table.packed()
        assert len({*zip(ways.rest.tolist(), ways.frame.tolist(), strict=True)}) == len(
            ways.rest
        )
        for (rest, frame), number in asked.items():
            assert (ways.rest[number], ways.frame[number]) == (rest, frame)
            up, down = tree.way(rest, frame)
            steps, way = [], number
            while ways.before[way] >= 0:
                assert ways.before[way] < way
                assert ways.rest[ways.before[way]] == rest
                steps.append((int(ways.joint[way]), bool(ways.up[way])))
                way = int(ways.before[way])
            assert (ways.frame[way], ways.joint[way], ways.up[way]) == (rest, -1, False)
            expected = [(j, True) for j in up] + [(j, False) for j in down]
            assert steps[::-1] == expected


def errors_of(
    tree: Tree, box: ErrorBox, reach: FloatArray, rest: int, frame: int
) -> Any:
    """What errors come to along a way, by the sums of docs/certificate.md.

    Returns:
        erring, turned, shifted, second, crude and swing.
    """
    erring = turned = shifted = second = crude = swing = 0.0
    up, down = tree.way(rest, frame)
    last, met = None, False  # the joint before, and whether it has met another one
    for j, upwards in [*((j, True) for j in up), *((j, False) for j in down)]:
        joint = tree.joints[j]
        lever = float(np.linalg.norm(np.asarray(joint.placement)[:3, 3]))
        turn = box.joints[j] if joint.kind is Kind.REVOLUTE else 0.0
        if not upwards:
            second += 0.5 * lever * turned**2
            crude += lever * swing
        added, meets = turn + box.tilts[j], False
        if (
            last is not None
            and not upwards
            and not last[1]
            and lever == 0.0
            and not met
        ):
            before = tree.joints[last[0]]
            if joint.kind is before.kind is Kind.REVOLUTE:
                axis = np.asarray(joint.placement)[:3, :3] @ np.asarray(joint.axis)
                cosine = min(1.0, abs(float(np.asarray(before.axis) @ axis)))
                one, meets = box.joints[last[0]], cosine < 1.0
                both = one**2 + turn**2 + 2.0 * cosine * one * turn
                added += (both**0.5 - one - turn) if meets else 0.0
        erring, turned = erring + turn, turned + turn + box.tilts[j]
        swing += added
        if upwards:
            second += 0.5 * lever * turned**2
            crude += lever * swing
        shifted += box.shifts[j]
        if joint.kind is Kind.PRISMATIC:
            stroke = abs(joint.offset)
            if joint.column is not None:
                stroke += abs(joint.ratio) * reach[joint.column]
            shifted += box.joints[j]
            second += 0.5 * stroke * turned**2
            crude += stroke * swing
        last, met = (j, upwards), meets
    return erring, turned, shifted, second, crude, swing


def test_errors_along_ways_are_the_sums_of_the_formula() -> None:
    rng = np.random.default_rng(7)
    for _ in range(80):
        tree = random_tree(rng, int(rng.integers(1, 9)))
        n, reach = len(tree.joints), rng.uniform(0.1, 2.0, tree.n_columns)
        box = ErrorBox(*(rng.choice([0.0, 0.3, 0.7], (3, n)) * rng.uniform(size=n)))
        packed, table = pack_tree(tree, reach), WayTable(pack_tree(tree).parent)
        for rest in range(tree.n_frames):
            for frame in range(tree.n_frames):
                table.number(rest, frame)
        ways = table.packed()
        found = errors_along(packed, ways, box.joints, box.shifts, box.tilts)
        turning = [j.kind is Kind.REVOLUTE for j in tree.joints]
        assert np.array_equal(found.turn, np.where(turning, box.joints, 0.0))
        assert np.array_equal(found.tilt, box.tilts)
        assert found.any_turn == bool(found.turn.any() or box.tilts.any())
        for way in range(len(ways.rest)):
            ends = int(ways.rest[way]), int(ways.frame[way])
            sums = (found.erring, found.turned, found.shifted)
            more = (found.second, found.crude, found.swing)
            np.testing.assert_allclose(
                [x[way] for x in (*sums, *more)],
                errors_of(tree, box, reach, *ends), **EXACT,
            )  # fmt: skip


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_a_slice_bends_as_the_whole_interval_of_a_path_cut_there(degree: int) -> None:
    """M, W, A and D of a slice: those of the same motion with the slice as interval.

    Rates are by the whole interval's time; at no length and past the end all rest.
    """
    rng = np.random.default_rng([8, degree])
    for _ in range(12):
        tree = random_tree(rng, int(rng.integers(1, 9)))
        path = random_path(rng, tree, 3, degree)
        frame, rest = rng.choice(tree.n_frames, 2, replace=False).tolist()
        bodies = [
            Body(frame, (Hull(np.ones((1, 3))),)),
            Body(rest, (Hull(np.zeros((1, 3))),)),
        ]
        table = PairTable.of([Pair(0, 1)])
        task = pack_task(tree, bodies, table, RULES, path.reach)
        task = with_errors(task, random_box(rng, tree))
        way, n = int(task.pairs.way[0]), len(task.ways.rest)
        found, whole = new_bends(n, tree.n_frames), new_bends(n, tree.n_frames)
        start, end = np.sort(rng.uniform(size=2))
        if degree == 1:
            start, end = 0.0, 1.0
        bend_between(task, path.packed(), found, way, 1, start, end)
        piece = bernstein.part(path.controls[1:2], *np.array([start, end])[:, None])
        alone = Path(piece[0, [0, -1]], piece[:, 1:-1])
        bend_between(task, alone.packed(), whole, way, 0, 0.0, 1.0)
        h = end - start
        for one, other, power in zip(found[:4], whole[:4], (2, 1, 2, 1), strict=True):
            np.testing.assert_allclose(
                one[way] * h**power, other[way], rtol=1e-9, atol=1e-13
            )
        for k, s, e in ((2, 0.0, 1.0), (1, 0.5, 0.5)):
            for part in found[:4]:
                part[:] = 7.0
            bend_between(task, path.packed(), found, way, k, s, e)
            on_way = way
            while on_way >= 0:
                assert not any(part[on_way] for part in found[:4])
                on_way = int(task.ways.before[on_way])
        for part in found[:4]:
            part[:] = 7.0
        stay(task.ways, found, way)
        assert not any(part[way] for part in found[:4])


@pytest.mark.parametrize("degree", [3, 5])
def test_a_slice_loads_the_body_of_a_path_cut_there(degree: int) -> None:
    """Corners, generators of errors and balls, of any length of the slice."""
    rng = np.random.default_rng([14, degree])
    for _ in range(16):
        tree = random_tree(rng, int(rng.integers(1, 9)))
        path = random_path(rng, tree, 3, degree)
        frame, rest = rng.choice(tree.n_frames, 2, replace=False).tolist()
        corners = rng.uniform(-0.3, 0.3, (int(rng.integers(1, 5)), 3))
        bodies = [Body(frame, (Hull(corners, 0.03),)), Body(rest, (Hull(corners[:1]),))]
        task = pack_task(tree, bodies, PairTable.of([Pair(0, 1)]), RULES, path.reach)
        task = with_errors(task, random_box(rng, tree))
        start, end = np.sort(rng.uniform(size=2))
        piece = bernstein.part(path.controls[1:2], *np.array([start, end])[:, None])
        alone, row = Path(piece[0, [0, -1]], piece[:, 1:-1]), np.zeros(SLICE)
        loaded = []
        for motion, slice_ in ((path, (1.0, 0.0, start, end)), (alone, (0, 0, 0, 1))):
            ends = new_ends(tree.n_frames, len(task.ways.rest), tree.n_columns)
            space = new_space(len(tree.joints), len(corners))
            row[INTERVAL:] = slice_
            place_pair(search.Slicing(task, motion.packed(), ends, space), row)
            load_body(task, mover_in(task, 0), ends, space.body, row[END] - row[START])
            loaded.append(space.body)
        one, other = loaded
        n, sizes = len(corners), other.sizes.tolist()
        assert one.used.tolist() == other.used.tolist() == [2 * n, n]
        assert one.sizes.tolist() == sizes
        np.testing.assert_allclose(one.points, other.points, rtol=0, atol=1e-12)
        for a, b, size in zip(one.swings, other.swings, sizes, strict=True):
            np.testing.assert_allclose(a[:size], b[:size], rtol=0, atol=1e-12)
        np.testing.assert_allclose(one.balls, other.balls, rtol=1e-9, atol=1e-13)


# ---- what is remembered of blocks --------------------------------------------------


def pair_task(groups: tuple[int, ...]) -> Task:
    """Pairs of a ball on frame 1 with bodies at rest, or of its own branch."""
    tree = Tree(free_joints(2))
    bodies = [Body(2, (Hull(np.zeros((1, 3)), 0.1),))]
    bodies += [
        Body(0 if group == ACROSS else 1, (Hull(np.full((1, 3), 2.0)),))
        for group in groups
    ]
    table = PairTable.of([Pair(0, 1 + k) for k in range(len(groups))])
    columns = np.array([0, *(1 + np.arange(len(groups)))])
    return pack_task(tree, bodies, table, RULES, np.ones(2), columns)


def free_joints(n: int) -> tuple[Any, ...]:
    return tuple(Joint(k, Kind.REVOLUTE, column=k) for k in range(n))


def test_values_below_a_bar_are_seen_wherever_they_stand() -> None:
    for k in range(4):
        values = np.ones(4)
        values[k] = 0.5
        assert any_below(values, 0.75) and not any_below(values, 0.5)
    assert not any_below(np.full(3, np.nan), 1.0)


def test_the_first_least_values_and_their_intervals_are_kept() -> None:
    least, at = np.array([1.0, np.inf, 2.0]), np.array([5, 6, 7])
    keep_least(np.array([0.5, 3.0, 2.0]), np.array([8, 9, 10]), least, at)
    assert least.tolist() == [0.5, 3.0, 2.0]
    assert at.tolist() == [8, 9, 7]


def test_the_least_upper_bound_is_kept_with_the_nearer_row() -> None:
    rng = np.random.default_rng(9)
    for _ in range(200):
        runs, best = new_runs(1, 64), np.full(OTHER + 3, 7.0)
        runs.upper[:] = rng.integers(0, 5, len(runs.upper))
        runs.at_rows[:] = rng.integers(0, 3, len(runs.at_rows))
        first, last = np.sort(rng.choice(30, 2, replace=False)).tolist()
        best[UP], points = float(rng.integers(0, 4)), rng.normal(size=6)
        before, part = best.copy(), runs.upper[first:last]
        note_upper(best, runs, points, 100, first, last)
        if not part.min() < before[UP]:
            assert np.array_equal(best, before)
            continue
        at = first + int(np.argmin(part))
        assert (best[UP], best[AT_UPPER]) == (part.min(), 100 + at)
        assert best[TIME] == float(runs.at_rows[at + 1] < runs.at_rows[at])
        assert np.array_equal(best[OWN:], points)
        assert np.array_equal(best[:UP], before[:UP])


@pytest.mark.parametrize("profile", [10**6, 30])
@pytest.mark.parametrize("room", [1, 3, 8, 64])
def test_blocks_are_noted_as_by_a_list_of_them(room: int, profile: int) -> None:
    """Best rows, the profile and candidates, where some find no room."""
    rng, groups = np.random.default_rng([10, room]), (ACROSS, WITHIN, ACROSS)
    task, n_intervals = pair_task(groups), 40
    for _ in range(12):
        found = new_results(3, 4, n_intervals, Budget(profile=profile, candidates=room))
        stride = found.stride
        assert stride == max(1, -(-n_intervals * 4 * 2 // profile))
        assert found.profile.shape == (2, 4, -(-n_intervals // stride))
        bins, noted, dropped = np.full(found.profile.shape, np.inf), [], 0
        for _ in range(60):
            pair, first = int(rng.integers(3)), int(rng.integers(n_intervals - 4))
            size = int(rng.integers(1, 5))
            lower, upper = np.sort(rng.integers(-3, 9, (2, size)), axis=0).astype(float)
            found.limit[rng.integers(2)] = rng.integers(0, 9)
            limit, best = found.limit[groups[pair]], found.best[pair].copy()
            held = int(found.tally[CANDIDATES])
            before, over = candidates(found), found.overflow.copy()
            note_block(task, found, pair, first, lower, upper)
            for column in (0, 1 + pair) if groups[pair] == ACROSS else ():
                for r in range(size):
                    at = (first + r) // stride
                    bins[:, column, at] = np.minimum(
                        bins[:, column, at], [lower[r], upper[r]]
                    )
            np.testing.assert_array_equal(found.profile, bins)
            if lower.min() < best[LOW]:
                best[LOW], best[AT_LOWER] = lower.min(), first + np.argmin(lower)
            np.testing.assert_array_equal(found.best[pair], best)
            after, row = candidates(found), (lower.min(), first, size, pair)
            if not lower.min() < limit - RULES.gap:
                assert after == before and np.array_equal(found.overflow, over)
                continue
            if held == room and dropped % max(1, room // 4) == 0:
                bar = found.limit - RULES.gap
                before = [one for one in before if one[0] < bar[groups[one[3]]]]
            dropped += held == room
            assert found.tally[LOST] == dropped
            if len(before) < room:
                before.append(row)
            else:
                over[groups[pair]] = min(over[groups[pair]], row[0])
            assert after == before and len(after) <= room
            assert np.array_equal(found.overflow, over)
            noted.append(row)
        assert noted


def candidates(found: Results) -> list[tuple[float, int, int, int]]:
    """Those held: least bound, first interval, size and pair."""
    held, n = found.candidates, int(found.tally[CANDIDATES])
    parts = (held.lower, held.first, held.size, held.pair)
    return [*zip(*(part[:n].tolist() for part in parts), strict=True)]


def test_room_is_for_as_many_as_are_asked() -> None:
    assert {part.shape for part in room_for(5)} == {(5,)}
    assert new_results(2, 1, 3, Budget()).candidates.lower.size == 6
    assert new_results(2, 1, 3, Budget(candidates=4)).candidates.lower.size == 4
    task = pair_task((ACROSS,))
    found = new_results(1, 2, 3, Budget(candidates=0))
    nominate(task, found, 0, 0, np.array([0.5, 0.25]))
    assert found.overflow.tolist() == [0.25, np.inf]


def test_a_held_clearance_falls_as_the_body_moves() -> None:
    rng = np.random.default_rng(12)
    task = pair_task((ACROSS,))
    for corners in (1, 2, 4):
        tracks, body = new_tracks(corners + 2, 64), loaded_body(2 * corners, corners, 1)
        tracks.places[:] = rng.normal(size=tracks.places.shape)
        tracks.sags[:] = rng.uniform(size=tracks.sags.shape)
        body.points[:] = rng.normal(size=body.points.shape)
        body.used[:] = 2 * corners, corners
        plane = np.zeros(HELD_AT + 3 * corners)
        cache_clearance(plane, 5.0, body)
        assert plane[HELD_CLEARANCE] == 5.0
        ends = body.points[corners : 2 * corners]
        assert np.array_equal(plane[HELD_AT:], ends.ravel())
        slots = rng.permutation(corners + 2)[:corners]
        mover = mover_in(task, 0)._replace(slots=slots)
        for first, last in ((0, 1), (3, 9), (0, 64)):
            lower = rng.uniform(0.0, 4.0, 64)
            away = np.linalg.norm(tracks.places[slots] - ends[:, :, None], axis=1)
            far = np.maximum(away[:, 1:], away[:, :-1]).max(axis=0)
            truth, span = lower.copy(), slice(first, last)
            fallen = 5.0 - far - tracks.sags[slots].max(axis=0)
            truth[span] = np.maximum(lower[span], fallen[span])
            raise_to_held(mover, tracks, plane, first, last, lower)
            np.testing.assert_allclose(lower, truth, **EXACT)


def test_one_plane_bounds_few_and_many_rows_alike() -> None:
    """Of few intervals of many corners it goes corner by corner."""
    rng, task = np.random.default_rng(13), pair_task((ACROSS,))
    for corners in (1, 2, 3, 17, 24):
        tracks, made = new_tracks(corners + 2, 64), new_runs(corners, 64)
        tracks.places[:] = rng.normal(size=tracks.places.shape)
        tracks.sags[:] = rng.uniform(size=tracks.sags.shape)
        made.growth[:] = rng.uniform(size=made.growth.shape)
        slots = rng.permutation(corners + 2)[:corners]
        mover = mover_in(task, 0)._replace(slots=slots, lost=0.25)
        plane = rng.normal(size=HELD_AT)
        for first, last in ((0, 1), (3, 9), (20, 36), (0, 64)):
            made.lower[:] = 7.0
            bound_below(mover, tracks, made, plane, first, last)
            along = np.einsum("c,kcr->kr", plane[:3], tracks.places[slots])
            most = np.maximum(along[:, 1:], along[:, :-1]) + tracks.sags[slots]
            truth, span = np.full(64, 7.0), slice(first, last)
            truth[span] = plane[SUPPORT] - 0.25 - (most + made.growth).max(axis=0)[span]
            np.testing.assert_allclose(made.lower[:64], truth, **EXACT)


# ---- versions, witnesses, sizes ----------------------------------------------------


@pytest.mark.parametrize("seed", range(4))
def test_of_many_pieces_the_bound_is_the_least_but_for_half_of_the_slack(
    seed: int,
) -> None:
    """Where that is enough, else the least of all."""
    rng = np.random.default_rng([14, seed])
    tree, away = Tree(free_joints(1)), rng.normal(size=(40, 3))
    balls = tuple(Hull(3.0 * one[None] / np.linalg.norm(one), 0.1) for one in away)
    balls += tuple(Hull(1.02 * ball.points, 0.1) for ball in balls)
    bodies = [Body(1, (Hull(0.3 * unit(rng)[None], 0.2),)), Body(0, balls)]
    rules = RULES._replace(slack=0.2)
    task = pack_task(tree, bodies, PairTable.of([Pair(0, 1)]), rules, np.ones(1))
    space, ends = new_space(1, 1), new_ends(2, len(task.ways.rest), 1)
    place_tree(task.tree, np.zeros(1), ends.start)
    load_body(task, mover_in(task, 0), ends, space.body, 0.0)
    own = bodies[0].pieces[0].points[0]
    gaps = [np.linalg.norm(ball.points[0] - own) - 0.3 for ball in balls]
    least, eased = min(gaps), 0
    for enough in (-1.0, 0.5 * least, 0.97 * least, np.inf):
        space.out[:] = 0.0
        space.out[NORMAL] = 1.0
        loaded_bound(task, space, 0, False, enough)
        found = space.out[LOWER]
        assert found <= least + 1e-9
        part = least if enough > least else max(enough, (1.0 - 0.5 * 0.2) * least)
        assert found >= part - 1e-8
        eased += found < least - 1e-6
    assert eased


def test_versions_go_from_the_roughest_to_the_pair_itself() -> None:
    task = pair_task((ACROSS,) * 3)
    assert task.pairs.rough.shape == (3, 0)
    assert not task.pairs.loose.any()
    rough = np.array([[3, 4, 5], [-1, 6, 7], [-1, -1, -1]])
    pairs = task.pairs._replace(rough=rough)
    for pair, way in ((0, [3, 4, 5, 0]), (1, [6, 7, 1]), (2, [2])):
        row = pair
        for expected in way:
            row = finer(pairs, pair, row)
            assert row == expected


def test_witnesses_lie_on_both_surfaces() -> None:
    """Of segments the nearest point of the axis; of others the point that is told."""
    rng = np.random.default_rng(13)
    for _ in range(60):
        tree, poses, pose = random_packed(rng, 4)
        frame, rest = rng.choice(tree.n_frames, 2, replace=False).tolist()
        radius, count = float(rng.uniform(0.0, 0.2)), int(rng.integers(1, 4))
        corners = rng.normal(size=(count, 3))
        solid: Any = Hull(corners, radius)
        if rng.integers(4) == 0:
            solid, radius = FlatCylinder(corners[0], unit(rng), 0.2, 0.1), 0.0
        bodies = [Body(frame, (solid,)), Body(rest, (Hull(np.zeros((1, 3))),))]
        task = pack_task(tree, bodies, PairTable.of([Pair(0, 1)]), RULES)
        mover, points = mover_in(task, 0), rng.normal(size=6)
        own, other = np.zeros(3), np.zeros(3)
        witness_at(mover, pose, points, own, other)
        inverse = mover.inverse
        if isinstance(solid, FlatCylinder) or count > 2:
            assert inverse == -1.0
        else:
            long = float(((corners[-1] - corners[0]) ** 2).sum())
            assert inverse == pytest.approx(1.0 / long if long else 0.0)
        there = (poses[rest] @ [*points[3:], 1.0])[:3]
        np.testing.assert_allclose(other, there, atol=1e-13)
        core = (poses[frame] @ [*points[:3], 1.0])[:3]
        if inverse >= 0.0:
            a, b = ((poses[frame] @ [*p, 1.0])[:3] for p in (corners[0], corners[-1]))
            t = (there - a) @ (b - a) / max(1e-300, (b - a) @ (b - a))
            core = a + np.clip(t, 0.0, 1.0) * (b - a)
        gap = np.linalg.norm(there - core)
        truth = core + radius * (there - core) / gap
        np.testing.assert_allclose(own, truth, atol=1e-12)
        local = points[3:].copy()
        to_body(mover, pose, local)
        back = np.linalg.inv(poses[frame]) @ poses[rest] @ [*points[3:], 1.0]
        np.testing.assert_allclose(local, back[:3], atol=1e-12)
    same = np.concatenate(
        [corners[0], (np.linalg.inv(poses[rest]) @ core_of(poses, frame, corners))[:3]]
    )
    task = pack_task(
        tree,
        [Body(frame, (Hull(corners[:1], 0.1),)), Body(rest, (Hull(np.zeros((1, 3))),))],
        PairTable.of([Pair(0, 1)]), RULES,
    )  # fmt: skip
    witness_at(mover_in(task, 0), pose, same, own, other)
    np.testing.assert_allclose(own, other, atol=0.1 + 1e-12)


def core_of(poses: FloatArray, frame: int, corners: FloatArray) -> FloatArray:
    return np.asarray(poses[frame] @ [*corners[0], 1.0])


def test_rounding_grows_with_what_is_far() -> None:
    extent, pad = TOLERANCES.scene_extent, TOLERANCES.arithmetic
    assert rounding_pad(0.0) == rounding_pad(extent) == pad
    assert rounding_pad(3.0 * extent) == pytest.approx(3.0 * pad)
    rules = Budget(slack=0.5, until=7.0, far=3.0).rules(0.25)
    told = (TOLERANCES.bracket_gap, TOLERANCES.least_bracket)
    assert rules == Rules(True, True, 0.25, *told, 0.5, 7.0, 3.0)


def test_the_worst_of_verdicts_is_refuted() -> None:
    assert RANK[CERTIFIED] < RANK[UNDECIDED] < RANK[REFUTED]
    assert RANK[RANK].tolist() == [CERTIFIED, REFUTED, UNDECIDED]


@pytest.mark.parametrize("size", [5, PAGES])
def test_zeros_by_the_page_are_zeros_to_write_to(size: int) -> None:
    found, usual = paged_zeros(size, 2), np.zeros((size, 2))
    assert (found.dtype, found.strides) == (usual.dtype, usual.strides)
    assert found.flags.num & 0x501 == usual.flags.num & 0x501  # as compiled code asks
    np.testing.assert_array_equal(found, usual)
    found[-1] = 1.0
    assert found.sum() == 2.0
    with pytest.raises(MemoryError):
        paged_zeros(1 << 46)
