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
from numba._dynfunc import make_function
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
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


class _PartLibrary(JITCodeLibrary):
    """A function's code as other compiled functions use it: to link, not to run."""

    def finalize(self) -> None:
        """Leave optimising and translating to whoever is called from Python."""
        self._finalized = True


class _WholeLibrary(JITCodeLibrary):
    """The code of a function with that of all that it calls."""

    def finalize(self) -> None:
        """Link every part once, then optimise and translate.

        Callers come before what they call: the linker leaves out what nobody asks for.
        """
        order: list[Any] = []

        def visit(libraries: list[Any]) -> None:
            for library in libraries:
                if library not in seen:
                    seen.add(library)
                    if isinstance(library, _PartLibrary):
                        visit(library._linking_libraries)
                    order.append(library)

        seen: set[Any] = set()
        visit(self._linking_libraries)
        self._linking_libraries = order[::-1]
        super().finalize()  # type: ignore[no-untyped-call]


def _not_executable(library: Any, description: Any, environment: Any) -> Any:
    """What stands for a part's entry point; numba knows it by its identity."""
    name = description.qualname
    return make_function(description.lookup_module(), name, name, 0, environment, ())


class _PartCompiler(Compiler):
    """numba's own steps, with a part as their result."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)  # type: ignore[no-untyped-call]
        library: Any = _PartLibrary
        self.state.library = library(self.state.targetctx.codegen(), "part")
        self.state.targetctx.get_executable = _not_executable


class _WholeCompiler(Compiler):
    """numba's own steps, with parts brought together."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)  # type: ignore[no-untyped-call]
        library: Any = _WholeLibrary
        self.state.library = library(self.state.targetctx.codegen(), "whole")
        self.state.library.enable_object_caching()


def compiled(function: F) -> F:
    """Compile a function, keeping its type and a copy of the machine code on disk.

    Left to itself numba optimises and translates each function with all that it calls,
    even where only compiled code calls it: with functions ten deep everything is done
    ten times over. Here that is done for what Python calls, once.

    No fast-math: the bounds rest on every operation being rounded once, as written.
    The GIL is released, divisions by zero give inf or nan as numpy's do.
    """
    config: Any = numba.config
    njit: Any = numba.njit
    before, folder = config.CACHE_DIR, _folder(Path(function.__code__.co_filename))
    config.CACHE_DIR = str(folder) if folder else before
    common = {"nogil": True, "fastmath": False, "error_model": "numpy"}
    try:
        whole = njit(cache=True, pipeline_class=_WholeCompiler, **common)(function)
    finally:
        config.CACHE_DIR = before
    part = njit(
        pipeline_class=_PartCompiler,
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
        **common,
    )(function)
    # What a call in compiled code asks for.
    whole.get_call_template = part.get_call_template
    whole.get_overload = part.get_overload
    return cast(F, whole)


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
