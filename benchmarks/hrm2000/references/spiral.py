"""The ridge line: all joints on a spiral, whose three numbers bring the tip there.

The bends of all joints are alike, each turned against the one before by the same phase,
as in the spiral gaits of snake robots. Size and direction of the bend and the base's
place are found by Newton steps; no freedom is left to go round an obstacle.
"""

import numpy as np

from benchmarks.hrm2000.references.arm import Arm
from benchmarks.hrm2000.references.jacobian import CLOSE_ENOUGH, MOST_STEPS
from vdsm_pin.geometry.arrays import FloatArray

PHASE = np.deg2rad(10.0)
"""From joint to joint; [rad]."""


def reach(arm: Arm, q: FloatArray, tip: FloatArray) -> FloatArray | None:
    """Joint values on the spiral through the tip, or None."""
    phases = PHASE * np.arange(arm.n)
    shape = np.zeros((arm.nq, 3))
    shape[0, 0] = 1.0
    shape[1::2, 1], shape[1::2, 2] = np.cos(phases), -np.sin(phases)
    shape[2::2, 1], shape[2::2, 2] = np.sin(phases), np.cos(phases)
    numbers = q[:3].copy()  # those of the first joint, whose phase is 0
    for _ in range(MOST_STEPS):
        q = shape @ numbers
        error, turn = arm.tip(q, tip)
        if float(np.linalg.norm(error)) < CLOSE_ENOUGH:
            return q if (arm.psi(q) <= arm.cone).all() else None
        numbers += np.linalg.solve(turn @ shape, error)
    return None
