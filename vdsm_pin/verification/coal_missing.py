"""What Coal finds missing at the rows of a planned motion: it steers the planner.

Coal measures, the planner moves joints, the proof judges: nothing here is a verdict.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.coal_arm import CoalArm, CoalDistances

NEAR: Final = 0.5
"""Pairs are measured up to this part of the body's radius past the required clearance;
[-]."""


@dataclass(frozen=True)
class Missing:
    """A link that comes nearer to an obstacle than required, where it comes nearest.

    Args:
        waypoint: Row of the trajectory, from 0.
        link: 1 to N.
        obstacle: Number of the obstacle in the scene, from 0.
        distance: What Coal measures; [m].
        normal: Unit vector from the obstacle to the link between Coal's witness points,
            shape (3,); zero where they coincide; [-].
    """

    waypoint: int
    link: int
    obstacle: int
    distance: float
    normal: FloatArray


def coal_missing(
    problem: PlanningProblem, trajectory: Trajectory, deadline: Deadline = NO_LIMIT
) -> tuple[Missing, ...]:
    """Links that miss the required clearance at a row, as Coal measures it.

    Args:
        problem: The scene and the required clearance.
        trajectory: Every row is looked at.
        deadline: When to give up.

    Returns:
        One entry for each link and obstacle held apart that come too near, at their
        worst row, in the order of links and obstacles. A distance that Coal cannot tell
        is no reason to move: the proof decides.

    Raises:
        OutOfTime: If the time is over.
    """
    worst: dict[tuple[int, int], Missing] = {}
    arm = CoalArm(problem, deadline, links=False)
    room = NEAR * problem.manipulator.most_radius
    for found in arm.near(trajectory, room, deadline=deadline):
        short = found.distance < problem.required_clearance
        for k in np.flatnonzero(short & np.isfinite(found.distance)):
            one = _missing(arm, found, int(k))
            key = one.link, one.obstacle
            if key not in worst or one.distance < worst[key].distance:
                worst[key] = one
    return tuple(worst[key] for key in sorted(worst))


def _missing(arm: CoalArm, found: CoalDistances, k: int) -> Missing:
    towards, pair = found.own_point[k] - found.other_point[k], found.pair[k]
    # Inside each other the witness points lie the other way round.
    towards = towards if found.distance[k] >= 0.0 else -towards
    return Missing(
        waypoint=int(found.moment[k]),
        link=min(int(arm.pairs.one[pair]) + 1, arm.problem.manipulator.n_links),
        obstacle=int(arm.pairs.other[pair]) - arm.pairs.n_own,
        distance=float(found.distance[k]),
        normal=towards / (np.linalg.norm(towards) or 1.0),
    )
