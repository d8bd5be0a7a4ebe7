"""Compiled: configurations along straight lines in the chart (Eq. 7)."""

from typing import NamedTuple

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray


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
