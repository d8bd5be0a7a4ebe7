"""Compiled: joints of arms moved or put in line, in the chart of projections."""

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.tolerances import TOLERANCES

COPIED, AT_KNEE, STRAIGHTENED = 0.05, 0.3, 0.45
"""Of a half: up to where a child is its parent, moves a knee, moves any joint; beyond,
a joint is put in line with its neighbours; [-]."""
STRAIGHT = TOLERANCES.straight_slope
SCALES = (0.008, 0.025, 0.06)
"""Sizes of a change over the arm's length; [-]."""


@compiled
def _bent_joints(row: FloatArray, stations: FloatArray, bent: BoolArray) -> IntArray:
    """Set which joints of a configuration bend; they are returned in order too."""
    last = stations.size - 1
    for i in range(1, last):
        turn = 0.0
        for c in range(2):
            after = (row[i + 1, c] - row[i, c]) / (stations[i + 1] - stations[i])
            before = (row[i, c] - row[i - 1, c]) / (stations[i] - stations[i - 1])
            turn = max(turn, abs(after - before))
        bent[i] = turn > STRAIGHT
    return np.flatnonzero(bent)


@compiled
def _line_up(
    row: FloatArray, stations: FloatArray, first: int, last: int, place: FloatArray
) -> None:
    """Put the joints between two others, and the last one, on a line.

    Args:
        row: Offsets of one configuration, shape (N + 1, 2); [m].
        stations: Arc length of the joints, shape (N + 1,); [m].
        first: The joint the line begins at.
        last: The joint it ends at.
        place: Where that one comes to be, shape (2,); [m].
    """
    span = stations[last] - stations[first]
    for i in range(last, first, -1):
        share = (stations[i] - stations[first]) / span
        for c in range(2):
            row[i, c] = (1.0 - share) * row[first, c] + share * place[c]


@compiled
def _bent_beside(bent: BoolArray, joint: int) -> tuple[int, int]:
    """The bent joints before and after one; the base and the tip count as bent."""
    low, high = joint - 1, joint + 1
    while low > 0 and not bent[low]:
        low -= 1
    while high < bent.size - 1 and not bent[high]:
        high += 1
    return low, high


@compiled
def mutated_offsets(
    offsets: FloatArray,
    stations: FloatArray,
    moved: FloatArray,
    joint: FloatArray,
    kind: FloatArray,
    shift: FloatArray,
) -> FloatArray:
    """Children of configurations, one each.

    Args:
        offsets: Parents, shape (n, N + 1, 2); [m].
        stations: Arc length of the joints, shape (N + 1,); [m].
        moved: How far the tip has moved across the rail since, shape (n, 2); [m].
        joint: Which joint to move, as a number in [0, 1), shape (n,).
        kind: What to do, as a number in [0, 1), shape (n,).
        shift: How far to move that joint, shape (n, 2); [m].

    Returns:
        Children, shape (n, N + 1, 2); [m].
    """
    last = stations.size - 1
    result = offsets.copy()
    bent = np.zeros(last + 1, dtype=np.bool_)
    for r in range(offsets.shape[0]):
        row = result[r]
        knees = _bent_joints(row, stations, bent)
        if kind[r] < 0.5 and knees.size > 0:
            # The projections stay where they are up to the last knee.
            for i in range(1, knees[-1] + 1):
                for c in range(2):
                    row[i, c] -= stations[i] / stations[last] * moved[r, c]
            _line_up(row, stations, knees[-1], last, row[last].copy())
        half = kind[r] % 0.5
        if half < COPIED:
            continue
        m = 1 + int(joint[r] * (last - 1))
        if half < AT_KNEE and knees.size > 0:
            m = knees[int(joint[r] * knees.size)]
        low, high = _bent_beside(bent, m)
        place = row[m] + shift[r]
        if half > STRAIGHTENED:
            share = (stations[m] - stations[low]) / (stations[high] - stations[low])
            place = (1.0 - share) * row[low] + share * row[high]
        _line_up(row, stations, low, m, place)
        _line_up(row, stations, m, high, row[high].copy())
    return result


@compiled
def lined_up(
    offsets: FloatArray, stations: FloatArray, joint: int, way: int
) -> FloatArray:
    """Arms with one joint in line with its neighbours; see `charts.in_line`.

    Args:
        offsets: D_1..D_{N+1}, shape (n, N + 1, 2); [m].
        stations: Arc length of the joints, shape (N + 1,); [m].
        joint: The joint, counted from 0.
        way: 0 between the bent joints before and after it; 1 where the piece before it
            goes on, up to the next bent joint; -1 where the piece after it goes back.

    Returns:
        Shape (n, N + 1, 2); [m].
    """
    result, last = offsets.copy(), stations.size - 1
    bent = np.zeros(last + 1, dtype=np.bool_)
    for r in range(offsets.shape[0]):
        row = result[r]
        _bent_joints(row, stations, bent)
        low, high = _bent_beside(bent, joint)
        if way == 0:
            _line_up(row, stations, low, high, row[high].copy())
            continue
        moved, fixed = (high, low) if way > 0 else (low, high)
        if not bent[joint] or moved == 0 or moved == last:
            continue
        part = (stations[moved] - stations[fixed]) / (stations[joint] - stations[fixed])
        place = row[fixed] + part * (row[joint] - row[fixed])
        before, after = _bent_beside(bent, moved)
        first, end = (low, after) if way > 0 else (before, high)
        _line_up(row, stations, first, moved, place)
        _line_up(row, stations, moved, end, row[end].copy())
    return result
