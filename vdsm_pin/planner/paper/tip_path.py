"""Step 4: the route of the tip (paper, 4.2), as far as no obstacle is met.

The tip goes from its start onto the desired path, draws it, and returns where the path
is closed. Off the path it steps back along -X, least at the ends and most at mid-way.
`detours.py` adds the way round an obstacle.
"""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, freeze
from vdsm_pin.planner.records import TipPath
from vdsm_pin.planner.spacing import spread
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.tolerances import TOLERANCES


@dataclass(frozen=True)
class Route:
    """The tip's route and the side on which the arm passes the obstacle.

    Args:
        tip_path: The route.
        side: 1 where the arm passes the obstacle on the side of the larger polar
            angle about P_1, -1 on the other, 0 where there is none, (n_samples,).
        undrawn: Stretches of the desired path left out, arc lengths from and to,
            shape (k, 2); [m].
        notes: What the user should know, one sentence each.
    """

    tip_path: TipPath
    side: IntArray
    undrawn: FloatArray
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self, "side", dtype=np.int64)
        freeze(self, "undrawn")

    @property
    def missing(self) -> float:
        """How much of the desired path is left out; [m]."""
        return length_of(self.undrawn)


class RowOf2D(NamedTuple):
    """One waypoint in the projection.

    Args:
        side: Of `Route.side`.
        tip_x: x of the tip; [m].
        planar: P_1..P_{N+1}, shape (N + 1, 2); [m].
    """

    side: int
    tip_x: float
    planar: FloatArray


def length_of(stretches: FloatArray) -> float:
    """Length of stretches from and to, shape (k, 2), together; [m]."""
    return float((stretches[:, 1] - stretches[:, 0]).sum())


@dataclass(frozen=True)
class Rows:
    """Consecutive waypoints, before they are joined to a route.

    Args:
        points: Shape (n, 3); [m].
        stations: Arc length along the desired path, shape (n,); [m].
        on_path: Whether these rows draw the path.
        side: As in `Route`, shape (n,).
    """

    points: FloatArray
    stations: FloatArray
    on_path: bool
    side: IntArray

    def __len__(self) -> int:
        """Number of waypoints."""
        return len(self.points)

    def part(self, first: int, last: int, side: IntArray) -> "Rows":
        """Waypoints first to last (included), with their sides."""
        rows = slice(first, last + 1)
        return Rows(self.points[rows], self.stations[rows], self.on_path, side)


def drawn_rows(path: DesiredPath, first: float) -> Rows:
    """The whole desired path at its spacing, corners included.

    Args:
        path: What to draw.
        first: Arc length at which a closed path is begun; 0 for an open one; [m].

    Returns:
        Waypoints; stations run from `first` to `first` + length, so a closed path
        passes its own length on the way. A single point is drawn by resting there:
        two waypoints at one place.
    """
    if not path.length > 0.0:
        return rows_at(path, np.array([first, first]))
    corners = path.corner_stations
    if path.closed:
        corners = np.concatenate([corners, corners[1:] + path.length])
    last = first + path.length
    inner = corners[(corners > first) & (corners < last)]
    knots = np.concatenate([[first], inner, [last] if last > first else []])
    counts = np.ceil(np.diff(knots) / path.spacing).astype(int)
    steps = np.repeat(np.diff(knots) / counts, counts)
    rank = np.arange(len(steps)) - np.repeat(np.cumsum(counts) - counts, counts)
    stations = np.repeat(knots[:-1], counts) + rank * steps
    return rows_at(path, np.append(stations, knots[-1]))


def rows_at(path: DesiredPath, stations: FloatArray) -> Rows:
    """Waypoints on the desired path at arc lengths from 0 to twice its length."""
    side = np.zeros(len(stations), np.int64)
    return Rows(path.at(path.wrapped(stations)), stations, True, side)


