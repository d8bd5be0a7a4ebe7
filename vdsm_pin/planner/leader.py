"""Strategy `follow-the-leader`: the arm runs along the curve that its tip has taken.

What operators know as nose following. The curve is the arm as it starts, then the
insertion that the problem gives, then the path. Each joint lies on it, a link's length
behind the next one; the base is fed along its rail. Obstacles are not looked at: the
verification says whether the motion keeps clear of them.
"""

from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import joint_angles, link_angles
from vdsm_pin.errors import NoPlanFound
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.planner.path_rows import path_rows
from vdsm_pin.planner.records import (
    UNMEASURED,
    LinkClearance,
    Margin,
    Measure,
    Plan,
    margin_table,
)
from vdsm_pin.planner.spacing import STRAYS, row_steps, stepped
from vdsm_pin.planner.start import check_start, start_centres
from vdsm_pin.planner.tip_curve import led_along
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES

FINEST: Final = 64
"""Parts into which a step is cut at most so that no joint turns too far in one."""


def plan_follow_the_leader(
    problem: PlanningProblem,
    clearance: LinkClearance,
    margin: Margin,
    measure: Measure = UNMEASURED,
) -> Plan:
    """A plan whose arm follows its tip along the insertion and the path.

    Args:
        problem: What is asked.
        clearance: Clearance of links at given joint centres.
        margin: Above 0 where this motion was found too near: there is no other.
        measure: Not read.

    Raises:
        Infeasible: If the start is too close to an obstacle, or `NoPlanFound` where a
            joint or the base would pass a limit, or a margin is asked for.
    """
    check_start(problem, clearance)
    if margin_table(problem, margin).any():
        message = "the arm can follow its tip in one way alone, which comes too near"
        raise NoPlanFound(message)
    arm, rows = problem.manipulator, path_rows(problem.path)
    start = start_centres(problem)
    way = np.vstack([start[-1:], problem.path.insertion, rows.tips[:1]])
    parts, alpha, theta = 1, np.zeros((0, 0)), np.zeros((0, 0))
    while True:
        step = problem.path.spacing / parts
        approach, _ = stepped(way, step)
        inner, _ = stepped(rows.tips, step)
        stations = stepped(rows.stations[:, None], step)[0][:, 0]
        tips = np.concatenate([approach[:-1], inner])
        on_path = np.arange(len(tips)) >= len(approach) - 1
        along = np.append(np.full(len(approach) - 1, stations[0]), stations)
        centres = led_along(tips, start, arm.link_lengths)
        _check_rail(problem, centres, tips)
        alpha, theta = joint_angles(arm, centres)
        _check_cone(problem, link_angles(alpha, theta), tips)
        turns, strays = row_steps(arm, alpha, theta)
        strays = strays[on_path[:-1]].max(initial=0.0)
        near = strays <= STRAYS * problem.path.spacing
        turn = turns.max(initial=0.0)
        if (turn <= problem.planned_row_change and near) or parts == FINEST:
            break
        parts *= 2
    trajectory = Trajectory(on_path, along, centres[:, 0, 0], alpha, theta)
    note = "the arm follows the curve of its tip; obstacles were not looked at"
    return Plan(problem, "follow-the-leader", centres, trajectory, notes=(note,))


def _check_rail(
    problem: PlanningProblem, centres: FloatArray, tips: FloatArray
) -> None:
    """Refuse a motion whose base would leave the rail.

    Raises:
        NoPlanFound: With where the tip is.
    """
    low, high = problem.manipulator.base_range
    rounding = TOLERANCES.planned_limit
    placed = np.asarray(np.isfinite(centres).all(axis=(1, 2)))
    base = np.where(placed, centres[:, 0, 0], 0.0)
    off: BoolArray = ~placed | (base < low - rounding) | (base > high + rounding)
    if off.any():
        row = int(np.argmax(off))
        message = (
            f"with the tip at {problem.in_file(tips[row])} the base would have to "
            "leave its rail to follow"
        )
        raise NoPlanFound(message)


def _check_cone(problem: PlanningProblem, psi: FloatArray, tips: FloatArray) -> None:
    """Refuse link angles beyond their limit.

    Raises:
        NoPlanFound: With the joint, its angle and where the tip is.
    """
    arm = problem.manipulator
    limit = arm.max_link_angle + TOLERANCES.planned_limit
    if not (psi <= limit).all():
        row, joint = divmod(int(np.argmax(psi)), arm.n_links)
        message = (
            f"with the tip at {problem.in_file(tips[row])} joint {joint + 1} would "
            f"bend by {np.rad2deg(psi[row, joint]):.1f}° to follow it, the limit is "
            f"{np.rad2deg(arm.max_link_angle):.1f}°: round the corners of "
            "`insertion`, which no link should pass at once"
        )
        raise NoPlanFound(message)
