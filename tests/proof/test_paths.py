"""Oracle: the polynomials themselves, by their coefficients."""

from itertools import pairwise

import numpy as np
import pytest

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.proof.motions import bound_column, interpolate
from vdsm_pin.proof.paths import Path, together


def value(path: Path, k: int, t: float) -> FloatArray:
    q = np.zeros(path.knots.shape[1])
    interpolate(path.packed(), k, t, q)
    return q


def made(degree: int, rng: np.random.Generator) -> tuple[Path, FloatArray]:
    """A path whose only column is a polynomial of its degree in time."""
    times = np.cumsum(rng.uniform(0.3, 2.0, 4))
    p = np.polynomial.Polynomial(rng.normal(size=degree + 1))
    q, rates, changes = (p.deriv(m)(times)[:, None] for m in range(3))
    if degree == 1:
        return Path(q, times=times), p
    if degree == 3:
        return Path.through(q, times, rates), p
    return Path.through(q, times, rates, changes), p


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_pieces_are_the_polynomials_that_they_fit(degree: int) -> None:
    rng = np.random.default_rng(degree)
    for _ in range(20):
        path, p = made(degree, rng)
        assert path.inner.shape == ((0, 0, 1) if degree == 1 else (3, degree - 1, 1))
        for k in range(3):
            start, end = path.times[k : k + 2]
            for t in [0.0, 1.0, *rng.uniform(size=5)]:
                assert value(path, k, t)[0] == pytest.approx(
                    p(start + t * (end - start))
                )


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_bounds_hold_over_every_slice(degree: int) -> None:
    rng, out = np.random.default_rng(degree), np.zeros(3)
    for _ in range(40):
        path, p = made(degree, rng)
        start, end = np.sort(rng.uniform(size=2))
        first, after = path.times[1:3]
        bound_column(path.packed(), 1, 0, start, end, out)
        t = first + np.linspace(start, end, 50) * (after - first)
        for m in range(3):
            most = np.abs(p.deriv(m)(t)).max() * (after - first) ** m
            assert most <= out[m] * (1.0 + 1e-9) + 1e-9
            if degree > 1:
                far = np.abs(p.deriv(m)(np.linspace(first, after, 50))).max()
                assert out[m] <= 40.0 * far * (after - first) ** m + 1e-9


