"""Oracle: poses of motions drawn from the slice and the error box of random trees."""

from dataclasses import dataclass

import numpy as np
import pytest
from oracles.tree_queries import random_box, random_path, random_tree, wrong_poses
from some_slow import few_of

from vdsm_pin.arm.kinematics import arm_tree
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import body_reach
from vdsm_pin.geometry.convex import FlatCylinder, Hull
from vdsm_pin.proof.bends import bend_between
from vdsm_pin.proof.bodies import Body, ErrorBox, Pair, PairTable
from vdsm_pin.proof.error_growth import crude_growth
from vdsm_pin.proof.motions import interpolate
from vdsm_pin.proof.packed_tree import place_tree
from vdsm_pin.proof.packing import pack_task, with_errors
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.plane_bounds import place_disc
from vdsm_pin.proof.row_places import fill_rows
from vdsm_pin.proof.slices import Space
from vdsm_pin.proof.swept_bodies import load_body
from vdsm_pin.proof.terms import Rules, Task, mover_of
from vdsm_pin.proof.tree import Joint, Kind, Tree
from vdsm_pin.proof.workspace import Workspace, load_rows, new_workspace

RULES = Rules(True, True, 1e-11, 1e-9, 1e-6, 0.02, np.inf)
DEGREES = (1, 3, 5)


@dataclass(frozen=True)
class Case:
    """A body that moves in the frame of its partner."""

    tree: Tree
    path: Path
    box: ErrorBox
    task: Task
    points: FloatArray
    frame: int
    rest: int

    def seen(self, q: FloatArray, rng: np.random.Generator) -> FloatArray:
        """Points of the body at q, with errors of the box, in the partner's frame."""
        # Shifts cost every plane the same: they are no part of the body.
        poses = wrong_poses(self.tree, q, self.box, rng, shifting=False)
        seen = np.linalg.inv(poses[self.rest]) @ poses[self.frame]
        return np.asarray(self.points @ seen[:3, :3].T + seen[:3, 3])


def random_case(rng: np.random.Generator, degree: int) -> Case:
    """A tree, a body on one of its frames, and a partner on another."""
    tree = random_tree(rng, int(rng.integers(1, 13)))
    frame, rest = rng.choice(tree.n_frames, 2, replace=False).tolist()
    corners = rng.uniform(-0.3, 0.3, (int(rng.integers(1, 5)), 3))
    corners *= rng.choice([0.0, 1.0], (len(corners), 1), p=[0.2, 0.8])
    solid: Hull | FlatCylinder = Hull(corners)
    if rng.integers(4) == 0:
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        solid = FlatCylinder(corners[0], axis, 0.1, 0.05)
        across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
        across /= np.linalg.norm(across)
        turn = np.linspace(0.0, 2.0 * np.pi, 40)[:, None]
        rim = 0.05 * (np.cos(turn) * across + np.sin(turn) * np.cross(axis, across))
        corners = corners[0] + np.concatenate([rim + 0.1 * axis, rim - 0.1 * axis])
    bodies = [Body(frame, (solid,)), Body(rest, (Hull(np.zeros((1, 3))),))]
    path = random_path(rng, tree, 2, degree)
    box, table = random_box(rng, tree), PairTable.of([Pair(0, 1)])
    task = with_errors(pack_task(tree, bodies, table, RULES, path.reach), box)
    return Case(tree, path, box, task, corners, frame, rest)


def at(case: Case, work: Workspace, t: float) -> FloatArray:
    """The nominal configuration at a time of the only interval."""
    q = np.zeros(case.tree.n_columns)
    interpolate(case.path.packed(), 0, t, q)
    return q


def load_slice(case: Case, work: Workspace, start: float, end: float) -> Space:
    """The body over a slice, as subdivision loads it."""
    task, motion, ends = case.task, case.path.packed(), work.ends
    place_tree(task.tree, at(case, work, start), ends.start)
    place_tree(task.tree, at(case, work, end), ends.end)
    way = int(task.pairs.way[0])
    bend_between(task, motion, ends.bends, way, 0, start, end)
    load_body(task, mover_of(task, 0), ends, work.space.body, end - start)
    return work.space


