"""Clearances from a mesh that bodies are inside of.

What is proved is the distance from the mesh's surface. Of a solid the clearance is
negative all over its inside: as for every other obstacle around a link's axis it is
reported as minus the radius about the core, whatever the depth. That is said of what
begins inside, until its core may meet the surface; what reaches out through the surface
has its distance from that.
"""

from collections.abc import Mapping
from dataclasses import fields, replace
from math import nan
from typing import NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, frozen
from vdsm_pin.geometry.winding import Side
from vdsm_pin.proof.terms import REFUTED
from vdsm_pin.verification.assembly import Assembly
from vdsm_pin.verification.brackets import (
    ClearanceChunk,
    ClearanceProfile,
    ClearanceSink,
    LeastClearances,
)
from vdsm_pin.verification.inside import Places, by_mesh
from vdsm_pin.verification.records import Check, Verdict


class Inside(NamedTuple):
    """A body that begins inside a mesh.

    Args:
        point: A point of it that is inside, shape (3,); [m].
        clearance: What is said of it: minus the radius about its core; [m].
    """

    point: FloatArray
    clearance: float


def pairs_inside(asked: Assembly, places: Places) -> dict[int, Inside]:
    """The pairs of a body that begins inside a mesh, by their numbers."""
    return {
        k: Inside(one.point, 0.0 - asked.ball(k))
        for k, one in places.items()
        if one.where.side is Side.INSIDE
    }


class EnclosedSink:
    """Corrects chunks for the bodies that are inside of meshes and passes them on.

    Args:
        sink: Receives the corrected chunks.
        inside: The pairs that begin inside a mesh.
    """

    def __init__(self, sink: ClearanceSink, inside: Mapping[int, Inside]) -> None:
        self.sink, self.columns = sink, np.array([*inside], np.int64)
        self.depths = np.array([one.clearance for one in inside.values()])
        self.left = np.zeros(len(inside), np.bool_)

    def __call__(self, chunk: ClearanceChunk) -> None:
        """Correct one chunk and pass it on."""
        lower, upper = chunk.lower.copy(), chunk.upper.copy()
        verdict, other_point = chunk.verdict.copy(), chunk.other_point.copy()
        meets = chunk.lower[:, self.columns] <= self.depths
        out = np.logical_or.accumulate(meets) | self.left
        self.left = out[-1]
        lower[:, self.columns] = self.depths
        row, which = np.nonzero(~out)
        inside = row, self.columns[which]
        upper[inside] = self.depths[which]
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
    profile: ClearanceProfile, asked: Assembly, inside: Mapping[int, Inside]
) -> ClearanceProfile:
    """The profile with meshes as solids.

    Args:
        profile: As proved of the surfaces.
        asked: What is held apart.
        inside: The pairs that begin inside a mesh.
    """
    changed = {one.name: getattr(profile, one.name).copy() for one in fields(profile)}
    for k, one in inside.items():
        own, partner = asked.sides(k)
        obstacle, depth = partner - len(asked.own), one.clearance
        met = profile.obstacle_lower[:, obstacle] <= depth
        within = ~np.logical_or.accumulate(met)
        columns = {"link": max(0, asked.links[own] - 1), "obstacle": obstacle}
        for name, column in columns.items():
            for side, rows in (("lower", slice(None)), ("upper", within)):
                values = changed[f"{name}_{side}"]
                values[rows, column] = np.minimum(values[rows, column], depth)
    for values in changed.values():
        values.setflags(write=False)
    return ClearanceProfile(**changed)


def enclosed_least(
    least: LeastClearances, inside: Mapping[int, Inside]
) -> LeastClearances:
    """The least clearances with meshes as solids.

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
    rows: tuple[Check, ...], asked: Assembly, places: Places
) -> tuple[Check, ...]:
    """The rows of the clearance, the one from obstacles first.

    Args:
        rows: As proved of the surfaces.
        asked: What is held apart.
        places: Where bodies begin as seen from meshes.
    """
    inside = pairs_inside(asked, places).values()
    if not inside:
        return rows
    within = by_mesh(asked, places).items()
    refuted = replace(
        rows[0],
        verdict=Verdict.REFUTED,
        worst=min([rows[0].worst, *(one.clearance for one in inside)]),
        where="; ".join(
            where.words(name) for name, where in within if where.side is Side.INSIDE
        ),
        moment=0.0,
        first_moment=0.0,
        last_moment=nan,
        too_close_intervals=0,
        too_close_stretches=0,
        deeper=True,
    )
    return refuted, *rows[1:]
