"""Result folders: files are staged and moved in whole, or not at all."""

import fcntl
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Final

from vdsm_pin.errors import CannotWrite, InvalidFile
from vdsm_pin.io.atomic import check_replaceable, writing
from vdsm_pin.io.source import check_ending, files_in

UNFINISHED: Final = ".vdsm-unfinished-"
"""What the names of temporary folders begin with."""


CERTIFICATES: Final = ".certificate", ".jsonl", ""
"""How the files of certificates end."""


def problem_beside(certificate: Path) -> Path:
    """Where the problem file stands that a certificate is about, of a robot alone."""
    return certificate.parent / f"{certificate.name}.yaml"


def check_output_folder(folder: Path) -> None:
    """Refuse an output folder that cannot take files, before any work is done.

    Raises:
        InvalidFile: If it is a file, below a file, or not writable.
    """
    nearest = folder
    while not nearest.exists() and nearest != nearest.parent:
        nearest = nearest.parent
    if not nearest.is_dir():
        raise InvalidFile(file=nearest, fault="is a file, expected a folder")
    if not os.access(nearest, os.W_OK | os.X_OK):
        raise InvalidFile(file=nearest, fault="is not writable")


def check_outputs(
    inputs: Iterable[Path],
    *,
    folder: Path | None = None,
    names: Iterable[str] = (),
    files: Sequence[tuple[Path, Sequence[str]]] = (),
) -> None:
    """Refuse outputs that shall not be written, before any work is done.

    First those that cannot be written, then those that are an input or one another's
    place, then those whose name is of another kind.

    Args:
        inputs: Files that are read.
        folder: Where outputs go by their names; None for nowhere.
        names: Of these outputs.
        files: Others, each with the endings one of which it has; none where that is
            as it may be.

    Raises:
        InvalidFile: If there is one; see `check_output_folder`, `check_kept` and
            `check_ending`.
    """
    outputs = [file for file, _ in files]
    if folder is not None:
        check_output_folder(folder)
        outputs = [*(folder / name for name in names), *outputs]
    for file, _ in files:
        check_output_folder(file.parent)
    check_kept(outputs, inputs)
    for file, endings in files:
        if endings:
            check_ending(file, endings)


def check_kept(outputs: Sequence[Path], inputs: Iterable[Path]) -> None:
    """Refuse to write over a file that is read, or two files to one place.

    Paths are compared as the file system does: a link to an input is the input.

    Args:
        outputs: Files that will be written; they need not exist.
        inputs: Files that are read.

    Raises:
        InvalidFile: If one output is an input, another output, or no regular file.
    """
    places: dict[str, Path] = {}
    for output in outputs:
        check_replaceable(output)
        first = places.setdefault(os.path.realpath(output), output)
        if first is not output:
            fault = f"is where {first} goes too; nothing was written"
            raise InvalidFile(file=output, fault=fault)
    there = {identity(output): output for output in outputs}
    for one in inputs:
        known = identity(one)
        if known is not None and known in there:
            fault = f"is an input, read as {one}; nothing was written"
            raise InvalidFile(file=there[known], fault=fault)


def identity(path: Path) -> tuple[int, int] | None:
    """What tells a file from every other, whatever it is called; None for no file."""
    try:
        status = path.stat()
    except OSError:
        return None
    return status.st_dev, status.st_ino


@contextmanager
def staged(folder: Path, within: Path | None = None) -> Iterator[Path]:
    """A temporary folder whose files move into `folder` when the block succeeds.

    Those of a folder in it move into one of that name.

    Files of the same name are replaced, each in one step; other files stay. Two
    processes that fill one folder move their files one after the other, so that these
    never mix. What a killed process left is removed.

    Args:
        folder: Made where missing.
        within: Where the temporary folder lies, on the same file system; in `folder`
            where None.

    Yields:
        The temporary folder.

    Raises:
        CannotWrite: If the file system refuses.
    """
    check_output_folder(folder)
    with writing(folder):
        within = within or folder
        within.mkdir(parents=True, exist_ok=True)
        with ExitStack() as stack:
            with locked(folder):
                _remove_abandoned(within)
                staging = Path(tempfile.mkdtemp(prefix=UNFINISHED, dir=within))
                stack.callback(shutil.rmtree, staging, ignore_errors=True)
                stack.enter_context(locked(staging))
            try:
                yield staging
                with locked(folder):
                    for path in files_in(staging):
                        place = folder / path.relative_to(staging)
                        with writing(place):  # another user's, perhaps
                            place.parent.mkdir(exist_ok=True)
                            path.replace(place)
            except CannotWrite as error:  # of a staged file, whose place says nothing
                file = Path(error.file)
                ours = staging in file.parents
                told = folder / file.relative_to(staging) if ours else file
                raise CannotWrite(file=told, reason=error.reason) from error


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other processes that ask for this lock waiting; it ends with the process."""
    with _handle(folder) as handle:
        with suppress(OSError):  # of a file system that has no locks
            fcntl.flock(handle, fcntl.LOCK_EX)
        yield


def _remove_abandoned(within: Path) -> None:
    """Remove the temporary folders that no living process holds."""
    for left in within.glob(f"{UNFINISHED}*"):
        with suppress(OSError), _handle(left) as handle:  # gone by itself, or held
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
            shutil.rmtree(left, ignore_errors=True)


@contextmanager
def _handle(folder: Path) -> Iterator[int]:
    handle = os.open(folder, os.O_RDONLY)
    try:
        yield handle
    finally:
        os.close(handle)
