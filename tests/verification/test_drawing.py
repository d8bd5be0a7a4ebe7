"""What is drawn and in which order; oracle: cells of a path, counted one by one."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.drawing import check_coverage, check_order, coverage
from vdsm_pin.verification.records import Verdict

ARM = built_in("hrm8")
CELLS = 64
"""The path is 1 m long: stations are exact in doubles."""

SQUARE = np.array([[3.0, 0, 0], [3.0, 0.25, 0], [3.0, 0.25, 0.25], [3.0, 0, 0.25]])
LINE = np.array([[3.0, 0, 0], [2.0, 0, 0]])


def asked(closed: bool, tolerance: float) -> PlanningProblem:
    corners = SQUARE if closed else LINE
    path = DesiredPath(corners[0], corners, closed=closed)
    return PlanningProblem(
        ARM, Scene(), path, 0.0, name="p", tip_tolerance=tolerance / CELLS
    )


def motion(on: np.ndarray, cells: np.ndarray) -> Trajectory:
    n = len(on)
    return Trajectory(on, cells / CELLS, np.zeros(n), *np.zeros((2, n, 8)))


def random_motion(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Rows on the path or not, and their stations in cells; often forwards."""
    n = int(rng.integers(1, 12))
    steps = rng.choice([-33, -32, -2, -1, 0, 1, 2, 5, 9, 31, 32, 33, 64, 97], n)
    if rng.random() < 0.7:
        steps = np.abs(steps) % 20
    return rng.random(n) < 0.8, int(rng.integers(0, CELLS)) + np.cumsum(steps)


def place(cell: int, closed: bool) -> int:
    return int(cell) % CELLS if closed else min(max(int(cell), 0), CELLS)


def run(begin: int, end: int, closed: bool) -> int:
    """The shorter way round, forwards where both are as long."""
    if not closed:
        return place(end, False) - place(begin, False)
    ahead = (int(end) - int(begin)) % CELLS
    return ahead if ahead <= CELLS // 2 else ahead - CELLS


def painted(on: np.ndarray, cells: np.ndarray, closed: bool) -> set[int]:
    found = set[int]()
    for k in range(len(on) - 1):
        if on[k] and on[k + 1]:
            start = place(cells[k], closed)
            end = start + run(cells[k], cells[k + 1], closed)
            found |= {c % CELLS for c in range(min(start, end), max(start, end))}
    return found


def gaps_of(drawn: set[int]) -> list[list[int]]:
    edges = [c for c in range(CELLS + 1)
             if (c - 1 in drawn or c == 0) != (c in drawn or c == CELLS)]  # fmt: skip
    return [[a, b] for a, b in zip(edges[::2], edges[1::2], strict=True)]


def order_of(
    on: np.ndarray, cells: np.ndarray, closed: bool, same: int
) -> tuple[int, int]:
    """How far the drawing goes back or beyond its end, and the row that tells."""
    rows = np.flatnonzero(on).tolist()
    steps = []
    for a, b in pairwise(rows):
        step = run(cells[a], cells[b], closed)
        if closed and b > a + 1:
            ahead = (place(cells[b], True) - place(cells[a], True)) % CELLS
            step = ahead - CELLS if ahead >= CELLS - same else ahead
        steps.append(step)
    totals = [0, *np.cumsum(steps).tolist()]
    behind = [max(totals[: k + 1]) - total for k, total in enumerate(totals)]
    back, row = max(behind), rows[behind.index(max(behind))]
    left = any(b > a + 1 for a, b in pairwise(rows))
    if closed and left and back <= same:
        back = max(back, max(totals) - CELLS)
        beyond = [k for k, total in enumerate(totals) if total > CELLS + same]
        row = rows[beyond[0]] if beyond else row
    return back, row


