"""How triangles close, function by function; oracle: dictionaries and loops."""

from collections import Counter
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from vdsm_pin.geometry import mesh_edges
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.closed_meshes import (
    SIGNED,
    SINGLE,
    SOLID,
    ClosedMesh,
    _heights,
    _Search,
)
from vdsm_pin.geometry.mesh_edges import (
    SLANT,
    Covers,
    attached,
    closes,
    counted,
    edge_keys,
    off_segment,
    open_edges,
    seams_along,
    welded,
)
from vdsm_pin.tolerances import TOLERANCES

Edge = tuple[int, int]


def random_names(rng: np.random.Generator) -> IntArray:
    """Few corners, so that triangles repeat, turn round, or lose an edge."""
    return rng.integers(0, int(rng.integers(3, 6)), (int(rng.integers(1, 9)), 3))


def edges_of(names: IntArray) -> list[Edge]:
    return [(int(t[i]), int(t[(i + 1) % 3])) for t in names for i in range(3)]


def turned_to_least(t: IntArray) -> tuple[int, ...]:
    return tuple(np.roll(t, -int(np.argmin(t))).tolist())


def covers_of(names: IntArray, kept: BoolArray) -> list[BoolArray]:
    """All, in each sense once, once, and those of one sense alone."""
    whole = kept & np.array([len({*t.tolist()}) == 3 for t in names])
    once, single, lone = np.zeros((3, len(names)), bool)
    faces: dict[frozenset[int], set[tuple[int, ...]]] = {}
    for k in np.flatnonzero(whole):
        face, sense = frozenset(names[k].tolist()), turned_to_least(names[k])
        single[k], senses = face not in faces, faces.setdefault(face, set())
        once[k] = sense not in senses
        senses.add(sense)
    for k in np.flatnonzero(whole):
        lone[k] = len(faces[frozenset(names[k].tolist())]) == 1
    return [whole, once, single, lone]


def left_open(names: IntArray, *, signed: bool) -> Counter[Edge]:
    """Edges that do not cancel, in the sense that is over, and how often."""
    runs = Counter(edges_of(names))
    found: Counter[Edge] = Counter()
    for a, b in {(min(e), max(e)) for e in runs}:
        up, down = runs[a, b], runs[b, a]
        if signed and up != down:
            found[(a, b) if up > down else (b, a)] = abs(up - down)
        if not signed and (up + down) % 2:
            found[a, b] = 1
    return found


def test_triangles_count_as_by_dictionaries() -> None:
    rng = np.random.default_rng(1)
    for _ in range(600):
        names = random_names(rng)
        kept = rng.random(len(names)) < 0.8
        found, truth = counted(names, kept), covers_of(names, kept)
        for one, other in zip(found, truth, strict=True):
            assert np.array_equal(one, other)
        whole = names[found.whole]
        if not len(whole):
            continue
        keys, up = edge_keys(whole)
        numbers = dict[Edge, int]()
        for key, upwards, (a, b) in zip(keys, up, edges_of(whole), strict=True):
            assert numbers.setdefault((min(a, b), max(a, b)), key) == key
            assert upwards == (a < b)
        assert len({*numbers.values()}) == len(numbers)
        for signed in (True, False):
            edges, at = open_edges(whole, signed=signed)
            over = left_open(whole, signed=signed)
            assert closes(whole, signed=signed) == (not over)
            told = [(int(a), int(b)) for a, b in edges]
            if not signed:
                told = [(min(edge), max(edge)) for edge in told]
            assert Counter(told) == over
            for (a, b), place in zip(edges, at, strict=True):
                assert edges_of(whole)[place] in ((a, b), (b, a))
            if not signed:
                first = [edges_of(whole)[place] for place in at]
                assert first == [(int(a), int(b)) for a, b in edges]


def test_walls_end_on_what_is_given_once() -> None:
    rng, seen = np.random.default_rng(2), Counter[bool]()
    for _ in range(600):
        names = random_names(rng)
        whole, once, single, lone = covers_of(names, np.ones(len(names), bool))
        seams = random_names(rng)[: rng.integers(3)]
        seams = seams[[len({*t.tolist()}) == 3 for t in seams]]
        found = attached(names, Covers(whole, once, single, lone), seams)
        cover = np.concatenate([names[single], seams])
        walls = {frozenset(e) for e in edges_of(np.concatenate([names[lone], seams]))}
        ends = {frozenset(e) for e in left_open(cover, signed=False)}
        expected = bool((lone == whole).all()) or ends <= walls
        assert found == expected
        seen[found] += 1
    assert min(seen[True], seen[False]) > 20


def test_equal_corners_have_one_name() -> None:
    vertices = np.array(
        [[1.0, 0, 0], [0.0, 0, 0], [-0.0, 0, 0], [1.0, 0, 0], [2.0, 0, 0]]
    )
    names = welded(vertices, np.array([[3, 1, 2], [4, 3, 2]]))
    assert names[[1, 2, 3, 4]].tolist() == [1, 1, 3, 4]  # 0 is in no triangle
    assert names[0] == 0
    assert welded(vertices, np.array([[0, 1, 2], [4, 3, 2]])).tolist() == [
        0,
        1,
        1,
        0,
        4,
    ]


