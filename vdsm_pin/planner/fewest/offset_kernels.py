"""Compiled: arms in the chart of projections, along straight lines in it (Eq. 7).

Where their joints are, and how these are moved or put in line.
"""

from typing import NamedTuple

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.tolerances import TOLERANCES


class Lines(NamedTuple):
    """Straight lines in the chart, each an interval."""

    tips: FloatArray
    """Where they begin, shape (n, 3); [m]."""

    next_tips: FloatArray
    """Where they end; [m]."""

    offsets: FloatArray
    """D_1..D_{N+1} where they begin, shape (n, N + 1, 2) [m], or the directions of the
    links, shape (n, N, 3) [-]."""

    next_offsets: FloatArray
    """The same where they end."""


@compiled
def centres_between(
    lines: Lines,
    interval: IntArray,
    share: FloatArray,
    ratios: FloatArray,
    lengths: FloatArray,
) -> FloatArray:
    """Joint centres at places of intervals (Eq. 7).

    Args:
        lines: The intervals.
        interval: Interval of each place, shape (r,).
        share: Where in its interval, 0 to 1, shape (r,).
        ratios: k_i of each joint centre, shape (N + 1,); [-].
        lengths: Of the links, shape (N,); [m].

    Returns:
        Shape (r, N + 1, 3), NaN from the base to a link that is too short; [m].
    """
    tips, next_tips, offsets, next_offsets = lines
    n_links = lengths.size
    centres = np.zeros((interval.size, n_links + 1, 3))
    for r in range(interval.size):
        a, t = interval[r], share[r]
        s = 1.0 - t
        tip_y = s * tips[a, 1] + t * next_tips[a, 1]
        tip_z = s * tips[a, 2] + t * next_tips[a, 2]
        x = s * tips[a, 0] + t * next_tips[a, 0]
        for i in range(n_links, -1, -1):
            dy = s * offsets[a, i, 0] + t * next_offsets[a, i, 0]
            dz = s * offsets[a, i, 1] + t * next_offsets[a, i, 1]
            y, z = tip_y * ratios[i] + dy, tip_z * ratios[i] + dz
            if i < n_links:
                gap_y, gap_z = centres[r, i + 1, 1] - y, centres[r, i + 1, 2] - z
                square = lengths[i] * lengths[i] - gap_y * gap_y - gap_z * gap_z
                x -= np.sqrt(square) if square > 0.0 else np.nan
            centres[r, i, 0], centres[r, i, 1], centres[r, i, 2] = x, y, z
    return centres


@compiled
def bends_of(centres: FloatArray) -> FloatArray:
    """Psi of every joint, shape (r, N), NaN where a link is too short; [rad].

    Args:
        centres: Joint centres, shape (r, N + 1, 3); [m].
    """
    n_links = centres.shape[1] - 1
    angles = np.zeros((centres.shape[0], n_links))
    for r in range(centres.shape[0]):
        before = (1.0, 0.0, 0.0)
        for i in range(n_links):
            x = centres[r, i + 1, 0] - centres[r, i, 0]
            y = centres[r, i + 1, 1] - centres[r, i, 1]
            z = centres[r, i + 1, 2] - centres[r, i, 2]
            size = np.sqrt(x * x + y * y + z * z)
            axis = (x / size, y / size, z / size)
            dx, dy, dz = axis[0] - before[0], axis[1] - before[1], axis[2] - before[2]
            # The chord of the unit circle keeps full precision at small angles.
            chord = np.sqrt(dx * dx + dy * dy + dz * dz)
            angles[r, i] = 2.0 * np.arcsin(min(chord / 2.0, 1.0))
            before = axis
    return angles


@compiled
def knees_between(
    offsets: FloatArray, next_offsets: FloatArray, lengths: FloatArray, straight: float
) -> BoolArray:
    """Joints where the arm may bend somewhere in each interval, and both ends.

    Args:
        offsets: D_1..D_{N+1} where they begin, shape (n, N + 1, 2); [m].
        next_offsets: D_1..D_{N+1} where they end; [m].
        lengths: Of the links, shape (N,); [m].
        straight: Change of slope that counts as none; [-].

    Returns:
        Shape (n, N + 1).
    """
    offsets, next_offsets = borrowed(offsets), borrowed(next_offsets)
    n_links = lengths.size
    bent = np.ones((offsets.shape[0], n_links + 1), dtype=np.bool_)
    for r in range(offsets.shape[0]):
        for i in range(1, n_links):
            turn = 0.0
            for rows in (offsets[r], next_offsets[r]):
                for c in range(2):
                    after = (rows[i + 1, c] - rows[i, c]) / lengths[i]
                    before = (rows[i, c] - rows[i - 1, c]) / lengths[i - 1]
                    turn = max(turn, abs(after - before))
            bent[r, i] = turn > straight
    return bent


@compiled
def pieces_of(
    centres: FloatArray, knees: BoolArray, interval: IntArray, wanted: BoolArray
) -> tuple[FloatArray, IntArray]:
    """Straight pieces of configurations: links in line between knees are one.

    Args:
        centres: Joint centres, shape (r, N + 1, 3); [m].
        knees: Of each interval, shape (n, N + 1).
        interval: Interval of each configuration, shape (r,).
        wanted: Which pieces are wanted, by the joint they end at, shape (r, N).

    Returns:
        Ends of the pieces, shape (p, 2, 3) [m], and where each stands in `wanted`, row
        after row, shape (p,).
    """
    n_rows, n_links = wanted.shape
    pieces, place = np.zeros((wanted.sum(), 2, 3)), np.zeros(wanted.sum(), np.int64)
    count = 0
    for r in range(n_rows):
        begin = 0
        for i in range(n_links):
            if not knees[interval[r], i + 1]:
                continue
            if wanted[r, i]:
                for c in range(3):
                    pieces[count, 0, c] = centres[r, begin, c]
                    pieces[count, 1, c] = centres[r, i + 1, c]
                place[count] = r * n_links + i
                count += 1
            begin = i + 1
    return pieces, place


@compiled
def clearances_along(
    clearances: FloatArray, knees: BoolArray, others: BoolArray
) -> FloatArray:
    """Clearance of an arm's pieces where it is cut at other knees.

    Args:
        clearances: Clearance of the pieces, shape (n, N); [m].
        knees: Where they are cut, shape (n, N + 1).
        others: Where the others are cut, shape (n, N + 1).

    Returns:
        The least of the pieces that each of the others shares, inf where none ends,
        shape (n, N); [m].
    """
    n_rows, n_links = clearances.shape
    result = np.full((n_rows, n_links), np.inf)
    for r in range(n_rows):
        begin = 0
        for i in range(n_links):
            if not others[r, i + 1]:
                continue
            for k in range(begin, n_links):
                result[r, i] = min(result[r, i], clearances[r, k])
                if k >= i and knees[r, k + 1]:
                    break
            begin = i + 1
    return result


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
    """Arms with one joint in line with its neighbours; see `Offsets.in_line`.

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
