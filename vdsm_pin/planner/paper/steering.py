"""Coal steers: the joints slide on by what it finds missing along its normal.

After a lift Coal measures each link near an obstacle. Where one misses what it shall
keep, its joints slide on along their auxiliary line until the missing part is made up
for: a joint that moves by s on its line brings the link away by s times the part of its
motion along Coal's normal. The danger region grows for this link and obstacle alone, to
where the joints so lie on its boundary, and the arm is lifted again. What the region
stands for together, grows together.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.paper.avoidance import WayRound
from vdsm_pin.planner.paper.lift import lift
from vdsm_pin.planner.paper.sections import planned_gap
from vdsm_pin.planner.paper.steps import PaperSteps
from vdsm_pin.planner.paper.tip_path import RowOf2D
from vdsm_pin.planner.records import Adjustment, Measure, Miss
from vdsm_pin.problem.planning_problem import PlanningProblem

LIFTS: Final = 8
"""Most lifts after joints were moved on."""

LEAST_GAIN: Final = 0.1
"""Joints that bring the link away by less than this part of their way are left; [-]."""

STEP: Final = 1e-6
"""Way of the joints by which that part is found; [m]."""


@dataclass(frozen=True)
class Steering:
    """What Coal is asked of each lift.

    Args:
        problem: What was asked.
        margins: Kept beyond the required clearance by each link from each obstacle,
            shape (N, n_obstacles); [m].
        measure: Coal's.
    """

    problem: PlanningProblem
    margins: FloatArray
    measure: Measure

    def misses(self, motion: PaperSteps) -> tuple[Miss, ...]:
        """What comes too near in a motion, by Coal."""
        return self.measure(motion.trajectory, self.margins)

    def moved_on(
        self, way: WayRound, motion: PaperSteps
    ) -> tuple[WayRound, tuple[Adjustment, ...]]:
        """The way on which joints have slid on, and what was moved.

        Nothing is where nothing is too near, or a link cannot be helped so.
        """
        growths, adjustments = way.growths.copy(), []
        for miss in self.misses(motion):
            one = self._adjusted(way, motion, miss)
            if one is None:
                return way, ()
            growths[miss.link - 1] = max(growths[miss.link - 1], one.margin)
            adjustments.append(one)
        return way.grown(growths), tuple(adjustments)

    def _adjusted(
        self, way: WayRound, motion: PaperSteps, miss: Miss
    ) -> Adjustment | None:
        """How a link is helped; None where its joints do not lead it away."""
        at, link = miss.row, miss.link
        if miss.obstacle not in way.obstacles:
            return None
        tip_x = float(motion.centres[at, -1, 0])
        row = RowOf2D(int(motion.route.side[at]), tip_x, motion.planar[at])
        kept = float(self.margins[link - 1, miss.obstacle])
        missing = planned_gap(self.problem) + kept - miss.distance
        name, now, found = self.problem.scene.names[miss.obstacle], way.growths, []
        for joints in way.sliding(row.side, link):
            gain = self._gain(row, way.slid(row, joints, STEP), miss)
            if gain >= LEAST_GAIN:
                by = missing / gain
                grown = way.growth_to(way.slid(row, joints, by), link, joints)
                one = Adjustment(
                    float(at),
                    link,
                    name,
                    "Coal",
                    miss.distance,
                    grown,
                    miss,
                    joints,
                    by,
                )
                # Joints outside the region would have it come to them first.
                found.append((max(grown - now[link - 1] - by, 0.0), one))
        _, best = min(found, key=lambda one: one[0], default=(0.0, None))
        return best if best and best.margin > now[link - 1] else None

    def _gain(self, row: RowOf2D, there: RowOf2D, miss: Miss) -> float:
        """What the link comes away along the normal on a way of `STEP`, over it; [-].

        Args:
            row: The waypoint.
            there: The same with joints farther by `STEP`.
            miss: Of a link at this waypoint.
        """
        arm, tip_x = self.problem.manipulator, np.array([row.tip_x])
        begin, end = (
            lift(arm, one.planar[None], tip_x)[0, miss.link - 1 : miss.link + 1]
            for one in (row, there)
        )
        axis = begin[1] - begin[0]
        share = np.clip((miss.on_link - begin[0]) @ axis / (axis @ axis), 0.0, 1.0)
        away = np.array([1.0 - share, share]) @ (end - begin)
        return float(away @ miss.normal) / STEP
