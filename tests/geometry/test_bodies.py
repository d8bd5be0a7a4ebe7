"""Oracle: all corners of the zonotopes of a body."""

import numpy as np
import pytest

from vdsm_pin.geometry.bodies import body_reach, body_support, new_body


def test_the_support_is_taken_at_a_point_of_the_body() -> None:
    """Against all corners of both zonotopes."""
    rng, point = np.random.default_rng(3), np.zeros(3)
    for _ in range(100):
        body = new_body(4, 2, 5)
        body.points[:], body.swings[:] = (
            rng.normal(size=(4, 3)),
            rng.normal(size=(2, 5, 3)),
        )
        body.sizes[:], body.balls[:] = rng.integers(1, 6, 2), rng.uniform(0.0, 0.5, 2)
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        found = body_support(body, *n, point)
        assert found == pytest.approx(body_reach(body, *n), abs=1e-12)
        assert found == pytest.approx(n @ point, abs=1e-12)
        best = -np.inf
        for k in range(4):
            size = body.sizes[k % 2]
            sides = np.array(np.meshgrid(*[[-1.0, 1.0]] * size)).reshape(size, -1)
            corners = body.points[k] + sides.T @ body.swings[k % 2, :size]
            best = max(best, float((corners @ n).max()) + body.balls[k % 2])
        assert found == pytest.approx(best, abs=1e-12)
