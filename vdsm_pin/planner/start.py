"""Whether the arm may stand where the problem says that it starts."""

import numpy as np

from vdsm_pin.errors import InsideUnknown, StartBlocked, StartInside
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.winding import Side, locate
from vdsm_pin.kinematics import joint_centres
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.planner.upper_clearance import culprit
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.scene import Mesh


def start_centres(problem: PlanningProblem) -> FloatArray:
    """Joint centres of the arm as it starts, shape (N + 1, 3); [m].

    NaN along the rail where the start is farther from it than the arm is long.
    """
    arm, path = problem.manipulator, problem.path
    if path.start_joints is not None:
        joints = path.start_joints[None]
        centres = joint_centres(arm, joints[:, 0], joints[:, 1::2], joints[:, 2::2])
        return np.asarray(centres[0])
    across = arm.ratios[:, None] * path.start[1:]
    square = arm.total_length**2 - path.start[1:] @ path.start[1:]
    rise = np.sqrt(square) if square >= 0.0 else np.nan
    along = path.start[0] - rise * (1.0 - arm.ratios)
    return np.column_stack([along, across])


def _check_outside(problem: PlanningProblem, base: FloatArray) -> None:
    """Refuse a start inside a mesh, and a mesh whose inside cannot be told.

    Args:
        problem: Arm and scene.
        base: First joint centre of the arm as it starts, shape (3,); [m].
    """
    radius = problem.manipulator.least_radius
    for mesh in problem.scene.obstacles:
        if not isinstance(mesh, Mesh) or mesh.is_surface:
            continue
        found = locate(mesh.closed_mesh, base, radius)
        if found.side is Side.INSIDE:
            raise StartInside(obstacle=mesh.name)
        if found.side is Side.UNKNOWN:
            raise InsideUnknown(obstacle=mesh.name, reason=found.words(mesh.name))


def check_start(problem: PlanningProblem, clearance: LinkClearance) -> None:
    """Refuse a start that is too close to an obstacle.

    The start is a pose that the problem states: no strategy takes another one. One out
    of reach is not judged here.

    Args:
        problem: What is asked.
        clearance: Clearance of links at given joint centres.

    Raises:
        StartInside: Where it is inside a mesh.
        StartBlocked: With the link, the obstacle and the clearance between them.
        InsideUnknown: Where the inside of a mesh cannot be told.
    """
    centres = start_centres(problem)
    required = problem.required_clearance
    if not np.isfinite(centres).all():
        return
    _check_outside(problem, centres[0])
    if not clearance(centres[None]).min() >= required:
        link, obstacle, room = culprit(problem, centres)
        bent = problem.path.start_joints is not None
        raise StartBlocked(
            link=link, obstacle=obstacle, clearance=room, required=required, bent=bent
        )
