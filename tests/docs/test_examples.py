"""Every example runs by itself, is short, and is told of in the list."""

import subprocess
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

ROOT = Path(__file__).parents[2]
FOLDER = ROOT / "examples"
NOTEBOOKS = sorted(FOLDER.rglob("*.ipynb"))
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
    for notebook in NOTEBOOKS:
        assert str(notebook.relative_to(FOLDER)) in listed, notebook
    for script in SCRIPTS:
        assert len(script.read_text(encoding="utf-8").splitlines()) <= 60, script
        assert str(script.relative_to(FOLDER)) in listed, script


def test_every_example_that_writes_a_report_has_its_picture() -> None:
    listed = (FOLDER / "README.md").read_text(encoding="utf-8")
    for script in SCRIPTS:
        if script.stem.startswith("test_"):
            continue
        picture = ROOT / "docs" / "gallery" / f"{script.stem}.jpg"
        assert picture.stat().st_size < 60_000
        assert f"../docs/gallery/{picture.name}" in listed, script


@pytest.mark.pages
@pytest.mark.parametrize("notebook", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_from_top_to_bottom(
    notebook: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("MPLBACKEND", "agg")
    content = nbformat.read(notebook, as_version=4)
    NotebookClient(content, resources={"metadata": {"path": tmp_path}}).execute()
    cells = [cell for cell in content.cells if cell.cell_type == "code"]
    assert all(cell.execution_count for cell in cells)
