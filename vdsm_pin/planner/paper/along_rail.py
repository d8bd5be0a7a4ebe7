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
    slide_on,
)
from vdsm_pin.planner.paper.project import project
from vdsm_pin.planner.paper.region_kernels import core_gaps
from vdsm_pin.planner.paper.sections import Passed, grown_by, planned_gap
from vdsm_pin.planner.paper.tip_path import Route, RowOf2D
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
        obstacles: Numbers in the scene of those that are gone round.
    """

    problem: PlanningProblem
    forbidden: DangerRegion
    region: DangerRegion
    rules: dict[int, SideRule]
    margins: FloatArray
    obstacles: tuple[int, ...]

    @property
    def passed(self) -> str:
        """Names of the obstacles that are gone round."""
        return self.region.name

    def route(self, missing: float) -> Route:
        """Step 4."""
        length = self.problem.manipulator.total_length
        return detour_route(self.problem.path, self.region, self.bends, length, missing)

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
        rule = self.rules[side]
        return bends(self.problem, self.forbidden, rule, points, self.margins)

    @property
    def growths(self) -> FloatArray:
        """How far the danger region is grown for the joints of each link, (N,); [m]."""
        return self.rules[1].margins

    def grown(self, growths: FloatArray) -> "AlongRail":
        """The same with the danger region grown for each link, shape (N,); [m]."""
        rules = {
            side: replace(rule, margins=growths) for side, rule in self.rules.items()
        }
        # The tip ends the last link.
        region = self.region.grown(float(growths[-1] - self.growths[-1]))
        return replace(self, region=region, rules=rules)

    def sliding(self, side: int, link: int) -> list[tuple[int, ...]]:
        """Both its ends or one of them, but for O_1 and the tip.

        Nothing slides where no obstacle is passed.
        """
        last = self.problem.manipulator.n_links
        ends = [joint for joint in (link, link + 1) if 1 < joint <= last]
        if side not in self.rules or not ends:
            return []
        return [*dict.fromkeys([tuple(ends), *((joint,) for joint in ends)])]

    def slid(self, row: RowOf2D, joints: tuple[int, ...], by: float) -> RowOf2D:
        """The waypoint with such joints farther along their line; [m]."""
        planar, rows = row.planar.copy(), [joint - 1 for joint in joints]
        planar[rows] = slide_on(planar[rows], self.rules[row.side], by)
        return row._replace(planar=planar)

    def growth_to(self, row: RowOf2D, link: int, joints: tuple[int, ...]) -> float:
        """The region reaches the farthest of the joints; [m]."""
        return float(self._gaps(row, joints).max())

    def _gaps(self, row: RowOf2D, joints: tuple[int, ...]) -> FloatArray:
        """How far joints are from their region, not grown, shape (n,); [m]."""
        region = self.rules[row.side].region
        places = row.planar[[joint - 1 for joint in joints]]
        return core_gaps(region.corners, places) - region.radius


def along_rail(
    problem: PlanningProblem, passed: Passed, margins: FloatArray
) -> Iterator[AlongRail]:
    """Choices for one obstacle prismatic along X, the paper's own first.

    Args:
        problem: What was asked.
        passed: The obstacle and its section in the plane Y0Z0.
        margins: Kept beyond the required clearance by each link, shape (N,); [m].

    Raises:
        PathBlocked: If the rail or the start lies in the danger region.
    """
    growth, section = grown_by(problem), passed.section
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

    def choice(some: list[DangerRegion]) -> AlongRail:
        return _choice(problem, forbidden, some, margins, passed.obstacles)

    yield choice(shapes)
    if len(shapes) > 1:
        for shape in shapes[::-3]:
            yield choice([shape])


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
    obstacles: tuple[int, ...],
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
    return AlongRail(problem, forbidden, region, rules, margins, obstacles)


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
