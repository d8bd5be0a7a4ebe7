"""The largest joint error that a motion's clearance survives, from both sides.

A motion survives what its weakest stretch survives. So the bisection looks at stretches
that do not survive what the ones before did, and the whole is asked about the result.
Around the first interval that survives no more, an error is sought that loses the
clearance.
"""

from collections.abc import Callable, Sequence
from functools import partial
from math import nan
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.terms import UNDECIDED
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.assembly import obstacle_growth
from vdsm_pin.verification.clearances import in_rows, least_clearances
from vdsm_pin.verification.counterexample import Search, starts
from vdsm_pin.verification.yes_or_no import YesOrNoProof, is_certified

LARGEST: Final = float(np.deg2rad(45.0))
"""Largest joint error that is tried; [rad]."""

STRETCH: Final = 256
"""Intervals of a stretch that is proved at once."""

FIRST_STEP: Final = 1.0 / 8.0
"""The next error tried is less by this share of one that is not survived; [-]."""

FACTORS: Final = (1.25, 2.0, 4.0)
"""How far beyond what is proved counterexamples are sought."""

SOUGHT: Final = 3
"""Most pairs for which counterexamples are sought."""

AROUND: Final = 16
"""So many intervals before and after the first that is lost are searched."""

MANY: Final = 1_000
"""Of more obstacles than this the far ones are left out first."""

FEW: Final = 64
"""Obstacles that are asked about before the others."""

SPARE: Final = 1e-6
"""What an obstacle that is left out keeps beyond what is asked for; [m]."""

LOOKS: Final = 8
"""Slices of an interval that tell well enough where a pair is near."""


def largest_joint_error(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    deadline: Deadline = NO_LIMIT,
    clearances: FloatArray | None = None,
) -> float:
    """The largest joint error for which the clearance proof still goes through.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The motion.
        errors: Base and obstacle errors to assume besides; its joint error is ignored.
        deadline: When to give up.
        clearances: Proved least clearance of each obstacle from the nominal motion,
            shape (n_obstacles,), which spares looking at far ones; [m].

    Returns:
        A joint error that was proved, within `TOLERANCES.joint_error` of one that was
        not; 0 where not even the nominal motion is certified; [rad].

    Raises:
        OutOfTime: If the time is over.
    """
    largest = LARGEST
    if clearances is not None and len(clearances) > MANY:
        # No motion survives more than what the nearest obstacles leave it.
        bound = float(np.partition(clearances, FEW)[FEW])
        some = problem.among(~(clearances > bound))
        largest = _largest_of_all(some, trajectory, errors, largest, deadline)
        problem = within_reach(problem, clearances, errors.with_joint(largest))
    return _largest_of_all(problem, trajectory, errors, largest, deadline)


def within_reach(
    problem: PlanningProblem, clearances: FloatArray, errors: ErrorBox
) -> PlanningProblem:
    """The problem without the obstacles that no error within a box brings too near.

    A joint angle that is off by E moves what is beyond it by E times its distance at
    most, which is the sum of the links between: two angles a joint make 2 E sum l L_l.

    Args:
        problem: Arm, scene, required clearances.
        clearances: Proved of each obstacle and the nominal motion, (n_obstacles,); [m].
        errors: The box.
    """
    arm, lengths = problem.manipulator, problem.manipulator.link_lengths
    lever = 2.0 * float(np.arange(1, lengths.size + 1) @ lengths)
    lever += 2.0 * lengths.size * arm.most_radius  # of what sticks out of the axis
    moved = (
        errors.joint * lever
        + errors.base
        + max(obstacle_growth(problem.scene.obstacles, errors))
    )
    far = float(np.abs(arm.base_range).max()) + arm.total_length + arm.most_radius
    moved += errors.base_turn * (far + moved)
    bound = problem.required_clearance + moved + SPARE
    return problem.among(~(clearances > bound))


def _largest_of_all(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    most: float,
    deadline: Deadline,
) -> float:
    """`largest_joint_error` with errors up to `most` [rad] and all obstacles."""
    proof = YesOrNoProof(problem, trajectory, deadline)
    end, largest = proof.n_intervals, most
    for first in _shuffled(range(0, end, STRETCH)):
        last = min(first + STRETCH, end)
        largest = _largest(partial(_holds, proof, errors, first, last), largest)
    return _largest(partial(_holds, proof, errors, 0, end), largest)


