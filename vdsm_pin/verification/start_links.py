"""Whether bodies of an arm keep apart from each other where it starts."""

import numpy as np

from vdsm_pin.arm.kinematics import straight_joints
from vdsm_pin.errors import StartFolded
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.terms import REFUTED
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.clearance import prove_clearance
from vdsm_pin.verification.records import is_deepest


def check_links_at_start(problem: PlanningProblem, deadline: Deadline) -> None:
    """Refuse a start at which two bodies of the arm are proved too near each other.

    No plan begins elsewhere, and what is carried may be too near in every posture. One
    out of reach is not judged here.

    Raises:
        StartFolded: With the pair that is nearest.
    """
    arm, begin = problem.manipulator, problem.begin
    if begin is None:
        return
    joints = begin.joints
    if joints is None:
        if not np.hypot(*begin.tip[1:]) < arm.total_length:
            return
        joints = straight_joints(arm, begin.tip)
    row = Trajectory.of_joints(joints[None])
    alone = problem.among(np.zeros(len(problem.scene.obstacles), bool))
    proof = prove_clearance(alone, row, problem.errors, deadline=deadline)
    least = proof.with_depths(deadline).least
    lost = np.flatnonzero(least.verdict == REFUTED)
    if lost.size:
        k = int(lost[np.argmin(least.upper[lost])])
        upper = float(least.upper[k])
        raise StartFolded(
            pair=str(proof.pairs[k]),
            clearance=upper,
            required=problem.required_self_clearance,
            deeper=is_deepest(upper, proof.motion.asked.ball(k)),
        )
