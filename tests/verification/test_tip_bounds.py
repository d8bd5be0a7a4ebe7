"""The tip between the rows; oracles: many moments of the motion, a sum written out."""

import numpy as np
import pytest

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.bernstein import derivative
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification import tip
from vdsm_pin.verification.drawing import runs, wrapped
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.tip import check_tip, second_derivatives

ARM = built_in("hrm8")
LENGTHS = ARM.link_lengths


def tips_of(joints: np.ndarray) -> np.ndarray:
    return joint_centres(ARM, joints[:, 0], joints[:, 1::2], joints[:, 2::2])[:, -1]


def random_motion(
    rng: np.random.Generator, degree: int, off: float = 0.0
) -> tuple[PlanningProblem, Trajectory]:
    """A motion whose tip meets the corners of its path, but for an error, at most rows.

    Some corners are passed between two rows.
    """
    n, links = int(rng.integers(3, 9)), ARM.n_links
    moves = 0.01 * rng.normal(size=(n, 1 + 2 * links)).cumsum(axis=0)
    more = {}
    if degree > 1:
        more["times"] = np.cumsum(rng.uniform(0.5, 2.0, n))
        more["rates"] = 0.01 * rng.normal(size=moves.shape)
    if degree > 3:
        more["changes"] = 0.01 * rng.normal(size=moves.shape)
    corners = tips_of(moves) + off * rng.uniform(-1, 1, (n, 3))
    closed, skipped = bool(rng.integers(2)) and n > 3, int(rng.integers(0, 2 * n))
    path = DesiredPath(corners[0], corners, closed=closed)
    keep = np.arange(n) != skipped
    stations = path.corner_stations[:n].copy()
    if closed:  # begun anywhere, past the seam
        begun = int(rng.integers(0, n))
        moves, stations = np.roll(moves, -begun, axis=0), np.roll(stations, -begun)
        stations[n - begun :] += path.length
        stations += path.length * rng.integers(0, 3)
    stations = stations[keep]
    more = {name: value[keep] for name, value in more.items()}
    on = rng.random(keep.sum()) < 0.9
    angles = moves[keep, 1::2], moves[keep, 2::2]
    motion = Trajectory(on, stations, moves[keep, 0], *angles, **more)
    tolerance = {"tip_tolerance": max(off, 1e-9)}
    return PlanningProblem(ARM, Scene(), path, 0.0, name="p", **tolerance), motion


def seen_deviation(problem: PlanningProblem, motion: Trajectory) -> np.ndarray:
    """Largest distance of the tip from its place on the path, by interval; [m]."""
    path, worst = problem.path, np.full(motion.n_samples - 1, -np.inf)
    start, run = wrapped(path, motion.path_m), runs(path, motion.path_m)
    corners = np.add.outer([-path.length, 0, path.length], path.corner_stations).ravel()
    for k in range(motion.n_samples - 1):
        if motion.on_path[k] and motion.on_path[k + 1]:
            t = np.linspace(0.0, 1.0, 201)
            if run[k]:
                at = (corners - start[k]) / run[k]
                t = np.append(t, at[(at > 0.0) & (at < 1.0)])
            tips = tips_of(motion.path.at_moments(k + t))
            places = path.at(wrapped(path, start[k] + run[k] * t))
            worst[k] = np.linalg.norm(tips - places, axis=1).max()
    return worst


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_the_second_derivative_is_the_sum_of_the_docs(
    degree: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tip, "CHUNK", 3)
    rng = np.random.default_rng(degree)
    for _ in range(30):
        _, motion = random_motion(rng, degree)
        found = second_derivatives(ARM, motion)
        assert found.shape == (motion.n_samples - 1,)
        for k, piece in enumerate(motion.path.controls):
            rates = derivative(piece[None])[0]
            changes = derivative(rates[None])[0] if degree > 1 else 0.0 * rates
            expected = np.abs(changes[:, 0]).max() if degree > 1 else 0.0
            turning = growing = 0.0
            for i in range(ARM.n_links):
                both = [1 + 2 * i, 2 + 2 * i]
                turning += np.abs(rates[:, both]).max(axis=0).sum()
                growing += np.abs(changes[:, both]).max(axis=0).sum()
                expected += LENGTHS[i] * (turning**2 + growing)
            assert found[k] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_the_deviation_bounds_what_the_tip_does(
    degree: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tip, "CHUNK", 3)
    rng, drawn = np.random.default_rng(7 + degree), 0
    for _ in range(60):
        problem, motion = random_motion(rng, degree, rng.choice([0.0, 1e-3]))
        seen, report = seen_deviation(problem, motion), check_tip(problem, motion)
        (row,) = [one for one in report.checks if "between" in one.name]
        both = motion.on_path[:-1] & motion.on_path[1:]
        assert row.count == both.sum()
        if not both.any():
            assert (report.deviation, row.verdict) == (0.0, Verdict.UNDECIDED)
            continue
        drawn += 1
        parts = 32 if degree > 1 else 1
        # Of the chord at both ends of a part, and of corners on it.
        slack = 4.0 * second_derivatives(ARM, motion) / (8.0 * parts**2)
        assert row.worst == report.deviation
        assert seen.max() < report.deviation
        assert report.deviation <= np.where(both, seen + slack, 0.0).max() + 1e-8
        assert seen[int(row.moment)] + slack[int(row.moment)] >= row.worst - 1e-8
        near = report.deviation <= problem.path.spacing
        assert row.verdict is (Verdict.CERTIFIED if near else Verdict.UNDECIDED)
    assert drawn > 40


