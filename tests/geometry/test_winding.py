"""Crossings of rays and triangles; oracle: the linear system of ray and corners."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from oracles.closed_solids import exactly, solid, tetrahedron_at_a_ray

from vdsm_pin.geometry import winding
from vdsm_pin.geometry.winding import Side


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


@pytest.mark.parametrize("seed", range(6))
def test_hits_are_those_of_exact_arithmetic(seed: int) -> None:
    """Rays past, at and beside edges and corners; points also in planes of faces."""
    rng = np.random.default_rng([5, seed])
    corners, counts = solid(rng), np.zeros(3, np.int64)
    corners = corners[rng.choice(len(corners), min(12, len(corners)), replace=False)]
    corners = np.rint(64.0 * corners) / 64.0  # differences are exact
    face = corners[rng.integers(len(corners))]
    points = [
        *rng.uniform(-1.2, 1.2, (2, 3)),
        face.mean(axis=0),
        2.0 * face[1] - face[0],
    ]
    for point in np.rint(64.0 * np.array(points)) / 64.0:
        view = winding._View(corners, point)
        aims = [*(corners[rng.integers(len(corners), size=3)] @ np.eye(3))[:, 0]]
        aims += [
            corners[k, :2].mean(axis=0) for k in rng.integers(len(corners), size=3)
        ]
        aims += [one + 1e-16 * rng.normal(size=3) for one in aims]
        rays = [aim - point for aim in aims if (aim != point).any()]
        for ray in [*rays, *(-ray for ray in rays), *winding.RAYS[:3]]:
            exact = [view._exact(k, ray) for k in range(len(corners))]
            found = view.hits(ray)
            counts[0] += found is None
            if None in exact:
                assert found is None
                continue
            assert found is not None
            met = [(k, *one) for k, one in enumerate(exact) if one and one[0]]
            order = np.argsort(found.triangle)
            told = [part[order] for part in found]
            assert [*zip(told[0].tolist(), told[1].tolist(), strict=True)] == [
                one[:2] for one in met
            ]
            np.testing.assert_allclose(told[2], [one[2] for one in met], rtol=1e-9)
            counts[1 if met else 2] += 1
    assert (counts > 0).all()


def test_signs_that_rounding_may_turn_are_those_of_exact_arithmetic() -> None:
    """Rays that pass an edge within rounding; of corners whose differences round."""
    rng, crossed = np.random.default_rng(8), 0
    for _ in range(300):
        corners, point = rng.normal(size=(1, 3, 3)), rng.normal(size=3)
        share = rng.uniform()
        ray = share * corners[0, 0] + (1.0 - share) * corners[0, 1] - point
        view = winding._View(corners, point)
        exact, found = view._exact(0, ray), view.hits(ray)
        if exact is None:
            assert found is None
            continue
        assert found is not None
        assert found.sense.tolist() == [exact[0]] * bool(exact[0])
        crossed += bool(exact[0])
    assert 100 < crossed < 200


def test_tetrahedra_of_which_a_ray_meets_an_edge_are_wound_round_exactly() -> None:
    """Of corners near and far; doubles leave many a sign in doubt."""
    rng, counts = np.random.default_rng(11), np.zeros(2, int)
    for _ in range(150):
        corners, point = tetrahedron_at_a_ray(rng)
        inside, faces = exactly(corners, point)
        view = winding._View(faces, point)
        hits = [one for ray in winding.RAYS if (one := view.hits(ray)) is not None]
        counts[int(inside)] += 1
        assert all(one.sense.sum() == inside for one in hits)
        assert len(hits) >= winding.N_RAYS - 3
    assert (counts > 5).all()


def test_rays_are_spread_over_all_directions() -> None:
    rays = winding.RAYS
    assert rays.shape == (winding.N_RAYS, 3)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=1), 1.0)
    any_way = np.random.default_rng(6).normal(size=(2000, 3))
    any_way /= np.linalg.norm(any_way, axis=1)[:, None]
    assert np.arccos((any_way @ rays.T).max(axis=1)).max() < 0.55


@pytest.mark.parametrize(
    ("seen", "turned", "signed", "side", "why"),
    [
        (set(), False, True, Side.UNKNOWN, "lies on its surface"),
        ({1}, True, True, Side.UNKNOWN, "faces that are given in both senses"),
        ({1}, False, False, Side.UNKNOWN, "faces are turned opposite ways"),
        ({1, -1}, False, True, Side.UNKNOWN, "fronts of its faces as well as backs"),
        ({1}, False, True, Side.OUTSIDE, ""),
        ({-1}, False, True, Side.OUTSIDE, ""),
    ],
)
def test_what_keeps_the_inside_from_being_told(
    seen: set[int], turned: bool, signed: bool, side: Side, why: str
) -> None:
    mesh: Any = SimpleNamespace(turned=turned, signed=np.array([signed, False]))
    found = winding._enclosed(mesh, seen)
    assert found.side is side
    assert why in found.reason
    assert bool(found.reason) is (side is Side.UNKNOWN)
