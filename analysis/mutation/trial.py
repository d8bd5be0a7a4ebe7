"""A change is tried in a process forked from one that has collected the tests.

Where a change lies within functions, the child replaces their code, and nothing is
imported again. What runs at import (constants, defaults, class bodies) is written to a
copy of the checkout, and the child imports what stands there, tests as well, again.
"""

import ast
import gc
import importlib
import os
import queue
import shutil
import signal
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from inspect import CO_OPTIMIZED
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, Final

import pytest

from analysis.mutation.changes import Change
from analysis.mutation.coverage_map import computed

COPIED: Final = ("vdsm_pin", "tests", "urdf", "docs", "analysis", "pyproject.toml")
PATIENCE: Final = 3.0
"""A test is ended once it has computed for so many times its usual time, and so many
seconds, which is noticing: other work on the machine makes no test fail."""

REMEMBERED: Final = 12
"""Tests that noticed changes of one function or module are asked first, so many."""

SILENCE: Final = 120.0
"""It is ended, too, after so long without computing, as it may wait for ever; [s]."""

WORDS: Final = ("-q", "-p", "no:cacheprovider", "-p", "no:xdist", "--assert=plain")


@dataclass(frozen=True)
class Task:
    """A change and whom to ask.

    Args:
        change: The change.
        tests: Names of the tests with their time on the code as it is, [s]; none:
            nobody notices.
        budget: They are asked until their times come to this; [s].
    """

    change: Change
    tests: dict[str, float]
    budget: float

    def asked(self, *first: str) -> list[str]:
        """Names of the tests to ask, some before the others."""
        names, total = [], 0.0
        for name in dict.fromkeys(
            [*(n for n in first if n in self.tests), *self.tests]
        ):
            if not names or total + self.tests[name] <= self.budget:
                total += self.tests[name]
                names.append(name)
        return names


@dataclass(frozen=True)
class Trial:
    """What came of a change.

    Args:
        change: The change.
        noticed: Whether a test failed, crashed or did not end.
        tests: Number of tests asked.
        seconds: What was computed for it.
    """

    change: Change
    noticed: bool
    tests: int
    seconds: float


def copy_checkout(root: Path, folder: Path) -> None:
    """A copy of what tests need, with the machine code that is kept."""
    folder.mkdir(parents=True, exist_ok=True)
    for name in COPIED:
        source, target = root / name, folder / name
        if source.is_dir():
            shutil.copytree(source, target, dirs_exist_ok=True)
        elif source.exists():
            shutil.copy2(source, target)


def _within(code: CodeType) -> Iterator[CodeType]:
    """The code of all that a module or class defines, nested or not."""
    for part in code.co_consts:
        if isinstance(part, CodeType):
            yield part
            yield from _within(part)


def _at_import(code: CodeType) -> tuple[Any, ...]:
    """What of a module or class body runs at import."""
    consts = [c if not isinstance(c, CodeType) else
              _at_import(c) if not c.co_flags & CO_OPTIMIZED else c.co_qualname
              for c in code.co_consts]  # fmt: skip
    return code.co_code, code.co_names, repr(consts)


def _called_at_import(source: str) -> set[str]:
    """Names that a module calls outside of its functions and classes."""
    kept = [s for s in ast.parse(source).body
            if not isinstance(s, ast.FunctionDef | ast.ClassDef)]  # fmt: skip
    calls = (n for s in kept for n in ast.walk(s) if isinstance(n, ast.Call))
    return {one.func.id for one in calls if isinstance(one.func, ast.Name)}


def new_code(module: Path, change: Change) -> dict[tuple[str, int], CodeType] | None:
    """The code of a changed module's functions by name and first line.

    Returns:
        None where something differs that runs at import.
    """
    source = module.read_text(encoding="utf-8")
    before = compile(source, str(module), "exec")
    after = compile(change.content, str(module), "exec")
    if _at_import(before) != _at_import(after):
        return None
    if change.function.partition(".")[0] in _called_at_import(source):
        return None
    every = list(_within(after))
    found = {(code.co_qualname, code.co_firstlineno): code for code in every}
    return found if len(found) == len(every) else None