def sturdiest(
    problem: PlanningProblem,
    motions: Sequence[Trajectory],
    deadline: Deadline = NO_LIMIT,
) -> tuple[int, float]:
    """Which of several motions survives the largest joint error.

    Args:
        problem: Arm, scene, required clearances.
        motions: At least one; of those equal within the width of the bisection the
            first is taken.
        deadline: When to give up.

    Returns:
        Its number, and its largest certified joint error; [rad].

    Raises:
        OutOfTime: If the time is over.
    """
    none = ErrorBox()
    best, largest = 0, largest_joint_error(problem, motions[0], none, deadline)
    for number, motion in enumerate(motions[1:], start=1):
        # Most are told apart by the first gap in the proof of what the best survives.
        if is_certified(problem, motion, ErrorBox(joint=largest), deadline):
            error = largest_joint_error(problem, motion, none, deadline)
            if error > largest + TOLERANCES.joint_error:
                best, largest = number, error
    return best, largest


def _holds(
    proof: YesOrNoProof, errors: ErrorBox, first: int, last: int, joint: float
) -> bool:
    return proof.holds(errors.with_joint(joint), first, last)


def _shuffled(firsts: range) -> list[int]:
    """An order in which a stretch weaker than all before it is rare."""
    order = np.random.default_rng(0).permutation(len(firsts))
    return [firsts[int(k)] for k in order]


def _largest(holds: Callable[[float], bool], most: float) -> float:
    """The largest value up to `most` that holds, to within `TOLERANCES.joint_error`.

    It is 0 where not even 0 holds.

    Args:
        holds: Whether a joint error is survived; monotone.
        most: Largest value that is tried; [rad].
    """
    if holds(most):
        return most
    high, step = most, max(TOLERANCES.joint_error, FIRST_STEP * most)
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


def refuted_joint_error(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    certified: float,
    deadline: Deadline = NO_LIMIT,
    clearances: FloatArray | None = None,
) -> float:
    """A joint error at which the clearance is lost, the smallest that is found.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The motion.
        errors: As for `largest_joint_error`.
        certified: What that one found; [rad].
        deadline: When to give up.
        clearances: As for `largest_joint_error`.

    Returns:
        The largest offset of a counterexample; NaN where none was found; [rad].

    Raises:
        OutOfTime: If the time is over.
    """
    above = certified + TOLERANCES.joint_error
    if clearances is not None and len(clearances) > MANY:
        # What loses the clearance of some obstacles loses that of all.
        problem = within_reach(problem, clearances, errors.with_joint(above))
    lost = _first_gap(problem, trajectory, errors.with_joint(above), deadline)
    if lost is None:
        return nan
    weakest = trajectory.part(max(0, lost - AROUND), lost + AROUND + 2)
    for factor in FACTORS:
        box = errors.with_joint(factor * above)
        found = _smallest(problem, weakest, box, deadline)
        if found:
            return min(found)
    return nan


def _first_gap(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    deadline: Deadline,
) -> int | None:
    """The first interval that is not proved; frees the proof before it returns."""
    proof = YesOrNoProof(problem, trajectory, deadline)
    return _first_lost(partial(proof.holds, errors), proof.n_intervals)


def _first_lost(holds: Callable[[int, int], bool], end: int) -> int | None:
    """An interval that is not proved, the first or nearly; None where all are.

    What was proved before helps a little, so that a stretch may be lost of which both
    halves hold, asked alone.
    """
    stretches = ((k, min(k + STRETCH, end)) for k in range(0, end, STRETCH))
    lost = next((stretch for stretch in stretches if not holds(*stretch)), None)
    if lost is None:
        return None
    first, last = lost
    while last - first > 1:
        middle = (first + last) // 2
        first, last = (middle, last) if holds(first, middle) else (first, middle)
    return first


def _smallest(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    deadline: Deadline,
) -> list[float]:
    """Joint errors of counterexamples of pairs that a few slices leave undecided."""
    budget = Budget(slices=LOOKS, profile=1, until=deadline.end)
    motion = AskedMotion.of_arm(problem, trajectory, errors)
    proving, knots = motion.proving(budget), motion.knots
    told = proving.found(proving.sweep(0, proving.n_intervals))
    among = np.flatnonzero(told.counts[:, UNDECIDED] > 0)
    nearest = among[np.argsort(told.lower[among], kind="stable")][:SOUGHT]
    least = in_rows(least_clearances(motion.asked, told), knots)
    weakest = knots.interval(told.lower_interval)
    searches = []
    for k in nearest.tolist():
        deadline.check()
        searches.append(Search(motion, k).smallest(starts(least, weakest, k)))
    return [float(np.abs(found.offsets[1:]).max()) for found in searches if found]
