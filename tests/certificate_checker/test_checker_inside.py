"""What the certificate checker knows of the inside of meshes, by plain geometry."""

from typing import Any

import numpy as np
import pytest
import trimesh
from flint import arb_mat, ctx
from oracles.closed_solids import (
    exactly,
    made,
    sample_points,
    tetrahedron_at_a_ray,
)

from vdsm_pin.certificate_checker.balls import Rejected
from vdsm_pin.certificate_checker.inside import (
    Surface,
    border,
    covers,
    crossings,
    heights,
    sign,
)
from vdsm_pin.geometry.winding import RAYS

GAP = 2e-4
"""How far corners are joined, over the diagonal (docs/certificate.md)."""
BOX = np.asarray(trimesh.creation.box((2.0, 2.0, 2.0)).triangles)


def rows_of(corners: Any) -> Any:
    """Names of corners, equal where corners are."""
    flat = np.reshape(corners, (-1, 3))
    return np.unique(flat, axis=0, return_inverse=True)[1].reshape(-1, 3)


@pytest.mark.parametrize("seed", range(12))
def test_rays_count_how_often_shells_wind_round_a_point(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mesh = made(rng)
    for point in sample_points(mesh, rng, 2):
        rays = list(crossings(mesh.corners, point))
        assert len(rays) > 12
        for triangles, senses, away in rays:
            assert senses.sum() == sum(mesh.windings(point))
            assert len(triangles) == len(senses) == len(away)
            assert (away > 0.0).all()


@pytest.mark.parametrize("scale", [0.125, 1.0, 32.0])
def test_crossings_of_a_ball_are_as_far_away_as_its_faces(scale: float) -> None:
    """Every ray from the centre crosses one face, between both radii."""
    ball = trimesh.creation.icosphere(2, scale)
    least = (ball.face_normals * ball.triangles[:, 0]).sum(axis=1).min()
    rays = list(crossings(ball.triangles, np.zeros(3)))
    assert len(rays) > 12
    for triangles, senses, away in rays:
        assert senses.tolist() == [1]
        assert least * (1 - 1e-12) <= away.item() <= scale * (1 + 1e-12)
        assert 0 <= triangles.item() < len(ball.faces)


def test_rays_point_all_around() -> None:
    """Each face of a cube is met, whichever way the cube is turned."""
    rng = np.random.default_rng(3)
    for _ in range(10):
        turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        corners = BOX @ (turn * np.sign(np.linalg.det(turn)))
        met = {int(t) for ts, _, _ in crossings(corners, np.zeros(3)) for t in ts}
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        assert len(np.unique(np.round(normals[[*met]], 6), axis=0)) == 6


def test_points_in_the_planes_of_faces_are_decided() -> None:
    """Doubles leave the side of the face in doubt there; balls do not."""
    for far in (3.0, 1.5, 1.0 + 1e-9):
        for point in ([far, 1.0, 0.3], [0.2, far, -1.0], [1.0, 1.0, far]):
            rays = list(crossings(BOX, np.array(point)))
            assert rays
            assert {int(senses.sum()) for _, senses, _ in rays} == {0}


def test_no_ray_is_decided_from_a_point_on_a_face() -> None:
    for triangles, senses, _ in crossings(BOX, np.array([1.0, 0.3, 0.2])):
        assert not triangles.size or senses.sum() in (0, 1)


@pytest.mark.parametrize("seed", range(5))
def test_heights_are_those_of_heron(seed: int) -> None:
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(50, 3, 3)) * 10.0 ** rng.integers(-3, 4, (50, 1, 1))
    a, b, c = (
        np.linalg.norm(corners[:, i] - corners[:, j], axis=1)
        for i, j in ((0, 1), (1, 2), (2, 0))
    )
    half = (a + b + c) / 2
    area = np.sqrt(half * (half - a) * (half - b) * (half - c))
    least = 2 * area / np.maximum(np.maximum(a, b), c)
    assert heights(corners) == pytest.approx(least, rel=1e-6)
    assert heights(np.zeros((1, 3, 3))).tolist() == [0.0]


def test_the_border_of_a_closed_mesh_is_empty_and_of_a_hole_its_edges() -> None:
    rows = rows_of(BOX)
    assert border(rows, signed=True) == border(rows, signed=False) == set()
    edges = {tuple(sorted((rows[4][i], rows[4][i - 1]))) for i in range(3)}
    left = np.delete(rows, 4, axis=0)
    assert border(left, signed=True) == border(left, signed=False) == edges
    turned = rows.copy()
    turned[4] = turned[4][::-1]
    assert border(turned, signed=True) == edges
    assert border(turned, signed=False) == set()
    twice = np.concatenate([rows, rows[4:5]])
    assert border(twice, signed=True) == border(twice, signed=False) == edges


