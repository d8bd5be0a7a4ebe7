"""Obstacles that move beside a robot: spheres against sampled closed forms."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from oracles.shortcuts import named, read_rows

from tests.robots.test_robots import write
from vdsm_pin.certificate_checker import Outcome, check_certificate
from vdsm_pin.certificate_writer.certificate import write_certificate
from vdsm_pin.certificate_writer.lines import Hashes
from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.source import sha256_of_file
from vdsm_pin.problem.error_boxes import TypedErrorBox
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.proof.paths import Path as Motion
from vdsm_pin.proof.terms import CERTIFIED, REFUTED
from vdsm_pin.repair.robot import repair_robot
from vdsm_pin.robots.cell import Cell, read_cell
from vdsm_pin.robots.judgement import verify_robot
from vdsm_pin.verification.moving import PART, Knots, in_short_parts
from vdsm_pin.verification.records import CheckKind, Verdict

URDF = """<robot name="two"><link name="base"/>
  <link name="upper"><collision><origin xyz="0.5 0 0"/>
    <geometry><sphere radius="0.04"/></geometry></collision></link>
  <link name="fore"><collision><origin xyz="0.4 0 0"/>
    <geometry><sphere radius="0.03"/></geometry></collision></link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="9"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="fore"/>
    <origin xyz="0.5 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="9"/></joint>
