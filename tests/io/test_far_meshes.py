"""A mesh far from its own origin, put back beside the base."""

import numpy as np
import pytest

from vdsm_pin.io.frames import Frame


@pytest.mark.parametrize("axis", range(3))
def test_a_mesh_far_along_one_axis_is_placed_as_exactly_as_a_near_one(
    axis: int,
) -> None:
    """Its other coordinates are 0; a quarter turn about z is exact."""
    frame = Frame("m", np.eye(3), np.zeros(3))
    corners = np.array([[0.0, 0.0, 0.0], [0.7, 0.0, 0.0], [0.0, 0.3, 0.1]])
    far = 2.0**36 * np.eye(3)[axis]
    turn = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    there = np.round((far + corners) * 2.0**10) / 2.0**10
    found = frame.placed(there, 1.0, [0.0, 0.0, 90.0], (-turn @ far).tolist())
    np.testing.assert_allclose(found, (there - far) @ turn.T, rtol=0.0, atol=1e-12)
