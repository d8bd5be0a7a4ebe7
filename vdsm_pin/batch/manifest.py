"""The manifest of a finished problem: by it `--resume` knows what need not be done."""

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
