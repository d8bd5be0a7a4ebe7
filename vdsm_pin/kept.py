"""Files made once and kept for later processes: machine code, page templates.

They can be deleted at any time: what is missing or damaged is made again.
"""

import hashlib
import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final

_DIGEST: Final = hashlib.sha256


def folders() -> Iterator[Path]:
    """Where files are looked for, and written in the first that can be."""
    yield Path(__file__).parent / "__pycache__" / "kept"
    home = os.environ.get("XDG_CACHE_HOME")
    yield (Path(home) if home else Path.home() / ".cache") / "vdsm_pin"


def read(name: str) -> bytes | None:
    """What was kept under a name; None if there is nothing, or nothing whole."""
    for folder in folders():
        try:
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
    """
    for folder in folders():
        try:
            folder.mkdir(parents=True, exist_ok=True)
            number, aside = tempfile.mkstemp(dir=folder, prefix=name)
        except OSError:  # a read-only installation
            continue
        with os.fdopen(number, "wb") as file:
            file.write(_DIGEST(content).digest() + content)
        Path(aside).chmod(0o644)  # one user installs, others run
        Path(aside).replace(folder / name)
        return
