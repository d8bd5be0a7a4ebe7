"""Cable lengths against Eq. 16-19 point by point, and angles back from lengths."""

from dataclasses import replace

import flint
import numpy as np
import pytest
from flint import arb
from hypothesis import given, settings
from hypothesis import strategies as st

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.cables import angles_from_cables, cable_lengths
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.arm.mounted import Tool
from vdsm_pin.errors import InconsistentCables, InvalidInput
from vdsm_pin.tolerances import TOLERANCES

HRM8 = built_in("hrm8")
BOX = HRM8.max_joint_angle


def arm_with(layout: CableLayout, box: float = BOX) -> Manipulator:
    n_links = len(layout.hole_angles)
    rng = np.random.default_rng(n_links)
    lengths = rng.uniform(0.2, 0.5, n_links)
    return Manipulator("any", lengths, 0.06, box, box, (-1.0, 1.0), layout)


def sampled(
    kind: str, arm: Manipulator, n: int, seed: int = 1
) -> tuple[np.ndarray, np.ndarray]:
    rng, box = np.random.default_rng(seed), arm.max_joint_angle
    shape = (2, n, arm.n_links)
    if kind == "uniform":
        alpha, theta = rng.uniform(-box, box, shape)
    elif kind == "on_limit":
        alpha, theta = box * rng.choice([-1.0, 0.0, 1.0], shape)
    else:
        alpha, theta = rng.uniform(-1e-7, 1e-7, shape)
    return alpha, theta


KINDS = ["uniform", "on_limit", "degenerate"]


def lengths_by_points(
    arm: Manipulator, alpha: np.ndarray, theta: np.ndarray
) -> np.ndarray:
    """Eq. 16-19 and 21 as printed, hole by hole, for one configuration."""
    cables = arm.cables
    d, r = cables.half_gap, cables.hole_radius
    lengths = np.zeros((arm.n_links, 3))
    for j in range(arm.n_links):
        for hole in range(3):
            phi = cables.hole_angles[j, hole]
            for i in range(j + 1):
                ca, sa = np.cos(alpha[i]), np.sin(alpha[i])
                ct, st_ = np.cos(theta[i]), np.sin(theta[i])
                T = np.array(
                    [
                        [ca * ct, -sa, ca * st_, 0.0],
                        [sa * ct, ca, sa * st_, 0.0],
                        [-st_, 0.0, ct, 0.0],
                        [0.0, 0.0, 0.0, 1.0],
                    ]
                )
                before = np.array([-d, r * np.sin(phi), r * np.cos(phi), 1.0])
                after = np.array([d, r * np.sin(phi), r * np.cos(phi), 1.0])
                span = np.linalg.norm((T @ after - before)[:3])
                lengths[j, hole] += span + arm.link_lengths[i] - 2.0 * d
    return lengths


@pytest.mark.parametrize("tool", [None, Tool(0.2, 0.01)])
@pytest.mark.parametrize("kind", KINDS)
def test_lengths_are_those_of_equations_16_to_21(kind: str, tool: Tool | None) -> None:
    """Of the links; no cable runs on along a tool behind the last one."""
    alpha, theta = sampled(kind, HRM8, 12)
    lengths = HRM8.link_lengths + (0.2 if tool else 0.0) * np.eye(8)[7]
    arm = replace(HRM8, link_lengths=lengths, tool=tool)
    found = cable_lengths(arm, alpha, theta)
    assert found.shape == (12, 8, 3)
    for k in range(12):
        by_points = lengths_by_points(HRM8, alpha[k], theta[k])
        np.testing.assert_allclose(found[k], by_points, rtol=0, atol=1e-14)


def test_one_joint_is_equation_20_as_printed() -> None:
    rng = np.random.default_rng(2)
    alpha, theta = rng.uniform(-BOX, BOX, (2, 50, 8))
    alpha[:, 1:] = theta[:, 1:] = 0.0
    d, r = HRM8.cables.half_gap, HRM8.cables.hole_radius
    a, t = alpha[:, :1], theta[:, :1]
    phi = HRM8.cables.hole_angles[0]
    ca, sa, ct, st_ = np.cos(a), np.sin(a), np.cos(t), np.sin(t)
    cp, sp = np.cos(phi), np.sin(phi)
    squared = (
        (d * ca * ct - r * sa * sp + r * ca * st_ * cp + d) ** 2
        + (d * sa * ct + r * ca * sp + r * sa * st_ * cp - r * sp) ** 2
        + (-d * st_ + r * ct * cp - r * cp) ** 2
    )
    expected = np.sqrt(squared) + HRM8.link_lengths[0] - 2.0 * d
    found = cable_lengths(HRM8, alpha, theta)[:, 0]
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-15)


