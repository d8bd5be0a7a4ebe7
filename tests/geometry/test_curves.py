"""Arcs and splines against their closed forms, and how far their chords stray."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.curves import arc_through, circle_from, spline_through

seeds = st.integers(0, 2**32 - 1)
tolerances = st.floats(1e-3, 0.3)


def strayed(curve: FloatArray, corners: FloatArray) -> float:
    """Largest distance of points of a curve from a polyline."""
    a, ab = corners[:-1], np.diff(corners, axis=0)
    arm = curve[:, None] - a
    t = np.clip((arm * ab).sum(-1) / (ab * ab).sum(-1), 0.0, 1.0)
    away = arm - t[..., None] * ab
    return float(np.linalg.norm(away, axis=-1).min(axis=1).max())


@given(seeds, tolerances, st.floats(0.01, 7.0), st.sampled_from([-1, 1]))
def test_a_circle_is_met_at_its_corners_and_left_by_less_than_the_tolerance(
    seed: int, tolerance: float, angle: float, sense: int
) -> None:
    turn = sense * angle
    rng = np.random.default_rng(seed)
    frame, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    frame[:, 2] *= np.sign(np.linalg.det(frame))
    centre, radius = rng.normal(size=3), rng.uniform(0.1, 3.0)

    def at(angles: FloatArray) -> FloatArray:
        flat = np.array([np.cos(angles), np.sin(angles), 0.0 * angles])
        return np.asarray(centre + radius * (frame @ flat).T)

    start = at(np.zeros(1))[0]
    corners = circle_from(start, centre, 2.0 * frame[:, 2], turn, tolerance)
    angles = turn * np.arange(1, len(corners) + 1) / len(corners)
    assert corners == pytest.approx(at(angles), abs=1e-12)
    fine = at(turn * np.linspace(0.0, 1.0, 777))
    assert strayed(fine, np.vstack([start, corners])) <= tolerance + 1e-12


def test_a_whole_turn_ends_where_it_begins_to_the_last_bit() -> None:
    start, centre = np.array([3126.0, 0.1, -200.3]), np.array([3126.0, 0.0, 0.0])
    corners = circle_from(start, centre, np.array([1.0, 0, 0]), -2.0 * np.pi, 0.05)
    assert (corners[-1] == start).all()


@given(seeds, tolerances)
def test_an_arc_runs_through_its_three_points_in_their_order(
    seed: int, tolerance: float
) -> None:
    rng = np.random.default_rng(seed)
    start, middle, end = rng.normal(size=(3, 3))
    if np.linalg.norm(np.cross(middle - start, end - start)) < 0.1:
        return
    corners = arc_through(start, middle, end, tolerance)
    assert (corners[-1] == end).all()
    path = np.vstack([start, corners])
    fine = arc_through(start, middle, end, 1e-4)
    assert strayed(middle[None], np.vstack([start, fine])) < 1.001e-4
    assert strayed(fine, path) <= tolerance + 1e-4


@given(seeds, tolerances, st.integers(2, 7))
def test_a_spline_meets_its_points_and_is_left_by_less_than_the_tolerance(
    seed: int, tolerance: float, count: int
) -> None:
    points = np.random.default_rng(seed).normal(size=(count, 3))
    corners = np.vstack([points[0], spline_through(points, tolerance)])
    for point in points:
        assert (corners == point).all(axis=1).any()
    fine = spline_through(points, 1e-4)
    assert strayed(fine, corners) <= tolerance + 1e-9


def test_a_spline_through_points_of_a_line_is_that_line() -> None:
    points = np.array([0.0, 1.0, 4.0, 4.5])[:, None] * np.array([1.0, 2.0, -1.0])
    corners = spline_through(points, 1e-3)
    along = corners @ np.array([1.0, 2.0, -1.0]) / 6.0
    assert corners == pytest.approx(along[:, None] * [1.0, 2.0, -1.0], abs=1e-12)
    assert (np.diff(along) > 0.0).all()


def test_a_spline_has_one_tangent_at_a_point() -> None:
    points = np.array([[0.0, 0, 0], [1, 0.5, 0], [1.2, 2, 1], [3, 3, 3]])
    corners = np.vstack([points[0], spline_through(points, 1e-9)])
    for point in points[1:-1]:
        (i,) = np.flatnonzero((corners == point).all(axis=1))
        before, after = corners[i] - corners[i - 1], corners[i + 1] - corners[i]
        before /= np.linalg.norm(before)
        after /= np.linalg.norm(after)
        assert before == pytest.approx(after, abs=1e-3)


ORIGIN = np.zeros(3)
X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize(
    ("curve", "why"),
    [
        (lambda: circle_from(X, ORIGIN, ORIGIN, 1.0, 0.1), "without direction"),
        (lambda: circle_from(X, X, Z, 1.0, 0.1), "at its own centre"),
        (lambda: circle_from(X + 0.5 * Z, ORIGIN, Z, 1.0, 0.1), "0.5 radii off"),
        (lambda: circle_from(X, ORIGIN, Z, 1.0, 1e-300), "more than 1000000 corners"),
        (lambda: arc_through(ORIGIN, X, 2.0 * X, 0.1), "three points on one line"),
        (lambda: arc_through(X, X, Z, 0.1), "three points on one line"),
        (lambda: spline_through(np.array([X, X]), 0.1), "a point twice in a row"),
        (
            lambda: spline_through(np.array([X, Z, 5.0 * X]), 1e-300),
            "more than 1000000 corners",
        ),
    ],
)
def test_what_is_no_curve_is_refused(curve: object, why: str) -> None:
    with pytest.raises(InvalidInput, match=why):
        curve()  # type: ignore[operator]
