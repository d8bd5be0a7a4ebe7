"""Table 1 and the 16 traditional frames against Pinocchio's reading of the URDF."""

import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib")
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "analysis"))

import table1_parameters as tables

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.verification.pinocchio_arm import load_arm

HRM8 = built_in("hrm8")


def poses(n: int) -> list[tuple[float, np.ndarray, np.ndarray]]:
    rng = np.random.default_rng(3)
    found = [(0.0, np.zeros(8), np.zeros(8))]
    for _ in range(n):
        alpha, theta = rng.uniform(-1.5, 1.5, (2, 8))
        found.append((float(rng.normal()), alpha, theta))
    return found


@pytest.mark.parametrize("table", [tables.by_table_1, tables.by_traditional])
def test_both_tables_give_the_joint_centres_of_pinocchio(table) -> None:  # type: ignore[no-untyped-def]
    robot = load_arm(HRM8)
    for x0, alpha, theta in poses(200):
        expected = robot.joint_centres(np.array([x0]), alpha[None], theta[None])[0]
        np.testing.assert_allclose(
            table(HRM8, x0, alpha, theta), expected, rtol=0, atol=1e-14
        )


def test_the_traditional_table_has_a_row_for_every_rotation() -> None:
    rows = tables.traditional(HRM8)
    assert len(rows) == 16
    assert [row.angle for row in rows[:3]] == [("α", 1), ("θ", 1), ("α", 2)]
    lengths = [row.a for row in rows if row.a > 0.0]
    np.testing.assert_array_equal(lengths, HRM8.link_lengths)
    assert tables.traditional_markdown(HRM8).count("\n") == 2 + 16


def test_the_printed_matrix_is_not_the_product() -> None:
    """It is right where theta equals alpha only, and not even a rotation elsewhere."""
    factors = tables._moved(0.3) @ tables._turned(2, 0.4) @ tables._turned(1, 0.4)
    np.testing.assert_allclose(
        tables.printed_matrix(0.3, 0.4, 0.4), factors, atol=1e-15
    )
    printed = tables.printed_matrix(0.3, 0.4, -0.2)[:3, :3]
    assert np.abs(printed @ printed.T - np.eye(3)).max() > 0.1


def test_the_printed_step_5_takes_the_nearest_of_four_points() -> None:
    """One joint, a disc: the tip goes over it, and the joint follows by hand."""
    from step5_choices import literal_rule

    from vdsm_pin.planner.paper.danger_region import DangerRegion

    region = DangerRegion("disc", np.array([[1.0, 0.0]]), 0.5)
    tips = np.array([[2.0, 2.0], [2.0, 0.2], [2.0, -0.2]])
    planar = literal_rule(np.array([0.0, 0.5]), tips, region)
    np.testing.assert_allclose(planar[0, 1], [1.0, 1.0])  # in proportion
    np.testing.assert_allclose(planar[1, 1], [1.0, 0.5])  # up is nearest
    np.testing.assert_allclose(planar[2, 1], [1.0, 0.5])
