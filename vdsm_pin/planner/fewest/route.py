"""The tip's stations: the way to the desired path, and the path in drawing order."""

import itertools
from dataclasses import dataclass

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.problem import DesiredPath, PlanningProblem


@dataclass(frozen=True)
class TipRoute:
    """Tip positions where shapes are tried, and how the tip moves among them.

    Args:
        tips: Positions, shape (k, 3); [m].
        layers: Tip numbers along the desired path in drawing order, shape (l,).
        stations: Arc length along the desired path at each layer; on a closed path
            they go on counting past its length, shape (l,); [m].
        rows: Rows of the trajectory from the layer before to each layer, shape (l,).
        first: Where each tip's neighbours begin, shape (k + 1,).
        links: Neighbouring tips, shape (m,).
        gaps: Distances to them, shape (m,); [m].
    """

    tips: FloatArray
    layers: IntArray
    stations: FloatArray
    rows: IntArray
    first: IntArray
    links: IntArray
    gaps: FloatArray


def nearest_station(path: DesiredPath, point: FloatArray) -> float:
    """Arc length of the path's point nearest to a point, the first of equals; [m]."""
    corners, stations = path.corners, path.corner_stations
    best, where = np.inf, 0.0
    for a, b, station in zip(corners[:-1], corners[1:], stations[:-1], strict=True):
        side = b - a
        square = float(side @ side)
        t = min(max(float((point - a) @ side) / square, 0.0), 1.0) if square else 0.0
        distance = float(np.linalg.norm(a + t * side - point))
        if distance < best - 1e-12:
            best, where = distance, station + t * float(np.sqrt(square))
    return where


def drawing_stations(
    path: DesiredPath, begin: float, coarse: float
) -> tuple[FloatArray, IntArray]:
    """Stations of the layers and the number of rows up to each.

    Every corner is a layer; each side is divided evenly, rows at most `spacing` apart
    and layers about `coarse` apart.
    """
    corners = path.corner_stations
    if begin > 0.0:
        later, sooner = corners[corners > begin], corners[1:][corners[1:] < begin]
        corners = np.concatenate(
            [[begin], later, sooner + path.length, [begin + path.length]]
        )
    stations, rows = [corners[:1]], [np.zeros(1, dtype=np.int64)]
    for a, b in itertools.pairwise(corners):
        if b - a <= 0.0:
            continue
        n_rows = max(1, int(np.ceil((b - a) / path.spacing - 1e-9)))
        n_layers = max(1, min(n_rows, int(np.ceil((b - a) / coarse - 1e-9))))
        marks = np.round(np.linspace(0, n_rows, n_layers + 1)).astype(np.int64)
        side = a + (b - a) * marks[1:] / n_rows
        side[-1] = b
        stations.append(side)
        rows.append(np.diff(marks))
    return np.concatenate(stations), np.concatenate(rows)


def _chain(begin: FloatArray, end: FloatArray, coarse: float) -> FloatArray:
    """Points from begin (included) to end (left out), at most `coarse` apart."""
    count = max(1, int(np.ceil(float(np.linalg.norm(end - begin)) / coarse)))
    return np.asarray(begin + np.outer(np.arange(count) / count, end - begin))


def tip_route(problem: PlanningProblem, coarse: float, back: float = 0.0) -> TipRoute:
    """Approach and path as one chain of tips, closed where the path is.

    Args:
        problem: What was asked.
        coarse: Largest distance between neighbouring tips; [m].
        back: How far behind the chain there shall be tips too, along -X; [m].
    """
    path = problem.path
    begin = 0.0
    if path.closed and len(path.points) > 1:
        begin = nearest_station(path, path.start)
    stations, rows = drawing_stations(path, begin, coarse)
    drawn = path.at(np.where(stations > path.length, stations - path.length, stations))
    approach = _chain(path.start, drawn[0], coarse)
    tips = np.vstack([approach, drawn])
    n, k = len(tips), len(approach)
    pairs = [(i, i + 1) for i in range(n - 1)]
    if path.closed and n - k > 2:
        pairs.append((k, n - 1))
    if back > 0.0:
        tips, more = _behind(tips, pairs[-1] == (k, n - 1), k, coarse, back)
        pairs += more
    return _linked(tips, np.arange(k, n), stations, rows, np.array(pairs))


SHEET_STRIDE = 4
"""Only every fourth tip of the chain has tips behind it; the search is for ways."""


def _behind(
    tips: FloatArray, closed: bool, entry: int, coarse: float, back: float
) -> tuple[FloatArray, list[tuple[int, int]]]:
    """The chain's tips and, in a sheet behind them, tips drawn back along -X."""
    n = len(tips)
    feet = [*range(0, n - 1, SHEET_STRIDE), n - 1]
    step = SHEET_STRIDE * coarse
    depth = max(1, int(np.ceil(back / step)))
    sheet, pairs = [tips], []
    for level in range(1, depth + 1):
        first = n + (level - 1) * len(feet)
        sheet.append(tips[feet] - np.array([level * step, 0.0, 0.0]))
        for i, foot in enumerate(feet):
            under = foot if level == 1 else first - len(feet) + i
            pairs.append((under, first + i))
            if i + 1 < len(feet):
                pairs.append((first + i, first + i + 1))
        if closed:
            nearest = int(np.argmin(np.abs(np.array(feet) - entry)))
            pairs.append((first + nearest, first + len(feet) - 1))
    return np.vstack(sheet), pairs


def _linked(
    tips: FloatArray,
    layers: IntArray,
    stations: FloatArray,
    rows: IntArray,
    pairs: IntArray,
) -> TipRoute:
    both = np.vstack([pairs.reshape(-1, 2), pairs.reshape(-1, 2)[:, ::-1]])
    both = both[np.lexsort((both[:, 1], both[:, 0]))]
    first = np.searchsorted(both[:, 0], np.arange(len(tips) + 1))
    gaps = np.linalg.norm(tips[both[:, 0]] - tips[both[:, 1]], axis=1)
    return TipRoute(
        tips, layers, stations, rows, first.astype(np.int64), both[:, 1].copy(), gaps
    )
