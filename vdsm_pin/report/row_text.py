"""Arrays to rows of a CSV file, fast enough for millions of them."""

from collections.abc import Sequence
from itertools import accumulate

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, frozen
from vdsm_pin.geometry.decimals import LONGEST, put_rows


class Form:
    """How the columns of a table are written.

    Args:
        decimals: Most decimals of each column, trailing zeros left out; `WORD` for a
            column that holds numbers of words.
        rounding: -1 downwards, 0 to the nearest, 1 upwards; by column.
        words: The words, as they shall stand in the file.
    """

    def __init__(
        self, decimals: Sequence[int], rounding: Sequence[int], words: Sequence[str]
    ) -> None:
        texts = [word.encode() for word in words]
        self._columns = frozen(decimals, np.int64), frozen(rounding, np.int64)
        self._words = frozen(bytearray(b"".join(texts)), np.uint8)
        self._ends = frozen([0, *accumulate(map(len, texts))], np.int64)
        longest = max(LONGEST, *(len(text) + 1 for text in (b"", *texts)))
        self._room = len(decimals) * longest

    def rows(self, table: FloatArray) -> memoryview:
        """The rows of a table as bytes, shape (n, n_columns)."""
        out = np.zeros(len(table) * self._room, dtype=np.uint8)
        rows = np.ascontiguousarray(table, dtype=np.float64)
        size = put_rows(rows, *self._columns, self._words, self._ends, out)
        return out[:size].data
