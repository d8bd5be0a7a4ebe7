"""What a command imports is what its user waits for."""

import subprocess
import sys
from pathlib import Path

import pytest

# Not pydantic: typer itself imports it where a command has parameters.
HEAVY = {"numba", "numpy", "pinocchio", "coal", "shapely", "trimesh", "rich"}
PROGRAM = """
import sys
from vdsm_pin.cli import main
try:
    main(sys.argv[1:])
except SystemExit:
    pass
sys.stderr.write(" ".join(sys.modules))
"""


def run(*words: str) -> subprocess.CompletedProcess[str]:
    program = [sys.executable, "-c", PROGRAM, *words]
    return subprocess.run(program, capture_output=True, text=True, check=True)


def imported(ended: subprocess.CompletedProcess[str]) -> set[str]:
    return set(ended.stderr.split())


@pytest.mark.parametrize("command", [["--help"], ["plan", "--help"]])
def test_help_imports_nothing_heavy(command: list[str]) -> None:
    ended = run(*command)
    assert "Usage" in ended.stdout
    assert not HEAVY & imported(ended)


def test_a_plan_is_made_without_numba_once_its_machine_code_is_there(
    tmp_path: Path,
) -> None:
    command = ("plan", "paper/free", "--strategy", "paper", "--out", str(tmp_path))
    run(*command)
    assert "numba" not in imported(run(*command))
    assert (tmp_path / "trajectory.csv").exists()
