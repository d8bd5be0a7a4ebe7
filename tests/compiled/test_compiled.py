"""Machine code kept on disk: found again, never stale, never for other arguments."""

import importlib
import itertools
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest

from vdsm_pin import compiled, kept
from vdsm_pin.compiled import compiling, machine_code
from vdsm_pin.compiled.machine_code import MachineCode, Unusable
from vdsm_pin.errors import OutOfTime

SOURCE = """
from typing import NamedTuple
import numpy as np
from vdsm_pin.compiled import clock, compiled

class Pair(NamedTuple):
    first: np.ndarray
    second: float

@compiled
def twice(values):
    return FACTOR * values[0]

@compiled
def pair(values, factor):
    out = np.zeros(len(values))
    for i in range(len(values)):
        out[i] = twice(values[i:])
    return Pair(out, factor)

@compiled
def refuse(value):
    if value < 0.0:
        raise ValueError("below zero", value)
    return value

@compiled
def now():
    return clock()

@compiled
def count_until(end):
    count = 0
    while clock() < end:
        count += 1
    return count

FACTOR = 2.0
"""
PROGRAM = """
import sys
from pathlib import Path
import numpy as np
from vdsm_pin import kept
kept.folders = lambda: iter([Path(sys.argv[1])])
sys.path.insert(0, sys.argv[2])
import kernels
print(kernels.twice(np.ones(3)))
found = kernels.pair(np.ones(2), 0.5)
print(type(found).__name__, found.first.tolist(), found.second)
try:
    kernels.refuse(1.0)
    early = "numba" in sys.modules
    kernels.refuse(-1.0)
except ValueError as error:
    print(error.args)
print(early)
"""
SIGNALLED = """
import signal
class Stop(Exception):
    pass
def stop(number, frame):
    raise Stop
signal.signal(signal.SIGALRM, stop)
values, stopped = np.ones(200_000), 0
for k in range(50):
    try:
        signal.setitimer(signal.ITIMER_REAL, 1e-3 + 1e-5 * k)
        while True:
            kernels.pair(values, 0.5)
    except Stop:
        stopped += 1
print(stopped)
"""
ANSWER = "2.0\nPair [2.0, 2.0] 0.5\n('below zero', -1.0)\n"


class Two(NamedTuple):
    first: Any
    second: Any


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where this test keeps its machine code."""
    found = tmp_path / "code"
    monkeypatch.setattr(kept, "folders", lambda: iter([found]))
    return found


@pytest.fixture
def kernels(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[Callable[..., ModuleType]]:
    """A maker of modules with compiled functions, as a new process would import it."""
    # Python takes a file of the same size, changed within a second, for the same.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    path = tmp_path / "kernels.py"

    def make(source: str = SOURCE) -> ModuleType:
        path.write_text(source, encoding="utf-8")
        spec = spec_from_file_location("kernels", path)
        assert spec is not None
        assert spec.loader is not None
        module = sys.modules["kernels"] = module_from_spec(spec)
        spec.loader.exec_module(module)
        return module

    yield make
    sys.modules.pop("kernels", None)


@pytest.fixture
def asked(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Names of the functions to be compiled; each really is only once."""
    names: list[str] = []
    made: dict[str, MachineCode] = {}
    ask = compiling.machine_code

    def note(function: Callable[..., Any], arguments: tuple[Any, ...]) -> MachineCode:
        name = function.__name__
        names.append(name)
        if name not in made:
            made[name] = ask(function, arguments)
        return made[name]

    monkeypatch.setattr(compiling, "machine_code", note)
    return names


def run(folder: Path, where: Path, more: str = "") -> subprocess.Popen[str]:
    (where / "kernels.py").write_text(SOURCE, encoding="utf-8")
    words = [sys.executable, "-c", PROGRAM + more, str(folder), str(where)]
    return subprocess.Popen(words, stdout=subprocess.PIPE, text=True)


def test_later_processes_do_without_numba(tmp_path: Path) -> None:
    """Also where two make the same code at once, with no file left over."""
    together = [run(tmp_path / "code", tmp_path) for _ in range(2)]
    assert {one.communicate()[0] for one in together} == {f"{ANSWER}True\n"}
    later = run(tmp_path / "code", tmp_path)
    assert later.communicate()[0] == f"{ANSWER}False\n"
    names = [path.name.split("-")[0] for path in (tmp_path / "code").iterdir()]
    assert sorted(names) == ["kernels.pair", "kernels.refuse", "kernels.twice"]


def test_what_a_signal_raises_is_not_lost(tmp_path: Path) -> None:
    """Not even while compiled code makes its result: a time limit rests on it."""
    run(tmp_path / "code", tmp_path).communicate()
    later = run(tmp_path / "code", tmp_path, SIGNALLED)
    assert later.communicate()[0] == f"{ANSWER}False\n50\n"


