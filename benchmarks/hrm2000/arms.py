"""The arms that problems are for."""

from dataclasses import replace
from typing import Final

import numpy as np

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.geometry.arrays import FloatArray

PAPER: Final = built_in("hrm8")


def made(name: str, lengths: FloatArray, radius: float, cone_deg: float) -> Manipulator:
    """An arm as long as the paper's; the lengths are taken as proportions."""
    count = len(lengths)
    limit = float(np.deg2rad(cone_deg))
    lengths = np.round(lengths / lengths.sum() * PAPER.total_length, 4)
    cables = CableLayout(0.8 * radius, 0.1 * lengths.min(), paper_hole_angles(count))
    return Manipulator(name, lengths, radius, limit, limit, (-6.4, 6.4), cables)


def scaled(arm: Manipulator, factor: float) -> Manipulator:
    """The same arm larger or smaller."""
    cables = CableLayout(
        factor * arm.cables.hole_radius,
        factor * arm.cables.half_gap,
        arm.cables.hole_angles,
    )
    low, high = arm.base_range
    return replace(
        arm,
        name=f"{arm.name}x{factor:g}",
        link_lengths=factor * arm.link_lengths,
        link_radius=factor * arm.link_radius,
        base_range=(factor * low, factor * high),
        cables=cables,
    )


EQUAL_12: Final = made("equal12", np.ones(12), 0.045, 40.0)
TAPERED_16: Final = made("tapered16", np.linspace(2.0, 1.0, 16), 0.045, 35.0)

USUAL: Final = (PAPER, PAPER, EQUAL_12, TAPERED_16)
"""Problem n of most families is for arm n modulo 4."""

NINE: Final = (
    made("n3", np.array([9.0, 8.0, 7.0]), 0.080, 42.5),
    made("n4", np.ones(4), 0.060, 42.5),
    made("n5", np.array([3.0, 2.0, 2.0, 1.0, 1.0]), 0.060, 45.0),
    made("n6", np.array([1.0, 1.5, 2.0, 2.0, 1.5, 1.0]), 0.055, 40.0),
    made("n8", np.linspace(1.0, 2.0, 8), 0.055, 42.5),
    made("n12", np.ones(12), 0.045, 40.0),
    made("n16", np.linspace(2.0, 1.0, 16), 0.045, 35.0),
    made("n24", np.ones(24), 0.040, 25.0),
    made("n40", np.ones(40), 0.030, 20.0),
)
"""Arms of 3 to 40 links."""

SMALL: Final = tuple(scaled(arm, 0.096) for arm in (PAPER, EQUAL_12, TAPERED_16))
"""Endoscopes of 0.3 m."""

LARGE: Final = tuple(scaled(arm, 6.4) for arm in (PAPER, EQUAL_12, TAPERED_16))
"""Booms of 20 m."""
