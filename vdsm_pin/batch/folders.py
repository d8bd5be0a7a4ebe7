"""The folders of a batch's results, one for each problem, and what ends each."""

import hashlib
import os
from collections import Counter
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from vdsm_pin.batch.task import MANIFEST, Task
from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.source import read_text, sha256_of_file
from vdsm_pin.report.files import BatchRow, ManifestFile
from vdsm_pin.report.words import TIME_LIMIT

MAX_BYTES: Final = 1 << 20
"""Of a file that a batch wrote about itself."""


def write_manifest(
    task: Task, row: BatchRow, digest: str, asked: dict[str, str]
) -> None:
    """Write manifest.json, which makes the folder a finished one."""
    task.aside.mkdir(parents=True, exist_ok=True)
    files = {path.name: sha256_of_file(path) for path in sorted(task.aside.iterdir())}
    manifest = ManifestFile(problem_sha256=digest, settings=asked, row=row, files=files)
    (task.aside / MANIFEST).write_text(manifest.text(), encoding="utf-8")


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
    path = Path(problem)
    stem = path.stem if path.suffix.lower() in (".yaml", ".yml") else problem.strip("/")
    if stem == NEW and path.parent.name:  # as vdsm new makes them: FOLDER/problem.yaml
        stem = path.parent.name
    kept = "".join(c if c.isalnum() or c in "-_." else "-" for c in stem).strip(".-")
    return kept.encode()[:LONGEST_NAME].decode(errors="ignore") or "problem"


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
    return "-".join(Path(name).stem for name in job if name is not None)
