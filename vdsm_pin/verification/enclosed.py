"""Clearances from a mesh that the arm is inside of.

What is proved is the distance from the mesh's surface. Of a solid the clearance is
negative all over its inside: as for every other obstacle around a link's axis it is
reported as minus the link's radius, whatever the depth.
"""

from collections.abc import Collection, Sequence
from dataclasses import replace
from math import nan
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, frozen
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.records import (
    Check,
    ClearanceChunk,
    ClearanceProfile,
    ClearanceSink,
    ClosestApproach,
    LeastClearances,
    Pair,
    Verdict,
)
from vdsm_pin.verification.task import all_pairs

REFUTED: Final = 1
"""In `ClearanceChunk.verdict`."""


class EnclosedSink:
    """Corrects chunks for the meshes around the arm and passes them on.

    The arm stays inside until its axis may meet the surface.

    Args:
        sink: Receives the corrected chunks.
        problem: The arm.
        around: Names of the meshes.
    """

    def __init__(
        self,
        sink: ClearanceSink,
        problem: PlanningProblem,
        around: Collection[str],
    ) -> None:
        self.sink, self.least = sink, -problem.manipulator.least_radius
        partners = np.array([pair.obstacle for pair in all_pairs(problem)])
        self.columns = [np.flatnonzero(partners == name) for name in around]
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
    profile: ClearanceProfile, problem: PlanningProblem, around: Collection[str]
) -> ClearanceProfile:
    """The profile with the meshes around the arm as solids."""
    if not around:
        return profile
    least = -problem.manipulator.least_radius
    lower, upper = profile.obstacle_lower.copy(), profile.obstacle_upper.copy()
    inside = np.zeros(len(lower), np.bool_)
    for name in around:
        column = problem.scene.names.index(name)
        mine: BoolArray = ~np.logical_or.accumulate(lower[:, column] <= least)
        lower[:, column] = upper[mine, column] = least
        inside |= mine

    def of_links(values: FloatArray, rows: BoolArray) -> FloatArray:
        return frozen(np.where(rows[:, None], np.minimum(values, least), values))

    return replace(
        profile,
        link_lower=of_links(profile.link_lower, np.ones_like(inside)),
        link_upper=of_links(profile.link_upper, inside),
        obstacle_lower=frozen(lower),
        obstacle_upper=frozen(upper),
    )


def enclosed_least(
    least: LeastClearances,
    pairs: Sequence[Pair],
    problem: PlanningProblem,
    around: Collection[str],
) -> LeastClearances:
    """The least clearances with the meshes around the arm as solids."""
    if not around:
        return least
    inside = np.array([pair.obstacle in around for pair in pairs], bool)
    depth = -problem.manipulator.least_radius
    return replace(
        least,
        lower=frozen(np.where(inside, depth, least.lower)),
        upper=frozen(np.where(inside, depth, least.upper)),
        verdict=frozen(np.where(inside, REFUTED, least.verdict), np.int64),
        other_point=frozen(
            np.where(inside[:, None], least.link_point, least.other_point)
        ),
    )


def enclosed_approaches(
    problem: PlanningProblem, trajectory: Trajectory, around: Collection[str]
) -> tuple[ClosestApproach, ...]:
    """Each link inside each mesh as the motion begins: the start of its axis is."""
    arm, first = problem.manipulator, slice(0, 1)
    rows = trajectory.x0[first], trajectory.alpha[first], trajectory.theta[first]
    centres = joint_centres(arm, *rows)[0]
    return tuple(
        ClosestApproach(
            interval=0,
            share=0.0,
            pair=Pair(link=link, obstacle=name),
            lower=-arm.least_radius,
            upper=-arm.least_radius,
            station=0.0,
            link_point=frozen(centres[link - 1]),
            other_point=frozen(centres[link - 1]),
            deeper=True,
        )
        for name in around
        for link in range(1, arm.n_links + 1)
    )


def enclosed_checks(
    rows: tuple[Check, ...], problem: PlanningProblem, around: Collection[str]
) -> tuple[Check, ...]:
    """The rows of the clearance, the one from obstacles first."""
    if not around:
        return rows
    worst = min(rows[0].worst, -problem.manipulator.least_radius)
    refuted = replace(
        rows[0],
        verdict=Verdict.REFUTED,
        worst=worst,
        where="; ".join(f"the arm is inside {name!r}" for name in around),
        moment=0.0,
        first=0.0,
        last=nan,
        too_close=0,
        stretches=0,
        deeper=True,
    )
    return refuted, *rows[1:]
