"""JSON: equal content gives equal bytes; NaN and infinity never get in."""

import json
from enum import StrEnum
from pathlib import Path, PurePosixPath

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from vdsm_pin.io.json_file import json_text, write_json

plain = st.recursive(
    st.none() | st.booleans() | st.integers() | st.text()
    | st.floats(allow_nan=False, allow_infinity=False),
    lambda inner: st.lists(inner) | st.dictionaries(st.text(), inner),
    max_leaves=8,
)  # fmt: skip


@settings(max_examples=50, deadline=None)
@given(plain)
def test_plain_values_come_back_equal(value: object) -> None:
    text = json_text(value)
    assert json.loads(text) == value
    assert json_text(json.loads(text)) == text


def test_order_of_insertion_does_not_matter() -> None:
    assert json_text({"b": 1, "a": [2]}) == json_text({"a": [2], "b": 1})
    assert json_text({"b": 1, "a": [2]}, indent=None) == '{"a":[2],"b":1}\n'


def test_what_is_not_finite_is_null_with_a_reason() -> None:
    value = {"worst": float("nan"), "range": [0.0, -np.inf], "good": 1.0}
    assert json.loads(json_text(value)) == {
        "worst": None,
        "worst_reason": "undefined",
        "range": [0.0, None],
        "range_reason": "-inf (unbounded)",
        "good": 1.0,
    }
    with pytest.raises(ValueError, match="would overwrite 'a_reason'"):
        json_text({"a": np.nan, "a_reason": "mine"})
    with pytest.raises(ValueError, match="no map"):
        json_text([np.nan])


def test_numpy_paths_and_enums_are_written_as_what_they_mean(tmp_path: Path) -> None:
    colour = StrEnum("colour", ["RED"])
    value = {
        "array": np.arange(3),
        "number": np.float64(0.1),
        "flag": np.bool_(True),
        "path": PurePosixPath("a/b"),
        "enum": colour.RED,
        "tuple": (1, 2),
        "float32": np.float32(0.5),
    }
    write_json(tmp_path / "a.json", value)
    assert json.loads((tmp_path / "a.json").read_text()) == {
        "array": [0, 1, 2],
        "number": 0.1,
        "flag": True,
        "path": "a/b",
        "enum": "red",
        "tuple": [1, 2],
        "float32": 0.5,
    }


@pytest.mark.parametrize("value", [{1: 2}, {"a": object()}, {"a": {1, 2}}, b"x"])
def test_what_json_has_no_word_for_is_an_error(value: object) -> None:
    with pytest.raises(TypeError):
        json_text(value)
