"""Machine code that was kept: one file for each function and kind of arguments.

It holds what numba made: an object file and the few names needed to call it. It is
loaded by numba's C extensions and LLVM alone, without numba's Python: importing that
and filling its registries takes more than a second, loading takes milliseconds.
"""

import ctypes
import importlib.machinery
import os
import pickle
import sys
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.util import find_spec, module_from_spec
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import llvmlite
import llvmlite.binding as llvm
import numpy as np

from vdsm_pin import kept

IN_THE_WAY: Final = ("NUMBA_NUM_THREADS", "NUMBA_CACHE_DIR")
"""Settings of numba that leave the code as it is."""

_engines: Final[list[Any]] = []
"""Owners of the loaded code; it stays until the process ends."""


@dataclass(frozen=True)
class MachineCode:
    """A function compiled for one kind of arguments.

    Args:
        content: The object file.
        entry: Name of the function that Python calls.
        environment: Name of the pointer through which `entry` finds `constants`.
        constants: Python objects that `entry` needs, such as the type it returns.
        needs: Names from outside.
    """

    content: bytes
    entry: str
    environment: str
    constants: tuple[Any, ...]
    needs: tuple[str, ...]


class Unusable(Exception):
    """There is no code of that name, or it needs what is not there."""


@cache
def platform() -> bytes:
    """All that decides on machine code besides the source."""
    ours = sorted(Path(__file__).parent.glob("*.py"))
    sources = (*ours, _extensions_folder() / "_version.py")
    settings = sorted(
        f"{name}={value}"
        for name, value in os.environ.items()
        if name.startswith("NUMBA_") and name not in IN_THE_WAY
    )
    words = (
        importlib.machinery.EXTENSION_SUFFIXES[0],  # Python and its kind
        np.__version__,
        llvmlite.__version__,
        llvm.get_process_triple(),
        llvm.get_host_cpu_name(),
        llvm.get_host_cpu_features().flatten(),
        *settings,
    )
    return "\n".join(words).encode() + b"".join(map(Path.read_bytes, sources))


def read(name: str) -> MachineCode:
    """The code kept under a name.

    Raises:
        Unusable: If there is none.
    """
    content = kept.read(name)
    if content is None:
        raise Unusable(name)
    code: MachineCode = pickle.loads(content)
    return code


def write(name: str, code: MachineCode) -> None:
    """Keep code for later processes."""
    kept.keep(name, pickle.dumps(code))


def load(code: MachineCode, function: Callable[..., Any]) -> Callable[..., Any]:
    """Machine code as something to call.

    Args:
        code: The code.
        function: What it was made from.

    Raises:
        Unusable: If a name from outside is unknown; LLVM would end the process.
    """
    dynamic = _runtime()
    engine = _empty_engine()  # the first one makes Python's names known
    unknown = [name for name in code.needs if llvm.address_of_symbol(name) is None]
    if unknown:
        raise Unusable(", ".join(unknown))
    engine.add_object_file(llvm.ObjectFileRef.from_data(code.content))
    engine.finalize_object()
    environment = dynamic.Environment(function.__globals__)
    environment.consts.extend(code.constants)
    pointer = engine.get_global_value_address(code.environment)
    ctypes.c_void_p.from_address(pointer).value = id(environment)
    _engines.append(engine)
    entry: Callable[..., Any] = dynamic.make_function(
        sys.modules[function.__module__],
        function.__name__,
        function.__doc__ or "",
        engine.get_function_address(code.entry),
        environment,
        None,
    )
    return entry


def _empty_engine() -> Any:
    """An engine for each: names from different files never meet."""
    machine = _target().create_target_machine()
    module = _no_module()
    engine = llvm.create_mcjit_compiler(module, machine)
    engine.remove_module(module)  # two milliseconds to translate, empty as it is
    return engine


@cache
def _target() -> Any:
    return llvm.Target.from_default_triple()


@cache
def _no_module() -> Any:
    """What every engine is made from and does not keep."""
    return llvm.parse_assembly("")


@cache
def _runtime() -> Any:
    """Make known to LLVM what compiled code calls; numba's maker of functions."""
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    helpers = _extension("numba._helperlib")
    memory = _extension("numba.core.runtime._nrt_python")
    memory.memsys_use_cpython_allocator()
    for prefix, module in (("numba_", helpers), ("NRT_", memory)):
        for name, address in module.c_helpers.items():
            llvm.add_symbol(name if name.startswith("_") else prefix + name, address)
    _teach_unpickling(helpers.c_helpers["unpickle"])
    return _extension("numba._dynfunc")


def _teach_unpickling(unpickle: int) -> None:
    """Have numba's C function for pickles call ours, which imports nothing of numba.

    It asks for its Python half once, by the name of a module. A callback made by ctypes
    would do without, but lose what a signal raises inside of it, such as the end of a
    time limit.

    Args:
        unpickle: Address of the C function.
    """
    if "numba" in sys.modules:
        return
    stand_in = ModuleType("numba.core.serialize")
    vars(stand_in)["_numba_unpickle"] = _unpickle
    shown = {"numba": ModuleType("numba"), stand_in.__name__: stand_in}
    prototype = ctypes.PYFUNCTYPE(
        ctypes.py_object, ctypes.c_char_p, ctypes.c_int, ctypes.c_char_p
    )
    content = pickle.dumps(None)
    sys.modules.update(shown)
    try:
        prototype(unpickle)(content, len(content), bytes(20))
    finally:
        for name in shown:
            del sys.modules[name]


@cache  # in C, where no signal comes between
def _unpickle(address: int, content: bytes, digest: bytes) -> Any:
    """The type of a result or what is raised, from the pickle in the code."""
    return pickle.loads(content)


def _extension(name: str) -> ModuleType:
    """A C extension of numba without the package around it.

    A later import of numba finds the same module, since its state is one to a process.
    """
    if name in sys.modules:
        return sys.modules[name]
    folder = _extensions_folder().joinpath(*name.split(".")[1:-1])
    spec = importlib.machinery.PathFinder.find_spec(name, [str(folder)])
    if spec is None or spec.loader is None:
        raise ImportError(name=name)
    module = sys.modules[name] = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@cache
def _extensions_folder() -> Path:
    spec = find_spec("numba")
    if spec is None or spec.origin is None:
        raise ImportError(name="numba")
    return Path(spec.origin).parent
