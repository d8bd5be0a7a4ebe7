"""Nodes tied into a roadmap: the start, and arms grown where the path is not drawn."""

from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.errors import LimitExceeded, NoPlanFound, NoWayOut, OutOfReach
from vdsm_pin.geometry.arrays import FloatArray, IntArray, distinct
from vdsm_pin.planner.feasibility import rail_distance
from vdsm_pin.planner.fewest.charts import OFFSETS, Chart, Intervals
from vdsm_pin.planner.fewest.growth import Grown, Layers, Population
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.roadmap import CostWeights, Roadmap, extended
from vdsm_pin.planner.fewest.search import TURN
from vdsm_pin.planner.start import start_centres
from vdsm_pin.planner.upper_clearance import culprit
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import in_mm

EXITS = 24
"""Nodes tried as the first step away from the start."""


def checked_start(judge: Judge, tip: FloatArray, chart: Chart) -> FloatArray:
    """Shape coordinates of the arm at the start.

    Args:
        judge: Knows the limits.
        tip: Of the arm at the start, shape (1, 3); [m].
        chart: What coordinates.

    Raises:
        LimitExceeded: If it breaks a limit.
        NoPlanFound: If it bends more than may be used, or the chart does not hold it.
    """
    problem = judge.problem
    arm, centres = problem.manipulator, start_centres(problem)
    if chart is not OFFSETS or problem.path.start_joints is not None:
        ahead = np.diff(centres[:, 0])
        if chart is OFFSETS and not (ahead > 0.0).all():
            link = int(np.argmin(ahead)) + 1
            message = f"link {link} leans backwards at the start; the chart ends there"
            raise NoPlanFound(message)
        shape = chart.coordinates(arm, centres[None])[0]
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
    offsets = checked_start(judge, tip, OFFSETS)[None]
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


POPULATION: Final = 150
"""Arms that live on at a layer."""
KEPT: Final = 6
"""Arms at the farthest layer whose ancestors are kept."""


def tied_in(
    judge: Judge,
    roadmap: Roadmap,
    grown: list[Grown],
    roots: list[IntArray],
    weights: CostWeights,
) -> Roadmap:
    """The roadmap with grown configurations, tied to what is near them.

    Args:
        judge: Says what is clear.
        roadmap: The graph before.
        grown: Trees, by layers of the path, that begin with their roots.
        roots: For each tree the nodes of its roots.
        weights: What the strategy prefers.
    """
    shapes, route = roadmap.shapes, roadmap.route
    tips, offsets, links = [], [], []
    first = shapes.size
    for tree, nodes in zip(grown, roots, strict=True):
        more = len(tree.layer) - len(nodes)
        ids = np.append(roadmap.shapes_of(nodes), first + np.arange(more))
        up = ids[tree.parent[-more:]]
        links.append(np.column_stack([ids[-more:], up, np.full(more, shapes.step)]))
        tips.append(route.layers[tree.layer[-more:]])
        offsets.append(tree.offsets[-more:])
        first += more
    every, places = np.concatenate(offsets), np.concatenate(tips)
    links.append(_ties(judge, roadmap, places, every))
    positions = route.tips[places]
    clearances = judge.look(positions, every).clearances
    wider = shapes.with_grown(every, np.vstack(links))
    return extended(roadmap, judge, weights, places, every, clearances, wider)


TIES = 4
"""Nodes of the graph tied to each grown configuration at its tip."""
TIE_LENGTH = 0.08
"""Largest move of a joint along a tie over the arm's length; [-]."""


def _ties(
    judge: Judge, roadmap: Roadmap, places: IntArray, grown: FloatArray
) -> FloatArray:
    """Clear links from grown configurations to the nearest ones at the same tip."""
    arm, shapes = judge.problem.manipulator, roadmap.shapes
    rows, tips, here, there = [], [], [], []
    for tip in distinct(places):
        own = np.flatnonzero(places == tip)
        nodes = roadmap.nodes_at(tip)
        shape = np.concatenate([roadmap.shapes_of(nodes), shapes.size + own])
        around = np.concatenate([roadmap.poses_of(arm, nodes)[1], grown[own]])
        gap = np.abs(grown[own][:, None] - around[None]).max(axis=(2, 3))
        gap[np.arange(len(own)), len(nodes) + np.arange(len(own))] = np.inf
        turn = gap / (TURN * arm.total_length)
        near = np.argsort(gap, axis=1, kind="stable")[:, :TIES]
        mine, column = np.repeat(np.arange(len(own)), near.shape[1]), near.ravel()
        close = gap[mine, column] <= TIE_LENGTH * arm.total_length
        mine, column = mine[close], column[close]
        rows.append(
            np.column_stack(
                [shapes.size + own[mine], shape[column], turn[mine, column]]
            )
        )
        tips.append(np.broadcast_to(roadmap.route.tips[tip], (len(mine), 3)))
        here.append(grown[own[mine]])
        there.append(around[column])
    every = np.concatenate(tips)
    lines = Intervals(every, every, np.concatenate(here), np.concatenate(there))
    good = judge.clear(lines) if len(every) else np.zeros(0, bool)
    return np.concatenate(rows)[good]


def fill(
    judge: Judge,
    roadmap: Roadmap,
    lengths: FloatArray,
    skipped: tuple[int, ...],
    rng: np.random.Generator,
    weights: CostWeights,
) -> Roadmap | None:
    """The roadmap with what could be grown into the stretches not drawn.

    Args:
        judge: Says what is clear.
        roadmap: The graph before.
        lengths: Of the way from the start to each node, inf if none, shape (v,).
        skipped: Layers k whose stretch from layer k - 1 is not drawn.
        rng: Source of chance.
        weights: What the strategy prefers.

    Returns:
        None if nothing grew.
    """
    route, arm = roadmap.route, judge.problem.manipulator
    marks = np.array(skipped)
    breaks = np.flatnonzero(np.diff(marks) > 1) + 1
    trees, roots = [], []
    for stretch in np.split(marks, breaks):
        ends = (int(stretch[0]) - 1, int(stretch[-1]))
        crossed = False
        for first, last, step in ((*ends, 1), (*ends[::-1], -1)):
            if crossed:
                break
            nodes = roadmap.nodes_at(route.layers[first])
            nodes = nodes[np.isfinite(lengths[nodes])]
            if len(nodes) > POPULATION:
                nodes = rng.choice(nodes, POPULATION, replace=False)
            if not len(nodes):
                continue
            _, offsets = roadmap.poses_of(arm, nodes)
            number = np.arange(first, last + step, step)
            tips = route.tips[route.layers[number]]
            layers = Layers(tips, np.zeros(len(tips)))
            tree = Population(judge, layers, rng, POPULATION).grow(offsets, kept=KEPT)
            if len(tree.layer) > len(nodes):
                trees.append(tree._replace(layer=number[tree.layer]))
                roots.append(nodes)
                crossed = bool((trees[-1].layer == last).any())
    return tied_in(judge, roadmap, trees, roots, weights) if trees else None
