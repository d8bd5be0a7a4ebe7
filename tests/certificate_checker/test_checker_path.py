"""What the certificate checker says of the desired path, against plain geometry."""

from dataclasses import replace
from fractions import Fraction
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flint import arb, ctx

from vdsm_pin.certificate_checker.balls import (
    SLACK,
    Rejected,
    column,
    norm,
    number,
    unit,
)
from vdsm_pin.certificate_checker.path import Drawing
from vdsm_pin.certificate_checker.rows import Rows
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.pointing import Pointing

TINY = 1e-12


def path(rng: np.random.Generator, closed: bool) -> DesiredPath:
    corners = rng.uniform(-1.0, 1.0, (int(rng.integers(2, 7)), 3))
    return DesiredPath(corners[0], corners, closed)


def _draw(
    drawing: Drawing, begin: float, end: float, tips: Any, bend: float = 0.0
) -> None:
    """One interval between two stations."""
    stations = arb(begin), arb(end)
    start = drawing.local(stations[0])
    drawing.draw(start, drawing.step(*stations), tips, arb(bend))


def line(length: int, closed: bool) -> Drawing:
    """A drawing along x; a closed one goes there and back."""
    half = length / 2 if closed else float(length)
    corners = np.array([[0.0, 0.0, 0.0], [half, 0.0, 0.0]])
    return Drawing(DesiredPath(corners[0], corners, closed))


def places(asked: DesiredPath, stations: Any) -> Any:
    """Points of a path at arc lengths, shape (n,) to (n, 3); [m]."""
    corners = asked.points
    if asked.closed:
        corners = np.vstack([corners, corners[:1]])
    sides = np.linalg.norm(np.diff(corners, axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(sides)])
    along = np.mod(stations, at[-1]) if asked.closed else np.asarray(stations)
    return np.column_stack([np.interp(along, at, corners[:, k]) for k in range(3)])


def entries(point: Any) -> Any:
    return np.array([float(x) for x in point.entries()])


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("seed", range(5))
def test_points_of_the_path(seed: int, closed: bool) -> None:
    rng = np.random.default_rng(seed)
    asked = path(rng, closed)
    drawing = Drawing(asked)
    stations = rng.uniform(-0.5, 2.5, 20) * asked.length
    for station, place in zip(stations, places(asked, stations), strict=True):
        assert entries(drawing.point(arb(station))) == pytest.approx(place, abs=TINY)


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("seed", range(40))
def test_coverage_is_the_union_of_the_stretches(seed: int, closed: bool) -> None:
    """Length 32, whole numbers: a stretch is a set of unit pieces."""
    rng = np.random.default_rng(seed)
    drawing, drawn = line(32, closed), set()
    for _ in range(rng.integers(1, 5)):
        low = int(rng.integers(0, 80 if closed else 30))
        high = low + int(rng.integers(0, 40 if closed else 33 - low))
        drawing.stretches.append((arb(low), arb(high)))
        drawn |= {k % 32 for k in range(low, high)}
    assert float(drawing.coverage()) == float(Fraction(len(drawn), 32))


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("seed", range(20))
def test_the_deviation_is_the_largest_distance_at_the_same_share(
    seed: int, closed: bool
) -> None:
    """The tip on a chord, the path round its corners: sampled in doubles."""
    rng = np.random.default_rng(seed)
    asked = path(rng, closed)
    drawing, length = Drawing(asked), asked.length
    far = 0.49 * length if closed else length
    begin = rng.uniform(0, 2.0 * length if closed else length)
    end = begin + rng.uniform(-far, far)
    if not closed:
        end = float(np.clip(end, 0.0, length))
    share = np.linspace(0.0, 1.0, 4001)
    wanted = places(asked, begin + share * (end - begin))
    tips = wanted[[0, -1]] + rng.normal(0.0, 0.1, (2, 3)) * rng.integers(0, 2)
    found = tips[0] + share[:, None] * (tips[1] - tips[0])
    worst = np.linalg.norm(found - wanted, axis=1).max()
    bend = float(rng.choice([0.0, 0.25]))
    balls = [column(*tip.tolist()) for tip in tips]
    _draw(drawing, begin, end, balls, bend)
    step = 3.0 * length / 4000
    assert worst - TINY <= float(drawing.deviation) - bend <= worst + step
    assert float(drawing.coverage()) == pytest.approx(abs(end - begin) / length)


