"""The certificate of an arm's motion: what stands above the lines of its proof.

The format is docs/certificate.md.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from vdsm_pin.arm.bodies import triangle_groups
from vdsm_pin.certificate_writer.lines import (
    Hashes,
    Recorded,
    check_certified,
    write_lines,
)
from vdsm_pin.certificate_writer.links import links_of_others
from vdsm_pin.certificate_writer.schema import ErrorLimits, HeaderLine, Pair
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.geometry.solids import ConvexCover, Mesh, Prism, Solid
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, Scene, solid_of, with_hulls
from vdsm_pin.proof.budget import Budget
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.inside import locate_start, unlocated
from vdsm_pin.verification.records import ArmVerification
from vdsm_pin.verification.records import Pair as NamedPair


def write_certificate(
    path: Path,
    verification: ArmVerification,
    hashes: Hashes,
    deadline: Deadline = NO_LIMIT,
) -> None:
    """Write the proof of a certified motion.

    Args:
        path: The file; it appears whole or not at all.
        verification: Of the same problem and trajectory files.
        hashes: Of the files.
        deadline: When to give up; there is no file then.

    Raises:
        OutOfTime: If the time is over.
        VerificationFailed: If the motion is not certified: there is nothing to write.
        InvalidFile: If the file cannot be written.
    """
    check_certified(verification)
    problem, trajectory = verification.problem, verification.trajectory
    # Of a mesh without known inside the hull is proved clear, by planes for all of it.
    hulls = unlocated(locate_start(problem, trajectory))
    scene = with_hulls(problem.scene, hulls)
    hulled = replace(problem, scene=scene)
    motion = AskedMotion.of_arm(hulled, trajectory, verification.errors)
    proving = motion.proving(Budget(until=deadline.end))
    places = motion.question.places[len(motion.asked.own) :]
    pieces = proving.task.pieces
    header = _header(verification, hashes, motion.asked.pairs, pieces, places)
    whole = np.zeros(len(pieces.root), np.int64)
    for place, one in zip(places, problem.scene.obstacles, strict=True):
        whole[place] = len(one.pieces) if one.name in hulls else 0
    proof = Recorded(proving.task, proving.motion, whole)
    write_lines(path, header, proof, deadline)


def _header(
    verification: ArmVerification,
    hashes: Hashes,
    pairs: Sequence[NamedPair],
    pieces: PackedPieces,
    places: Sequence[int],
) -> HeaderLine:
    """The header; `places` are those of the obstacles among the packed bodies."""
    problem, trajectory = verification.problem, verification.trajectory
    box = verification.errors
    obstacles = [*zip(places, problem.scene.obstacles, strict=True)]
    return HeaderLine(
        **hashes.as_json(),
        errors=ErrorLimits(
            joints_rad=box.angles(trajectory.n_links).ravel().tolist(),
            **errors_beside(box, problem.scene),
        ),
        interpolation=trajectory.interpolation,
        pairs=_pairs(pairs),
        pieces=pieces_of_obstacles(obstacles, pieces) | _pieces_carried(problem),
        joined=joined_corners(problem.scene),
        links=links_of_others(obstacles, pieces),
    )


def errors_beside(errors: ErrorBox, scene: Scene) -> dict[str, Any]:
    """How far base and obstacles may be off, as every header has it."""
    off = map(errors.of_obstacle, scene.names)
    return {
        "base": (errors.base, errors.base_turn),
        "obstacles": {one.name: (one.shift, one.turn) for one in off},
    }


def _pairs(pairs: Sequence[NamedPair]) -> list[Pair]:
    """The moving body of each pair and what it is proved clear of."""
    return [
        (pair.own, pair.obstacle) if pair.obstacle else (pair.label, pair.own)
        for pair in pairs
    ]


def _pieces_carried(problem: PlanningProblem) -> dict[str, list[Any]]:
    """As of obstacles; of a mesh on a link the triangles under each hull."""
    result: dict[str, list[Any]] = {}
    for body in problem.manipulator.bodies:
        if isinstance(body.solid, Prism) and len(body.solid.convex_sections) > 1:
            result[body.name] = _triangles(body.solid)
        elif isinstance(body.solid, Mesh):
            result[body.name] = [group.tolist() for group in triangle_groups(body)]
    return result


def pieces_of_obstacles(
    obstacles: Iterable[tuple[int, Obstacle]], pieces: PackedPieces
) -> dict[str, list[Any]]:
    """The pieces of cut prisms and of meshes in the order in which planes count them.

    Triangles by the numbers of their corners for a prism, numbers of the file's
    triangles for a mesh that was sorted.

    Args:
        obstacles: The solids, each with its number among those that were packed.
        pieces: Theirs, among others.
    """
    result: dict[str, list[Any]] = {}
    for k, one in obstacles:
        obstacle: Solid | ConvexCover = solid_of(one)
        if isinstance(obstacle, ConvexCover):
            continue  # a link of another robot
        order = pieces.order[pieces.first_piece[k] : pieces.first_piece[k + 1]]
        if isinstance(obstacle, Prism) and len(order) > 1:
            triangles = _triangles(obstacle)
            result[obstacle.name] = [triangles[i] for i in order]
        elif (np.diff(order) != 1).any():
            result[obstacle.name] = order.tolist()
    return result


def joined_corners(scene: Scene) -> dict[str, tuple[list[Any], list[Any]]]:
    """By mesh the corners that are joined to close it, and its seams."""
    result = {}
    for mesh in map(solid_of, scene.obstacles):
        if isinstance(mesh, Mesh) and mesh.has_inside:
            joined = _corners_and_seams(mesh)
            if any(joined):
                result[mesh.name] = joined
    return result


def _corners_and_seams(mesh: Mesh) -> tuple[list[Any], list[Any]]:
    """Both by numbers of corners: 3 k + i is corner i of the file's triangle k."""
    closed, given = mesh.closed_mesh, mesh.triangles.reshape(-1)
    count = len(given)
    at = np.zeros(len(mesh.vertices), np.int64)
    at[given[::-1]] = np.arange(count)[::-1]  # where a vertex occurs first
    names = closed.triangles.reshape(-1)
    away = (mesh.vertices[names[:count]] != mesh.vertices[given]).any(axis=1)
    moved = np.flatnonzero(away)
    corners = np.stack([moved, at[names[moved]]], axis=1)
    seams = np.column_stack([at[names[count:]].reshape(-1, 3), closed.beside])
    return corners.tolist(), seams.tolist()


def _triangles(prism: Prism) -> list[list[int]]:
    """The section's triangles by corner numbers, run in the sense of the polygon."""
    corners = {tuple(corner): k for k, corner in enumerate(prism.polygon.tolist())}
    sense = _sense(prism.polygon)
    return [
        [corners[tuple(c)] for c in part.tolist()][:: sense * _sense(part)]
        for part in prism.convex_sections
    ]


def _sense(polygon: FloatArray) -> int:
    """1 where the corners, shape (n, 2), run anticlockwise, -1 where clockwise."""
    corners = [(Fraction(x), Fraction(y)) for x, y in polygon.tolist()]
    edges = pairwise([*corners, corners[0]])
    return 1 if sum(a[0] * b[1] - a[1] * b[0] for a, b in edges) > 0 else -1
