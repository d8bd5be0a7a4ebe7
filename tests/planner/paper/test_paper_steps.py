"""The seven steps one by one: published numbers, closed forms, both sides of limits."""

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.kinematics import joint_angles, link_angles
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.errors import LimitExceeded, LinkTooShort, OutOfReach
from vdsm_pin.planner.feasibility import (
    check_feasibility,
    curled_reach,
    straight_reach,
)
from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.planner.paper.joint_paths import SideRule, slide_joints
from vdsm_pin.planner.paper.lift import largest_angles, lift
from vdsm_pin.planner.paper.project import project
from vdsm_pin.planner.paper.scale import scale
from vdsm_pin.planner.paper.solve import check_limits
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.tolerances import TOLERANCES

HRM8 = built_in("hrm8")
PUBLISHED_RATIOS = [0.155, 0.311, 0.466, 0.622, 0.777, 0.843, 0.909]


def arm(lengths: list[float], cone_deg: float) -> Manipulator:
    limit = float(np.deg2rad(cone_deg))
    layout = CableLayout(0.05, 0.03, paper_hole_angles(len(lengths)))
    return Manipulator(
        "arm", np.array(lengths), 0.06, limit, limit, (-5.0, 5.0), layout
    )


def disc(y: float, z: float, radius: float) -> DangerRegion:
    return DangerRegion("disc", np.array([[y, z]]), radius)


def test_curled_reach_is_the_published_2966() -> None:
    assert curled_reach(HRM8) == pytest.approx(2.96649, abs=5e-6)


def test_straight_reach_is_the_arm_leaned_to_its_cone() -> None:
    assert straight_reach(HRM8) == pytest.approx(3.126 * np.sin(np.deg2rad(42.5)))


def test_reach_of_two_links_by_hand() -> None:
    two = arm([1.0, 1.0], 30.0)
    assert curled_reach(two) == pytest.approx(0.5 + np.sin(np.deg2rad(60.0)))
    assert straight_reach(two) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("factor_of", "inside"), [(straight_reach, True), (curled_reach, False)]
)
def test_both_reaches_have_two_sides(factor_of, inside: bool) -> None:
    radius = factor_of(HRM8)
    for excess in (-1e-9, 1e-9):
        corner = [3.126, 0.0, radius + excess]
        path = DesiredPath(np.array([3.126, 0.0, 0.0]), np.array([corner]))
        if inside and excess < 0.0:
            check_feasibility(HRM8, path)
            continue
        with pytest.raises(OutOfReach) as error:
            check_feasibility(HRM8, path)
        between = radius + excess <= curled_reach(HRM8)
        assert ("straight arm" in str(error.value)) is between
        assert error.value.place == "point 1 of the desired path"


def test_projection_drops_x() -> None:
    np.testing.assert_array_equal(project(np.array([[1.0, 2.0, 3.0]])), [[2.0, 3.0]])


def test_reference_paths_are_the_published_ratios_of_the_tip() -> None:
    planar = scale(HRM8, np.array([[1.0, 1.3]]))[0]
    np.testing.assert_allclose(planar[1:-1, 0], PUBLISHED_RATIOS, atol=5e-4)
    np.testing.assert_allclose(planar[:, 1], 1.3 * planar[:, 0], rtol=1e-15)
    assert not planar[0].any()


def test_far_corner_of_the_square_gives_the_published_psi_and_base() -> None:
    tip = np.array([[1.0, 1.3]])
    centres = lift(HRM8, scale(HRM8, tip), np.array([3.126]))
    psi = np.rad2deg(link_angles(*joint_angles(HRM8, centres)))[0]
    assert psi[0] == pytest.approx(31.65, abs=5e-3)
    np.testing.assert_allclose(psi[1:], 0.0, atol=1e-6)
    assert centres[0, 0, 0] * 1e3 == pytest.approx(464.8, abs=0.05)