def test_what_is_drawn_in_one_go_is_one_stretch() -> None:
    drawing = line(8, closed=False)
    tip = [column(0, 0, 0)] * 2
    for begin, end in ((0, 2), (2, 3), (3, 1)):
        _draw(drawing, begin, end, tip)
    drawing.last = None
    _draw(drawing, 6, 7, tip)
    assert [(float(a), float(b)) for a, b in drawing.stretches] == [(0, 3), (6, 7)]
    assert float(drawing.coverage()) == 4 / 8


def test_a_path_of_one_point_is_drawn_by_one_row() -> None:
    drawing = Drawing(DesiredPath(np.zeros(3), np.ones((1, 3)), closed=True))
    assert entries(drawing.point(arb(3.0))).tolist() == [1.0, 1.0, 1.0]
    assert float(drawing.coverage()) == 0.0
    assert drawing.visit(arb(0), joined=False, same=arb(1e-6)) == 0
    assert float(drawing.coverage()) == 1.0


@pytest.mark.parametrize(
    "value", [True, "1", None, [1.0], float("nan"), float("inf"), -float("inf")]
)
def test_what_is_no_finite_number_is_refused(value: Any) -> None:
    with pytest.raises(Rejected, match="is not a finite number"):
        number(value)


def test_numbers_are_exact() -> None:
    assert number(-3) == -3
    assert number(0.1) == arb(0.1)


def test_a_unit_vector_has_length_1_and_the_same_direction() -> None:
    with ctx.workprec(128):
        assert entries(unit(column(0, 3, -4))).tolist() == [0.0, 0.6, -0.8]
        long = unit(column(1e9, 2e9, 3e9))
        assert abs(float(norm(long)) - 1.0) < TINY
    with pytest.raises(Rejected, match="length 0"):
        unit(column(0, 0, 0))


@pytest.mark.parametrize("same", [1e-6, 2.0**-21])
def test_a_hair_backwards_off_a_closed_path_is_not_once_round(same: float) -> None:
    drawing, same = line(8, closed=True), arb(same)
    drawing.visit(arb(3), joined=False, same=same)
    back = drawing.visit(arb(3 - 2.0**-21), joined=False, same=same)
    assert back == -(2.0**-21)
    on = drawing.visit(arb(2), joined=False, same=same)
    assert on == 7  # beyond the first one; the second lies a hair behind
    assert drawing.farthest == 7
    assert drawing.left


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("closed", [False, True])
def test_the_steepest_change_of_the_aim_is_that_of_one_side(
    seed: int, closed: bool
) -> None:
    """Difference of the directions at its corners over its length, in plain numbers."""
    rng = np.random.default_rng([7, seed])
    corners = rng.uniform(-1.0, 1.0, (int(rng.integers(3, 7)), 3))
    looks = rng.normal(size=(len(corners) + closed, 3))
    looks /= np.linalg.norm(looks, axis=1, keepdims=True)
    looks[-1] = looks[0] if closed else looks[-1]
    pointing = Pointing(0.1, directions=looks)
    asked = DesiredPath(corners[0], corners, closed, pointing=pointing)
    round_ = np.concatenate([corners, corners[: int(closed)]])
    sides = np.linalg.norm(np.diff(round_, axis=0), axis=1)
    turned = np.linalg.norm(np.diff(looks, axis=0), axis=1)
    found = float(Drawing(asked).steepest)
    assert found == pytest.approx((turned / sides).max(), rel=1e-12)
    straight = replace(asked, pointing=Pointing(0.1, directions=looks[:1]))
    assert float(Drawing(straight).steepest) == 0.0


@pytest.mark.parametrize(
    ("strays", "drawn", "said"),
    [
        (0.0, 0.0, ""),
        (0.5 * SLACK, -0.5 * SLACK, ""),
        (2.0 * SLACK, 0.0, "the tip strays 100.000002 mm from the path, 100 are"),
        (0.0, -2.0 * SLACK, "coverage is 0.499999998, required is 0.5"),
    ],
)
def test_rounding_is_all_that_a_drawing_may_fall_short(
    strays: float, drawn: float, said: str
) -> None:
    path = SimpleNamespace(spacing=0.1, required_coverage=0.5)
    asked = SimpleNamespace(path=path, tip_tolerance=1e-6)
    drawing: Any = SimpleNamespace(
        coverage=lambda: 0.5 + drawn, deviation=0.1 + strays, farthest=2.0, length=2.0,
        left=False, closed=False,
    )  # fmt: skip
    rows: Any = SimpleNamespace(problem=asked, ordered=True, drawing=drawing)
    if said:
        with pytest.raises(Rejected, match=said):
            Rows._drawn(rows)
    else:
        Rows._drawn(rows)
