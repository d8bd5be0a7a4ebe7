"""Faces to triangles: an exact cover by the face's own corners, whatever its shape.

Oracles: areas and point location of shapely, volumes of prisms, counting edges.
"""

import numpy as np
import pytest
import shapely
import trimesh

from vdsm_pin.geometry.closed_meshes import close_mesh
from vdsm_pin.io.meshes.faces import cut_faces

SQUARE_WITH_HOLE = [
    *([0, 0], [3, 0], [3, 3], [0, 3], [0, 0]),
    *([1, 1], [1, 2], [2, 2], [2, 1], [1, 1]),
]
U = [[-3, -3], [0, -3], [3, -3], [3, 3], [1, 3], [1, -1], [-1, -1], [-1, 3], [-3, 3]]


def rotation(rng: np.random.Generator) -> np.ndarray:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    return q * np.sign(np.diag(r))


def star(rng: np.random.Generator) -> np.ndarray:
    """A polygon seen whole from its middle, some corners in line with others."""
    n = int(rng.integers(4, 40))
    turns = np.sort(rng.uniform(0, 2 * np.pi, n))
    radii = rng.uniform(0.2, 1.0, n)
    corners = np.column_stack([np.cos(turns), np.sin(turns)]) * radii[:, None]
    middles = (corners + np.roll(corners, -1, axis=0)) / 2
    keep = rng.uniform(size=n) < 0.3
    return np.concatenate(
        [
            [a, b] if both else [a]
            for a, b, both in zip(corners, middles, keep, strict=True)
        ]
    )


