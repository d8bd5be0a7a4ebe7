"""Margins that links keep from obstacles beyond the required clearance when planning.

A margin of each link and obstacle is raised by what Coal or the proof finds missing.
"""

from dataclasses import dataclass
from typing import Final, Literal

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.records import Plan
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.time_limit import Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.coal_missing import coal_missing
from vdsm_pin.verification.records import ArmVerification

OVERSHOOT: Final = 1.25
"""The margin grows by this times what is missing, as a plan with a larger margin also
swings a little farther; [-]."""


@dataclass(frozen=True)
class Adjustment:
    """A margin that was raised after a round, and why.

    Args:
        moment: Where the clearance was missed, in waypoints of that round's motion.
        link: 1 to N.
        obstacle: Its name.
        measured_by: "Coal" at a waypoint, or "proof" over an interval.
        distance: What it found; [m].
        margin: What the link keeps beyond the required clearance from now on; [m].
    """

    moment: float
    link: int
    obstacle: str
    measured_by: Literal["Coal", "proof"]
    distance: float
    margin: float


def by_coal(
    plan: Plan, margins: FloatArray, deadline: Deadline
) -> tuple[Adjustment, ...]:
    """Raise margins where Coal measures less than required at a waypoint.

    Args:
        plan: With the problem whose clearance it has to keep.
        margins: Those of the plan, shape (N, n_obstacles); [m].
        deadline: When to give up.

    Returns:
        One entry for each link and obstacle that are too near; none where all keep it.

    Raises:
        OutOfTime: If the time is over.
    """
    problem = plan.problem
    return tuple(
        _adjustment(
            problem, margins, float(one.waypoint), one.link, one.obstacle,
            ("Coal", one.distance, one.distance),
        )
        for one in coal_missing(problem, plan.trajectory, deadline)
    )  # fmt: skip


def by_proof(
    verification: ArmVerification, margins: FloatArray
) -> tuple[Adjustment, ...]:
    """Raise margins where less than required is proved over an interval.

    Args:
        verification: Of the plan.
        margins: Those of the plan, shape (N, n_obstacles); [m].

    Returns:
        One entry for each of the closest approaches to obstacles that is too near.
    """
    problem = verification.problem
    names = problem.scene.names
    return tuple(
        _adjustment(
            problem, margins, near.moment, near.pair.link,
            names.index(near.pair.obstacle), ("proof", near.lower, near.coal),
        )
        for near in verification.approaches
        if near.pair.link  # the feed goes where x0 goes, and nowhere else
        and near.pair.obstacle
        and near.lower < problem.required_clearance
    )  # fmt: skip


def _adjustment(
    problem: PlanningProblem,
    margins: FloatArray,
    moment: float,
    link: int,
    obstacle: int,
    found: tuple[Literal["Coal", "proof"], float, float],
) -> Adjustment:
    """The margin that a link and an obstacle need in the next round.

    Args:
        problem: With the required clearance.
        margins: Those of this round, shape (N, n_obstacles); [m].
        moment: When the clearance is missed, in waypoints.
        link: 1 to N.
        obstacle: Number of the obstacle in the scene, from 0.
        found: Who found it; the clearance under the errors of the problem; and the
            clearance without errors by Coal, NaN where it was not measured; [m].
    """
    measured_by, distance, nominal = found
    missing = problem.required_clearance - distance
    more = OVERSHOOT * missing + TOLERANCES.planned_clearance
    # What errors take, the plan may have kept already without being asked.
    kept = np.fmax(margins[link - 1, obstacle], nominal - problem.required_clearance)
    margin = float(kept) + more
    name = problem.scene.names[obstacle]
    return Adjustment(moment, link, name, measured_by, distance, margin)


def raised_margins(
    problem: PlanningProblem, margins: FloatArray, adjustments: tuple[Adjustment, ...]
) -> FloatArray:
    """The margins of the next round, shape (N, n_obstacles); [m]."""
    raised = margins.copy()
    for one in adjustments:
        raised[one.link - 1, problem.scene.names.index(one.obstacle)] = one.margin
    return raised