def load_block(case: Case, work: Workspace) -> Space:
    """The body over the whole interval, as blocks load it."""
    task, mover = case.task, mover_of(case.task, 0)
    fill_rows(task, case.path.packed(), work.rows, 0, 1)
    place_disc(mover, work.rows, work.runs, 1)
    load_rows(task, mover, work, 0, 1)
    return work.space


def normals(rng: np.random.Generator, n: int) -> FloatArray:
    n_rows = rng.normal(size=(n, 3))
    return np.asarray(n_rows / np.linalg.norm(n_rows, axis=1)[:, None])


@pytest.mark.parametrize("degree", DEGREES)
@pytest.mark.parametrize("seed", range(2))
def test_no_motion_of_the_box_leaves_the_body(degree: int, seed: int) -> None:
    check_motions(degree, seed)


@pytest.mark.slow
@pytest.mark.parametrize("degree", DEGREES)
@pytest.mark.parametrize("seed", range(2, 40))
def test_no_motion_of_many_more_boxes_leaves_the_body(degree: int, seed: int) -> None:
    check_motions(degree, seed)


def check_motions(degree: int, seed: int) -> None:
    rng = np.random.default_rng([degree, seed])
    for _ in range(20):
        case = random_case(rng, degree)
        work = new_workspace(case.task, case.tree.n_columns, 1)
        start, end = np.sort(rng.uniform(size=2))
        slices = [(0.0, 1.0, load_block), (0.0, 1.0, None), (start, end, None)]
        for first, last, load in [*slices, (start, start, None)]:
            space = load(case, work) if load else load_slice(case, work, first, last)
            directions = normals(rng, 20)
            reach = np.array([body_reach(space.body, *n) for n in directions])
            for t in np.append(rng.uniform(first, last, 12), [first, last]):
                seen = case.seen(at(case, work, t), rng)
                most = (directions @ seen.T).max(axis=1)
                assert (most <= reach + 1e-11).all()


def straight() -> Case:
    """A point that turns at a constant rate, little of it."""
    tree = Tree((Joint(0, Kind.REVOLUTE, column=0),))
    return corner_case(tree, Path(np.array([[0.0], [0.2]])))


def curved(degree: int) -> Case:
    """A point that is pushed at a constant acceleration."""
    tree = Tree((Joint(0, Kind.PRISMATIC, column=0),))
    q, times = np.zeros((2, 1)), np.array([0.0, 1.0])
    rates, changes = np.array([[-0.5], [0.5]]), np.ones((2, 1))
    if degree == 3:
        return corner_case(tree, Path.through(q, times, rates))
    return corner_case(tree, Path.through(q, times, rates, changes))


def corner_case(tree: Tree, path: Path) -> Case:
    """One corner on frame 1, seen from the world."""
    corner = np.array([[1.0, 0.0, 0.0]])
    bodies = [Body(1, (Hull(corner),)), Body(0, (Hull(np.zeros((1, 3))),))]
    task = pack_task(tree, bodies, PairTable.of([Pair(0, 1)]), RULES, path.reach)
    none = ErrorBox(*np.zeros((3, len(tree.joints))))
    return Case(tree, path, none, task, corner, 1, 0)


@pytest.mark.parametrize("case", [straight(), curved(3), curved(5)])
@pytest.mark.parametrize(("share", "caught"), [(1.0, False), (0.9, True)])
def test_nine_tenths_of_the_curvature_would_be_caught(
    case: Case, share: float, caught: bool
) -> None:
    rng = np.random.default_rng(0)
    work, left = new_workspace(case.task, case.tree.n_columns, 1), False
    space, x, along = load_slice(case, work, 0.0, 1.0), np.eye(3)[0], np.eye(3)[2]
    half = np.array([np.cos(0.1), np.sin(0.1), 0.0])  # where the turn is halfway
    directions = np.concatenate([[x, along, -along, half], normals(rng, 20)])
    space.body.balls[:] *= share
    reach = np.array([body_reach(space.body, *n) for n in directions])
    for t in np.linspace(0.0, 1.0, 21):
        seen = case.seen(at(case, work, t), rng)
        left |= bool(((directions @ seen.T).max(axis=1) > reach + 1e-11).any())
    assert left == caught


