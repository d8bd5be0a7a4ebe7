"""The lines of a certificate: planes, interval by interval, and the seal.

The format is docs/certificate.md. Planes are found again and go to the file as they
come, so that memory stays bounded.
"""

import gzip
import hashlib
import json
import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from itertools import chain
from pathlib import Path
from typing import IO, Any, Final, cast

import numpy as np

from vdsm_pin import __version__
from vdsm_pin.certificate_writer.schema import AnyHeader, LastLine
from vdsm_pin.errors import CertificateTooLarge, VerificationFailed
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.io.atomic import atomic_path
from vdsm_pin.io.source import MAX_LINE
from vdsm_pin.progress import step, watched
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.layouts import (
    CLAIM,
    FIRST,
    LAST,
    OF_INTERVAL,
    OF_PAIR,
    PLANE_NORMAL,
    RECORD,
    SLICE_END,
    SLICE_START,
)
from vdsm_pin.proof.motions import Motion
from vdsm_pin.proof.recording import record
from vdsm_pin.proof.terms import Task
from vdsm_pin.proof.workspace import new_workspace
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.records import Verdict, Verification

LEVEL: Final = 9
"""Of gzip; it takes a small part of the time that finding the planes does."""

PER_METRE: Final = 10**10
"""A clearance that is whole counts these parts of a metre."""

CHUNK: Final = 512
"""Intervals recorded at once."""

ROOM: Final = 65_536
"""Planes there is room for at first; doubled where one interval needs more."""

PAIRS: Final = 4096
"""Pairs whose planes become text at once."""

SHORTEST: Final = len("[[0,1,[[0,1,0,0,1,0]]]],")
"""Least that a pair takes in an interval's line; [bytes]."""

TOO_LONG: Final = (
    f"an interval takes more than {MAX_LINE >> 20} MB, the longest line that is read"
)
MOST_CLEARANCES: Final = 50_000_000
"""One for each pair and interval at least; so many take half a gigabyte."""


@dataclass(frozen=True)
class Hashes:
    """SHA-256 of the files that a certificate is about, as hexadecimal digits.

    Args:
        problem: Of the problem file and its mesh files.
        trajectory: Of the trajectory file.
    """

    problem: str
    trajectory: str

    def as_json(self) -> dict[str, Any]:
        """What every header says of them and of the writer."""
        return {
            "problem_sha256": self.problem,
            "trajectory_sha256": self.trajectory,
            "versions": {"vdsm_pin": __version__, "numpy": np.__version__},
        }


@dataclass(frozen=True)
class Recorded:
    """The proof that is written down.

    Args:
        task: What was proved, by all corners of each body.
        motion: Of what.
        whole: Pieces of each partner that one plane serves, 0 for no such rule.
    """

    task: Task
    motion: Motion
    whole: IntArray


def check_certified(verification: Verification) -> None:
    """Refuse a motion of which there is no proof to write.

    Raises:
        VerificationFailed: If it is not certified.
    """
    if verification.verdict is not Verdict.CERTIFIED:
        verdict = verification.verdict.value
        message = f"no certificate is written: the verdict is {verdict}"
        raise VerificationFailed(message)


def write_lines(
    path: Path, header: AnyHeader, proof: Recorded, deadline: Deadline = NO_LIMIT
) -> None:
    """Write a certificate; it appears whole or not at all.

    Raises:
        OutOfTime: If the time is over.
        CertificateTooLarge: If nobody would read it.
        VerificationFailed: If a proof is not found again.
        InvalidFile: If the file cannot be written.
    """
    _check_size(proof)
    digest, length = hashlib.sha256(), 0
    with atomic_path(path) as temporary, _packed(temporary) as file:
        for text in chain([header.model_dump_json() + "\n"], _lines(proof, deadline)):
            part = text.encode()
            digest.update(part)
            file.write(part)
            length += len(part)
            if length > MAX_LINE:
                raise CertificateTooLarge(TOO_LONG)
            if text.endswith("\n"):
                length = 0
        last = LastLine(end=True, sha256=digest.hexdigest())
        file.write(last.model_dump_json().encode() + b"\n")


