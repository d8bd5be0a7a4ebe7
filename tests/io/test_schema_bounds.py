"""Bounds and defaults of problem files: they change on purpose only."""

from typing import Any

import pytest
from pydantic import Field, ValidationError

from vdsm_pin.io.problem_file import problem_schema
from vdsm_pin.io.schema_types import SMALLEST, FileModel, Positive, Range, Vector

CONTRACT = """\
< 90.0, > 0.0: cone_deg max_joint_angle_deg max_link_angle_deg
<= 1.0, >= 0.0, default 1.0: required_coverage
<= 1e12, <= 36000.0, >= -36000.0, >= 0.0, default 0.0, default 360.0: turn_deg
<= 1e12, > 0.0: half_gap hole_radius length link_lengths[] link_radius[] size[]
<= 1e12, > 0.0, default 1.0: scale
<= 1e12, > 0.0, default None: curve_tolerance cylinder_radius max_change_per_row_deg
    radius spacing tip_tolerance
<= 1e12, > 0.0, items <= 40, items >= 2: link_radius
<= 1e12, >= -1e12: alpha_deg[] axis[] base_range[] center[] direction[] directions[][]
    from hole_angles_deg[][] insertion[][] lock normal[] point[] points[][] polygon[][]
    position[] positions[][] rpy_deg[][] scaling_centre[] spline[][] start[] target[]
    theta_deg[] through[] times_s[] tip[] to[] values[] x0
<= 1e12, >= -1e12, items <= 3, items >= 3: rpy_deg[] to
<= 1e12, >= 0.0: joint_deg[] required_clearance
<= 1e12, >= 0.0, default 0.0: base base_deg joint_deg obstacle required_self_clearance
    retreat shift slide
<= 256, >= 1, default 1, default None: parts
<= 40, >= 1: link
>= 2, default None: joint
default False: closed
default None: bodies cables feed goal group joint_limits joints length_unit manipulator
    motion pointing positions ratios robot solid srdf tip_path tool topic
default None, default [0.0, 0.0, 0.0], items <= 3, items >= 3: rpy_deg
default None, default custom, length <= 100: name
default None, items <= 2, items >= 2: base_range scaling_centre
default None, items <= 3, items >= 3: direction start target tip
default None, items <= 40: hole_angles_deg values
default None, items >= 1: directions
default True: check_size
default [0.0, 0.0, 0.0], items <= 3, items >= 3: center position
default []: bodies ignore_pairs insertion obstacles others package_dirs
default as_given: order
default detour: blocked
default shortest: approach
default z: cylinder_axis
items <= 2, items >= 2: ignore_pairs[] polygon[]
items <= 3, items >= 3: axis directions[] hole_angles_deg[] insertion[] normal point
    points[] positions[] size spline[] through
items <= 40, items >= 2: link_lengths
items >= 1: points spline times_s
items >= 3: polygon
length <= 100: ignore_pairs[][]
length <= 4096, length >= 1: file trajectory
length >= 1: urdf
"""
"""Each line: bounds and defaults, the fields that have them; [] is of an item."""

WORDS = {
    "minimum": ">=",
    "exclusiveMinimum": ">",
    "maximum": "<=",
    "exclusiveMaximum": "<",
    "minItems": "items >=",
    "maxItems": "items <=",
    "minLength": "length >=",
    "maxLength": "length <=",
    "default": "default",
}


def bounds(entry: Any, field: str = "") -> set[tuple[str, str]]:
    """Field and bound, of a part of a JSON schema."""
    if isinstance(entry, list):
        return {bound for one in entry for bound in bounds(one, field)}
    if not isinstance(entry, dict):
        return set()
    found = {
        (field, f"{WORDS[key]} {value}")
        for key, value in entry.items()
        if field and key in WORDS and not isinstance(value, dict)
    }
    for key, value in entry.items():
        if key == "properties":
            found |= {b for name, one in value.items() for b in bounds(one, name)}
        else:
            found |= bounds(value, f"{field}[]" if key == "items" else field)
    return found


def test_the_schema_has_the_bounds_and_defaults_that_are_promised() -> None:
    expected = set()
    for line in CONTRACT.replace("\n    ", " ").splitlines():
        said, _, fields = line.replace("1e12", "1000000000000.0").partition(": ")
        words = said.replace(", 0.0", "; 0.0").split(", ")  # commas of a default stay
        expected |= {(f, w.replace(";", ",")) for f in fields.split() for w in words}
    assert bounds(problem_schema()) == expected


class Sizes(FileModel):
    size: Positive = 1.0
    vector: Vector = Field(default=[0.0, 0.0, 0.0])
    range: Range = Field(default=[0.0, 1.0])


@pytest.mark.parametrize(
    "fields",
    [
        {"size": SMALLEST * (1.0 - 1e-15)},
        {"size": 0.0},
        {"size": float("nan")},
        {"size": "1"},
        {"vector": [0.0] * 2},
        {"vector": [0.0] * 4},
        {"range": [0.0]},
        {"range": [0.0] * 3},
        {"range": [0.0, float("inf")]},
        {"other": 1.0},
    ],
)
def test_what_no_field_holds_is_refused(fields: dict[str, Any]) -> None:
    with pytest.raises(ValidationError):
        Sizes(**fields)


def test_what_was_read_does_not_change() -> None:
    sizes = Sizes(size=SMALLEST)
    with pytest.raises(ValidationError, match="frozen"):
        sizes.size = 2.0
