"""Margins that links keep from obstacles beyond the required clearance when planning.

A margin of each link and obstacle is raised by what Coal or the proof finds missing.
Coal measures, the planner moves joints, the proof judges.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import Final, TypeAlias

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.records import Adjustment, Margin, Miss, Plan, margin_table
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
"""Pairs are measured by Coal up to this part of the body's radius past the clearance
that is asked for; [-]."""


Margins: TypeAlias = Mapping[tuple[int, str], float]
"""What a link, 1 to N, keeps from an obstacle, by its name; 0 where it is not there;
[m]."""


class CoalMeasure:
    """Coal's measure of motions in one scene, for planners and for margins.

    Args:
        problem: The scene and the required clearance.
        deadline: When to give up.
    """

    def __init__(self, problem: PlanningProblem, deadline: Deadline = NO_LIMIT) -> None:
        self._problem, self._deadline = problem, deadline
        self._clear: tuple[Trajectory, FloatArray] | None = None

    @cached_property
    def _arm(self) -> CoalArm:
        return CoalArm(self._problem, self._deadline, links=False)

    def __call__(
        self, trajectory: Trajectory, margin: Margin = 0.0, /
    ) -> tuple[Miss, ...]:
        """Links that miss the required clearance and a margin at a row.

        Args:
            trajectory: Every row is looked at.
            margin: What links keep beyond the required clearance; [m].

        Returns:
            One entry for each link and obstacle held apart that come too near, at their
            worst row, in the order of links and obstacles. A distance that Coal cannot
            tell is no reason to move: the proof decides.

        Raises:
            OutOfTime: If the time is over.
        """
        problem, worst = self._problem, dict[tuple[int, int], tuple[float, int, int]]()
        asked = problem.required_clearance + margin_table(problem, margin)
        if self._clear and self._clear[0] is trajectory:
            if (asked <= self._clear[1]).all():
                return ()
        room = NEAR * problem.manipulator.most_radius
        room += float(np.max(margin, initial=0.0))
        arm, pairs = self._arm, self._arm.pairs
        for found in arm.near(trajectory, room, deadline=self._deadline):
            link = np.minimum(pairs.one[found.pair], problem.manipulator.n_links - 1)
            obstacle = pairs.other[found.pair] - pairs.n_own
            short = found.distance < asked[link, obstacle]
            for k in np.flatnonzero(short & np.isfinite(found.distance)):
                key, told = (int(link[k]), int(obstacle[k])), float(found.distance[k])
                if key not in worst or told < worst[key][0]:
                    worst[key] = told, int(found.moment[k]), int(found.pair[k])
        if not worst:
            self._clear = trajectory, asked
        return tuple(
            Miss(row, link + 1, obstacle, told, *arm.witness(trajectory, row, pair))
            for (link, obstacle), (told, row, pair) in sorted(worst.items())
        )


def by_coal(
    plan: Plan, measure: CoalMeasure, margins: Margins
) -> tuple[Adjustment, ...]:
    """Raise margins where Coal measures less than required at a waypoint.

    Args:
        plan: With the problem whose clearance it has to keep.
        measure: Of the same scene.
        margins: Those of the plan.

    Returns:
        One entry for each link and obstacle that are too near; none where all keep it.

    Raises:
        OutOfTime: If the time is over.
    """
    needed, names = plan.problem.required_clearance, plan.problem.scene.names
    adjustments = []
    for one in measure(plan.trajectory):
        pair, missing = (one.link, names[one.obstacle]), needed - one.distance
        margin = _raised(margins, pair, missing, -missing)
        row = Adjustment(float(one.row), *pair, "Coal", one.distance, margin, one)
        adjustments.append(row)
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


def of_pairs(margins: Margins, problem: PlanningProblem) -> FloatArray:
    """The margins of each link and obstacle, shape (N, n_obstacles); [m]."""
    names = problem.scene.names
    table = np.zeros((problem.manipulator.n_links, len(names)))
    for (link, name), margin in margins.items():
        table[link - 1, names.index(name)] = margin
    return table
