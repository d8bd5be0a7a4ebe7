"""Values that know where they stand in a file."""

import json
from collections.abc import Callable
from typing import Any

import pytest

from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.places import Place

DATA = {"a": {"b": [1, 2.5, 3]}, "n": 7, "none": None, 5: "no name"}


def test_what_stands_there_is_found() -> None:
    data = Place.of("f", DATA)
    assert data["a"]["b"][1].number() == 2.5
    assert data["n"].number() == 7.0
    assert data["a"]["b"].numbers(3).tolist() == [1.0, 2.5, 3.0]
    assert [one.number() for one in data["a"]["b"].items()] == [1.0, 2.5, 3.0]
    assert data["a"].keys() == ["b"]
    assert data.get("n").value == 7
    for missing in (data.get("none", 3), data.get("x", 3), data.get("x").get("y", 3)):
        assert missing.value == 3
    assert data.get("x").value is data["n"].get("x").value is None


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (lambda data: data["n"]["x"], "f: n: is no mapping"),
        (lambda data: data["a"]["b"]["x"], "f: a.b: is no mapping"),
        (lambda data: data["a"]["x"], "f: a: has no 'x'"),
        (lambda data: data["n"].get("x", 3), "f: n: is no mapping"),
        (lambda data: data["a"]["b"].get("x", []), "f: a.b: is no mapping"),
        (lambda data: data["a"]["b"][3], "f: a.b: has no 3"),
        (lambda data: data["n"][0], "f: n: has no 0"),
        (lambda data: data["n"].items(), "f: n: is no list"),
        (lambda data: data["a"].items(), "f: a: is no list"),
        (lambda data: data["a"]["b"].keys(), "f: a.b: is no mapping"),
        (lambda data: data["n"].keys(), "f: n: is no mapping"),
        (lambda data: data.keys(), "f: has the key 5, expected a name"),
        (
            lambda data: data["a"].number(),
            "f: a: is {'b': [1, 2.5, 3]}, expected a finite",
        ),
        (lambda data: data["a"]["b"].numbers(2), "f: a.b: is [1, 2.5, 3], expected 2 "),
    ],
)
def test_what_does_not_is_told_with_its_place(
    wrong: Callable[[Place], Any], said: str
) -> None:
    with pytest.raises(InvalidFile) as caught:
        wrong(Place.of("f", DATA))
    assert str(caught.value).startswith(said)


def test_numbers_are_finite_and_no_words() -> None:
    for value in ("1", True, None, float("nan"), float("inf"), 10**400, [1]):
        with pytest.raises(InvalidFile, match="expected a finite number"):
            Place.of("f", value).number()
    assert Place.of("f", json.loads("1e3")).number() == 1000.0
