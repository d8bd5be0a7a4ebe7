"""Time to plan by default: more until a first plan has made the machine code."""

import hashlib
import os
from collections.abc import Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Final

from vdsm_pin import kept
from vdsm_pin.time_limit import COLD_PLAN_LIMIT, PLAN_LIMIT

PLANNED: Final = "planned"
"""What is kept once a plan has been made to its end."""


def is_cold() -> bool:
    """Whether no plan was made to its end here yet, so that much is to be compiled.

    Code that was made for other versions of package or numba does not count.
    """
    return kept.read(PLANNED) != _made_for()


def default_limit() -> float:
    """How long planning may take where nobody says it; [s]."""
    return COLD_PLAN_LIMIT if is_cold() else PLAN_LIMIT


def note_planned() -> None:
    """Keep that a plan was made to its end, so that machine code is there."""
    if is_cold():
        kept.keep(PLANNED, _made_for())


def _made_for() -> bytes:
    """What machine code is made for: numba, and the package's files as they are."""
    facts = version("numba"), sorted(_sources(str(Path(__file__).parents[1])))
    return hashlib.sha256(repr(facts).encode()).digest()


def _sources(folder: str) -> Iterator[tuple[str, int, int]]:
    with os.scandir(folder) as entries:  # half the time of Path.rglob
        for entry in entries:
            if entry.name.endswith(".py"):
                found = entry.stat()
                yield entry.path, found.st_size, found.st_mtime_ns
            elif entry.is_dir() and not entry.name.startswith("__"):
                yield from _sources(entry.path)
