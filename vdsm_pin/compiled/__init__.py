"""Functions that run as machine code.

`@compiled` looks for the code of a function on disk and asks numba for it where there
is none (`compiling`): numba is imported in the first run after a change, and never
again (`machine_code`), which saves more than a second of every process. Each function
is translated once, not once in every caller, which halves the first compile.

The code belongs to the bytecode of a function and of all that it calls, with the values
of the globals that they name (`digests`). `borrowed` hands arrays on by address and
without counting (`intrinsics`). Where the installed numba lacks what this steps into,
which is tried once, and with `VDSM_PLAIN_NUMBA=1`, functions are compiled and kept by
`njit(cache=True)` (`plain`), with the same results. Nothing is read from a folder that
others can write.
"""

import hashlib
import inspect
import os
import time
from collections.abc import Callable
from contextlib import suppress
from functools import cached_property, partial, update_wrapper
from threading import RLock
from typing import Any, Final, TypeVar, overload

import numpy as np

F = TypeVar("F", bound=Callable[..., Any])
T = TypeVar("T")

NOT_INLINED: Final = "not_inlined"
"""The attribute of a function that is not to be copied into its callers."""

_C, _FORTRAN, _ALIGNED, _WRITE = 0x1, 0x2, 0x100, 0x400
"""Bits of an array's flags, as numpy numbers them."""

_SCALARS: Final[dict[type, type]] = {
    bool: bool,
    int: int,
    float: float,
    np.bool_: bool,
    np.int64: int,
    np.float64: float,
}
"""What a scalar is to compiled code."""

_one_at_a_time: Final = RLock()


def _kind(value: Any) -> Any:
    """What compiled code is made for: values of one kind share their code.

    numba would take an array that is not aligned for one that is.

    Raises:
        TypeError: If compiled code takes no such value.
    """
    given = type(value)
    if given is np.ndarray and (flags := value.flags.num) & _ALIGNED:
        return value.dtype, value.ndim, flags & _C or flags & _FORTRAN, flags & _WRITE
    if given in _SCALARS:
        return _SCALARS[given]
    if isinstance(value, tuple):
        return given, *map(_kind, value)
    message = f"compiled code takes no {given.__name__} such as {value!r}"
    raise TypeError(message)


def _words(kind: Any) -> str:
    """A kind as text, the same in every process."""
    if isinstance(kind, tuple):
        return f"({' '.join(map(_words, kind))})"
    if isinstance(kind, type):
        return f"{kind.__module__}.{kind.__qualname__}"
    return kind.str if isinstance(kind, np.dtype) else str(kind)


def _file_name(function: Callable[..., Any], kind: Any) -> str:
    """The file of a function's code for one kind of arguments."""
    from vdsm_pin.compiled.digests import digest_of
    from vdsm_pin.compiled.machine_code import platform

    digest = hashlib.sha256(platform())
    digest.update(digest_of(function))
    digest.update(_words(kind).encode())
    return f"{function.__module__}.{function.__qualname__}-{digest.hexdigest()[:32]}"


def _first_cause(error: BaseException) -> BaseException:
    while error.__cause__ is not None:
        error = error.__cause__
    return error


class _Compiled:
    """A function as Python calls it."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function = function
        self._entries: dict[Any, Callable[..., Any]] = {}
        update_wrapper(self, function)

    def __call__(self, *arguments: Any) -> Any:
        kind = tuple(map(_kind, arguments))
        entry = self._entries.get(kind)
        if entry is None:
            with _one_at_a_time:
                entry = self._entries[kind] = self._entry(kind, arguments)
        try:
            return entry(*arguments)
        except SystemError as error:
            # What a signal raised while numba's half in Python made a result.
            raise _first_cause(error) from None

    def _entry(self, kind: Any, arguments: tuple[Any, ...]) -> Callable[..., Any]:
        """The machine code for a kind of arguments, made if it is not there."""
        from vdsm_pin.compiled.machine_code import Unusable, load, read, write

        if plain_numba():
            return _plain(self._function)
        name = _file_name(self._function, kind)
        with suppress(Unusable):
            return load(read(name), self._function)
        # Only now: there is no code for too few or too many arguments.
        inspect.signature(self._function).bind(*arguments)
        from vdsm_pin.compiled.choice import compiler

        keeping = compiler()
        if keeping is None:
            return _plain(self._function)
        code = keeping.machine_code(self._function, arguments)
        write(name, code)
        return load(code, self._function)

    @property
    def _numba_type_(self) -> Any:
        """What numba asks for where compiled code calls this function."""
        from vdsm_pin.compiled.choice import compiler

        keeping = compiler()
        if keeping is None:
            made: Any = _plain(self._function)
            return made._numba_type_
        return keeping.part(self._function)._numba_type_


def plain_numba() -> bool:
    """Whether VDSM_PLAIN_NUMBA asks for numba as it comes."""
    return os.environ.get("VDSM_PLAIN_NUMBA", "0") != "0"


def _plain(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function compiled by numba as it comes."""
    from vdsm_pin.compiled.plain import part

    made: Callable[..., Any] = part(function)
    return made


class _Clock:
    """The monotonic clock, for loops that a deadline ends; [s]."""

    def __call__(self) -> float:
        """The same, where Python calls it."""
        return time.monotonic()

    @cached_property
    def _numba_type_(self) -> Any:
        from vdsm_pin.compiled.intrinsics import clock

        return clock()


class _Borrowed:
    """The same value, handed on by address, its arrays without reference counts.

    Compiled code counts the references of every array that it hands on, twice a call,
    with atomic operations, and copies every field of a tuple of fifty arrays: that
    costs more than the arithmetic of a short function. A borrowed named tuple is one
    address. Whoever calls from Python holds the arrays until the call returns, so that
    nothing inside needs to count them. Only for arguments that came from Python, and
    never to be returned.
    """

    def __call__(self, value: T) -> T:
        """The value itself, where Python calls it."""
        return value

    @cached_property
    def _numba_type_(self) -> Any:
        from vdsm_pin.compiled.intrinsics import borrowed

        return borrowed()


@overload
def compiled(function: F, /) -> F: ...


@overload
def compiled(*, inline: bool) -> Callable[[F], F]: ...


def compiled(function: F | None = None, /, *, inline: bool = True) -> Any:
    """Run a function as machine code, keeping its type.

    Arguments are positional: arrays, numbers, and tuples of them. For each new kind of
    them (dtype, dimensions, memory order, whether writeable) there is code of its own,
    so that no array is ever taken for another.

    With NUMBA_DISABLE_JIT=1, as numba has it, functions stay as they stand: for
    debuggers and for coverage. With VDSM_PLAIN_NUMBA=1, and where the installed numba
    lacks what `compiling` steps into, numba compiles and keeps them in its own way.

    Args:
        function: The function.
        inline: Whether it may be copied into its callers. A large function that may
            is optimised again inside every other one, and compiling takes minutes.
    """
    if function is None:
        return partial(compiled, inline=inline)
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        return function
    if not inline:
        vars(function)[NOT_INLINED] = True
    return _Compiled(function)


borrowed: Final = _Borrowed()
clock: Final = _Clock()