def comb(rng: np.random.Generator) -> np.ndarray:
    """Teeth on a bar, all on a grid: many corners in line."""
    heights = np.repeat(rng.integers(1, 6, int(rng.integers(2, 12))), 2)
    across = np.repeat(np.arange(len(heights) // 2 + 1), 2)[1:-1]
    top = np.column_stack([across, heights])[::-1]
    bottom = np.column_stack([np.arange(top[0, 0] + 1), np.zeros(int(top[0, 0]) + 1)])
    return np.concatenate([bottom, top]).astype(float)


def spiral(rng: np.random.Generator) -> np.ndarray:
    turns = np.linspace(0, float(rng.uniform(4, 20)), int(rng.integers(8, 80)))
    arm = np.column_stack([np.cos(turns), np.sin(turns)])
    outer = arm * (1.0 + turns)[:, None]
    return np.concatenate([outer, (arm * (0.6 + turns)[:, None])[::-1]])


def embedded(polygon: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    turned = np.column_stack([polygon, np.zeros(len(polygon))]) @ rotation(rng).T
    return turned + rng.uniform(-5, 5, 3)


def cut(points: np.ndarray) -> np.ndarray:
    """The triangles of one face."""
    found = cut_faces(points, np.arange(len(points)), np.array([len(points)]))
    different = (points != np.roll(points, 1, axis=0)).any(axis=1).sum()
    assert not found.crossed
    assert len(found.triangles) == different - 2
    return found.triangles


def areas(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    a, b, c = np.moveaxis(points[triangles], 1, 0)
    return np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2


@pytest.mark.parametrize("make", [star, comb, spiral])
@pytest.mark.parametrize("seed", range(25))
def test_any_simple_polygon_in_any_pose_is_covered_once(make, seed: int) -> None:
    rng = np.random.default_rng(seed)
    polygon = make(rng)
    if rng.uniform() < 0.5:
        polygon = polygon[::-1]
    polygon = np.roll(polygon, int(rng.integers(len(polygon))), axis=0)
    shape = shapely.Polygon(polygon)
    assert shape.is_valid
    points = embedded(polygon, rng)
    triangles = cut(points)
    assert areas(points, triangles).sum() == pytest.approx(shape.area, rel=1e-9)
    assert (areas(points, triangles) > 0.0).all()
    used = np.unique(points[triangles.ravel()], axis=0)
    np.testing.assert_array_equal(used, np.unique(points, axis=0))
    parts = shapely.polygons(polygon[triangles])
    low, high = polygon.min(axis=0), polygon.max(axis=0)
    samples = shapely.points(rng.uniform(low, high, (200, 2)))
    far = samples[shapely.distance(shape.exterior, samples) > 1e-9]
    inside = shapely.contains(shape, far)
    hits = shapely.intersects(parts[:, None], far[None, :]).sum(axis=0)
    assert (hits[~inside] == 0).all()
    assert (hits[inside] >= 1).all()


def test_a_hole_joined_by_a_bridge_stays_a_hole() -> None:
    points = embedded(np.array(SQUARE_WITH_HOLE, float), np.random.default_rng(0))
    assert areas(points, cut(points)).sum() == pytest.approx(8.0)


def test_the_notch_of_a_u_that_begins_in_a_line_stays_open() -> None:
    for shift in range(len(U)):
        points = embedded(np.roll(np.array(U, float), shift, axis=0),
                          np.random.default_rng(shift))  # fmt: skip
        assert areas(points, cut(points)).sum() == pytest.approx(28.0)


def prism(polygon: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Vertices, corners and sizes of a polygon swept by 1, caps in one face each."""
    n = len(polygon)
    low = np.column_stack([polygon, np.zeros(n)])
    vertices = np.concatenate([low, low + np.array([0, 0, 1])])
    caps = [*reversed(range(n)), *range(n, 2 * n)]
    sides = [(i, (i + 1) % n, (i + 1) % n + n, i + n) for i in range(n)]
    corners = np.array(caps + [i for side in sides for i in side])
    return vertices, corners, np.array([n, n, *[4] * n])


@pytest.mark.parametrize("make", [star, comb, spiral])
@pytest.mark.parametrize("seed", range(10))
def test_a_prism_of_any_section_is_closed_and_has_its_volume(make, seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    polygon = make(rng)
    keep = (polygon != np.roll(polygon, 1, axis=0)).any(axis=1)
    vertices, corners, sizes = prism(polygon[keep])
    vertices = vertices @ rotation(rng).T
    found = cut_faces(vertices, corners, sizes)
    assert found.bend < 1e-13
    assert close_mesh(vertices, found.triangles).closed
    assert (areas(vertices, found.triangles) > 0.0).all()
    a, b, c = np.moveaxis(vertices[found.triangles], 1, 0)
    volume = abs(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)
    assert volume == pytest.approx(shapely.Polygon(polygon).area, rel=1e-9)


def test_convex_faces_are_fans_about_their_first_corner() -> None:
    turns = np.linspace(0, 2 * np.pi, 6, endpoint=False)
    points = np.column_stack([np.cos(turns), np.sin(turns), 0 * turns])
    corners = np.array([0, 1, 2, 3, 4, 5, 2, 1, 0])
    found = cut_faces(points, corners, np.array([6, 3]))
    fan = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5], [2, 1, 0]]
    assert found.triangles.tolist() == fan


def test_the_bend_of_a_face_bounds_how_far_other_cuts_are_off() -> None:
    """A quad of which one corner is lifted: two ways to cut it, bend between them."""
    quad = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.2], [0, 1, 0]], float)
    found = cut_faces(quad, np.arange(4), np.array([4]))
    normal = np.cross(quad[2] - quad[0], quad[3] - quad[1])
    heights = quad @ (normal / np.linalg.norm(normal))
    assert found.bend == pytest.approx(np.ptp(heights))
    shares = np.random.default_rng(0).dirichlet(np.ones(3), 500)
    others = np.concatenate([shares @ quad[[0, 1, 3]], shares @ quad[[1, 2, 3]]])
    ours = quad[found.triangles]
    nearest = [trimesh.triangles.closest_point(np.tile(t, (1000, 1, 1)), others)
               for t in ours]  # fmt: skip
    off = np.linalg.norm(np.array(nearest) - others, axis=2).min(axis=0)
    assert 0.02 < off.max() <= found.bend + 1e-12
    flat = quad * [1, 1, 0]
    assert cut_faces(flat, np.arange(4), np.array([4])).bend == 0.0


def test_the_bend_of_a_face_is_the_same_far_away() -> None:
    """Of corners that lie as exactly there."""
    quad = np.array([[0, 0, 0], [1, 0, 0.25], [1, 1, 0.5], [0, 1, 0.5]])
    here, there = (
        cut_faces(quad + away, np.arange(4), np.array([4])).bend
        for away in (0.0, 2.0**30)
    )
    assert here == pytest.approx(there, rel=1e-12)


@pytest.mark.parametrize(
    "polygon",
    [
        [[0, 0], [2, 2], [2, 0], [0, 2]],  # a bow tie
        [[0, 2], [1, -2], [-2, 1], [2, 1], [-1, -2]],  # a star drawn in one stroke
    ],
)
def test_what_crosses_itself_stays_a_fan_that_covers_it_and_says_so(polygon) -> None:
    points = np.column_stack([np.array(polygon, float), np.zeros(len(polygon))])
    found = cut_faces(points, np.arange(len(points)), np.array([len(points)]))
    assert found.crossed == 1
    assert found.notes == ("1 face crosses itself and may be covered too widely",)
    fan = [[0, i, i + 1] for i in range(1, len(points) - 1)]
    assert found.triangles.tolist() == fan


@pytest.mark.parametrize("step", [0, 1])
def test_a_face_without_area_stays_a_fan(step: int) -> None:
    points = np.arange(4)[:, None] * np.array([step, 0.0, 0.0])
    found = cut_faces(points, np.arange(4), np.array([4]))
    assert not found.crossed
    assert found.triangles.tolist() == [[0, 1, 2], [0, 2, 3]]


def test_a_face_of_ten_thousand_corners_is_cut() -> None:
    rng = np.random.default_rng(0)
    turns = np.linspace(0, 2 * np.pi, 10_000, endpoint=False)
    radii = 1 + 0.3 * np.sin(17 * turns) + 0.01 * rng.normal(size=10_000)
    polygon = np.column_stack([np.cos(turns), np.sin(turns)]) * radii[:, None]
    points = embedded(polygon, rng)
    area = areas(points, cut(points)).sum()
    assert area == pytest.approx(shapely.Polygon(polygon).area, rel=1e-9)


@pytest.mark.parametrize("shift", range(4))
def test_a_triangle_with_a_corner_given_twice_is_one(shift: int) -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 0, 0], [0, 2, 0]])
    rolled = np.roll(points, shift, axis=0)
    triangles = cut(rolled)
    assert len(triangles) == 1
    assert areas(rolled, triangles).tolist() == [1.0]
