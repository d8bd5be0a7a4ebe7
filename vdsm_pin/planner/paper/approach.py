"""Where the tip joins a closed path round an obstacle along the rail (4.2.2)."""

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.planner.paper.project import project
from vdsm_pin.problem.desired_path import Approach, DesiredPath


def first_station(path: DesiredPath, region: DangerRegion) -> tuple[float, str]:
    """Where the tip joins a closed path, by the scheme asked for (paper, 4.2.2).

    The equidistant points are those where the line from the start through the centre of
    the obstacle meets the path behind the obstacle: there both ways round are equal. Of
    several obstacles the line goes through the middle of all, or, for the nearest
    equidistant point, one line through each.

    Returns:
        The arc length [m], and a note where the scheme had to be widened.
    """
    if path.approach is Approach.SHORTEST or not path.closed:
        return path.entry, ""
    each = path.approach is Approach.NEAREST_EQUIDISTANT and region.centres is not None
    centres = region.centres if each else region.centre[None]
    assert centres is not None
    found = [_behind(path, centre) for centre in centres]
    stations = np.concatenate([one[0] for one in found])
    distances = np.concatenate([one[1] for one in found])
    if not len(stations):
        return path.entry, "no equidistant point: the nearest point is used"
    note = ""
    if path.approach is Approach.EQUIDISTANT and len(stations) > 1:
        note = f"{len(stations)} equidistant points: the nearest is used"
    return float(stations[np.argmin(distances)]), note


def _behind(path: DesiredPath, centre: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Where the line from the start through a centre meets the path behind it.

    Returns:
        Arc lengths along the path, and distances from the start, shape (k,) each; [m].
    """
    start = path.start[1:]
    ray = centre - start
    offsets = project(path.corners) - start
    across = ray[0] * offsets[:, 1] - ray[1] * offsets[:, 0]
    crossed = np.flatnonzero((across[:-1] <= 0.0) != (across[1:] <= 0.0))
    part = across[crossed] / (across[crossed] - across[crossed + 1])
    sides = np.diff(path.corner_stations)[crossed]
    stations = path.corner_stations[crossed] + part * sides
    along = (project(path.at(stations)) - start) @ ray / (ray @ ray)
    behind = along > 1.0
    return stations[behind], along[behind] * float(np.hypot(*ray))
