"""Compiled: configurations along straight lines in the chart (Eq. 7)."""

from typing import NamedTuple

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray

LEANING = 0.3
"""Part of its length that a link is thought to advance along the rail at least; [-]."""


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


class Places(NamedTuple):
    """Places of intervals."""

    interval: IntArray
    """Interval of each place, shape (r,)."""

    share: FloatArray
    """Where in its interval, 0 to 1, shape (r,)."""


class Seen(NamedTuple):
    """Configurations, one end of a part each, and what their pieces keep."""

    centres: FloatArray
    """Joint centres, shape (r, N + 1, 3); [m]."""

    clearances: FloatArray
    """Of the pieces, inf where none ends, shape (r, N); [m]."""


class Cutting(NamedTuple):
    """How parts are cut."""

    finest: float
    """A way that is too short to matter; [m]."""

    long_way: float
    """A way that is cut whatever the clearance; [m]."""

    most: int
    """Largest number of parts."""


class Chain(NamedTuple):
    """Corners of a motion in the chart."""

    tips: FloatArray
    """Shape (n, 3); [m]."""

    offsets: FloatArray
    """Shape (n, N + 1, 2) [m], or directions (n, N, 3) [-]."""

    stations: FloatArray
    """Arc length along the desired path, shape (n,); [m]."""


@compiled
def centres_between(
    lines: Lines, places: Places, ratios: FloatArray, lengths: FloatArray
) -> FloatArray:
    """Joint centres at places of intervals (Eq. 7).

    Args:
        lines: The intervals.
        places: The places.
        ratios: k_i of each joint centre, shape (N + 1,); [-].
        lengths: Of the links, shape (N,); [m].

    Returns:
        Shape (r, N + 1, 3), NaN from the base to a link that is too short; [m].
    """
    tips, next_tips, offsets, next_offsets = lines
    interval, share = places
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


@compiled
def bow_bounds(centres: FloatArray, next_centres: FloatArray, bows: FloatArray) -> None:
    """How far joint centres stray from the straight line between two configurations.

    The tip does not; a link whose projection d goes along a line advances along the
    rail by a = sqrt(l^2 - d^2), which strays by d'^2 l^2 / 8 a^3 at most. Of directions
    that go along arcs, and below `LEANING`, it is an estimate.

    Args:
        centres: Of one configuration, shape (N + 1, 3); [m].
        next_centres: Of the other; [m].
        bows: Set to the bounds, the tip's last, shape (N + 1,); [m].
    """
    last = centres.shape[0] - 1
    bows[last] = 0.0
    for i in range(last - 1, -1, -1):
        length = turn = 0.0
        for c in range(3):
            side = centres[i + 1, c] - centres[i, c]
            length += side * side
            if c > 0:
                turn += (next_centres[i + 1, c] - next_centres[i, c] - side) ** 2
        a = min(
            centres[i + 1, 0] - centres[i, 0],
            next_centres[i + 1, 0] - next_centres[i, 0],
        )
        a = max(a, LEANING * np.sqrt(length))
        bows[i] = bows[i + 1] + turn * length / (8.0 * a**3)


@compiled
def parts_of_pieces(
    begin: Seen,
    end: Seen,
    knees: BoolArray,
    interval: IntArray,
    need: FloatArray,
    cutting: Cutting,
) -> IntArray:
    """Into how many parts to cut the way of a piece to see that it is clear.

    No point of a straight piece moves farther than both its ends, which may bow out on
    the way (`bow_bounds`). The number is what it takes if there is as much clearance on
    the way as at its ends, as a power of 2.

    Args:
        begin: Configurations where the ways begin.
        end: Those where they end.
        knees: Of each interval, shape (n, N + 1).
        interval: Interval of both configurations, shape (r,).
        need: Clearance to keep in each interval, shape (n,); [m].
        cutting: What is cut.

    Returns:
        Shape (r, N), 0 where a piece is clear all the way.
    """
    centres, clearances = begin
    next_centres, next_clearances = end
    finest, long_way, most = cutting
    n_rows, n_links = clearances.shape
    parts = np.zeros((n_rows, n_links), dtype=np.int64)
    bows = np.zeros(n_links + 1)
    for r in range(n_rows):
        bow_bounds(centres[r], next_centres[r], bows)
        before = 0.0
        for i in range(n_links + 1):
            if not knees[interval[r], i]:
                continue
            square = 0.0
            for c in range(3):
                square += (next_centres[r, i, c] - centres[r, i, c]) ** 2
            here = np.sqrt(square) + 2.0 * bows[i]
            way, before = max(before, here), here
            if i == 0 or not way > finest:
                continue
            spare = (
                clearances[r, i - 1]
                + next_clearances[r, i - 1]
                - 2.0 * need[interval[r]]
            )
            if spare >= way and way <= long_way:
                continue
            parts[r, i - 1] = 2
            step = max(spare, finest)
            while 2 * parts[r, i - 1] <= most and parts[r, i - 1] * step < way:
                parts[r, i - 1] *= 2
    return parts


@compiled
def on_line(
    chain: Chain,
    drawn: bool,
    unit: float,
    span: tuple[int, int],
    line_tips: FloatArray,
    line_offsets: FloatArray,
) -> None:
    """Corners between two corners, moved onto the straight line between them.

    Where the tip draws, each keeps its station and its tip; elsewhere they are spread
    as far apart as they are now.

    Args:
        chain: The corners.
        drawn: Whether the tip draws here.
        unit: Way of the tip that one of the offsets counts for; [m] or [-].
        span: The first corner and the last one.
        line_tips: Result in rows a + 1 to b - 1, shape (n, 3); [m].
        line_offsets: Result likewise, shape (n, N + 1, 2); [m].
    """
    (tips, offsets, stations), (a, b) = chain, span
    share = np.zeros(b - a + 1)
    for k in range(a, b):
        if drawn:
            way = abs(stations[k + 1] - stations[k])
        else:
            turn = np.abs(offsets[k + 1] - offsets[k]).max()
            way = np.sqrt(((tips[k + 1] - tips[k]) ** 2).sum()) + unit * turn
        share[k + 1 - a] = share[k - a] + way
    if share[-1] > 0.0:
        share /= share[-1]
    else:
        share[:] = np.arange(b - a + 1) / (b - a)
    for k in range(a + 1, b):
        t = share[k - a]
        line_offsets[k] = (1.0 - t) * offsets[a] + t * offsets[b]
        if not drawn:
            line_tips[k] = (1.0 - t) * tips[a] + t * tips[b]


@compiled
def farthest_apart(
    tips: FloatArray,
    offsets: FloatArray,
    other_tips: FloatArray,
    other_offsets: FloatArray,
) -> FloatArray:
    """Largest difference of a coordinate, corner by corner, shape (n,); [m]."""
    result = np.zeros(len(tips))
    for k in range(len(tips)):
        gap = np.abs(tips[k] - other_tips[k]).max()
        result[k] = max(gap, np.abs(offsets[k] - other_offsets[k]).max())
    return result
