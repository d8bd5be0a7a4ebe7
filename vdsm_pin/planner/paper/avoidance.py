"""The seam between the paper's pipeline and its ways of avoiding obstacles.

An avoidance fixes Steps 4 and 5: where the tip goes, and where the joints go in the
projection. The pipeline tries them in the order given here.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import Final, Protocol

import numpy as np

from vdsm_pin.errors import Infeasible, NoPlanFound
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.paper.across_rail import across_rail
from vdsm_pin.planner.paper.along_rail import along_rail
from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.planner.paper.sections import Passed, merged, section_along
from vdsm_pin.planner.paper.tip_path import Route, RowOf2D, straight_route
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem.planning_problem import PlanningProblem

MOST_OBSTACLES: Final = 4
"""Of so many obstacles 15 groups can be made, and each is tried; [-]."""

SPARSE: Final = 16
"""Every so manieth waypoint is looked at first."""


class Avoidance(Protocol):
    """Steps 4 and 5 of one plan."""

    @property
    def passed(self) -> str:
        """Names of the obstacles that are gone round."""
        ...

    def route(self, missing: float) -> Route:
        """Step 4: the tip's route that leaves less than this of the path undrawn; [m].

        Raises Infeasible where there is none.
        """
        ...

    def clearance(self, centres: FloatArray) -> float:
        """Smallest clearance at joint centres (n, N + 1, 3), less the margins; [m]."""
        ...

    def joints(self, route: Route, reference: FloatArray) -> FloatArray:
        """Step 5: projected joint centres from the reference of Step 3.

        Args:
            route: Step 4's route.
            reference: The straight arm's, shape (n_samples, N + 1, 2); [m].

        Returns:
            P_1..P_{N+1}, shape (n_samples, N + 1, 2); [m].
        """
        ...


class WayRound(Avoidance, Protocol):
    """An avoidance whose joints slide on where Coal asks for it."""

    @property
    def obstacles(self) -> tuple[int, ...]:
        """Numbers in the scene of the obstacles that are gone round."""
        ...

    @property
    def growths(self) -> FloatArray:
        """How far the danger region is grown for the joints of each link, (N,); [m]."""
        ...

    def grown(self, growths: FloatArray) -> "WayRound":
        """The same with the danger region grown for each link, shape (N,); [m]."""
        ...

    def sliding(self, side: int, link: int) -> list[tuple[int, ...]]:
        """Which joints may slide for a link, by their numbers, the preferred first."""
        ...

    def slid(self, row: RowOf2D, joints: tuple[int, ...], by: float) -> RowOf2D:
        """The waypoint with such joints farther along their line; [m]."""
        ...

    def growth_to(self, row: RowOf2D, link: int, joints: tuple[int, ...]) -> float:
        """How far the region is to grow for the joints of a link to slide there; [m].

        Args:
            row: As `slid` leaves it.
            link: 1 to N.
            joints: Those that slid.
        """
        ...


@dataclass(frozen=True)
class Straight:
    """No obstacle is met: the arm stays straight (paper, section 3).

    Args:
        problem: What was asked.
        link_clearance: Clearance of every link at given joint centres, less margins.
    """

    problem: PlanningProblem
    link_clearance: LinkClearance

    @property
    def passed(self) -> str:
        """None."""
        return ""

    def clearance(self, centres: FloatArray) -> float:
        """By the function handed in; a few waypoints tell where it is hopeless."""
        if not self.problem.scene.obstacles:
            return np.inf
        needed = self.problem.required_clearance
        few = self._least(centres[::SPARSE])
        return few if few < needed else self._least(centres)

    def _least(self, centres: FloatArray) -> float:
        return float(self.link_clearance(centres).min())

    def route(self, missing: float) -> Route:
        """Step 4 without obstacles: the whole path."""
        return straight_route(self.problem.path)

    def joints(self, route: Route, reference: FloatArray) -> FloatArray:
        """Step 5 without obstacles: the reference itself."""
        return reference


def avoidances(
    problem: PlanningProblem, met: Sequence[int], margins: FloatArray
) -> Iterator[WayRound]:
    """Every way the paper's rule offers to go round the scene's obstacles.

    A body that is prismatic along several axes is tried along X first, where only its
    section matters, then along Z and Y. Of several obstacles one alone is gone round
    first, then more of them together, as the hull of their sections: the others must
    keep clear by themselves.

    Args:
        problem: What was asked.
        met: Numbers of the obstacles that a part of the arm may not touch.
        margins: Kept beyond the required clearance by each link from each obstacle,
            shape (N, n_obstacles); [m]. From several obstacles that are gone round as
            one the largest is kept.

    Raises:
        NoPlanFound: If the paper's rule does not cover the scene.
        PathBlocked: If a view rules its obstacle out.
    """
    obstacles = [problem.scene.obstacles[k] for k in met]
    if len(obstacles) > MOST_OBSTACLES:
        message = (
            f"there are {len(obstacles)} obstacles, and the straight arm is not clear "
            f"of all; the paper's rule goes round up to {MOST_OBSTACLES} (the strategy "
            "'fewest' takes any number)"
        )
        raise NoPlanFound(message)
    seen = {
        axis: [section_along(obstacle, axis) for obstacle in obstacles]
        for axis in "xzy"
    }
    groups = _groups(seen)
    if not groups:
        names = " or ".join(repr(obstacle.name) for obstacle in obstacles)
        message = (
            f"obstacle {names} is not prismatic along X, Y or Z, which the paper's "
            "rule needs (the strategy 'fewest' takes any shape)"
        )
        raise NoPlanFound(message)
    offered, refusal = False, None
    for axis, members, section in groups:
        passed = Passed(section, tuple(met[k] for k in members))
        kept = margins[:, passed.obstacles].max(axis=1)
        try:
            found = (
                along_rail(problem, passed, kept)
                if axis == "x"
                else across_rail(problem, passed, axis, kept)
            )
            for avoidance in found:
                offered = True
                yield avoidance
        except Infeasible as error:
            refusal = refusal or error
    if not offered and refusal is not None:
        raise refusal


def _groups(
    seen: Mapping[str, list[DangerRegion | None]],
) -> list[tuple[str, tuple[int, ...], DangerRegion]]:
    """Sections to go round: axis, and which they are; of one obstacle, two together, ..

    Args:
        seen: Section of every obstacle along each axis; None where it is none.
    """
    sections = {
        axis: [(k, one) for k, one in enumerate(found) if one]
        for axis, found in seen.items()
    }
    most = max(map(len, sections.values()))
    return [
        (axis, tuple(k for k, _ in some), merged([one for _, one in some]))
        for size in range(1, most + 1)
        for axis, found in sections.items()
        for some in combinations(found, size)
    ]
