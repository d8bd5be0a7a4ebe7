"""Files that appear whole or not at all."""

import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from vdsm_pin.errors import CannotWrite, InvalidFile, lacks_memory


def check_replaceable(path: Path) -> None:
    """Refuse to put a file where something stands that is none, as a pipe or a device.

    Raises:
        InvalidFile: If there is a folder or a special file.
    """
    if path.is_dir():
        raise InvalidFile(file=path, fault="is a folder, expected a file")
    if path.exists() and not path.is_file():
        raise InvalidFile(file=path, fault="is there and is not a regular file")


@contextmanager
def writing(place: str | Path) -> Iterator[None]:
    """Tell of whatever keeps a block from writing to a file or folder.

    Raises:
        CannotWrite: For the block's OSError.
        MemoryError: If that is for want of memory.
    """
    try:
        yield
    except BrokenPipeError:  # of who reads what we print
        raise
    except OSError as error:
        if lacks_memory(error):  # of a library that is loaded meanwhile
            message = "a library has no room"
            raise MemoryError(message) from error
        raise CannotWrite(file=place, reason=error.strerror or str(error)) from error


@contextmanager
def atomic_path(path: str | Path) -> Iterator[Path]:
    """A path to write to, whose file takes its final name when the block succeeds.

    The temporary file lies in the same folder, which is made where missing, and is
    removed when the block fails. Content reaches the disk before the name does, so that
    a crash leaves the old file or the new one.

    Args:
        path: Final name; an existing file is replaced.

    Yields:
        The temporary path.

    Raises:
        InvalidFile: If something stands there that is no file.
        CannotWrite: If the folder cannot be made or the file not be written.
    """
    final = Path(path)
    begin = os.fsdecode(os.fsencode(final.name)[:80])  # names have 255 bytes
    temporary = final.parent / f".{begin}.{secrets.token_hex(8)}.part"
    try:
        with writing(path):
            check_replaceable(final)
            final.parent.mkdir(parents=True, exist_ok=True)
            yield temporary
            _flush(temporary)
            temporary.replace(final)
            _flush(final.parent)
    finally:
        with suppress(OSError):  # told above already, or nothing to remove
            temporary.unlink()


def write_text(path: str | Path, text: str) -> None:
    """Write UTF-8 text, whole or not at all; see `write_bytes`."""
    write_bytes(path, text.encode("utf-8"))


def write_bytes(path: str | Path, content: bytes) -> None:
    """Write a file, whole or not at all.

    Raises:
        InvalidFile: If something stands there that is no file.
        CannotWrite: If the file cannot be written.
    """
    with atomic_path(path) as temporary:
        temporary.write_bytes(content)


def _flush(path: Path) -> None:
    """Bring a file, or the names in a folder, to the disk."""
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
