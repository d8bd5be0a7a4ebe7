"""Pairs that boxes settle, number by number; oracle: the same by loops in numpy."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from oracles.plain import plain
from oracles.tree_queries import clearances, random_path, random_tree, unit

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.proof import boxes, broad_phase, far_pairs, row_places
from vdsm_pin.proof.bodies import Body, ErrorBox, Pair, PairTable
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.layouts import AT_LOWER, AT_UPPER, LOW, OTHER, OWN, TIME, UP
from vdsm_pin.proof.packing import pack_task, with_errors
from vdsm_pin.proof.pair_sweep import LOOSELY, Block
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.proving import dense_rows, new_results
from vdsm_pin.proof.terms import ACROSS, CERTIFIED, UNDECIDED, Rules, Task
from vdsm_pin.proof.tree import Joint, Kind, Tree
from vdsm_pin.proof.workspace import new_workspace

PAD = 1e-11
RULES = Rules(True, True, PAD, 1e-9, 1e-6, 0.02, np.inf)
BLOCKS = ((0, 4), (4, 3))
CLOSE: dict[str, Any] = {"rtol": 0.0, "atol": 1e-8}

fill_rows, settle_far = plain(row_places.fill_rows), plain(broad_phase.settle_far)
merge_far, body_box = plain(far_pairs.merge_far), plain(boxes.body_box)
new_broad_phase = plain(far_pairs.new_broad_phase)


class Case(NamedTuple):
    """Balls at rest, then capsules that move; some pairs of them."""

    tree: Tree
    path: Path
    bodies: list[Body]
    pairs: list[Pair]
    columns: Any
    task: Task
    n_obstacles: int


def random_case(rng: np.random.Generator, nominal: bool, n_obstacles: int) -> Case:
    """Some are near, some far; the last body at rest and one that moves have no pair.

    The third body that moves is asked against another one that moves alone.
    """
    arm = random_tree(rng, int(rng.integers(2, 5)))
    arm = arm.joined(Tree((Joint(0, Kind.PRISMATIC, column=0),)))
    bodies = []
    for o in range(n_obstacles):
        away = unit(rng) * (rng.choice([1.0, 4.0, 8.0, 9.0]) if o else 40.0)
        bodies.append(Body(0, (Hull(away[None], float(rng.uniform(0.05, 0.3))),)))
    for frame in (
        arm.n_frames - 2,
        int(rng.integers(1, arm.n_frames - 1)),
        arm.n_frames - 1,
    ):
        ends = rng.uniform(-0.2, 0.2, (2, 3))
        bodies.append(Body(frame, (Hull(ends, float(rng.uniform(0.01, 0.1))),)))
    pairs = [
        Pair(n_obstacles + b, o, float(rng.choice([0.0, 0.5, 6.0])))
        for b in range(2)
        for o in range(n_obstacles - 1)
        if o in (0, 1) or rng.random() < 0.8
    ]
    pairs.insert(1, Pair(n_obstacles + 2, n_obstacles, 0.1))
    columns = np.append(
        rng.permutation(n_obstacles) - 1, n_obstacles + np.arange(-1, 2)
    )
    path = random_path(rng, arm, 8, int(rng.choice([1, 3])))
    n = len(arm.joints)
    shifts = np.zeros(n) if nominal else np.full(n, 0.01)
    task = pack_task(arm, bodies, PairTable.of(pairs), RULES, path.reach, columns)
    task = with_errors(task, ErrorBox(np.zeros(n), shifts, np.zeros(n)))
    return Case(arm, path, bodies, pairs, columns, task, n_obstacles)


def moved(case: Case, body: int, row: int) -> FloatArray:
    """The ends of a body's axis at one row of the path."""
    pose = case.tree.poses(case.path.knots[row : row + 1])[0, case.bodies[body].frame]
    (piece,) = case.bodies[body].pieces
    return np.asarray(piece.points @ pose[:3, :3].T + pose[:3, 3])


