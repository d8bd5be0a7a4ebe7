"""Where a point lies of meshes written well and badly, against solid angles."""

from collections import Counter
from collections.abc import Callable

import numpy as np
import pytest
import trimesh
from oracles.closed_solids import (
    CLEAN,
    DOUBTFUL,
    GAPS,
    Made,
    made,
    sample_points,
    spoiled,
)
from scipy.sparse.csgraph import connected_components

from vdsm_pin.geometry import closed_meshes
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.closed_meshes import close_mesh, closed_parts
from vdsm_pin.geometry.mesh_edges import SLANT, clusters
from vdsm_pin.geometry.winding import Location, Side, locate

RADIUS = 0.02
ORIGIN = np.zeros(3)


def box(half: float, centre: tuple[float, float, float] = (0, 0, 0)) -> FloatArray:
    solid = trimesh.creation.box(np.full(3, 2.0 * half))
    return np.asarray(solid.triangles) + np.array(centre)


def inwards(corners: FloatArray) -> FloatArray:
    return corners[:, ::-1]


def where(*parts: FloatArray, point: FloatArray = ORIGIN) -> Location:
    vertices, triangles = Made(np.concatenate(parts), [], []).indexed()
    return locate(close_mesh(vertices, triangles), point, RADIUS)


TINY = np.array([[[0.3, 0.2, 0.1]] * 3])
EQUAL = box(5.0)[:1][:, [0, 0, 1]]
IN_LINE = np.array([[[1.0, 2.0, 3.0], [2.0, 3.0, 4.0], [3.0, 4.0, 5.0]]])


@pytest.mark.parametrize(
    "parts",
    [
        (box(5),),
        (inwards(box(5)),),
        (box(5), box(6)),
        (inwards(box(5)), inwards(box(6))),
        (box(5), box(5, (1, 0.5, 0.3))),
        (box(5), box(5)),
        (box(5), inwards(box(5))),
        (box(5), box(5)[:1]),
        (box(5), EQUAL, TINY),
        (box(5), IN_LINE),
        (box(5), box(5, (10, 0, 0))),
        (box(5), box(6)[[0, 1]], inwards(box(6)[[0, 1]])),
        (box(5), box(1, (8, 0, 0)), inwards(box(1, (8, 0, 0)))),
    ],
    ids=[
        *("plain", "inverted", "nested", "both inverted", "overlap", "twice"),
        *("double sided", "a face twice", "equal corners", "in line", "a wall twice"),
        *("beside a sheet", "beside a double-sided box"),
    ],
)
def test_these_are_around_the_arm(parts: tuple[FloatArray, ...]) -> None:
    found = where(*parts)
    expected = Side.UNKNOWN if len(parts) == 3 and len(parts[1]) == 2 else Side.INSIDE
    assert found.side is expected


def test_a_body_turned_inwards_within_another_is_a_cavity() -> None:
    assert where(box(6), inwards(box(5))) == Location(Side.OUTSIDE)
    assert where(inwards(box(6)), box(5)) == Location(Side.OUTSIDE)
    wall = np.array([5.5, 0.1, 0.2])
    assert where(box(6), inwards(box(5)), point=wall).side is Side.INSIDE


@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_point_near_a_tip_is_inside_wherever_the_tip_stands_in_its_faces(
    axis: int, sense: float
) -> None:
    """The box around a mesh is that of all corners of its triangles."""
    tip, base = np.zeros(3), np.array([[1.0, 1, 1], [2, 1, 1], [1, 2, 1], [1, 1, 2]])
    tip[axis] = -9.0
    corners = np.array([tip, *(base[k] for k in (*range(4),) if k != axis + 1)])
    for turned in range(3):
        faces = [np.roll([0, i, j], turned) for i, j in ((1, 2), (2, 3), (3, 1))]
        solid = sense * corners[np.array([*faces, [3, 2, 1]])]
        near = sense * (0.9 * tip + 0.1 * corners[1:].mean(axis=0))
        assert where(solid, point=near).side is Side.INSIDE
        assert where(solid, point=1.2 * sense * tip).side is Side.OUTSIDE