@given(st.integers(2, 12), st.integers(0, 2**32 - 1))
def test_lifted_arms_keep_link_lengths_tip_and_rail(n_links: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    lengths = rng.uniform(0.1, 0.6, n_links)
    some = arm(list(lengths), 42.5)
    steps = rng.uniform(-0.69, 0.69, (7, n_links, 2)) * lengths[:, None]
    planar = np.concatenate([np.zeros((7, 1, 2)), np.cumsum(steps, axis=1)], axis=1)
    tip_x = rng.uniform(-1.0, 4.0, 7)
    centres = lift(some, planar, tip_x)
    links = np.linalg.norm(np.diff(centres, axis=1), axis=2)
    np.testing.assert_allclose(links, np.broadcast_to(lengths, links.shape), rtol=1e-12)
    np.testing.assert_array_equal(centres[:, -1, 0], tip_x)
    np.testing.assert_array_equal(centres[:, 0, 1:], 0.0)
    assert (np.diff(centres[..., 0], axis=1) > 0.0).all()
    psi = link_angles(*joint_angles(some, centres))
    np.testing.assert_allclose(
        largest_angles(planar, lengths), psi.max(axis=1), atol=1e-7
    )
    planar[3, -1] += 2.0 * lengths[-1]
    assert np.isinf(largest_angles(planar, lengths)).tolist() == [
        row == 3 for row in range(7)
    ]


@pytest.mark.parametrize(("excess", "fits"), [(-1e-12, True), (1e-9, False)])
def test_a_gap_as_long_as_its_link_is_the_limit(excess: float, fits: bool) -> None:
    two = arm([1.0, 0.5], 42.5)
    planar = np.array([[[0.0, 0.0], [0.3, 0.0], [0.8 + excess, 0.0]]])
    if fits:
        lift(two, planar, np.array([2.0]))
        return
    with pytest.raises(LinkTooShort) as error:
        lift(two, planar, np.array([2.0]))
    assert error.value.link == 2
    assert error.value.waypoint == 0


@pytest.mark.parametrize("kind", ["disc", "stadium", "triangle"])
def test_joints_end_outside_the_region_or_in_proportion(kind: str) -> None:
    """Each joint is P'_i of Eq. 8-10 or on the boundary straight along the line."""
    corners = {
        "disc": [[0.7, 0.6]],
        "stadium": [[0.6, 0.5], [0.8, 0.7]],
        "triangle": [[0.6, 0.5], [0.8, 0.6], [0.65, 0.75]],
    }[kind]
    region = DangerRegion("body", np.array(corners), 0.2)
    core = shapely.MultiPoint(corners).convex_hull
    rng = np.random.default_rng(3)
    tip = rng.uniform([0.7, 0.5], [1.2, 1.4], (400, 2))
    tip = tip[~region.contains(tip)]
    up = np.array([0.0, 1.0])
    for direction in (up, np.zeros(2)):
        rule = SideRule(region, 1, direction, np.zeros(8))
        planar = slide_joints(HRM8, tip, rule)
        moved = 0
        for i in range(8, 1, -1):
            reference = HRM8.ratio(i, i + 1) * planar[:, i]
            joint = planar[:, i - 1]
            outside = shapely.distance(core, shapely.points(reference)) >= 0.2
            np.testing.assert_array_equal(joint[outside], reference[outside])
            gaps = shapely.distance(core, shapely.points(joint[~outside]))
            np.testing.assert_allclose(gaps, 0.2, atol=1e-12)
            shift = joint[~outside] - reference[~outside]
            if not direction.any():
                radii = np.linalg.norm(joint, axis=1)
                np.testing.assert_allclose(radii, np.linalg.norm(reference, axis=1))
            else:
                np.testing.assert_allclose(shift[:, 0], 0.0, atol=1e-15)
                assert (shift[:, 1] > 0.0).all()
            moved += len(shift)
        assert moved > 100


def test_a_margin_moves_the_joints_of_its_link_alone() -> None:
    """Link 5 keeps 20 mm more: its joints, 5 and 6, slide on a boundary farther out."""
    region, up = disc(0.7, 0.6, 0.302), np.array([0.0, 1.0])
    tip = np.array([[1.0, 0.6 + np.sqrt(0.302**2 - 0.3**2)]])
    margins = np.zeros(8)
    before = slide_joints(HRM8, tip, SideRule(region, 1, up, margins))
    margins[4] = 0.020
    after = slide_joints(HRM8, tip, SideRule(region, 1, up, margins))
    gaps = np.linalg.norm(after[0, 3:8] - [0.7, 0.6], axis=1)
    # Joints 4 to 8 slide; 4 follows 5 in proportion unless it is inside again.
    np.testing.assert_allclose(gaps[[1, 2]], 0.322, atol=1e-12)
    np.testing.assert_allclose(gaps[[3, 4]], 0.302, atol=1e-12)
    np.testing.assert_array_equal(after[0, 6:], before[0, 6:])


def test_figure_8_only_deviated_joints_bend() -> None:
    """obs1, tip at A5: P_8..P_4 on the boundary, P_3 and P_2 in proportion (6.2.1)."""
    region = disc(0.7, 0.6, 0.302)
    tip = np.array([[1.0, 0.6 + np.sqrt(0.302**2 - 0.3**2)]])
    rule = SideRule(region, 1, np.array([0.0, 1.0]), np.zeros(8))
    planar = slide_joints(HRM8, tip, rule)
    centres = lift(HRM8, planar, np.array([3.126]))
    psi = np.rad2deg(link_angles(*joint_angles(HRM8, centres)))[0]
    np.testing.assert_array_equal(psi > 1e-6, [1, 0, 0, 1, 1, 1, 1, 1])
    on_boundary = np.linalg.norm(planar[0, 3:8] - [0.7, 0.6], axis=1)
    np.testing.assert_allclose(on_boundary, 0.302, atol=1e-12)


@pytest.mark.parametrize("excess", [-1e-9, 1e-9])
@pytest.mark.parametrize("quantity", ["psi", "theta", "alpha", "x0"])
def test_limits_have_two_sides(quantity: str, excess: float) -> None:
    alpha, theta, x0 = np.zeros((3, 8)), np.zeros((3, 8)), np.zeros(3)
    limit = HRM8.max_joint_angle + excess
    if quantity == "alpha":
        alpha[1, 4] = -limit
    elif quantity == "theta":
        theta[1, 4] = limit
    elif quantity == "psi":
        alpha[1, 4] = theta[1, 4] = np.arccos(np.sqrt(np.cos(limit)))
    else:
        x0[1] = HRM8.base_range[1] + excess
    if excess < 0.0:
        check_limits(HRM8, x0, alpha, theta)
        return
    with pytest.raises(LimitExceeded) as error:
        check_limits(HRM8, x0, alpha, theta)
    assert error.value.waypoint == 1
    if quantity in ("psi", "x0"):
        assert quantity in error.value.quantity


def test_box_corner_keeps_the_box_and_breaks_the_cone() -> None:
    corner = np.full((1, 8), HRM8.max_joint_angle - 1e-9)
    with pytest.raises(LimitExceeded) as error:
        check_limits(HRM8, np.zeros(1), corner, corner)
    assert "psi" in error.value.quantity
    assert error.value.value == pytest.approx(57.1, abs=0.05)


def test_planned_step_leaves_room_below_five_degrees() -> None:
    assert TOLERANCES.planned_step < np.deg2rad(5.0)