def test_compiled_code_reads_the_clock_that_python_reads(
    kernels: Callable[..., ModuleType],
) -> None:
    """Oracle: Python's own clock, before and after."""
    module = kernels()
    module.now()  # makes the code
    before = time.monotonic()
    inside = module.now()
    assert before <= inside <= time.monotonic()
    assert module.count_until(inside) == 0
    assert module.count_until(time.monotonic() + 0.01) > 0
    assert time.monotonic() > inside + 0.01


def test_what_a_signal_raises_where_numba_hides_it_comes_out(
    kernels: Callable[..., ModuleType], monkeypatch: pytest.MonkeyPatch
) -> None:
    def hiding(*arguments: Any) -> Any:
        try:
            raise OutOfTime(1.0)
        except OutOfTime as error:
            message = "returned a result with an exception set"
            raise SystemError(message) from error

    module = kernels()
    monkeypatch.setattr(module.twice, "_entry", lambda kind, arguments: hiding)
    with pytest.raises(OutOfTime):
        module.twice(np.ones(2))


def test_changed_source_is_compiled_again(
    folder: Path, kernels: Callable[..., ModuleType]
) -> None:
    values = np.ones(3)
    assert kernels().twice(values) == 2.0
    assert kernels(SOURCE.replace("2.0", "3.0")).twice(values) == 3.0
    assert kernels().twice(values) == 2.0
    assert len(list(folder.iterdir())) == 2


