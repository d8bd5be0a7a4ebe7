"""Bytes from disk, with every way a path can be wrong told in one sentence."""

import gzip
import hashlib
import io
import os
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, Final, Protocol, cast

from vdsm_pin.errors import InvalidFile, InvalidInput
from vdsm_pin.progress import watched

BLOCK: Final = 1 << 20
"""Bytes read at one time."""

MAX_LINE: Final = 64 << 20
"""Longest line of a certificate; [bytes]. Numbers of 5 million triangles have 40 MB.

Lines of meshes and rows of tables, which `io.meshes.raw` and `io.tables` read, are far
shorter.
"""

GZIPPED: Final = b"\x1f\x8b"
"""How a gzipped file begins."""


class Digest(Protocol):
    """A hash that bytes can be added to."""

    def update(self, data: bytes | memoryview, /) -> None:
        """Add bytes."""

    def hexdigest(self) -> str:
        """The hash so far, in hexadecimal."""


def path_of(value: Any) -> Path:
    """The path of a file that a caller names.

    Raises:
        InvalidInput: If it is no name of a file.
    """
    try:
        return Path(value)
    except TypeError:
        found = type(value).__name__
        message = f"expected the name of a file, as text or Path; found {found}"
        raise InvalidInput(message) from None


def check_ending(path: Path, known: Iterable[str]) -> str:
    """The ending of a file, in small letters.

    Raises:
        InvalidFile: If it is none of those known, of which "" is to have none.
    """
    ending, (*most, last) = path.suffix.lower(), (one or "none" for one in known)
    if (ending or "none") not in (*most, last):
        found = f"ends in {path.suffix!r}" if ending else "has no ending"
        expected = f"{', '.join(most)} or {last}" if most else last
        raise InvalidFile(file=path, fault=f"{found}, expected {expected}")
    return ending


def check_is_file(path: Path) -> None:
    """Refuse what is not a readable regular file.

    Raises:
        InvalidFile: If there is no file there, or something that is not one.
    """
    try:
        if path.is_dir():
            raise InvalidFile(file=path, fault="is a folder, expected a file")
        if not path.exists():
            raise InvalidFile(file=path, fault="does not exist")
        if not path.is_file():
            raise InvalidFile(file=path, fault="is not a regular file")
    except (OSError, ValueError) as error:  # a name too long, or with a NUL in it
        reason = getattr(error, "strerror", None) or str(error)
        raise InvalidFile(file=path, fault=f"cannot be opened: {reason}") from None


def check_is_file_or_bag(path: Path) -> None:
    """Refuse what is neither a readable file nor the folder of a ROS 2 bag.

    Raises:
        InvalidFile: If it is another thing, or not there.
    """
    with readable(path):
        is_bag = (path / "metadata.yaml").is_file()
    if not is_bag:
        check_is_file(path)


@contextmanager
def readable(path: Path) -> Iterator[None]:
    """Tells what the system says of a file that is read within, or of its packing.

    Raises:
        InvalidFile: If it cannot be read.
    """
    try:
        yield
    except (OSError, EOFError, zlib.error) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise InvalidFile(file=path, fault=f"cannot be read: {reason}") from None


@contextmanager
def naming_file(path: Path) -> Iterator[None]:
    """Name a file where it makes what is done within invalid.

    Raises:
        InvalidFile: For the block's InvalidInput.
    """
    try:
        yield
    except InvalidFile:  # which names its place
        raise
    except InvalidInput as error:
        raise InvalidFile(file=path, fault=str(error)) from None


def read_bytes(path: Path, *, limit: int) -> bytes:
    """The content of a file of bounded size.

    Args:
        path: The file.
        limit: Largest size accepted; [bytes].

    Returns:
        All of it.

    Raises:
        InvalidFile: If it cannot be read, is empty or is too large.
    """
    check_is_file(path)
    with readable(path), path.open("rb") as stream:
        data = stream.read(limit + 1)
    _check_size(path, len(data), limit)
    return data


def read_text(path: Path, *, limit: int) -> str:
    """The content of a UTF-8 file of bounded size, without a byte order mark.

    Raises:
        InvalidFile: As `read_bytes`, or if it is not UTF-8.
    """
    return decode(read_bytes(path, limit=limit), path)


def decode(data: bytes, path: Path) -> str:
    """Bytes as UTF-8 text, without a byte order mark.

    Raises:
        InvalidFile: If they are not UTF-8; names the line.
    """
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        fault = f"is not UTF-8 text (byte 0x{data[error.start]:02x})"
        raise InvalidFile(file=path, where=f"line {line}", fault=fault) from None


