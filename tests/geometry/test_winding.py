"""Crossings of rays and triangles; oracle: the linear system of ray and corners."""

import numpy as np

from vdsm_pin.geometry import winding


def test_crossings_in_doubt_are_those_of_the_linear_system() -> None:
    """A ray d meets a, b, c where d = x a + y b + z c with x, y, z above 0."""
    rng, met = np.random.default_rng(4), 0
    for _ in range(400):
        corners, point = rng.normal(size=(3, 3)), rng.normal(size=3)
        ray = corners.mean(axis=0) - point if rng.integers(2) else rng.normal(size=3)
        seen = corners - point
        shares = np.linalg.solve(seen.T, ray)
        found = winding._View(corners[None], point)._exact(0, ray)
        assert found is not None
        if not (shares > 0.0).all():
            assert found == (0, 0.0)
            continue
        met += 1
        assert found[0] == np.sign(np.linalg.det(seen))
        np.testing.assert_allclose(found[1], 1.0 / shares.sum(), rtol=1e-9)
    assert met > 150
