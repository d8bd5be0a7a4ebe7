"""Links next to each other: why nothing but their joint is left unchecked."""

import numpy as np
import pytest

from vdsm_pin.arm.bodies import arm_bodies, self_pairs
from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.manipulator import Manipulator


def test_axes_part_at_least_as_fast_as_they_leave_their_joint() -> None:
    """The sentence of docs/files.md, for a million places and angles below 90 deg."""
    rng = np.random.default_rng(0)
    n = 1_000_000
    psi = np.where(rng.random(n) < 0.3, np.pi / 2 - 1e-9, rng.uniform(0, np.pi / 2, n))
    s, t = rng.exponential(1.0, (2, n))
    # One axis comes in along x, s before the joint; the other goes out at an angle psi.
    apart = np.hypot(s + t * np.cos(psi), t * np.sin(psi))
    assert (apart >= np.maximum(s, t) * (1.0 - 1e-12)).all()


@pytest.mark.parametrize("radius", [0.02, 0.09])
@pytest.mark.parametrize("cone", [40.0, 89.9])
def test_thick_links_with_large_cones_leave_out_their_joints_alone(
    radius: float, cone: float
) -> None:
    arm = Manipulator(
        "thick",
        np.full(4, 0.2),
        radius,
        np.deg2rad(cone),
        np.deg2rad(cone),
        (-1.0, 1.0),
        CableLayout(0.8 * radius, 0.02, paper_hole_angles(4)),
    )
    pairs = self_pairs(arm, arm_bodies(arm))
    held = {tuple(sorted(pair)) for pair in pairs.held.tolist()}
    assert held == {(0, 2), (0, 3), (1, 3)}
    assert [row.reason for row in pairs.left_out] == [
        f"meet at joint {joint} in every pose" for joint in (2, 3, 4)
    ]
    # What touches of two neighbours, in any pose, is within their radii of the joint.
    rng = np.random.default_rng(1)
    s, t = rng.uniform(0.0, 0.2, (2, 100_000))
    psi = rng.uniform(0.0, np.deg2rad(cone), 100_000)
    apart = np.hypot(s + t * np.cos(psi), t * np.sin(psi))
    assert np.maximum(s, t)[apart <= 2.0 * radius].max() <= 2.0 * radius
