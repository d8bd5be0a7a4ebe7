"""A change is tried: its module stands in a copy of the checkout, its tests run there.

Each change has a process of its own, forked from one that has imported the libraries
already: most of a test run's time would be these imports.
"""

import importlib
import math
import os
import resource
import shutil
import signal
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from analysis.mutation.changes import Change

LIBRARIES: Final = (
    *("numpy", "flint", "pydantic", "pytest", "scipy.spatial", "shapely", "trimesh"),
    *("yaml", "jsonschema", "typer", "rich"),
)
COPIED: Final = ("vdsm_pin", "tests", "urdf", "docs", "analysis", "pyproject.toml")
PATIENCE: Final = 3.0
"""A run is ended once it has computed for so many times its usual time, and so many
seconds: other work on the machine makes no test fail."""

SILENCE: Final = 120.0
"""It is ended, too, after so long without computing, as it may wait for ever; [s]."""


@dataclass(frozen=True)
class Trial:
    """What came of a change.

    Args:
        change: The change.
        noticed: Whether a test failed, crashed or did not end.
        tests: Number of tests asked.
        seconds: How long it took.
    """

    change: Change
    noticed: bool
    tests: int
    seconds: float


def copy_checkout(root: Path, folder: Path) -> None:
    """A copy of what tests need, with the machine code that is kept."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in COPIED:
        source, target = root / name, folder / name
        if source.is_dir():
            shutil.copytree(source, target, dirs_exist_ok=True)
        elif source.exists():
            shutil.copy2(source, target)


def import_libraries() -> None:
    """Import what tests import besides the package."""
    for name in LIBRARIES:
        importlib.import_module(name)


def try_change(
    folder: Path, change: Change, tests: list[str], usual: float, plain: str | None
) -> Trial:
    """Run tests on a change.

    Args:
        folder: A copy of the checkout, this process's own.
        change: The change.
        tests: Names of the tests; none: nobody notices.
        usual: Their time on the code as it is; [s].
        plain: Variable that turns machine code off, if it shall be.
    """
    if not tests:
        return Trial(change, False, 0, 0.0)
    module, begun = folder / change.module, time.monotonic()
    kept = module.read_bytes()
    module.write_text(change.content, encoding="utf-8")
    try:
        status = _status(folder, tests, PATIENCE * (1.0 + usual), plain)
    finally:
        module.write_bytes(kept)
    return Trial(change, status != 0, len(tests), time.monotonic() - begun)


def _status(folder: Path, tests: list[str], limit: float, plain: str | None) -> int:
    """Exit status of the tests in a child; above 0 where they fail or do not end."""
    child = os.fork()
    if child == 0:
        os.setpgid(0, 0)
        seconds = math.ceil(limit)
        resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds))
        _run_tests(folder, tests, plain)
    computed, ends = "", time.monotonic() + SILENCE
    while time.monotonic() < ends:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return abs(os.waitstatus_to_exitcode(status))
        if computed != (now := _computed(child)):
            computed, ends = now, time.monotonic() + SILENCE
        time.sleep(0.02)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return signal.SIGKILL


def _computed(process: int) -> str:
    """What the system counts of the time that a process and those before computed."""
    stat = Path(f"/proc/{process}/stat").read_text(encoding="utf-8")
    return " ".join(stat.rpartition(")")[2].split()[11:15])


def _run_tests(folder: Path, tests: list[str], plain: str | None) -> None:
    """In the child: run them, say nothing, end."""
    import pytest

    os.chdir(folder)
    os.environ["PYTHONPATH"] = str(folder)
    # Byte code of one change would pass for the next one of its size and second.
    sys.dont_write_bytecode = True
    os.environ["PYTHONDONTWRITEBYTECODE"] = "1"
    if plain is not None:
        os.environ[plain] = "1"
    sys.path.insert(0, str(folder))
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    status = 1
    try:
        # Its libraries are imported already, so pytest rewrites no assertions.
        words = [
            "-x",
            "-q",
            "-p",
            "no:cacheprovider",
            "-p",
            "no:xdist",
            "--assert=plain",
        ]
        status = int(pytest.main([*words, *tests]))
    finally:
        os._exit(status)
