"""numba as it comes gives what our own way of keeping machine code gives."""

import os
import re
import subprocess
import sys
from pathlib import Path
from types import FunctionType

import numba
import pytest
from numba.core.compiler import Compiler

from vdsm_pin.compiled import choice, compiled, compiling
from vdsm_pin.compiled.digests import digest_of
from vdsm_pin.compiled.intrinsics import pipeline

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


@pytest.mark.skipif(numba.config.DISABLE_JIT, reason="nothing is compiled")
def test_what_is_not_to_be_copied_is_told_to_llvm_and_is_other_code() -> None:
    def double(value: float) -> float:
        return 2.0 * value

    told, digests = [], []
    for inline in (True, False):
        function = FunctionType(double.__code__, globals(), "double")
        compiled(function, inline=inline)
        made = numba.njit(pipeline_class=pipeline(function, Compiler))(function)
        assert made(1.5) == 3.0
        (text,) = made.inspect_llvm().values()
        own = re.search(r"define .*double.*?#(\d+)", text)
        group = re.search(rf"attributes #{own[1]} = {{(.*)}}", text) if own else None
        told.append("noinline" in (group[1] if group else ""))
        digests.append(digest_of(function))
    assert told == [False, True]
    assert digests[0] != digests[1]
