"""What long work says while it lasts."""

import logging

import pytest

from vdsm_pin.progress import say, shown


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
