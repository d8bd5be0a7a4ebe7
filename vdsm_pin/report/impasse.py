"""Where a search for a plan came to its end, so that a page can show it."""

from dataclasses import dataclass

import numpy as np

from vdsm_pin.arm.kinematics import joint_angles, straight_joints
from vdsm_pin.errors import Reached, VdsmError
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory


@dataclass(frozen=True)
class Impasse:
    """The place of the desired path that a search did not get past.

    Args:
        arm: The arm where it came farthest, else straight with its tip at the place,
            where it could be so, else as it starts; one row.
        posture: Which of them: "where it came farthest", "straight" or "as it starts".
        station: Along the desired path; None where nobody knows; [m].
        tip: The place itself, or the goal, base frame, shape (3,); None where nobody
            knows; [m].
        link: Of the arm shown, the one that is nearest to an obstacle, from 1; 0 where
            nobody knows.
        obstacle: Name of the obstacle that is in the way; empty where nobody knows.
        narrowest: Where the best way in is narrowest, base frame; empty where nobody
            knows; [m].
    """

    arm: Trajectory
    posture: str
    station: float | None = None
    tip: FloatArray | None = None
    link: int = 0
    obstacle: str = ""
    narrowest: tuple[float, ...] = ()


def impasse_of(problem: PlanningProblem, error: VdsmError) -> Impasse:
    """What an error of the planner knows of its place."""
    found = getattr(error, "reached", None)
    reached = found if isinstance(found, Reached) else None
    known = reached.station if reached else None
    station: float | None = getattr(error, "station", known)
    link: int = getattr(error, "link", reached.link if reached else 0)
    obstacle: str = getattr(error, "obstacle", reached.obstacle if reached else "")
    path, tip = problem.tip_path, None
    if path is None:  # a goal: what a search calls its path is one point
        station, tip = None, None if problem.goal is None else problem.goal.tip
    elif station is not None:
        tip = path.at(np.array([station]))[0]
    arm, posture = _arm(problem, reached, tip)
    narrowest = tuple(reached.narrowest) if reached else ()
    return Impasse(arm, posture, station, tip, link, obstacle, narrowest)


def _arm(
    problem: PlanningProblem, reached: Reached | None, tip: FloatArray | None
) -> tuple[Trajectory, str]:
    """The arm to show, and which one it is."""
    arm = problem.manipulator
    if reached and reached.centres:
        centres = np.array([reached.centres])
        alpha, theta = joint_angles(arm, centres)
        angles = np.stack([alpha, theta], axis=2).ravel()
        joints = np.concatenate([centres[0, 0, :1], angles])
        return Trajectory.of_joints(joints[None]), "where it came farthest"
    if tip is not None and float(np.hypot(tip[1], tip[2])) < arm.total_length:
        return Trajectory.of_joints(straight_joints(arm, tip)[None]), "straight"
    return at_start(problem), "as it starts"


def at_start(problem: PlanningProblem) -> Trajectory:
    """The arm where it begins.

    A start known by its tip is the straight arm's; where any start will do the arm is
    straight along its rail.
    """
    arm, begin = problem.manipulator, problem.begin
    if begin is not None:
        given = begin.joints
        joints = straight_joints(arm, begin.tip) if given is None else given
    else:
        joints = np.zeros(1 + 2 * arm.n_links)
        joints[0] = min(max(arm.base_range[0], 0.0), arm.base_range[1])
    return Trajectory.of_joints(joints[None])
