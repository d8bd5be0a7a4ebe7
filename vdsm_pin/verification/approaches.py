"""The pairs that come nearest in a motion."""

from collections.abc import Sequence
from dataclasses import replace
from math import nan
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.brackets import LeastClearances
from vdsm_pin.verification.clearance import ClearanceProof, least_clearances
from vdsm_pin.verification.enclosed import enclosed_approaches
from vdsm_pin.verification.inside import Enclosed
from vdsm_pin.verification.records import ClosestApproach, Pair, is_deepest
from vdsm_pin.verification.task import ball_of

CLOSEST: Final = 10
"""Most pairs that are listed."""


def closest_approaches(
    problem: PlanningProblem,
    trajectory: Trajectory,
    proof: ClearanceProof,
    enclosed: Enclosed | None = None,
) -> tuple[ClosestApproach, ...]:
    """The pairs that come nearest, by their upper bounds; obstacles first.

    Links keep near each other all the time, which is rarely news. The lower bound of
    the nearest is narrowed; another may lie below it by the width of that bracket.

    Args:
        problem: Arm and scene.
        trajectory: The motion.
        proof: The clearance proof of the motion.
        enclosed: Bodies that begin inside a mesh, by name of the mesh.
    """
    enclosed = enclosed or {}
    rows = list(enclosed_approaches(problem, enclosed))
    nearest = nearest_pairs(proof.pairs, least_clearances(proof))
    for near in nearest.values():
        if near.pair.own in enclosed.get(near.pair.obstacle, ()):
            continue
        deeper = is_deepest(near.upper, ball_of(problem, near.pair))
        station = _station(problem, trajectory, near)
        rows.append(replace(near, station=station, deeper=deeper))
    return tuple(rows[:CLOSEST])


def nearest_pairs(
    pairs: Sequence[Pair], least: LeastClearances
) -> dict[int, ClosestApproach]:
    """The pairs of least upper bounds by their numbers, obstacles first.

    Args:
        pairs: Every pair, of an arm or a robot.
        least: What is proved of them.
    """
    of_links = np.array([not pair.obstacle for pair in pairs], bool)
    seen = np.flatnonzero(np.isfinite(least.upper))
    order = seen[np.lexsort((least.upper[seen], of_links[seen]))][:CLOSEST]
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
    """Arc length along the link's axis of the point nearest to the witness; [m]."""
    joints, link = trajectory.path.at_moments(np.array([near.moment])), near.pair.link
    now = joints[:, 0], joints[:, 1::2], joints[:, 2::2]
    centres = joint_centres(problem.manipulator, *now)[0]
    length = float(problem.manipulator.link_lengths[link - 1])
    axis = (centres[link] - centres[link - 1]) / length
    along = float(axis @ (near.link_point - centres[link - 1]))
    return min(max(along, 0.0), length)