def _check_size(proof: Recorded) -> None:
    """Refuse what would take too much of a disk, and hours to check.

    Raises:
        CertificateTooLarge: If it would.
    """
    pairs, intervals = len(proof.task.pairs.rough), max(1, len(proof.motion.knots) - 1)
    if pairs * intervals > MOST_CLEARANCES:
        message = (
            f"{pairs} pairs in {intervals} intervals have {pairs * intervals} "
            f"clearances, at most {MOST_CLEARANCES} are written"
        )
        raise CertificateTooLarge(message)
    if pairs * SHORTEST > MAX_LINE:
        raise CertificateTooLarge(TOO_LONG)


@contextmanager
def _packed(path: Path) -> Iterator[IO[bytes]]:
    """A file whose bytes are gzipped; equal content makes equal files."""
    with (
        path.open("wb") as file,
        gzip.GzipFile("", "wb", LEVEL, fileobj=file, mtime=0) as packed,
    ):
        yield cast("IO[bytes]", packed)


def _lines(proof: Recorded, deadline: Deadline) -> Iterator[str]:
    """One line per interval, in parts."""
    step("writing the certificate")
    motion, task = proof.motion, proof.task
    n_intervals = max(1, len(motion.knots) - 1)
    work = new_workspace(task, motion.knots.shape[1], Budget().slices)
    records, first = np.zeros((ROOM, RECORD)), 0
    with watched(lambda: first / n_intervals):
        while first < n_intervals:
            last = min(first + CHUNK, n_intervals)
            count, reached, pair = record(task, motion, work, first, last, records)
            deadline.check()
            if pair >= 0:
                message = (
                    f"interval {reached}: the proof of pair {pair} was not found again"
                )
                raise VerificationFailed(message)
            partner = task.pairs.obstacle[records[:count, OF_PAIR].astype(np.int64)]
            records[:count, LAST] = np.maximum(
                records[:count, LAST], proof.whole[partner]
            )
            if reached == first:
                records = np.zeros((2 * len(records), RECORD))
            yield from _interval_lines(task, records[:count], first, reached)
            first = reached


def _interval_lines(
    task: Task, records: FloatArray, first: int, last: int
) -> Iterator[str]:
    """The lines of the intervals [first, last), in parts that memory can hold."""
    keys = (FIRST, SLICE_START, OF_PAIR, OF_INTERVAL)  # the last one first
    order = np.lexsort([records[:, key] for key in keys])
    rows, n_pairs = records[order], len(task.pairs.rough)
    for k in range(first, last):
        low, high = np.searchsorted(rows[:, OF_INTERVAL], [k, k + 1])
        yield f'{{"k":{k},"proofs":['
        for begin in range(0, n_pairs, PAIRS):
            pairs = range(begin, min(begin + PAIRS, n_pairs))
            ends = np.searchsorted(rows[low:high, OF_PAIR], [pairs.start, pairs.stop])
            proofs = _proofs(task, rows[low:high][slice(*ends)].tolist(), pairs)
            text = json.dumps(proofs, separators=(",", ":"))
            yield ("," if begin else "") + text[1:-1]
        yield "]}\n"


def _proofs(task: Task, rows: list[list[float]], pairs: range) -> list[list[list[Any]]]:
    """Of one interval and each of some pairs its slices, of each slice its planes."""
    proofs: list[list[list[Any]]] = [[] for _ in pairs]
    for row in rows:
        pair, start, end = int(row[OF_PAIR]), row[SLICE_START], row[SLICE_END]
        slices = proofs[pairs.index(pair)]
        if not slices or slices[-1][0] != start:
            slices.append([_short(start), _short(end), []])
        n = [_short(x) for x in row[PLANE_NORMAL:CLAIM]]
        lower = _counted(row[CLAIM], float(task.pairs.required[pair]))
        slices[-1][2].append([int(row[FIRST]), int(row[LAST]), *n, lower])
    return proofs


def _short(value: float) -> float:
    """A whole number as such; others as they are."""
    return int(value) if value == int(value) else value


def _counted(lower: float, required: float) -> float:
    """A clearance in whole parts of a metre, more than one below it where that will do.

    Of a long motion the checker lifts its bounds by more than the prover's padding.
    """
    for spare in (1, 0):
        parts = math.floor(lower * PER_METRE) - spare
        enough = Fraction(parts, PER_METRE) >= Fraction(required)
        if enough and parts <= lower * PER_METRE:
            return parts
    return lower
