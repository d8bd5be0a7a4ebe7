"""Rows of evidence and what is said of them: by hand."""

from math import inf, nan
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vdsm_pin.geometry.winding import Location, Side
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.inside import LINKS_OUTSIDE, Place, check_inside
from vdsm_pin.verification.records import (
    Check,
    Pair,
    Verdict,
    _place,
    is_deepest,
)


@pytest.mark.parametrize(
    ("moment", "where", "words"),
    [
        (nan, "", ""),
        (2.25, "", ", at waypoint 2.25"),
        (0.0, "", ", at waypoint 0"),
        (nan, "link 3", ", link 3"),
        (1234567.0, "link 3 and a", ", at waypoint 1.23457e+06, link 3 and a"),
    ],
)
def test_the_place_of_a_worst_case_in_words(
    moment: float, where: str, words: str
) -> None:
    row = Check("n", Verdict.REFUTED, 1, 0.0, 0.0, "m", where=where, moment=moment)
    assert _place(row) == words


def test_no_depth_beyond_the_radius_is_measured() -> None:
    limit = TOLERANCES.bracket_gap - 0.05
    for clearance in (limit, -0.05, -9.0):
        assert is_deepest(clearance, 0.05)
    for clearance in (limit + 1e-12, 0.0, 0.05, nan, inf, -inf):
        assert not is_deepest(clearance, 0.05)


OUTSIDE, INSIDE = Location(Side.OUTSIDE), Location(Side.INSIDE)
UNKNOWN = Location(Side.UNKNOWN, "it has a hole")


@pytest.mark.parametrize(
    ("sides", "verdict", "bad"),
    [
        ({"a": OUTSIDE, "b": OUTSIDE}, Verdict.CERTIFIED, ""),
        ({"a": OUTSIDE, "b": UNKNOWN, "c": UNKNOWN}, Verdict.UNDECIDED, "bc"),
        ({"a": UNKNOWN, "b": INSIDE, "c": OUTSIDE}, Verdict.REFUTED, "b"),
        ({"a": INSIDE, "b": INSIDE}, Verdict.REFUTED, "ab"),
    ],
)
def test_the_row_of_meshes_counts_those_that_decide_it(
    sides: dict[str, Location], verdict: Verdict, bad: str
) -> None:
    """Of the first moment, where the arm is outside of them all or is not."""
    asked: Any = SimpleNamespace(chain=0, pair=lambda k: Pair(1, [*sides][k]))
    places = {k: Place(one, np.zeros(3)) for k, one in enumerate(sides.values())}
    (row,) = check_inside(asked, places)
    assert (row.name, row.verdict, row.count) == (LINKS_OUTSIDE, verdict, len(sides))
    assert (row.worst, row.limit, row.unit) == (float(len(bad)), 0.0, "-")
    assert row.where == "; ".join(sides[name].words(name) for name in bad)
    assert [row.moment] == pytest.approx([0.0 if bad else nan], nan_ok=True)
    assert check_inside(asked, {}) == ()
