"""Which tests run which lines, and how long each test takes."""

import hashlib
import json
import os
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import coverage
import pytest

SLOW: Final = 6.0
"""Tests that take longer are ended, and not asked; [s]."""

AT_ONCE: Final = 16
"""Files of tests run in one process: what it saw is kept before the next one begins."""

PLAIN: Final = "NUMBA_DISABLE_JIT"
"""Where it is 1, functions for machine code run as they stand, in Python."""


@dataclass(frozen=True)
class CoverageMap:
    """What was seen in one run of the tests.

    Args:
        tests: Names of the tests that run a line, by module and line.
        seconds: Duration by test.
    """

    tests: dict[str, dict[int, list[str]]]
    seconds: dict[str, float]

    def _of(self, places: dict[str, tuple[int, ...]]) -> set[str]:
        """Tests that run one of the lines of some modules."""
        none: list[str] = []
        return {test for module, lines in places.items() for line in lines
                for test in self.tests.get(module, {}).get(line, none)}  # fmt: skip

    def runs(self, places: dict[str, tuple[int, ...]]) -> bool:
        """Whether some test runs one of the lines of some modules."""
        return bool(self._of(places))

    def meets(self, places: dict[str, tuple[int, ...]]) -> bool:
        """Whether a test, one that is not asked or an import runs one of the lines."""
        return any(line in self.tests.get(module, {}) for module, lines in
                   places.items() for line in lines)  # fmt: skip

    def asked(self, places: dict[str, tuple[int, ...]]) -> dict[str, float]:
        """Tests of lines of some modules with their seconds.

        The quickest of each file come first, since tests of one file notice the same,
        then all others, the quickest first: these hold functions to formulas.

        Where no test runs any of the lines, all may be asked: what runs at import has
        an effect anywhere.
        """
        known = self._of(places) or {
            name for name, used in self.seconds.items() if used < SLOW
        }
        turns, rank = Counter[str](), {}
        for test in sorted(known, key=lambda name: (self.seconds[name], name)):
            file = test.partition("::")[0]
            turns[file] += 1
            rank[test] = (turns[file] > 1, self.seconds[test], test)
        return {t: self.seconds[t] for t in sorted(rank, key=rank.__getitem__)}


PROGRAMS: Final = ("subprocess.Popen", "os.fork", "os.forkpty", "os.posix_spawn")
"""Events of a test that starts a program, in which changed functions are as they were:
such a test is ended, and not asked."""


class TooSlow(BaseException):
    """A test takes too long to be asked; no `except Exception` of a test sees it."""


def _end_test(*_: object) -> None:
    raise TooSlow


def computed() -> float:
    """What this process and those that it started have computed so far; [s]."""
    return sum(os.times()[:4])


class Recorder:
    """A plugin of pytest: the test that runs is the context of what is covered."""

    def __init__(self, running: coverage.Coverage) -> None:
        self._running = running
        self.seconds: dict[str, float] = {}
        self._in_test = False
        sys.addaudithook(self._heard)

    def _heard(self, event: str, _: object) -> None:
        if self._in_test and event in PROGRAMS:
            raise TooSlow

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        """Note what a test runs and how long it computes, fixtures included."""
        self._running.switch_context(item.nodeid)
        begun = computed()
        self.seconds[item.nodeid] = 0.0
        result = yield
        self.seconds[item.nodeid] += computed() - begun
        return result

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_call(self) -> Iterator[None]:
        """End a test that computes for too long or starts a program."""
        signal.signal(signal.SIGPROF, _end_test)
        signal.setitimer(signal.ITIMER_PROF, SLOW)
        self._in_test = True
        try:
            return (yield)
        finally:
            self._in_test = False
            signal.setitimer(signal.ITIMER_PROF, 0.0)

    def pytest_runtest_logreport(self, report: Any) -> None:
        """A test that fails is not asked."""
        if report.failed:
            self.seconds[report.nodeid] = float("inf")


def record(root: Path, modules: list[str], tests: list[str]) -> None:
    """Run tests under coverage in this process and print what was seen as JSON."""
    sys.path.insert(0, str(root))
    running = coverage.Coverage(
        data_file=None, include=[str(root / module) for module in modules]
    )
    recorder = Recorder(running)
    running.start()
    # Hypothesis' plugin fails where one of its tests is ended.
    without = [
        f"-pno:{name}" for name in ("cacheprovider", "xdist", "hypothesispytest")
    ]
    # A traceback of a test that is ended may lack a line, which pytest's own printing
    # does not expect.
    words = ["-q", "--tb=native", *without, "-m", "not slow"]
    status = pytest.main([*words, *tests], plugins=[recorder])
    running.stop()
    if status not in (pytest.ExitCode.OK, pytest.ExitCode.TESTS_FAILED):
        raise RuntimeError(status)
    data = running.get_data()
    found: dict[str, dict[int, list[str]]] = {}
    for module in modules:
        by_line = data.contexts_by_lineno(str(root / module))
        found[module] = {
            line: sorted(
                name for name in names if recorder.seconds.get(name, 99) < SLOW
            )
            for line, names in by_line.items()
        }
    print(json.dumps({"tests": found, "seconds": recorder.seconds}))


