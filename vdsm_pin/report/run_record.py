"""What a report says about the run itself: inputs, versions, machine, command."""

import os
import platform
import time
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from importlib import import_module, metadata
from typing import Final

from vdsm_pin import __version__
from vdsm_pin.text import printable

_LIBRARIES: Final = ("pin", "coal", "numpy", "numba", "yourdfpy", "meshcat")

_MODULES: Final = {"pin": "pinocchio", "coal": "coal"}
"""Libraries that conda installs without the metadata of a Python distribution."""


@dataclass(frozen=True)
class RunRecord:
    """Everything needed to repeat a run.

    Args:
        command: The exact command line.
        problem_sha256: Of the problem file and the meshes it names.
        trajectory_sha256: Of the trajectory file; empty before there is one.
        urdf_sha256: Of the URDF the verification loaded.
        date: When it was run; None where files shall be the same from run to run.
    """

    command: str
    problem_sha256: str
    trajectory_sha256: str = ""
    urdf_sha256: str = ""
    date: str | None = None

    def __post_init__(self) -> None:
        """Spell what a file cannot hold: paths need not be text."""
        object.__setattr__(self, "command", printable(self.command))


def now() -> str:
    """The time in UTC to the second, or what SOURCE_DATE_EPOCH says instead."""
    fixed = os.environ.get("SOURCE_DATE_EPOCH", "")
    seconds = int(fixed) if fixed.isdecimal() else time.time()
    return datetime.fromtimestamp(seconds, UTC).strftime("%Y-%m-%d %H:%M:%S UTC")


@cache
def versions() -> dict[str, str]:
    """Versions of everything a number in the report may depend on."""
    known = {"vdsm-pin": __version__, "python": platform.python_version()}
    for name in _LIBRARIES:
        known[name] = version_of(name) or "not installed"
    return known


def version_of(name: str) -> str | None:
    """The version of an installed library; None where it is not installed."""
    with suppress(metadata.PackageNotFoundError):
        return metadata.version(name)
    if name in _MODULES:
        with suppress(ImportError):
            return str(import_module(_MODULES[name]).__version__)
    return None


@cache
def machine() -> str:
    """The machine in one line: system, architecture, number of processors."""
    system = f"{platform.system()} {platform.machine()}"
    return f"{system}, {os.cpu_count() or 1} processors"
