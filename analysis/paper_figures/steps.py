"""Step 5 taken apart: P'_i, the auxiliary lines through it, and P_i on the boundary.

Everything is read from the planned joint centres: P'_i = k_{i,i+1} P_{i+1} (Eq. 8-10)
follows from the next joint, and the joints that were moved lie on the boundary.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np
import shapely

from paper_figures.runs import Run
from paper_figures.scenery import Zone, zone
from vdsm_pin.geometry.arrays import FloatArray

SAME: Final = 1e-9
"""P_i this near to P'_i was not moved; [m]."""

SPREAD: Final = 1e-6
"""Joints on one boundary are equally far from the section up to this; [m]."""


@dataclass(frozen=True)
class Slide:
    """How one joint gets its place in the projection.

    Args:
        joint: Its number, counted from 1.
        proportional: P'_i, shape (2,); [m].
        place: P_i, shape (2,); [m].
    """

    joint: int
    proportional: FloatArray
    place: FloatArray

    @property
    def moved(self) -> bool:
        """Whether P'_i was in the danger region."""
        return bool(np.abs(self.place - self.proportional).max() > SAME)


def slides(run: Run, row: int) -> tuple[Slide, ...]:
    """All joints from the one next to the tip down to joint 2."""
    planar, arm = run.centres[row, :, 1:], run.problem.manipulator
    return tuple(
        Slide(i, arm.ratio(i, i + 1) * planar[i], planar[i - 1])
        for i in range(arm.n_links, 1, -1)
    )


def sliding_region(run: Run, row: int) -> Zone | None:
    """The region on whose boundary the moved joints lie; None where there is none.

    It is the section grown by what the planner used at this row: at least the body
    radius and the required clearance.
    """
    section = zone(run.problem, "x", 0.0)
    moved = [slide.place for slide in slides(run, row) if slide.moved]
    if section is None or not moved:
        return None
    distances = shapely.distance(section.core, shapely.points(np.array(moved)))
    if np.ptp(distances) > SPREAD:
        return None
    return Zone(section.core, float(distances.mean()))
