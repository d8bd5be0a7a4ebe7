"""The pairs that come nearest in a motion."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import nan
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.geometry.arrays import BoolArray, IntArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.brackets import LeastClearances
from vdsm_pin.verification.records import ClosestApproach, Pair

CLOSEST: Final = 10
"""Most pairs that are listed."""


def closest_approaches(
    problem: PlanningProblem,
    trajectory: Trajectory,
    nearest: Mapping[int, ClosestApproach],
) -> dict[int, ClosestApproach]:
    """The pairs that come nearest in a snake arm's motion, with places along links."""
    return {
        k: replace(near, station=_station(problem, trajectory, near))
        for k, near in nearest.items()
    }


def nearest_pairs(
    pairs: Sequence[Pair], outer: BoolArray, least: LeastClearances
) -> dict[int, ClosestApproach]:
    """The pairs of least upper bounds by their numbers, obstacles first.

    Links keep near each other all the time, which is rarely news. The lower bound of
    the nearest is narrowed; another may lie below it by the width of that bracket.
    Under errors one that comes less near may be proved to keep less than any of these
    from its obstacle; then it takes the place of the last.

    Args:
        pairs: Every pair, of an arm or a robot.
        outer: Which of them are with an obstacle, shape (n_pairs,).
        least: What is proved of them.
    """
    of_links, seen = ~outer, np.flatnonzero(np.isfinite(least.upper))

    def nearest(some: IntArray) -> IntArray:
        return some[np.lexsort((least.upper[some], of_links[some]))][:CLOSEST]

    order = nearest(seen)
    lower = np.where(of_links, np.inf, least.lower)[seen]
    least_of_all = lower.min(initial=np.inf) + 2.0 * TOLERANCES.least_bracket
    if order.size and (least.lower[order] > least_of_all).all():
        weakest = seen[np.argmin(lower)]
        order = nearest(np.append(order[: CLOSEST - 1], weakest))
    return {
        k: ClosestApproach(
            interval=int(least.interval[k]),
            share=float(least.share[k]),
            pair=pairs[k],
            lower=float(least.lower[k]),
            upper=float(least.upper[k]),
            station=nan,
            link_point=least.link_point[k],
            other_point=least.other_point[k],
        )
        for k in order.tolist()
    }


def _station(
    problem: PlanningProblem, trajectory: Trajectory, near: ClosestApproach
) -> float:
    """Arc length along the link's axis of the point nearest to the witness; [m].

    Of the feed, which lies along the rail, it counts back from O_1 and is negative.
    """
    arm, link = problem.manipulator, near.pair.link
    joints = trajectory.path.at_moments(np.array([near.moment]))
    if not link and arm.feed:
        return float(np.clip(near.link_point[0] - joints[0, 0], -arm.feed.length, 0.0))
    now = joints[:, 0], joints[:, 1::2], joints[:, 2::2]
    centres = joint_centres(arm, *now)[0]
    length = float(arm.link_lengths[link - 1])
    axis = (centres[link] - centres[link - 1]) / length
    along = float(axis @ (near.link_point - centres[link - 1]))
    return min(max(along, 0.0), length)