def test_points_lie_along_segments_and_off_them() -> None:
    rng = np.random.default_rng(3)
    begin, end, points = rng.normal(size=(3, 200, 3))
    end[:20] = begin[:20]
    share, off = off_segment(points, begin, end)
    t = np.linspace(0.0, 1.0, 20_001)[:, None]
    for k in range(0, 200, 5):
        way = end[k] - begin[k]
        along = (points[k] - begin[k]) @ way / (way @ way) if k >= 20 else 0.0
        assert share[k] == pytest.approx(along)
        near = np.linalg.norm(begin[k] + t * way - points[k], axis=1).min()
        assert off[k] == pytest.approx(near, abs=1e-7)


def test_heights_are_twice_the_area_over_the_longest_side() -> None:
    rng = np.random.default_rng(4)
    corners = rng.normal(size=(50, 3, 3))
    corners[0] = corners[0, :1]
    corners[1, 2] = 0.5 * (corners[1, 0] + corners[1, 1])
    found = _heights(corners)
    assert found[0] == 0.0
    assert found[1] == pytest.approx(0.0, abs=1e-12)
    for triangle, height in zip(corners[2:], found[2:], strict=True):
        sides = [np.linalg.norm(triangle[i] - triangle[i - 1]) for i in range(3)]
        half = sum(sides) / 2.0
        area = np.sqrt(half * np.prod([half - side for side in sides]))
        assert height == pytest.approx(2.0 * area / max(sides))


def seams_by_loops(
    vertices: FloatArray, edges: IntArray, at: IntArray, gap: float
) -> list[tuple[list[int], int]]:
    """Fans along each edge, from its begin over the corners on it to its end."""
    found, loose = [], sorted({*edges.ravel().tolist()})
    for (a, b), place in zip(edges.tolist(), at.tolist(), strict=True):
        way, on = vertices[b] - vertices[a], []
        for c in loose:
            share = (vertices[c] - vertices[a]) @ way / (way @ way)
            off = np.linalg.norm(vertices[a] + share * way - vertices[c])
            if c not in (a, b) and 0.0 < share < 1.0 and off <= gap:
                on.append((share, c))
        chain = [c for _, c in sorted(on)] + [b]
        found += [([a, c, d], place) for c, d in pairwise(chain)]
    return found


@pytest.mark.parametrize("seed", range(8))
def test_seams_join_an_edge_and_the_corners_on_it(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng([5, seed])
    flat = np.append(rng.integers(0, 5, (12, 2)), np.zeros((12, 1)), axis=1)
    vertices = flat + rng.choice([0.0, 0.04], (12, 3)) * rng.uniform(-1, 1, (12, 3))
    edges = np.array([rng.choice(12, 2, replace=False) for _ in range(14)])
    edges = edges[(vertices[edges[:, 0]] != vertices[edges[:, 1]]).any(axis=1)]
    at = rng.permutation(99)[: len(edges)]
    found = seams_along(vertices, edges, at, 0.05)
    expected = seams_by_loops(vertices, edges, at, 0.05)
    assert [
        *zip(found.triangles.tolist(), found.beside.tolist(), strict=True)
    ] == expected
    assert expected
    height, ends = vertices @ SLANT, vertices[edges] @ SLANT
    loose = sorted({*edges.ravel().tolist()})
    looked_at = sum(
        int(low.min() - 0.05 <= height[c] <= low.max() + 0.05)
        for low in ends
        for c in loose
    )
    for most, told in ((looked_at, len(expected)), (looked_at - 1, 0)):
        monkeypatch.setattr(mesh_edges, "MANY", most)
        assert len(seams_along(vertices, edges, at, 0.05).beside) == told


@pytest.mark.parametrize("size", [1e-2, 1.0, 100.0])
def test_triangles_without_area_are_those_flat_for_their_mesh(size: float) -> None:
    """On both sides of the limit; along an edge as long as the mesh."""
    limit = TOLERANCES.mesh_flat * size
    corners = np.array([
        [[0.0, 0.0, 0.0], [size, 0.0, 0.0], [0.5 * size, height, 0.0]]
        for height in (0.0, 0.5 * limit, 2.0 * limit, 1e-3 * size)
    ])  # fmt: skip
    search = _Search(corners.reshape(-1, 3), corners)
    assert search.flat.tolist() == [True, True, False, False]


def test_covers_are_told_of_the_triangles_alone() -> None:
    """Seams come last and have none."""
    every = np.array([True, False, True, True])
    mesh = ClosedMesh(
        np.zeros((3, 3)), np.zeros((4, 3), np.int64), np.array([0]), every, ~every,
        turned=False, gap=0.0, n_open=0, size=1.0,
    )  # fmt: skip
    signed, single = SOLID + SIGNED, SOLID + SINGLE
    assert mesh.covers.tolist() == [signed, single, signed]
    assert (SOLID | SIGNED | SINGLE) == SOLID + SIGNED + SINGLE
    assert mesh.closed and mesh.corners.shape == (4, 3, 3)
    for count, words in ((1, "an edge has"), (2, "2 edges have")):
        left = replace(mesh, n_open=count)
        assert not left.closed
        assert left.why_open == f"is not closed: {words} no partner"
