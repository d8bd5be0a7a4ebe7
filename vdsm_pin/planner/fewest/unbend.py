"""Starts that the chart does not hold: the arm unbends until all links lean ahead.

The chart (`motion.py`) knows an arm by its projection across the rail, so a link that
leans backwards, or stands nearly square to the rail, is beyond it. From there the arm
moves along straight lines in joint space towards smaller angles, the base making room.
"""

import itertools
from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import link_angles, row_centres
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import NoPlanFound
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.joint_lines import clear_line
from vdsm_pin.planner.records import LinkClearance, Plan
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES

ADVANCE: Final = 0.15
"""A link leans ahead if it advances along the rail by so much of its length; [-]."""
PARTS: Final = (0.75, 0.5, 0.25, 0.0)
"""Parts of the angles that may be left; [-]."""
TAKEN_BACK: Final = (1.0, 0.5, 0.0, 1.5)
"""Parts of the tip's advance that the base takes back; [-]."""
TRIES: Final = 200
"""Ways over a configuration drawn by chance."""
STRAY: Final = 0.3
"""How far these are from the line; the base goes by thirds of the arm; [rad]."""


def leans_ahead(problem: PlanningProblem) -> bool:
    """Whether the chart holds the arm at its start."""
    joints = problem.path.start_joints
    return joints is None or _ahead(problem.manipulator, joints)


def _ahead(arm: Manipulator, joints: FloatArray) -> bool:
    advance = np.diff(row_centres(arm, joints[None])[0, :, 0])
    return bool((advance >= ADVANCE * arm.link_lengths).all())


def _targets(arm: Manipulator, start: FloatArray) -> Iterator[FloatArray]:
    """Joint values to move to, the nearest first."""
    tip_x = float(row_centres(arm, start[None])[0, -1, 0])
    for part, shift in itertools.product(PARTS, TAKEN_BACK):
        joints = part * start
        joints[0] = start[0]
        advance = float(row_centres(arm, joints[None])[0, -1, 0]) - tip_x
        joints[0] = min(max(start[0] - shift * advance, arm.base_range[0]),
                        arm.base_range[1])  # fmt: skip
        if _ahead(arm, joints):
            yield joints


def _within(arm: Manipulator, joints: FloatArray) -> bool:
    angles = np.abs(joints[1:])
    psi = link_angles(joints[None, 1::2], joints[None, 2::2])
    low, high = arm.base_range
    return bool(
        (angles <= arm.max_joint_angle).all()
        and (psi <= arm.max_link_angle).all()
        and low <= joints[0] <= high
    )


def unbend(
    problem: PlanningProblem, clearance: LinkClearance, margin: float
) -> FloatArray:
    """Rows of joint values from the start to an arm that leans ahead.

    Returns:
        Shape (r, 1 + 2N); [m] in the first column, [rad] in the others.

    Raises:
        NoPlanFound: If neither a straight line in joint space nor two were clear.
    """
    arm, start = problem.manipulator, problem.path.start_joints
    assert start is not None
    at_start = float(clearance(row_centres(arm, start[None])).min())
    # The start may be closer than the margin asks for; the way out only gets better.
    need = min(problem.required_clearance + margin, at_start - TOLERANCES.joint_centre)
    need = max(need, problem.required_clearance)
    targets = list(_targets(arm, start))
    for target in targets:
        rows = clear_line(problem, clearance, start, target, need)
        if rows is not None:
            return rows
    rng = np.random.default_rng(0)
    spread = np.full(start.shape, STRAY)
    spread[0] *= arm.total_length / 3.0
    for _ in range(TRIES):
        target = targets[int(rng.integers(len(targets)))]
        middle = start + rng.random() * (target - start)
        middle = middle + rng.normal(0.0, spread)
        if not _within(arm, middle):
            continue
        first = clear_line(problem, clearance, start, middle, need)
        rest = (
            None
            if first is None
            else clear_line(problem, clearance, middle, target, need)
        )
        if first is not None and rest is not None:
            return np.concatenate([first, rest[1:]])
    message = (
        "a link leans backwards at the start, and no clear way to unbend was found"
    )
    raise NoPlanFound(message)


def from_there(problem: PlanningProblem, joints: FloatArray) -> PlanningProblem:
    """The same problem from other joint values, shape (1 + 2N,); [m], [rad]."""
    tip = row_centres(problem.manipulator, joints[None])[0, -1]
    return replace(
        problem, tip_path=replace(problem.path, start=tip, start_joints=joints)
    )


def with_unbending(problem: PlanningProblem, rows: FloatArray, plan: Plan) -> Plan:
    """A plan that begins with more rows; the last one is the plan's first.

    Args:
        problem: What was asked, with the start that leans backwards.
        rows: As `unbend` returns them, shape (r, 1 + 2N); [m], [rad].
        plan: From the last of these rows on.
    """
    first, told, count = rows[:-1], plan.trajectory, len(rows) - 1
    trajectory = Trajectory.of_joints(
        np.concatenate([first, told.joints]),
        np.concatenate([np.zeros(count, dtype=np.bool_), told.on_path]),
        np.concatenate([np.full(count, told.path_m[0]), told.path_m]),
    )
    before = row_centres(problem.manipulator, first)
    note = (
        f"a link leans backwards at the start: the arm unbends first, in {count} rows"
    )
    return replace(
        plan,
        problem=problem,
        centres=np.concatenate([before, plan.centres]),
        trajectory=trajectory,
        notes=(*plan.notes, note),
    )