@contextmanager
def opened(
    path: Path, *, limit: int, digest: Digest
) -> Iterator[tuple[int, "io.BufferedReader[Any]"]]:
    """A file of bounded size to be read in pieces, all of it into a digest.

    Args:
        path: The file.
        limit: Largest size accepted; [bytes].
        digest: Gets every byte of the file, in order, also those that are not asked
            for.

    Yields:
        Its size in bytes, and its bytes from the start.

    Raises:
        InvalidFile: If it cannot be read, is empty or is too large.
    """
    check_is_file(path)
    with readable(path), path.open("rb", buffering=0) as raw:
        size = os.fstat(raw.fileno()).st_size
        _check_size(path, size, limit)
        content = io.BufferedReader(_Hashed(raw, digest, size), BLOCK)
        yield size, content
        while content.read(BLOCK):
            pass


def _check_size(path: Path, size: int, limit: int) -> None:
    if not size:
        raise InvalidFile(file=path, fault="is empty")
    if size > limit:
        fault = f"is larger than {limit / 1e6:.0f} MB, the most that is read"
        raise InvalidFile(file=path, fault=fault)


class _Hashed(io.RawIOBase):
    """A file as far as it was long when it was opened; a digest sees what is read."""

    def __init__(self, raw: io.RawIOBase, digest: Digest, size: int) -> None:
        self._raw, self._digest, self._left = raw, digest, size

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: object, /) -> int:
        view = memoryview(buffer)[: self._left]  # type: ignore[arg-type]
        count = self._raw.readinto(view) or 0
        if not count and self._left:
            message = "it was cut short while it was read"
            raise OSError(message)
        self._digest.update(view[:count])
        self._left -= count
        return count


def bounded_lines(path: Path, *, limit: int = MAX_LINE) -> Iterator[bytes]:
    """The lines of a file, gzipped or not, one at a time, with their line ends.

    Args:
        path: The file.
        limit: Longest line accepted; [bytes].

    Raises:
        InvalidFile: If a line is longer, or the file cannot be read.
    """
    check_is_file(path)
    number = 0
    with readable(path), _unpacked(path) as stream:
        while line := stream.readline(limit + 1):
            number += 1
            if len(line) > limit:
                fault = f"is longer than {limit >> 20} MB, the most that is read"
                raise InvalidFile(file=path, where=f"line {number}", fault=fault)
            yield line


@contextmanager
def _unpacked(path: Path) -> Iterator[IO[bytes]]:
    """A file to read; if it begins as gzipped ones do, what is in it."""
    with path.open("rb") as raw:
        packed = raw.read(len(GZIPPED)) == GZIPPED
        raw.seek(0)
        size = max(1, path.stat().st_size)
        with watched(lambda: raw.tell() / size if not raw.closed else 1.0):
            yield cast("IO[bytes]", gzip.GzipFile(fileobj=raw)) if packed else raw


def files_in(path: Path) -> list[Path]:
    """A file, or the files in a bag's folder, in order."""
    return sorted(filter(Path.is_file, path.rglob("*"))) if path.is_dir() else [path]


def sha256_of_file(path: Path) -> str:
    """SHA-256 of a file's bytes, or of those in a bag's folder, in hexadecimal.

    Raises:
        InvalidFile: If a file is not regular or cannot be read.
    """
    digest = hashlib.sha256()
    for one in files_in(path):
        add_file(one, digest)
    return digest.hexdigest()


def add_file(path: Path, digest: "hashlib._Hash") -> None:
    """Add the bytes of a file to a hash, a block at a time.

    Raises:
        InvalidFile: If it is no regular file: a pipe or a device may have no end.
    """
    check_is_file(path)
    with readable(path), path.open("rb") as file:
        hashlib.file_digest(file, lambda: digest)


def check_unchanged(path: Path, digest: str) -> None:
    """Refuse a file that is another one than when work on it began.

    Raises:
        InvalidFile: If its SHA-256 is another one now.
    """
    with readable(path):
        same = sha256_of_file(path) == digest
    if not same:
        raise InvalidFile(file=path, fault="changed while it was worked on")


def sha256_of(parts: Iterable[bytes]) -> str:
    """SHA-256 of byte strings one after the other, in hexadecimal."""
    digest = hashlib.sha256()
    for part in parts:
        digest.update(part)
    return digest.hexdigest()
