"""What kernels call that numba does not have, and how every kernel is compiled."""

from collections.abc import Callable
from time import CLOCK_MONOTONIC
from typing import Any, Final, cast

from llvmlite import ir
from numba.core import cgutils, types
from numba.core.compiler import Compiler
from numba.core.typing.templates import AttributeTemplate, make_intrinsic_template
from numba.extending import infer_getattr, lower_getattr_generic, models, register_model

from vdsm_pin.compiled import NOT_INLINED

OPTIONS: Final = {"nogil": True, "fastmath": False, "error_model": "numpy"}
"""No fast-math: the bounds rest on every operation being rounded once, as written.

The GIL is released, divisions by zero give inf or nan as numpy's do."""


def by_type(made: Any) -> Any:
    """A numba function that is compiled once for each type of its arguments.

    Left to itself numba compiles it again for every constant it is given.
    """
    choose = made.get_call_template

    def choose_by_type(arguments: tuple[Any, ...], named: dict[str, Any]) -> Any:
        plain: Any = types.unliteral
        types_of_named = {name: plain(one) for name, one in named.items()}
        return choose(tuple(map(plain, arguments)), types_of_named)

    made.get_call_template = choose_by_type
    return made


def pipeline(function: Callable[..., Any], steps: type[Compiler]) -> type[Compiler]:
    """The steps of numba that compile a function.

    Where it is not to be copied into its callers, LLVM is told so.
    """
    if not vars(function).get(NOT_INLINED):
        return steps

    class NotInlined(steps):  # type: ignore[valid-type,misc]
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            state = self.state
            lowered = state.targetctx.post_lowering

            def post_lowering(module: Any, library: Any) -> None:
                if library is state.library:  # not what numba compiles beside it
                    made = next(one for one in module.functions if one.blocks)
                    made.attributes.add("noinline")
                lowered(module, library)

            state.targetctx.post_lowering = post_lowering

    return NotInlined


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
