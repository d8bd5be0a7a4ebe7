"""Manipulator against Table 1 and the paper's printed numbers."""

import numpy as np
import pytest

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.errors import InvalidInput, UnknownName

HRM8 = built_in("hrm8")


def arm(**changes: object) -> Manipulator:
    values: dict[str, object] = {
        "name": "test",
        "link_lengths": [0.3, 0.2],
        "link_radius": 0.05,
        "max_link_angle": 0.7,
        "max_joint_angle": 0.7,
        "base_range": (-1.0, 1.0),
        "cables": CableLayout(0.04, 0.02, paper_hole_angles(2)),
    }
    return Manipulator(**(values | changes))  # type: ignore[arg-type]


def test_hrm8_is_table_1() -> None:
    expected = [486, 486, 486, 486, 486, 206, 206, 284]
    np.testing.assert_allclose(HRM8.link_lengths * 1e3, expected, rtol=1e-15)
    assert HRM8.total_length == pytest.approx(3.126, abs=1e-15)
    assert HRM8.link_radius == 0.0615


def test_ratios_are_the_recovered_numbers() -> None:
    printed = [0.155, 0.311, 0.466, 0.622, 0.777, 0.843, 0.909]
    np.testing.assert_allclose(HRM8.ratios[1:-1], printed, atol=6e-4)
    assert HRM8.ratios[0] == 0.0
    assert HRM8.ratios[-1] == 1.0


def test_ratio_follows_equation_6() -> None:
    assert HRM8.ratio(1, 5) == 0.0
    assert HRM8.ratio(7, 7) == 1.0
    assert HRM8.ratio(8, 9) == HRM8.ratios[7]
    assert HRM8.ratio(7, 8) * HRM8.ratio(8, 9) == pytest.approx(HRM8.ratio(7, 9))
    with pytest.raises(ZeroDivisionError):
        HRM8.ratio(3, 1)


def test_hole_angles_are_the_printed_ones() -> None:
    degrees = np.rad2deg(HRM8.cables.hole_angles)
    assert degrees[4, 1] == pytest.approx(0.0, abs=1e-12)
    assert degrees[5, 1] == pytest.approx(15.0)
    assert degrees[0, 0] == pytest.approx(180.0)
    assert degrees[3, 1] == pytest.approx(345.0)
    assert len(set(np.round(degrees.ravel(), 6))) == 24


@pytest.mark.parametrize("n_links", [2, 3, 7, 20, 40])
def test_holes_are_distinct_for_any_number_of_links(n_links: int) -> None:
    holes = np.sort(paper_hole_angles(n_links).ravel())
    gaps = np.diff(np.concatenate([holes, holes[:1] + 2 * np.pi]))
    np.testing.assert_allclose(gaps, 2 * np.pi / (3 * n_links), atol=1e-12)


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("link_lengths", [0.3]),
        ("link_lengths", [0.3, -0.2]),
        ("link_lengths", [0.3, np.nan]),
        ("link_lengths", [0.3, 1e308]),
        ("link_lengths", [[0.3, 0.2]]),
        ("link_radius", 0.0),
        ("link_radius", np.nan),
        ("link_radius", 1e308),
        ("max_link_angle", np.pi / 2),
        ("max_joint_angle", 0.0),
        ("base_range", (1.0, -1.0)),
        ("base_range", (0.0, np.inf)),
        ("cables", HRM8.cables),
    ],
)
def test_impossible_arms_are_refused(field: str, value: object) -> None:
    with pytest.raises(InvalidInput):
        arm(**{field: value})


def test_arrays_are_read_only() -> None:
    with pytest.raises(ValueError, match="read-only"):
        HRM8.link_lengths[0] = 1.0


def test_unknown_name_lists_the_known() -> None:
    with pytest.raises(UnknownName, match="hrm8"):
        built_in("hrm9")
