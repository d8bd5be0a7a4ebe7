"""Oracles: the JSON Schemas, the headers written, the table of words in the docs."""

import re
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import made_up
import pytest

from vdsm_pin.report.facts import verification_file
from vdsm_pin.report.files import SCHEMA_NAMES, BatchRow, schema
from vdsm_pin.report.tables import (
    ClearanceCsv,
    write_cables,
    write_centres,
    write_link_angles,
)
from vdsm_pin.report.words import TERMS
from vdsm_pin.tolerances import TOLERANCES, UNITS

PAGE = Path(__file__).parents[2] / "docs" / "results.md"
OURS = [name for name in SCHEMA_NAMES if name != "problem"]
RESULTS = [name for name in OURS if name != "certificate"]  # it has a page of its own
WITHOUT_UNIT = {
    "worst", "limit", "value",  # a key `unit` stands beside them
    "moment", "first_moment", "last_moment",  # in waypoints
    "coverage",  # a share
    "changed_angles_mean_on_path",  # a number
    "normal",  # a unit vector
    "proofs", "base",  # said in their descriptions
}  # fmt: skip


def keys(name: str) -> Iterator[tuple[str, dict[str, Any]]]:
    """Every key of one file, at any depth, with its description."""
    whole = schema(name)
    for part in (whole, *whole.get("$defs", {}).values()):
        yield from part.get("properties", {}).items()


def holds_numbers(field: dict[str, Any]) -> bool:
    """Whether a field is a number that is not a count, or holds some."""
    if field.get("type") == "number":
        return True
    inside = [*field.get("anyOf", []), *field.get("prefixItems", [])]
    items = field.get("items")
    return any(map(holds_numbers, inside + ([items] if items else [])))


def documented() -> set[str]:
    """Every key the table of words names."""
    table = PAGE.read_text(encoding="utf-8").split("## Words")[1].split("\n## ")[0]
    columns = [line.split("|") for line in table.splitlines() if line.startswith("|")]
    return {key for cells in columns for key in re.findall(r"`(\w+)`", cells[2])}


@pytest.mark.parametrize("name", OURS)
def test_every_key_is_described(name: str) -> None:
    for key, field in keys(name):
        assert field.get("description") or "$ref" in field, key


@pytest.mark.parametrize("name", OURS)
def test_every_length_and_angle_says_its_unit(name: str) -> None:
    for key, field in keys(name):
        if holds_numbers(field) and key not in WITHOUT_UNIT:
            assert re.search(r"_(m|rad|s)$|^seconds$", key), key


def test_the_words_in_the_docs_are_the_keys_of_the_files(tmp_path: Path) -> None:
    judged = made_up.verification(n=3)
    path = tmp_path / "clearance.csv"
    with closing(ClearanceCsv(path, judged.problem, len(judged.pairs))) as clearance:
        clearance.write(judged)
    write_link_angles(tmp_path / "link_angles.csv", judged)
    write_cables(tmp_path / "cables.csv", judged.problem, judged.trajectory)
    write_centres(tmp_path / "centres.csv", judged.problem, judged.trajectory)
    columns = {
        re.sub(r"_[yz]_m$", "_x_m", re.sub(r"^(psi|gamma|l|o)\d", r"\g<1>1", column))
        for path in tmp_path.iterdir()
        for column in path.read_text(encoding="utf-8").splitlines()[0].split(",")
    }
    written = {key for name in RESULTS for key, _ in keys(name)} | columns
    assert documented() == written


def test_the_terms_are_keys_of_the_files_and_words_of_the_docs() -> None:
    text = " ".join(PAGE.read_text(encoding="utf-8").split())
    written = {key for name in RESULTS for key, _ in keys(name)}
    for key, word in TERMS.items():
        assert key in written
        name = word.removeprefix("smallest ").removeprefix("largest ")
        assert word in text or name in text, word


def test_every_tolerance_has_its_unit_and_is_reported_with_it() -> None:
    reported = verification_file(made_up.verification(), made_up.RECORD).tolerances
    assert set(reported) == set(UNITS)
    source = Path(__file__).parents[2] / "vdsm_pin" / "tolerances.py"
    text = source.read_text(encoding="utf-8")
    for name, held in reported.items():
        assert held.value == getattr(TOLERANCES, name)
        assert held.unit, f"{name} names no unit"
        said = re.search(rf'    {name}: .*?\n    """(.*?)"""', text, re.DOTALL)
        assert said is not None
        if held.unit in ("m", "rad", "-"):
            assert f"[{held.unit}]" in said[1], name


def test_a_summary_has_the_columns_of_its_schema() -> None:
    assert set(BatchRow.model_fields) <= {key for key, _ in keys("manifest")}
