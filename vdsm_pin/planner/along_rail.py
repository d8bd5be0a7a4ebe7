"""One obstacle prismatic along the rail (obs1, obs2): which detour the joints take.

The paper leaves two things open in Step 5: the direction of the auxiliary line, and how
far round the section the danger region is drawn. Both are chosen here by trial on the
waypoints in the obstacle's shadow. The vertical and the horizontal line, the paper's
"positive cross", come first, then oblique ones; the region starts as the section grown
by body, clearance and margin, and is grown on until the links between the joints, not
only the joints, keep the clearance. Corners are blunted where links cannot follow them.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from vdsm_pin.errors import PathBlocked
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.manipulator import Manipulator
from vdsm_pin.planner.danger_region import DangerRegion
from vdsm_pin.planner.detours import (
    Shadow,
    detour_route,
    first_station,
    path_rows,
)
from vdsm_pin.planner.joint_paths import slide_joints
from vdsm_pin.planner.lift import rises_squared
from vdsm_pin.planner.project import project
from vdsm_pin.planner.sections import Section, grown_by
from vdsm_pin.planner.tip_path import Route
from vdsm_pin.problem import PlanningProblem

ROUNDINGS: Final = (0.0, 0.25, 0.5, 0.75, 1.0)
"""How far corners are blunted, tried in this order; [-]."""

GROWTHS: Final = (0.0, 0.01, 0.02, 0.03, 0.04, 0.06, 0.09, 0.12)
"""How far the region is grown for the links, as parts of the longest link; [-]."""

OBLIQUE: Final = tuple(np.deg2rad([90.0, 75.0, 105.0, 60.0, 120.0]))
"""Oblique lines, by their angle to the ray from P_1 through the obstacle; [rad]."""

LARGEST_STRIDE: Final = 0.25
"""A joint that moves farther between two rows than this part of the longest link has
jumped: subdividing will not make its motion continuous; [-]."""


@dataclass(frozen=True)
class SideRule:
    """How joints get out of the danger region on one side.

    Args:
        region: What they slide on.
        direction: The auxiliary line, a unit vector, shape (2,); [-].
    """

    region: DangerRegion
    direction: FloatArray


@dataclass(frozen=True)
class AlongRail:
    """A complete choice for Steps 4 and 5.

    Args:
        problem: What was asked.
        forbidden: The region no part of a link's axis may enter.
        rules: The rule of each side, by 1 and -1.
    """

    problem: PlanningProblem
    forbidden: DangerRegion
    rules: dict[int, SideRule]

    @cached_property
    def region(self) -> DangerRegion:
        """The danger region of the tip: the larger of the two sides'."""
        return max(
            (rule.region for rule in self.rules.values()), key=lambda r: r.radius
        )

    def route(self) -> Route:
        """Step 4."""
        return detour_route(self.problem.path, self.region, self.stands)

    def joints(self, route: Route, reference: FloatArray) -> FloatArray:
        """Step 5: the joints slide where the arm passes the obstacle."""
        manipulator = self.problem.manipulator
        planar, tip = reference.copy(), reference[:, -1]
        for side, rule in self.rules.items():
            rows = np.flatnonzero(route.side == side)
            if len(rows):
                planar[rows] = _slid(manipulator, tip[rows], rule)
        return planar

    def stands(self, points: FloatArray, side: int) -> BoolArray:
        """Whether the arm can stand with its tip at points, on a side, (n,)."""
        return stands(self.problem, self.forbidden, self.rules[side], points)


def _slid(manipulator: Manipulator, tip: FloatArray, rule: SideRule) -> FloatArray:
    directions = np.broadcast_to(rule.direction, tip.shape)
    return slide_joints(manipulator, tip, rule.region, directions)


def stands(
    problem: PlanningProblem,
    forbidden: DangerRegion,
    rule: SideRule,
    points: FloatArray,
) -> BoolArray:
    """Whether links are long enough, limits and clearance kept, and no joint jumps.

    Args:
        problem: The arm and its limits.
        forbidden: What the links keep out of.
        rule: How the joints slide.
        points: Tip positions, neighbours on the path, shape (n, 3); [m].
    """
    manipulator = problem.manipulator
    planar = _slid(manipulator, project(points), rule)
    squares = rises_squared(manipulator, planar)
    able = (squares > 0.0).all(axis=1)
    links = np.concatenate(
        [np.sqrt(np.maximum(squares, 0.0))[..., None], np.diff(planar, axis=1)], axis=2
    )
    links /= manipulator.link_lengths[:, None]
    cosine = np.einsum("nij,nij->ni", links[:, 1:], links[:, :-1])
    limit = np.cos(min(manipulator.max_link_angle, manipulator.max_joint_angle))
    able &= (cosine >= limit).all(axis=1) & (links[:, 0, 0] >= limit)
    able &= forbidden.core_distance(planar) >= forbidden.radius
    stride = np.abs(np.diff(planar, axis=0)).max(axis=(1, 2), initial=0.0)
    able[1:] &= stride <= LARGEST_STRIDE * manipulator.link_lengths.max()
    return np.asarray(able)


