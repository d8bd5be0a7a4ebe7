"""Oracle: the imports themselves, read from the source, against pyproject.toml."""

import ast
import re
import sys
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.metadata import (
    PackageNotFoundError,
    packages_distributions,
    requires,
)
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("vdsm_pin", "tests", "analysis", "benchmarks")
STATEMENTS = (ast.stmt, ast.ExceptHandler, ast.match_case)
COMES_WITH = {
    "pinocchio": "pin",
    "pink": "pin-pink",
    "pydantic-core": "pydantic",
    "markupsafe": "jinja2",
}
"""What a declared library brings under another name."""


def plain(name: str) -> str:
    """A distribution's name as registries compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def declared(*extras: str) -> set[str]:
    """What pyproject.toml asks for, with extras."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    wanted = list(project["dependencies"])
    for extra in extras:
        wanted += project["optional-dependencies"][extra]
    return {plain(re.split(r"[<>=\[; ]", line)[0]) for line in wanted}


@cache
def imported(folder: str) -> frozenset[str]:
    """Top names a folder imports, also by importorskip."""
    names = set()
    for path in (ROOT / folder).rglob("*.py"):
        text = path.read_text(encoding="utf-8")
        names |= set(re.findall(r'importorskip\(\s*"([\w.]+)"', text))
        blocks: list[ast.AST] = [ast.parse(text)]
        while blocks:
            node = blocks.pop()
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
                names.add(node.module)
            inside = ast.iter_child_nodes(node)
            blocks += [one for one in inside if isinstance(one, STATEMENTS)]
    return frozenset(name.split(".")[0] for name in names)


@cache
def providers_of() -> Mapping[str, list[str]]:
    """Which installed packages bring a top name."""
    return packages_distributions()


@cache
def ours() -> set[str]:
    """Modules and packages that this repository holds."""
    paths = [path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")]
    return {path.stem for path in paths} | {path.parent.name for path in paths}


@pytest.mark.parametrize(
    ("folder", "extras"),
    [
        ("vdsm_pin", ("cluster", "parquet", "simulation", "xacro", "bags")),
        ("tests", ("dev", "docs")),
        ("analysis", ("dev",)),
        ("benchmarks", ("dev", "references")),
    ],
)
def test_every_library_imported_is_declared(
    folder: str, extras: tuple[str, ...]
) -> None:
    providers = providers_of()
    known = declared(*extras)
    foreign = imported(folder) - set(sys.stdlib_module_names) - ours()
    assert "numpy" in foreign
    for name in sorted(foreign):
        made_by = {plain(one) for one in providers.get(name, [name])}
        made_by |= {COMES_WITH[one] for one in made_by if one in COMES_WITH}
        assert made_by & known, f"{folder} imports {name}, of {sorted(made_by)}"


def test_the_scan_sees_what_is_not_declared() -> None:
    assert "lxml" in imported("tests")
    assert "lxml" not in declared()
    assert "playwright" in imported("tests")


def test_the_page_lists_what_is_brought_along() -> None:
    """Oracle: requirements that the installed distributions state, followed by hand."""
    page = (ROOT / "docs" / "dependencies.md").read_text("utf-8").split("## cluster")[0]
    rows = [line for line in page.splitlines() if line.startswith("| ")]
    listed = {plain(line.split("|")[1].strip()) for line in rows}
    assert declared() <= listed
    for name in listed - {"distribution"}:
        try:
            lines = requires(name) or []
        except PackageNotFoundError:  # of another system or Python
            continue
        for line in lines:
            if ";" not in line:
                assert plain(re.split(r"[<>=!~\[( ;]", line)[0]) in listed, line
