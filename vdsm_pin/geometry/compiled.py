"""The one place that asks numba to compile, and keeps what it made.

numba notices a change of the file a function stands in, but not of the files of the
functions it calls, and would go on with stale machine code. So the code is kept in a
folder named by the content of every compiled module.
"""

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numba

F = TypeVar("F", bound=Callable[..., Any])

MARK: Final = b"import compiled\n"
"""Modules with this line are compiled."""


@cache
def _folder() -> Path | None:
    """Where the machine code is kept; None where numba shall choose."""
    package = Path(__file__).parents[1]
    digest = hashlib.sha256(numba.__version__.encode())
    for path in sorted(package.rglob("*.py")):
        content = path.read_bytes()
        if MARK in content:
            digest.update(content)
    folder = package / "__pycache__" / f"compiled-{digest.hexdigest()[:16]}"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:  # a read-only installation
        return None
    return folder


def compiled(function: F) -> F:
    """Compile a function, keeping its type and a copy of the machine code on disk.

    No fast-math: the bounds rest on every operation being rounded once, as written.
    The GIL is released, divisions by zero give inf or nan as numpy's do.
    """
    config: Any = numba.config
    before, folder = config.CACHE_DIR, _folder()
    config.CACHE_DIR = str(folder) if folder else before
    try:
        jit = numba.njit(cache=True, nogil=True, fastmath=False, error_model="numpy")
        return cast(F, jit(function))
    finally:
        config.CACHE_DIR = before