@pytest.mark.parametrize("closed", [True, False])
def test_what_is_drawn_is_what_the_cells_say(closed: bool) -> None:
    rng, path = np.random.default_rng(1 + closed), asked(closed, 0.5).path
    for _ in range(400):
        on, cells = random_motion(rng)
        drawn = painted(on, cells, closed)
        share, gaps = coverage(path, motion(on, cells))
        assert len(drawn) / CELLS - 1e-12 <= share <= len(drawn) / CELLS
        np.testing.assert_array_equal(gaps * CELLS, np.reshape(gaps_of(drawn), (-1, 2)))


@pytest.mark.parametrize("same", [0, 1])
@pytest.mark.parametrize("closed", [True, False])
def test_the_order_is_what_the_cells_say(closed: bool, same: int) -> None:
    rng, refuted = np.random.default_rng(3 + 2 * same + closed), 0
    problem = asked(closed, max(same, 0.5))
    for _ in range(600):
        on, cells = random_motion(rng)
        (row,) = check_order(problem, motion(on, cells))
        if not on.any():
            assert row.verdict is Verdict.UNDECIDED
            assert np.isnan(row.worst)
            continue
        back, moment = order_of(on, cells, closed, same)
        refuted += back > same
        assert row.verdict is (Verdict.REFUTED if back > same else Verdict.CERTIFIED)
        assert (row.count, row.worst * CELLS) == (on.sum(), back)
        assert bool(row.where) == (back > same)
        np.testing.assert_equal(row.moment, moment if back > same else np.nan)
    assert 40 < refuted < 560


@pytest.mark.parametrize("closed", [True, False])
def test_small_steps_back_add_up(closed: bool) -> None:
    """Each within the tolerance: a path drawn from its end to its start is refused."""
    cells = np.arange(CELLS, -1, -1)
    (row,) = check_order(asked(closed, 1), motion(np.ones(CELLS + 1, bool), cells))
    assert row.verdict is Verdict.REFUTED
    assert (row.worst * CELLS, row.moment) == (CELLS, CELLS)
    (row,) = check_order(asked(closed, 1), motion(np.ones(2, bool), cells[:2]))
    assert row.verdict is Verdict.CERTIFIED


@pytest.mark.parametrize("seed", range(4))
def test_no_more_counts_as_drawn_than_is(seed: int) -> None:
    """Of hundreds of stretches, whose sum rounds; by exact arithmetic."""
    rng = np.random.default_rng([3, seed])
    for _ in range(20):
        n, ends = int(rng.integers(3, 600)), np.array([[3.0, 0, 0], [2.0, 0, 0]])
        ends[1, 1] = rng.uniform()
        path = DesiredPath(ends[0], ends)
        stations = np.sort(rng.uniform(0.0, path.length, n))
        on = rng.random(n) < 0.7
        rows = Trajectory(on, stations, np.zeros(n), *np.zeros((2, n, 8)))
        drawn = sum(
            Fraction(b) - Fraction(a)
            for (a, b), one, other in zip(
                pairwise(stations.tolist()), on, on[1:], strict=False
            )
            if one and other
        )
        share, _ = coverage(path, rows)
        exact = drawn / Fraction(path.length)
        assert Fraction(share) <= exact
        assert exact - Fraction(share) < 1e-12


def test_a_path_of_one_point_is_drawn_by_any_row_there() -> None:
    path = DesiredPath(LINE[0], LINE[:1])
    for on in ([False, True], [False, False], [True]):
        share, gaps = coverage(path, motion(np.array(on), np.zeros(len(on))))
        assert (share, gaps.shape) == (float(any(on)), (0, 2))


def test_coverage_is_judged_on_both_sides_of_what_is_required() -> None:
    problem = asked(False, 1)
    for share, verdict in (
        (1.0, Verdict.CERTIFIED),
        (1.0 - 1e-12, Verdict.CERTIFIED),
        (1.0 - 1e-3, Verdict.INCOMPLETE),
        (float("nan"), Verdict.INCOMPLETE),
    ):
        (row,) = check_coverage(problem, share)
        assert (row.verdict, row.limit, row.count) == (verdict, 1.0, 1)
