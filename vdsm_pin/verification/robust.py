"""The largest joint error that a motion's clearance survives, by bisection.

A motion survives what its weakest stretch survives. So the bisection looks at stretches
that do not survive what the ones before did, and the whole is asked about the result.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np

from vdsm_pin.problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.verification.clearance import HastyProof
from vdsm_pin.verification.records import ErrorBox

LARGEST: Final = float(np.deg2rad(45.0))
"""Errors beyond this are not looked at; [rad]."""

STRETCH: Final = 256
"""Intervals asked about at once."""


def largest_joint_error(
    problem: PlanningProblem, trajectory: Trajectory, errors: ErrorBox
) -> float:
    """The largest joint error for which the clearance proof still goes through.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The motion.
        errors: Base and obstacle errors to assume besides; its joint error is ignored.

    Returns:
        A joint error that was proved, within `TOLERANCES.joint_error` of one that was
        not; 0 where not even the nominal motion is certified; [rad].
    """
    proof = HastyProof(problem, trajectory)
    end = proof.n_intervals
    largest = LARGEST
    for first in _shuffled(range(0, end, STRETCH)):
        last = min(first + STRETCH, end)
        largest = _largest(partial(_holds, proof, errors, first, last), largest)
    return _largest(partial(_holds, proof, errors, 0, end), largest)


def _holds(
    proof: HastyProof, errors: ErrorBox, first: int, last: int, joint: float
) -> bool:
    return proof.holds(replace(errors, joint=joint), first, last)


def _shuffled(firsts: range) -> list[int]:
    """An order in which a stretch weaker than all before it is rare."""
    order = np.random.default_rng(0).permutation(len(firsts))
    return [firsts[int(k)] for k in order]


def _largest(holds: Callable[[float], bool], most: float) -> float:
    """The most, where it holds; else what holds and is nearly what does not."""
    if holds(most):
        return most
    high, step = most, TOLERANCES.joint_error
    low = max(0.0, most - step)
    while not holds(low):
        if low == 0.0:
            return 0.0
        high, step = low, 2.0 * step
        low = max(0.0, low - step)
    while high - low > TOLERANCES.joint_error:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low
