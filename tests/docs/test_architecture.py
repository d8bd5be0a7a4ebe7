"""The drawing of the package and the list of its modules show what is there."""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "analysis"))

import module_index  # noqa: E402


def test_the_drawing_names_every_folder_and_module() -> None:
    """Its texts are comments in the SVG; `make figures` draws it anew."""
    drawn = (ROOT / "docs" / "architecture.svg").read_text(encoding="utf-8")
    words = set(re.findall(r"\w+", " ".join(re.findall(r"<!-- (.*?) -->", drawn))))
    package = ROOT / "vdsm_pin"
    there = {
        path.relative_to(package).parts[0].removesuffix(".py")
        for path in package.rglob("*.py")
    }
    assert {name for name in there if not name.startswith("__")} <= words


def test_every_module_is_listed_in_its_own_words() -> None:
    """`python analysis/module_index.py` writes the page anew."""
    assert (ROOT / "docs" / "modules.md").read_text("utf-8") == module_index.page()
    assert not re.search(r"`: *$", module_index.page(), re.MULTILINE)


def test_the_walk_of_a_problem_file_has_at_most_twelve_stops() -> None:
    page = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    walk = page.split("## The walk of one problem file")[1].split("\n## ")[0]
    stops = re.findall(r"^\d+\. ", walk, re.MULTILINE)
    assert 5 <= len(stops) <= 12
