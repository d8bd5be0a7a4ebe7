"""Step 4 with an obstacle along the rail: the tip's way round it (paper, 4.2.2-4.2.3).

Seen along X, the straight arm is a ray from P_1, and the danger region throws a shadow.
A tip outside the shadow is reached straight; inside it the arm must bend round the
region on one side. A tip that enters the shadow at one edge and leaves it at the other
would wrap the arm round the obstacle. There the tip leaves the desired path (A4), walks
back round the base-facing side of the region, and rejoins the path with the arm on the
other side (A5).
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Final, TypeAlias

import numpy as np

from vdsm_pin.errors import PathBlocked
from vdsm_pin.geometry.arrays import FloatArray, IntArray, distinct
from vdsm_pin.planner.paper.approach import first_station
from vdsm_pin.planner.paper.danger_region import DangerRegion, Visit
from vdsm_pin.planner.paper.project import project
from vdsm_pin.planner.paper.tip_path import (
    Route,
    Rows,
    drawn_rows,
    join,
    length_of,
    off_path_rows,
    rows_at,
    undrawn_by,
)
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import in_mm

WIDER: Final = (0.0, 0.01, 0.02, 0.032, 0.048, 0.064, 0.096)
"""By how much wider than the region ways round it are tried, too, where the arm cannot
follow the taut one, over its length; [-]."""

Judge: TypeAlias = Callable[[FloatArray, int], FloatArray]
"""(tip positions (n, 3), side) to the largest link angle with the arm on that side,
infinite where it cannot stand so, shape (n,); [rad]."""


def path_rows(path: DesiredPath, start: float, region: DangerRegion) -> Rows:
    """Waypoints of the whole path, with one on each crossing of the boundary.

    Args:
        path: The desired path.
        start: Arc length at which it is begun; [m].
        region: The danger region.
    """
    rows = drawn_rows(path, start)
    inside = region.contains(project(rows.points))
    crossed = np.flatnonzero(inside[1:] != inside[:-1])
    if not len(crossed):
        return rows
    ends = rows.stations[np.stack([crossed, crossed + 1])]
    within, without = np.where(inside[crossed], ends, ends[::-1])
    while np.abs(within - without).max() > TOLERANCES.on_boundary:
        middle = 0.5 * (within + without)
        hit = region.contains(project(rows_at(path, middle).points))
        within, without = np.where(hit, middle, within), np.where(hit, without, middle)
    return rows_at(path, distinct(np.concatenate([rows.stations, without])))


def detour_route(
    path: DesiredPath,
    region: DangerRegion,
    judge: Judge,
    arm_length: float,
    missing: float = np.inf,
) -> Route:
    """The tip's whole route round one region: onto the path, along it, and back.

    Args:
        path: The desired path.
        region: The danger region of the tip.
        judge: Which tip positions the arm can take on a side.
        arm_length: Of the whole arm; [m].
        missing: Less than this of the path must be left undrawn; [m].

    Returns:
        The route with the arm's side at every waypoint.

    Raises:
        PathBlocked: If nothing or too little of the path can be drawn, or a way cannot
            be joined.
    """
    station, note = first_station(path, region)
    rows = path_rows(path, station, region)
    pieces = _drawable(rows, region, judge)
    if not pieces:
        raise PathBlocked(
            obstacle=region.name, reason="no point of the path can be drawn"
        )
    undrawn = length_of(undrawn_by(path, pieces))
    if not undrawn < missing:
        reason = f"{in_mm(undrawn)} of the path cannot be drawn"
        raise PathBlocked(obstacle=region.name, reason=reason)
    start = _End(path.start, 0, path.start[None, 1:])
    walk = _Walk(path, region, judge, _largest_angle(pieces, judge), arm_length)
    ways: list[Rows] = []
    here = start
    for piece in pieces:
        left_at = float(ways[-1].stations[-1] if ways else piece.stations[0])
        there = _end(piece, region, last=False)
        ways += [_connect(walk, here, there, left_at), piece]
        here = _end(piece, region, last=True)
    if path.closed:
        ways.append(_connect(walk, here, start, float(ways[-1].stations[-1])))
    return join(path, ways, (note,) if note else ())


def _largest_angle(rows: list[Rows], judge: Judge) -> float:
    """Largest link angle where the arm bends round the region; [rad]."""
    angles = [
        judge(some.points[some.side == side], side) for some in rows for side in (1, -1)
    ]
    return float(np.concatenate(angles).max(initial=0.0))


def _drawable(rows: Rows, region: DangerRegion, judge: Judge) -> list[Rows]:
    """The parts of the path that are drawn in one go, each with its sides."""
    points = project(rows.points)
    inside = region.contains(points)
    # Two layers: waypoint k as the end of one part and as the beginning of the next.
    leaving, joining = np.zeros(len(rows), int), np.zeros(len(rows), int)
    drawn, cut = ~inside, np.zeros(len(rows), bool)
    for visit in region.visits(points):
        span = slice(visit.first, visit.last + 1)
        before, after = _sides_drawn(rows, visit, region, judge)
        leaving[span], joining[span] = before, after
        drawn[span] = (before != 0) | (after != 0)
        both = np.flatnonzero((before != 0) & (after != 0) & (before != after))
        cut[visit.first + both] = True
    parts = []
    edges = np.flatnonzero(np.diff(np.concatenate([[False], drawn, [False]])))
    for begin, end in zip(edges[::2], edges[1::2] - 1, strict=True):
        cuts = begin + 1 + np.flatnonzero(cut[begin + 1 : end])
        for first, last in pairwise([begin, *cuts, end]):
            side = joining[first : last + 1].copy()
            side[-1] = leaving[last]
            parts.append(rows.part(first, last, side))
    return parts


def _sides_drawn(
    rows: Rows, visit: Visit, region: DangerRegion, judge: Judge
) -> tuple[IntArray, IntArray]:
    """On which side each waypoint of a visit is drawn; 0 for not at all.

    The arm keeps the side it came in by as far as it can stand so, and the side it goes
    out by from as early as it can. Where both are possible, the sides change at the
    waypoint nearest to the obstacle.

    Returns:
        Side as the end of a part and as the beginning of the next; they differ only at
        the waypoint where the sides change.
    """
    points = rows.points[visit.first : visit.last + 1]
    count = len(points)
    entry, exit_ = visit.entry, visit.exit
    if entry == 0 and exit_ == 0:
        able = {side: int(np.isfinite(judge(points, side)).sum()) for side in (-1, 1)}
        entry = exit_ = max(able, key=lambda side: able[side])
    before, after = np.zeros(count, int), np.zeros(count, int)
    if entry == exit_:
        kept = np.where(np.isfinite(judge(points, entry)), entry, 0)
        return kept, kept
    n_before = _leading(judge(points, entry)) if entry else 0
    n_after = _leading(judge(points, exit_)[::-1]) if exit_ else 0
    first_after = count - n_after
    if n_before > first_after:
        gaps = np.linalg.norm(project(points) - region.centre, axis=1)
        change = first_after + int(np.argmin(gaps[first_after:n_before]))
        n_before, first_after = change + 1, change
    before[:n_before] = entry
    after[first_after:] = exit_
    leaving = np.where(before != 0, before, after)
    joining = np.where(after != 0, after, before)
    return leaving, joining


def _leading(angles: FloatArray) -> int:
    """How many entries are finite from the beginning on."""
    return int(np.argmin(np.append(np.isfinite(angles), False)))


@dataclass(frozen=True)
class _End:
    """An end of a drawn part, seen by the way that joins it.

    Args:
        point: The tip there, shape (3,); [m].
        side: The arm's side there; 0 if any.
        retreat: The drawn waypoints from there to the first one out of the shadow,
            projected, shape (m, 2), m >= 1; [m].
    """

    point: FloatArray
    side: int
    retreat: FloatArray


def _end(rows: Rows, region: DangerRegion, last: bool) -> _End:
    """The last or the first waypoint of a drawn part as an end."""
    inwards = slice(None, None, -1) if last else slice(None)
    points = project(rows.points)[inwards]
    covered = region.covers(points)
    out = len(points) - 1 if covered.all() else int(np.argmin(covered))
    side = rows.side[inwards]
    return _End(rows.points[inwards][0], int(side[0]), points[: out + 1])


@dataclass(frozen=True)
class _Walk:
    """What ways off the path have in common.

    Args:
        path: The desired path.
        region: What is gone round.
        judge: Which tip positions the arm can take on a side.
        gentle: Largest link angle on the path, which ways should not exceed; [rad].
        arm_length: Of the whole arm; [m].
    """

    path: DesiredPath
    region: DangerRegion
    judge: Judge
    gentle: float
    arm_length: float


def _connect(walk: _Walk, begin: _End, end: _End, station: float) -> Rows:
    """The shortest way off the path that the arm can follow, sides kept in the shadow.

    From either end the tip goes round the region at once; where the arm cannot follow,
    it first goes back along the path it can draw, out of the shadow. A way that needs
    no larger link angles than the path itself is preferred.
    """
    shortest = None
    lines = []
    for k, m in product(*map(_retreats, (begin, end))):
        out, back = begin.retreat[:k], end.retreat[:m][::-1]
        lines += [
            np.concatenate([out, line, back])
            for line in _ways_round(walk, out[-1], back[0])
        ]
    lines.sort(key=lambda line: np.linalg.norm(np.diff(line, axis=0), axis=1).sum())
    from_x, to_x = float(begin.point[0]), float(end.point[0])
    for line in lines:
        way = off_path_rows(walk.path, line, from_x, to_x, station)
        side = _sides_on_way(way, walk.region, begin.side, end.side, walk.judge)
        if side is None:
            continue
        way = way.part(0, len(way) - 1, side)
        if _largest_angle([way], walk.judge) <= walk.gentle:
            return way
        shortest = shortest or way
    if shortest is None:
        reason = "the tip cannot get round it with the arm on the side it needs"
        raise PathBlocked(obstacle=walk.region.name, reason=reason)
    return shortest


def _retreats(end: _End) -> list[int]:
    """How many waypoints to go back along the path: 1, 2, 4, .., all."""
    most = len(end.retreat)
    return [*(2**k for k in range(most.bit_length()) if 2**k < most), most]


def _ways_round(walk: _Walk, begin: FloatArray, end: FloatArray) -> list[FloatArray]:
    """The straight line where it is clear, and ways round, taut or wider."""
    region = walk.region
    straight = np.stack([begin, end])
    touch = region.radius - TOLERANCES.on_boundary
    ways = [straight] if region.core_distance(straight[None])[0] >= touch else []
    ends = region.core_distance(np.stack([straight[[0, 0]], straight[[1, 1]]]))
    for wider in WIDER:
        grown = region.grown(wider * walk.arm_length)
        if wider == 0.0 or ends.min() >= grown.radius:
            ways += [grown.walk(begin, end, sense) for sense in (1, -1)]
    return ways


def _sides_on_way(
    way: Rows, region: DangerRegion, leaving: int, arriving: int, judge: Judge
) -> IntArray | None:
    """The arm's side along a way; None where it cannot follow or would change side."""
    side = np.zeros(len(way), int)
    for visit in region.visits(project(way.points)):
        needs = {visit.entry, visit.exit}
        if visit.first == 0:
            needs.add(leaving)
        if visit.last == len(way) - 1:
            needs.add(arriving)
        needs.discard(0)
        if len(needs) > 1:
            return None
        span = slice(visit.first, visit.last + 1)
        side[span] = needs.pop() if needs else 1
        if not np.isfinite(judge(way.points[span], int(side[visit.first]))).all():
            return None
    return side
