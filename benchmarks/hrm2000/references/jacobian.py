"""One row by Newton steps on the tip's Jacobian from Pinocchio, in three ways."""

import numpy as np

from benchmarks.hrm2000.references.arm import Arm
from vdsm_pin.geometry.arrays import FloatArray

CLOSE_ENOUGH = 2e-8  # m
MOST_STEPS = 30
DAMPING = 1e-8
GAIN = 0.5
"""Of the push off obstacles and off the edge of the cone, in the null space."""
PUSHES = {"damped": 6, "projected": 10}
"""Steps after which there is no more push."""


def pseudo_inverse(arm: Arm, q: FloatArray, tip: FloatArray) -> FloatArray | None:
    """By the pseudo-inverse alone: no obstacle is looked at."""
    for _ in range(MOST_STEPS):
        error, turn = arm.tip(q, tip)
        if float(np.linalg.norm(error)) < CLOSE_ENOUGH:
            return q
        q = arm.bounded(q + np.linalg.pinv(turn) @ error)
    return None


def damped_least_squares(arm: Arm, q: FloatArray, tip: FloatArray) -> FloatArray | None:
    """By damped least squares, pushed until the row is valid; None where it is not."""
    for step in range(MOST_STEPS):
        error, turn = arm.tip(q, tip)
        close = float(np.linalg.norm(error)) < CLOSE_ENOUGH
        if close and (step >= PUSHES["damped"] or arm.valid(q)):
            return q if arm.valid(q) else None
        square = turn @ turn.T + DAMPING * np.eye(3)
        push = GAIN * arm.push(q) if step < PUSHES["damped"] else np.zeros(arm.nq)
        rest = push - turn.T @ np.linalg.solve(square, turn @ push)
        q = arm.bounded(q + turn.T @ np.linalg.solve(square, error) + rest)
    return None


def gradient_projection(arm: Arm, q: FloatArray, tip: FloatArray) -> FloatArray | None:
    """By the pseudo-inverse, pushed; whether the row is valid is left to the judge."""
    for step in range(MOST_STEPS):
        error, turn = arm.tip(q, tip)
        pushed = step < PUSHES["projected"]
        if float(np.linalg.norm(error)) < CLOSE_ENOUGH and not pushed:
            return q
        back = np.linalg.pinv(turn)
        push = GAIN * arm.push(q) if pushed else np.zeros(arm.nq)
        q = arm.bounded(q + back @ error + push - back @ (turn @ push))
    return None
