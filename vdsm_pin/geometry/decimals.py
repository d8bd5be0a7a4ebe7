"""Numbers as decimals, compiled: the rows of the CSV tables that grow with a motion."""

from math import ceil, floor, isnan, log10
from typing import Final

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import ByteArray, FloatArray, IntArray

WORD: Final = -1
"""In place of a number of decimals: the column holds numbers of words."""

LONGEST: Final = 32
"""Most characters of one number with its comma."""

_EXACT: Final = 2.0**53  # beyond so many units a double no longer tells one from next
_ZERO, _COMMA, _NEWLINE, _MINUS, _POINT, _E = 48, 44, 10, 45, 46, 101
_INF: Final = (105, 110, 102)


@compiled
def _put_integer(value: int, out: ByteArray, at: int) -> int:
    """Digits of a number that is not negative; the place behind them."""
    count, rest = 1, value // 10
    while rest > 0:
        count, rest = count + 1, rest // 10
    for k in range(count - 1, -1, -1):
        out[at + k] = _ZERO + value % 10
        value //= 10
    return at + count


@compiled
def _put_units(scaled: float, unit: int, rounding: int, out: ByteArray, at: int) -> int:
    """A number of units, 1 / `unit` each, without trailing zeros; the place behind."""
    whole = floor(scaled + 0.5)
    if rounding < 0:
        whole = floor(scaled)
    elif rounding > 0:
        whole = ceil(scaled)
    if whole < 0:
        out[at] = _MINUS
        at, whole = at + 1, -whole
    at = _put_integer(whole // unit, out, at)
    rest = whole % unit
    if rest == 0:
        return at
    out[at] = _POINT
    at += 1
    while rest > 0:
        unit //= 10
        out[at] = _ZERO + rest // unit
        at, rest = at + 1, rest % unit
    return at


@compiled(inline=False)
def _put_number(
    value: float, decimals: int, rounding: int, out: ByteArray, at: int
) -> int:
    """Any number, large ones with an exponent, NaN as nothing; the place behind it."""
    if isnan(value):
        return at
    if abs(value) == float("inf"):
        if value < 0.0:
            out[at] = _MINUS
            at += 1
        for sign in _INF:
            out[at] = sign
            at += 1
        return at
    unit = 10**decimals
    if abs(value) * unit < _EXACT:
        return _put_units(value * unit, unit, rounding, out, at)
    power = floor(log10(abs(value)))
    at = _put_units(value / 10.0**power * 1e12, 10**12, rounding, out, at)
    out[at] = _E
    return _put_integer(power, out, at + 1)


@compiled
def put_rows(
    table: FloatArray,
    decimals: IntArray,
    rounding: IntArray,
    words: ByteArray,
    ends: IntArray,
    out: ByteArray,
) -> int:
    """Write rows of a table as CSV.

    Args:
        table: Numbers, or numbers of words, shape (n, m).
        decimals: Most decimals of each column, or `WORD`, shape (m,).
        rounding: -1 downwards, 0 to the nearest, 1 upwards, shape (m,).
        words: Bytes of all words in a row, uint8.
        ends: Where each word ends, after a leading 0.
        out: Result, uint8, with room for `LONGEST` a number and for the words.

    Returns:
        Number of bytes written.
    """
    at = 0
    for row in range(table.shape[0]):
        for column in range(table.shape[1]):
            if column > 0:
                out[at] = _COMMA
                at += 1
            value = table[row, column]
            if decimals[column] >= 0:
                at = _put_number(value, decimals[column], rounding[column], out, at)
                continue
            word = int(value)
            for k in range(ends[word], ends[word + 1]):
                out[at] = words[k]
                at += 1
        out[at] = _NEWLINE
        at += 1
    return at