def test_straight_cables_are_as_long_as_the_arm() -> None:
    found = cable_lengths(HRM8, np.zeros((1, 8)), np.zeros((1, 8)))
    expected = np.repeat(HRM8.stations[1:, None], 3, axis=1)
    np.testing.assert_allclose(found[0], expected, rtol=0, atol=1e-15)


def test_a_cable_shortens_on_the_side_its_link_turns_to() -> None:
    """Differences at the straight arm: dl is -r sin phi dalpha + r cos phi dtheta."""
    step = 1e-6
    r, phi = HRM8.cables.hole_radius, HRM8.cables.hole_angles
    for i in range(8):
        turn = np.zeros((2, 8))
        turn[:, i] = step, -step
        zero = np.zeros((2, 8))
        by_alpha = cable_lengths(HRM8, turn, zero)
        by_theta = cable_lengths(HRM8, zero, turn)
        slope_alpha = (by_alpha[0] - by_alpha[1]) / (2.0 * step)
        slope_theta = (by_theta[0] - by_theta[1]) / (2.0 * step)
        np.testing.assert_allclose(slope_alpha[i:], -r * np.sin(phi[i:]), atol=1e-8)
        np.testing.assert_allclose(slope_theta[i:], r * np.cos(phi[i:]), atol=1e-8)
        np.testing.assert_allclose(slope_alpha[:i], 0.0, atol=1e-8)


def test_published_hole_angles() -> None:
    holes = np.rad2deg(paper_hole_angles(8))
    published = {(5, "b"): 0.0, (6, "b"): 15.0, (1, "a"): 180.0, (4, "b"): 345.0}
    for (link, hole), degrees in published.items():
        found = holes[link - 1, "abc".index(hole)]
        assert min(abs(found - degrees), 360.0 - abs(found - degrees)) < 1e-9
    turns = np.round(holes.ravel() / 15.0).astype(int) % 24
    assert sorted(turns) == list(range(24))
    np.testing.assert_allclose(holes.ravel(), 15.0 * np.round(holes.ravel() / 15.0))


@pytest.mark.parametrize("kind", KINDS)
def test_angles_come_back_from_the_lengths(kind: str) -> None:
    alpha, theta = sampled(kind, HRM8, 3000)
    again = angles_from_cables(HRM8, cable_lengths(HRM8, alpha, theta))
    limit = TOLERANCES.cable_round_trip
    np.testing.assert_allclose(again[0], alpha, rtol=0, atol=limit)
    np.testing.assert_allclose(again[1], theta, rtol=0, atol=limit)


@pytest.mark.parametrize("n_links", [2, 3, 13, 40])
def test_angles_come_back_on_any_number_of_links(n_links: int) -> None:
    layout = CableLayout(0.05, 0.03, paper_hole_angles(n_links))
    for kind in KINDS:
        arm = arm_with(layout)
        alpha, theta = sampled(kind, arm, 200)
        again = angles_from_cables(arm, cable_lengths(arm, alpha, theta))
        limit = TOLERANCES.cable_round_trip
        np.testing.assert_allclose(again[0], alpha, rtol=0, atol=limit)
        np.testing.assert_allclose(again[1], theta, rtol=0, atol=limit)


