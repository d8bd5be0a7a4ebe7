"""The one place that asks numba to compile, and keeps what it made.

numba notices a change of the file a function stands in, but not of the files of the
functions it calls, and would go on with stale machine code. So the code is kept in a
folder named by the content of a module and of all that it imports. Modules with
compiled functions therefore import little.
"""

import hashlib
import re
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, Final, TypeVar, cast

import numba
from numba.extending import intrinsic

F = TypeVar("F", bound=Callable[..., Any])

IMPORT: Final = re.compile(rb"^from vdsm_pin\.([\w.]+) import", re.MULTILINE)
PACKAGE: Final = Path(__file__).parents[1]


@cache
def _sources(path: Path) -> dict[Path, bytes]:
    """A module and all of the package that it imports, with their content."""
    content = path.read_bytes()
    found = {path: content}
    for name in IMPORT.findall(content):
        other = PACKAGE.joinpath(*name.decode().split(".")).with_suffix(".py")
        if other.is_file():
            found |= _sources(other)
    return found


@cache
def _folder(path: Path) -> Path | None:
    """Where a module's machine code is kept; None where numba shall choose."""
    digest = hashlib.sha256(numba.__version__.encode())
    for _, content in sorted(_sources(path).items()):
        digest.update(content)
    folder = PACKAGE / "__pycache__" / f"{path.stem}-{digest.hexdigest()[:16]}"
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
    before, folder = config.CACHE_DIR, _folder(Path(function.__code__.co_filename))
    config.CACHE_DIR = str(folder) if folder else before
    try:
        jit = numba.njit(cache=True, nogil=True, fastmath=False, error_model="numpy")
        return cast(F, jit(function))
    finally:
        config.CACHE_DIR = before


def _apart(typing_context: Any) -> Any:
    """Keep the function that calls this from being copied into its callers.

    Without it every large function is optimised again inside every other one, and
    compiling takes minutes.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.function.attributes.add("noinline")
        return context.get_dummy_value()

    return numba.types.void(), generate


apart: Callable[[], None] = cast(Any, intrinsic)(_apart)
