"""numba as it comes, for versions that lack what `compiling` steps into.

The results are the same. A process starts more than a second later, since it imports
numba, and compiling takes about twice as long.
"""

import hashlib
import os
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

import numba
from numba.core.compiler import Compiler

from vdsm_pin import kept
from vdsm_pin.compiled.intrinsics import OPTIONS, by_type, pipeline


@cache
def part(function: Callable[..., Any]) -> Any:
    """A function for Python and for other functions being compiled."""
    _keep_apart()
    njit: Any = numba.njit
    steps = pipeline(function, Compiler)
    return by_type(njit(cache=True, pipeline_class=steps, **OPTIONS)(function))


@cache
def _keep_apart() -> None:
    """Give every state of the sources a folder of its own.

    numba looks at the file of a function, not at those of what it calls.
    """
    if "NUMBA_CACHE_DIR" in os.environ:
        return
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(path.read_bytes())
    folder = kept.writeable() / f"plain-{digest.hexdigest()[:16]}"
    vars(numba.config)["CACHE_DIR"] = str(folder)
