"""Oracle: the words that the checks write, and what a reader may conclude from them."""

import math
from dataclasses import replace

import made_up

from vdsm_pin.report.reason import failing, reason
from vdsm_pin.verification.records import Check, CheckKind, Verdict


def test_the_check_that_decides_comes_first() -> None:
    judged = made_up.verification()
    late = Check("late", Verdict.UNDECIDED, 1, 2.0, 1.0, "m", moment=3.0)
    bad = Check("bad_one", Verdict.REFUTED, 1, 2.0, 1.0, "m", moment=4.5)
    judged = replace(judged, checks=(*judged.checks, late, bad))
    first, second = failing(judged)
    assert (first.name, first.verdict, first.moment) == ("bad_one", "refuted", 4.5)
    assert (second.name, second.moment) == ("late", 3.0)
    assert failing(made_up.verification()) == ()


def test_a_check_without_evidence_is_not_said_to_have_a_value() -> None:
    for name, worst in (
        ("tip on the path", math.nan),
        (CheckKind.OBSTACLES, -math.inf),
    ):
        empty = Check(name, Verdict.UNDECIDED, 0, worst, 1e-6, "m")
        told = reason(replace(made_up.verification(), checks=(empty,)))
        assert f'there is no evidence for "{name}"' in told
        assert "not available" not in told and "∞" not in told
