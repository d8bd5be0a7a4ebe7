"""What the machine code of a function depends on: its bytecode and all that it names.

numba compiles bytecode and takes the values of globals as constants, so the digest of a
function covers both, and those of every function that it calls. A comment changes
nothing; another constant in another module does.
"""

import hashlib
from collections.abc import Iterator
from enum import Enum
from functools import cache
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any, Final

import numpy as np

from vdsm_pin.compiled import NOT_INLINED

_PACKAGE: Final = __name__.partition(".")[0]
_PLAIN: Final = (type(None), bool, int, float, complex, str, bytes, type(...))
_BY_VERSION: Final = ("numpy", "math", "numba", "builtins")
"""Modules whose version stands for their functions."""


@cache
def digest_of(function: FunctionType) -> bytes:
    """A digest of a function with all that it calls.

    Raises:
        TypeError: If the function uses a value that nobody can tell apart.
    """
    reached, waiting = {function}, [function]
    while waiting:
        new = set(_read(waiting.pop())[1]) - reached
        reached |= new
        waiting += new
    return hashlib.sha256(b"".join(sorted(_read(one)[0] for one in reached))).digest()


@cache
def _read(function: FunctionType) -> tuple[bytes, tuple[FunctionType, ...]]:
    """A digest of a function by itself, and the functions that it calls."""
    called: dict[FunctionType, None] = {}
    words = [
        function.__module__,
        function.__qualname__,
        repr(NOT_INLINED in vars(function)),
    ]
    words += _code_words(function.__code__)
    words += [_word(value, called) for value in function.__defaults__ or ()]
    for name, value in sorted(_named(function).items()):
        words += [name, _word(value, called)]
    digest = hashlib.sha256("\0".join(words).encode()).digest()
    return digest, tuple(called)


def _code_words(code: CodeType) -> list[str]:
    """What a code object does, whatever its lines and comments."""
    words = [code.co_code.hex(), code.co_exceptiontable.hex(), str(code.co_flags)]
    words += [str(code.co_argcount), *code.co_names, *code.co_varnames]
    words += [*code.co_cellvars, *code.co_freevars]
    for constant in code.co_consts:
        inner = isinstance(constant, CodeType)
        words += _code_words(constant) if inner else [_word(constant, {})]
    return words


def _named(function: FunctionType) -> dict[str, Any]:
    """The values of the globals and outer variables that a function names.

    Of a module of this package also the attributes: `module.name`.
    """
    cells = function.__closure__ or ()
    outer = zip(function.__code__.co_freevars, cells, strict=True)
    found = {name: cell.cell_contents for name, cell in outer}
    known = function.__globals__
    names = set(_all_names(function.__code__))
    found |= {name: known[name] for name in names & known.keys()}
    for name, value in list(found.items()):
        if isinstance(value, ModuleType) and value.__name__.startswith(_PACKAGE):
            inner = vars(value)
            found |= {f"{name}.{one}": inner[one] for one in names & inner.keys()}
    return found


def _all_names(code: CodeType) -> Iterator[str]:
    yield from code.co_names
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _all_names(constant)


def _word(value: Any, called: dict[FunctionType, None]) -> str:
    """A value as text, the same in every process; functions are added to `called`.

    Raises:
        TypeError: If two values of the kind cannot be told apart.
    """
    if isinstance(value, _PLAIN):
        return repr(value)
    if isinstance(value, np.ndarray | np.generic):
        content = np.ascontiguousarray(value).tobytes()
        return f"{value.dtype.str} {value.shape} {hashlib.sha256(content).hexdigest()}"
    if isinstance(value, tuple | list):
        return f"({', '.join(_word(one, called) for one in value)})"
    if isinstance(value, frozenset):
        return f"{{{', '.join(sorted(_word(one, called) for one in value))}}}"
    if isinstance(value, Enum):
        return f"{type(value).__qualname__} {value.name} {value.value!r}"
    if isinstance(value, type):
        return (
            f"{value.__module__}.{value.__qualname__} {getattr(value, '_fields', '')}"
        )
    if isinstance(value, ModuleType):
        return value.__name__
    function = getattr(value, "__wrapped__", value)
    if isinstance(function, FunctionType):
        if function.__module__.partition(".")[0] not in _BY_VERSION:
            called.setdefault(function)
        return f"{function.__module__}.{function.__qualname__}"
    if isinstance(value, BuiltinFunctionType | np.ufunc):
        return value.__name__
    if type(value).__module__.startswith(f"{_PACKAGE}.compiled"):
        return type(value).__qualname__
    message = f"compiled code cannot depend on {value!r}"
    raise TypeError(message)
