"""The distance of two segments, against every case of the closed form."""

import itertools

import numpy as np
import pytest

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.segments import squared_gap


def _to_point(p: FloatArray, a: FloatArray, b: FloatArray) -> float:
    along = b - a
    square = float(along @ along)
    t = np.clip((p - a) @ along / square, 0.0, 1.0) if square else 0.0
    return float(np.sum((a + t * along - p) ** 2))


def _apart(a: FloatArray, b: FloatArray, p: FloatArray, q: FloatArray) -> float:
    """Least of the four ends against the other segment and the inner points."""
    cases = [_to_point(a, p, q), _to_point(b, p, q), _to_point(p, a, b)]
    cases.append(_to_point(q, a, b))
    sides = np.column_stack([b - a, p - q])
    inner, _, rank, _ = np.linalg.lstsq(sides, p - a)
    if rank == 2 and (inner >= 0.0).all() and (inner <= 1.0).all():
        cases.append(float(np.sum((a - p + sides @ inner) ** 2)))
    return min(cases)


def _random_ends(rng: np.random.Generator, kind: str) -> FloatArray:
    a, b, p, q = rng.normal(size=(4, 3)) * rng.choice([0.1, 1.0, 10.0], size=(4, 1))
    if kind == "parallel":
        q = p + rng.normal() * (b - a)
    elif kind == "point and segment":
        q = p.copy()
    elif kind == "segment and point":
        b = a.copy()
    elif kind == "points":
        b, q = a.copy(), p.copy()
    elif kind == "sharing an end":
        p = b.copy()
    elif kind == "on a grid":
        a, b, p, q = rng.integers(-2, 3, size=(4, 3)).astype(float)
    return np.stack([a, b, p, q])


@pytest.mark.parametrize(
    "kind",
    [
        "any",
        "parallel",
        "point and segment",
        "segment and point",
        "points",
        "sharing an end",
        "on a grid",
    ],
)
def test_distance_is_the_least_of_all_cases(kind: str) -> None:
    rng = np.random.default_rng(5)
    for _ in range(300):
        ends = _random_ends(rng, kind)
        size = 1.0 + float(np.abs(ends).max()) ** 2
        assert abs(squared_gap(*ends) - _apart(*ends)) <= 1e-12 * size


def test_distance_is_the_same_whichever_way_round() -> None:
    rng = np.random.default_rng(6)
    for _ in range(100):
        a, b, p, q = _random_ends(rng, "any")
        turned = [
            squared_gap(*one, *other)
            for one, other in itertools.product(((a, b), (b, a)), ((p, q), (q, p)))
        ]
        turned.append(squared_gap(p, q, a, b))
        np.testing.assert_allclose(turned, turned[0], rtol=1e-9, atol=1e-13)