def test_blocks_and_slices_load_the_same_body() -> None:
    rng = np.random.default_rng(5)
    for _ in range(100):
        case = random_case(rng, int(rng.choice(DEGREES)))
        work = new_workspace(case.task, case.tree.n_columns, 1)
        directions = normals(rng, 20)
        space = load_slice(case, work, 0.0, 1.0)
        one = [body_reach(space.body, *n) for n in directions]
        space = load_block(case, work)
        other = [body_reach(space.body, *n) for n in directions]
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("seed", range(3))
def test_the_body_is_as_small_as_the_first_order_allows(seed: int) -> None:
    """Errors along the gradient, found by differences, come near its support."""
    rng, step = np.random.default_rng([9, seed]), 1e-6
    for _ in range(20):
        case = random_case(rng, 1)
        if case.task.bodies.discs[0, 3] > 0.0:
            continue  # what errors do to a disc is bounded by its size alone
        error = np.where([j.kind is Kind.REVOLUTE for j in case.tree.joints], 1e-5, 0.0)
        blank = np.zeros(len(error))
        task = with_errors(case.task, ErrorBox(error, blank, blank))
        case = Case(
            case.tree, case.path, case.box, task, case.points, case.frame, case.rest
        )
        work = new_workspace(task, case.tree.n_columns, 1)
        space, n = load_slice(case, work, 0.0, 0.0), normals(rng, 1)[0]
        q = at(case, work, 0.0)

        def reach(push: FloatArray, case: Case = case, q: FloatArray = q) -> FloatArray:
            joints = [
                type(joint)(
                    joint.parent, joint.kind, joint.axis, joint.placement, joint.column,
                    joint.ratio, joint.offset + more,
                )
                for joint, more in zip(case.tree.joints, push, strict=True)
            ]  # fmt: skip
            poses = Tree(tuple(joints)).poses(q[None])[0]
            seen = np.linalg.inv(poses[case.rest]) @ poses[case.frame]
            return np.asarray(case.points @ seen[:3, :3].T + seen[:3, 3])

        unit = step * np.eye(len(error))
        slopes = np.array([(reach(u) - reach(-u)) @ n for u in unit]) / (2.0 * step)
        grown = (np.abs(slopes) * error[:, None]).sum(axis=0)
        best = (reach(blank) @ n + grown).max()
        assert body_reach(space.body, *n) == pytest.approx(best, abs=2e-7)


@pytest.mark.parametrize("seed", few_of(3, 1))
def test_the_crude_growth_is_above_every_exact_one(seed: int) -> None:
    """Of a point, in any direction; for an arm of yaws and pitches not by much."""
    rng, nearest = np.random.default_rng([11, seed]), np.inf
    arm = arm_tree(built_in("hrm8"))
    for k in range(200):
        case = random_case(rng, 1)
        if k % 4 == 0:
            frame = int(rng.integers(6, arm.n_frames))
            bodies = [Body(frame, (Hull(rng.normal(size=(1, 3))),))]
            bodies.append(Body(0, (Hull(np.zeros((1, 3))),)))
            path = random_path(rng, arm, 2, 1)
            pair = PairTable.of([Pair(0, 1)])
            task = pack_task(arm, bodies, pair, RULES, path.reach)
            task = with_errors(task, random_box(rng, arm))
            case = Case(arm, path, case.box, task, case.points, frame, 0)
        task, n = case.task, normals(rng, 1)[0]
        work = new_workspace(task, case.tree.n_columns, 1)
        body = load_slice(case, work, 0.0, 0.0).body
        core = work.space.core
        mover = mover_of(task, 0)
        grown = body_reach(body, *n) - body_reach(core, *n)
        crude = [
            crude_growth(task.errors, task.places.way[place], task.places.lever[place])
            for place in mover.slots
        ]
        assert max(crude) >= grown - 1e-15
        if k % 4 == 0 and grown > 1e-6:
            nearest = min(nearest, max(crude) / grown)
    assert nearest < 2.0
