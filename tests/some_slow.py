"""Many cases, of which the fast tests run a few and `make test-slow` the others."""

from collections.abc import Sequence
from typing import Any

import pytest


def few_of(cases: int | Sequence[Any], few: int) -> list[Any]:
    """Values to parametrize with: the first few as they are, the others slow.

    Args:
        cases: Their values, or how many numbers from 0 on.
        few: How many are fast.
    """
    every = range(cases) if isinstance(cases, int) else cases
    slow = pytest.mark.slow
    return [
        *every[:few],
        *(
            pytest.param(*(one if isinstance(one, tuple) else (one,)), marks=slow)
            for one in every[few:]
        ),
    ]
