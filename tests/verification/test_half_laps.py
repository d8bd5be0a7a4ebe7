"""Steps along a closed path: verifier and checker take the same way round, always."""

import math
from fractions import Fraction
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from flint import arb, ctx

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.certificate_checker.balls import column
from vdsm_pin.certificate_checker.path import Drawing
from vdsm_pin.errors import InvalidFile, InvalidInput
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.drawing import exact_length, runs

PRECISION = 128


def closed_path(points: object) -> DesiredPath:
    corners = np.array(points, dtype=float)
    return DesiredPath(corners[0], corners, closed=True)


def rectangle(rng: np.random.Generator) -> tuple[DesiredPath, Fraction]:
    """A rectangle, or a line there and back, and its exact length."""
    y, z = rng.uniform(-3, 3, 2)
    w, h = 10.0 ** rng.uniform(-3, 1, 2)
    corners = [[3.0, y, z], [3.0, y + w, z]]
    if rng.uniform() < 0.7:
        corners += [[3.0, y + w, z + h], [3.0, y, z + h]]
    sides = [
        sum(abs(Fraction(q) - Fraction(p)) for p, q in zip(a, b, strict=True))
        for a, b in pairwise([*corners, corners[0]])
    ]
    return closed_path(corners), sum(sides, Fraction(0))


def steps(rng: np.random.Generator, length: Fraction) -> np.ndarray:
    """Stations a whole number of half laps apart, exactly or to a unit or two."""
    found = [Fraction(0)]
    for _ in range(12):
        half_laps = int(rng.integers(1, 6)) * int(rng.choice([-1, 1]))
        found.append(abs(found[-1] + half_laps * length / 2))
    stations = np.array([float(station) for station in found])
    return np.abs(stations + rng.integers(-2, 3, 13) * np.spacing(stations))


def checkers_run(path: DesiredPath, begin: float, end: float) -> float:
    """How far the checker goes along the path, over an interval of its own."""
    with ctx.workprec(PRECISION):
        drawing, tip = Drawing(path), column(3, 0, 0)
        stations = [arb(begin), arb(end)]
        start, run = drawing.local(stations[0]), drawing.step(*stations)
        drawing.draw(start, run, [tip, tip], arb(0))
        return float(drawing.last - start)


def exact_run(length: Fraction, begin: float, end: float) -> Fraction:
    """The shorter way round, forwards where both are as long."""
    step = Fraction(end) - Fraction(begin)
    return step - length * math.ceil(step / length - Fraction(1, 2))


@pytest.mark.parametrize("seed", range(60))
def test_both_programs_take_the_same_way_round(seed: int) -> None:
    rng = np.random.default_rng(seed)
    path, length = rectangle(rng)
    stations = steps(rng, length)
    for k, run in enumerate(runs(path, stations).tolist()):
        pair = stations[k].item(), stations[k + 1].item()
        true = float(exact_run(length, *pair))
        assert run == pytest.approx(true, abs=1e-12 * float(length))
        assert checkers_run(path, *pair) == pytest.approx(true, abs=1e-12)


@pytest.mark.parametrize("seed", range(30))
def test_both_agree_on_paths_of_no_exact_length(seed: int) -> None:
    rng = np.random.default_rng(1000 + seed)
    path = closed_path(rng.uniform(-1, 1, (int(rng.integers(2, 7)), 3)))
    stations = steps(rng, Fraction(path.length))
    for k, run in enumerate(runs(path, stations).tolist()):
        theirs = checkers_run(path, stations[k].item(), stations[k + 1].item())
        assert run == pytest.approx(theirs, abs=1e-12)


def test_a_whole_tie_goes_forwards() -> None:
    path = closed_path([[3, 0, 0], [3, 1, 0]])
    found = runs(path, np.array([0.0, 1.0, 0.0, 3.0, 0.5]))
    np.testing.assert_array_equal(found, [1.0, 1.0, 1.0, -0.5])


def test_lengths_are_known_to_a_rounding_or_two() -> None:
    """Of many sides too; a plain sum of these loses some forty times as much."""
    rng = np.random.default_rng(5)
    path = closed_path(rng.uniform(-1, 1, (20_000, 3)))
    exact = exact_length(path)
    assert abs(Fraction(path.length) - exact) <= 4 * Fraction(np.spacing(path.length))


def test_a_path_m_beyond_its_extent_is_refused(tmp_path: Path) -> None:
    n, most = 2, TOLERANCES.path_extent
    parts = np.zeros(n), np.zeros((n, 8)), np.zeros((n, 8))
    motion = Trajectory(np.ones(n, bool), np.array([0.0, most]), *parts)
    write_trajectory(motion, tmp_path / "t.csv")
    read_trajectory(tmp_path / "t.csv", built_in("hrm8"))
    text = (tmp_path / "t.csv").read_text().replace("10000.0", "10000.000000000002")
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(InvalidFile, match="line 3: path_m is 10000, expected 0 to 1"):
        read_trajectory(tmp_path / "t.csv", built_in("hrm8"))
    with pytest.raises(InvalidInput, match="path_m beyond 10000 m"):
        Trajectory(np.ones(n, bool), np.array([0.0, 1e12]), *parts)
