"""The checker as a program: files in, one verdict out.

The files are read by the readers that everybody uses, into their records; from there on
nothing is shared with planner or verifier. The certificate itself is read here, line by
line.

    python -m vdsm_pin.certificate_checker CERTIFICATE PROBLEM TRAJECTORY
"""

import hashlib
import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Final, NamedTuple

import numpy as np
from flint import ctx

from vdsm_pin.certificate_checker.arm import Arm
from vdsm_pin.certificate_checker.balls import Rejected, claim
from vdsm_pin.certificate_checker.claims import Clearances
from vdsm_pin.certificate_checker.robot import Robot, other_robot
from vdsm_pin.errors import InvalidFile, InvalidInput
from vdsm_pin.io.problem_file import arm_problem, find_problem, read_document
from vdsm_pin.io.source import bounded_lines, check_is_file_or_bag, check_unchanged
from vdsm_pin.robots.files import cell_file
from vdsm_pin.text import printable, show_everything

VERSION: Final = 9
PRECISION: Final = 128
"""Bits of a ball: lengths are known to about 1e-35 m."""

DAMAGE: Final = (
    *(ValueError, TypeError, LookupError, ArithmeticError),
    *(RecursionError, AttributeError),
)
"""What a file of another make raises where it is taken for a certificate."""


class Outcome(NamedTuple):
    """What a check found.

    Args:
        judged: What an accepted certificate says; empty if it is not.
        reason: Empty, or the claim that fails with its interval and pair.
        n_intervals: Intervals found good.
        n_claims: Clearances recomputed and found good.
        notes: What was assumed of the meshes.
    """

    judged: str
    reason: str
    n_intervals: int
    n_claims: int
    notes: tuple[str, ...]

    @property
    def accepted(self) -> bool:
        """Whether every claim holds."""
        return not self.reason


def _lines(path: Path) -> Iterator[dict[str, Any]]:
    """The lines of a certificate but the last one, which must seal them.

    Raises:
        Rejected: If the last line is missing, not the last or does not fit the others.
    """
    digest, lines = hashlib.sha256(), bounded_lines(path)
    for raw in lines:
        lists = raw.count(b"[") + raw.count(b"{")
        # An empty list takes 64 bytes when it is read, and 3 in the file.
        claim(6 * lists <= max(len(raw), 4096), "a line is lists and no numbers")
        line = json.loads(raw.decode(), object_pairs_hook=_unique)
        claim(isinstance(line, dict), "a line is not an object")
        if "end" in line:
            seal = {"end": True, "sha256": digest.hexdigest()}
            fits = line == seal and raw.endswith(b"\n") and not next(lines, b"")
            claim(fits, "the last line does not fit what is before or behind it")
            return
        digest.update(raw)
        yield line
    claim(False, "the last line is missing")


def _unique(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    claim(len(dict(pairs)) == len(pairs), "a key is doubled")
    return dict(pairs)


def _check(
    parts: list[Any], lines: Iterator[dict[str, Any]], problem: Path, trajectory: Path
) -> tuple[str, list[str]]:
    """What is judged, and what was assumed; `parts` grows by what is checked."""
    file = read_document(find_problem(problem))
    robot = file.is_of_robot
    stated: Any = cell_file(file) if robot else arm_problem(file, other_robot)
    header = next(lines, {})
    version, by = header.get("vdsm_certificate"), header.get("versions", {})
    told = f"is of version {version}, as vdsm-pin {by.get('vdsm_pin')} writes and "
    claim(version == VERSION, told + f"reads it; expected {VERSION}")
    asked: Any = (Robot if robot else Arm)(stated, header, trajectory)
    check_unchanged(trajectory, header["trajectory_sha256"])
    expected = [pair.names for pair in asked.pairs]
    claim(header["pairs"] == expected, "the pairs are not those of the problem")
    parts.append(Clearances(asked.tree, asked.path, asked.pairs))
    begin = parts[-1].check(lines)
    parts.append(asked.rows)
    asked.rows.check(*begin)
    return asked.judged, asked.notes


def check_certificate(certificate: Path, problem: Path, trajectory: Path) -> Outcome:
    """Recompute every claim of a certificate.

    Args:
        certificate: The certificate.
        problem: The problem file it is about.
        trajectory: The trajectory file it is about.

    Returns:
        Whether it is accepted, else why not.

    Raises:
        InvalidFile: If one of the files is not what its format says.
    """
    check_is_file_or_bag(trajectory)
    parts = list[Any]([SimpleNamespace(place="header", n_intervals=0, n_claims=0)])
    reason, judged, notes = "", "", list[str]()
    with ctx.workprec(PRECISION), np.errstate(all="ignore"):
        try:
            judged, notes = _check(parts, _lines(certificate), problem, trajectory)
        except Rejected as error:
            reason = printable(f"{parts[-1].place}: {error}")
        except DAMAGE as error:
            place, text = parts[-1].place, f"cannot be read as a certificate: {error}"
            raise InvalidFile(file=certificate, where=place, fault=text) from None
    seen = parts[:2][-1]
    return Outcome(judged, reason, seen.n_intervals, seen.n_claims, tuple(notes))


def main(arguments: Sequence[str]) -> int:
    """Check one certificate and say the outcome in one line.

    Returns:
        0 accepted, 1 rejected, 2 unreadable or wrong usage.
    """
    if len(arguments) != 3:
        sys.stderr.write("usage: check-certificate CERTIFICATE PROBLEM TRAJECTORY\n")
        return 2
    show_everything()
    try:
        outcome = check_certificate(*map(Path, arguments))
    except (InvalidInput, MemoryError) as error:
        memory = "there is too little memory; " * isinstance(error, MemoryError)
        sys.stderr.write(f"vdsm: {memory}{error}".rstrip("; ") + "\n")
        return 2
    found = f"{outcome.n_intervals} intervals, {outcome.n_claims} clearances"
    notes = "; ".join([f"{found} recomputed", *outcome.notes])
    told = outcome.reason and f"rejected: {outcome.reason}"
    sys.stdout.write(f"{told or f'accepted: {outcome.judged}'} ({notes})\n")
    return 0 if outcome.accepted else 1