@dataclass(frozen=True)
class Asked:
    """Whose lines are to be mapped, and how.

    Args:
        root: Of the checkout.
        modules: Paths of the modules whose lines count.
        plain: Whether compiled functions run in Python, where coverage sees them.
    """

    root: Path
    modules: list[str]
    plain: bool

    def kept(self, folder: Path, file: str) -> Path:
        """Where the map of one file of tests is kept."""
        folders = sorted({str(Path(module).parent) for module in self.modules})
        words = json.dumps([file, self.plain, folders])
        digest = hashlib.sha256(words.encode() + (self.root / file).read_bytes())
        return folder / f"{digest.hexdigest()[:24]}.json"

    def sources(self, tests: dict[str, Any]) -> dict[str, str]:
        """Digests of the modules that some tests run: while they stay, the map does."""
        run = (self.root / name for name, lines in tests.items() if any(lines.values()))
        return {str(path.relative_to(self.root)): _digest(path) for path in run}

    def holds(self, place: Path) -> bool:
        """Whether a map is there that still holds."""
        if not place.exists():
            return False
        one = json.loads(place.read_text())
        return bool(one["sources"] == self.sources(one["tests"]))


def _digest(path: Path) -> str:
    """Of a file's content; "" where it is gone."""
    return hashlib.sha256(path.read_bytes()).hexdigest() if path.exists() else ""


def coverage_map(asked: Asked, tests: list[str], jobs: int, kept: Path) -> CoverageMap:
    """Run tests in processes of their own and note which lines each runs.

    Args:
        asked: What is mapped.
        tests: Files and folders of tests.
        jobs: Number of processes; each runs some of the files.
        kept: Folder of what earlier runs found; the files that changed run again.

    Raises:
        RuntimeError: If the tests could not be run.
    """
    places = {file: asked.kept(kept, file) for file in _test_files(asked.root, tests)}
    missing = [file for file, place in places.items() if not asked.holds(place)]
    with ThreadPoolExecutor(jobs) as pool:
        count = max(jobs, -(-len(missing) // AT_ONCE))
        parts = [missing[k::count] for k in range(count) if missing[k::count]]
        for part, seen in zip(
            parts, pool.map(lambda part: _seen(asked, part), parts), strict=True
        ):
            for file in part:
                one = _of_file(seen, file)
                one["sources"] = asked.sources(one["tests"])
                places[file].write_text(json.dumps(one))
    whole = CoverageMap({module: {} for module in asked.modules}, {})
    for place in places.values():
        one = json.loads(place.read_text())
        whole.seconds.update(one["seconds"])
        for module in whole.tests.keys() & one["tests"].keys():  # others are gone
            for line, names in one["tests"][module].items():
                whole.tests[module].setdefault(int(line), []).extend(names)
    return whole


def _test_files(root: Path, tests: list[str]) -> list[str]:
    paths = [p for name in tests for p in sorted((root / name).glob("test_*.py"))]
    paths += [root / name for name in tests if name.endswith(".py")]
    return [str(path.relative_to(root)) for path in paths]


def _of_file(seen: dict[str, Any], file: str) -> dict[str, Any]:
    """What was seen of the tests of one file."""
    begin = f"{file}::"
    seconds = {n: s for n, s in seen["seconds"].items() if n.startswith(begin)}
    tests = {
        module: {
            line: [n for n in names if n.startswith(begin)]
            for line, names in by_line.items()
        }
        for module, by_line in seen["tests"].items()
    }
    return {"seconds": seconds, "tests": tests}


def _seen(asked: Asked, files: list[str]) -> dict[str, Any]:
    """What `record` prints in a process of its own."""
    words = json.dumps({"modules": asked.modules, "tests": files})
    more = {"PYTHONPATH": str(asked.root)} | ({PLAIN: "1"} if asked.plain else {})
    ended = subprocess.run(
        [sys.executable, "-m", "analysis.mutation.coverage_map", words],
        cwd=asked.root, env=os.environ | more, capture_output=True, text=True,
        check=False,
    )  # fmt: skip
    if ended.returncode != 0:
        message = (
            f"the tests could not be run: {ended.stdout[-2000:]}{ended.stderr[-2000:]}"
        )
        raise RuntimeError(message)
    return dict(json.loads(ended.stdout.strip().splitlines()[-1]))


if __name__ == "__main__":
    words = json.loads(sys.argv[1])
    record(Path.cwd(), words["modules"], words["tests"])
