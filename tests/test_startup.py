"""What a command imports is what its user waits for."""

import subprocess
import sys

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
sys.stderr.write(" ".join({name.split(".")[0] for name in sys.modules}))
"""


@pytest.mark.parametrize("command", [["--help"], ["plan", "--help"]])
def test_help_imports_nothing_heavy(command: list[str]) -> None:
    words = [sys.executable, "-c", PROGRAM, *command]
    ended = subprocess.run(words, capture_output=True, text=True, check=True)
    assert "Usage" in ended.stdout
    assert not HEAVY & set(ended.stderr.split())
