"""The certificate file: a proof written down for an independent reader.

The format is docs/certificate.md. Planes are found again, interval by interval, and go
to the file as they come, so that memory stays bounded.
"""

import gzip
import hashlib
import json
import math
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from fractions import Fraction
from itertools import chain, pairwise
from pathlib import Path
from typing import IO, Any, Final, cast

import numpy as np

from vdsm_pin import __version__
from vdsm_pin.arm.bodies import triangle_groups
from vdsm_pin.errors import VerificationFailed
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.geometry.solids import Mesh, Prism
from vdsm_pin.io.atomic import atomic_path
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import solid_of, with_hulls
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.layouts import CLAIM, FIRST, LAST, PLANE_NORMAL, RECORD
from vdsm_pin.proof.packed_tree import Motion
from vdsm_pin.proof.recording import record
from vdsm_pin.proof.terms import Task
from vdsm_pin.proof.workspace import new_workspace
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.certificate_file import (
    ErrorLimits,
    HeaderLine,
    LastLine,
    Pair,
)
from vdsm_pin.verification.inside import locate_start, unlocated
from vdsm_pin.verification.moving import whole_motion
from vdsm_pin.verification.records import ArmVerification, Verdict
from vdsm_pin.verification.task import all_pairs, make_task

LEVEL: Final = 9
"""Of gzip; it takes a small part of the time that finding the planes does."""

PER_METRE: Final = 10**10
"""A clearance that is whole counts these parts of a metre."""

CHUNK: Final = 512
"""Intervals recorded at once."""

ROOM: Final = 65_536
"""Planes there is room for at first; doubled where one interval needs more."""


@dataclass(frozen=True)
class Hashes:
    """SHA-256 of the files that a certificate is about, as hexadecimal digits.

    Args:
        problem: Of the problem file and its mesh files.
        trajectory: Of the trajectory file.
    """

    problem: str
    trajectory: str


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
    if verification.verdict is not Verdict.CERTIFIED:
        verdict = verification.verdict.value
        message = f"no certificate is written: the verdict is {verdict}"
        raise VerificationFailed(message)
    problem, trajectory = verification.problem, verification.trajectory
    # Of a mesh without known inside the hull is proved clear, by planes for all of it.
    hulls = unlocated(locate_start(problem, trajectory))
    scene = with_hulls(problem.scene, hulls)
    asked, budget = replace(problem, scene=scene), Budget(until=deadline.end)
    motion, reach, _ = whole_motion(asked, trajectory)
    task = make_task(asked, verification.errors, budget=budget, reach=reach)
    digest = hashlib.sha256()
    with atomic_path(path) as temporary, _packed(temporary) as file:
        header = _header(verification, hashes, task.pieces)
        lines = _lines(motion, task, _whole(problem, task, hulls), deadline)
        for text in chain([header.model_dump_json()], lines):
            line = text.encode() + b"\n"
            digest.update(line)
            file.write(line)
        last = LastLine(end=True, sha256=digest.hexdigest())
        file.write(last.model_dump_json().encode() + b"\n")


@contextmanager
def _packed(path: Path) -> Iterator[IO[bytes]]:
    """A file whose bytes are gzipped; equal content makes equal files."""
    with (
        path.open("wb") as file,
        gzip.GzipFile("", "wb", LEVEL, fileobj=file, mtime=0) as packed,
    ):
        yield cast("IO[bytes]", packed)


def _header(
    verification: ArmVerification, hashes: Hashes, pieces: PackedPieces
) -> HeaderLine:
    problem, trajectory = verification.problem, verification.trajectory
    box = verification.errors
    off = [box.of_obstacle(one.name) for one in problem.scene.obstacles]
    return HeaderLine(
        problem_sha256=hashes.problem,
        trajectory_sha256=hashes.trajectory,
        versions={"vdsm_pin": __version__, "numpy": np.__version__},
        errors=ErrorLimits(
            joints_rad=box.angles(trajectory.n_links).ravel().tolist(),
            base=(box.base, box.base_turn),
            obstacles={one.name: (one.shift, one.turn) for one in off},
        ),
        interpolation=trajectory.interpolation,
        pairs=_pairs(problem),
        pieces=_pieces(problem, pieces),
        joined=_joined(problem),
    )


def _pairs(problem: PlanningProblem) -> list[Pair]:
    """The moving body of each pair and what it is proved clear of."""
    return [
        (pair.own, pair.obstacle) if pair.obstacle else (pair.label, pair.own)
        for pair in all_pairs(problem)
    ]


