"""Problems and motions that a batch is given: names, files and folders of them."""

from collections.abc import Set
from contextlib import suppress
from pathlib import Path
from typing import Final

from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.bags import is_bag
from vdsm_pin.io.problem_file import built_in_names

PROBLEMS: Final = ".yaml", ".yml"


MOTIONS: Final = ".csv", *PROBLEMS, ".json", ".bag", ".db3", ".mcap"
"""Endings of trajectories."""


def expanded(problems: tuple[str, ...]) -> tuple[str, ...]:
    """Every problem once, in one order whatever order they came in.

    Raises:
        InvalidFile: If a folder holds no problem file.
    """
    found: set[str] = set()
    for name in problems or built_in_names():
        if not _is_folder(name):
            found.add(name)
            continue
        inside = _problem_files(Path(name))
        if not inside:
            deeper = ", ".join(passed_over((name,)))
            more = f"; folders in it do: {deeper}" if deeper else ""
            raise InvalidFile(file=name, problem=f"holds no .yaml file{more}")
        found.update(map(str, inside))
    return tuple(sorted(found))


def passed_over(problems: tuple[str, ...]) -> tuple[str, ...]:
    """Folders with .yaml files inside of those named, which nobody named."""
    folders = [Path(name) for name in problems if _is_folder(name)]
    inside = {sub for folder in folders for sub in folder.iterdir() if sub.is_dir()}
    found = []
    for folder in sorted(inside - set(folders)):
        with suppress(OSError):  # of one that may not be read, as `lost+found`
            found += [str(folder)] if _problem_files(folder) else []
    return tuple(found)


def _is_folder(name: str) -> bool:
    return Path(name).is_dir() and name not in built_in_names()


def _problem_files(folder: Path) -> list[Path]:
    return [path for path in folder.iterdir() if path.suffix.lower() in PROBLEMS]


def motions(names: tuple[str, ...], problems: Set[Path]) -> tuple[str, ...]:
    """Every trajectory once, in one order; `problems` beside them are none.

    Raises:
        InvalidFile: If a folder holds none.
    """
    found: set[str] = set()
    for name in names:
        if not Path(name).is_dir():
            found.add(name)
            continue
        beside = [p for p in Path(name).iterdir() if p.resolve() not in problems]
        inside = [p for p in beside if p.suffix.lower() in MOTIONS or is_bag(p)]
        if not inside:
            problem = f"holds no trajectory; expected {', '.join(MOTIONS)}"
            raise InvalidFile(file=name, problem=problem)
        found.update(str(path) for path in inside)
    return tuple(sorted(found))
