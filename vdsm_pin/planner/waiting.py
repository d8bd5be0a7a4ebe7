"""Plans beside obstacles that move: the arm waits until all of them rest."""

from dataclasses import replace
from typing import Final

import numpy as np

from vdsm_pin.planner.records import Plan
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.units import in_mm

TURNING: Final = float(np.deg2rad(20.0))
"""How fast a joint turns at most in such a plan; [rad/s]."""

SLIDING: Final = 0.2
"""How fast the base goes on its rail at most; [m/s]."""

SHORTEST: Final = 1e-3
"""Between two waypoints; [s]."""


def waited(plan: Plan, problem: PlanningProblem) -> Plan:
    """A plan with times, that stands at its start until nothing moves any more.

    Args:
        plan: Made for the obstacles as they come to rest.
        problem: With the obstacles as they move.
    """
    rows, scene = plan.trajectory, problem.scene
    steps = np.abs(np.diff(rows.joints, axis=0))
    turns = steps[:, 1:].max(axis=1, initial=0.0) / TURNING
    durations = np.maximum(np.maximum(turns, steps[:, 0] / SLIDING), SHORTEST)
    times = scene.rest_time + np.append(0.0, np.cumsum(durations))
    order = np.arange(rows.n_samples)
    if scene.start_time < scene.rest_time:
        times, order = np.append(scene.start_time, times), np.append(0, order)
    note = (
        f"waits at the start until {scene.rest_time:g} s, when all obstacles have come "
        f"to rest; then goes at {np.rad2deg(TURNING):.0f}°/s and {in_mm(SLIDING)}/s "
        "at most, and any other pace will do"
    )
    return replace(
        plan,
        problem=problem,
        centres=plan.centres[order],
        trajectory=Trajectory.of_joints(
            rows.joints[order], rows.on_path[order], rows.path_m[order], times
        ),
        notes=(*plan.notes, note),
        steps=None,
    )
