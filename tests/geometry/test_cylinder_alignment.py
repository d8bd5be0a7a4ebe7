"""Cylinders seen almost along their axis: points stay in the solid, boxes hold it."""

import numpy as np
import pytest

from vdsm_pin.geometry.arrays import turn_z_to
from vdsm_pin.geometry.convex import FlatCylinder
from vdsm_pin.geometry.kernels import piece_support
from vdsm_pin.geometry.pieces import pack_pieces

TILTS = [0.0, 1e-17, 1e-16, 1e-15, 1e-12, 1e-9, 1e-8, 1e-6, 1e-3]


@pytest.mark.parametrize("tilt", TILTS)
def test_a_support_point_lies_in_the_cylinder(tilt: float) -> None:
    rng = np.random.default_rng(5)
    for _ in range(200):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        side = np.cross(axis, rng.normal(size=3))
        n = axis * rng.choice([-1.0, 1.0]) + tilt * side / np.linalg.norm(side)
        n /= np.linalg.norm(n)
        pieces = pack_pieces([[FlatCylinder(np.zeros(3), axis, 0.3, 0.2)]])
        point = np.zeros(3)
        least = piece_support(pieces, 0, *map(float, n), point)
        along = float(point @ axis)
        assert abs(along) <= 0.3 + 1e-15
        assert np.linalg.norm(point - along * axis) <= 0.2 + 1e-15
        assert float(point @ n) == pytest.approx(least, abs=1e-14)


@pytest.mark.parametrize("tilt", TILTS)
def test_a_box_holds_a_cylinder_tilted_by_a_hair(tilt: float) -> None:
    """Its rim reaches h cos(tilt) + r sin(tilt) along the axis it almost has."""
    axis = np.array([np.sin(tilt), 0.0, np.cos(tilt)])
    pieces = pack_pieces([[FlatCylinder(np.zeros(3), axis, 0.3, 2.0)]])
    reach = 0.3 * np.cos(tilt) + 2.0 * np.sin(tilt)
    assert pieces.node_high[0, 2] >= reach
    assert pieces.node_low[0, 2] <= -reach


def test_a_turn_of_z_is_that_of_cross_products() -> None:
    """To the last bit; along the coordinate axes too."""
    axes = np.random.default_rng(0).normal(size=(50, 3))
    for axis in [*(axes / np.linalg.norm(axes, axis=1)[:, None]), *np.eye(3)]:
        x = np.cross(np.eye(3)[np.argmin(np.abs(axis))], axis)
        x /= np.linalg.norm(x)
        expected = np.stack([x, np.cross(axis, x), axis], axis=1)
        np.testing.assert_array_equal(turn_z_to(axis), expected)
