"""Versions, dependencies and recipes say what the package says."""

import json
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest
import yaml

import vdsm_pin
from vdsm_pin.io.problem_file import problem_schema
from vdsm_pin.report.files import schema

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))[
    "project"
]


def names(requirements: list[str]) -> set[str]:
    return {re.split(r"[^\w.-]", line)[0] for line in requirements}


@pytest.mark.parametrize("kind", ["problem", "certificate", "plan", "verification"])
def test_the_page_about_versions_tells_the_versions_there_are(kind: str) -> None:
    contract = problem_schema() if kind == "problem" else schema(kind)
    stated = re.search(rf'"vdsm_{kind}": {{"const": (\d+)', json.dumps(contract))
    page = (ROOT / "docs" / "formats.md").read_text(encoding="utf-8")
    (row,) = [line for line in page.splitlines() if f"`vdsm_{kind}`" in line]
    assert stated is not None
    assert row.split("|")[3].strip() == stated[1]


def test_every_dependency_is_on_the_page_with_its_use() -> None:
    page = (ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8")
    direct = re.sub(r"## What these bring along.*?(?=\n## )", "", page, flags=re.DOTALL)
    told = set(re.findall(r"^\| ([\w.-]+) \|", direct, re.MULTILINE)) - {"distribution"}
    extras = PROJECT["optional-dependencies"]
    needed = set(PROJECT["dependencies"])
    for extra in extras.keys() - {"dev", "docs"}:
        needed |= set(extras[extra])
    assert told == names(sorted(needed))


def test_the_recipe_asks_for_what_the_package_asks_for() -> None:
    recipe = yaml.safe_load((ROOT / "recipe" / "recipe.yaml").read_text())
    elsewhere = {"pinocchio": "pin", "meshcat-python": "meshcat"}
    asked = {elsewhere.get(x, x) for x in names(recipe["requirements"]["run"])}
    assert asked - {"python", "__linux"} == names(PROJECT["dependencies"])
    assert recipe["context"]["version"] == vdsm_pin.__version__


def test_the_citation_is_of_this_version() -> None:
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == vdsm_pin.__version__


def test_the_changelog_begins_with_this_version_or_what_comes() -> None:
    page = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    first = re.findall(r"^## \[(.*?)\]", page, re.MULTILINE)[0]
    assert first in ("Unreleased", vdsm_pin.__version__)


def test_the_number_on_the_first_screen_is_the_one_measured() -> None:
    report = (ROOT / "reports" / "foreign_plans.md").read_text(encoding="utf-8")
    (number,) = re.findall(r"^\*\*(.*)\*\*$", report, re.MULTILINE)
    shown = " ".join((ROOT / "README.md").read_text(encoding="utf-8").split())
    assert f"**{number}**" in shown[:1500]
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    assert index.startswith("```{include} ../README.md\n")


def test_the_python_of_the_readme_runs() -> None:
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE)
    ran = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert re.search(r"verdict +certified", ran.stdout)


def test_a_version_of_the_changelog_has_each_heading_once() -> None:
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    for version in changelog.split("\n## ")[1:]:
        headings = re.findall(r"^### .*", version, re.MULTILINE)
        assert len(set(headings)) == len(headings), version.splitlines()[0]
