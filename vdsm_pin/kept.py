"""Files made once and kept for later processes: machine code, page templates.

They can be deleted at any time: what is missing or damaged is made again.
"""

import hashlib
import os
import tempfile
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

_DIGEST: Final = hashlib.sha256


def folders() -> Iterator[Path]:
    """Where files are looked for, and written in the first that can be."""
    yield Path(__file__).parent / "__pycache__" / "kept"
    cache = Path(os.environ.get("XDG_CACHE_HOME", ""))
    with suppress(RuntimeError):  # a user without a home, as in many containers
        # A path that is not absolute does not count, says the specification.
        yield (cache if cache.is_absolute() else Path.home() / ".cache") / "vdsm_pin"


def functions(folder: Path) -> int:
    """How many functions' machine code is kept in a folder."""
    return sum(1 for _ in folder.glob("vdsm_pin.*")) if folder.is_dir() else 0


def read(name: str) -> bytes | None:
    """What was kept under a name; None if there is nothing, or nothing whole."""
    for folder in folders():
        try:
            if not _only_ours(folder):
                _say(f"{folder} is passed over: other users can write there")
                continue
            content = (folder / name).read_bytes()
        except OSError:
            continue
        size = _DIGEST().digest_size
        if _DIGEST(content[size:]).digest() == content[:size]:
            return content[size:]
    return None


def keep(name: str, content: bytes) -> None:
    """Keep something under a name, if there is a folder that can be written.

    The file appears whole or not at all, whoever else writes it or ends this process.
    A folder that cannot be written or is full is passed over: nothing but time is lost.
    """
    for folder in folders():
        try:
            _write(folder, name, _DIGEST(content).digest() + content)
        except OSError as error:
            _say(f"{name} is not kept in {folder}: {error}")
            continue
        return


def writeable() -> Path:
    """The folder that files are written in; the last one where none can be written."""
    for folder in folders():
        with suppress(OSError):
            probe(folder)
            return folder
    return folder


def _only_ours(folder: Path) -> bool:
    """Whether nobody but its owner can write into a folder, and we trust the owner.

    What is kept is run: machine code, and pickles.
    """
    found = folder.stat()
    trusted = {0, os.getuid(), Path(__file__).stat().st_uid}
    return found.st_uid in trusted and not found.st_mode & 0o022


def probe(folder: Path) -> None:
    """Write a file into a folder and take it away again.

    Raises:
        OSError: If that cannot be done.
    """
    _write(folder, "probe", b"")
    (folder / "probe").unlink()


def _write(folder: Path, name: str, content: bytes) -> None:
    """Write a file aside, then give it its name.

    Raises:
        OSError: If that cannot be done; nothing is left.
    """
    if not folder.is_dir():
        folder.mkdir(parents=True, exist_ok=True)
        folder.chmod(0o755)
    if not _only_ours(folder):
        message = f"other users can write into {folder}"
        raise PermissionError(message)
    number, aside = tempfile.mkstemp(dir=folder, prefix=name)
    try:
        with os.fdopen(number, "wb") as file:
            file.write(content)
        Path(aside).chmod(0o644)  # one user installs, others run
        Path(aside).replace(folder / name)
    except OSError:
        Path(aside).unlink(missing_ok=True)
        raise


def _say(message: str) -> None:
    import logging  # seldom needed, and every process would wait for it

    logging.getLogger(__name__).debug(message)
