"""The narrowest passage of the best way in, which need not be wide enough: to be told.

A way of the tip is looked for that may come nearer to obstacles than the body does,
and the opening where it comes nearest is measured in its middle. Nothing is proved.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vdsm_pin.errors import OutOfTime
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.broad_phase import BroadPhase
from vdsm_pin.planner.fewest.elastic_band import resampled
from vdsm_pin.planner.fewest.tip_room import TipRoom
from vdsm_pin.planner.fewest.tip_routes import TipSpace
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES

NEARER: Final = 0.6
"""How much nearer such a way may come, over the body's radius; [-]."""
CELLS: Final = 60_000
"""Cells at which the search for it ends."""
STEP: Final = 0.02
"""Distance of its points over the arm's length; [-]."""
FINER: Final = 20
"""Places between two of them at which it is measured."""
TURNS: Final = 16
"""Directions across the way that are tried."""
FIRST: Final = 0.3
"""The first step to the middle of an opening, over the body's radius; [-]."""
SHORTER: Final = 0.9
"""How much shorter each of them is than the one before; [-]."""


@dataclass(frozen=True)
class Passage:
    """The best way in, and where it is narrowest.

    Args:
        place: The middle of its narrowest opening, shape (3,); [m].
        route: Of the tip, shape (k, 3); [m].
    """

    place: FloatArray
    route: FloatArray


def narrowest_passage(
    problem: PlanningProblem, clearance: LinkClearance, tip: FloatArray
) -> Passage | None:
    """The best way in to a tip and the middle of its narrowest opening.

    Args:
        problem: Arm and scene.
        clearance: The planner's own, as long as to look.
        tip: Where the way ends, shape (3,); [m].

    Returns:
        None without obstacles, where there is no way, or the time is over.
    """
    if not problem.scene.obstacles:
        return None
    assert isinstance(clearance, BroadPhase)
    exact = replace(clearance, floor=-np.inf)
    arm = problem.manipulator
    required = problem.required_clearance - NEARER * arm.most_radius
    step = STEP * arm.total_length
    space = TipSpace(problem, exact, required, step, CELLS)
    try:
        for route in space.routes(tip, 1):
            points = resampled(route, step / FINER)
            worst = int(np.argmin(space.room.spare(points)))
            ends = points[[max(worst - 1, 0), min(worst + 1, len(points) - 1)]]
            place = _middle(space.room, points[worst], ends[1] - ends[0])
            return Passage(place, route)
    except OutOfTime:
        pass
    return None


def _middle(room: TipRoom, place: FloatArray, along: FloatArray) -> FloatArray:
    """The narrowest place of an opening, in its middle, shape (3,); [m].

    Steps along the way go where it is narrower, steps across where it is wider.

    Args:
        room: Measures.
        place: In the opening, shape (3,); [m].
        along: Which way it leads, shape (3,); [m].
    """
    if not along.any():
        return place
    step, turn = FIRST * room.arm.most_radius, np.arange(TURNS) * 2.0 * np.pi / TURNS
    _, _, axes = np.linalg.svd(along[None])
    across = np.column_stack([np.cos(turn), np.sin(turn)]) @ axes[1:]
    ahead = np.stack([axes[0], -axes[0]])
    while step > TOLERANCES.planned_clearance:
        for sign, ways in ((-1.0, across), (1.0, ahead)):
            tried = np.vstack([place, place + step * ways])
            place = tried[int(np.argmin(sign * room.spare(tried)))]
        step *= SHORTER
    return place