def test_covers_of_a_closed_mesh_written_badly() -> None:
    """What closes with senses, what as a single cover, what is turned both ways."""
    rows, every = rows_of(BOX), np.ones(12, bool)
    signed, single, turned = covers(rows, every, 12)
    assert signed.all()
    assert single.all()
    assert not turned

    again = np.concatenate([rows, np.roll(rows[3:4], 1, axis=1)])  # a face twice
    signed, single, turned = covers(again, np.ones(13, bool), 13)
    for mask in (signed, single):
        assert mask[[3, 12]].sum() == 1
        assert mask.sum() == 12
    assert not turned

    both = np.concatenate([rows, rows[3:4, ::-1]])  # a face in both senses
    signed, single, turned = covers(both, np.ones(13, bool), 13)
    assert not signed.any() or turned
    assert single.sum() == 12
    assert turned

    signed, single, turned = covers(rows[1:], every[1:], 11)
    assert not signed.any()
    assert not single.any()
    assert not turned

    seam = np.delete(rows, 5, axis=0), rows[5:6]  # the last face is a seam
    signed, single, _ = covers(np.concatenate(seam), every, 11)
    assert signed.all()
    assert single.all()


@pytest.mark.parametrize("seed", range(20))
def test_seams_are_as_wide_as_their_corners_are_off_the_edge(seed: int) -> None:
    rng = np.random.default_rng(seed)
    start, along = rng.normal(size=3), rng.normal(size=3)
    aside = np.cross(along, rng.normal(size=3))
    aside *= 1e-5 / np.linalg.norm(aside)
    share = rng.choice([-1e-5, 0.3, 1.0, 1.0 + 1e-5])
    off = start + share * along + aside
    edge = int(rng.integers(3))
    first = np.roll([start, start + along, start + 3 * rng.normal(size=3)], edge, 0)
    second = np.array([off, *rng.normal(size=(2, 3))])
    surface = Surface(np.stack([first, second]))
    surface.join([], [[edge, 3, (edge + 1) % 3, edge]])
    past = max(0.0, -share, share - 1.0) * np.linalg.norm(along)
    assert surface.gap == pytest.approx(np.hypot(1e-5, past), rel=1e-6)
    assert surface.at.tolist() == [*range(6), edge, 3, (edge + 1) % 3]


@pytest.mark.parametrize(("share", "good"), [(0.99, True), (1.01, False)])
def test_corners_farther_apart_than_stated_are_not_joined(
    share: float, good: bool
) -> None:
    corners = np.array([[[0.0, 0, 0], [3, 0, 0], [0, 4, 0]], [[0, 0, 0]] * 3])
    corners[1, 0, 0] = share * GAP * 5.0
    surface = Surface(corners)
    if good:
        surface.join([[3, 0]], [])
        assert surface.gap == pytest.approx(share * GAP * 5.0)
        assert surface.at.tolist() == [0, 1, 2, 0, 4, 5]
    else:
        with pytest.raises(Rejected, match="far apart"):
            surface.join([[3, 0]], [])


@pytest.mark.parametrize(("radius", "good"), [(1.01, True), (1.0, False)])
def test_an_arm_thinner_than_the_gaps_is_not_proved_outside(
    radius: float, good: bool
) -> None:
    surface, point = Surface(BOX), [5.0, 0.1, 0.2]
    assert surface.not_outside(point, radius) == ""
    surface.gap = 1.0
    assert (surface.not_outside(point, radius) == "") is good


@pytest.mark.parametrize("seed", range(12))
def test_points_of_random_solids_are_outside_or_inside(seed: int) -> None:
    rng = np.random.default_rng(100 + seed)
    mesh = made(rng)
    for point in sample_points(mesh, rng, 3):
        why, windings = (
            Surface(mesh.corners).not_outside(point, 0.01),
            mesh.windings(point),
        )
        if sum(windings):
            assert why == "it is inside"
        elif not any(windings):
            assert why != "it is inside"


def test_senses_of_three_rows() -> None:
    x, y, z = (arb_mat([row]) for row in np.eye(3).tolist())
    assert (sign(x, y, z), sign(y, x, z), sign(x, y, x)) == (1, -1, 0)
    assert (sign(x * 0.1, y, z), sign(y * 0.1, x, z)) == (1, -1)


@pytest.mark.parametrize("first", range(3))
@pytest.mark.parametrize("sense", [1, -1])
def test_rays_that_meet_a_corner_are_left_out(first: int, sense: int) -> None:
    """An octahedron's corner lies exactly on a ray: that one says nothing."""
    x = np.cross(RAYS[5], [0.0, 0.0, 1.0])
    tips = np.array([4.0 * RAYS[5], x, np.cross(RAYS[5], x), -RAYS[5]])
    tips = np.concatenate([tips, -tips[1:3]])
    sides = [(1, 2), (2, 4), (4, 5), (5, 1)]
    rows = np.array(
        [[0, *side] for side in sides] + [[3, *side[::-1]] for side in sides]
    )
    volume = np.linalg.det(tips[rows]).sum()
    outwards = tips[rows] if volume > 0.0 else tips[rows][:, ::-1]
    turned = np.roll(outwards[:, ::sense], first, axis=1)
    rays = list(crossings(turned, np.zeros(3)))
    assert len(rays) == len(RAYS) - 1
    assert all(senses.tolist() == [sense] for _, senses, _ in rays)
    # Beside the corner by less than doubles tell apart: balls decide.
    with ctx.workprec(128):
        beside = np.array([1e-16, 2e-16, -1e-16])
        rays = list(crossings(turned, beside))
    assert len(rays) == len(RAYS)
    assert all(senses.tolist() == [sense] for _, senses, _ in rays)


