"""What a batch is given, and the folders of its results, one for each problem."""

import hashlib
import os
from collections import Counter
from collections.abc import Iterable, Sequence, Set
from contextlib import suppress
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from vdsm_pin.batch.task import MANIFEST, Task
from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.bags import is_bag
from vdsm_pin.io.problem_file import built_in_names
from vdsm_pin.io.source import read_text, sha256_of_file
from vdsm_pin.report.files import BatchRow, ManifestFile
from vdsm_pin.report.words import TIME_LIMIT

PROBLEMS: Final = ".yaml", ".yml"


MOTIONS: Final = ".csv", *PROBLEMS, ".json", ".bag", ".db3", ".mcap"
"""Endings of trajectories."""


def expanded(problems: tuple[str, ...]) -> tuple[str, ...]:
    """Every problem once, in one order whatever order they came in.

    Raises:
        InvalidFile: If a folder holds no problem file.
    """
    found: set[str] = set()
    known = built_in_names()
    for name in problems or known:
        if not _is_folder(name):
            found.add(name if name in known else str(Path(name)))
            continue
        inside = _problem_files(Path(name))
        if not inside:
            deeper = ", ".join(passed_over((name,)))
            more = f"; folders in it do: {deeper}" if deeper else ""
            raise InvalidFile(file=name, fault=f"holds no .yaml file{more}")
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
            found.add(str(Path(name)))
            continue
        beside = [p for p in Path(name).iterdir() if p.resolve() not in problems]
        inside = [p for p in beside if p.suffix.lower() in MOTIONS or is_bag(p)]
        if not inside:
            fault = f"holds no trajectory; expected {', '.join(MOTIONS)}"
            raise InvalidFile(file=name, fault=fault)
        found.update(str(path) for path in inside)
    return tuple(sorted(found))


MAX_BYTES: Final = 1 << 20
"""Of a file that a batch wrote about itself."""


def write_manifest(
    task: Task, row: BatchRow, digest: str, asked: dict[str, str]
) -> None:
    """Write manifest.json, which makes the folder a finished one."""
    task.staging.mkdir(parents=True, exist_ok=True)
    files = {path.name: sha256_of_file(path) for path in sorted(task.staging.iterdir())}
    manifest = ManifestFile(problem_sha256=digest, settings=asked, row=row, files=files)
    (task.staging / MANIFEST).write_text(manifest.text(), encoding="utf-8")


def finished(task: Task, digest: str, asked: dict[str, str]) -> BatchRow | None:
    """The row of a folder that is finished, intact and still wanted, else None."""
    try:
        text = read_text(task.final / MANIFEST, limit=MAX_BYTES)
        manifest = ManifestFile.model_validate_json(text)
        intact = all(
            sha256_of_file(task.final / name) == expected
            for name, expected in manifest.files.items()
        )
    except (OSError, ValidationError, InvalidFile):
        return None
    same = (manifest.problem_sha256, manifest.settings) == (digest, asked)
    wanted = manifest.row.outcome not in ("error", TIME_LIMIT)
    return manifest.row if intact and same and wanted else None


NEW: Final = "problem"
"""Stem of the problem files that `vdsm new` makes, each in a folder of its own."""

LONGEST_NAME: Final = 100
"""Bytes of a folder's name that come from the problem's."""


def folder_names(
    problems: tuple[str, ...], taken: Iterable[str] = ()
) -> dict[str, str]:
    """A folder name for each problem, whatever order they come in.

    Args:
        problems: Names or paths of problems, each once.
        taken: Names of other files in the same place.
    """
    plain = {problem: _plain_name(problem) for problem in problems}
    count = Counter([*plain.values(), *taken])
    names: dict[str, str] = {}
    for digits in (8, 64):  # more where short ones meet a name or each other
        names = {
            problem: name if count[name] == 1 else f"{name}-{_hash(problem)[:digits]}"
            for problem, name in plain.items()
        }
        if len(set(names.values())) == len(names):
            break
    return names


def _plain_name(problem: str) -> str:
    stem = _stem(problem)
    kept = "".join(c if c.isalnum() or c in "-_." else "-" for c in stem).strip(".-")
    return kept.encode()[:LONGEST_NAME].decode(errors="ignore") or "problem"


def _stem(problem: str) -> str:
    path = Path(problem)
    if path.stem == NEW and path.parent.name:  # as vdsm new makes: FOLDER/problem.yaml
        return path.parent.name
    named = path.suffix.lower() in (".yaml", ".yml")
    return path.stem if named else problem.strip("/")


def _hash(problem: str) -> str:
    return hashlib.sha256(os.fsencode(problem)).hexdigest()


def jobs_by_name(
    problems: Sequence[str], given: Sequence[str | None]
) -> dict[str, tuple[str, str | None]]:
    """Each problem with each motion, by the text that its folder is named after."""
    both = [(problem, motion) for problem in problems for motion in given]
    short, jobs = Counter(map(_stems, both)), {}
    for problem, motion in both:
        name = problem
        if motion is not None:
            name = _stems((problem, motion))
            name = name if short[name] == 1 else f"{problem}/{motion}"
        jobs[name] = problem, motion
    return jobs


def _stems(job: tuple[str, str | None]) -> str:
    problem, motion = job
    stem = _stem(problem)
    return stem if motion is None else f"{stem}-{Path(motion).stem}"
