"""The certificate file: a proof written down for an independent reader.

The format is docs/certificate.md. Planes are found again, interval by interval, and go
to the file as they come, so that memory stays bounded.
"""

import hashlib
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np

from vdsm_pin import __version__
from vdsm_pin.errors import VerificationFailed
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.io.atomic import atomic_path
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.scene import Prism
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.limits import extremes
from vdsm_pin.verification.proof.desk import new_desk
from vdsm_pin.verification.proof.layouts import CLAIM, FIRST, LAST, PLANE_NORMAL, RECORD
from vdsm_pin.verification.proof.recording import record
from vdsm_pin.verification.proof.terms import BASE, Motion, Task
from vdsm_pin.verification.proving import BUDGET
from vdsm_pin.verification.records import Verdict, Verification
from vdsm_pin.verification.task import all_pairs, make_task

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
        urdf: Of the arm's URDF.
    """

    problem: str
    trajectory: str
    urdf: str


def write_certificate(path: Path, verification: Verification, hashes: Hashes) -> None:
    """Write the proof of a certified motion.

    Args:
        path: The file; it appears whole or not at all.
        verification: Of the same problem and trajectory files.
        hashes: Of the files.

    Raises:
        VerificationFailed: If the motion is not certified: there is nothing to write.
        InvalidFile: If the file cannot be written.
    """
    if verification.verdict is not Verdict.CERTIFIED:
        verdict = verification.verdict.value
        message = f"no certificate is written: the verdict is {verdict}"
        raise VerificationFailed(message)
    task = make_task(verification.problem, verification.errors)
    digest = hashlib.sha256()
    n_intervals = max(1, verification.trajectory.n_samples - 1)
    with atomic_path(path) as temporary, temporary.open("wb") as file:
        header = _header(verification, hashes, task.pieces)
        for text in (json.dumps(header), *_lines(verification, task)):
            line = text.encode() + b"\n"
            digest.update(line)
            file.write(line)
        last = {"end": True, "n_intervals": n_intervals, "sha256": digest.hexdigest()}
        file.write(json.dumps(last).encode() + b"\n")


def _header(
    verification: Verification, hashes: Hashes, pieces: PackedPieces
) -> dict[str, Any]:
    problem, trajectory = verification.problem, verification.trajectory
    box, found = verification.errors, extremes(trajectory)
    rounding = TOLERANCES.arithmetic
    return {
        "vdsm_certificate": 1,
        "problem_sha256": hashes.problem,
        "trajectory_sha256": hashes.trajectory,
        "urdf_sha256": hashes.urdf,
        "versions": {"vdsm_pin": __version__, "numpy": np.__version__},
        "required_clearance_m": problem.required_clearance,
        "required_self_clearance_m": problem.required_self_clearance,
        "errors": {
            "joint_rad": box.joint,
            "base_m": box.base,
            "obstacle_m": box.obstacle,
        },
        "n_rows": trajectory.n_samples,
        "n_intervals": max(1, trajectory.n_samples - 1),
        "pairs": _pairs(problem),
        "sections": _sections(problem),
        "piece_order": _piece_order(problem, pieces),
        "limits": {
            "alpha_rad": found.alpha,
            "theta_rad": found.theta,
            "psi_rad": found.psi + rounding,
            "x0_min_m": found.x0_min,
            "x0_max_m": found.x0_max,
        },
        "tip_deviation_m": verification.tip_deviation,
        "coverage": verification.coverage,
    }


def _pairs(problem: PlanningProblem) -> list[dict[str, Any]]:
    sizes = {o.name: len(o.pieces) for o in problem.scene.obstacles}
    return [
        {"link": p.link, "obstacle": p.obstacle, "pieces": sizes[p.obstacle]}
        if p.obstacle
        else {"link": p.link, "other_link": p.other_link}
        for p in all_pairs(problem)
    ]


def _sections(problem: PlanningProblem) -> dict[str, list[list[int]]]:
    """The triangles that cut prisms are made of, by corner numbers."""
    result = {}
    for obstacle in problem.scene.obstacles:
        if isinstance(obstacle, Prism) and len(obstacle.pieces) > 1:
            corners = {tuple(c): k for k, c in enumerate(obstacle.polygon.tolist())}
            result[obstacle.name] = [
                [corners[tuple(corner)] for corner in section.tolist()]
                for section in obstacle.convex_sections
            ]
    return result


def _piece_order(
    problem: PlanningProblem, pieces: PackedPieces
) -> dict[str, list[int]]:
    """The order of the pieces of those obstacles that were sorted."""
    result = {}
    for k, obstacle in enumerate(problem.scene.obstacles):
        order = pieces.order[pieces.first_piece[k] : pieces.first_piece[k + 1]]
        if (np.diff(order) != 1).any():
            result[obstacle.name] = order.tolist()
    return result


def _lines(verification: Verification, task: Task) -> Iterator[str]:
    """One line per interval."""
    trajectory = verification.trajectory
    motion = Motion(trajectory.x0, trajectory.alpha, trajectory.theta)
    n_intervals = max(1, trajectory.n_samples - 1)
    n_links, n_pairs = trajectory.n_links, task.pairs.link.size
    desk = new_desk(n_links, n_pairs, BUDGET)
    records, first = np.zeros((ROOM, RECORD)), 0
    while first < n_intervals:
        last = min(first + CHUNK, n_intervals)
        count, reached, pair = record(task, motion, desk, first, last, records)
        if pair >= 0:
            message = (
                f"interval {reached}: the proof of pair {pair} was not found again"
            )
            raise VerificationFailed(message)
        if reached == first:
            records = np.zeros((2 * len(records), RECORD))
        yield from _interval_lines(task, records[:count], first, reached)
        first = reached


def _interval_lines(
    task: Task, records: FloatArray, first: int, last: int
) -> Iterator[str]:
    """The lines of the intervals [first, last)."""
    # A pair of links is written with n from the lower link to the higher one.
    own = task.pairs.frame[records[:, 1].astype(np.int64)] != BASE
    records[own, PLANE_NORMAL:CLAIM] *= -1.0
    order = np.lexsort((records[:, FIRST], records[:, 2], records[:, 1], records[:, 0]))
    rows = records[order]
    for k in range(first, last):
        low, high = np.searchsorted(rows[:, 0], [k, k + 1])
        yield json.dumps({"k": k, "proofs": _proofs(task, rows[low:high].tolist())})


def _proofs(task: Task, rows: list[list[float]]) -> list[list[list[Any]]]:
    """The proofs of one interval: per pair its slices, per slice its planes."""
    proofs: list[list[list[Any]]] = [[] for _ in range(task.pairs.link.size)]
    for row in rows:
        slices = proofs[int(row[1])]
        if not slices or slices[-1][0] != row[2]:
            slices.append([row[2], row[3], []])
        plane = [int(row[FIRST]), int(row[LAST]), *row[PLANE_NORMAL:RECORD]]
        slices[-1][2].append(plane)
    return proofs