def off_path_rows(
    path: DesiredPath, line: FloatArray, from_x: float, to_x: float, station: float
) -> Rows:
    """Waypoints of a way off the path, its two ends included.

    Args:
        path: For its spacing and retreat.
        line: Projected way, a polyline of shape (m, 2), m >= 2; [m].
        from_x: x of the tip at the beginning; [m].
        to_x: x of the tip at the end; [m].
        station: Arc length at which the path was left, or where it begins; [m].

    Returns:
        Waypoints, an odd number of them, so that one is at mid-way.
    """
    sides = np.linalg.norm(np.diff(line, axis=0), axis=1)
    walked = np.concatenate([[0.0], np.cumsum(sides)])
    length = float(walked[-1])
    # A way shorter than one row leaves nothing to step back from.
    retreat = path.retreat if length > path.spacing else 0.0
    # No waypoint moves faster than this over the unit interval.
    fastest = float(np.hypot(length, abs(to_x - from_x) + np.pi * retreat))
    n_rows = 2 * int(np.ceil(fastest / (2.0 * path.spacing))) + 1
    part = np.linspace(0.0, 1.0, n_rows)
    points = np.zeros((n_rows, 3))
    points[:, 0] = from_x + part * (to_x - from_x) - retreat * np.sin(np.pi * part)
    for column in (0, 1):
        points[:, 1 + column] = np.interp(part * length, walked, line[:, column])
    stations = np.full(n_rows, station)
    return Rows(points, stations, False, np.zeros(n_rows, np.int64))


def straight_route(path: DesiredPath) -> Route:
    """The route where no obstacle is met: to the path, along it, and back."""
    first = path.entry
    drawn = drawn_rows(path, first)
    there = _straight(path, path.start, drawn.points[0], first)
    parts = [there, drawn]
    if path.closed:
        parts.append(_straight(path, drawn.points[-1], path.start, first))
    return join(path, parts)


def _straight(
    path: DesiredPath, begin: FloatArray, end: FloatArray, station: float
) -> Rows:
    line = np.stack([begin[1:], end[1:]])
    return off_path_rows(path, line, float(begin[0]), float(end[0]), station)


def join(path: DesiredPath, parts: list[Rows], notes: tuple[str, ...] = ()) -> Route:
    """Put ways together; a waypoint shared by two of them counts as drawn."""
    kept = []
    for k, rows in enumerate(parts):
        if rows.on_path:
            kept.append(rows)
            continue
        begin = 1 if k > 0 else 0
        end = len(rows) - (1 if k + 1 < len(parts) else 0)
        kept.append(rows.part(begin, end - 1, rows.side[begin:end]))
    stations = path.wrapped(np.concatenate([rows.stations for rows in kept]))
    on_path = np.concatenate([np.full(len(rows), rows.on_path) for rows in kept])
    points = np.concatenate([rows.points for rows in kept])
    side = np.concatenate([rows.side for rows in kept])
    undrawn = undrawn_by(path, [rows for rows in kept if rows.on_path])
    return Route(TipPath(points, on_path, stations), side, undrawn, notes)


def undrawn_by(path: DesiredPath, drawn: list[Rows]) -> FloatArray:
    """Stretches no drawn part covers, shape (k, 2); [m]."""
    covered = []
    for rows in drawn:
        first, last = float(rows.stations[0]), float(rows.stations[-1])
        if last <= path.length:
            covered.append((first, last))
        elif first >= path.length:
            covered.append((first - path.length, last - path.length))
        else:
            covered += [(first, path.length), (0.0, last - path.length)]
    gaps, reached = [], 0.0
    for first, last in [*sorted(covered), (path.length, path.length)]:
        if first - reached > TOLERANCES.on_path_length:
            gaps.append((reached, first))
        reached = max(reached, last)
    return np.array(gaps).reshape(-1, 2)


def subdivided(path: DesiredPath, route: Route, pieces: IntArray) -> Route:
    """The same route with more waypoints.

    Args:
        path: The desired path, on which drawn waypoints stay.
        route: The route.
        pieces: Into how many pieces each interval is cut, shape (n_samples - 1,).
    """
    tip = route.tip_path
    interval, part = (places[:-1] for places in spread(pieces))
    begin, end = np.append(interval, len(pieces)), np.append(interval + 1, len(pieces))
    part = np.append(part, 0.0)
    points = tip.points[begin] + part[:, None] * (tip.points[end] - tip.points[begin])
    after = tip.path_m[end]
    # A closed path passes its first point: stations go on from length to 0.
    after = np.where(after < tip.path_m[begin], after + path.length, after)
    stations = tip.path_m[begin] + part * (after - tip.path_m[begin])
    on_path = np.where(part > 0.0, tip.on_path[begin] & tip.on_path[end], False)
    on_path |= (part == 0.0) & tip.on_path[begin]
    side = np.where(route.side[begin] != 0, route.side[begin], route.side[end])
    stations = np.where(on_path | (part == 0.0), stations, tip.path_m[begin])
    tip = TipPath(points, on_path, path.wrapped(stations))
    return replace(route, tip_path=tip, side=side)
