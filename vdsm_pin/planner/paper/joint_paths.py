"""Step 5: the joints' projected paths round an obstacle (paper, 4.3, Eq. 8-10).

The paper leaves two things open: the direction of the auxiliary line, and how far round
the section the danger region is drawn. Both are tried on the waypoints wanted on a
side. The vertical and the horizontal line, the paper's "positive cross", come first,
then oblique ones; the region starts as the section grown by body, clearance and margin,
and is grown on until the links between the joints, not only the joints, keep clear.
"""

from dataclasses import dataclass
from itertools import product
from typing import Final

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.planner.paper.lift import largest_angles
from vdsm_pin.planner.paper.project import project
from vdsm_pin.planner.paper.region_kernels import core_gaps
from vdsm_pin.planner.paper.sliding_kernels import (
    Links,
    Standing,
    slide_chains,
    slide_of,
    standing,
)
from vdsm_pin.planner.paper.trial_kernels import Trials, Wanted, best_rule
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


@dataclass(frozen=True)
class SideRule:
    """How joints get out of the danger region on one side.

    Args:
        region: What they slide on, in the plane Y0Z0.
        side: On which side of the region the arm passes, 1 for the larger polar angle
            about P_1, -1 for the smaller.
        direction: The auxiliary lines, a unit vector towards that side, shape (2,);
            zero for the circles about P_1 through P'_i; [-].
        margins: How far the region is grown for the joints of each link, (N,); [m].
    """

    region: DangerRegion
    side: int
    direction: FloatArray
    margins: FloatArray


def chain_ratios(manipulator: Manipulator) -> FloatArray:
    """k_{i,i+1} for i = 1..N (Eq. 6), shape (N,); [-]."""
    return manipulator.stations[:-1] / manipulator.stations[1:]


def links_of(manipulator: Manipulator, margins: FloatArray) -> Links:
    """The arm as compiled code takes it, its cone and box kept by the link angle."""
    largest = min(manipulator.max_link_angle, manipulator.max_joint_angle)
    ratios, lengths = chain_ratios(manipulator), manipulator.link_lengths
    return Links(ratios, lengths, margins, float(np.cos(largest)))


def slide_joints(
    manipulator: Manipulator, tip: FloatArray, rule: SideRule
) -> FloatArray:
    """Joints in the danger region slide onto its boundary, from the tip to the base.

    P'_i = k_{i,i+1} P_{i+1} (Eq. 8-10) is the place of joint i in proportion. Inside
    the region it moves along the auxiliary line through P'_i, to the side on which the
    arm passes, onto the boundary; outside it is P_i already.

    Args:
        manipulator: The arm with its ratios.
        tip: Projected tip P_{N+1}, shape (n_samples, 2); [m].
        rule: The region and how joints get out of it.

    Returns:
        P_1..P_{N+1}, shape (n_samples, N + 1, 2); [m].
    """
    planar = np.zeros((len(tip), manipulator.n_links + 1, 2))
    planar[:, -1] = tip
    slide = slide_of(rule.region.core, rule.side, rule.direction)
    slide_chains(slide, links_of(manipulator, rule.margins), planar)
    return planar


def slide_on(points: FloatArray, rule: SideRule, by: float) -> FloatArray:
    """Joints farther along their auxiliary lines, shape (n, 2); [m].

    Args:
        points: Shape (n, 2); [m].
        rule: Which lines.
        by: How far; [m].
    """
    if rule.direction.any():
        return np.asarray(points + by * rule.direction)
    turn = rule.side * by / np.linalg.norm(points, axis=1)
    cos, sin, (y, z) = np.cos(turn), np.sin(turn), points.T
    return np.stack([cos * y - sin * z, sin * y + cos * z], axis=1)


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
    margins: FloatArray,
) -> FloatArray:
    """Largest link angles where links are long enough and clear, and no joint jumps.

    Args:
        problem: The arm and its limits.
        forbidden: What the links keep out of.
        rule: How the joints slide.
        points: Tip positions that follow each other as waypoints do, (n, 3); [m].
        margins: How far `forbidden` is grown for each link, shape (N,); [m].

    Returns:
        Shape (n,), infinite where the arm cannot stand; [rad].
    """
    manipulator = problem.manipulator
    planar = slide_joints(manipulator, project(points), rule)
    links = links_of(manipulator, margins)
    able = standing(planar, Standing(links, forbidden.core, LARGEST_SWING))
    return np.where(able, largest_angles(planar, manipulator.link_lengths), np.inf)
