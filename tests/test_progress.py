"""What long work says while it lasts."""

import io
import logging
import time

import pytest
from made_up import trajectory

from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.progress import say, shown, step, watched
from vdsm_pin.verification.asked_motion import AskedMotion


def test_what_is_said_is_shown_once_each_with_its_time(
    capsys: pytest.CaptureFixture[str],
) -> None:
    say("before")
    with shown(quiet=0.0):
        say("%d of %s", 3, "7 mm")
        say("%d of %s", 3, "7 mm")
        say("more")
    say("after")
    said = capsys.readouterr()
    assert said.out == ""
    assert [line.split(" s  ")[1] for line in said.err.splitlines()] == [
        "3 of 7 mm",
        "more",
    ]


def test_what_is_soon_done_says_nothing(capsys: pytest.CaptureFixture[str]) -> None:
    with shown(quiet=1e3):
        say("soon")
    assert capsys.readouterr().err == ""
    assert not logging.getLogger("vdsm_pin.progress").handlers


class Terminal(io.StringIO):
    """A stderr that somebody looks at."""

    def isatty(self) -> bool:
        return True


def look_at(monkeypatch: pytest.MonkeyPatch) -> Terminal:
    """Make stderr a terminal; not in a fixture, after which pytest takes it again."""
    looked_at = Terminal()
    monkeypatch.setattr("sys.stderr", looked_at)
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setenv("COLUMNS", "100")
    return looked_at


def wait_for(words: str, terminal: Terminal) -> None:
    for _ in range(500):
        if words in terminal.getvalue():
            return
        time.sleep(0.02)
    pytest.fail(f"{words!r} is not in {terminal.getvalue()!r}")


def test_a_terminal_shows_a_bar_of_what_is_watched(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    terminal = look_at(monkeypatch)
    done = [0.0]
    with shown(quiet=0.0), watched(lambda: done[0]):
        step("proving %d pairs", 29)
        wait_for("proving 29 pairs", terminal)
        wait_for(" 0%", terminal)
        for percent in (25, 50):
            done[0] = percent / 100
            wait_for(f"{percent}%", terminal)
        say("more")
        wait_for("more", terminal)
    assert not logging.getLogger("vdsm_pin.progress").handlers
    assert not logging.getLogger("vdsm_pin.progress").isEnabledFor(logging.INFO)


def test_a_bar_of_the_time_where_nothing_is_watched(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    terminal = look_at(monkeypatch)
    with shown(quiet=0.0, limit=1e6):
        wait_for(" 0%", terminal)


def test_no_bar_for_what_is_soon_done_or_not_looked_at(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    terminal = look_at(monkeypatch)
    with shown(quiet=1e3):
        say("soon")
    monkeypatch.setattr(terminal, "isatty", lambda: False)
    with shown(quiet=0.0, lines=False), watched(lambda: 0.5):
        say("unheard")
    assert terminal.getvalue() == ""


def test_the_share_of_a_proof_grows_to_all_and_counts_what_is_far() -> None:
    problem = read_problem("paper/obs2")
    proving = AskedMotion.of_arm(problem, trajectory(), ErrorBox()).proving()
    assert proving.share == 0.0
    proving.sweep(0, 64)
    assert 0.0 < proving.share < 1.0
    proving.sweep(64, proving.n_intervals)
    assert proving.share == 1.0
