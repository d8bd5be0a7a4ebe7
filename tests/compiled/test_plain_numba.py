"""numba as it comes gives what our own way of keeping machine code gives."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from vdsm_pin.compiled import choice, compiling

PROGRAM = """
import time
from typing import NamedTuple
import numpy as np
from vdsm_pin.compiled import borrowed, clock, compiled
from vdsm_pin.compiled.choice import compiler
from vdsm_pin.geometry.row_bounds import _crossing_gap

class Two(NamedTuple):
    values: np.ndarray
    scale: float

@compiled(inline=False)
def _scaled(two):
    return two.scale * two.values[0] / 3.0

@compiled
def scaled(two):
    return _scaled(borrowed(two)), clock()

rng = np.random.default_rng(1)
for _ in range(20):
    ends = rng.normal(size=(4, 3))
    print(_crossing_gap(*ends))
    value, now = scaled(Two(ends[0], 0.7))
    print(value, abs(now - time.monotonic()) < 10.0)
print(compiler() is None)
"""


def answers(folder: Path, plain: str) -> list[str]:
    folder.mkdir()
    (folder / "program.py").write_text(PROGRAM, encoding="utf-8")
    words = [sys.executable, str(folder / "program.py")]
    setting = {"VDSM_PLAIN_NUMBA": plain, "NUMBA_CACHE_DIR": str(folder)}
    run = subprocess.run(
        words, env=os.environ | setting, capture_output=True, text=True, check=True
    )
    return run.stdout.splitlines()


def test_both_ways_give_the_same_numbers(tmp_path: Path) -> None:
    *ours, kept_here = answers(tmp_path / "ours", "0")
    *plain, as_it_comes = answers(tmp_path / "plain", "1")
    assert ours == plain
    assert (kept_here, as_it_comes) == ("False", "True")
    assert len(list((tmp_path / "plain").rglob("*.nbi"))) > 1


def test_numba_that_lacks_something_is_used_as_it_comes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def lacking() -> bool:
        message = "cannot import name 'JITCodeLibrary'"
        raise ImportError(message)

    try:
        for tried in (lacking, lambda: False):
            monkeypatch.setattr(compiling, "tried", tried)
            choice.compiler.cache_clear()
            assert choice.compiler() is None
    finally:
        monkeypatch.undo()
        choice.compiler.cache_clear()
    assert choice.compiler() is compiling
