"""The docs site builds without a dead link, and what its pages show runs.

Blocks of a page run one after the other in one folder: `sh` by the shell, `python` in
one namespace, `yaml` is written to the file that its first line names.
"""

import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

import vdsm_pin
from vdsm_pin.planner.strategies import STRATEGIES

ROOT = Path(__file__).parents[2]
PAGES = sorted((ROOT / "docs").rglob("*.md"))
BLOCK = re.compile(r"^```(sh|python|yaml)\n(.*?)^```", re.DOTALL | re.MULTILINE)
NAMED = re.compile(r"# (\S+\.yaml)\n")
RUN_ELSEWHERE = {"files.md", "simulation.md"}
"""Their blocks are parts of files, which other tests read."""


def blocks(page: Path) -> list[tuple[str, str]]:
    return BLOCK.findall(page.read_text(encoding="utf-8"))


WITH_BLOCKS = [
    page for page in PAGES if blocks(page) and page.name not in RUN_ELSEWHERE
]


def run(kind: str, text: str, names: dict[str, Any], folder: Path) -> None:
    if kind == "yaml":
        named = NAMED.match(text)
        assert named, f"no file name in the first line of:\n{text}"
        (folder / named[1]).write_text(text, encoding="utf-8")
    elif kind == "python":
        exec(compile(text, "<page>", "exec"), names)
    else:
        programs = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
        environment = {**os.environ, "PATH": programs}
        ran = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", text],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
        )
        assert ran.returncode == 0, f"{text}\n{ran.stdout}\n{ran.stderr}"


@pytest.mark.pages
@pytest.mark.parametrize("page", WITH_BLOCKS, ids=lambda page: page.stem)
def test_what_a_page_shows_runs(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    names: dict[str, Any] = {}
    for kind, text in blocks(page):
        run(kind, text, names, tmp_path)


@pytest.mark.pages
def test_the_site_builds_and_every_link_leads_somewhere(tmp_path: Path) -> None:
    build = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", "-n"]
    ran = subprocess.run(
        [*build, "-c", str(ROOT / "docs"), str(ROOT), str(tmp_path / "site")],
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    pages = list((tmp_path / "site").rglob("*.html"))
    assert len(pages) > 25
    for page in pages:  # it works offline: what it fetches is a file beside it
        text = page.read_text(encoding="utf-8")
        fetched = re.findall(
            r"<(?:script|link|img)[^>]+(?:src|href)=\"([^\"?#]+)", text
        )
        lost = [one for one in fetched if not (page.parent / one).is_file()]
        assert not lost, page


def test_every_public_name_is_on_the_page_about_python() -> None:
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    shown = set(re.findall(r"auto\w+:: vdsm_pin\.(\w+)", page))
    assert shown == set(vdsm_pin.__all__)


def test_every_strategy_is_on_the_page_about_them() -> None:
    page = (ROOT / "docs" / "strategies.md").read_text(encoding="utf-8")
    assert re.findall(r"^\| `([\w-]+)`(?: \(default\))? \|", page, re.MULTILINE)[
        : len(STRATEGIES)
    ] == list(STRATEGIES)


def test_no_page_of_the_site_is_left_without_a_way_to_it() -> None:
    """Pages in docs/ stand in a toctree of the first page."""
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    named = {line.strip() for line in index.splitlines()}
    for page in PAGES:
        path = page.relative_to(ROOT / "docs").with_suffix("").as_posix()
        assert path == "index" or path in named, path


def test_every_script_and_module_that_a_page_runs_is_there() -> None:
    pages = [ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
    for folder in ("docs", "examples", "reports", "benchmarks"):
        pages += sorted((ROOT / folder).rglob("*.md"))
    named = set()
    for page in pages:
        text = page.read_text(encoding="utf-8")
        for module in re.findall(r"python -m ((?:benchmarks|analysis)[\w.]*\w)", text):
            named.add((page.name, module.replace(".", "/")))
        for script in re.findall(r"python ((?:analysis|examples)/[\w/]+)\.py", text):
            named.add((page.name, script))
    lost = [
        (page, name)
        for page, name in sorted(named)
        if not (ROOT / f"{name}.py").is_file()
        and not (ROOT / name / "__main__.py").is_file()
    ]
    assert len(named) > 15
    assert lost == []