def cube(half: float, aside: float = 0.0, sense: int = 1) -> Any:
    """A cube turned outwards, or inwards for the sense -1."""
    return (half * BOX + np.array([aside, 0.0, 0.0]))[:, ::sense]


def test_what_is_seen_first_decides_in_a_cavity() -> None:
    """Shells within shells: nothing winds round the point, and it sees backs alone."""
    shells = [cube(half, sense=sense) for half, sense in ((8, 1), (6, -1))]
    within = [cube(half, sense=sense) for half, sense in ((4, 1), (2, -1))]
    point = [0.1, 0.2, -0.1]
    assert Surface(np.concatenate(shells)).not_outside(point, 0.01) == ""
    assert Surface(np.concatenate([*shells, *within])).not_outside(point, 0.01) == ""
    again = np.concatenate([*shells, shells[0][:1]])  # a face twice
    assert Surface(again).not_outside(point, 0.01) == ""
    across = np.concatenate([cube(4, 1.0), cube(4, -1.0, sense=-1)])
    why = Surface(across).not_outside(point, 0.01)
    assert why == "its faces are turned both ways"


SCALES = [2.0**-10, 1.0, 2.0**10]
"""What holds of a mesh holds of one larger or smaller by a power of two."""


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(("share", "closed"), [(0.99, True), (1.01, False)])
def test_a_triangle_counts_that_is_higher_than_1e_12_of_the_diagonal(
    scale: float, share: float, closed: bool
) -> None:
    """One more along an edge of a cube, as high as stated, closes nothing."""
    height = share * 1e-12 * np.sqrt(12.0)
    more = np.array([[[1, 1, 1], [1, 1 - height, 0.5], [1, 1, -1]]])
    surface = Surface(scale * np.concatenate([BOX, more]))
    why = surface.not_outside([0.0, 0.0, 0.0], 0.01)
    assert why == ("it is inside" if closed else "the mesh is not closed")


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(("share", "thin"), [(0.8, True), (1.01, False)])
def test_walls_thinner_than_1e_6_of_the_diagonal_are_seen_from_both_sides(
    scale: float, share: float, thin: bool
) -> None:
    """A thin shell within a cavity, seen from the middle."""
    wall = share * 1e-6 * 16.0 * np.sqrt(3.0)
    halves = (8.0, 1), (6.0, -1), (6.0 - wall, 1), (6.0 - 2.0 * wall, -1)
    shells = np.concatenate([cube(half, sense=sense) for half, sense in halves])
    why = Surface(scale * shells).not_outside([0.0, 0.0, 0.0], 0.01)
    assert why == ("its faces are turned both ways" if thin else "")


def test_tetrahedra_of_which_a_ray_meets_an_edge_are_wound_round_exactly() -> None:
    """Of corners near and far; doubles leave many a sign in doubt."""
    rng, counts = np.random.default_rng(12), np.zeros(2, int)
    with ctx.workprec(128):
        for _ in range(150):
            corners, point = tetrahedron_at_a_ray(rng)
            inside, faces = exactly(corners, point)
            rays = list(crossings(faces, point))
            counts[int(inside)] += 1
            assert all(senses.sum() == inside for _, senses, _ in rays)
            assert len(rays) >= len(RAYS) - 3
    assert (counts > 5).all()


def test_a_mesh_that_closes_by_triangles_in_line_has_others_of_two_corners() -> None:
    """Those fill the gap beside an edge that is split, these are left out."""
    a, b, c = BOX[0]
    middle = (a + b) / 2.0
    split = np.array([[a, middle, c], [middle, b, c], [a, b, middle]])
    surface = Surface(np.concatenate([split, BOX[1:], [[a, a, b], [c, c, c]]]))
    assert surface.not_outside([0.1, 0.2, 0.3], 0.01) == "it is inside"
    assert surface.not_outside([5.1, 0.2, 0.3], 0.01) == ""


def test_a_cavity_in_a_body_that_is_written_twice_is_none() -> None:
    """As written the mesh closes and winds 2 - 1 times round the middle."""
    thrice = np.concatenate([cube(6), cube(6), cube(5, sense=-1)])
    assert Surface(thrice).not_outside([0.1, 0.2, 0.3], 0.01) == "it is inside"
    twice = np.concatenate([thrice, cube(5, sense=-1)])
    assert Surface(twice).not_outside([0.1, 0.2, 0.3], 0.01) == ""


def test_zeros_of_both_signs_are_one_place() -> None:
    corners = BOX + 1.0  # from 0 to 2
    corners[::2][corners[::2] == 0.0] = -0.0
    assert Surface(corners).not_outside([1.0, 1.1, 1.2], 0.01) == "it is inside"
    assert Surface(corners).not_outside([5.0, 1.1, 1.2], 0.01) == ""
