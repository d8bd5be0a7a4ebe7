"""Step 7: joint angles from the joint centres, within every limit (paper, section 5).

The step's cable lengths are `vdsm_pin.arm.cables.cable_lengths`.
"""

import numpy as np

from vdsm_pin.arm.kinematics import joint_angles, link_angles
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import LimitExceeded
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.paper.tip_path import Route
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES


def solve(manipulator: Manipulator, route: Route, centres: FloatArray) -> Trajectory:
    """The motion in joint space (Eq. 11-15), checked against every limit.

    Args:
        manipulator: The arm.
        route: Step 4's route.
        centres: Step 6's joint centres, shape (n_samples, N + 1, 3); [m].

    Returns:
        The trajectory.

    Raises:
        LimitExceeded: If psi, theta, alpha or x0 leaves its range anywhere.
    """
    alpha, theta = joint_angles(manipulator, centres)
    x0 = centres[:, 0, 0]
    check_limits(manipulator, x0, alpha, theta)
    tip = route.tip_path
    return Trajectory(tip.on_path, tip.path_m, x0, alpha, theta)


def check_limits(
    manipulator: Manipulator, x0: FloatArray, alpha: FloatArray, theta: FloatArray
) -> None:
    """Refuse a motion that leaves the psi cone, the theta/alpha box or the rail.

    Args:
        manipulator: The arm.
        x0: Base positions, shape (n_samples,); [m].
        alpha: Yaw angles, shape (n_samples, N); [rad].
        theta: Pitch angles, shape (n_samples, N); [rad].

    Raises:
        LimitExceeded: With the worst waypoint, the joint, the value and the limit.
    """
    box, cone = manipulator.max_joint_angle, manipulator.max_link_angle
    rounding = TOLERANCES.planned_limit
    psi = np.zeros_like(alpha)
    # psi is at most the root of alpha^2 + theta^2, as a sphere curves inwards.
    near = ~(alpha * alpha + theta * theta < cone * cone)
    psi[near] = link_angles(alpha[near], theta[near])
    for name, values, limit in (
        ("psi", psi, cone),
        ("|theta|", np.abs(theta), box),
        ("|alpha|", np.abs(alpha), box),
    ):
        if not (values <= limit + rounding).all():
            waypoint, joint = np.unravel_index(int(np.argmax(values)), values.shape)
            raise LimitExceeded(
                waypoint=int(waypoint),
                quantity=f"{name} of joint {joint + 1}",
                value=float(np.rad2deg(values[waypoint, joint])),
                limit=float(np.rad2deg(limit)),
                unit="deg",
            )
    low, high = manipulator.base_range
    for worst, limit, kept in (
        (int(np.argmin(x0)), low, bool((x0 >= low - rounding).all())),
        (int(np.argmax(x0)), high, bool((x0 <= high + rounding).all())),
    ):
        if not kept:
            value = float(x0[worst])
            raise LimitExceeded(
                waypoint=worst, quantity="x0", value=value, limit=limit, unit="m"
            )
