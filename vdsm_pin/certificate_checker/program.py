"""The checker as a program: files in, one verdict out.

The files are read by the readers that everybody uses; from there on nothing is shared
with planner or verifier. The certificate itself is read here, line by line.

    python -m vdsm_pin.certificate_checker CERTIFICATE PROBLEM TRAJECTORY
"""

import hashlib
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
from flint import ctx

from vdsm_pin.certificate_checker.arm import Arm
from vdsm_pin.certificate_checker.balls import Rejected, claim
from vdsm_pin.certificate_checker.claims import Clearances
from vdsm_pin.certificate_checker.rows import Rows
from vdsm_pin.errors import InvalidFile, InvalidInput
from vdsm_pin.io.problem_file import ProblemFile, read_problem
from vdsm_pin.io.source import bounded_lines, check_is_file, sha256_of_file
from vdsm_pin.io.trajectory_file import read_trajectory
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.text import printable, show_everything

VERSION: Final = 6
KEYS: Final = set(
    "vdsm_certificate problem_sha256 trajectory_sha256 versions interpolation errors "
    "pairs pieces joined".split()
)
PRECISION: Final = 128
"""Bits of a ball: lengths are known to about 1e-35 m."""

DAMAGE: Final = (
    *(ValueError, TypeError, LookupError, ArithmeticError),
    *(RecursionError, AttributeError),
)
"""What a file of another make raises where it is taken for a certificate."""


JUDGED: Final = (
    "clearance and pointing hold as the problem asks under the errors stated, limits, "
    "start, goal and path without them; cables are not judged"
)
"""What an accepted certificate says, and what it does not."""


@dataclass(frozen=True)
class Outcome:
    """What a check found.

    Args:
        accepted: Whether every claim holds.
        reason: Empty, or the claim that fails with its interval and pair.
        n_intervals: Intervals found good.
        n_claims: Clearances recomputed and found good.
        notes: What was assumed of the meshes.
    """

    accepted: bool
    reason: str
    n_intervals: int
    n_claims: int
    notes: tuple[str, ...]


def _lines(path: Path) -> Iterator[dict[str, Any]]:
    """The lines of a certificate but the last one, which must seal them.

    Raises:
        Rejected: If the last line is missing, not the last or does not fit the others.
    """
    digest = hashlib.sha256()
    lines = bounded_lines(path)
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


def _joined(header: dict[str, Any], file: Path, problem: PlanningProblem) -> Trajectory:
    """The trajectory, its rows joined as the certificate says."""
    version, kinds = header.get("vdsm_certificate"), ("linear", "cubic", "quintic")
    by = f"as vdsm-pin {header.get('versions', {}).get('vdsm_pin')} writes and reads it"
    claim(version == VERSION, f"is of version {version}, {by}; expected {VERSION}")
    claim(set(header) == KEYS, f"has other keys than {sorted(KEYS)}")
    joined = header["interpolation"]
    claim(joined in kinds, f"interpolation is {joined}, expected one of {kinds}")
    return read_trajectory(file, problem.manipulator, joined)


class _Run:
    """One run of the checker on an arm's certificate; `place` says where it is."""

    def __init__(self, problem: ProblemFile, trajectory: Path) -> None:
        self.problem, self.trajectory = problem, trajectory
        self.parts = list[Any]()  # those that are checked, and where they are
        self.notes = list[str]()

    @property
    def place(self) -> str:
        return self.parts[-1].place if self.parts else "header"

    def check(self, lines: Iterator[dict[str, Any]]) -> None:
        header, problem = next(lines, {}), self.problem.problem
        rows = _joined(header, self.trajectory, problem)
        hashes = {
            "problem": self.problem.sha256,
            "trajectory": sha256_of_file(self.trajectory),
        }
        for kind, sha256 in hashes.items():
            known = header[f"{kind}_sha256"] == sha256
            claim(known, f"the certificate is of another {kind} file")
        arm = Arm(problem, rows, header)
        self.parts.append(Clearances(arm.tree, arm.path, arm.pairs))
        self.parts[0].check(lines)
        self.parts.append(Rows(arm, rows))
        arm.check_outside(self.parts[0].first)
        self.parts[1].check()
        self.notes = [note for mesh in arm.meshes.values() for note in mesh.notes()]
        self.notes.append(f"{rows.interpolation} pieces join the rows")


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
    check_is_file(certificate)
    check_is_file(trajectory)
    run, reason = _Run(read_problem(problem), trajectory), ""
    with ctx.workprec(PRECISION), np.errstate(all="ignore"):
        try:
            run.check(_lines(certificate))
        except Rejected as error:
            reason = printable(f"{run.place}: {error}")
        except DAMAGE as error:
            text = f"cannot be read as a certificate: {error}"
            raise InvalidFile(file=certificate, where=run.place, problem=text) from None
    first = run.parts[0] if run.parts else None
    counts = (first.n_intervals, first.n_claims) if first else (0, 0)
    return Outcome(not reason, reason, counts[0], counts[1], tuple(run.notes))


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
    except InvalidInput as error:
        sys.stderr.write(f"vdsm: {error}\n")
        return 2
    found = f"{outcome.n_intervals} intervals, {outcome.n_claims} clearances"
    verdict = "accepted" if outcome.accepted else "rejected"
    told = JUDGED if outcome.accepted else outcome.reason
    notes = "; ".join([f"{found} recomputed", *outcome.notes])
    sys.stdout.write(f"{verdict}: {told} ({notes})\n")
    return 0 if outcome.accepted else 1
