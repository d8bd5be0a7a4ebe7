"""Damaged files end in a status and one message, whatever they hold.

Commands run in processes of bounded memory and time. A traceback, a signal, a status
but 0, 1 or 2, or a sign that no terminal should see fails the test.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from test_outputs import PART, PROBLEM

from vdsm_pin.cli import main
from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.source import bounded_lines
from vdsm_pin.text import LONGEST, printable

WORKER = Path(__file__).parent / "fuzz_commands.py"


@pytest.fixture(scope="module")
def good(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A problem with a mesh, its motion and its certificate."""
    folder = tmp_path_factory.mktemp("good")
    (folder / "problem.yaml").write_text(PROBLEM)
    (folder / "part.stl").write_text(PART)
    problem, out = str(folder / "problem.yaml"), str(folder / "out")
    motion, proof = str(folder / "motion.csv"), str(folder / "proof")
    with pytest.raises(SystemExit):
        main(["plan", problem, "--out", out])
    (folder / "out" / "trajectory.csv").rename(motion)
    words = ["verify", problem, "--trajectory", motion, "--out", out]
    with pytest.raises(SystemExit) as ended:
        main([*words, "--certificate", proof])
    assert ended.value.code == 0
    return folder


def fuzz(folder: Path, seed: int, count: int, seconds: float) -> dict[str, int]:
    words = [sys.executable, str(WORKER), str(folder), str(seed), str(count)]
    ran = subprocess.run(
        words, check=False, capture_output=True, text=True, timeout=seconds
    )
    assert ran.returncode == 0, ran.stderr[-4000:]
    found: dict[str, int] = json.loads(ran.stdout)
    return found


def test_damaged_files_end_in_one_message(good: Path) -> None:
    found = fuzz(good, 1, 60, 600.0)
    assert sum(found.values()) == 60
    assert found["2"] > 4


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2, 22))
def test_thousands_of_damaged_files_end_in_one_message(good: Path, seed: int) -> None:
    assert sum(fuzz(good, seed, 1500, 3600.0).values()) == 1500


def test_the_fuzzer_notices_a_traceback(good: Path, tmp_path: Path) -> None:
    (tmp_path / "proof").write_text("")
    words = [sys.executable, str(WORKER), str(tmp_path), "1", "1"]
    ran = subprocess.run(
        words, check=False, capture_output=True, text=True, timeout=600
    )
    assert ran.returncode == 1
    assert "Traceback" in ran.stderr


def test_every_sign_can_be_seen() -> None:
    odd = "a\x1b[31m\n\ud800\u202e\x7f\u200b"
    assert printable(odd) == r"a\x1b[31m\n\ud800\u202e\x7f\u200b"
    assert printable("Größe 5 µm ✓") == "Größe 5 µm ✓"
    assert len(printable("x" * 10 * LONGEST)) < LONGEST + 100
    assert str(InvalidFile(file="a\x1b", fault="b\n")) == r"a\x1b: b\n"


def test_an_endless_line_is_not_read(tmp_path: Path) -> None:
    path = tmp_path / "lines"
    path.write_bytes(b"short\n" + b"x" * 100 + b"\n")
    lines = bounded_lines(path, limit=50)
    assert next(lines) == b"short\n"
    with pytest.raises(InvalidFile, match=r"line 2: is longer than"):
        next(lines)
