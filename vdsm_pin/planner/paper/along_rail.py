"""One obstacle prismatic along the rail (obs1, obs2): Steps 4 and 5 put together.

Each side of the obstacle has its rule for the joints (`joint_paths.py`), found on the
waypoints wanted there; the tip keeps out of a region that holds those of both rules.
Where links cannot follow a sharp corner of the section, blunter regions are tried.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vdsm_pin.errors import PathBlocked
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.paper.approach import first_station
from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.planner.paper.detours import detour_route, path_rows
from vdsm_pin.planner.paper.joint_paths import (
    SideRule,
    anchors,
    bends,
    choose_rule,
    slide_joints,
)
from vdsm_pin.planner.paper.project import project
from vdsm_pin.planner.paper.region_kernels import core_gaps
from vdsm_pin.planner.paper.sections import grown_by, planned_gap
from vdsm_pin.planner.paper.tip_path import Route
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.units import in_mm

ROUNDINGS: Final = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.75, 1.0)
"""How far corners are blunted, tried in this order; [-]."""


@dataclass(frozen=True)
class AlongRail:
    """A complete choice for Steps 4 and 5.

    Args:
        problem: What was asked.
        forbidden: The region no part of a link's axis may enter.
        region: The danger region of the tip; it holds those of both sides.
        rules: The rule of each side, by 1 and -1.
        margins: How far `forbidden` is grown for each link, shape (N,); [m].
    """

    problem: PlanningProblem
    forbidden: DangerRegion
    region: DangerRegion
    rules: dict[int, SideRule]
    margins: FloatArray

    @property
    def passed(self) -> str:
        """Names of the obstacles that are gone round."""
        return self.region.name

    def route(self, missing: float) -> Route:
        """Step 4."""
        return detour_route(self.problem.path, self.region, self.bends, missing)

    def clearance(self, centres: FloatArray) -> float:
        """From the section, taken as endless along the rail, less the margins."""
        distance = self.forbidden.link_distances(project(centres)) - self.margins
        reserve = self.forbidden.radius - planned_gap(self.problem)
        return float(distance.min()) - reserve

    def joints(self, route: Route, reference: FloatArray) -> FloatArray:
        """Step 5: the joints slide where the arm passes the obstacle."""
        manipulator = self.problem.manipulator
        planar, tip = reference.copy(), reference[:, -1]
        for side, rule in self.rules.items():
            rows = np.flatnonzero(route.side == side)
            if len(rows):
                planar[rows] = slide_joints(manipulator, tip[rows], rule)
        return planar

    def bends(self, points: FloatArray, side: int) -> FloatArray:
        """Largest link angle with the tip at points; infinite for none, (n,); [rad]."""
        return bends(self.problem, self.forbidden, self.rules[side], points)


def along_rail(
    problem: PlanningProblem, section: DangerRegion, margins: FloatArray
) -> Iterator[AlongRail]:
    """Choices for one obstacle prismatic along X, the paper's own first.

    Args:
        problem: What was asked.
        section: The obstacle's section in the plane Y0Z0.
        margins: Kept beyond the required clearance by each link, shape (N,); [m].

    Raises:
        PathBlocked: If the rail or the start lies in the danger region.
    """
    growth = grown_by(problem)
    forbidden = section.grown(growth)
    for what, point in (
        ("the rail", np.zeros(2)),
        ("the start", problem.path.start[1:]),
    ):
        distance = float(forbidden.core_distance(np.stack([point, point])[None])[0])
        if not distance > forbidden.radius:
            reason = (
                f"{what} lies in its danger region: {in_mm(distance - section.radius)} "
                f"from it seen along the rail, {in_mm(growth)} needed"
            )
            raise PathBlocked(obstacle=section.name, reason=reason)
    shapes = _shapes(problem, section, growth)
    yield _choice(problem, forbidden, shapes, margins)
    if len(shapes) > 1:
        for shape in shapes[::-3]:
            yield _choice(problem, forbidden, [shape], margins)


def _shapes(
    problem: PlanningProblem, section: DangerRegion, growth: float
) -> list[DangerRegion]:
    """The danger region with sharper to blunter corners, as far as there is room."""
    shapes = [section.grown(growth)]
    for rounding in ROUNDINGS[1:] if len(section.corners) > 1 else ():
        shape = section.rounded(rounding).grown(growth)
        if not core_gaps(shape.corners, anchors(problem)).min() > shape.radius:
            break
        shapes.append(shape)
    return shapes


def _choice(
    problem: PlanningProblem,
    forbidden: DangerRegion,
    shapes: list[DangerRegion],
    margins: FloatArray,
) -> AlongRail:
    """For each side the rule that brings the tip farthest along its path."""
    sequences = _sequences(problem, shapes[0])
    rules = {
        side: choose_rule(problem, forbidden, shapes, side, sequences[side], margins)
        for side in (1, -1)
    }
    # Blunter shapes hold sharper ones, grown ones those less grown.
    regions = [rule.region for rule in rules.values()]
    bluntest = max(regions, key=lambda r: _rank(r, shapes))
    grown = max(r.radius - shapes[_rank(r, shapes)].radius for r in regions)
    # The tip ends the last link, whose margin it keeps.
    radius = shapes[_rank(bluntest, shapes)].radius + grown + margins[-1]
    region = replace(bluntest, radius=radius)
    return AlongRail(problem, forbidden, region, rules, margins)


def _sequences(
    problem: PlanningProblem, region: DangerRegion
) -> dict[int, list[FloatArray]]:
    """For each side the projected tips wanted on it, going into the shadow."""
    path = problem.path
    rows = path_rows(path, first_station(path, region)[0], region)
    wanted: dict[int, list[FloatArray]] = {1: [], -1: []}
    tip = project(rows.points)
    for visit in region.visits(tip):
        points = tip[visit.first : visit.last + 1]
        sides = {visit.entry, visit.exit} - {0}
        if len(sides) == 2:
            gaps = np.linalg.norm(points - region.centre, axis=1)
            change = int(np.argmin(gaps))
            wanted[visit.entry].append(points[: change + 1])
            wanted[visit.exit].append(points[change:][::-1])
            continue
        for side in sides or {1, -1}:
            backwards = visit.entry == 0
            wanted[side].append(points[::-1] if backwards else points)
    return wanted


def _rank(region: DangerRegion, shapes: list[DangerRegion]) -> int:
    """Which of the shapes a region was grown from."""
    same = [np.array_equal(region.corners, shape.corners) for shape in shapes]
    return same.index(True)
