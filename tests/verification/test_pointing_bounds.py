"""What bounds the last link's angle, number by number; oracle: the sums written out."""

from typing import Any

import numpy as np
import pytest

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.pointing import AimError, Pointing
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification import pointing
from vdsm_pin.verification.pointing import (
    ROUNDING,
    _intervals,
    _Motion,
    _Slices,
    _Worst,
)

ARM = built_in("hrm8")
BOX = ErrorBox(joint=0.003, base=0.002, base_turn=0.001)


def random_motion(
    rng: np.random.Generator, degree: int
) -> tuple[PlanningProblem, Trajectory]:
    """Any motion beside any path, closed or not, by laps or less."""
    n, links = int(rng.integers(2, 8)), ARM.n_links
    joints = 0.1 * rng.normal(size=(n, 1 + 2 * links)).cumsum(axis=0)
    more = {}
    if degree > 1:
        more["times"] = np.cumsum(rng.uniform(0.5, 2.0, n))
        more["rates"] = 0.1 * rng.normal(size=joints.shape)
    if degree > 3:
        more["changes"] = 0.1 * rng.normal(size=joints.shape)
    corners = np.array([2.0, 0.0, 0.0]) + rng.normal(size=(int(rng.integers(3, 6)), 3))
    closed = bool(rng.integers(2))
    m = len(corners) + closed
    look = [
        Pointing(1.0, target=np.add([6.0, 0.0, 0.0], rng.normal(size=3))),
        Pointing(1.0, directions=rng.normal(size=(1, 3))),
        Pointing(1.0, directions=np.add([2.0, 0, 0], rng.normal(size=(m, 3)))),
    ][int(rng.integers(3))]
    if closed and look.directions is not None and len(look.directions) > 1:
        directions = np.array(look.directions)
        directions[-1] = directions[0]
        look = Pointing(1.0, directions=directions)
    path = DesiredPath(corners[0], corners, closed=closed, pointing=look)
    stations = rng.uniform(0.0, path.length, n).cumsum() if closed else np.sort(
        rng.uniform(0.0, path.length, n)
    )  # fmt: skip
    on = rng.random(n) < 0.7
    motion = Trajectory(
        on, stations, joints[:, 0], joints[:, 1::2], joints[:, 2::2], **more
    )
    return PlanningProblem(ARM, Scene(), path, 0.0, name="p"), motion


def expected_intervals(on: Any) -> list[tuple[int, int]]:
    """Intervals whose rows are both on the path, then rows with no neighbour on it."""
    n = len(on)
    both = [(k, k + 1) for k in range(n - 1) if on[k] and on[k + 1]]
    beside = {k for pair in both for k in pair}
    return [*both, *((k, k) for k in range(n) if on[k] and k not in beside)]


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_a_motion_is_bounded_by_the_sums_of_its_rates(
    degree: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pointing, "CHUNK", 3)
    rng = np.random.default_rng(degree)
    for _ in range(40):
        problem, motion = random_motion(rng, degree)
        chunks = list(_intervals(motion))
        found = [*zip(*(np.concatenate(x).tolist() for x in zip(*chunks, strict=True)),
                      strict=True)] if chunks else []  # fmt: skip
        assert found == expected_intervals(motion.on_path)
        assert all(len(first) <= 3 for first, _ in chunks)
        for first, after in chunks:
            some = _Motion(problem, motion, first, after, BOX)
            for row, (k, last) in enumerate(zip(first, after, strict=True)):
                check_interval(problem, motion, some, row, (int(k), int(last)))
            pieces = some.pieces[..., 0]
            assert some.far == np.abs(pieces).max()
            check_slices(rng, problem, some)


def check_interval(
    problem: PlanningProblem,
    motion: Trajectory,
    some: _Motion,
    row: int,
    rows: tuple[int, int],
) -> None:
    k, last = rows
    path, look = problem.path, problem.path.pointing
    assert look is not None
    if last == k:
        assert (some.pieces[row] == motion.joints[k]).all()
        run = 0.0
    else:
        piece = motion.path.controls[k]
        assert np.array_equal(some.pieces[row], piece)
        run = float(motion.path_m[last] - motion.path_m[k])
        if path.closed:
            run -= path.length * np.ceil(run / path.length - 0.5)
    degree = len(some.pieces[row]) - 1
    rates = degree * np.abs(np.diff(some.pieces[row], axis=0)).max(axis=0)
    turning, speed = 0.0, rates[0]
    for j in range(ARM.n_links):
        turns = rates[1 + 2 * j] + rates[2 + 2 * j]
        turning += turns
        speed += turns * ARM.link_lengths[j:].sum()
    assert some.turning[row] == pytest.approx(turning)
    assert some.speed[row] == pytest.approx(speed)
    begin = motion.path_m[k] % path.length if path.closed else motion.path_m[k]
    assert some.station[row] == pytest.approx(begin)
    assert some.run[row] == pytest.approx(run, abs=1e-12)
    steep = 0.0
    if look.directions is not None and len(look.directions) > 1:
        sides = np.diff(path.corner_stations)
        change = np.linalg.norm(np.diff(look.directions, axis=0), axis=1)
        steep = float((change / sides).max())
    assert some.swerve[row] == pytest.approx(steep * abs(run), abs=1e-12)


