"""Support functions of the certificate checker against exact fractions."""

from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from vdsm_pin.arm.mounted import LinkBody
from vdsm_pin.certificate_checker.balls import Rejected
from vdsm_pin.certificate_checker.solids import (
    Solid,
    away,
    boundary,
    cover,
    halved,
    hulls,
    sizes,
)
from vdsm_pin.certificate_checker.solids import (
    solid as as_read,
)
from vdsm_pin.geometry.ordering import coherent_order
from vdsm_pin.geometry.solids import Mesh, PointCloud, Sphere


@pytest.mark.parametrize("n", [1, 2, 3, 8, 9, 64, 1001])
@pytest.mark.parametrize("places", [2, 5, 10**9])
def test_the_order_by_halves_is_the_one_that_is_stated(n: int, places: int) -> None:
    """By the words of docs/certificate.md, and as the prover packs; many are equal."""
    points = np.random.default_rng(n).integers(places, size=(n, 3)) * 0.1
    order = halved(points)
    np.testing.assert_array_equal(order, by_the_words(points, [*range(n)]))
    np.testing.assert_array_equal(order, coherent_order(points))


def by_the_words(points: Any, numbers: list[int]) -> list[int]:
    if len(numbers) < 2:
        return numbers
    far = np.ptp(points[numbers], axis=0).tolist()
    numbers = sorted(numbers, key=lambda k: (points[k, far.index(max(far))], k))
    half = len(numbers) // 2
    return [
        *by_the_words(points, sorted(numbers[:half])),
        *by_the_words(points, sorted(numbers[half:])),
    ]


SQUARE = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]


@pytest.mark.parametrize("seed", range(20))
def test_a_support_is_the_exact_one_but_for_rounding(seed: int) -> None:
    """Far points, one of them at the origin, whose heights nearly cancel."""
    rng = np.random.default_rng(seed)
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    across = np.cross(n, rng.normal(size=(6, 3))) * 10.0 ** rng.uniform(0, 6, (6, 1))
    points = np.concatenate([across, np.zeros((1, 3))])
    first, last = 2, 7
    solid = Solid("far", points[:, None, :], radius=0.5)
    exact = min(
        sum(Fraction(a) * Fraction(b) for a, b in zip(point, n, strict=True))
        for point in points[first:last].tolist()
    )
    off = abs(Fraction(solid.support(n, first, last)) - exact + Fraction(1, 2))
    assert off <= 64 * 2.0**-53 * solid.extent


def prism() -> Solid:
    ends: Any = np.array([[[x, y, z] for x, y in SQUARE] for z in (0.0, 1.0)])
    solid = Solid("bar", ends.reshape(1, -1, 3))
    solid.ends = ends
    return solid


def test_pieces_of_a_prism_are_no_more_corners_than_its_triangles() -> None:
    """Pieces there and back change no boundary: only their number is against them."""
    halves = [[0, 1, 2], [0, 2, 3]]
    solid = prism()
    solid.cut(halves)
    assert solid.points.shape == (2, 6, 3)
    there_and_back = [[0, 1, 2], [2, 1, 0]]
    prism().cut([*halves, *there_and_back])  # 12 corners of 12
    with pytest.raises(Rejected, match="do not make up the whole"):
        prism().cut([*halves, [0, 1, 2, 3], [3, 2, 1, 0]])


def test_a_prism_on_a_link_is_covered_by_the_pieces_of_its_section() -> None:
    """Each is the prism over one polygon; the whole one keeps its name."""
    (whole,) = prism().convex(None)
    assert whole.name == "bar"
    np.testing.assert_array_equal(whole.points, prism().points)
    found, square = prism().convex([[0, 1, 2], [0, 2, 3]]), np.array(SQUARE)
    for k, (part, corners) in enumerate(
        zip(found, ([0, 1, 2], [0, 2, 3]), strict=True)
    ):
        flat = square[corners]
        both = [np.column_stack([flat, np.full(3, z)]) for z in (0.0, 1.0)]
        np.testing.assert_array_equal(part.points, [np.vstack(both)])
        assert part.name == f"bar part {k + 1}"
        assert part.extent == 1.0 + prism().extent  # worked out of what may be so far


