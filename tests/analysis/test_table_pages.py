"""Each committed page of tables is what its script makes of the committed numbers."""

import importlib
import json
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("matplotlib")
ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "analysis"))

Rows = list[dict[str, Any]]


def closed_loop(script: Any, rows: Rows) -> str:
    swept = [row for row in rows if "assumption" in row]
    return str(script.markdown([row for row in rows if row not in swept], swept))


def baselines(script: Any, rows: Rows) -> str:
    lines = [script.Line(**row) for row in rows]
    own = [line for line in lines if line.scene in script.SCENES]
    rest = [line for line in lines if line.scene not in script.SCENES]
    return str(script.markdown(own, rest))


def step5_choices(script: Any, rows: Rows) -> str:
    literals = [script.Literal(**row) for row in rows if "line" not in row]
    singles = [script.OneLine(**row) for row in rows if "line" in row]
    return str(script.markdown(literals, singles))


def plain(name: str) -> Callable[[Any, Rows], str]:
    def made(script: Any, rows: Rows) -> str:
        return str(script.markdown([getattr(script, name)(**row) for row in rows]))

    return made


PAGES = {
    "baselines": ("baselines", baselines),
    "closed_loop": ("closed_loop", closed_loop),
    "moving_obstacle": ("moving_obstacle", plain("Line")),
    "obs2_orientations": ("obs2_orientations", plain("Row")),
    "step5_choices": ("step5_choices", step5_choices),
    "table": ("paper_table", plain("Row")),
}
"""The script of each page, and how it makes the page of the rows."""


@pytest.mark.parametrize("page", sorted(PAGES))
def test_a_page_is_what_its_script_makes_of_its_numbers(page: str) -> None:
    name, made = PAGES[page]
    file = ROOT / "reports/paper" / f"{page}.json"
    text = made(importlib.import_module(name), json.loads(file.read_text("utf-8")))
    assert file.with_suffix(".md").read_text("utf-8") == text


def test_every_method_ran_on_the_same_problems_without_a_failure() -> None:
    """The slow ones may have ended with a part of the others' problems."""
    file = ROOT / "reports/paper/baselines.json"
    rows = json.loads(file.read_text("utf-8"))
    assert not [row for row in rows if row["answer"] == "error"]
    script = importlib.import_module("baselines")
    scenes: dict[str, set[str]] = {name: set() for name in script.METHODS}
    for row in rows:
        assert row["scene"] not in scenes[row["method"]], "asked once"
        scenes[row["method"]].add(row["scene"])
    some = {name: scenes.pop(name) for name in script.SLOW}
    (every,) = set(map(frozenset, scenes.values()))
    assert all(one <= every for one in some.values())
    assert len(set(map(frozenset, some.values()))) == 1


def test_answers_that_were_kept_are_not_asked_for_again(tmp_path: Path) -> None:
    script, log, asked = importlib.import_module("baselines"), tmp_path / "log", []

    def ask(method: str, scene: str) -> Any:
        asked.append((method, scene))
        return script.Line(method, scene, "certified", "", 0.1, 1.0, 30.0, 1.2, None)

    first = script.kept(ask, log)("fewest", "obs1")
    again = script.kept(ask, log)
    assert again("fewest", "obs1") == first
    again("paper", "obs1")
    assert asked == [("fewest", "obs1"), ("paper", "obs1")]


def test_slow_methods_are_asked_for_the_first_problems_only() -> None:
    script = importlib.import_module("baselines")
    found = list(script.sample(lambda *one: one, 3, 1, 60.0))
    numbers = [
        {scene[-4:] for name, scene in found if (name in script.SLOW) == slow}
        for slow in (False, True)
    ]
    assert numbers == [{"0000", "0001", "0002"}, {"0000"}]
    families = {scene[:-5] for _, scene in found}
    assert len(families) == 8
    assert len(found) == 8 * (3 * len(script.METHODS) - 2 * len(script.SLOW))