class Bench:
    """A plugin of pytest that tries changes in place of running the tests once.

    Args:
        folder: A copy of the checkout, this process's own.
        tasks: What is left to try; None: no more.
        done: Where trials go.
    """

    def __init__(
        self, folder: Path, tasks: "queue.Queue[Task | None]", done: Callable[..., None]
    ) -> None:
        self._folder, self._tasks, self._done = folder, tasks, done
        self._functions: dict[Path, list[FunctionType]] = {}
        self._failed = False
        self._noticed_by: dict[str, list[str]] = {}

    @pytest.hookimpl(tryfirst=True)
    def pytest_runtestloop(self, session: pytest.Session) -> bool:
        """Try one change after another."""
        items = {item.nodeid: item for item in session.items}
        while (task := self._tasks.get()) is not None:
            self._done(self._try(task, items))
        return True

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Note that a test failed."""
        self._failed |= report.failed

    def _try(self, task: Task, items: dict[str, pytest.Item]) -> Trial:
        change, begun = task.change, computed()
        if not task.tests:
            return Trial(change, False, 0, 0.0)
        if not change.line:
            return Trial(change, self._fail(task, items), len(task.tests), 0.0)
        module = self._folder / change.module
        code = new_code(module, change)
        if code is None:
            status = self._written(module, task)
        else:
            status = self._replaced(module, code, task, items)
        return Trial(change, status != 0, len(task.tests), computed() - begun)

    def _fail(self, task: Task, items: dict[str, pytest.Item]) -> bool:
        """Whether tests fail here and now, where nothing is changed.

        What they load, modules and machine code, is loaded in every child from then on.
        """
        self._failed = False
        for name in task.asked():
            item = items[name]
            item.ihook.pytest_runtest_protocol(item=item, nextitem=None)
        return self._failed

    def _replaced(
        self, module: Path, code: dict[tuple[str, int], CodeType], task: Task,
        items: dict[str, pytest.Item],
    ) -> int:  # fmt: skip
        """Exit status of the tests in a child whose functions have other code."""
        functions = self._functions_of(module)
        module_name = task.change.module
        places = f"{module_name}:{task.change.function}", module_name
        names = task.asked(*(n for p in places for n in self._noticed_by.get(p, [])))
        reading, writing = os.pipe()

        def child() -> int:
            for function in functions:
                old = function.__code__
                function.__code__ = code[old.co_qualname, old.co_firstlineno]
            for k, name in enumerate(names):
                item, after = items[name], [items[n] for n in names[k + 1 : k + 2]]
                nextitem = after[0] if after else None
                limit = PATIENCE * (1.0 + task.tests[name])
                signal.setitimer(signal.ITIMER_PROF, limit)  # ends the process
                item.ihook.pytest_runtest_protocol(item=item, nextitem=nextitem)
                if self._failed:
                    os.write(writing, name.encode())
                    return 1
            return 0

        status = _status(_forked(child))
        os.close(writing)
        with os.fdopen(reading, encoding="utf-8") as told:
            name = told.read()
        for place in places if name else ():
            known = [n for n in self._noticed_by.get(place, []) if n != name]
            self._noticed_by[place] = [name, *known][:REMEMBERED]
        return status

    def _functions_of(self, module: Path) -> list[FunctionType]:
        """All functions of a module that are alive."""
        if module not in self._functions:
            name = module.relative_to(self._folder).with_suffix("").as_posix()
            importlib.import_module(name.replace("/", ".").removesuffix(".__init__"))
            self._functions[module] = [
                found for found in gc.get_objects() if type(found) is FunctionType
                and found.__code__.co_filename == str(module)
            ]  # fmt: skip
        return self._functions[module]

    def _written(self, module: Path, task: Task) -> int:
        """Exit status of the tests in a child that imports the checkout again."""
        kept = module.read_bytes()
        module.write_text(task.change.content, encoding="utf-8")
        names = task.asked()
        limit = PATIENCE * (2.0 + sum(task.tests[name] for name in names))

        def child() -> int:
            for name, one in [*sys.modules.items()]:
                if str(getattr(one, "__file__", "")).startswith(f"{self._folder}/"):
                    del sys.modules[name]
            signal.setitimer(signal.ITIMER_PROF, limit)  # ends the process
            return pytest.main(["-x", "-s", *WORDS, *names])

        try:
            return _status(_forked(child))
        finally:
            module.write_bytes(kept)


def _forked(work: Callable[[], int]) -> int:
    """A child that ends with what `work` returns."""
    child = os.fork()
    if child:
        return child
    status = 1
    try:
        os.setpgid(0, 0)
        status = work()
    finally:
        os._exit(status)


def _status(child: int) -> int:
    """Exit status of a child; above 0 where its tests fail or do not end."""
    before, ends, pause = "", time.monotonic() + SILENCE, 0.001
    while time.monotonic() < ends:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return abs(os.waitstatus_to_exitcode(status))
        if before != (now := _computed(child)):
            before, ends = now, time.monotonic() + SILENCE
        time.sleep(pause)
        pause = min(0.02, 1.5 * pause)
    os.killpg(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return signal.SIGKILL


def _computed(process: int) -> str:
    """What the system counts of the time that a process and those before computed."""
    stat = Path(f"/proc/{process}/stat").read_text(encoding="utf-8")
    return " ".join(stat.rpartition(")")[2].split()[11:15])


def try_changes(
    folder: Path,
    files: list[str],
    tasks: "queue.Queue[Task | None]",
    done: Callable[[Trial], None],
    plain: str | None,
) -> None:
    """Collect tests in this process, which prints no more, and try changes with them.

    Args:
        folder: A copy of the checkout, this process's own.
        files: Of tests.
        tasks: What to try; None: no more.
        done: Takes each trial.
        plain: Variable that turns machine code off, if it shall be.
    """
    os.chdir(folder)
    # Byte code of one change would pass for the next one of its size and second.
    sys.dont_write_bytecode = True
    more = {"PYTHONPATH": str(folder), "PYTHONDONTWRITEBYTECODE": "1"}
    os.environ.update(more if plain is None else more | {plain: "1"})
    sys.path.insert(0, str(folder))
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, 1)
    os.dup2(nowhere, 2)
    place = f"--basetemp={folder.with_name(folder.name + '-tests')}"
    pytest.main(["-s", *WORDS, place, *files], plugins=[Bench(folder, tasks, done)])