def angle(
    problem: PlanningProblem, some: _Motion, row: int, share: float
) -> tuple[float, float]:
    """Between the last link and its aim, and the aim's length, in plain arithmetic."""
    points = some.pieces[row]
    while len(points) > 1:
        points = points[:-1] + share * np.diff(points, axis=0)
    q, path = points[0], problem.path
    centres = joint_centres(ARM, q[:1], q[None, 1::2], q[None, 2::2])[0]
    station = some.station[row] + share * some.run[row]
    station = station % path.length if path.closed else station
    (aim,) = path.aims(centres[None, -1], np.array([station]))
    axis, size = centres[-1] - centres[-2], float(np.linalg.norm(aim))
    cosine = axis @ aim / (np.linalg.norm(axis) * size)
    return float(np.arccos(np.clip(cosine, -1.0, 1.0))), size


def check_slices(
    rng: np.random.Generator, problem: PlanningProblem, some: _Motion
) -> None:
    """Ends, halves and bounds of some slices; no angle within is above its bound."""
    look, m = problem.path.pointing, len(some.pieces)
    assert look is not None
    whole = some.whole()
    assert whole.interval.tolist() == list(range(m))
    assert not whole.low.any() and (whole.high == 1.0).all()
    slices, rounds = whole, int(rng.integers(0, 5))
    for _ in range(rounds):
        halves, middle = some.halved(slices), (slices.low + slices.high) / 2.0
        assert np.array_equal(halves.low, np.append(slices.low, middle))
        assert np.array_equal(halves.high, np.append(middle, slices.high))
        assert np.array_equal(halves.interval, np.tile(slices.interval, 2))
        slices = halves.take(rng.random(len(halves.low)) < 0.6)
    bounds = some.bounds(slices)
    error = AimError.of(look, ARM, BOX)

    def wider(size: float) -> float:
        return float(error.widening(np.array([size]), np.array([some.far]))[0])

    for k in range(len(slices.low)):
        row, low, high = int(slices.interval[k]), slices.low[k], slices.high[k]
        ends = [angle(problem, some, row, float(share)) for share in (low, high)]
        told = (
            (slices.angle[k], slices.next_angle[k]),
            (slices.size[k], slices.next_size[k]),
        )
        for (seen, size), said, length in zip(ends, *told, strict=True):
            assert length == pytest.approx(size)
            assert said == pytest.approx(seen + wider(size), abs=1e-7)
        width, sizes = high - low, [size for _, size in ends]
        moved = (some.speed if look.target is not None else some.swerve)[row] * width
        nearest = (sum(sizes) - moved) / 2.0
        if nearest <= 0.0:
            assert bounds[k] == np.inf
            continue
        turned = some.turning[row] * width + moved / nearest
        middle = (ends[0][0] + ends[1][0]) / 2.0 + wider(nearest)
        expected = middle + turned / 2.0 + ROUNDING * (1.0 + 1.0 / nearest)
        assert bounds[k] == pytest.approx(expected, abs=1e-7)
        for share in rng.uniform(low, high, 3):
            assert (
                angle(problem, some, row, share)[0] + wider(nearest) <= bounds[k] + 1e-7
            )


def test_bounds_hold_rounding_of_short_aims() -> None:
    """At rest an angle is bounded by itself and what rounding may come to."""
    problem, motion = random_motion(np.random.default_rng(3), 1)
    rows = np.zeros(1, np.int64)
    some = _Motion(problem, motion, rows, rows, ErrorBox())
    one, zero = np.ones(1), np.zeros(1)
    for size in (1e-3, 1.0):
        slices = _Slices(rows, zero, one, 0.5 * one, 0.5 * one, size * one, size * one)
        more = some.bounds(slices)[0] - 0.5
        assert more == pytest.approx(ROUNDING * (1.0 + 1.0 / size), rel=1e-3)
    nothing = _Slices(rows, zero, one, 0.5 * one, 0.5 * one, zero, zero)
    unseen = _Slices(rows, zero, one, np.nan * one, 0.5 * one, one, one)
    assert some.bounds(nothing)[0] == some.bounds(unseen)[0] == np.inf


def slices_of(angle: FloatArray, after: FloatArray) -> _Slices:
    n = len(angle)
    low = np.linspace(0.0, 0.5, n)
    return _Slices(np.arange(n), low, low + 0.25, angle, after, np.ones(n), np.ones(n))


def test_the_largest_angle_and_bound_are_kept_with_their_moments() -> None:
    rng, first = np.random.default_rng(4), 10 + np.arange(4)
    for _ in range(60):
        worst, most, at = _Worst(), 0.0, np.nan
        for _ in range(4):
            angles = rng.integers(-1, 6, (2, 4)).astype(float)
            angles[rng.random((2, 4)) < 0.2] = np.nan
            slices = slices_of(*angles)
            worst.look(slices, first)
            for side in range(2):
                for k in range(4):
                    if angles[side, k] > most:
                        most = angles[side, k]
            ends = np.stack([slices.low, slices.high]) + first
            moments = ends[angles == most].tolist()
            if worst.at != at and not (np.isnan(worst.at) and np.isnan(at)):
                assert worst.at == moments[0]
            at = worst.at
            assert worst.seen == most
            bounds = rng.uniform(0.0, 6.0, 4)
            before = (worst.bound, worst.bound_at)
            worst.settle(bounds, slices, first)
            k = int(np.argmax(bounds))
            now = (
                (bounds[k], first[k] + slices.low[k])
                if bounds[k] > before[0]
                else before
            )
            assert (worst.bound, worst.bound_at) == now
            worst.settle(np.zeros(0), slices, first)
            assert (worst.bound, worst.bound_at) == now
