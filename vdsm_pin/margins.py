"""Margins that links keep from obstacles beyond the required clearance when planning.

A margin of each link and obstacle is raised by what Coal or the proof finds missing. A
strategy is told the largest of each link alone.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.records import Plan
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.coal_arm import CoalArm
from vdsm_pin.verification.records import ArmVerification

OVERSHOOT: Final = 1.25
"""The margin grows by this times what is missing, as a plan with a larger margin also
swings a little farther; [-]."""

NEAR: Final = 0.5
"""Pairs are measured by Coal up to this part of the body's radius past the required
clearance; [-]."""


Margins: TypeAlias = Mapping[tuple[int, str], float]
"""What a link, 1 to N, keeps from an obstacle, by its name; 0 where it is not there;
[m]."""


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


class Missing(NamedTuple):
    """A link that comes nearer to an obstacle than required, where it comes nearest.

    Args:
        waypoint: Row of the trajectory, from 0.
        link: 1 to N.
        obstacle: Number of the obstacle in the scene, from 0.
        distance: What Coal measures; [m].
    """

    waypoint: int
    link: int
    obstacle: int
    distance: float


def coal_missing(
    problem: PlanningProblem, trajectory: Trajectory, deadline: Deadline = NO_LIMIT
) -> tuple[Missing, ...]:
    """Links that miss the required clearance at a row, as Coal measures it.

    Coal measures, the planner moves joints, the proof judges: this is no verdict.

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
    arm, n_links = CoalArm(problem, deadline, links=False), problem.manipulator.n_links
    room = NEAR * problem.manipulator.most_radius
    for found in arm.near(trajectory, room, deadline=deadline):
        short = found.distance < problem.required_clearance
        for k in np.flatnonzero(short & np.isfinite(found.distance)):
            pair, distance = found.pair[k], float(found.distance[k])
            link = min(int(arm.pairs.one[pair]) + 1, n_links)
            key = link, int(arm.pairs.other[pair]) - arm.pairs.n_own
            if key not in worst or distance < worst[key].distance:
                worst[key] = Missing(int(found.moment[k]), *key, distance)
    return tuple(worst[key] for key in sorted(worst))


def by_coal(plan: Plan, margins: Margins, deadline: Deadline) -> tuple[Adjustment, ...]:
    """Raise margins where Coal measures less than required at a waypoint.

    Args:
        plan: With the problem whose clearance it has to keep.
        margins: Those of the plan.
        deadline: When to give up.

    Returns:
        One entry for each link and obstacle that are too near; none where all keep it.

    Raises:
        OutOfTime: If the time is over.
    """
    problem = plan.problem
    needed, names = problem.required_clearance, problem.scene.names
    adjustments = []
    for one in coal_missing(problem, plan.trajectory, deadline):
        pair = one.link, names[one.obstacle]
        margin = _raised(margins, pair, needed - one.distance, one.distance - needed)
        when = float(one.waypoint)
        adjustments.append(Adjustment(when, *pair, "Coal", one.distance, margin))
    return tuple(adjustments)


def by_proof(verification: ArmVerification, margins: Margins) -> tuple[Adjustment, ...]:
    """Raise margins where less than required is proved over an interval.

    Args:
        verification: Of the plan.
        margins: Those of the plan.

    Returns:
        One entry for each of the closest approaches to obstacles that is too near.
    """
    needed, adjustments = verification.problem.required_clearance, []
    for near in verification.approaches:
        pair = near.pair.link, near.pair.obstacle
        # The feed, link 0, goes where x0 goes, and nowhere else.
        if all(pair) and near.lower < needed:
            margin = _raised(margins, pair, needed - near.lower, near.coal - needed)
            row = Adjustment(near.moment, *pair, "proof", near.lower, margin)
            adjustments.append(row)
    return tuple(adjustments)


def _raised(
    margins: Margins, pair: tuple[int, str], missing: float, nominal: float
) -> float:
    """The margin that a link and an obstacle need in the next round; [m].

    Args:
        margins: Those of this round.
        pair: The link and the obstacle.
        missing: What they fall short of the required clearance; [m].
        nominal: What they keep beyond it without errors by Coal, NaN where it was not
            measured; [m].
    """
    # What errors take, the plan may have kept already without being asked.
    kept = float(np.fmax(margins.get(pair, 0.0), nominal))
    return kept + (OVERSHOOT * missing + TOLERANCES.planned_clearance)


def raised_margins(margins: Margins, adjustments: tuple[Adjustment, ...]) -> Margins:
    """The margins of the next round."""
    return {**margins, **{(one.link, one.obstacle): one.margin for one in adjustments}}


def by_link(margins: Margins, n_links: int) -> FloatArray:
    """The largest margin of each link from any obstacle, shape (N,); [m]."""
    largest = np.zeros(n_links)
    for (link, _), margin in margins.items():
        largest[link - 1] = max(largest[link - 1], margin)
    return largest