</robot>
"""
RADII = np.array([0.04, 0.03])
BALL, POST = 0.05, 0.06


def cell_with(folder: Path, times: FloatArray, places: FloatArray) -> Cell:
    """The robot beside a ball that goes straight from place to place, and a post."""
    write(folder, "two.urdf", URDF)
    knots = f"times_s: {times.tolist()}, positions: {places.tolist()}"
    text = (
        "vdsm_problem: 1\nlength_unit: m\nrobot: {urdf: two.urdf}\n"
        "required_clearance: 0.01\nobstacles:\n"
        f"  - {{name: ball, shape: sphere, center: [0, 0, 0], radius: {BALL},\n"
        f"     motion: {{{knots}}}}}\n"
        f"  - {{name: post, shape: sphere, center: [-0.9, 0, 0], radius: {POST}}}\n"
    )
    return read_cell(write(folder, "cell.yaml", text))


def gaps(q: FloatArray, centres: FloatArray) -> FloatArray:
    """Clearance of both links from the ball at rows of q, shape (n, 2); [m]."""
    a, b = q[:, 0], q.sum(axis=1)
    elbow = 0.5 * np.stack([np.cos(a), np.sin(a), 0.0 * a], axis=1)
    tip = elbow + 0.4 * np.stack([np.cos(b), np.sin(b), 0.0 * b], axis=1)
    off = np.stack([elbow, tip], axis=1) - centres[:, None]
    return np.asarray(np.linalg.norm(off, axis=2) - RADII - BALL)


def along(times: FloatArray, knots: FloatArray, at: FloatArray) -> FloatArray:
    """Straight lines between knots, at rest outside, shape (n, n_columns)."""
    columns = [np.interp(at, times, column) for column in knots.T]
    return np.stack(columns, axis=1)


@pytest.mark.parametrize("seed", range(6))
def test_clearances_are_those_of_dense_samples(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    rows, knots = rng.uniform(-2.0, 2.0, (4, 2)), rng.uniform(-1.0, 1.0, (3, 3))
    times, moves = np.array([0.0, 1.0, 1.5, 4.0]), np.array([0.5, 1.25, 3.0])
    cell = cell_with(tmp_path, moves, knots)
    result = verify_robot(cell, named(Motion(rows, times=times)))
    at = np.linspace(0.0, 4.0, 40_001)
    truth = gaps(along(times, rows, at), along(moves, knots, at))
    for pair, low, high, verdict in zip(
        result.pairs,
        result.least.lower,
        result.least.upper,
        result.least.verdict,
        strict=True,
    ):
        if pair.obstacle != "ball":
            continue
        least = float(truth[:, pair.link - 1].min())
        assert max(low, 0.0) <= max(least, 0.0) + 1e-12
        assert least - 2e-4 <= max(high, 0.0) or least < 0.0
        assert verdict == (CERTIFIED if least >= 0.01 else REFUTED)
    for near in result.approaches:  # told in rows of the trajectory
        time = np.interp(near.interval + near.share, np.arange(4.0), times)
        q, ball = along(times, rows, [time]), along(moves, knots, [time])
        if near.pair.obstacle == "ball" and near.upper > 0.0:
            found = float(gaps(q, ball)[0, near.pair.link - 1])
            assert near.lower - 1e-9 <= found <= near.upper + 1e-9
            assert near.coal == pytest.approx(found, abs=1e-6)


def test_a_ball_too_early_is_refuted_and_in_time_is_not(tmp_path: Path) -> None:
    # The arm, stretched, sweeps from 0 to 90 deg in a second; the ball falls through
    # the place that its tip has left.
    rows, times = np.array([[0.0, 0.0], [np.pi / 2, 0.0]]), np.array([0.0, 1.0])
    drop = np.array([[0.9, 0.0, 0.5], [0.9, 0.0, 0.0]])
    late = cell_with(tmp_path, np.array([0.5, 1.0]), drop)
    motion = named(Motion(rows, times=times))
    assert verify_robot(late, motion).verdict is Verdict.CERTIFIED
    early = cell_with(tmp_path, np.array([-1.0, 0.0]), drop)
    result = verify_robot(early, motion)
    assert result.verdict is Verdict.REFUTED
    assert result.closest(1)[0].pair.obstacle == "ball"
    row = next(check for check in result.checks if check.name == CheckKind.OBSTACLES)
    assert row.moment == pytest.approx(0.0, abs=0.05)


def test_errors_of_a_robot_beside_what_moves_are_covered(tmp_path: Path) -> None:
    rng = np.random.default_rng(4)
    rows, times = rng.uniform(-1.0, 1.0, (3, 2)), np.array([0.0, 1.0, 2.0])
    moves, knots = np.array([0.2, 1.4]), rng.uniform(-1.0, 1.0, (2, 3))
    box = TypedErrorBox(joint_deg=2.0, obstacle_mm=3.0)
    cell = cell_with(tmp_path, moves, knots).under(box)
    result = verify_robot(cell, named(Motion(rows, times=times)))
    at = np.linspace(0.0, 2.0, 5_001)
    q, ball, worst = along(times, rows, at), along(moves, knots, at), np.full(2, np.inf)
    for signs in np.array([*np.ndindex(3, 3)]) - 1.0:
        off = np.radians(2.0) * signs
        worst = np.minimum(worst, gaps(q + off, ball).min(axis=0) - 3e-3)
    lows = {
        pair.link: low
        for pair, low in zip(result.pairs, result.least.lower, strict=True)
        if pair.obstacle == "ball"
    }
    assert all(lows[link] <= least for link, least in enumerate(worst, start=1))
    assert min(lows.values()) >= worst.min() - 0.02


@pytest.mark.parametrize("seed", range(4))
def test_certificates_beside_what_moves(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    rows, knots = rng.uniform(-1.0, 1.0, (3, 2)), rng.uniform(-1.0, 1.0, (3, 3))
    knots[:, 2] += 0.4  # the ball keeps above the arm
    moves = np.array([0.1, 0.8, 1.7])
    body = [
        f"{a!r},{b!r},{t!r}" for (a, b), t in zip(rows.tolist(), (0, 1, 2), strict=True)
    ]
    file = write(tmp_path, "t.csv", "\n".join(["shoulder_rad,elbow_rad,time_s", *body]))
    cell = cell_with(tmp_path, moves, knots)
    if seed % 2:
        cell = cell.under(TypedErrorBox(joint_deg=0.3, base_mm=1.0))
    found = verify_robot(cell, read_rows(file, cell.robot))
    assert found.verdict is Verdict.CERTIFIED
    proof, problem = tmp_path / "c", tmp_path / "cell.yaml"

    def outcome() -> Outcome:
        source = read_cell(problem).source
        assert source is not None
        hashes = Hashes(source.sha256, sha256_of_file(file))
        write_certificate(proof, found, hashes)
        return check_certificate(proof, problem, file)

    assert outcome().accepted
    # The same planes beside a ball that comes through the tip, or in another time.
    tip = 0.5 * np.array([np.cos(rows[1, 0]), np.sin(rows[1, 0]), 0.0])
    cell_with(tmp_path, moves, np.vstack([knots[:1], tip[None], knots[2:]]))
    assert not outcome().accepted
    cell_with(tmp_path, moves - 0.6, knots)
    assert not outcome().accepted


def test_a_counterexample_beside_what_moves_is_told_in_rows(tmp_path: Path) -> None:
    rows, times = np.array([[0.0, 0.0], [0.5, 0.0], [0.6, 0.2]]), np.arange(3.0)
    moves, knots = np.array([0.5, 1.7]), np.array([[0.0, 1.5, 0.0], [0.5, 1.1, 0.0]])
    near = cell_with(tmp_path, moves, knots)
    motion = Motion(rows, times=times)
    least = verify_robot(near, named(motion)).least
    asked = replace(near, required_clearance=float(least.lower.min()) - 0.01)
    result = verify_robot(asked.under(TypedErrorBox(joint_deg=3.0)), named(motion))
    (lost,) = result.counterexamples
    assert result.verdict is Verdict.REFUTED
    assert result.nominal_clear
    assert len(lost.joints) == 2
    time = np.array([lost.moment])  # rows are a second apart
    nominal = along(times, rows, time)[0]
    np.testing.assert_allclose(lost.joints - lost.offsets, nominal, atol=1e-12)
    assert (np.abs(lost.offsets) <= np.radians(3.0)).all()
    gap = gaps(lost.joints[None], along(moves, knots, time))[0, lost.pair.link - 1]
    assert gap == pytest.approx(lost.clearance, abs=1e-6)
    assert gap < asked.required_clearance


def test_what_is_not_done_beside_what_moves_is_said(tmp_path: Path) -> None:
    cell = cell_with(tmp_path, np.array([0.0, 1.0]), np.ones((2, 3)))
    joints = tuple(joint.name for joint in cell.robot.joints)
    rows = np.array([[0.0, 0.0], [1.0, 0.0]])
    with pytest.raises(InvalidInput, match="no column 'time_s', but obstacle 'ball'"):
        verify_robot(cell, named(Motion(rows)))
    with pytest.raises(InvalidInput, match="no column 'time_s', but obstacle 'ball'"):
        repair_robot(cell, JointTrajectory(joints, rows))


def test_a_motion_beside_what_moves_is_repaired_in_its_time(tmp_path: Path) -> None:
    """The ball comes near the tip's circle and leaves; samples keep clear of it."""
    rows, times = np.array([[0.0, 0.3], [1.2, 0.3]]), np.array([0.0, 2.0])
    q = np.array([0.6, 0.9])
    tip = np.array([0.5 * np.cos(q[0]), 0.5 * np.sin(q[0]), 0.0])
    tip += 0.43 * np.array([np.cos(q[1]), np.sin(q[1]), 0.0])
    moves, knots = np.array([0.5, 1.0, 1.5]), np.array([1.5, 1.06, 1.5])[:, None] * tip
    cell = cell_with(tmp_path, moves, knots)
    joints = tuple(joint.name for joint in cell.robot.joints)
    motion = JointTrajectory(joints, rows, times)
    assert verify_robot(cell, motion).verdict is Verdict.REFUTED
    found = repair_robot(cell, motion)
    path = found.verification.trajectory.path
    assert found.verification.verdict is Verdict.CERTIFIED
    assert path.knots[[0, -1]].tolist() == rows.tolist()
    assert path.own_times[[0, -1]].tolist() == times.tolist()
    at = np.linspace(0.0, 2.0, 20_001)
    assert gaps(path.at(at), along(moves, knots, at)).min() >= 0.01
    moved = np.abs(path.knots - along(times, rows, path.own_times)).max(axis=1)
    np.testing.assert_allclose(found.moved, moved, atol=1e-12)
    assert moved.max() < 0.3


def test_parts_of_long_intervals_are_told_in_those_of_the_trajectory() -> None:
    rng = np.random.default_rng(12)
    for _ in range(50):
        times = np.cumsum(rng.uniform(0.1, 1.0, int(rng.integers(2, 6))))
        path = Motion(rng.normal(size=(len(times), 2)), times=times)
        more = rng.uniform(times[0], times[-1], int(rng.integers(0, 5)))
        union = np.unique(np.concatenate([times, more]))
        whole = Motion(path.at(union), times=union)
        cut, knots = in_short_parts(whole, Knots.of(path, union))
        assert np.abs(np.diff(cut.knots, axis=0)).max() <= PART + 1e-12
        inner, share = rng.integers(0, cut.n_intervals, 20), rng.uniform(size=20)
        told = path.within(knots.interval(inner), knots.share(inner, share))
        np.testing.assert_allclose(told, cut.within(inner, share), atol=1e-12)
