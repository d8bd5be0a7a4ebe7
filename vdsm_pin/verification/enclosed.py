"""Clearances from a mesh that the arm is inside of.

What is proved is the distance from the mesh's surface. Of a solid the clearance is
negative all over its inside: as for every other obstacle around a link's axis it is
reported as minus the link's radius, whatever the depth. That is said of what begins
inside; what reaches out through the surface has its distance from that.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from math import nan
from typing import NamedTuple

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
from vdsm_pin.verification.records import Check, Pair, Verdict


class Inside(NamedTuple):
    """A body that begins inside a mesh.

    Args:
        point: A point of it that is inside, shape (3,); [m].
        clearance: What is said of it: minus the radius about its core; [m].
    """

    point: FloatArray
    clearance: float


def pairs_inside(
    problem: PlanningProblem, pairs: Sequence[Pair], enclosed: Enclosed
) -> dict[int, Inside]:
    """The pairs of an arm that begin inside a mesh, by their numbers."""
    balls = _balls(problem)
    return {
        k: Inside(enclosed[pair.obstacle][pair.own], -balls[pair.own])
        for k, pair in enumerate(pairs if enclosed else ())
        if pair.own in enclosed.get(pair.obstacle, ())
    }


def _balls(problem: PlanningProblem) -> dict[str, float]:
    """Radius about the core of each body of the arm, by its name; [m]."""
    return {body.name: body.ball for body in problem.manipulator.convex_bodies}


class EnclosedSink:
    """Corrects chunks for the meshes that the arm is inside of and passes them on.

    The arm stays inside until the core of a body may meet the surface.

    Args:
        sink: Receives the corrected chunks.
        pairs: Every pair.
        inside: Those that begin inside a mesh.
    """

    def __init__(
        self, sink: ClearanceSink, pairs: Sequence[Pair], inside: Mapping[int, Inside]
    ) -> None:
        self.sink, by_mesh = sink, dict[str, list[int]]()
        for k in inside:
            by_mesh.setdefault(pairs[k].obstacle, []).append(k)
        self.columns = [np.array(each) for each in by_mesh.values()]
        self.depths = [
            np.array([inside[k].clearance for k in each]) for each in by_mesh.values()
        ]
        self.left = [False] * len(self.columns)

    def __call__(self, chunk: ClearanceChunk) -> None:
        """Correct one chunk and pass it on."""
        lower, upper = chunk.lower.copy(), chunk.upper.copy()
        verdict, other_point = chunk.verdict.copy(), chunk.other_point.copy()
        for k, columns in enumerate(self.columns):
            meets = (chunk.lower[:, columns] <= self.depths[k]).any(axis=1)
            out = np.logical_or.accumulate(meets) | self.left[k]
            self.left[k] = bool(out[-1])
            inside = np.ix_(~out, columns)
            lower[:, columns] = self.depths[k]
            upper[inside] = self.depths[k]
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
    arm, balls = problem.manipulator, _balls(problem)
    lower, upper = profile.obstacle_lower.copy(), profile.obstacle_upper.copy()
    link_lower, link_upper = profile.link_lower.copy(), profile.link_upper.copy()
    for name, bodies in enclosed.items():
        column = problem.scene.names.index(name)
        least = -min((balls[body] for body in bodies), default=arm.least_radius)
        mine: BoolArray = ~np.logical_or.accumulate(lower[:, column] <= least)
        lower[:, column] = upper[mine, column] = least
        for link in range(arm.n_links):
            if (own := f"link {link + 1}") in bodies:
                depth = -balls[own]
                link_lower[:, link] = np.minimum(link_lower[:, link], depth)
                link_upper[mine, link] = np.minimum(link_upper[mine, link], depth)
    return replace(
        profile,
        link_lower=frozen(link_lower),
        link_upper=frozen(link_upper),
        obstacle_lower=frozen(lower),
        obstacle_upper=frozen(upper),
    )


def enclosed_least(
    least: LeastClearances, inside: Mapping[int, Inside]
) -> LeastClearances:
    """The least clearances with meshes as solids, of an arm or a robot.

    Args:
        least: What is proved of the surfaces.
        inside: The pairs that begin inside a mesh.
    """
    rows = {
        k: (0, 0.0, one.clearance, one.clearance, REFUTED, one.point, one.point)
        for k, one in inside.items()
    }
    return least.with_rows(rows) if rows else least


def enclosed_checks(
    rows: tuple[Check, ...], meshes: Collection[str], clearances: Iterable[float]
) -> tuple[Check, ...]:
    """The rows of the clearance, the one from obstacles first.

    Args:
        rows: As proved of the surfaces.
        meshes: Names of those that the arm is inside of.
        clearances: Of the bodies inside; [m].
    """
    if not meshes:
        return rows
    refuted = replace(
        rows[0],
        verdict=Verdict.REFUTED,
        worst=min([rows[0].worst, *clearances]),
        where="; ".join(f"the arm is inside {name!r}" for name in meshes),
        moment=0.0,
        first_moment=0.0,
        last_moment=nan,
        too_close_intervals=0,
        too_close_stretches=0,
        deeper=True,
    )
    return refuted, *rows[1:]
