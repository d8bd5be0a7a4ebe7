"""numba, asked for machine code where there is none yet.

Imported only then.

Left to itself numba optimises and translates each function with all that it calls, even
where only compiled code calls it: with functions ten deep everything is done ten times
over. Here that is done for what Python calls, once.
"""

from collections.abc import Callable
from functools import cache
from typing import Any

import numba
import numpy as np
import numpy.typing as npt
from numba._dynfunc import make_function
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler

from vdsm_pin.compiled.intrinsics import OPTIONS, by_type, pipeline
from vdsm_pin.compiled.machine_code import MachineCode, load


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


def machine_code(
    function: Callable[..., Any], arguments: tuple[Any, ...]
) -> MachineCode:
    """Compile a function for arguments such as these.

    Raises:
        NumbaError: If the function cannot be compiled for them.
    """
    njit: Any = numba.njit
    typeof: Any = numba.typeof
    steps = pipeline(function, _WholeCompiler)
    whole = njit(pipeline_class=steps, no_cfunc_wrapper=True, **OPTIONS)(function)
    signature = tuple(typeof(argument) for argument in arguments)
    whole.compile(signature)
    result = whole.overloads[signature]
    return MachineCode(
        content=result.library._get_compiled_object(),
        entry=result.fndesc.llvm_cpython_wrapper_name,
        environment=result.fndesc.env_name,
        constants=tuple(result.environment.consts),
        needs=tuple(
            name.name
            for name in result.library._final_module.functions
            if name.is_declaration and not name.name.startswith("llvm.")
        ),
    )


def tried() -> bool:
    """Whether a function that calls another one can be compiled, loaded and run.

    Raises:
        Exception: Whatever numba raises where it lacks something.
    """
    last = part(_last)

    def ends(values: npt.NDArray[np.float64]) -> Any:
        return max(last(values), values[0])

    values = np.arange(3.0)
    return bool(load(machine_code(ends, (values,)), ends)(values) == 2.0)


def _last(values: npt.NDArray[np.float64]) -> Any:
    return values[len(values) - 1]


@cache
def part(function: Callable[..., Any]) -> Any:
    """A function for other functions being compiled, in numba's form."""
    njit: Any = numba.njit
    made = njit(
        pipeline_class=pipeline(function, _PartCompiler),
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
        **OPTIONS,
    )(function)
    return by_type(made)
