"""Every problem of HRM-2000 by family and number: HRM-1000's families and the new ones.

HRM-1000's promise a clear start and a clear tip path, not that a plan exists; the new
ones have a witness. Two families hold problems without a solution.
"""

from pathlib import Path
from typing import Final

from benchmarks.hrm1000 import generate as first
from benchmarks.hrm1000.families import FAMILIES as FIRST
from benchmarks.hrm2000.families import FAMILIES as WITNESSED
from benchmarks.hrm2000.generate import VERSION, generate

FAMILIES: Final = (*FIRST, *WITNESSED)
"""The nine of HRM-1000, then the others."""

INFEASIBLE: Final = ("infeasible", "twins")
"""Families whose problems have no solution."""


def has_witness(family: str) -> bool:
    """Whether every problem of a family is known to have a solution."""
    return family in WITNESSED and family not in INFEASIBLE


def problem_file(folder: Path, family: str, number: int) -> Path:
    """A problem's file, made if it is not there yet.

    Args:
        folder: Of all problems; other versions of the benchmark have folders beside.
        family: A name in `FAMILIES`.
        number: 0, 1, ...
    """
    version = first.VERSION if family in FIRST else VERSION
    home = folder / f"version-{version}" / family
    for path in sorted(home.glob(f"{family}-{number:04d}*.yaml")):
        return path
    if family in FIRST:
        return first.generate(home, family, number)
    return generate(home, family, number).path
