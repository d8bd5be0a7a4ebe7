"""Every example runs by itself, is short, and is told of in the list."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "examples"
SCRIPTS = sorted(FOLDER.rglob("*.py"))


@pytest.mark.pages
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_an_example_runs(script: Path, tmp_path: Path) -> None:
    tests = script.stem.startswith("test_")
    how = ["-m", "pytest", "-q", "-p", "no:cacheprovider"] if tests else []
    ran = subprocess.run(
        [sys.executable, *how, str(script)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, f"{ran.stdout}\n{ran.stderr}"
    assert tests or list(tmp_path.glob("*.html")) or list(tmp_path.glob("*_out"))


def test_examples_are_short_and_listed() -> None:
    listed = (FOLDER / "README.md").read_text(encoding="utf-8")
    for script in SCRIPTS:
        assert len(script.read_text(encoding="utf-8").splitlines()) <= 60, script
        assert str(script.relative_to(FOLDER)) in listed, script
