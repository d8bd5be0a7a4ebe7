"""How far the rail goes until the feed behind the arm is too near an obstacle.

The feed lies along the rail, so that x0 alone says where it is. A motion begins at a
given x0 and cannot pass a value at which the feed is too near: planners get the rail
between the nearest of those.
"""

from dataclasses import replace
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.records import Prepared
from vdsm_pin.planner.start import start_centres
from vdsm_pin.planner.upper_clearance import feed_culprit
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.units import in_mm

END_WITHIN: Final = 1e-6
"""How far beyond the place where it comes too near the rail may end; [m]."""


def within_feed(known: Prepared) -> Prepared:
    """Shorten the rail to where the feed can come from its start.

    An end moves only to a value at which the feed is proved too near, so that what is
    proved impossible of the shorter rail is impossible.
    """
    problem, arm = known.problem, known.problem.manipulator
    start = start_centres(problem)[0]
    if not arm.feed or not np.isfinite(start).all():
        return known
    ends, notes = list(arm.base_range), []
    for side, end in enumerate(arm.base_range):
        found = _last_place(problem, start, end)
        if found is not None:
            ends[side], obstacle = found
            notes.append(
                f"the feed keeps x0 {('above', 'below')[side]} {in_mm(ends[side])}, "
                f"for {obstacle!r} (in the base frame)"
            )
    if not notes:
        return known
    shorter = replace(arm, base_range=(ends[0], ends[1]))
    problem = replace(problem, manipulator=shorter)
    return Prepared(problem, (*known.notes, *notes))


def _last_place(
    problem: PlanningProblem, start: FloatArray, end: float
) -> tuple[float, str] | None:
    """The x0 at which the feed is too near, and to what; None if none is on the way.

    What the feed sweeps as it slides is as long and grows steadily: bisection. Base and
    surfaces may be off in any direction: by so much more is required. What turns add is
    left to the verification.
    """
    errors, clear = problem.errors, float(start[0])
    required = problem.required_clearance + errors.base + errors.obstacle
    found = feed_culprit(problem, start, end)
    if not found.clearance < required:
        return None
    if feed_culprit(problem, start).clearance < required:
        return None
    while abs(end - clear) > END_WITHIN:
        middle = (clear + end) / 2.0
        near = feed_culprit(problem, start, middle)
        if near.clearance < required:
            end, found = middle, near
        else:
            clear = middle
    return end, found.obstacle
