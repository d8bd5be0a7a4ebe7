"""Whether links of a robot are inside a mesh: where they are as the motion begins.

Every convex part of a link that is proved to keep off a mesh's triangles stays on its
side of them, so one point of it at the first row decides for the whole motion. Where
the inside of a mesh cannot be told, a link is outside if it is proved to keep its
clearance from the mesh's hull.
"""

from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from typing import NamedTuple, cast

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import FlatCylinder, Hull, Piece
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.geometry.winding import Location, Side, locate
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.scene import solid_of
from vdsm_pin.proof.bodies import Body, PairTable
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.prover import answer
from vdsm_pin.proof.question import Question
from vdsm_pin.proof.terms import CERTIFIED
from vdsm_pin.robots.cell import Cell
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.brackets import ClearanceProfile
from vdsm_pin.verification.enclosed import Inside
from vdsm_pin.verification.first_contact import FirstContact
from vdsm_pin.verification.inside import worst_location
from vdsm_pin.verification.records import Pair


class Place(NamedTuple):
    """Where a link begins as seen from a mesh, and a point of it that tells.

    Args:
        where: As seen from the mesh.
        point: In the world, shape (3,); [m].
    """

    where: Location
    point: FloatArray


def locate_links(cell: Cell, motion: AskedMotion, budget: Budget) -> dict[int, Place]:
    """Where each link begins as seen from each mesh that may have an inside.

    Args:
        cell: Robot and scene.
        motion: What is asked.
        budget: Of the proof off hulls.

    Returns:
        By the number of their pair.
    """
    found = at_start(cell, motion.path)
    unknown = unlocated_pairs(found)
    if not unknown:
        return found
    asked = question_of_hulls(cell, unknown, motion.errors, unknown)
    proof = answer(asked, motion.path, budget)
    clear = [unknown[k] for k in np.flatnonzero(proof.verdict == CERTIFIED)]
    outside = Location(Side.OUTSIDE)
    return found | {k: found[k]._replace(where=outside) for k in clear}


def unlocated_pairs(located: Mapping[int, Place]) -> list[int]:
    """Numbers of the pairs of which it is not known on which side the link is."""
    return [k for k, one in located.items() if one.where.side is Side.UNKNOWN]


def question_of_hulls(
    cell: Cell,
    hulled: Sequence[int],
    errors: ErrorBox,
    asked: Sequence[int] | None = None,
) -> Question:
    """Pairs of a cell, with the hulls of meshes in place of the meshes in some of them.

    The hulls are bodies behind all others, each once, in the order of the pairs.

    Args:
        cell: Robot and scene.
        hulled: Numbers of the pairs that are asked of the hull of their mesh.
        errors: Those of the proof.
        asked: Numbers of the pairs that are asked; None for all.
    """
    held, table = cell.asked, cell.asked.table
    one, n, box = table.one.copy(), len(held.bodies), held.box(errors)
    meshes = list(dict.fromkeys(one[hulled].tolist()))
    bodies, surfaces = [*held.bodies], np.asarray(box.surfaces)
    for number in meshes:
        mesh = cast("Mesh", solid_of(cell.scene.obstacles[number - len(held.own)]))
        bodies.append(replace(bodies[number], pieces=mesh.hull.pieces))
    one[hulled] = [n + meshes.index(number) for number in one[hulled].tolist()]
    which = np.arange(table.size) if asked is None else np.array(asked)
    pairs = PairTable(one[which], table.other[which], table.required[which])
    box = replace(box, surfaces=np.append(surfaces, surfaces[meshes]))
    return Question.of(held.tree, bodies, pairs, box)


def at_start(cell: Cell, path: Path) -> dict[int, Place]:
    """Where each link begins as seen from each mesh, by the number of their pair."""
    solids = [solid_of(one) for one in cell.scene.obstacles]
    found = dict[int, Place]()
    if not any(isinstance(one, Mesh) for one in solids):
        return found
    asked = cell.asked
    bodies, poses = asked.bodies, asked.poses(path.knots[:1])[0]
    for k in np.flatnonzero(asked.outer).tolist():
        own, partner = asked.sides(k)
        mesh = solids[partner - len(asked.own)]
        if isinstance(mesh, Mesh) and not mesh.is_surface:
            link, rest = bodies[own], poses[bodies[partner].frame]
            needed = float(asked.table.required[k])
            found[k] = _place(mesh, link, poses[link.frame], rest, needed)
    return found


def _place(
    mesh: Mesh, link: Body, pose: FloatArray, rest: FloatArray, required: float
) -> Place:
    """Where a link stands as seen from a mesh: what of its parts says the most.

    Args:
        mesh: In its own frame.
        link: In its own.
        pose: T_world_link, shape (4, 4); [m].
        rest: T_world_mesh, shape (4, 4); [m].
        required: How far the link keeps off the mesh; [m].
    """
    places = []
    for piece in link.pieces:
        middle, radius = _middle(piece)
        point = pose[:3, :3] @ middle + pose[:3, 3]
        seen = (point - rest[:3, 3]) @ rest[:3, :3]
        where = locate(mesh.closed_mesh, seen, radius + required)
        places.append(Place(where._replace(who=f"link {link.name!r}"), point))
    worst = worst_location([place.where for place in places])
    return next(place for place in places if place.where == worst)


def _middle(piece: Piece) -> tuple[FloatArray, float]:
    """A point of a convex part of a link, and how far off its skin it lies; [m]."""
    if isinstance(piece, FlatCylinder):
        return piece.centre, 0.0
    assert isinstance(piece, Hull)  # links have no half-spaces
    return piece.points.mean(axis=0), piece.radius


def by_mesh(cell: Cell, located: Mapping[int, Place]) -> dict[str, Location]:
    """What of each mesh says the most against the motion."""
    found = dict[str, list[Location]]()
    for k, one in located.items():
        found.setdefault(cell.asked.pair(k).obstacle, []).append(one.where)
    return {name: worst_location(each) for name, each in found.items()}


def pairs_inside(located: Mapping[int, Place]) -> dict[int, Inside]:
    """The pairs of a link that begins inside a mesh, by their numbers."""
    found = located.items()
    return {
        k: Inside(one.point, 0.0) for k, one in found if one.where.side is Side.INSIDE
    }


def enclosed_contacts(
    contacts: tuple[FirstContact, ...],
    pairs: Sequence[Pair],
    located: Mapping[int, Place],
) -> tuple[FirstContact, ...]:
    """The first contacts: of a link that begins inside a mesh it is the first row."""
    inside = list(pairs_inside(located))
    if not inside:
        return contacts
    between = (one for one in contacts if not one.pair.obstacle)
    return (FirstContact(pairs[inside[0]], 0.0, clear_before=True), *between)


def enclosed_profile(
    profile: ClearanceProfile, cell: Cell, located: Mapping[int, Place]
) -> ClearanceProfile:
    """The profile with meshes as solids, until links that begin inside may come out."""
    changed = {one.name: getattr(profile, one.name).copy() for one in fields(profile)}
    for k in pairs_inside(located):
        own, partner = cell.asked.sides(k)
        obstacle = partner - len(cell.asked.own)
        met = changed["obstacle_lower"][:, obstacle] <= 0.0
        inside = ~np.logical_or.accumulate(met)
        for name, column in (("link", own), ("obstacle", obstacle)):
            for side in ("lower", "upper"):
                values = changed[f"{name}_{side}"]
                values[inside, column] = np.minimum(values[inside, column], 0.0)
    return ClearanceProfile(**changed)
