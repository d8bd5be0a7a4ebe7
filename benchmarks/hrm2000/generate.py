"""Writes problems: python -m benchmarks.hrm2000.generate --family port --out DIR.

Problem n of a family depends on the family, n and VERSION alone. Beside every problem
lies its witness, a motion that the verifier has certified; no planner reads it. Beside
an infeasible one lies what solves its feasible twin; the verifier has refused it.
"""

import argparse
import time
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from benchmarks.hrm2000.families import FAMILIES
from benchmarks.hrm2000.files import write
from benchmarks.hrm2000.motions import DraftRejected
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory
from vdsm_pin.verification.records import ArmVerification, Verdict
from vdsm_pin.verification.verify import verify

VERSION: Final = 3
"""Raised whenever a generated file changes."""

DRAFTS: Final = 2_000
"""Most drafts of one problem."""


@dataclass(frozen=True)
class Generated:
    """A problem on disk.

    Args:
        path: The problem file.
        drafts: How many were made, the accepted one included.
        make_s: Processor time of making them; [s].
        verify_s: Processor time of verifying witnesses; [s].
    """

    path: Path
    drafts: int
    make_s: float
    verify_s: float


def witness_of(path: Path) -> Path:
    """Where the witness of a problem file lies."""
    return path.with_suffix(".witness.csv")


def verified(path: Path) -> ArmVerification:
    """The judgement of a problem's witness, both read from their files."""
    problem = read_problem(path)
    trajectory = read_trajectory(witness_of(path), problem.manipulator)
    return verify(problem, trajectory)


def _remove(path: Path) -> None:
    for old in path.parent.glob(f"{path.stem}[.-]*"):
        old.unlink()


def generate(folder: Path, family: str, number: int) -> Generated:
    """Write one problem and its witness.

    Args:
        folder: Where to; made if need be.
        family: A name in `FAMILIES`.
        number: 0, 1, ...

    Raises:
        RuntimeError: If no draft is accepted.
    """
    rng = np.random.default_rng([VERSION, zlib.crc32(family.encode()), number])
    arms, verify_s = FAMILIES[family].arms, 0.0
    begin = time.process_time()
    for drafts in range(1, DRAFTS + 1):
        try:
            draft = FAMILIES[family].draft(rng, arms[number % len(arms)])
        except DraftRejected:
            continue
        note = f"-{draft.note}" if draft.note else ""
        path = write(folder, f"{family}-{number:04d}{note}", draft)
        before = time.process_time()
        solved = verified(path).verdict is Verdict.CERTIFIED
        verify_s += time.process_time() - before
        if solved == draft.feasible:
            make_s = time.process_time() - begin - verify_s
            return Generated(path, drafts, make_s, verify_s)
        _remove(path)
    message = f"{family} {number}: none of {DRAFTS} drafts is accepted"
    raise RuntimeError(message)


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--family", choices=sorted(FAMILIES), action="append")
    parser.add_argument("--seed", type=int, default=0, help="number of the first one")
    parser.add_argument("--count", type=int, default=10)
    options = parser.parse_args()
    for family in options.family or FAMILIES:
        for number in range(options.seed, options.seed + options.count):
            made = generate(options.out, family, number)
            print(
                made.path, f"{made.drafts} drafts in {made.make_s:.1f} s,",
                f"verified in {made.verify_s:.1f} s", flush=True,
            )  # fmt: skip


if __name__ == "__main__":
    main()
