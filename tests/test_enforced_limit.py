"""What does not ask the clock is interrupted a little after the time limit."""

import importlib
import signal
import sys
import threading
import time
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

import vdsm_pin.io.problem_file as problem_file
from vdsm_pin.app import subjects
from vdsm_pin.cli import app
from vdsm_pin.errors import OutOfTime
from vdsm_pin.time_limit import GRACE, NO_LIMIT, Deadline, enforced

OVER = Deadline(2.0, 0.0)
"""A limit of two seconds that was over when the machine started."""


def for_ever(*_: object) -> None:
    while True:
        pass


def test_a_loop_that_never_asks_is_interrupted_and_nothing_is_left_behind() -> None:
    before = signal.getsignal(signal.SIGALRM)
    with pytest.raises(OutOfTime, match="the time limit of 2 s came first"):
        with enforced(OVER):
            for_ever()
    assert signal.getsignal(signal.SIGALRM) is before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_a_library_is_imported_whole_before_the_end_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """One that is imported by halves may not be imported again."""
    slow = "import time\nend = time.monotonic() + 0.3\n"
    slow += "while time.monotonic() < end:\n    pass\nwhole = True\n"
    (tmp_path / "slow_to_import.py").write_text(slow)
    monkeypatch.syspath_prepend(tmp_path)
    begun = time.monotonic()
    soon = Deadline(2.0, begun - GRACE + 0.1)
    with pytest.raises(OutOfTime), enforced(soon):
        importlib.import_module("slow_to_import")
        for_ever()
    assert sys.modules.pop("slow_to_import").whole
    assert 0.3 <= time.monotonic() - begun < 5.0


def test_a_program_that_is_imported_is_interrupted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The import that a limit stands in is not one that it waits for."""
    program = """
import time
from vdsm_pin.errors import OutOfTime
from vdsm_pin.time_limit import GRACE, Deadline, enforced
end, told = time.monotonic() + 2.0, False
try:
    with enforced(Deadline(2.0, time.monotonic() - GRACE + 0.1)):
        while time.monotonic() < end:
            pass
except OutOfTime:
    told = True
"""
    (tmp_path / "limited_program.py").write_text(program)
    monkeypatch.syspath_prepend(tmp_path)
    assert importlib.import_module("limited_program").told
    del sys.modules["limited_program"]


def test_who_takes_it_for_a_failure_is_interrupted_again() -> None:
    heard = []
    soon = Deadline(2.0, time.monotonic() - GRACE + 0.5)
    with pytest.raises(OutOfTime):
        with enforced(soon):
            try:
                for_ever()
            except OutOfTime as error:
                heard.append(error)
            for_ever()
    assert len(heard) == 1


def test_a_library_that_tells_it_as_an_error_of_its_own_is_not_believed() -> None:
    with pytest.raises(OutOfTime, match="the time limit of 2 s came first"):
        with enforced(OVER):
            try:
                for_ever()
            except OutOfTime as error:
                message = f"Error building a serializer: {error}"
                raise RuntimeError(message) from error
    with pytest.raises(RuntimeError, match="an error before"), enforced(NO_LIMIT):
        message = "an error before"
        raise RuntimeError(message)
    with pytest.raises(RuntimeError), enforced(Deadline.after(1e6)):
        raise RuntimeError


def test_work_that_ends_in_time_is_left_alone() -> None:
    before = signal.getsignal(signal.SIGALRM)
    with enforced(Deadline.after(1e6)):
        left, again = signal.getitimer(signal.ITIMER_REAL)
        assert 1e6 - 60.0 < left <= 1e6 + GRACE
        assert again > 0.0
    assert signal.getsignal(signal.SIGALRM) is before
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_without_a_limit_there_is_no_alarm() -> None:
    with enforced(NO_LIMIT):
        assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_threads_are_left_to_ask() -> None:
    said = []

    def run() -> None:
        with enforced(OVER):
            said.append(signal.getitimer(signal.ITIMER_REAL))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert said == [(0.0, 0.0)]


def test_work_that_heard_has_its_grace() -> None:
    ended = Deadline(1.0, time.monotonic() - 0.5 * GRACE)
    with enforced(ended):
        assert ended.passed
        assert 0.0 < signal.getitimer(signal.ITIMER_REAL)[0] <= 0.5 * GRACE


def test_work_that_has_nothing_to_write_has_no_grace() -> None:
    ends = time.monotonic() + 60.0
    with enforced(Deadline(60.0, ends), grace=0.0):
        assert signal.getitimer(signal.ITIMER_REAL)[0] <= 60.0
    with pytest.raises(OutOfTime), enforced(OVER, grace=0.0):
        for_ever()


@pytest.mark.parametrize("command", ["plan", "verify"])
def test_a_command_that_hangs_in_reading_ends_with_one_word(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for module in (problem_file, subjects):
        monkeypatch.setattr(module, "read_document", for_ever)
    words = [command, "paper/obs1", "--out", str(tmp_path / "out")]
    rows = [] if command == "plan" else ["--trajectory", str(tmp_path / "none.csv")]
    found = CliRunner().invoke(app, [*words, *rows, "--time-limit", "0.1"])
    assert isinstance(found.exception, OutOfTime)
    assert "the time limit of 0.1 s came first" in str(found.exception)
    assert "no_plan.html" not in str(found.exception), "there was no time for it"
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("cold", [True, False])
@pytest.mark.parametrize("asked", [None, "600"])
def test_only_the_default_of_a_cold_machine_counts_as_a_first_plan(
    cold: bool, asked: str | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A plan that ran out of a limit of the user's own, also of 600 s, does not."""
    noted, limits = [], []

    def slow(*more: Any, **_: object) -> None:
        limits.append(more[-1].limit)
        raise OutOfTime(limits[-1], "searched")

    monkeypatch.setattr("vdsm_pin.app.workflow.plan_to_folder", slow)
    monkeypatch.setattr("vdsm_pin.app.first_plan.is_cold", lambda: cold)
    monkeypatch.setattr("vdsm_pin.app.first_plan.note_planned", lambda: noted.append(1))
    words = [] if asked is None else ["--time-limit", asked]
    out = ["--out", str(tmp_path / "out")]
    CliRunner().invoke(app, ["plan", "paper/free", *out, *words])
    assert limits == [600.0 if cold or asked else 60.0]
    assert len(noted) == (cold and asked is None)