def test_paths_together_move_as_each_does_alone() -> None:
    rng = np.random.default_rng(7)
    for _ in range(60):
        paths = [made(int(rng.choice([1, 3, 5])), rng)[0] for _ in range(3)]
        shifted = [
            Path(p.knots, p.inner, p.times + rng.uniform(-2.0, 2.0)) for p in paths
        ]
        both = together(*shifted)
        assert set(both.times) == set(np.concatenate([p.times for p in shifted]))
        for k in range(both.n_intervals):
            for t in (0.0, 0.3, 1.0):
                now = both.times[k] + t * (both.times[k + 1] - both.times[k])
                for column, path in enumerate(shifted):
                    at = int(np.searchsorted(path.times, now, side="right")) - 1
                    at = min(max(at, 0), path.n_intervals - 1)
                    length = path.times[at + 1] - path.times[at]
                    share = np.clip((now - path.times[at]) / length, 0.0, 1.0)
                    expected = value(path, at, float(share))[0]
                    assert value(both, k, t)[column] == pytest.approx(
                        expected, abs=1e-9
                    )


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Path(np.zeros(3)), "expected"),
        (lambda: Path(np.zeros((0, 2))), r"shape \(0, 2\)"),
        (lambda: Path(np.full((2, 1), np.nan)), "not finite"),
        (lambda: Path(np.zeros((2, 1)), np.full((1, 2, 1), np.nan)), "not finite"),
        (lambda: Path(np.zeros((2, 1)), np.zeros((1, 3, 1))), "2 or 4, 1"),
        (lambda: Path(np.zeros((2, 1)), np.zeros((1, 2, 2))), "control points"),
        (lambda: Path(np.zeros((2, 1)), times=np.array([0, np.inf])), "all finite"),
        (lambda: Path(np.zeros((2, 1))).at(np.zeros(1)), "need times"),
        (lambda: Path(np.zeros((3, 1)), np.zeros((2, 1, 1))), "control points"),
        (lambda: Path(np.zeros((2, 1)), times=np.zeros(2)), "rise"),
        (lambda: Path(np.zeros((2, 1)), times=np.zeros(3)), "times have shape"),
        (
            lambda: Path.through(np.zeros((2, 1)), np.arange(2), np.zeros((2, 2))),
            "rates",
        ),
        (lambda: together(Path(np.zeros((2, 1)))), "need times"),
    ],
)
def test_what_is_no_path_is_refused(make: object, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        make()  # type: ignore[operator]


def test_rows_within_intervals_are_those_at_their_times() -> None:
    """Also at the ends, and of a single row."""
    rng = np.random.default_rng(7)
    times = np.cumsum(rng.uniform(0.1, 1.0, 6))
    path = Path.through(rng.normal(size=(6, 3)), times, rng.normal(size=(6, 3)))
    intervals = rng.integers(0, 5, 200)
    shares = np.concatenate([np.zeros(20), np.ones(20), rng.uniform(size=160)])
    moments = times[intervals] + shares * np.diff(times)[intervals]
    np.testing.assert_allclose(
        path.within(intervals, shares), path.at(moments), atol=1e-12
    )
    np.testing.assert_array_equal(path.at_moments(np.arange(6.0)), path.knots)
    for seed in range(40):  # an interval ends at its knot to the last bit
        ends = Path(np.random.default_rng(seed).normal(size=(4, 3)))
        at_end = ends.within(np.arange(3), np.ones(3))
        np.testing.assert_array_equal(at_end, ends.knots[1:])
    one = Path(path.knots[:1])
    np.testing.assert_array_equal(
        one.within(intervals[:2], shares[:2])[1], one.knots[0]
    )


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_a_path_says_how_far_it_goes_and_rests_outside_of_its_times(
    degree: int,
) -> None:
    rng = np.random.default_rng([degree, 8])
    for _ in range(20):
        path, _ = made(degree, rng)
        assert (path.degree, path.n_samples, path.n_intervals) == (degree, 4, 3)
        assert path.reach.tolist() == [np.abs(path.controls).max()]
        before, after = path.times[0] - 1.0, path.times[-1] + 1.0
        outside = path.at(np.array([before, after, *path.times]))[:, 0]
        ends = path.knots[[0, -1, 0, 1, 2, 3], 0]
        np.testing.assert_allclose(outside, ends, atol=1e-12)
        moments = rng.uniform(0.0, 3.0, 9)
        told = path.times_at(moments)
        assert told == pytest.approx(np.interp(moments, np.arange(4), path.times))
        intervals, shares = path.split(np.append(moments, 3.0))
        assert (intervals[-1], shares[-1]) == (2, 1.0)
        assert intervals[:-1].tolist() == np.floor(moments).tolist()
        assert shares[:-1] == pytest.approx(moments % 1.0)
        assert path.same_as(Path(path.knots, path.inner, path.times))
        assert not path.same_as(Path(path.knots, path.inner, path.times + 1.0))
        assert not path.same_as(Path(path.knots + 1.0, path.inner, path.times))
        assert Path(path.knots).times_at(moments) is None
    one = Path(path.knots[:1], times=np.zeros(1))
    assert (one.n_intervals, one.degree) == (1, 1)
    assert np.array_equal(one.at(np.array([-1.0, 0.0, 2.0])), path.knots[[0, 0, 0]])


def test_paths_together_begin_and_end_where_they_are_asked_to() -> None:
    rng = np.random.default_rng(9)
    for _ in range(20):
        (one, _), (other, _) = made(3, rng), made(1, rng)
        low, high = np.sort(rng.uniform(-1.0, 8.0, 2)).tolist()
        both = together(one, other, within=(low, high))
        knots = {*one.times.tolist(), *other.times.tolist()}
        inside = sorted(t for t in knots if low < t < high)
        assert both.times.tolist() == [low, *inside, high]
        t = np.append(rng.uniform(low, high, 9), [low, high])
        np.testing.assert_allclose(both.at(t)[:, 0], one.at(t)[:, 0], atol=1e-9)
        np.testing.assert_allclose(both.at(t)[:, 1], other.at(t)[:, 0], atol=1e-9)
        (at_once,) = together(one, other, within=(low, low)).knots
        assert at_once == pytest.approx([one.at(t[-2:])[0, 0], other.at(t[-2:])[0, 0]])


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_a_path_cut_in_parts_is_the_same_motion(degree: int) -> None:
    rng = np.random.default_rng([degree, 7])
    for _ in range(20):
        path, p = made(degree, rng)
        counts = rng.integers(1, 6, 3)
        cut, own = path.cut(counts), cut_times(path, counts)
        np.testing.assert_allclose(cut.own_times, own, rtol=1e-14)
        assert np.isin(path.knots, cut.knots).all()
        for k, (start, end) in enumerate(pairwise(own)):
            for t in [0.0, 1.0, *rng.uniform(size=3)]:
                expected = p(start + t * (end - start))
                assert value(cut, k, t)[0] == pytest.approx(expected, abs=1e-9)


def cut_times(path: Path, counts: IntArray) -> FloatArray:
    """Those of a path with its intervals in so many parts, one after the other."""
    found = [path.own_times[:1]]
    for k, count in enumerate(counts.tolist()):
        start, end = path.own_times[k : k + 2]
        found.append(np.linspace(start, end, count + 1)[1:])
    return np.concatenate(found)


@pytest.mark.parametrize("which", [0, 1])
def test_rates_are_of_the_knots(which: int) -> None:
    knots, times = np.zeros((3, 2)), np.arange(3.0)
    assert Path.through(knots, times, knots, knots).degree == 5
    names = "rates", "accelerations"
    for shape in ((2, 2), (3, 1), (3,)):
        given = [knots, knots]
        given[which] = np.zeros(shape)
        with pytest.raises(ValueError, match=f"{names[which]} have shape"):
            Path.through(knots, times, *given)
    for wrong in ([0.0, 1.0], [0.0, 1.0, 1.0], [0.0, 2.0, 1.0], [0.0, 1.0, np.nan]):
        with pytest.raises(ValueError, match="times"):
            Path.through(knots, np.array(wrong), knots, knots)
