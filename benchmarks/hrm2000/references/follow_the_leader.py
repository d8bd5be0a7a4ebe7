"""Follow the leader: every joint goes where the tip has been ("repeated path")."""

import numpy as np

from benchmarks.hrm2000.references.arm import Arm, Rows, Wanted, wanted
from vdsm_pin.arm.kinematics import joint_angles, link_angles
from vdsm_pin.errors import NoPlanFound
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.pinocchio_arm import PinocchioArm

FAR = 100.0
"""How far the rail goes on behind the start; [m]."""


def behind(
    trail: FloatArray, point: FloatArray, last: int, length: float
) -> tuple[FloatArray, int] | None:
    """The place on a trail at a distance from a point on it, going back.

    Args:
        trail: Where the tip has been, in order, shape (k, 3); [m].
        point: On the trail, shape (3,); [m].
        last: Number of the corner of the trail before the point.
        length: [m].

    Returns:
        The place and the number of the corner before it; None where the trail ends.
    """
    offsets = trail[: last + 1] - point
    far = np.flatnonzero((offsets**2).sum(axis=1) >= length**2)
    if not far.size:
        return None
    k = int(far[-1])
    a = offsets[k]
    way = (offsets[k + 1] if k < last else np.zeros(3)) - a
    square, half = float(way @ way), float(a @ way)
    under = half * half - square * (float(a @ a) - length**2)
    # Of two places the one that is nearer along the trail.
    part = (-half - np.sqrt(max(under, 0.0))) / square if square > 0.0 else 0.0
    return point + a + part * way, k


def posture(arm: Arm, trail: FloatArray, station: float) -> FloatArray:
    """Joint values of the arm lying on the trail that ends at its tip.

    Raises:
        NoPlanFound: If the base would leave its rail, or a link turns too far.
    """
    where = f"at {station:.3f} m along the path"
    centres, corner = [trail[-1]], len(trail) - 2
    for length in arm.problem.manipulator.link_lengths[::-1].tolist():
        found = behind(trail, centres[-1], corner, length)
        if found is None:
            message = f"the trail is too short {where}"
            raise NoPlanFound(message)
        centres.append(found[0])
        corner = found[1]
    chain = np.array(centres[::-1])
    off = float(np.hypot(*chain[0, 1:]))
    if off > TOLERANCES.joint_centre:
        message = f"the base would be {off:.3f} m off its rail {where}"
        raise NoPlanFound(message)
    alpha, theta = joint_angles(arm.problem.manipulator, chain[None])
    psi = float(link_angles(alpha, theta).max())
    if psi > arm.cone:
        message = f"a link angle of {np.rad2deg(psi):.1f} deg {where}"
        raise NoPlanFound(message)
    return np.concatenate([chain[0, :1], np.stack([alpha[0], theta[0]], 1).ravel()])


def lie_on(arm: Arm, goal: Wanted) -> Trajectory:
    """The motion in which the arm lies on the way of its tip, row by row.

    Raises:
        NoPlanFound: If a posture breaks a limit.
    """
    begin = arm.problem.path.start
    rail = np.array([begin - [FAR, 0.0, 0.0], begin])
    rows = Rows(arm.start(), goal.stations[0])
    for k, (station, drawn) in enumerate(zip(goal.stations, goal.drawn, strict=True)):
        q = posture(arm, np.vstack([rail, goal.tips[: k + 1]]), float(station))
        rows.add(q, float(station), bool(drawn))
    return rows.trajectory()


def follow(
    problem: PlanningProblem, robot: PinocchioArm, clearance: LinkClearance
) -> Trajectory:
    """Straight to the path and along it, the arm on the tip's trail.

    Raises:
        NoPlanFound: If a posture breaks a limit.
    """
    return lie_on(Arm(problem, robot, clearance), wanted(problem))
