"""numba, asked for machine code where there is none yet.

Imported only then.

Left to itself numba optimises and translates each function with all that it calls, even
where only compiled code calls it: with functions ten deep everything is done ten times
over. Here that is done for what Python calls, once.
"""

from collections.abc import Callable
from functools import cache
from time import CLOCK_MONOTONIC
from typing import Any, Final, cast

import numba
from llvmlite import ir
from numba._dynfunc import make_function
from numba.core import cgutils, types
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler
from numba.core.imputils import lower_getattr_generic
from numba.core.typing.templates import (
    AttributeTemplate,
    infer_getattr,
    make_intrinsic_template,
)
from numba.extending import models, register_model

from vdsm_pin.geometry.machine_code import MachineCode

OPTIONS: Final = {"nogil": True, "fastmath": False, "error_model": "numpy"}
"""No fast-math: the bounds rest on every operation being rounded once, as written.

The GIL is released, divisions by zero give inf or nan as numpy's do."""


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
    whole = njit(pipeline_class=_WholeCompiler, no_cfunc_wrapper=True, **OPTIONS)(
        function
    )
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


@cache
def part(function: Callable[..., Any]) -> Any:
    """A function for other functions being compiled, in numba's form."""
    njit: Any = numba.njit
    made = njit(
        pipeline_class=_PartCompiler,
        no_cpython_wrapper=True,
        no_cfunc_wrapper=True,
        **OPTIONS,
    )(function)
    choose = made.get_call_template

    def choose_by_type(arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
        plain: Any = types.unliteral
        types_of_named = {name: plain(one) for name, one in named.items()}
        return choose(tuple(map(plain, arguments)), types_of_named)

    # Left to itself numba compiles a function again for every constant it is given.
    made.get_call_template = choose_by_type
    return made


def apart() -> Any:
    """The numba type of the function that forbids to copy its caller."""

    def define(typing_context: Any) -> Any:
        return types.void(), generate

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        builder.function.attributes.add("noinline")
        return context.get_dummy_value()

    template: Any = make_intrinsic_template
    return types.Function(
        template(define, define, "apart", prefer_literal=False, kwargs={})
    )


def clock() -> Any:
    """The numba type of the function that reads the monotonic clock."""

    def define(typing_context: Any) -> Any:
        return types.float64(), generate

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        helpers: Any = cgutils
        whole, real = ir.IntType(64), ir.DoubleType()
        kind = ir.FunctionType(ir.IntType(32), [ir.IntType(32), whole.as_pointer()])
        read = helpers.get_or_insert_function(builder.module, kind, "clock_gettime")
        time = helpers.alloca_once(builder, whole, size=2)  # seconds, nanoseconds
        builder.call(read, [ir.Constant(ir.IntType(32), CLOCK_MONOTONIC), time])
        places = time, builder.gep(time, [ir.Constant(whole, 1)])
        parts = [builder.sitofp(builder.load(place), real) for place in places]
        fraction = builder.fmul(parts[1], ir.Constant(real, 1e-9))
        return builder.fadd(parts[0], fraction)

    template: Any = make_intrinsic_template
    return types.Function(
        template(define, define, "clock", prefer_literal=False, kwargs={})
    )


def _without_owner(context: Any, builder: Any, kind: Any, value: Any) -> Any:
    """An array, or a tuple of whatever holds arrays, that owns nothing."""
    helpers: Any = cgutils
    if isinstance(kind, types.Array):
        array = context.make_array(kind)(context, builder, value=value)
        array.meminfo = helpers.get_null_value(array.meminfo.type)
        array.parent = helpers.get_null_value(array.parent.type)
        return array._getvalue()
    if isinstance(kind, types.BaseTuple):
        kinds: list[Any] = list(cast(Any, kind))
        items: list[Any] = helpers.unpack_tuple(builder, value)
        stripped = [
            _without_owner(context, builder, kinds[k], items[k])
            for k in range(len(items))
        ]
        return context.make_tuple(builder, kind, stripped)
    return value


class _Borrowed(types.Type):
    """A named tuple somewhere in memory: functions hand on its address alone."""

    def __init__(self, inner: Any) -> None:
        self.inner = inner
        super().__init__(name=f"borrowed({inner})")

    def field(self, name: str) -> tuple[int, Any]:
        """Number and type of a field; named tuples within are handed on as well."""
        number = self.inner.fields.index(name)
        kind: Any = list(self.inner)[number]
        return number, _lent(kind)


def _lent(kind: Any) -> Any:
    """What a value is lent as."""
    return _Borrowed(kind) if isinstance(kind, types.BaseNamedTuple) else kind


@register_model(_Borrowed)
class _BorrowedModel(models.PrimitiveModel):
    """An address."""

    def __init__(self, manager: Any, kind: Any) -> None:
        inner = manager.lookup(kind.inner).get_value_type()
        super().__init__(manager, kind, inner.as_pointer())  # type: ignore[no-untyped-call]


@infer_getattr
class _BorrowedFields(AttributeTemplate):
    """Types of fields."""

    key = _Borrowed

    def generic_resolve(self, kind: Any, name: str) -> Any:  # type: ignore[override]
        """The type of a field."""
        return kind.field(name)[1]


@lower_getattr_generic(_Borrowed)  # type: ignore[no-untyped-call,untyped-decorator]
def _field(context: Any, builder: Any, kind: Any, value: Any, name: str) -> Any:
    """A field: the address of a named tuple, the value of anything else."""
    helpers: Any = cgutils
    number, field = kind.field(name)
    place = helpers.gep_inbounds(builder, value, 0, number)
    if isinstance(field, _Borrowed):
        return place
    return _without_owner(context, builder, field, builder.load(place))


def borrowed() -> Any:
    """The numba type of the function that takes the owners off its argument."""

    def define(typing_context: Any, value: Any) -> Any:
        return _lent(value)(value), generate

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        helpers: Any = cgutils
        kind, value = signature.args[0], arguments[0]
        if isinstance(kind, types.BaseNamedTuple):
            return helpers.alloca_once_value(builder, value)
        return _without_owner(context, builder, kind, value)

    template: Any = make_intrinsic_template
    return types.Function(
        template(define, define, "borrowed", prefer_literal=False, kwargs={})
    )
