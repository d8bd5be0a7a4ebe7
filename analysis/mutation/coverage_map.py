"""Which tests run which lines, and how long each test takes."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import coverage

SLOW: Final = 6.0
"""Tests that take longer are ended, and not asked; [s]."""

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

    def asked(self, module: str, lines: tuple[int, ...], budget: float) -> list[str]:
        """The quickest tests of lines that take no more than a budget.

        Where no test runs any of the lines, all that run the module are asked: what
        runs at import has an effect anywhere.
        """
        by_line = self.tests.get(module, {})
        known = set().union(*(by_line.get(line, []) for line in lines))
        known = known or set().union(*by_line.values())
        chosen, total = [], 0.0
        for test in sorted(known, key=lambda name: (self.seconds[name], name)):
            total += self.seconds[test]
            if chosen and total > budget:
                break
            chosen.append(test)
        return chosen


def _end_test(*_: object) -> None:
    message = "is too slow to be asked"
    raise TimeoutError(message)


class Recorder:
    """A plugin of pytest: the test that runs is the context of what is covered."""

    def __init__(self, running: coverage.Coverage) -> None:
        self._running = running
        self.seconds: dict[str, float] = {}

    def pytest_runtest_logstart(self, nodeid: str) -> None:
        """A test begins."""
        self._running.switch_context(nodeid)
        self.seconds[nodeid] = 0.0
        signal.signal(signal.SIGPROF, _end_test)
        signal.setitimer(signal.ITIMER_PROF, SLOW)  # of this process's computing

    def pytest_runtest_logfinish(self) -> None:
        """A test ends."""
        signal.setitimer(signal.ITIMER_PROF, 0.0)

    def pytest_runtest_logreport(self, report: Any) -> None:
        """A part of a test is done."""
        self.seconds[report.nodeid] += report.duration
        if report.failed:
            self.seconds[report.nodeid] = float("inf")


def record(root: Path, modules: list[str], tests: list[str]) -> None:
    """Run tests under coverage in this process and print what was seen as JSON."""
    import pytest

    sys.path.insert(0, str(root))
    running = coverage.Coverage(
        data_file=None, include=[str(root / module) for module in modules]
    )
    recorder = Recorder(running)
    running.start()
    words = ["-q", "-p", "no:cacheprovider", "-p", "no:xdist", "-m", "not slow"]
    pytest.main([*words, *tests], plugins=[recorder])
    running.stop()
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


def coverage_map(
    root: Path, modules: list[str], tests: list[str], plain: bool
) -> CoverageMap:
    """Run tests in a process of their own and note which lines each runs.

    Args:
        root: Of the checkout.
        modules: Paths of the modules whose lines count.
        tests: Files and folders of tests.
        plain: Whether compiled functions run in Python, where coverage sees them.

    Raises:
        RuntimeError: If the tests could not be run.
    """
    words = json.dumps({"modules": modules, "tests": tests})
    environment = (
        os.environ | {"PYTHONPATH": str(root)} | ({PLAIN: "1"} if plain else {})
    )
    ended = subprocess.run(
        [sys.executable, "-m", "analysis.mutation.coverage_map", words],
        cwd=root, env=environment, capture_output=True, text=True, check=False,
    )  # fmt: skip
    lines = ended.stdout.strip().splitlines()
    if not lines or not lines[-1].startswith("{"):
        message = (
            f"the tests could not be run: {ended.stdout[-2000:]}{ended.stderr[-2000:]}"
        )
        raise RuntimeError(message)
    seen = json.loads(lines[-1])
    tests_of = {
        module: {int(line): names for line, names in by_line.items()}
        for module, by_line in seen["tests"].items()
    }
    return CoverageMap(tests_of, seen["seconds"])


if __name__ == "__main__":
    asked = json.loads(sys.argv[1])
    record(Path.cwd(), asked["modules"], asked["tests"])