@settings(deadline=None, max_examples=200)
@given(
    radius=st.floats(0.005, 0.3),
    gap_ratio=st.floats(0.2, 3.0),
    reach=st.floats(0.05, 0.98),
    first=st.floats(0.0, 2.0 * np.pi),
    spread=st.tuples(st.floats(0.5, 2.6), st.floats(0.5, 2.6)),
    seed=st.integers(0, 2**32 - 1),
)
def test_angles_come_back_over_the_stated_domain(
    radius: float,
    gap_ratio: float,
    reach: float,
    first: float,
    spread: tuple[float, float],
    seed: int,
) -> None:
    """Any holes at least 30 deg apart, any r and d, all of tan(psi / 2) < d / r."""
    rng = np.random.default_rng(seed)
    layout = CableLayout(
        radius,
        gap_ratio * radius,
        first + rng.uniform(0.0, 6.0, (4, 1)) + [0.0, spread[0], sum(spread)],
    )
    arm = arm_with(layout)
    psi = min(2.0 * np.arctan(gap_ratio), 1.1) * reach
    tilt, gamma = psi * np.sqrt(rng.uniform(size=(50, 4))), rng.uniform(-4, 4, (50, 4))
    theta = np.arcsin(np.sin(tilt) * np.sin(gamma))
    alpha = np.arctan2(np.sin(tilt) * np.cos(gamma), np.cos(tilt))
    again = angles_from_cables(arm, cable_lengths(arm, alpha, theta))
    limit = TOLERANCES.cable_round_trip
    np.testing.assert_allclose(again[0], alpha, rtol=0, atol=limit)
    np.testing.assert_allclose(again[1], theta, rtol=0, atol=limit)


def test_rounding_stays_small_against_ball_arithmetic() -> None:
    rng = np.random.default_rng(6)
    alpha, theta = rng.uniform(-BOX, BOX, (2, 3, 8))
    found = cable_lengths(HRM8, alpha, theta)
    with flint.ctx.workprec(120):
        d, r = arb(HRM8.cables.half_gap), arb(HRM8.cables.hole_radius)
        for k, hole in np.ndindex(3, 3):
            phi = arb(float(HRM8.cables.hole_angles[7, hole]))
            y, z = r * phi.sin(), r * phi.cos()
            total = arb(0)
            for i in range(8):
                a, t = arb(float(alpha[k, i])), arb(float(theta[k, i]))
                ahead, up = d * t.cos() + z * t.sin(), z * t.cos() - d * t.sin()
                x_span = ahead * a.cos() - y * a.sin() + d
                y_span = ahead * a.sin() + y * a.cos() - y
                span = (x_span**2 + y_span**2 + (up - z) ** 2).sqrt()
                total += span + arb(float(HRM8.link_lengths[i])) - 2 * d
            assert abs(found[k, 7, hole] - float(total)) < 2e-15


@pytest.mark.parametrize("link", [1, 5, 8])
def test_contradicting_lengths_are_refused_by_link(link: int) -> None:
    alpha, theta = sampled("uniform", HRM8, 2000)
    lengths = cable_lengths(HRM8, alpha, theta)
    lengths[1500, link - 1] += [1e-9, 0.0, 0.0]
    with pytest.raises(InconsistentCables) as caught:
        angles_from_cables(HRM8, lengths)
    assert (caught.value.waypoint, caught.value.link) == (1500, link)
    assert caught.value.residual > caught.value.tolerance
    assert f"waypoint 1500: the cable lengths of link {link} fit no" in str(
        caught.value
    )


@pytest.mark.parametrize("bad", [np.nan, np.inf, 0.0, -1.0, 1e300])
def test_impossible_lengths_are_refused(bad: float) -> None:
    lengths = cable_lengths(HRM8, *np.zeros((2, 4, 8)))
    lengths[2, 3, 1] = bad
    with pytest.raises(InconsistentCables, match=r"waypoint 2: .* link 4"):
        angles_from_cables(HRM8, lengths)


def test_shape_of_lengths_is_checked() -> None:
    with pytest.raises(InvalidInput, match=r"\(5, 7, 3\), expected \(n, 8, 3\)"):
        angles_from_cables(HRM8, np.zeros((5, 7, 3)))


def test_no_samples_are_no_problem() -> None:
    lengths = cable_lengths(HRM8, np.zeros((0, 8)), np.zeros((0, 8)))
    assert lengths.shape == (0, 8, 3)
    assert angles_from_cables(HRM8, lengths)[0].shape == (0, 8)


def test_rows_do_not_depend_on_their_neighbours() -> None:
    alpha, theta = sampled("uniform", HRM8, 1300)
    lengths = cable_lengths(HRM8, alpha, theta)
    alone = cable_lengths(HRM8, alpha[700:701], theta[700:701])
    np.testing.assert_allclose(lengths[700:701], alone, rtol=0, atol=1e-15)