def test_a_row_off_the_path_is_named_with_its_distance() -> None:
    rng, verdicts = np.random.default_rng(3), []
    for _ in range(60):
        problem, motion = random_motion(rng, 1, 1e-3)
        path, tips = problem.path, tips_of(motion.joints)
        gap = np.linalg.norm(tips - path.at(wrapped(path, motion.path_m)), axis=1)
        gap[~motion.on_path] = -1.0
        (row,) = [one for one in check_tip(problem, motion).checks
                  if "at the waypoints" in one.name]  # fmt: skip
        assert row.count == motion.on_path.sum()
        if not row.count:
            assert row.verdict is Verdict.UNDECIDED
            continue
        assert row.worst == pytest.approx(gap.max(), abs=1e-12)
        assert row.moment == gap.argmax()
        kept = gap.max() <= problem.tip_tolerance
        assert row.verdict is (Verdict.CERTIFIED if kept else Verdict.REFUTED)
        verdicts.append(row.verdict)
    assert {*verdicts} == {Verdict.CERTIFIED, Verdict.REFUTED}


def test_of_a_single_row_the_deviation_is_its_distance() -> None:
    rng = np.random.default_rng(5)
    for _ in range(20):
        problem, motion = random_motion(rng, 1, 1e-3)
        one = motion.part(0, 1)
        place = problem.path.at(wrapped(problem.path, one.path_m))
        gap = np.linalg.norm(tips_of(one.joints) - place)
        report = check_tip(problem, one)
        (row,) = [each for each in report.checks if "between" in each.name]
        if not one.on_path[0]:
            assert report.deviation == 0.0
            continue
        assert gap < report.deviation <= gap + 1e-10
        assert (row.count, row.moment, row.worst) == (1, 0, report.deviation)


@pytest.mark.parametrize("row", [1, 3, 5])
def test_a_row_off_the_path_counts_in_both_of_its_intervals(row: int) -> None:
    rng = np.random.default_rng(6)
    problem, motion = random_motion(rng, 1)
    while motion.n_samples < 7 or not motion.on_path.all():
        problem, motion = random_motion(rng, 1)
    joints = motion.joints.copy()
    joints[row, 0] += 0.5
    moved = Trajectory.of_joints(joints, motion.on_path, motion.path_m)
    found = tip._deviations(problem, moved, tips_of(joints))
    assert (found[[row - 1, row]] > 0.4).all()
    assert (np.delete(found, [row - 1, row]) < 0.2).all()


@pytest.mark.parametrize("scale", [1.0, 0.01])
@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("seed", range(4))
def test_a_chord_is_off_most_at_its_ends_or_at_corners_on_its_way(
    seed: int, closed: bool, scale: float
) -> None:
    """Past the seam too, forwards and backwards; oracle: 20,001 moments."""
    rng, shares = np.random.default_rng([14, seed]), np.linspace(0.0, 1.0, 20_001)
    for _ in range(12):
        corners = scale * rng.normal(size=(int(rng.integers(3, 7)), 3))
        path = DesiredPath(corners[0], corners, closed=closed)
        begin, run = rng.uniform(0.0, path.length), rng.uniform(-0.5, 0.5) * path.length
        if not closed:
            run = np.clip(begin + run, 0.0, path.length) - begin
        tips = scale * np.array([rng.normal(size=3), rng.normal(size=3)])
        at = wrapped(path, begin + shares * run)
        chord = tips[0] + shares[:, None] * (tips[1] - tips[0])
        off = np.linalg.norm(chord - path.at(at), axis=1)
        asked = path, tips, np.array([begin]), np.array([run]), np.array([0])
        (inner,) = tip._corner_deviation(*asked)
        most = max(inner, off[0], off[-1])
        assert most == pytest.approx(off.max(), abs=2e-3 * scale)
        assert most >= off.max() - 1e-9


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_the_worst_deviation_is_told_in_the_interval_where_it_is(degree: int) -> None:
    """Smooth pieces are cut for the bound; one row is 0.5 m off."""
    rng = np.random.default_rng([8, degree])
    for _ in range(10):
        problem, motion = random_motion(rng, degree)
        row = int(rng.integers(0, motion.n_samples))
        joints = motion.joints.copy()
        joints[row, 0] += 0.5
        more = motion.times, motion.rates, motion.changes
        motion = Trajectory.of_joints(joints, motion.on_path, motion.path_m, *more)
        drawn = motion.on_path[:-1] & motion.on_path[1:]
        if not (drawn[max(row - 1, 0) : row + 1]).any():
            continue
        report = check_tip(problem, motion)
        (told,) = [each for each in report.checks if "between" in each.name]
        assert row - 1 <= told.moment <= row
