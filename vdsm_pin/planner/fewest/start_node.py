"""Where the motion starts: the node of the arm as it stands."""

import numpy as np

from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.errors import LimitExceeded, NoPlanFound, NoWayOut, OutOfReach
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.feasibility import rail_distance
from vdsm_pin.planner.fewest.charts import coordinates
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.motion import Intervals
from vdsm_pin.planner.fewest.roadmap import CostWeights, Roadmap, extended
from vdsm_pin.planner.fewest.sequence import TURN
from vdsm_pin.planner.start import start_centres
from vdsm_pin.planner.upper_clearance import culprit
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import in_mm

EXITS = 24
"""Nodes tried as the first step away from the start."""


def checked_start(judge: Judge, tip: FloatArray, directed: bool) -> FloatArray:
    """Shape coordinates of the arm at the start.

    Args:
        judge: Knows the limits.
        tip: Of the arm at the start, shape (1, 3); [m].
        directed: Whether in directions of links.

    Raises:
        LimitExceeded: If it breaks a limit.
        NoPlanFound: If it bends more than may be used, or the chart does not hold it.
    """
    problem = judge.problem
    arm, centres = problem.manipulator, start_centres(problem)
    if directed or problem.path.start_joints is not None:
        ahead = np.diff(centres[:, 0])
        if not (directed or (ahead > 0.0).all()):
            link = int(np.argmin(ahead)) + 1
            message = f"link {link} leans backwards at the start; the chart ends there"
            raise NoPlanFound(message)
        shape = coordinates(arm, centres[None], directed)[0]
    else:
        shape = np.zeros((arm.n_links + 1, 2))
    _check_limits(judge, tip, shape[None])
    return np.asarray(shape)


def with_start(
    judge: Judge, roadmap: Roadmap, weights: CostWeights
) -> tuple[Roadmap, int]:
    """The roadmap with the start as a node, tied to what can be reached from it.

    Raises:
        LimitExceeded: If it breaks a limit.
        NoWayOut: If no node can be reached from it.
    """
    if judge.problem.path.start_joints is None and roadmap.index[0] >= 0:
        return roadmap, int(roadmap.index[0])
    tip = roadmap.route.tips[:1]
    offsets = checked_start(judge, tip, directed=False)[None]
    clearances = judge.look(tip, offsets).clearances
    shapes = roadmap.shapes
    nodes = roadmap.nodes_at(0)
    _, around = roadmap.poses_of(judge.problem.manipulator, nodes)
    gap = np.abs(around - offsets).max(axis=(1, 2))
    near = np.argsort(gap, kind="stable")[:EXITS]
    every = np.broadcast_to(tip, (len(near), 3))
    lines = Intervals(
        every, every, np.broadcast_to(offsets, around[near].shape), around[near]
    )
    need = judge.needed_from(np.repeat(clearances, len(near)))
    good = judge.clear(lines, need) if len(near) else np.zeros(0, bool)
    if not good.any():
        raise NoWayOut(_kept_there(judge, float(clearances[0]), len(near)))
    ids = np.full(int(good.sum()), shapes.size)
    there = roadmap.shapes_of(nodes[near[good]])
    turn = gap[near[good]] / (TURN * judge.problem.manipulator.total_length)
    links = np.column_stack([ids, there, turn])
    at, grown = np.zeros(1, dtype=np.int64), shapes.with_grown(offsets, links)
    more = extended(roadmap, judge, weights, at, offsets, clearances, grown)
    return more, int(more.index[shapes.size])


def _kept_there(judge: Judge, clearance: float, tried: int) -> str:
    """Why no node can be reached from the start, in words.

    Args:
        judge: Knows what is kept.
        clearance: Of the arm at the start, beyond what links keep besides; [m].
        tried: Number of nodes at the tip of the start.
    """
    kept = in_mm(judge.required)
    if clearance < judge.required:
        found = culprit(judge.problem, start_centres(judge.problem))
        return (
            f"the arm starts with {found.words} to {found.obstacle!r}, and the "
            f"search keeps {kept}; try a smaller margin or "
            "`required_clearance`, or another start"
        )
    if not tried:
        return (
            f"with the tip where it starts no arm bent at one joint keeps {kept}; try "
            "another start"
        )
    return (
        f"the way to each of the {tried} nearest postures bent at one joint is "
        "blocked; try another start"
    )


def largest_start_angle(problem: PlanningProblem) -> float:
    """Largest link angle at the start; [rad]."""
    arm, path = problem.manipulator, problem.path
    if path.start_joints is None:
        away = np.hypot(path.start[1], path.start[2])
        return float(np.arcsin(min(1.0, away / arm.total_length)))
    alpha, theta = path.start_joints[None, 1::2], path.start_joints[None, 2::2]
    return float(link_angles(alpha, theta).max())


def _check_placed(problem: PlanningProblem) -> None:
    """Refuse a start that arm or rail do not allow.

    Raises:
        OutOfReach: If it is farther from the rail than the arm is long.
        LimitExceeded: If its base is off the rail.
    """
    arm, start = problem.manipulator, problem.path.start
    base, (low, high) = float(start_centres(problem)[0, 0]), arm.base_range
    if np.isnan(base):
        raise OutOfReach(
            place=f"the start {problem.in_file(start)}",
            distance=float(rail_distance(arm, start[None])[0]),
            reach=arm.total_length,
            reason="the length of the arm",
        )
    limit = min(max(base, low), high)
    if abs(base - limit) > TOLERANCES.planned_limit:
        raise LimitExceeded(
            waypoint=0, quantity="x0", value=base, limit=limit, unit="m"
        )


def _check_limits(judge: Judge, tip: FloatArray, offsets: FloatArray) -> None:
    problem = judge.problem
    _check_placed(problem)
    bend = float(judge.bends(tip, offsets).max())
    if not bend <= problem.manipulator.max_link_angle + TOLERANCES.joint_limit:
        limit = float(np.rad2deg(problem.manipulator.max_link_angle))
        raise LimitExceeded(
            waypoint=0, quantity="psi", value=float(np.rad2deg(bend)), limit=limit,
            unit="deg",
        )  # fmt: skip
    if not bend <= judge.limit + TOLERANCES.joint_limit:
        message = (
            f"the arm starts with a link angle of {np.rad2deg(bend):.4g}°, and this "
            f"strategy bends joints by at most {np.rad2deg(judge.limit):.4g}°"
        )
        raise NoPlanFound(message)
