"""How joints get round the danger region on one side: chosen by trial (Step 5).

The paper leaves two things open: the direction of the auxiliary line, and how far round
the section the danger region is drawn. Both are tried on the waypoints wanted on that
side. The vertical and the horizontal line, the paper's "positive cross", come first,
then oblique ones; the region starts as the section grown by body, clearance and margin,
and is grown on until the links between the joints, not only the joints, keep clear.
"""

from itertools import product
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.planner.paper.joint_paths import SideRule, links_of, slide_joints
from vdsm_pin.planner.paper.lift import largest_angles
from vdsm_pin.planner.paper.project import project
from vdsm_pin.planner.paper.region_kernels import core_gaps
from vdsm_pin.planner.paper.sliding_kernels import standing
from vdsm_pin.planner.paper.trial_kernels import Standing, Trials, Wanted, best_rule
from vdsm_pin.problem.planning_problem import PlanningProblem

GROWTHS: Final = (0.0, 0.01, 0.02, 0.03, 0.04, 0.06, 0.08, 0.1, 0.12, 0.15)
"""How far the region is grown for the links, as parts of the longest link; [-]."""

OBLIQUE: Final = tuple(np.deg2rad([90.0, 75.0, 105.0, 60.0, 120.0]))
"""Oblique lines, by their angle to the ray from P_1 through the obstacle; [rad]."""

LARGEST_SWING: Final = float(np.deg2rad(15.0))
"""A link that turns farther than this between two neighbouring waypoints has jumped:
inserting waypoints would not make its motion continuous; [rad]."""

CROSS: Final = 2
"""The first two lines are the vertical and the horizontal."""

COARSE: Final = 4
"""Choices are compared on every fourth waypoint, then confirmed on all."""


def choose_rule(
    problem: PlanningProblem,
    forbidden: DangerRegion,
    shapes: list[DangerRegion],
    side: int,
    sequences: list[FloatArray],
    margins: FloatArray,
) -> SideRule:
    """The paper's cross where it does all that is wanted, else the best line.

    Args:
        problem: What is asked.
        forbidden: What the links keep out of.
        shapes: The danger region with sharper to blunter corners.
        side: 1 or -1.
        sequences: Projected tips wanted on this side, going into the shadow, shape
            (n, 2) each; [m].
        margins: How far regions are grown for each link, shape (N,); [m].

    Returns:
        The rule that brings the tip farthest; of several, the one that shortens the
        arm least, which is the one that moves the base least.
    """
    arm = problem.manipulator
    lines, regions = _lines(shapes[0], side), _regions(problem, shapes)
    numbers = [*product(range(CROSS), range(len(regions)))]
    n_cross = len(numbers)
    numbers += product(range(CROSS, len(lines)), range(len(regions)))
    n_corners = np.array([len(region.corners) for region in regions])
    cores = np.zeros((len(regions), n_corners.max(), 2))
    for core, region in zip(cores, regions, strict=True):
        core[: len(region.corners)] = region.corners
    wanted = Wanted(
        np.concatenate([np.zeros((0, 2)), *sequences]),
        np.cumsum([0, *map(len, sequences)]),
        COARSE,
    )
    radii = np.array([region.radius for region in regions])
    trials = Trials(
        np.array(lines), cores, n_corners, radii, np.array(numbers), n_cross
    )
    able = Standing(links_of(arm, margins), forbidden.core, LARGEST_SWING)
    chosen = best_rule(wanted, trials, side, able)
    line, number = numbers[chosen]
    return SideRule(regions[number], side, lines[line], margins)


def _regions(
    problem: PlanningProblem, shapes: list[DangerRegion]
) -> list[DangerRegion]:
    """The shapes, each grown on as far as the rail and the start stay free."""
    longest = float(problem.manipulator.link_lengths.max())
    regions = []
    for shape in shapes:
        room = float(core_gaps(shape.corners, anchors(problem)).min())
        grown = [shape.grown(growth * longest) for growth in GROWTHS]
        regions += [region for region in grown if region.radius < room]
    return regions


def _lines(region: DangerRegion, side: int) -> list[FloatArray]:
    """Auxiliary lines as in `SideRule`, in the order in which they are tried."""
    centre = region.centre
    bearing = np.arctan2(centre[1], centre[0])
    across = side * np.array([-np.sin(bearing), np.cos(bearing)])
    lines = [np.array([0.0, 1.0]), np.array([1.0, 0.0])]
    lines = [line * (1.0 if line @ across > 0.0 else -1.0) for line in lines]
    turned = bearing + side * np.array(OBLIQUE)
    oblique = [np.array([np.cos(t), np.sin(t)]) for t in turned]
    return [*lines, *oblique, np.zeros(2)]


def anchors(problem: PlanningProblem) -> FloatArray:
    """What a danger region must leave free: the rail and the start, (2, 2); [m]."""
    return np.stack([np.zeros(2), problem.path.start[1:]])


def bends(
    problem: PlanningProblem,
    forbidden: DangerRegion,
    rule: SideRule,
    points: FloatArray,
) -> FloatArray:
    """Largest link angles where links are long enough and clear, and no joint jumps.

    Args:
        problem: The arm and its limits.
        forbidden: What the links keep out of.
        rule: How the joints slide.
        points: Tip positions that follow each other as waypoints do, (n, 3); [m].

    Returns:
        Shape (n,), infinite where the arm cannot stand; [rad].
    """
    manipulator = problem.manipulator
    planar = slide_joints(manipulator, project(points), rule)
    links = links_of(manipulator, rule.margins)
    able = standing(planar, links, forbidden.core, LARGEST_SWING)
    return np.where(able, largest_angles(planar, manipulator.link_lengths), np.inf)
