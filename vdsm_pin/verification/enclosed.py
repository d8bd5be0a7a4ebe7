"""Clearances from a mesh that the arm is inside of.

What is proved is the distance from the mesh's surface. Of a solid the clearance is
negative all over its inside: as for every other obstacle around a link's axis it is
reported as minus the link's radius, whatever the depth. That is said of what begins
inside; what reaches out through the surface has its distance from that.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from math import nan

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, frozen
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.proof.terms import REFUTED
from vdsm_pin.verification.brackets import (
    ClearanceChunk,
    ClearanceProfile,
    ClearanceSink,
    LeastClearances,
)
from vdsm_pin.verification.inside import Enclosed
from vdsm_pin.verification.records import Check, ClosestApproach, Pair, Verdict
from vdsm_pin.verification.task import all_pairs


def _begins_inside(pair: Pair, enclosed: Enclosed) -> bool:
    """Whether the obstacle of a pair is a mesh, and its body begins inside."""
    return pair.own in enclosed.get(pair.obstacle, ())


class EnclosedSink:
    """Corrects chunks for the meshes that the arm is inside of and passes them on.

    The arm stays inside until its axis may meet the surface.

    Args:
        sink: Receives the corrected chunks.
        problem: The arm.
        enclosed: Meshes and the bodies that begin inside them.
    """

    def __init__(
        self, sink: ClearanceSink, problem: PlanningProblem, enclosed: Enclosed
    ) -> None:
        self.sink, self.least = sink, -problem.manipulator.least_radius
        pairs = list(enumerate(all_pairs(problem)))
        self.columns = [
            np.array([k for k, pair in pairs if _begins_inside(pair, {name: inside})])
            for name, inside in enclosed.items()
            if inside
        ]
        self.left = [False] * len(self.columns)

    def __call__(self, chunk: ClearanceChunk) -> None:
        """Correct one chunk and pass it on."""
        lower, upper = chunk.lower.copy(), chunk.upper.copy()
        verdict, other_point = chunk.verdict.copy(), chunk.other_point.copy()
        for k, columns in enumerate(self.columns):
            meets = (chunk.lower[:, columns] <= self.least).any(axis=1)
            out = np.logical_or.accumulate(meets) | self.left[k]
            self.left[k] = bool(out[-1])
            inside = np.ix_(~out, columns)
            lower[:, columns] = upper[inside] = self.least
            verdict[inside] = REFUTED
            other_point[inside] = chunk.link_point[inside]
        self.sink(
            replace(
                chunk,
                lower=frozen(lower),
                upper=frozen(upper),
                verdict=frozen(verdict, np.int64),
                other_point=frozen(other_point),
            )
        )


def enclosed_profile(
    profile: ClearanceProfile, problem: PlanningProblem, enclosed: Enclosed
) -> ClearanceProfile:
    """The profile with the meshes that the arm is inside of as solids."""
    if not enclosed:
        return profile
    least = -problem.manipulator.least_radius
    lower, upper = profile.obstacle_lower.copy(), profile.obstacle_upper.copy()
    link_lower, link_upper = profile.link_lower.copy(), profile.link_upper.copy()
    for name, bodies in enclosed.items():
        column = problem.scene.names.index(name)
        mine: BoolArray = ~np.logical_or.accumulate(lower[:, column] <= least)
        lower[:, column] = upper[mine, column] = least
        for link in range(problem.manipulator.n_links):
            if f"link {link + 1}" in bodies:
                link_lower[:, link] = np.minimum(link_lower[:, link], least)
                link_upper[mine, link] = np.minimum(link_upper[mine, link], least)
    return replace(
        profile,
        link_lower=frozen(link_lower),
        link_upper=frozen(link_upper),
        obstacle_lower=frozen(lower),
        obstacle_upper=frozen(upper),
    )


def enclosed_least(
    least: LeastClearances, inside: Mapping[int, FloatArray], depth: float
) -> LeastClearances:
    """The least clearances with meshes as solids, of an arm or a robot.

    Args:
        least: What is proved of the surfaces.
        inside: A point of each pair's body that begins inside the mesh, by the number
            of the pair, shape (3,); [m].
        depth: The clearance of such a pair; [m].
    """
    rows = {k: (0, 0.0, depth, depth, REFUTED, at, at) for k, at in inside.items()}
    return least.with_rows(rows) if rows else least


def pairs_inside(pairs: Sequence[Pair], enclosed: Enclosed) -> dict[int, FloatArray]:
    """The pairs of an arm that begin inside, as `enclosed_least` takes them."""
    return {
        k: enclosed[pair.obstacle][pair.own]
        for k, pair in enumerate(pairs)
        if _begins_inside(pair, enclosed)
    }


def enclosed_approaches(
    problem: PlanningProblem, enclosed: Enclosed
) -> tuple[ClosestApproach, ...]:
    """Each link that begins inside a mesh, by its middle."""
    arm = problem.manipulator
    return tuple(
        ClosestApproach(
            interval=0,
            share=0.0,
            pair=Pair(link=link, obstacle=name),
            lower=-arm.least_radius,
            upper=-arm.least_radius,
            station=float(arm.axis_spans[link - 1].mean()),
            link_point=frozen(bodies[f"link {link}"]),
            other_point=frozen(bodies[f"link {link}"]),
            deeper=True,
        )
        for name, bodies in enclosed.items()
        for link in range(1, arm.n_links + 1)
        if f"link {link}" in bodies
    )


def enclosed_checks(
    rows: tuple[Check, ...], problem: PlanningProblem, enclosed: Collection[str]
) -> tuple[Check, ...]:
    """The rows of the clearance, the one from obstacles first."""
    if not enclosed:
        return rows
    worst = min(rows[0].worst, -problem.manipulator.least_radius)
    refuted = replace(
        rows[0],
        verdict=Verdict.REFUTED,
        worst=worst,
        where="; ".join(f"the arm is inside {name!r}" for name in enclosed),
        moment=0.0,
        first_moment=0.0,
        last_moment=nan,
        too_close_intervals=0,
        too_close_stretches=0,
        deeper=True,
    )
    return refuted, *rows[1:]
