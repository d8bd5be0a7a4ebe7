"""Oracle: the words that the checks write, and what a reader may conclude from them."""

import math
from dataclasses import replace

import made_up
import pytest

from vdsm_pin.report.facts import failing, moment, reason
from vdsm_pin.verification.records import Check, Verdict


@pytest.mark.parametrize(
    ("where", "time"),
    [
        ("waypoint 193", 193.0),
        ("waypoint 573, theta5", 573.0),
        ("interval 193 at 0.2500, link 6 and pillar", 193.25),
        ("interval 7 at 1.0000, link 1 and link 3; 2 of 9 undecided", 8.0),
        ("interval 201", 201.0),
        ("", None),
        ("not run: broken", None),
    ],
)
def test_a_place_in_words_is_a_moment(where: str, time: float | None) -> None:
    assert moment(where) == time


def test_the_check_that_decides_comes_first() -> None:
    judged = made_up.verification()
    late = Check("late", Verdict.UNDECIDED, 1, 2.0, 1.0, "m", "waypoint 3")
    bad = Check("bad_one", Verdict.REFUTED, 1, 2.0, 1.0, "m", "interval 4 at 0.5000")
    judged = replace(judged, checks=(*judged.checks, late, bad))
    first, second = failing(judged)
    assert (first.name, first.verdict, first.time) == ("bad one", "refuted", 4.5)
    assert (second.name, second.time) == ("late", 3.0)
    assert failing(made_up.verification()) == ()


def test_a_check_without_evidence_is_not_said_to_have_a_value() -> None:
    nan = math.nan
    empty = Check("tip on the path", Verdict.UNDECIDED, 0, nan, 1e-6, "m")
    judged = replace(made_up.verification(), checks=(empty,))
    assert "tip on the path: there is nothing to judge it by" in reason(judged)
    assert "not available" not in reason(judged)