def test_a_mesh_that_closes_by_triangles_in_line_has_others_of_two_corners() -> None:
    """Those fill the gap beside an edge that is split, these are left out."""
    a, b, c = box(5.0)[0]
    middle = (a + b) / 2.0
    split = np.array([[a, middle, c], [middle, b, c], [a, b, middle]])
    parts = split, box(5.0)[1:], np.array([[a, a, b], [c, c, c]])
    assert where(*parts).side is Side.INSIDE
    assert where(*parts, point=np.array([9.0, 0.1, 0.2])).side is Side.OUTSIDE


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
    corners = scale * np.concatenate([box(1.0), more])
    search = closed_meshes._Search(corners.reshape(-1, 3), corners)
    assert search.flat.tolist() == [False] * 12 + [closed]
    assert search.most == pytest.approx(scale * 2e-4 * np.sqrt(12.0))


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(("share", "thin"), [(0.8, True), (1.01, False)])
def test_walls_thinner_than_1e_6_of_the_diagonal_are_seen_from_both_sides(
    scale: float, share: float, thin: bool
) -> None:
    """A thin shell within a cavity, seen from the middle."""
    wall = share * 1e-6 * 16.0 * np.sqrt(3.0)
    shells = box(8.0), inwards(box(6.0)), box(6.0 - wall), inwards(box(6.0 - 2 * wall))
    found = where(scale * np.concatenate(shells))
    assert found.side is (Side.UNKNOWN if thin else Side.OUTSIDE)


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(("share", "joined"), [(0.99, True), (1.01, False)])
def test_corners_are_joined_up_to_2e_4_of_the_diagonal(
    scale: float, share: float, joined: bool
) -> None:
    """The lid of a cube that is lifted by as much as stated."""
    corners = box(5.0)
    gap = share * 2e-4 * np.linalg.norm([10.0, 10.0, 10.0])
    corners[corners[:, :, 2].min(axis=1) > 0.0] += [0.0, 0.0, gap]
    found = close_mesh(*Made(scale * corners, [], []).indexed())
    assert found.closed == joined


def test_corners_of_closed_parts_are_joined_with_none() -> None:
    """Not even where a face of theirs is turned round and they are as small as gaps."""
    corners = box(5.0)
    size = np.linalg.norm([10.0, 10.0, 10.0])
    corners[corners[:, :, 2].min(axis=1) > 0.0] += [0.0, 0.0, 5e-6 * size]
    tips = 6e-6 * size * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    speck = tips[[[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3][::-1]]] + [0.0, 0.0, 9.0]
    found = close_mesh(*Made(np.concatenate([corners, speck]), [], []).indexed())
    assert found.single[:16].all()
    assert found.gap == pytest.approx(5e-6 * size, rel=1e-3)