def _pieces(problem: PlanningProblem, pieces: PackedPieces) -> dict[str, list[Any]]:
    """The pieces of cut prisms and of meshes in the order in which planes count them.

    Triangles by the numbers of their corners for a prism, numbers of the file's
    triangles for a mesh that was sorted; of a mesh on a link those of each hull.
    """
    result: dict[str, list[Any]] = {}
    for k, obstacle in enumerate(map(solid_of, problem.scene.obstacles)):
        order = pieces.order[pieces.first_piece[k] : pieces.first_piece[k + 1]]
        if isinstance(obstacle, Prism) and len(order) > 1:
            triangles = _triangles(obstacle)
            result[obstacle.name] = [triangles[i] for i in order]
        elif (np.diff(order) != 1).any():
            result[obstacle.name] = order.tolist()
    for body in problem.manipulator.bodies:
        if isinstance(body.solid, Prism) and len(body.solid.convex_sections) > 1:
            result[body.name] = _triangles(body.solid)
        elif isinstance(body.solid, Mesh):
            result[body.name] = [group.tolist() for group in triangle_groups(body)]
    return result


def _joined(problem: PlanningProblem) -> dict[str, tuple[list[Any], list[Any]]]:
    """By mesh the corners that are joined to close it, and its seams."""
    result = {}
    for mesh in map(solid_of, problem.scene.obstacles):
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


def _whole(problem: PlanningProblem, task: Task, hulls: Collection[str]) -> IntArray:
    """Pieces of each obstacle whose hull is proved clear: one plane serves them all."""
    whole = np.zeros(len(task.pieces.root), np.int64)
    for k, obstacle in enumerate(problem.scene.obstacles):
        if obstacle.name in hulls:
            whole[k] = len(obstacle.pieces)
    return whole


def _lines(
    motion: Motion, task: Task, whole: IntArray, deadline: Deadline
) -> Iterator[str]:
    """One line per interval."""
    n_intervals = max(1, len(motion.knots) - 1)
    work = new_workspace(task, motion.knots.shape[1], Budget().slices)
    records, first = np.zeros((ROOM, RECORD)), 0
    while first < n_intervals:
        last = min(first + CHUNK, n_intervals)
        count, reached, pair = record(task, motion, work, first, last, records)
        deadline.check()
        if pair >= 0:
            message = (
                f"interval {reached}: the proof of pair {pair} was not found again"
            )
            raise VerificationFailed(message)
        partner = task.pairs.obstacle[records[:count, 1].astype(np.int64)]
        records[:count, LAST] = np.maximum(records[:count, LAST], whole[partner])
        if reached == first:
            records = np.zeros((2 * len(records), RECORD))
        yield from _interval_lines(task, records[:count], first, reached)
        first = reached


def _interval_lines(
    task: Task, records: FloatArray, first: int, last: int
) -> Iterator[str]:
    """The lines of the intervals [first, last)."""
    order = np.lexsort((records[:, FIRST], records[:, 2], records[:, 1], records[:, 0]))
    rows = records[order]
    for k in range(first, last):
        low, high = np.searchsorted(rows[:, 0], [k, k + 1])
        line = {"k": k, "proofs": _proofs(task, rows[low:high].tolist())}
        yield json.dumps(line, separators=(",", ":"))


def _proofs(task: Task, rows: list[list[float]]) -> list[list[list[Any]]]:
    """The proofs of one interval: per pair its slices, per slice its planes."""
    proofs: list[list[list[Any]]] = [[] for _ in range(task.pairs.body.size)]
    for row in rows:
        slices = proofs[int(row[1])]
        if not slices or slices[-1][0] != row[2]:
            slices.append([_short(row[2]), _short(row[3]), []])
        n = [_short(x) for x in row[PLANE_NORMAL:CLAIM]]
        lower = _counted(row[CLAIM], float(task.pairs.required[int(row[1])]))
        slices[-1][2].append([int(row[FIRST]), int(row[LAST]), *n, lower])
    return proofs


def _short(value: float) -> float:
    """A whole number as such; others as they are."""
    return int(value) if value == int(value) else value


def _counted(lower: float, required: float) -> float:
    """A clearance in parts of a metre, rounded down; as it is where that fails."""
    parts = math.floor(lower * PER_METRE)
    enough = Fraction(parts, PER_METRE) >= Fraction(required)
    return parts if enough and parts <= lower * PER_METRE else lower
