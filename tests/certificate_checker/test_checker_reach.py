"""How far the checker takes a point to reach in a slice, by the formula of the docs."""

from itertools import pairwise
from math import cos, sin
from typing import Any

import numpy as np
import pytest
from flint import arb
from oracles.tree_certificates import controls

from vdsm_pin.certificate_checker.balls import column, cross, dot, norm
from vdsm_pin.certificate_checker.motion import Branch, Interval, Slices
from vdsm_pin.certificate_checker.solids import Body, Solid, away
from vdsm_pin.certificate_checker.tree import SLIDES, TURNS, Joint, Tree

LEVER = 0.7
"""Of the point about the joint; [m]."""

HIGH = 3.0
"""How high the joint stands, which no height along y depends on; [m]."""


def reached(
    width: float,
    errors: tuple[float, float, float],
    disc: float = 0.0,
    share: float = 1.0,
) -> tuple[float, float]:
    """Largest y of a point on the x axis that turns about z, errors included; [m].

    It turns by `width` in a slice that is the first `share` of an interval. Then the
    size of all that this is made of.
    """
    place = np.eye(4)
    place[2, 3] = HIGH
    joint = Joint(0, TURNS, (0, 0, 1), place, (0, 1.0, 0.0), errors)
    tree = Tree([joint])
    interval = Interval(tree, controls([0, width / share]))
    slices = Slices(tree, [(interval, 0.0, share)])
    ends = [[[LEVER, 0.0, 0.0], [LEVER / 2.0, 0.0, 0.0]]]
    point = Solid("point", ends, disc=((1.0, 0.0, 0.0), disc))
    body, at = Body(1, point), np.zeros(1, np.int64)
    found, size = slices.reach(body, 0, at, np.array([[0.0, 1.0, 0.0]]))
    return found.item(), size.item()


@pytest.mark.parametrize("width", [0.0, 0.1, 0.8])
@pytest.mark.parametrize("error", [0.0, 1e-3, 0.1])
@pytest.mark.parametrize("tilt", [0.0, 2e-3, 0.05])
@pytest.mark.parametrize("disc", [0.0, 0.2])
@pytest.mark.parametrize("share", [1.0, 0.25])
def test_reach_is_that_of_the_docs(
    width: float, error: float, tilt: float, disc: float, share: float
) -> None:
    """Height at an end, M h^2 / 8, h D / 2, Q, and what errors move at the ends."""
    far, turned = LEVER + disc, error + tilt
    end = LEVER * sin(width) + disc * cos(width)
    bend = far * width**2 * (1.0 + tilt) / 8.0
    drift, second = far * error * width / 2.0, far * turned**2 / 2.0
    moved = error * LEVER * (1.0 + cos(width)) / 2.0 + tilt * LEVER
    heights = max(disc, end)
    more = bend + drift + second + disc * turned + moved
    found, size = reached(width, (error, 0.0, tilt), disc, share)
    assert found == pytest.approx(heights + more, rel=1e-12)
    assert size == pytest.approx(HIGH + far + more + far * turned, rel=1e-12)


@pytest.mark.parametrize("width", [0.1, 0.8])
@pytest.mark.parametrize("error", [0.0, 0.05])
def test_reach_is_an_upper_bound(width: float, error: float) -> None:
    """Of the exact motion within the errors, at many moments."""
    angles = np.linspace(0.0, width, 101)[:, None] + np.linspace(-error, error, 21)
    assert (LEVER * np.sin(angles)).max() <= reached(width, (error, 0.0, 0.0))[0]


@pytest.mark.parametrize("inner", [2, 4])
@pytest.mark.parametrize("n_rates", [0, 1, 2])
def test_pieces_are_of_the_degree_of_what_is_given(inner: int, n_rates: int) -> None:
    """Straight, by control points in between, or by rates at both ends."""
    knots, rates = np.zeros((3, 5)), [np.zeros((3, 5))] * n_rates
    assert Branch(knots, None, None, rates).degree == 1 + 2 * n_rates
    assert Branch(knots, None, np.zeros((2, inner, 5))).degree == 1 + inner
    assert Branch(knots[:1], None, None, rates).degree == 1


@pytest.mark.parametrize("part", [(0.0, 1.0), (0.25, 0.5), (0.5, 1.0), (0.0, 0.5)])
def test_rates_of_a_part_are_those_within_it(part: tuple[float, float]) -> None:
    """Of q = 3 t^2, whose joint turns by 2 q: value, rate and its change at the end."""
    tree = Tree([Joint(0, TURNS, (0, 0, 1), np.eye(4), (0, 2.0, 0.0))])
    interval = Interval(tree, controls([0, 0, 3]))
    end = part[1]
    (found,) = Slices(tree, [(interval, *part)]).bounds
    assert found[:, 0] == pytest.approx([6.0 * end**2, 12.0 * end, 12.0], rel=1e-11)


def exact(point: Any) -> arb:
    """The length of a vector of doubles."""
    return norm(column(*point.tolist()))


def test_bounds_lie_above_what_rounding_loses_of_them() -> None:
    """In balls: lengths, errors, values and rates that planes are worked out of."""
    rng = np.random.default_rng(3)
    for kind in (TURNS, SLIDES):
        place, axis = np.eye(4), rng.normal(size=3)
        place[:3, 3] = rng.normal(size=3)
        value, moved, tilt, offset = rng.uniform(0.1, 1.0, 4)
        made = Joint(0, kind, axis, place, (0, -2.0, offset), (value, moved, tilt))
        assert arb(made.lever) > exact(place[:3, 3])
        still = Joint(0, kind, axis, place, (None, 1.0, offset))
        assert still.bounds(None)[0, 0] > offset
        assert made.tilt > tilt
        assert made.turn_error > value if kind == TURNS else made.turn_error == 0.0
        least = arb(moved) + (arb(value) if kind == SLIDES else 0)
        assert arb(made.slip) > least
        points = [arb(x) for x in rng.normal(size=4)]
        interval = Interval(tree := Tree([made]), controls(points))
        (found,) = Slices(tree, [(interval, 0.0, 1.0)]).bounds
        steps = [b - a for a, b in pairwise(points)]
        twice = [6 * (b - a) for a, b in pairwise(steps)]
        for bound, values in zip(
            found[:, 0].tolist(), (points, [3 * x for x in steps], twice), strict=True
        ):
            more = arb(offset) if values is points else arb(0)
            assert all(arb(bound) > abs(2 * x) + more for x in values)
    corners = rng.normal(size=(1, 8, 3))
    solid = Solid("hull", corners, disc=((1.0, 0.0, 0.0), 0.25))
    levers = zip(solid.levers.tolist(), corners[0], strict=True)
    assert all(arb(far) > exact(point) + arb(0.25) for far, point in levers)
    corners[0] -= (corners[0].min(axis=0) + corners[0].max(axis=0)) / 2.0
    corners[0, :2] = [-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]  # their middle is 0
    assert arb(away(corners[0] / 8.0, 0.5)) > exact(corners[0, 1]) / 8 + arb(0.5)


def test_products_of_balls_are_those_of_vectors() -> None:
    for a, b in np.random.default_rng(2).normal(size=(20, 2, 3)):
        one, other = column(*a), column(*b)
        assert float(dot(one, other)) == pytest.approx(a @ b)
        found = [float(x) for x in cross(one, other).entries()]
        assert found == pytest.approx(np.cross(a, b).tolist())
        assert float(norm(one)) == pytest.approx(np.linalg.norm(a))
