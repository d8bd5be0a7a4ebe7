"""Oracle: the text a person expects."""

import math
from fractions import Fraction

import numpy as np
import pytest

from vdsm_pin.report.words import (
    OUTCOMES,
    at_least,
    at_most,
    lost,
    outcome,
    place,
    survived,
)
from vdsm_pin.units import (
    MISSING,
    measured_at_most,
    percent,
    percent_at_most,
    quantity,
    signed,
)


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (0.0035, "m", "3.500 mm"),
        (-0.0984, "m", "−98.400 mm"),
        (math.radians(42.5), "rad", "42.500°"),
        (2e-14, "m", "2.0e-11 mm"),
        (-2e-14, "rad", "−1.1e-12°"),
        (0.0, "m", "0.000 mm"),
        (24.0, "-", "24"),
        (1.5, "-", "1.500"),
        (math.inf, "m", "+∞ mm"),
        (-math.inf, "m", "−∞ mm"),
        (math.nan, "m", "not available"),
        (None, "rad", "not available"),
        (3.0, "s", "3.000 s"),
        (0.873, "share", "87.3 %"),
    ],
)
def test_quantities_read_as_people_write_them(
    value: float | None, unit: str, text: str
) -> None:
    assert quantity(value, unit) == text


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("-1.5", "−1.5"),
        ("-0.000", "0.000"),
        ("0", "0"),
        ("12.0", "12.0"),
        ("-10", "−10"),
        ("1e-05", "1e-05"),
        ("-2.0e-11", "−2.0e-11"),
    ],
)
def test_a_number_has_a_minus_sign_and_zero_has_none(text: str, shown: str) -> None:
    assert signed(text) == shown


@pytest.mark.parametrize(
    ("share", "text"),
    [
        (1.0, "100.0 %"),
        (0.99999, "99.9 %"),
        (1.0 - 1e-15, "100.0 %"),
        (0.873, "87.3 %"),
        (0.0, "0.0 %"),
        (math.nan, "not available"),
        (None, "not available"),
    ],
)
def test_percent_never_rounds_up_to_complete(share: float | None, text: str) -> None:
    assert percent(share) == text


def test_a_share_of_what_is_bad_never_rounds_down_to_nothing() -> None:
    told = [percent_at_most(share) for share in (0.0, 1e-15, 4e-5, 0.125, 0.1251)]
    assert told == ["0.0 %", "0.0 %", "0.1 %", "12.5 %", "12.6 %"]


@pytest.mark.parametrize(
    ("moment", "where", "text"),
    [
        (193.0, "", "waypoint 193"),
        (190.0, "theta5", "waypoint 190, theta5"),
        (193.25, "link 6 and pillar", "waypoint 193.25, link 6 and pillar"),
        (7.5, "", "waypoint 7.5"),
        (0.0, "", "waypoint 0"),
        (12.999, "", "waypoint 13"),
        (None, "not run: broken", "not run: broken"),
        (None, "", ""),
    ],
)
def test_a_place_is_when_and_where(moment: float | None, where: str, text: str) -> None:
    assert place(moment, where) == text


def test_only_certified_counts_as_passed() -> None:
    assert [word for word, known in OUTCOMES.items() if known.passed] == ["certified"]
    assert not outcome("splendid").passed
    marks = [known.mark for known in OUTCOMES.values()]
    assert len(set(marks)) == len(marks), (
        "marks must tell outcomes apart without colour"
    )


def test_joint_errors_are_rounded_to_the_safe_side_and_told_apart() -> None:
    error, more = math.radians(0.052978), math.radians(0.053407)
    assert (survived(error), lost(more)) == ("±0.0529°", "±0.0535°")
    assert survived(math.radians(0.13169)) == "±0.1316°"
    assert (survived(0.0), lost(0.0)) == ("none", "±0.0000°")
    assert (survived(None), lost(math.nan)) == (MISSING, MISSING)


def test_what_is_proved_is_never_rounded_up() -> None:
    """Oracle: exact fractions of what the texts say."""
    rng = np.random.default_rng(0)
    sizes = 10.0 ** rng.uniform(-9.0, 2.0, 3000) * rng.choice([-1.0, 1.0], 3000)
    noise = Fraction(1, 10**12)  # [m]: of 5.0 mm that rounding left a little less
    for value in [*sizes.tolist(), 5e-3, 0.105, 1.2345, 0.0, 1.0]:
        texts = at_least(value), at_most(value)
        low, high = (
            Fraction(text.removesuffix(" mm").replace("\u2212", "-")) / 1000
            for text in texts
        )
        last = Fraction(1, 10**4 if abs(value) >= 1.0 else 10**6)
        assert low - noise <= Fraction(value) <= high + noise
        assert high - low <= last + noise
    assert at_least(5e-3) == at_most(5e-3) == quantity(5e-3, "m") == "5.000 mm"
    assert at_least(0.10600089937594809) == "106.000 mm"
    assert at_least(1.23456) == "1234.5 mm"


def test_no_error_is_told_smaller_than_it_was() -> None:
    told = [measured_at_most(value, "m") for value in (0.0, 1e-12, 9e-7, 0.00123401)]
    assert told == ["0.000 mm", "0.001 mm", "0.001 mm", "1.235 mm"]
