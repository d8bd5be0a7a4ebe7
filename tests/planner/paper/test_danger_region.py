"""The danger region against shapely's buffers and hulls."""

import numpy as np
import pytest
import shapely

from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.planner.paper.region_kernels import leave_along, reach_along_circle

SHAPES = {
    "disc": [[0.7, 0.6]],
    "stadium": [[0.5, 0.7], [0.9, 0.5]],
    "triangle": [[0.5, 0.5], [0.9, 0.6], [0.6, 0.9]],
    "pentagon": [[0.5, 0.5], [0.8, 0.4], [1.0, 0.6], [0.9, 0.9], [0.6, 0.8]],
}
RADIUS = 0.15


def region(name: str) -> DangerRegion:
    return DangerRegion(name, np.array(SHAPES[name]), RADIUS)


def core(name: str) -> shapely.Geometry:
    return shapely.MultiPoint(SHAPES[name]).convex_hull


@pytest.mark.parametrize("name", SHAPES)
def test_distances_of_chains_agree_with_shapely(name: str) -> None:
    chains = np.random.default_rng(1).uniform(0.2, 1.3, (3000, 3, 2))
    expected = shapely.distance(core(name), shapely.linestrings(chains))
    np.testing.assert_allclose(region(name).core_distance(chains), expected, atol=1e-14)
    assert (expected == 0.0).sum() > (0 if name == "disc" else 100) - 1


@pytest.mark.parametrize("name", SHAPES)
def test_lines_leave_where_shapely_says(name: str) -> None:
    rng = np.random.default_rng(2)
    fine = core(name).buffer(RADIUS, quad_segs=4096)
    for _ in range(60):
        x, y = rng.uniform(0.3, 1.2, 2)
        angle = rng.uniform(-np.pi, np.pi)
        ux, uy = np.cos(angle), np.sin(angle)
        mine = region(name)
        far = leave_along(mine.corners, mine.sides, RADIUS, x, y, ux, uy)
        line = shapely.LineString([[x - 9 * ux, y - 9 * uy], [x + 9 * ux, y + 9 * uy]])
        cut = shapely.get_coordinates(line.intersection(fine))
        if len(cut):
            along = ((cut - [x, y]) @ [ux, uy]).max()
            assert far == pytest.approx(along, abs=2e-4)
        elif not line.dwithin(fine, 1e-6):
            assert far == -np.inf


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("side", [1, -1])
def test_circles_about_the_origin_end_on_the_boundary(name: str, side: int) -> None:
    mine = region(name)
    low = float(mine.core_distance(np.zeros((1, 2, 2)))[0]) - RADIUS
    bearing = float(np.arctan2(*mine.centre[::-1]))
    for circle in np.linspace(low + 1e-6, low + 0.28, 40):
        turn = reach_along_circle(
            mine.corners, mine.sides, RADIUS, float(circle), bearing, side
        )
        for step, outside in ((0.0, None), (1e-6, True), (-1e-6, False)):
            angle = bearing + side * (turn + step)
            point = circle * np.array([np.cos(angle), np.sin(angle)])
            gap = shapely.distance(core(name), shapely.Point(point)) - RADIUS
            if outside is None:
                assert gap == pytest.approx(0.0, abs=1e-12)
            elif outside:
                assert gap > 0.0


@pytest.mark.parametrize("name", SHAPES)
@pytest.mark.parametrize("sense", [1, -1])
def test_walks_are_the_taut_ways_round(name: str, sense: int) -> None:
    """A walk is one side of the hull of both ends and the region."""
    rng = np.random.default_rng(4)
    mine, body = region(name), core(name).buffer(RADIUS, quad_segs=1024)
    for _ in range(30):
        ends = rng.uniform(-0.5, 2.0, (2, 2))
        if mine.contains(ends).any():
            continue
        walk = mine.walk(ends[0], ends[1], sense)
        np.testing.assert_array_equal(walk[[0, -1]], ends)
        inside = mine.radius - mine.core_distance(np.stack([walk[1:-1]]))
        assert inside.max() <= 1e-9
        if not shapely.LineString(ends).crosses(body):
            continue
        length = np.linalg.norm(np.diff(walk, axis=0), axis=1).sum()
        hull = shapely.union(body, shapely.MultiPoint(ends)).convex_hull
        other = mine.walk(ends[0], ends[1], -sense)
        both = length + np.linalg.norm(np.diff(other, axis=0), axis=1).sum()
        assert both == pytest.approx(hull.length, abs=2e-5)


@pytest.mark.parametrize("name", SHAPES)
def test_the_shadow_is_where_the_straight_arm_meets_the_region(name: str) -> None:
    mine = region(name)
    points = np.random.default_rng(5).uniform(-0.3, 2.0, (4000, 2))
    points = points[~mine.contains(points)]
    arms = np.stack([np.zeros_like(points), points], axis=1)
    gap = mine.core_distance(arms) - mine.radius
    clear_cut = np.abs(gap) > 1e-6
    covered = mine.covers(points)
    np.testing.assert_array_equal(covered[clear_cut], (gap < 0.0)[clear_cut])
    assert covered.sum() > 200


@pytest.mark.parametrize("name", SHAPES)
def test_rounded_sections_hold_the_section_and_each_other(name: str) -> None:
    section = DangerRegion(name, np.array(SHAPES[name]), 0.05)
    smaller = core(name).buffer(0.05)
    for rounding in (0.25, 0.5, 1.0):
        rounded = section.rounded(rounding)
        hull = shapely.MultiPoint(rounded.corners).convex_hull
        larger = hull.buffer(rounded.radius, quad_segs=256)
        assert larger.buffer(1e-5).covers(smaller)
        smaller = larger
