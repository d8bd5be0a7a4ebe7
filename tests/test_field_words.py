"""One thing has one name, the field's: docs/glossary.md has them."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FIELD = {
    "coast": "cached plane",
    "culling": "broad phase",
    "desk": "workspace",
    "garden": "roadmap",
    "glide": "cached plane",
    "graft": "population growth",
    "hasty": "verdict alone",
    "narrowing": "refining",
    "taste": "cost",
    "taper": "corner",
}
"""Words that this project once had of its own, and what the field says."""

WORD = re.compile(rf"\b({'|'.join(FIELD)})s?\b", re.IGNORECASE)
PLACES = ("vdsm_pin", "docs", "benchmarks", "analysis", "examples")
TEXTS = sorted(
    path
    for place in PLACES
    for path in (ROOT / place).rglob("*")
    if path.suffix in (".py", ".md") and "site" not in path.parts
)


def found_in(text: str) -> list[str]:
    """Words of the list that stand by themselves or within a name."""
    apart = re.sub(r"_|(?<=[a-z])(?=[A-Z])", " ", text)
    return [found[0].lower() for found in WORD.finditer(apart)]


@pytest.mark.parametrize("path", TEXTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_every_word_is_the_field_s(path: Path) -> None:
    used = found_in(path.read_text(encoding="utf-8"))
    assert not used, {word: FIELD[word.rstrip("s")] for word in used}


def test_the_test_finds_words_in_names() -> None:
    text = "class HastyProof: self.desk, plane_coasts = 1, 'a desktop tasted'"
    assert found_in(text) == ["hasty", "desk", "coasts"]
