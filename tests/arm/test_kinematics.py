"""Closed-form kinematics against products of matrices and against itself."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from vdsm_pin.arm.kinematics import (
    joint_angles,
    joint_centres,
    link_angles,
    position_angles,
    straight_joints,
    tip_jacobian,
)
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.errors import WrongLinkLength

HRM8 = built_in("hrm8")
LIMIT = HRM8.max_joint_angle


def samples(kind: str, n: int = 200) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    rng = np.random.default_rng(7)
    shape = (n, 8)
    if kind == "uniform":
        alpha, theta = rng.uniform(-LIMIT, LIMIT, (2, *shape))
    elif kind == "on_limit":
        alpha, theta = LIMIT * rng.choice([-1.0, 0.0, 1.0], (2, *shape))
    else:
        alpha, theta = rng.uniform(-1e-7, 1e-7, (2, *shape))
    return rng.uniform(-1.0, 1.0, n), alpha, theta


KINDS = ["uniform", "on_limit", "degenerate"]


@pytest.mark.parametrize("kind", KINDS)
def test_centres_are_the_product_of_equation_1(kind: str) -> None:
    x0, alpha, theta = samples(kind, 50)
    centres = joint_centres(HRM8, x0, alpha, theta)
    for k in range(x0.size):
        frame, centre = Rotation.identity(), np.array([x0[k], 0.0, 0.0])
        for i in range(8):
            angles = [alpha[k, i], theta[k, i]]
            frame = frame * Rotation.from_euler("ZY", angles)
            centre = centre + frame.apply([HRM8.link_lengths[i], 0.0, 0.0])
            np.testing.assert_allclose(centres[k, i + 1], centre, rtol=0, atol=1e-14)


@pytest.mark.parametrize("kind", KINDS)
def test_angles_come_back_from_the_centres(kind: str) -> None:
    x0, alpha, theta = samples(kind)
    again = joint_angles(HRM8, joint_centres(HRM8, x0, alpha, theta))
    np.testing.assert_allclose(again[0], alpha, rtol=0, atol=1e-12)
    np.testing.assert_allclose(again[1], theta, rtol=0, atol=1e-12)


@pytest.mark.parametrize("kind", KINDS)
def test_link_angle_is_the_angle_between_adjacent_links(kind: str) -> None:
    x0, alpha, theta = samples(kind)
    links = np.diff(joint_centres(HRM8, x0, alpha, theta), axis=1)
    before, after = links[:, :-1], links[:, 1:]
    across = np.linalg.norm(np.cross(before, after), axis=2)
    expected = np.arctan2(across, np.sum(before * after, axis=2))
    psi = link_angles(alpha, theta)
    np.testing.assert_allclose(psi[:, 1:], expected, rtol=0, atol=1e-12)


def test_link_angle_is_equation_2_and_keeps_precision_at_zero() -> None:
    _, alpha, theta = samples("uniform")
    printed = np.arccos(np.cos(theta) * np.cos(alpha))
    np.testing.assert_allclose(link_angles(alpha, theta), printed, atol=1e-7)
    tiny = np.array([[1e-12]])
    assert link_angles(tiny, 0 * tiny)[0, 0] == pytest.approx(1e-12, rel=1e-9)


def test_the_box_corner_has_57_degrees() -> None:
    corner = np.array([[LIMIT]])
    assert np.rad2deg(link_angles(corner, corner)[0, 0]) == pytest.approx(
        57.1, abs=0.05
    )


def test_position_angle_keeps_the_quadrant_arctan_loses() -> None:
    a = np.deg2rad([[30.0]])
    zero = np.zeros((1, 1))
    assert position_angles(a, zero)[0, 0] == pytest.approx(0.0)
    assert abs(position_angles(-a, zero)[0, 0]) == pytest.approx(np.pi)
    assert position_angles(zero, a)[0, 0] == pytest.approx(-np.pi / 2)


def test_centres_a_link_length_apart_or_refused_by_name() -> None:
    x0, alpha, theta = samples("uniform", 3)
    centres = joint_centres(HRM8, x0, alpha, theta)
    centres[:2, 4] += [[1e-7, 0.0, 0.0], [1e-6, 0.0, 0.0]]
    with pytest.raises(WrongLinkLength, match=r"waypoint 1: o[45] and o") as caught:
        joint_angles(HRM8, centres)
    assert caught.value.link in (4, 5)


@pytest.mark.parametrize("where", [(0, 0, 0), (1, 4, 2), (2, 8, 1)])
def test_centres_that_are_no_numbers_are_refused_wherever(
    where: tuple[int, int, int],
) -> None:
    """A nan is no link length, whatever finite differences follow it."""
    centres = joint_centres(HRM8, *samples("uniform", 3))
    centres[where] = np.nan
    with pytest.raises(WrongLinkLength, match=f"waypoint {where[0]}: .* nan mm apart"):
        joint_angles(HRM8, centres)


@pytest.mark.parametrize("kind", KINDS)
def test_the_tips_jacobian_is_that_of_differences(kind: str) -> None:
    x0, alpha, theta = samples(kind, 20)
    found, step = tip_jacobian(HRM8, alpha, theta), 1e-6
    q = np.concatenate([x0[:, None], np.stack([alpha, theta], 2).reshape(20, -1)], 1)

    def tip(q: np.ndarray) -> np.ndarray:
        return joint_centres(HRM8, q[:, 0], q[:, 1::2], q[:, 2::2])[:, -1]

    for k, way in enumerate(step * np.eye(q.shape[1])):
        slope = (tip(q + way) - tip(q - way)) / (2.0 * step)
        np.testing.assert_allclose(found[:, :, k], slope, rtol=0, atol=1e-8)


def test_the_straight_arm_ends_at_its_tip() -> None:
    for tip in np.random.default_rng(9).uniform(-1.5, 1.5, (50, 3)):
        q = straight_joints(HRM8, tip)
        assert not q[3:].any()
        ends = joint_centres(HRM8, q[:1], q[None, 1::2], q[None, 2::2])[0, [0, -1]]
        np.testing.assert_allclose(ends[1], tip, rtol=0, atol=1e-12)
        assert ends[0, 0] < tip[0]