def test_seams_are_as_many_as_an_edge_lacks_partners_of_its_sense() -> None:
    """Two cubes that meet at an edge, which both have forwards alone: it lacks two."""
    ends, parts = np.array([[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]), []
    for k, centre in enumerate(((1.0, 1.0, 0.0), (-1.0, -1.0, 0.0))):
        for triangle in box(1.0, centre):
            sides = zip(triangle, np.roll(triangle, -1, axis=0), strict=True)
            met = [i for i, (p, q) in enumerate(sides) if (p == ends[1]).all()
                   and (q == ends[0]).all()]  # fmt: skip
            if not met:
                parts.append(triangle)
                continue
            a, b, c = np.roll(triangle, -met[0], axis=0)
            middle = (a + (2 + k) * b) / (3 + k) + np.array([1e-5, 0.0, 0.0])
            parts += [np.array([a, middle, c]), np.array([middle, b, c])]
    assert len(parts) == 26
    found = close_mesh(*Made(np.array(parts), [], []).indexed())
    assert found.signed.all()
    for centre in ([1.0, 1.1, 0.2], [-1.0, -1.1, 0.2]):
        assert where(np.array(parts), point=np.array(centre)).side is Side.INSIDE


def test_a_cavity_in_a_body_that_is_written_twice_is_none() -> None:
    """As written the mesh closes and winds 2 - 1 times round the middle."""
    assert where(box(6), box(6), inwards(box(5))).side is Side.INSIDE
    twice = box(6), box(6), inwards(box(5)), inwards(box(5))
    assert where(*twice) == Location(Side.OUTSIDE)


def test_bodies_turned_opposite_ways_that_overlap_leave_no_cavity() -> None:
    """The winding number is 0 there, as in a cavity."""
    found = where(box(5), inwards(box(6, (2, 0.5, 0.3))))
    assert found.side is Side.UNKNOWN
    assert "fronts" in found.reason


def test_a_face_drawn_twice_a_little_apart_is_no_thin_wall() -> None:
    """In single precision both covers close, and cancel."""
    off = box(5) * (1.0 - 1e-7)
    assert where(box(5), inwards(off)).side is Side.UNKNOWN
    assert where(box(5), inwards(0.999 * box(5))).side is Side.OUTSIDE


def test_a_face_turned_round_leaves_the_parity() -> None:
    corners = box(5).copy()
    corners[3] = corners[3, ::-1]
    assert where(corners).side is Side.INSIDE
    assert where(corners, point=np.array([0.0, 0.0, 5.5])).side is Side.OUTSIDE
    within = where(corners, box(6))
    assert within.side is Side.UNKNOWN
    assert "opposite ways" in within.reason


def test_a_hole_leaves_the_inside_unknown_also_in_what_is_drawn_from_both_sides() -> (
    None
):
    for corners in (box(5)[1:], np.concatenate([box(5)[1:], inwards(box(5)[1:])])):
        found = where(corners)
        assert found.side is Side.UNKNOWN
        assert found.reason == "it is not closed: 3 edges have no partner"


def test_a_point_on_the_surface_is_unknown() -> None:
    assert where(box(5), point=np.array([5.0, 0.1, 0.2])).side is Side.UNKNOWN
    assert where(box(5), point=np.array([5.0, 5.0, 5.0])).side is Side.UNKNOWN


@pytest.mark.parametrize("gap", [1e-9, 1e-7, 1e-6, 1e-5, 1e-4])
def test_gaps_are_joined_and_their_width_is_told(gap: float) -> None:
    corners = box(5)
    size = np.linalg.norm(np.ptp(corners.reshape(-1, 3), axis=0))
    upper = corners.mean(axis=1)[:, 2] > 0.0
    corners[upper] += [0.0, 0.0, gap * size]
    found = close_mesh(*Made(corners, [], []).indexed())
    assert found.closed
    assert found.gap == pytest.approx(gap * size, rel=1e-3)
    assert locate(found, ORIGIN, RADIUS).side is Side.INSIDE
    assert locate(found, ORIGIN, found.gap).side is Side.UNKNOWN
    assert not close_mesh(*Made(corners * [1, 1, 1.001], [], []).indexed()).n_open


def test_wider_gaps_are_not_joined() -> None:
    corners = box(5)
    upper = corners.mean(axis=1)[:, 2] > 0.0
    corners[upper] += [0.0, 0.0, 1e-3 * 17.3]
    assert where(corners).side is Side.UNKNOWN


@pytest.mark.parametrize("off", [0.0, 1e-9, 1e-4, 2e-3])
def test_a_corner_on_an_edge_is_joined_to_it(off: float) -> None:
    corners = box(5)
    a, b, c = corners[0]
    middle = 0.3 * a + 0.7 * b + off
    seamed = np.concatenate([corners[1:], [[a, middle, c], [middle, b, c]]])
    found = close_mesh(*Made(seamed, [], []).indexed())
    # Where another face is turned round no seam makes up for it.
    other = seamed.copy()
    other[5] = other[5, ::-1]
    mixed = close_mesh(*Made(other, [], []).indexed())
    assert mixed.closed and mixed.single.all() and not mixed.signed.any()
    assert len(mixed.single) == len(other) + 1
    again = close_mesh(*Made(np.concatenate([other, other[7:8]]), [], []).indexed())
    assert again.closed and again.single.sum() == len(other) + 1 and again.single[-1]
    assert found.signed.all() and not found.single.any()
    twice = close_mesh(*Made(np.concatenate([seamed, seamed[7:8]]), [], []).indexed())
    assert twice.signed.sum() == len(seamed) + 1 and not twice.single.any()
    assert found.closed
    assert len(found.beside) == 1
    assert found.gap <= off * np.sqrt(3.0)
    assert locate(found, ORIGIN, RADIUS).side is Side.INSIDE


def test_thin_plates_are_not_joined() -> None:
    """Only open edges are: a plate thinner than the gap stays a plate."""
    solid = trimesh.creation.box([10.0, 10.0, 1e-4])
    found = close_mesh(np.asarray(solid.vertices), np.asarray(solid.faces))
    assert found.gap == 0.0
    assert found.signed.all()


def test_closedness_is_what_counting_edges_gives() -> None:
    """Oracle: counting in dictionaries, over sets of few random triangles."""
    rng = np.random.default_rng(3)
    vertices = rng.normal(size=(5, 3))
    solid = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
    seen: Counter[bool] = Counter()
    for _ in range(200):
        extra = [rng.permutation(5)[:3].tolist() for _ in range(rng.integers(0, 3))]
        triangles = solid[: rng.integers(3, 5)] + extra
        faces = {frozenset(t): t for t in triangles}
        once = {tuple(np.roll(t, -int(np.argmin(t))).tolist()) for t in triangles}
        even = not border(list(faces.values()), signed=False)
        balanced = not border(triangles) or not border([list(t) for t in once])
        found = close_mesh(vertices, np.array(triangles))
        assert found.turned == (found.closed and len(once) > len(faces))
        if len(once) == len(faces):
            assert found.closed == (even or balanced)
        else:  # what is given in both senses must end on others besides
            assert found.closed in ({even, True} if balanced else {even})
        seen[found.closed] += 1
    assert min(seen[True], seen[False]) > 10


def border(triangles: list[list[int]], *, signed: bool = True) -> set[frozenset[int]]:
    times: Counter[frozenset[int]] = Counter()
    for triangle in triangles:
        for i in range(3):
            a, b = triangle[i], triangle[(i + 1) % 3]
            times[frozenset((a, b))] += 1 if a < b or not signed else -1
    return {edge for edge, n in times.items() if (n if signed else n % 2)}


# ---- by the hundred ------------------------------------------------------------------


def hold_to_truth(
    seed: int, faults: tuple[Callable[..., None], ...], count: int = 4
) -> Counter[tuple[str, Side]]:
    """Random points of one random mesh against solid angles.

    Never outside where the shells wind round the point, never inside where none does;
    with faults that lose nothing the answer is exact.
    """
    rng = np.random.default_rng(seed)
    mesh = made(rng)
    if faults:
        spoiled(mesh, rng, faults)
    closed, seen = close_mesh(*mesh.indexed()), Counter[tuple[str, Side]]()
    for point in sample_points(mesh, rng, count):
        windings, side = mesh.windings(point), locate(closed, point, RADIUS).side
        told = f"seed {seed}, {mesh.faults}, {windings}"
        if sum(windings):
            kind, allowed = "in a solid", {Side.INSIDE, Side.UNKNOWN}
        elif any(windings):
            kind, allowed = "in a cavity", {*Side}
        else:
            kind, allowed = "outside", {Side.OUTSIDE, Side.UNKNOWN}
        if faults is not DOUBTFUL and kind != "in a cavity":
            allowed -= {Side.UNKNOWN}
        assert side in allowed, told
        seen[kind, side] += 1
    return seen


GROUPS = pytest.mark.parametrize(
    "faults", [(), CLEAN, GAPS, DOUBTFUL], ids=["none", "clean", "gaps", "doubtful"]
)


@GROUPS
def test_random_meshes(faults: tuple[Callable[..., None], ...]) -> None:
    seen = sum((hold_to_truth(seed, faults) for seed in range(25)), Counter())
    assert seen["in a solid", Side.INSIDE] > 5
    assert seen["outside", Side.OUTSIDE] > 20


@pytest.mark.slow
@GROUPS
def test_many_random_meshes(faults: tuple[Callable[..., None], ...]) -> None:
    seen = sum((hold_to_truth(seed, faults) for seed in range(60, 3000)), Counter())
    assert seen["in a solid", Side.INSIDE] > 500


@pytest.mark.parametrize("seed", range(5))
def test_vertices_are_joined_along_chains_in_which_one_of_two_is_loose(
    seed: int,
) -> None:
    """Oracle: every pair looked at, parts of a graph by scipy."""
    rng, gap = np.random.default_rng(seed), 0.2
    vertices = rng.uniform(size=(80, 3))
    loose = np.flatnonzero(rng.uniform(size=80) < 0.4)
    joined = clusters(vertices, np.arange(80).reshape(-1, 2), loose, gap)
    off = np.linalg.norm(vertices[:, None] - vertices, axis=2)
    is_loose = np.isin(np.arange(80), loose)
    graph = (off <= gap) & (is_loose[:, None] | is_loose)
    assert np.linalg.norm(SLANT) <= 1.0
    _, part = connected_components(graph)
    least = [int(np.flatnonzero(part == one)[0]) for one in part]
    assert joined.tolist() == least
    assert 5 < len(set(least)) < 75


def test_closed_parts_hang_together_by_their_corners() -> None:
    """One within another, two that touch in a corner, some of their faces mixed."""
    rng = np.random.default_rng(2)
    boxes = [box(1.0), box(0.5), box(0.5, (1.5, 1.5, 1.5)), box(1.0, (9, 0, 0))]
    order = rng.permutation(sum(map(len, boxes)))
    corners = np.concatenate(boxes)[order]
    truth = np.repeat([0, 1, 0, 2], [len(one) for one in boxes])[order]
    found = closed_parts(corners)
    assert found is not None
    assert sorted(set(found.tolist())) == [0, 1, 2]
    assert len({*zip(found.tolist(), truth.tolist(), strict=True)}) == 3
    assert closed_parts(corners[1:]) is None
    tube = trimesh.creation.annulus(0.5, 1.0, 20.0, sections=60)  # a long chain
    parts = closed_parts(np.asarray(tube.triangles))
    assert parts is not None and not parts.any()


@pytest.mark.parametrize("order", [(0, 1, 2), (0, 2, 1)])
def test_open_edges_are_those_without_a_partner_whichever_way_it_runs(
    order: tuple[int, int, int],
) -> None:
    """Two triangles share a side, however the second one is turned."""
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    second = np.array([2, 1, 3])[list(order)]
    found = close_mesh(vertices, np.array([[0, 1, 2], second]))
    assert found.n_open == 4
    assert close_mesh(vertices, np.array([[0, 1, 2]])).n_open == 3
