"""Step 5: the joints' projected paths round an obstacle (paper, 4.3, Eq. 8-10)."""

from dataclasses import dataclass

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.planner.paper.sliding_kernels import Links, slide_chains, slide_of


@dataclass(frozen=True)
class SideRule:
    """How joints get out of the danger region on one side.

    Args:
        region: What they slide on, in the plane Y0Z0.
        side: On which side of the region the arm passes, 1 for the larger polar angle
            about P_1, -1 for the smaller.
        direction: The auxiliary lines, a unit vector towards that side, shape (2,);
            zero for the circles about P_1 through P'_i; [-].
        margins: How far the region is grown for each link, shape (N,); [m].
    """

    region: DangerRegion
    side: int
    direction: FloatArray
    margins: FloatArray


def chain_ratios(manipulator: Manipulator) -> FloatArray:
    """k_{i,i+1} for i = 1..N (Eq. 6), shape (N,); [-]."""
    return manipulator.stations[:-1] / manipulator.stations[1:]


def links_of(manipulator: Manipulator, margins: FloatArray) -> Links:
    """The arm as compiled code takes it, its cone and box kept by the link angle."""
    largest = min(manipulator.max_link_angle, manipulator.max_joint_angle)
    ratios, lengths = chain_ratios(manipulator), manipulator.link_lengths
    return Links(ratios, lengths, margins, float(np.cos(largest)))


def slide_joints(
    manipulator: Manipulator, tip: FloatArray, rule: SideRule
) -> FloatArray:
    """Joints in the danger region slide onto its boundary, from the tip to the base.

    P'_i = k_{i,i+1} P_{i+1} (Eq. 8-10) is the place of joint i in proportion. Inside
    the region it moves along the auxiliary line through P'_i, to the side on which the
    arm passes, onto the boundary; outside it is P_i already.

    Args:
        manipulator: The arm with its ratios.
        tip: Projected tip P_{N+1}, shape (n_samples, 2); [m].
        rule: The region and how joints get out of it.

    Returns:
        P_1..P_{N+1}, shape (n_samples, N + 1, 2); [m].
    """
    planar = np.zeros((len(tip), manipulator.n_links + 1, 2))
    planar[:, -1] = tip
    slide = slide_of(rule.region.core, rule.side, rule.direction)
    slide_chains(slide, links_of(manipulator, rule.margins), planar)
    return planar
