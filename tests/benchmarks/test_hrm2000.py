"""Generated problems have a certified witness; a spoiled one is refused."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.hrm2000.arms import NINE, PAPER
from benchmarks.hrm2000.carving import least_opening, sweep, tube
from benchmarks.hrm2000.curves import Bend, follow_the_leader, tip_curve
from benchmarks.hrm2000.families import FAMILIES
from benchmarks.hrm2000.generate import generate, verified, witness_of
from benchmarks.hrm2000.motions import DraftRejected, drawn_by_feeding
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory
from vdsm_pin.robot_model import load_robot
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.verify import verify

CURVE = tip_curve([Bend(0.2, 0.4, 0.9, 0.3), Bend(0.1, 0.5, 0.8, 2.5)])


def digest(folder: Path) -> dict[str, str]:
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.iterdir())
    }


def test_a_curve_is_run_through_at_unit_speed_without_a_kink() -> None:
    at = np.linspace(-0.5, 2.0, 2001)
    points = CURVE.at(at)
    step = at[1] - at[0]
    ways = np.diff(points, axis=0)
    # A chord of an arc of radius R is shorter by step^3 / 24 R^2.
    np.testing.assert_allclose(np.linalg.norm(ways, axis=1), step, rtol=1e-6)
    turns = np.linalg.norm(np.diff(ways, axis=0), axis=1) / step**2
    assert turns.max() <= 1.0 / 0.8 + 1e-6
    assert (points[at <= 0.2, 1:] == 0.0).all()


@pytest.mark.parametrize("arm", NINE, ids=lambda arm: arm.name)
def test_the_follower_has_its_joints_on_the_tips_curve(arm) -> None:
    curve = tip_curve([Bend(0.3, 0.5, 2.2, 1.0)])
    centres = follow_the_leader(arm, curve, np.linspace(0.0, 1.7, 40))
    lengths = np.linalg.norm(np.diff(centres, axis=1), axis=2)
    np.testing.assert_allclose(
        lengths, np.broadcast_to(arm.link_lengths, lengths.shape), rtol=0, atol=1e-12
    )
    fine = curve.at(np.linspace(-4.0, 1.71, 40_000))
    gaps = np.linalg.norm(centres[-1][:, None] - fine[None], axis=2).min(axis=1)
    assert gaps.max() <= 1e-4


def test_a_curve_too_tight_for_the_arm_has_no_witness() -> None:
    tight = tip_curve([Bend(0.1, 1.0, 0.25, 0.0)])
    with pytest.raises(DraftRejected):
        drawn_by_feeding(PAPER, tight, (-0.2, 0.8, 1.0), 0.01)


def test_the_least_opening_touches_the_room_of_the_sweep() -> None:
    witness = drawn_by_feeding(PAPER, CURVE, (-0.2, 1.4, 1.5), 0.01)
    swept = sweep(witness)
    least = least_opening(swept, 0.6, 0.03)
    assert least is not None
    fine = np.linspace(0.0, 1.0, 2001)[:, None, None, None]
    begins, ends = swept.centres[::5, :-1], swept.centres[::5, 1:]
    points = (begins + fine * (ends - begins)).reshape(-1, 3)
    within = np.abs(points[:, 0] - 0.6) <= 0.015 + swept.room
    off = np.abs(points[within, 1:] - least.centre) + swept.room - least.half
    assert (off <= 1e-9).all()
    assert (off.max(axis=0) >= -2e-3).all()


@pytest.mark.parametrize("capped", [False, True])
def test_a_tube_is_a_solid_of_the_volume_of_its_wall(capped: bool) -> None:
    straight = tip_curve([])
    solid = tube("t", straight, (0.0, 2.0), (0.1, 0.15), (96, 5), capped)
    corners = solid.vertices[solid.triangles]
    volume = (
        np.einsum(
            "ij,ij->i", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])
        ).sum()
        / 6.0
    )
    expected = np.pi * (0.15**2 - 0.1**2) * 2.0
    expected += np.pi * 0.15**2 * 0.05 if capped else 0.0
    assert volume == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize("family", ["port", "windows", "inside"])
def test_the_same_number_makes_the_same_files(family: str, tmp_path: Path) -> None:
    for folder in ("a", "b"):
        generate(tmp_path / folder, family, 3)
    assert digest(tmp_path / "a") == digest(tmp_path / "b")


@pytest.mark.parametrize("family", sorted(set(FAMILIES) - {"duct"}))
def test_a_witness_is_certified_and_one_that_is_spoiled_is_not(
    family: str, tmp_path: Path
) -> None:
    path = generate(tmp_path, family, 1).path
    assert verified(path).verdict is Verdict.CERTIFIED
    problem = read_problem(path).problem
    robot = load_robot(problem.manipulator)
    motion = read_trajectory(witness_of(path), problem.manipulator)
    assert verified(path).coverage >= 1.0 - 1e-9
    half = motion.part(0, motion.n_samples - 5)
    assert verify(problem, half, robot).verdict is not Verdict.CERTIFIED
    turned = replace(motion, alpha=motion.alpha + np.deg2rad(3.0))
    assert verify(problem, turned, robot).verdict is not Verdict.CERTIFIED
