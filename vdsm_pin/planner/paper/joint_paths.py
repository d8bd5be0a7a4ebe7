"""Step 5: the joints' projected paths round an obstacle (paper, 4.3, Eq. 8-10)."""

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.planner.paper.sliding_kernels import slide_chains


def chain_ratios(manipulator: Manipulator) -> FloatArray:
    """k_{i,i+1} for i = 1..N (Eq. 6), shape (N,); [-]."""
    return manipulator.stations[:-1] / manipulator.stations[1:]


def slide_joints(
    manipulator: Manipulator,
    tip: FloatArray,
    region: DangerRegion,
    margins: FloatArray,
    side: int,
    direction: FloatArray | None,
) -> FloatArray:
    """Joints in the danger region slide onto its boundary, from the tip to the base.

    P'_i = k_{i,i+1} P_{i+1} (Eq. 8-10) is the place of joint i in proportion. Inside
    the region it moves along the auxiliary line through P'_i, to the side on which the
    arm passes, onto the boundary; outside it is P_i already.

    Args:
        manipulator: The arm with its ratios.
        tip: Projected tip P_{N+1}, shape (n_samples, 2); [m].
        region: The danger region, in the plane Y0Z0.
        margins: How far it is grown for each link, shape (N,); [m].
        side: On which side of the region the arm passes, 1 for the larger polar angle
            about P_1, -1 for the smaller.
        direction: The auxiliary lines, a unit vector towards that side, shape (2,); or
            None for the circles about P_1 through P'_i; [-].

    Returns:
        P_1..P_{N+1}, shape (n_samples, N + 1, 2); [m].
    """
    planar = np.zeros((len(tip), manipulator.n_links + 1, 2))
    planar[:, -1] = tip
    line = np.zeros(2) if direction is None else direction
    ratios = chain_ratios(manipulator)
    slide_chains(region.corners, region.radius, ratios, margins, side, line, planar)
    return planar
