"""Oracle: exact decimals of the standard library, and its own rounding."""

from decimal import Decimal

import numpy as np
import pytest

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.decimals import WORD
from vdsm_pin.report.tables import Form


def written(values: FloatArray, decimals: int, rounding: int) -> list[str]:
    text = bytes(Form([decimals], [rounding], ()).rows(values[:, None])).decode()
    assert text.endswith("\n")
    return text.splitlines()


def numbers(rng: np.random.Generator) -> FloatArray:
    """Of every size, on and beside multiples of the units, and nothing."""
    sizes = rng.normal(size=2000) * 10.0 ** rng.uniform(-14, 3, 2000)
    on = rng.integers(-(10**7), 10**7, 500) * 1e-6
    beside = np.nextafter(on, rng.choice([-np.inf, np.inf], 500))
    return np.concatenate([sizes, on, beside, [0.0, -0.0, 1e-30, -1e-30, 0.5, -1.0]])


@pytest.mark.parametrize("decimals", [0, 6, 9, 12])
def test_numbers_are_rounded_where_they_are_meant_to(decimals: int) -> None:
    values, unit = numbers(np.random.default_rng(decimals)), Decimal(10) ** -decimals
    for rounding in (-1, 0, 1):
        for value, text in zip(
            values, written(values, decimals, rounding), strict=True
        ):
            off = Decimal(text) - Decimal(value)
            # The product with the units is itself rounded once.
            ulp = abs(Decimal(value)) * Decimal(2) ** -52
            if rounding == 0:
                assert abs(off) <= unit / 2 + ulp
            else:
                assert -ulp <= off * rounding <= unit + ulp
            assert "." not in text or not text.endswith(("0", "."))
            assert text != "-0"
            assert set(text) <= set("-0123456789.")


def test_most_numbers_read_as_python_writes_them() -> None:
    values = np.random.default_rng(1).normal(size=3000)
    expected = [f"{value:.6f}".rstrip("0").rstrip(".") for value in values]
    assert written(values, 6, 0) == expected


def test_very_large_numbers_keep_twelve_digits_and_none_is_hidden() -> None:
    values = np.array([9.1e15, -3.7e22, 1.0e300, 1.7976931348623157e308, 2.0**53])
    for decimals in (0, 9):
        for value, text in zip(values, written(values, decimals, 0), strict=True):
            assert float(text) == pytest.approx(value, rel=1e-11)
            assert len(text) < 32
    assert written(np.array([np.nan, np.inf, -np.inf]), 9, 1) == ["", "inf", "-inf"]


def test_words_stand_between_numbers() -> None:
    words = ("certified", '"a, ""b"""', "äö,")
    form = Form([0, WORD, 3, WORD], [0] * 4, words)
    text = bytes(form.rows(np.array([[7.0, 1, 0.25, 0], [8.0, 2, -1.0, 1]])))
    assert text.decode() == '7,"a, ""b""",0.25,certified\n8,äö,,-1,"a, ""b"""\n'
    assert bytes(form.rows(np.zeros((0, 4)))) == b""


def test_the_longest_rows_fit() -> None:
    longest = -np.pi * 10.0 ** np.arange(0.0, 308.0)
    form = Form([12] * longest.size, [0] * longest.size, ())
    (line,) = bytes(form.rows(longest[None])).splitlines()
    np.testing.assert_allclose(
        [float(word) for word in line.split(b",")], longest, rtol=1e-11
    )
