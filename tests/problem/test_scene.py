"""Obstacles: what they refuse, and that their pieces are the solid they claim."""

from collections.abc import Callable

import numpy as np
import pytest
import shapely

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.geometry.solids import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Mesh,
    Prism,
    Sphere,
)
from vdsm_pin.problem.scene import Obstacle, Scene, with_hulls

EYE = np.eye(3)
L_SHAPE = [[0, 0], [2, 0], [2, 1], [1, 1], [1, 3], [0, 3]]


def prism(polygon: object, span: tuple[float, float] = (0.0, 1.0)) -> Prism:
    return Prism("p", np.zeros(3), EYE, np.asarray(polygon, dtype=float), span)


def test_duplicate_names_are_refused() -> None:
    ball = Sphere("a", np.zeros(3), 1.0)
    with pytest.raises(InvalidInput, match="'a'"):
        Scene((ball, ball))


UP = np.array([0.0, 0.0, 1.0])
FAR = np.array([60.0, 79.0, 0.0])  # 99.2 m away


@pytest.mark.parametrize(
    ("inside", "outside"),
    [
        (Sphere("a", FAR, 0.79), Sphere("a", FAR, 0.81)),
        (
            Capsule("a", 0.0 * FAR, UP, 99.0, 0.9),
            Capsule("a", 0.0 * FAR, UP, 99.0, 1.1),
        ),
        (Cylinder("a", FAR, UP, 9.0, 0.3), Cylinder("a", FAR, UP, 15.0, 0.3)),
        (Box("a", FAR, EYE, np.full(3, 0.45)), Box("a", FAR, EYE, np.full(3, 0.9))),
        (
            Prism("a", FAR, EYE, np.array([[0, 0], [0.1, 0], [0, 0.1]]), (0.0, 11.0)),
            Prism("a", FAR, EYE, np.array([[0, 0], [0.1, 0], [0, 0.1]]), (-14.0, 0.0)),
        ),
        (HalfSpace("a", 100 * UP, UP), HalfSpace("a", 100.1 * UP, UP)),
        (
            Mesh("a", np.array([FAR, -UP, UP]), np.array([[0, 1, 2]])),
            Mesh("a", np.array([FAR, -101 * UP, UP]), np.array([[0, 1, 2]])),
        ),
    ],
    ids=["sphere", "capsule", "cylinder", "box", "prism", "half-space", "mesh"],
)
def test_a_scene_reaches_as_far_as_distances_are_proved(
    inside: Obstacle, outside: Obstacle
) -> None:
    assert Scene((inside,)).names == ("a",)
    with pytest.raises(InvalidInput, match=r"'a' reaches 1\d\d.* m from the base"):
        Scene((outside,))


def test_the_hull_of_a_mesh_is_that_of_its_triangles() -> None:
    rng = np.random.default_rng(0)
    vertices = np.vstack([rng.normal(size=(30, 3)), np.full((1, 3), 50.0)])
    mesh = Mesh("a", vertices, rng.integers(0, 30, (60, 3)))
    scene = Scene((mesh, Sphere("b", np.zeros(3), 1.0)))
    cover, ball = with_hulls(scene, ["a", "b"]).obstacles
    assert (cover.name, ball) == ("a", scene.obstacles[1])
    (hull,) = cover.pieces
    used = vertices[np.unique(mesh.triangles)]
    for n in rng.normal(size=(50, 3)):
        assert (hull.points @ n).max() == (used @ n).max()
    assert len(hull.points) == len(used)
    assert with_hulls(scene, ["b"]).obstacles == scene.obstacles


@pytest.mark.parametrize("radius", [0.0, -1.0, np.nan, np.inf])
def test_radius_must_be_positive_and_finite(radius: float) -> None:
    with pytest.raises(InvalidInput, match="radius"):
        Sphere("a", np.zeros(3), radius)


@pytest.mark.parametrize(
    ("make", "expected"),
    [
        (lambda: HalfSpace("a", UP, 2.0 * UP), "normal is .*, expected a unit vector"),
        (lambda: Capsule("a", UP, 0.0 * UP, 1.0, 1.0), "axis is .* a unit vector"),
        (lambda: Cylinder("a", UP, 0.1 * UP, 1.0, 1.0), "axis is .* a unit vector"),
        (lambda: Box("a", UP, 0.3 * EYE, UP + 1.0), "rotation is .* a rotation"),
        (lambda: Box("a", UP, np.diag([1.0, 1.0, -1.0]), UP + 1.0), "a rotation"),
        (lambda: Box("a", UP, EYE, np.array(1.0)), "half_size has shape"),
        (lambda: Sphere("a", UP[:2], 1.0), r"shape \(2,\), expected \(3,\)"),
        (lambda: Sphere("a", UP, np.ones(2)), r"radius has shape \(2,\)"),
        (lambda: Mesh("a", EYE, np.array([[0, 1, 1.5]])), "expected whole numbers"),
        (lambda: Mesh("a", EYE[:, :2], np.array([[0, 1, 2]])), "vertices have shape"),
        (lambda: Mesh("a", EYE, np.array([0, 1, 2])), "triangles have shape"),
    ],
)
def test_numbers_that_are_another_solid_are_refused(
    make: Callable[[], Obstacle], expected: str
) -> None:
    """A scaled normal scales distances, a scaled rotation makes a smaller box."""
    with pytest.raises(InvalidInput, match=expected):
        make()


def test_a_self_crossing_polygon_is_refused() -> None:
    with pytest.raises(InvalidInput, match="not simple"):
        prism([[0, 0], [1, 1], [1, 0], [0, 1]])


def test_convex_prism_is_one_piece_with_all_corners() -> None:
    (piece,) = prism([[0, 0], [1, 0], [0, 1]], (2.0, 5.0)).pieces
    assert isinstance(piece, Hull)
    assert piece.points.shape == (6, 3)
    assert set(piece.points[:, 2]) == {2.0, 5.0}


def test_non_convex_prism_pieces_tile_the_section() -> None:
    sections = [shapely.Polygon(s) for s in prism(L_SHAPE).convex_sections]
    assert len(sections) > 1
    union = shapely.union_all(sections)
    assert union.symmetric_difference(shapely.Polygon(L_SHAPE)).area == 0.0
    assert sum(s.area for s in sections) == pytest.approx(union.area)


def test_box_corners_follow_its_rotation() -> None:
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    (piece,) = Box("b", np.ones(3), turn, np.array([1.0, 2, 3])).pieces
    assert isinstance(piece, Hull)
    np.testing.assert_allclose(np.ptp(piece.points, axis=0), [4, 2, 6])


def test_capsule_piece_is_its_segment_grown() -> None:
    (piece,) = Capsule("c", np.zeros(3), np.array([0.0, 1, 0]), 0.5, 0.1).pieces
    assert isinstance(piece, Hull)
    assert piece.radius == 0.1
    np.testing.assert_array_equal(piece.points, [[0, -0.5, 0], [0, 0.5, 0]])


def test_mesh_indices_must_exist() -> None:
    with pytest.raises(InvalidInput, match="index"):
        Mesh("m", np.zeros((3, 3)), np.array([[0, 1, 3]]))
