"""The pairs that come nearest in a motion."""

from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.geometry.arrays import FloatArray, frozen
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.layouts import AT_UPPER, LOW, OTHER, OWN, TIME, UP
from vdsm_pin.verification.clearance import ClearanceProof
from vdsm_pin.verification.enclosed import enclosed_approaches
from vdsm_pin.verification.inside import Enclosed
from vdsm_pin.verification.records import ClosestApproach, is_deepest
from vdsm_pin.verification.task import ball_of

CLOSEST: Final = 10
"""Pairs listed."""


def closest_approaches(
    problem: PlanningProblem,
    trajectory: Trajectory,
    proof: ClearanceProof,
    around: Enclosed | None = None,
) -> tuple[ClosestApproach, ...]:
    """The pairs that come nearest, by their upper bounds; obstacles first.

    Links keep near each other all the time, which is rarely news. The lower bound of
    the nearest is narrowed; another may lie below it by the width of that bracket.

    Args:
        problem: Arm and scene.
        trajectory: The motion.
        proof: Of its distances.
        around: What begins inside the meshes that the arm is inside of.
    """
    around = around or {}
    rows = list(enclosed_approaches(problem, around))
    of_links = np.array([not pair.obstacle for pair in proof.pairs])
    seen = np.flatnonzero(np.isfinite(proof.best[:, UP]))
    for k in seen[np.lexsort((proof.best[seen, UP], of_links[seen]))][:CLOSEST]:
        pair, row = proof.pairs[k], proof.best[k]
        if pair.own in around.get(pair.obstacle, ()):
            continue
        points = row[OWN:OTHER], row[OTHER : OTHER + 3]
        # In a pair of links the sweep moves the second one against the first.
        mine, theirs = points if pair.obstacle else points[::-1]
        rows.append(
            ClosestApproach(
                interval=int(row[AT_UPPER]),
                share=float(row[TIME]),
                pair=pair,
                lower=float(row[LOW]),
                upper=float(row[UP]),
                station=_station(problem, trajectory, row, pair.link, mine),
                link_point=frozen(mine),
                other_point=frozen(theirs),
                deeper=is_deepest(float(row[UP]), ball_of(problem, pair)),
            )
        )
    return tuple(rows[:CLOSEST])


def _station(
    problem: PlanningProblem,
    trajectory: Trajectory,
    row: FloatArray,
    link: int,
    point: FloatArray,
) -> float:
    """Arc length along a link's axis of the place below its witness; [m]."""
    joints = trajectory.joints_at(row[[AT_UPPER]] + row[TIME])
    now = joints[:, 0], joints[:, 1::2], joints[:, 2::2]
    centres = joint_centres(problem.manipulator, *now)[0]
    length = float(problem.manipulator.link_lengths[link - 1])
    axis = (centres[link] - centres[link - 1]) / length
    along = float(axis @ (point - centres[link - 1]))
    return min(max(along, 0.0), length)
