"""Result folders: files are written aside and moved in whole, or not at all."""

import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from vdsm_pin.errors import InvalidFile, InvalidInput


def check_output_folder(folder: Path) -> None:
    """Refuse an output folder that cannot take files, before any work is done.

    Raises:
        InvalidFile: If it is a file, below a file, or not writable.
    """
    nearest = folder
    while not nearest.exists() and nearest != nearest.parent:
        nearest = nearest.parent
    if not nearest.is_dir():
        raise InvalidFile(file=nearest, problem="is a file, expected a folder")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InvalidFile(file=nearest, problem="is not writable")


def check_output_file(path: Path) -> None:
    """Refuse an output file that cannot be written, before any work is done.

    Raises:
        InvalidFile: If it is a folder, or its folder cannot take files.
    """
    if path.is_dir():
        raise InvalidFile(file=path, problem="is a folder, expected a file")
    check_output_folder(path.parent)


@contextmanager
def staged(folder: Path) -> Iterator[Path]:
    """A temporary folder whose files move into `folder` when the block succeeds.

    Files of the same name are replaced, each in one step; other files stay.

    Yields:
        The temporary folder, on the same file system.

    Raises:
        InvalidInput: If the file system refuses.
    """
    check_output_folder(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        aside = Path(tempfile.mkdtemp(prefix=".vdsm-", dir=folder))
    except OSError as error:
        raise _refused(folder, error) from error
    try:
        yield aside
        for path in sorted(aside.iterdir()):
            path.replace(folder / path.name)
    except OSError as error:
        raise _refused(folder, error) from error
    finally:
        shutil.rmtree(aside, ignore_errors=True)


def _refused(folder: Path, error: OSError) -> InvalidInput:
    return InvalidInput(f"{folder}: cannot write: {error.strerror or error}")