def test_a_cloud_is_a_ball_about_each_of_its_points() -> None:
    rng = np.random.default_rng(3)
    points = rng.normal(size=(7, 3))
    n = points[2] / np.linalg.norm(points[2])
    cloud = as_read(PointCloud("scan", points, 0.25))
    for first, last in ((0, 7), (2, 3), (4, 6)):
        least = min(float(point @ n) for point in points[first:last]) - 0.25
        assert cloud.support(n, first, last) == pytest.approx(least, rel=0, abs=1e-15)
    assert cloud.extent == pytest.approx(np.abs(points).max() + 0.25)


def test_boundaries_cancel_where_loops_run_both_ways() -> None:
    assert boundary([[0, 1, 2]]) == {(0, 1): 1, (1, 2): 1, (2, 0): 1}
    assert boundary([[0, 1, 2], [2, 1, 0]]) == {}
    halves = boundary([[0, 1, 2], [0, 2, 3]])
    assert halves == boundary([[0, 1, 2, 3]])
    assert halves != boundary([[0, 1, 2], [0, 3, 2]])
    assert boundary([[0, 0, 1, 2, 2]]) == boundary([[0, 1, 2]])
    assert boundary([[0, 1, 2]] * 2) == {(0, 1): 2, (1, 2): 2, (2, 0): 2}


def test_the_extent_is_that_of_the_points_and_where_they_come_from() -> None:
    assert Solid("one", [[[0.5, -0.25, 0.0]]]).extent == 0.5
    assert Solid("far", [[[0.5, 0.0, 0.0]]], origin=[0.0, -4.0, 0.0]).extent == 4.5
    assert Solid("ball", [[[0.5, 0.0, 0.0]]], radius=0.25).extent == 0.75


def test_points_lie_half_a_diagonal_from_the_middle_of_their_box() -> None:
    rng = np.random.default_rng(1)
    for _ in range(20):
        low, size = rng.normal(size=3), rng.uniform(0.1, 1.0, 3)
        corners = low + size * np.indices((2, 2, 2)).reshape(3, -1).T
        inner = low + size * rng.uniform(0.3, 0.7, (4, 3))
        found = away(np.vstack([inner, corners]), 0.25)
        assert found == pytest.approx(np.linalg.norm(size) / 2 + 0.25, rel=1e-11)


def test_a_disc_reaches_by_its_radius_times_the_sine_of_its_axis() -> None:
    rng = np.random.default_rng(2)
    for radius in (0.001, 0.3, 2.0):
        n, axis, point = rng.normal(size=(3, 3))
        n, axis = n / np.linalg.norm(n), axis / np.linalg.norm(axis)
        solid = Solid("disc", [[point]], radius=0.1, disc=(axis, radius))
        sine = np.sqrt(1.0 - (axis @ n) ** 2)
        expected = point @ n - 0.1 - radius * sine
        assert solid.support(n, 0, 1) == pytest.approx(expected, rel=0, abs=1e-12)


@pytest.mark.parametrize("share", [0.9, 1.1])
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sense", [1, -1])
def test_hulls_of_open_meshes_share_a_point_where_they_are_near(
    axis: int, sense: int, share: float
) -> None:
    """Three triangles in a row, a thousandth of their size apart, or a little more."""
    one, size = np.array([[0.0, 0, 0], [1, 0, 1], [0, 1, 1]]), np.sqrt(11.0)
    step = np.zeros(3)
    step[axis] = 1.0 + share * size / 1000  # the gaps make it no larger to speak of
    corners = np.array([one + k * step for k in range(3)])[::sense] + 7.0  # far off
    groups = [[0], [1], [2]]
    tips = corners.mean(axis=1)
    tips = tips if share > 1.0 else np.tile(tips.mean(axis=0), (3, 1))
    for found, part, tip in zip(
        hulls("m", corners, groups), corners, tips, strict=True
    ):
        np.testing.assert_allclose(found, np.unique([*part, tip], axis=0), atol=1e-12)
    alone = hulls("m", corners, groups, inside=False)
    for found, part in zip(alone, corners, strict=True):
        np.testing.assert_array_equal(found, np.unique(part, axis=0))
    for wrong in ([[0], [1]], [[0, 1]], [[1], [2]]):
        with pytest.raises(Rejected, match="pieces of m do not make up the whole"):
            hulls("m", corners, wrong)


