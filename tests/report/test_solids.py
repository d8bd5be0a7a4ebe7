"""Oracle: volumes in closed form; one wrongly turned triangle changes the sum."""

import numpy as np
import pinocchio
import pytest
from made_up import X, Y, every_shape

from vdsm_pin.geometry.arrays import quaternions, rotation_from_quaternion
from vdsm_pin.geometry.solids import Box, Capsule, Cylinder, HalfSpace, Mesh, Sphere
from vdsm_pin.problem.scene import Obstacle
from vdsm_pin.report.solids import Surface, detail, surface


def volume(skin: Surface) -> float:
    a, b, c = np.moveaxis(skin.vertices[skin.triangles], 1, 0)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6.0)


CENTRE = np.array([0.3, -0.2, 1.1])
TILTED = np.array([1.0, 2.0, -2.0]) / 3.0


@pytest.mark.parametrize(
    ("solid", "expected", "tolerance"),
    [
        (Sphere("s", CENTRE, 0.5), 4.0 / 3.0 * np.pi * 0.125, 0.02),
        (Cylinder("c", CENTRE, TILTED, 0.7, 0.3), np.pi * 0.09 * 1.4, 0.01),
        (
            Capsule("k", CENTRE, TILTED, 0.7, 0.3),
            np.pi * 0.09 * 1.4 + 4.0 / 3.0 * np.pi * 0.027,
            0.02,
        ),
        (Box("b", CENTRE, np.eye(3), np.array([0.1, 0.2, 0.3])), 0.048, 1e-12),
    ],
)
def test_surfaces_enclose_their_solid(
    solid: Obstacle, expected: float, tolerance: float
) -> None:
    assert volume(surface(solid, 1.0)) == pytest.approx(expected, rel=tolerance)


@pytest.mark.parametrize("count", [1, 20, 100, 500])
def test_many_obstacles_share_what_a_page_can_hold(count: int) -> None:
    fine = detail(count)
    ball = surface(Sphere("s", CENTRE, 0.5), 1.0, fine)
    assert count * len(ball.triangles) <= 60_000
    assert volume(ball) == pytest.approx(4.0 / 3.0 * np.pi * 0.125, rel=0.2)


def test_a_prism_keeps_its_notch() -> None:
    angle = next(o for o in every_shape().obstacles if o.name == "angle")
    skin = surface(angle, 1.0)
    spans = np.ptp(skin.vertices, axis=0)
    np.testing.assert_allclose(spans, [0.5, 0.5, 0.6], atol=1e-12)
    corners = skin.vertices[skin.triangles]
    areas = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    walls, caps = 2.0 * 0.6, 2.0 * (0.25 - 0.09)
    assert areas.sum() / 2.0 == pytest.approx(walls + caps)


def test_a_half_space_is_drawn_on_its_plane() -> None:
    skin = surface(HalfSpace("w", CENTRE, TILTED), 2.0)
    np.testing.assert_allclose((skin.vertices - CENTRE) @ TILTED, 0.0, atol=1e-12)
    a, b, c = skin.vertices[skin.triangles[0]]
    assert np.cross(b - a, c - a) @ TILTED > 0.0


def test_quaternions_are_those_of_pinocchio() -> None:
    """Among them half turns and turns that differ from these by rounding."""
    rng = np.random.default_rng(0)
    axes = np.vstack([np.eye(3), rng.normal(size=(97, 3))])
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    angles = np.r_[np.pi, np.pi, np.pi, np.pi - 1e-9, 0.0, rng.uniform(0.0, 6.3, 95)]
    turns = np.array(
        [pinocchio.AngleAxis(*one).matrix() for one in zip(angles, axes, strict=True)]
    )
    found = quaternions(turns.reshape(20, 5, 3, 3)).reshape(100, 4)
    for turn, quaternion in zip(turns, found, strict=True):
        expected = pinocchio.Quaternion(turn).coeffs()
        assert abs(expected @ quaternion) == pytest.approx(1.0, abs=1e-15)
        back = rotation_from_quaternion(quaternion)
        np.testing.assert_allclose(back, turn, rtol=0, atol=1e-15)


def test_a_large_mesh_is_drawn_with_few_triangles() -> None:
    n = 150
    grid = np.stack(np.meshgrid(np.arange(n), np.arange(n)), axis=2).reshape(-1, 2)
    points = np.column_stack([grid / n, np.zeros(len(grid))])
    k = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    faces = np.vstack(
        [np.stack([k, k + 1, k + n], 1), np.stack([k + 1, k + n + 1, k + n], 1)]
    )
    skin = surface(Mesh("m", points @ np.stack([X, Y, X + Y]), faces), 1.0)
    assert 1_000 < len(skin.triangles) <= 20_000
