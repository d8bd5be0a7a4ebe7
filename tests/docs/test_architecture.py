"""The drawing of the package shows what is there."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]


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


def test_the_walk_of_a_problem_file_has_at_most_twelve_stops() -> None:
    page = (ROOT / "ARCHITECTURE.md").read_text(encoding="utf-8")
    walk = page.split("## The walk of one problem file")[1].split("\n## ")[0]
    stops = re.findall(r"^\d+\. ", walk, re.MULTILINE)
    assert 5 <= len(stops) <= 12
