"""Whether bodies are inside a mesh: where they are as the motion begins.

Every convex part that is proved to keep off a mesh's triangles stays on its side of
them, also where the mesh moves, so one point of it at the first row decides for the
whole motion. A snake arm hangs together: where links, tool and feed are all held off a
mesh, O_1 decides for them. Where the inside of a mesh cannot be told, a body is outside
if it is proved to keep its clearance from the mesh's hull.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple, TypeAlias, cast

import numpy as np

from vdsm_pin.errors import OutOfTime
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.convex import FlatCylinder, Hull, Piece
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.geometry.winding import Location, Side, locate
from vdsm_pin.problem.any_problem import AnyProblem
from vdsm_pin.problem.scene import solid_of
from vdsm_pin.proof.bodies import PairTable
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.question import Question
from vdsm_pin.proof.terms import CERTIFIED
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.assembly import Assembly
from vdsm_pin.verification.records import Check, CheckKind, Verdict, combine

VERDICTS: Final = {
    Side.INSIDE: Verdict.REFUTED,
    Side.UNKNOWN: Verdict.UNDECIDED,
    Side.OUTSIDE: Verdict.CERTIFIED,
}


class Place(NamedTuple):
    """Where a body begins as seen from a mesh, and a point of it that tells.

    Args:
        where: As seen from the mesh.
        point: In the base frame, shape (3,); [m].
    """

    where: Location
    point: FloatArray


Places: TypeAlias = Mapping[int, Place]
"""Where bodies begin as seen from the meshes that may have an inside, by the number of
their pair."""


def located_at_start(motion: AskedMotion) -> dict[int, Place]:
    """Where each body begins as seen from each mesh that it is held off."""
    asked, found = motion.asked, dict[int, Place]()
    solids = enumerate(map(solid_of, asked.scene.obstacles), start=len(asked.own))
    meshes = [(k, one) for k, one in solids if isinstance(one, Mesh)]
    meshes = [(k, one) for k, one in meshes if not one.is_surface]
    poses = asked.poses(motion.path.knots[:1])[0] if meshes else np.zeros((0, 4, 4))
    for number, mesh in meshes:
        pairs = np.flatnonzero(asked.table.one == number)
        found |= _as_seen_from(mesh, number, asked, pairs, poses)
    return found


def _as_seen_from(
    mesh: Mesh, number: int, asked: Assembly, pairs: IntArray, poses: FloatArray
) -> dict[int, Place]:
    """Where the bodies of some pairs are as seen from the mesh that all are held off.

    A snake arm's links are one chain: its base tells the side of all of them, unless it
    is inside, as then some link may reach out.

    Args:
        mesh: In its own frame.
        number: Its own among the bodies.
        asked: What is held apart.
        pairs: Numbers of the pairs, shape (m,).
        poses: Of all frames, shape (n_frames, 4, 4); [m].
    """
    rest, found = poses[asked.bodies[number].frame], dict[int, Place]()

    def seen(pose: FloatArray, at: FloatArray, off: float, who: str) -> Place:
        point = pose[:3, :3] @ at + pose[:3, 3]
        place = (point - rest[:3, 3]) @ rest[:3, :3]
        return Place(locate(mesh.closed_mesh, place, off)._replace(who=who), point)

    held = asked.table.other[pairs].tolist()
    links, told = range(asked.chain), dict[int, Place]()
    if links and {*links} <= {*held}:
        pose, off = poses[asked.own[0].frame], min(asked.balls[: asked.chain])
        base = seen(pose, np.zeros(3), off, "the arm")
        inside = base.where.side is Side.INSIDE
        told = dict.fromkeys(links[:1] if inside else links, base)
    for k, own in zip(pairs.tolist(), held, strict=True):
        if own in told:
            found[k] = told[own]
            continue
        body, keeps = asked.own[own], float(asked.table.required[k])
        who = "the arm" if links else f"link {body.name!r}"
        parts, pose = map(_middle, body.pieces), poses[body.frame]
        found[k] = _worst(seen(pose, at, off + keeps, who) for at, off in parts)
    return found


def _middle(piece: Piece) -> tuple[FloatArray, float]:
    """A point of a convex part of a body, and how far from its surface that is; [m]."""
    if isinstance(piece, FlatCylinder):
        return piece.centre, 0.0
    assert isinstance(piece, Hull)  # nothing that moves is a half-space
    return piece.points.mean(axis=0), piece.radius


def _worst(places: Iterable[Place]) -> Place:
    """The first of the worst: inside before unknown before outside."""
    order = list(VERDICTS)
    return min(places, key=lambda one: order.index(one.where.side))


def located(motion: AskedMotion, deadline: Deadline = NO_LIMIT) -> dict[int, Place]:
    """On which side of each mesh that may have an inside each body is.

    Args:
        motion: What is asked; the result holds for every motion within its errors.
        deadline: What is not proved by then stays unknown.
    """
    found = located_at_start(motion)
    unknown = unlocated(found)
    if not unknown:
        return found
    asked = question_of_hulls(motion, unknown, unknown)
    proof = asked.about(motion.path, Budget(until=deadline.end)).prove()
    late = "" if proof.in_time else f"; {OutOfTime(deadline.limit)}"
    for k, verdict in zip(unknown, proof.verdict.tolist(), strict=True):
        where = found[k].where
        where = where._replace(reason=where.reason + late)
        where = Location(Side.OUTSIDE) if verdict == CERTIFIED else where
        found[k] = found[k]._replace(where=where)
    return found


def unlocated(places: Places) -> list[int]:
    """Numbers of the pairs of which it is not known on which side the body is."""
    return [k for k, one in places.items() if one.where.side is Side.UNKNOWN]


def question_of_hulls(
    motion: AskedMotion, hulled: Sequence[int], pairs: Sequence[int] | None = None
) -> Question:
    """What is asked, with hulls of meshes in place of the meshes in some pairs.

    The hulls are bodies behind all others, each once, in the order of the pairs.

    Args:
        motion: What is asked.
        hulled: Numbers of the pairs that are asked of the hull of their mesh.
        pairs: Numbers of the pairs that are asked; None for all.
    """
    held, table, box = motion.asked, motion.asked.table, motion.asked.box(motion.errors)
    one, n = table.one.copy(), len(held.bodies)
    meshes = list(dict.fromkeys(one[hulled].tolist()))
    bodies, surfaces = [*held.bodies], np.asarray(box.surfaces)
    for number in meshes:
        mesh = cast("Mesh", solid_of(held.scene.obstacles[number - len(held.own)]))
        bodies.append(replace(bodies[number], pieces=mesh.hull.pieces))
    one[hulled] = [n + meshes.index(number) for number in one[hulled].tolist()]
    which = np.arange(table.size) if pairs is None else np.array(pairs)
    asked = PairTable(one[which], table.other[which], table.required[which])
    box = replace(box, surfaces=np.append(surfaces, surfaces[meshes]))
    return Question.of(held.tree, bodies, asked, box)


def by_mesh(asked: Assembly, places: Places) -> dict[str, Location]:
    """What of each mesh says the most against the motion, by its name."""
    found = dict[str, list[Place]]()
    for k, one in places.items():
        found.setdefault(asked.pair(k).obstacle, []).append(one)
    return {name: _worst(each).where for name, each in found.items()}


def is_outside(places: Places) -> bool:
    """Whether every body is known to be outside of every mesh."""
    return all(one.where.side is Side.OUTSIDE for one in places.values())


def check_inside(asked: Assembly, places: Places) -> tuple[Check, ...]:
    """The row of evidence that no body held apart from a mesh is inside it.

    Args:
        asked: What is held apart.
        places: What `located` found.

    Returns:
        One row for all meshes that may have an inside; none without.
    """
    if not places:
        return ()
    meshes = by_mesh(asked, places)
    kind = CheckKind.ARM_OUTSIDE if asked.chain else CheckKind.LINKS_OUTSIDE
    verdict = combine(tuple(VERDICTS[found.side] for found in meshes.values()))
    bad = {
        name: found
        for name, found in meshes.items()
        if VERDICTS[found.side] is verdict is not Verdict.CERTIFIED
    }
    return (
        Check(
            name=kind.value,
            verdict=verdict,
            count=len(meshes),
            worst=float(len(bad)),
            limit=0.0,
            unit="-",
            where="; ".join(found.words(name) for name, found in bad.items()),
            moment=0.0 if bad else float("nan"),
        ),
    )


def surfaces(problem: AnyProblem) -> tuple[str, ...]:
    """Names of the meshes that count as surfaces only: the file says `solid: false`."""
    meshes = (s for s in map(solid_of, problem.scene.obstacles) if isinstance(s, Mesh))
    return tuple(mesh.name for mesh in meshes if mesh.is_surface)


def mesh_notes(problem: AnyProblem) -> tuple[str, ...]:
    """What a reader must know of the meshes: surfaces only, and gaps that were joined.

    Args:
        problem: The scene.
    """
    notes = [
        f"{name!r} is a surface only, as the problem says: it has no inside"
        for name in surfaces(problem)
    ]
    for mesh in map(solid_of, problem.scene.obstacles):
        if isinstance(mesh, Mesh) and not mesh.is_surface:
            gap, closed = mesh.closed_mesh.gap, mesh.closed_mesh.closed
            if closed and gap > TOLERANCES.mesh_flat * mesh.closed_mesh.size:
                notes.append(
                    f"gaps of {mesh.name!r}, up to {gap * MM_PER_M:.2g} mm wide, were "
                    "joined to tell its inside; distances are those of its triangles"
                )
    return tuple(notes)