def test_changed_import_is_another_file(
    tmp_path: Path,
    kernels: Callable[..., ModuleType],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Constants and functions of other modules, whatever way they are imported."""
    monkeypatch.syspath_prepend(str(tmp_path))
    inner = tmp_path / "inner.py"
    use = """
import inner
from inner import B, outer
@compiled
def use(value):
    return outer(value) + B
"""
    body = """
from vdsm_pin.compiled import compiled
A, B = {}, {}
@compiled
def deep(value):
    return value + A
@compiled
def outer(value):
    return deep(value)
"""
    names = []
    for values in ((1, 2), (3, 2), (1, 3), (1.0, 2), (1, 2)):
        inner.write_text(body.format(*values), encoding="utf-8")
        sys.modules.pop("inner", None)
        importlib.invalidate_caches()
        module = kernels(SOURCE + use)
        names.append(compiled._file_name(module.use._function, (float,)))
    assert len(set(names)) == 4
    assert names[0] == names[-1]


def test_comments_and_places_change_nothing(
    kernels: Callable[..., ModuleType],
) -> None:
    names = set()
    for source in (
        SOURCE,
        f"# above\n\n{SOURCE}",
        SOURCE.replace("+= 1", "+= 1  # one"),
    ):
        module = kernels(source)
        names.add(compiled._file_name(module.count_until._function, (float,)))
    assert len(names) == 1


def test_what_cannot_be_told_apart_is_refused(
    kernels: Callable[..., ModuleType],
) -> None:
    module = kernels(SOURCE.replace("FACTOR = 2.0", "FACTOR = object()"))
    with pytest.raises(TypeError, match="cannot depend on"):
        compiled._file_name(module.twice._function, (float,))


def test_other_processor_or_version_is_another_file(
    kernels: Callable[..., ModuleType], monkeypatch: pytest.MonkeyPatch
) -> None:
    function = kernels().twice._function
    before = compiled._file_name(function, (float,))
    assert compiled._file_name(function, (float,)) == before
    for module, name in (
        (machine_code.llvm, "get_host_cpu_name"),
        (machine_code.llvm, "get_process_triple"),
    ):
        with monkeypatch.context() as patch:
            patch.setattr(module, name, lambda: "another")
            machine_code.platform.cache_clear()
            assert compiled._file_name(function, (float,)) != before
    with monkeypatch.context() as patch:
        patch.setenv("NUMBA_OPT", "1")
        machine_code.platform.cache_clear()
        assert compiled._file_name(function, (float,)) != before
    machine_code.platform.cache_clear()
    assert compiled._file_name(function, (float,)) == before


def test_damaged_file_is_made_again(
    folder: Path, kernels: Callable[..., ModuleType], asked: list[str]
) -> None:
    values = np.ones(3)
    kernels().twice(values)
    (file,) = folder.iterdir()
    good = file.read_bytes()
    for bad in (b"", good[:-1], good[:99] + b"?" + good[100:]):
        file.write_bytes(bad)
        asked.clear()
        assert kernels().twice(values) == 2.0
        assert asked == ["twice"]
    asked.clear()
    assert kernels().twice(values) == 2.0
    assert asked == []


def test_nothing_to_write_to(
    tmp_path: Path,
    kernels: Callable[..., ModuleType],
    monkeypatch: pytest.MonkeyPatch,
    asked: list[str],
) -> None:
    (tmp_path / "file").touch()
    monkeypatch.setattr(kept, "folders", lambda: iter([tmp_path / "file" / "code"]))
    for _ in range(2):
        assert kernels().twice(np.ones(3)) == 2.0
    assert asked == ["twice", "twice"]


def test_unknown_name_is_refused_before_llvm_ends_the_process(
    folder: Path, kernels: Callable[..., ModuleType]
) -> None:
    module = kernels()
    module.twice(np.ones(3))
    (file,) = folder.iterdir()
    code = machine_code.read(file.name)
    assert machine_code.load(code, module.twice._function)(np.ones(1)) == 2.0
    lacking = MachineCode(
        code.content,
        code.entry,
        code.environment,
        code.constants,
        ("not_there_at_all",),
    )
    with pytest.raises(Unusable, match="not_there_at_all"):
        machine_code.load(lacking, module.twice._function)


def values() -> list[Any]:
    array = np.arange(12.0)
    frozen = array.reshape(3, 4)
    frozen.setflags(write=False)
    return [
        array,
        array[:1],
        array[::2],
        array[:0],
        array.reshape(3, 4).copy(),
        np.asfortranarray(array.reshape(3, 4)),
        array.reshape(3, 4)[:, 1:],
        array.reshape(3, 1, 4).copy(),
        np.zeros((0, 3)),
        frozen,
        array.astype(np.float32),
        array.astype(np.int64),
        array.astype(np.int32),
        array > 3.0,
        np.array(1.0),
        True,
        np.True_,
        1,
        np.int64(1),
        1.0,
        np.float64(1.0),
        (1, 2.0),
        (1.0, 2.0),
        (1.0, 2.0, 3.0),
        (array, 1.0),
        Two(1.0, 2.0),
        Two(array, (1.0, frozen)),
    ]


def test_values_of_one_kind_have_one_numba_type() -> None:
    """And the other way round, so that nothing is compiled twice."""
    from numba import typeof

    for one, other in itertools.product(values(), repeat=2):
        same = compiled._kind(one) == compiled._kind(other)
        assert same == (typeof(one) == typeof(other)), (one, other)
        words = (
            compiled._words(compiled._kind(one)),
            compiled._words(compiled._kind(other)),
        )
        assert (words[0] == words[1]) == same


class Masked(np.ndarray):
    pass


@pytest.mark.parametrize(
    "value",
    [
        None,
        "text",
        [1.0],
        {},
        1j,
        np.float32(1),
        np.zeros(2).view(Masked),
        np.zeros(17, dtype=np.uint8)[1:].view(float),
        (1.0, None),
    ],
    ids=str,
)
def test_values_compiled_code_cannot_take(
    value: Any, folder: Path, kernels: Callable[..., ModuleType]
) -> None:
    with pytest.raises(TypeError, match="compiled code takes no"):
        kernels().twice(value)


def test_array_is_never_taken_for_another(
    folder: Path, kernels: Callable[..., ModuleType]
) -> None:
    """After code for one kind is there, others get theirs or an error."""
    from numba.core.errors import NumbaError

    twice = kernels().twice
    array = np.arange(1.0, 7.0)
    assert twice(array) == 2.0
    assert twice(array[2::-1]) == 6.0
    assert twice(array.astype(np.float32)) == 2.0
    with pytest.raises(NumbaError):
        twice(array.astype(">f8"))
    with pytest.raises(TypeError):
        twice(array, array)
    with pytest.raises(TypeError):
        twice()
    with pytest.raises(TypeError):
        twice(values=array)


def test_first_calls_of_several_threads(
    folder: Path, kernels: Callable[..., ModuleType], asked: list[str]
) -> None:
    twice, found = kernels().twice, []
    many = [
        threading.Thread(target=lambda: found.append(twice(np.ones(1))))
        for _ in range(4)
    ]
    for one in many:
        one.start()
    for one in many:
        one.join()
    assert found == [2.0] * 4
    assert asked == ["twice"]


def test_results_own_their_memory(
    folder: Path, kernels: Callable[..., ModuleType]
) -> None:
    """Arrays outlive what made them, and arguments are held no longer than needed."""
    pair, values = kernels().pair, np.ones(1000)
    first = pair(values, 1.0)
    before = sys.getrefcount(values)
    kept = [pair(values, float(i)) for i in range(100)]
    assert all((one.first == 2.0).all() for one in kept)
    assert sys.getrefcount(values) == before
    first.first[:] = 0.0
    assert (kept[0].first == 2.0).all()
    assert type(first).__name__ == "Pair"
