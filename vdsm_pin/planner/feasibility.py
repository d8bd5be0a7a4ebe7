"""Step 1: can the arm reach the desired path at all (paper, 3.2, Eq. 4)?

Two radii about the rail matter. Eq. 4 bends every joint to its limit, so the arm curls
up until its links stand square to the rail: no arm reaches farther. The method itself
keeps the arm straight where nothing is in the way, so its first joint alone must lean
as far as the tip is out; this radius is smaller. A tip between the two passes the
paper's test and breaks the limit of psi_1 in its method. Both are tested.
"""

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import OutOfReach
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.units import in_mm


def curled_reach(manipulator: Manipulator) -> float:
    """r_yz, the reach with every joint at its limit (Eq. 4); [m]."""
    inclination = manipulator.max_link_angle * np.arange(1, manipulator.n_links + 1)
    rise = np.sin(np.minimum(inclination, np.pi / 2.0))
    return float(manipulator.link_lengths @ rise)


def straight_reach(manipulator: Manipulator) -> float:
    """The reach of the straight arm, whose only changed link angle is psi_1; [m]."""
    return manipulator.total_length * float(np.sin(manipulator.max_link_angle))


def rail_distance(manipulator: Manipulator, tips: FloatArray) -> FloatArray:
    """Distance of tips (n, 3) from where the base can be, shape (n,); [m]."""
    low, high = manipulator.base_range
    along = tips[:, 0] - np.clip(tips[:, 0], low, high)
    return np.asarray(np.hypot(along, np.hypot(tips[:, 1], tips[:, 2])))


def check_feasibility(manipulator: Manipulator, path: DesiredPath) -> None:
    """Refuse a path that leaves the reach.

    The distance from the rail is convex along a straight side: the corners decide.

    Args:
        manipulator: The arm.
        path: The desired path.

    Raises:
        OutOfReach: With the place that lies farthest out and the reach it exceeds.
    """
    places = np.vstack([path.start, path.points])
    distances = np.hypot(places[:, 1], places[:, 2])
    worst = int(np.argmax(distances))
    place = f"point {worst} of the desired path" if worst else "the start"
    distance = float(distances[worst])
    curled, straight = curled_reach(manipulator), straight_reach(manipulator)
    if distance > curled:
        reason = "every joint at its limit, Eq. 4"
        raise OutOfReach(place=place, distance=distance, reach=curled, reason=reason)
    if distance > straight:
        reason = f"straight arm; curled up it would reach {in_mm(curled)}"
        raise OutOfReach(place=place, distance=distance, reach=straight, reason=reason)