def along_rail(
    problem: PlanningProblem, section: Section, margin: float
) -> Iterator[AlongRail]:
    """Choices for one obstacle prismatic along X, the paper's own first.

    Args:
        problem: What was asked.
        section: The obstacle's section in the plane Y0Z0.
        margin: Kept beyond the required clearance; [m].

    Raises:
        PathBlocked: If the rail or the start lies in the danger region.
    """
    growth = grown_by(problem, margin)
    forbidden = _grown(section, growth)
    for what, point in (
        ("the rail", np.zeros(2)),
        ("the start", problem.path.start[1:]),
    ):
        distance = float(forbidden.core_distance(np.stack([point, point])[None])[0])
        if not distance > forbidden.radius:
            reason = (
                f"{what} lies in its danger region: {distance - section.radius:.4f} m "
                f"from it seen along the rail, {growth:.4f} m needed"
            )
            raise PathBlocked(obstacle=section.name, reason=reason)
    for rounding in ROUNDINGS:
        rounded = section.rounded(rounding)
        region = _grown(rounded, growth)
        if rounding > 0.0 and (
            rounded is section or region.contains(_anchors(problem)).any()
        ):
            break
        yield AlongRail(problem, forbidden, _rules(problem, forbidden, region))


def _grown(section: Section, growth: float) -> DangerRegion:
    return DangerRegion(section.name, section.points, section.radius + growth)


def _anchors(problem: PlanningProblem) -> FloatArray:
    return np.stack([np.zeros(2), problem.path.start[1:]])


def _rules(
    problem: PlanningProblem, forbidden: DangerRegion, region: DangerRegion
) -> dict[int, SideRule]:
    """The rule for each side that brings the tip farthest along its path."""
    sequences = _sequences(problem, region)
    return {
        side: _rule(problem, forbidden, region, side, sequences[side])
        for side in (1, -1)
    }


def _sequences(
    problem: PlanningProblem, region: DangerRegion
) -> dict[int, list[FloatArray]]:
    """For each side the tip positions wanted on it, going into the shadow."""
    path = problem.path
    rows = path_rows(path, first_station(path, region)[0], region)
    shadow = Shadow(region)
    wanted: dict[int, list[FloatArray]] = {1: [], -1: []}
    for visit in shadow.visits(project(rows.points)):
        points = rows.points[visit.first : visit.last + 1]
        sides = {visit.entry, visit.exit} - {0}
        if len(sides) == 2:
            gaps = np.linalg.norm(project(points) - region.centre, axis=1)
            change = int(np.argmin(gaps))
            wanted[visit.entry].append(points[: change + 1])
            wanted[visit.exit].append(points[change:][::-1])
            continue
        for side in sides or {1, -1}:
            backwards = visit.entry == 0
            wanted[side].append(points[::-1] if backwards else points)
    return wanted


def _rule(
    problem: PlanningProblem,
    forbidden: DangerRegion,
    region: DangerRegion,
    side: int,
    sequences: list[FloatArray],
) -> SideRule:
    """Try lines and growths in order; the first that does all, else the farthest."""
    total = sum(len(points) for points in sequences)
    best, best_score = SideRule(region, _lines(region, side)[0]), -1
    for direction in _lines(region, side):
        for growth in GROWTHS:
            grown = DangerRegion(
                region.name,
                region.corners,
                region.radius + growth * problem.manipulator.link_lengths.max(),
            )
            rule = SideRule(grown, direction)
            if grown.contains(_anchors(problem)).any():
                break
            score = 0
            for points in sequences:
                able = stands(problem, forbidden, rule, points)
                score += len(able) if able.all() else int(np.argmin(able))
            if score == total:
                return rule
            if score > best_score:
                best, best_score = rule, score
    return best


def _lines(region: DangerRegion, side: int) -> list[FloatArray]:
    """Directions of the auxiliary lines, each turned to the side; [-]."""
    centre = region.centre
    bearing = np.arctan2(centre[1], centre[0])
    across = side * np.array([-np.sin(bearing), np.cos(bearing)])
    lines = [np.array([0.0, 1.0]), np.array([1.0, 0.0])]
    lines = [line * (1.0 if line @ across > 0.0 else -1.0) for line in lines]
    turned = bearing + side * np.array(OBLIQUE)
    return lines + [np.array([np.cos(t), np.sin(t)]) for t in turned]