def boxes_of(
    case: Case, work: Any, count: int, pair: int
) -> list[tuple[int, FloatArray, FloatArray]]:
    """The boxes that a body is looked at by: the first interval of each, low, high."""
    low, high = np.zeros((2, 3))

    def size(first: int, last: int) -> float:
        span = first, min(last, count)
        return float(body_box(case.task, work.rows, span, pair, low, high))

    length = count
    while length > 1 and size(0, length) > broad_phase.SPREAD * size(0, 1):
        length //= 2
    found = []
    for first in range(0, count, length):
        size(first, first + length)
        found.append((first, low.copy(), high.copy()))
    return found


@pytest.mark.parametrize("nominal", [True, False])
@pytest.mark.parametrize("seed", range(6))
def test_far_pairs_are_told_as_by_loops(seed: int, nominal: bool) -> None:
    rng = np.random.default_rng([1, seed])
    case = random_case(rng, nominal, broad_phase.FEW + 3)
    task, n, pairs = case.task, case.n_obstacles, case.pairs
    work = new_workspace(task, case.tree.n_columns, 4, 8)
    broad = new_broad_phase(task, n)
    n_columns = int(case.columns.max()) + 1
    results = new_results(len(pairs), n_columns, 7, Budget(profile=2 * n_columns * 3))
    dense = dense_rows(7, len(pairs))
    dense.verdict[:] = UNDECIDED
    results = results._replace(dense=dense)
    assert results.stride == 3
    results.limit[ACROSS] = rng.choice([np.inf, 0.3]) if nominal else 0.3
    centres = np.array([body.pieces[0].points[0] for body in case.bodies[:n]])
    radii = np.array([body.pieces[0].radius for body in case.bodies[:n]])
    np.testing.assert_allclose(broad.box[0], (centres - radii[:, None]).T, **CLOSE)
    np.testing.assert_allclose(broad.box[1], (centres + radii[:, None]).T, **CLOSE)
    np.testing.assert_allclose(broad.point, centres.T, **CLOSE)
    profile = np.full(results.profile.shape, np.inf)
    least = np.full((2, 2, n), np.inf)  # lower and upper bounds by body and obstacle
    since, settled = np.zeros((2, 2, n)), np.zeros((2, n))
    number = np.full((2, n), -1)
    movers = [int(k) for k in task.bodies.number]
    for pair, row in enumerate(pairs):
        if row.other < n:
            number[movers.index(row.one), row.other] = pair
    for start, count in BLOCKS:
        fill_rows(task, case.path.packed(), work.rows, start, count)
        limit, near = results.limit[ACROSS], [1]
        block = Block(start, start, count, LOOSELY)
        n_near = settle_far(task, work, results, broad, block)
        bounds, when = np.full((2, 2, n), np.inf), np.zeros((2, 2, n))
        for b in range(2):
            of, asked = n + b, number[b] >= 0
            some = int(number[b][asked][0])
            radius = case.bodies[of].pieces[0].radius
            lost = np.where(asked, task.pairs.lost[number[b]], 0.0)
            gaps, reaches, rows = [], [], []
            for first, low, high in boxes_of(case, work, count, some):
                apart = np.maximum(broad.box[0].T - high, low - broad.box[1].T)
                gaps.append(np.linalg.norm(apart.clip(0.0), axis=1) - lost)
                corner = np.maximum(centres - low, high - centres)
                reaches.append(np.linalg.norm(corner, axis=1) + PAD - radius)
                rows.append(start + first)
            gap, reach = np.min(gaps, axis=0), np.min(reaches, axis=0)
            at = np.array(rows)[np.argmin([gaps, reaches], axis=1)]
            nearest = int(np.argmin(np.where(asked, gap, np.inf)))
            row = int(at[0, nearest])
            pose = case.tree.poses(case.path.knots[row : row + 1])
            two = case.bodies[of], case.bodies[nearest]
            upper = float(clearances(case.tree, two, pose)[0]) + PAD
            limit = min(limit, upper) if nominal else limit
            required = np.array([pairs[max(k, 0)].required for k in number[b]])
            far = asked & (gap >= np.maximum(max(upper, limit), required))
            near += number[b][asked & ~far].tolist()
            settled[b] += count * far
            bounds[:, b] = np.where(far, [gap, reach], np.inf)
            when[:, b] = at
            for o in np.flatnonzero(far).tolist():
                pair = number[b, o]
                for k in range(start, start + count):
                    corner = moved(case, of, k)[0]
                    away = centres[o] - corner
                    gone = np.linalg.norm(away)
                    own = corner + radius * away / gone
                    np.testing.assert_allclose(dense.own[k, pair], own, **CLOSE)
                    np.testing.assert_allclose(
                        dense.other[k, pair], centres[o], **CLOSE
                    )
                    told = (
                        dense.lower[k, pair],
                        dense.upper[k, pair],
                        dense.time[k, pair],
                    )
                    np.testing.assert_allclose(
                        told, [gap[o], gone + PAD - radius, 0.0], **CLOSE
                    )
                    assert dense.verdict[k, pair] == CERTIFIED
            untold = number[b][asked & ~far]
            assert (dense.verdict[start : start + count, untold] == UNDECIDED).all()
        np.testing.assert_allclose(results.limit[ACROSS], limit, **CLOSE)
        np.testing.assert_allclose(broad.gap[:2], bounds[0], **CLOSE)
        np.testing.assert_allclose(broad.reach[:2], bounds[1], **CLOSE)
        assert sorted(broad.near[:n_near].tolist()) == sorted(near)
        since = np.where(bounds < least - 1e-9, when, since)
        least = np.minimum(least, bounds)
        bins = sorted({k // 3 for k in range(start, start + count)})
        for side in range(2):
            for b in range(2):
                column = case.columns[n + b]
                part = profile[side, column, bins]
                profile[side, column, bins] = np.minimum(part, bounds[side, b].min())
            for o in np.flatnonzero(case.columns[:n] >= 0).tolist():
                column = case.columns[o]
                part = profile[side, column, bins]
                profile[side, column, bins] = np.minimum(part, bounds[side, :, o].min())
        np.testing.assert_allclose(results.profile, profile, **CLOSE)
    for found, told in ((broad.lower, least[0]), (broad.upper, least[1])):
        np.testing.assert_allclose(found[:2], told, **CLOSE)
    for found, told in ((broad.at_lower, since[0]), (broad.at_upper, since[1])):
        assert np.array_equal(found[:2], told)
    assert np.array_equal(broad.settled[:2], settled)
    assert not broad.settled[2].any() and settled.any()
    check_merged(case, work, results, broad, number)


def check_merged(case: Case, work: Any, results: Any, broad: Any, number: Any) -> None:
    """What was settled counts, and is kept where it is less than what was known."""
    results.best[::3, [LOW, UP]] = -5.0
    before = results.best.copy()
    merge_far(case.task, case.path.packed(), work.ends, results, broad)
    for b in range(2):
        for o in range(case.n_obstacles):
            pair, of = number[b, o], case.n_obstacles + b
            if pair < 0 or not broad.settled[b, o]:
                assert pair < 0 or np.array_equal(results.best[pair], before[pair])
                continue
            assert results.counts[pair].tolist() == [broad.settled[b, o], 0, 0]
            best = before[pair]
            if broad.lower[b, o] < best[LOW]:
                best[[LOW, AT_LOWER]] = broad.lower[b, o], broad.at_lower[b, o]
            if broad.upper[b, o] < best[UP]:
                (piece,) = case.bodies[of].pieces
                row = int(broad.at_upper[b, o])
                gone = np.linalg.norm(broad.point[:, o] - moved(case, of, row)[0])
                best[[UP, AT_UPPER, TIME]] = gone - piece.radius + PAD, row, 0.0
                best[OWN:OTHER], best[OTHER:] = piece.points[0], broad.point[:, o]
            np.testing.assert_allclose(results.best[pair], best, **CLOSE)


def test_few_obstacles_are_all_near() -> None:
    rng = np.random.default_rng(2)
    case = random_case(rng, True, broad_phase.FEW)
    work = new_workspace(case.task, case.tree.n_columns, 4, 8)
    broad = new_broad_phase(case.task, case.n_obstacles)
    results = new_results(len(case.pairs), case.n_obstacles + 2, 7, Budget())
    fill_rows(case.task, case.path.packed(), work.rows, 0, 4)
    block = Block(0, 0, 4, LOOSELY)
    assert settle_far(case.task, work, results, broad, block) == len(case.pairs)
    assert broad.near.tolist() == list(range(len(case.pairs)))
    assert not broad.settled.any() and np.isinf(results.profile).all()
