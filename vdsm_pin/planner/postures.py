"""Postures at random, and those of them whose tip is at a given place.

The tip is brought there by Newton's method with damping on the joint values, kept
within their limits step by step (Buss 2004).
"""

from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import link_angles, row_centres, tip_jacobian
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import BoolArray, FloatArray

MODES: Final = 3
"""Waves along the arm of which a posture at random is made."""
ROUNDS: Final = 60
"""Newton steps after which a posture is given up."""
DAMPING: Final = 1e-3
"""Of a Newton step, over the arm's length; [-]."""
ENOUGH: Final = 1e-13
"""Distance of the tip from its place over the arm's length that is rounding; [-]."""
TINY: Final = 1e-12
"""Least damping, for arms that no free joint moves; [-]."""
HELD: Final = 3
"""Times that joints are held at their limits in a step."""
USED: Final = 0.98
"""Part of the limits of joints that postures use; [-]."""


def random_postures(
    arm: Manipulator, count: int, rng: np.random.Generator
) -> FloatArray:
    """Joint values at random, neighbouring joints bent alike.

    Args:
        arm: The arm.
        count: How many.
        rng: Source of chance.

    Returns:
        Rows (x0, alpha1, theta1, ..) within the limits, shape (count, 1 + 2N); [m] in
        the first column, [rad] in the others.
    """
    along = (np.arange(arm.n_links) + 0.5) / arm.n_links
    waves = np.cos(np.pi * np.arange(MODES)[:, None] * along)
    weight = rng.normal(size=(count, 2, MODES)) @ waves
    largest = np.hypot(weight[:, 0], weight[:, 1]).max(axis=1)
    angle = USED * min(arm.max_link_angle, arm.max_joint_angle)
    size = angle * rng.random(count) / largest
    rows = np.zeros((count, 1 + 2 * arm.n_links))
    rows[:, 0] = rng.uniform(*arm.base_range, count)
    rows[:, 1::2] = weight[:, 0] * size[:, None]
    rows[:, 2::2] = weight[:, 1] * size[:, None]
    return within_limits(arm, rows)


def within_limits(arm: Manipulator, rows: FloatArray) -> FloatArray:
    """The rows, each joint turned back to its limits and the base to its rail."""
    rows = rows.copy()
    rows[:, 0] = np.clip(rows[:, 0], *arm.base_range)
    box = USED * arm.max_joint_angle
    alpha, theta = np.clip(rows[:, 1::2], -box, box), np.clip(rows[:, 2::2], -box, box)
    # A part of both angles gives less than that part of the angle between the links.
    over = link_angles(alpha, theta) / (USED * arm.max_link_angle)
    part = 1.0 / np.maximum(1.0, over)
    rows[:, 1::2], rows[:, 2::2] = part * alpha, part * theta
    return rows


def brought_to(
    arm: Manipulator, rows: FloatArray, tip: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Postures with the tip brought to a place, and for which that succeeded.

    Args:
        arm: The arm.
        rows: Where to begin, shape (n, 1 + 2N); [m], [rad].
        tip: The place, shape (3,); [m].

    Returns:
        Joint values within the limits, shape (n, 1 + 2N), and shape (n,).
    """
    length = arm.total_length
    for _ in range(ROUNDS):
        miss = (tip - row_centres(arm, rows)[:, -1]) / length
        jacobian = tip_jacobian(arm, rows[:, 1::2], rows[:, 2::2]) / length
        jacobian[:, :, 0] *= length  # a length of the rail counts as a radian
        free = np.ones(rows.shape, dtype=np.bool_)
        for _ in range(HELD):
            step = _step(jacobian * free[:, None, :], miss)
            step[:, 0] *= length
            moved = within_limits(arm, rows + step)
            # Joints at their limits are held there, the others take their part.
            free &= np.abs(moved - rows - step) <= ENOUGH * length
        rows = moved
    miss = (tip - row_centres(arm, rows)[:, -1]) / length
    return rows, np.asarray(np.linalg.norm(miss, axis=1) <= ENOUGH)


def _step(jacobian: FloatArray, miss: FloatArray) -> FloatArray:
    """The damped step of each row; damping ends where the miss does."""
    across = np.swapaxes(jacobian, 1, 2)
    damping = DAMPING * np.linalg.norm(miss, axis=1)[:, None, None] * np.eye(3)
    pull = np.linalg.solve(
        jacobian @ across + damping + TINY * np.eye(3), miss[:, :, None]
    )
    return np.asarray((across @ pull)[:, :, 0])