@pytest.mark.parametrize("again", [0, 1, 2])
@pytest.mark.parametrize("solids", [1, 2])
def test_hulls_of_closed_meshes_share_a_point_where_they_share_a_corner(
    again: int, solids: int
) -> None:
    """Two tetrahedra near one another have each its own, also of faces given twice."""
    tips = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = tips[[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]]
    whole = [faces, faces - [1.0 + 1e-4, 0.0, 0.0]][:solids]
    corners = np.concatenate([*whole, faces[:again]])
    n = len(corners)
    groups = [[0, 1, *range(4 * solids, n)], [2, 3], [4, 5, 6, 7]][: 1 + solids]
    ways = [[*groups[0], *groups[1]]] * 2 + groups[2:]
    middles = [corners[way].mean(axis=(0, 1)) for way in ways]
    found = hulls("m", corners, groups)
    for points, group, middle in zip(found, groups, middles, strict=True):
        expected = np.unique([*corners[group].reshape(-1, 3), middle], axis=0)
        np.testing.assert_allclose(points, expected, rtol=0, atol=1e-12)


def test_two_hulls_of_two_closed_meshes_have_each_its_own_point() -> None:
    """However near their boxes are."""
    tips = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    faces = tips[[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]]
    corners = np.concatenate([faces, faces - [1.0 + 1e-4, 0.0, 0.0]])
    found = hulls("m", corners, [[0, 1, 2, 3], [4, 5, 6, 7]])
    for points, whole in zip(found, (corners[:4], corners[4:]), strict=True):
        middle = whole.mean(axis=(0, 1))
        expected = np.unique([*whole.reshape(-1, 3), middle], axis=0)
        np.testing.assert_allclose(points, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("solid", [True, False])
def test_a_mesh_on_a_link_is_covered_by_hulls_of_its_triangles(solid: bool) -> None:
    """With a point in common where the inside is meant too."""
    tips = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    order = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    mesh = as_read(Mesh("part", tips, order, solid=solid))
    (whole,) = mesh.convex(None)
    expected = np.unique([*tips, *[tips.mean(axis=0)] * solid], axis=0)
    assert whole.name == "part"
    np.testing.assert_array_equal(whole.points[0], expected)
    first, second = mesh.convex([[0, 1], [2, 3]])
    assert (first.name, second.name) == ("part part 1", "part part 2")
    assert len(first.points[0]) == len(second.points[0]) == 4 + solid
    with pytest.raises(Rejected, match="pieces of part do not make up the whole"):
        mesh.convex([[0, 1], [2]])


@pytest.mark.parametrize(
    ("more", "reason"),
    [
        ({"joined": {"ball": [[[0, 0]], []]}}, "ball is no mesh: nothing is joined"),
        ({"joined": {"": [[[0, 0]], []]}}, " is no mesh: nothing is joined"),
        ({"links": {"foot": {}}}, "links without solids are told of"),
        ({"pieces": {"ball": [0, 0]}}, "pieces of ball do not make up the whole"),
    ],
)
def test_what_a_certificate_tells_of_is_there(more: Any, reason: str) -> None:
    ball = Solid("ball", [[[0.0, 0.0, 0.0]]], radius=1.0)
    header: Any = {"links": {"tool": {}}, "pieces": {"ball": [0]}, "joined": {}}
    cover([ball], header, ["tool"])
    with pytest.raises(Rejected, match=reason):
        cover([ball], header | more, ["tool"])


def test_sizes_that_nobody_states_are_told_of_all_that_stands_in_files() -> None:
    """Of clouds and of what a link carries as of meshes."""
    mesh = Mesh("part", np.eye(3), np.array([[0, 1, 2]]), assumed_size="9 x 9 x 9 m")
    scan = PointCloud("scan", np.eye(3), 0.1, assumed_size="1 x 1 x 1 mm")
    stated = Mesh("stated", np.eye(3), np.array([[0, 1, 2]]))
    ball = Sphere("ball", np.zeros(3), 1.0)
    assert sizes([scan, stated, ball, LinkBody(1, mesh)]) == [
        "scan is taken to be 1 x 1 x 1 mm; no unit is stated",
        "part is taken to be 9 x 9 x 9 m; no unit is stated",
    ]
