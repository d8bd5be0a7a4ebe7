"""Plans beside obstacles that move: the arm waits until they rest, and it is proved."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from vdsm_pin import refinement
from vdsm_pin.cli import app
from vdsm_pin.errors import InvalidInput, NoPlanFound, OutOfTime
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.geometry.solids import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Mesh,
    PointCloud,
    Prism,
    Solid,
    Sphere,
    Voxels,
)
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.records import Plan
from vdsm_pin.planner.waiting import waited
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict

TEXT = """vdsm_problem: 1
name: door
length_unit: mm
manipulator: {link_lengths: [300, 300, 300], link_radius: 40, max_link_angle_deg: 60,
              max_joint_angle_deg: 60, base_range: [-2000, 2000]}
obstacles:
  - {name: door, shape: box, center: [0, 400, 0], size: [40, 800, 900], motion:
      {times_s: [1, 3], positions: [[%g, -400, 0], [%g, -400, 0]],
       rpy_deg: [[0, 0, 0], [0, 0, -90]]}}
tip_path: {start: [900, 0, 0], points: [[1700, 0, 0], [1700, 100, 0]]}
required_clearance: 5
"""


def problem_of(folder: Path, hinge: float = 1400.0) -> PlanningProblem:
    path = folder / "p.yaml"
    path.write_text(TEXT % (hinge, hinge), encoding="utf-8")
    return read_problem(path)


def test_the_arm_waits_until_the_door_is_open(tmp_path: Path) -> None:
    problem = problem_of(tmp_path)
    found = plan_and_verify(problem, "fewest")
    assert found.verification.verdict is Verdict.CERTIFIED
    assert found.verification.problem is not problem  # which promises small steps
    assert found.verification.problem.scene.moving
    motion = found.plan.trajectory
    assert motion.times is not None
    assert motion.times[:2].tolist() == [1.0, 3.0]
    assert (motion.joints[0] == motion.joints[1]).all()
    assert found.plan.centres.shape[0] == motion.n_samples
    assert found.plan.cable_lengths.shape[0] == motion.n_samples
    rates = np.abs(np.diff(motion.joints, axis=0)) / np.diff(motion.times)[:, None]
    assert np.rad2deg(rates[:, 1:].max()) <= 20.0 + 1e-9
    assert rates[:, 0].max() <= 0.2 + 1e-9
    assert any("waits at the start until 3 s" in note for note in found.plan.notes)


def test_a_door_that_swings_over_the_start_has_no_plan(tmp_path: Path) -> None:
    problem = problem_of(tmp_path, hinge=500.0)
    with pytest.raises(NoPlanFound, match="where all comes to rest, but not proved"):
        plan_and_verify(problem, "fewest")


def test_a_time_limit_before_the_proof_of_the_wait_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, deadline = problem_of(tmp_path), Deadline.after(600.0)

    def late(*args: Any) -> Plan:
        object.__setattr__(deadline, "end", 0.0)
        return waited(*args)

    monkeypatch.setattr(refinement, "waited", late)
    with pytest.raises(OutOfTime, match="600 s came first; a motion was found, but"):
        plan_and_verify(problem, "fewest", deadline=deadline)


def test_what_knows_no_time_refuses(tmp_path: Path) -> None:
    problem = problem_of(tmp_path)
    with pytest.raises(InvalidInput, match="'door' moves"):
        link_clearance(problem)
    out = str(tmp_path / "out")
    words = ["explain", str(tmp_path / "p.yaml"), "--out", out]
    found = CliRunner().invoke(app, words, obj="vdsm")
    assert found.exit_code and "'door' moves" in str(found.exception)
    words = ["plan", str(tmp_path / "p.yaml"), "--out", out, "--quiet"]
    assert CliRunner().invoke(app, words, obj="vdsm").exit_code == 0
    rows = str(tmp_path / "out" / "trajectory.csv")
    words = ["simulate", str(tmp_path / "p.yaml"), "--trajectory", rows]
    found = CliRunner().invoke(app, [*words, "--out", out + "2"], obj="vdsm")
    assert found.exit_code and "'door' moves" in str(found.exception)
    file = str(tmp_path / "c")
    words = ["verify", str(tmp_path / "p.yaml"), "--trajectory", rows, "--out"]
    words += [out + "3", "--certificate", file]
    found = CliRunner().invoke(app, words, obj="vdsm")
    assert found.exit_code == 0
    words = ["check-certificate", file, str(tmp_path / "p.yaml"), rows]
    assert CliRunner().invoke(app, words, obj="vdsm").exit_code == 0


def corners(solid: Solid) -> FloatArray:
    """Points that stand for a solid: the corners, centres or planes of its pieces."""
    rows = []
    for piece in solid.pieces:
        if hasattr(piece, "points"):
            rows.append(piece.points)
        elif hasattr(piece, "half_length"):
            offset = piece.half_length * piece.axis
            rows.append(np.array([piece.centre - offset, piece.centre + offset]))
    return np.concatenate(rows)


TRIANGLE = np.array([[0, 1, 2]])
SOLIDS: list[Solid] = [
    Sphere("a", np.array([0.1, 0.2, 0.3]), 0.1),
    Capsule("b", np.array([0.1, 0.2, 0.3]), np.array([0.6, 0.8, 0.0]), 0.2, 0.1),
    Cylinder("c", np.array([0.1, 0.2, 0.3]), np.array([0.6, 0.8, 0.0]), 0.2, 0.1),
    Box("d", np.array([0.1, 0.2, 0.3]), np.eye(3), np.array([0.1, 0.2, 0.3])),
    Prism("e", np.ones(3), np.eye(3), np.array([[0, 0], [1, 0], [0, 1]]), (0.0, 1.0)),
    Mesh("f", np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 1]]), TRIANGLE),
    PointCloud("g", np.array([[0.1, 0.2, 0.3], [1.0, 2.0, 3.0]]), 0.1),
    Voxels("h", np.array([[0.1, 0.2, 0.3]]), np.eye(3), np.array([0.1, 0.2, 0.3])),
]


@pytest.mark.parametrize("solid", SOLIDS, ids=lambda one: type(one).__name__)
def test_a_placed_solid_is_the_solid_elsewhere(solid: Solid) -> None:
    pose = np.eye(4)
    pose[:3, :3] = rotation_from_rpy(np.array([0.3, -0.7, 2.0]))
    pose[:3, 3] = 0.4, -0.5, 0.6
    moved = corners(solid) @ pose[:3, :3].T + pose[:3, 3]
    np.testing.assert_allclose(corners(solid.placed(pose)), moved, atol=1e-12)


def test_a_placed_half_space_has_its_points() -> None:
    pose = np.eye(4)
    pose[:3, :3] = rotation_from_rpy(np.array([0.3, -0.7, 2.0]))
    pose[:3, 3] = 0.4, -0.5, 0.6
    solid = HalfSpace("p", np.array([0.0, 0.0, 0.5]), np.array([0.0, 0.6, 0.8]))
    moved = solid.placed(pose)
    points = np.random.default_rng(0).normal(size=(50, 3))
    heights = (points - solid.point) @ solid.normal
    there = points @ pose[:3, :3].T + pose[:3, 3]
    np.testing.assert_allclose(
        (there - moved.point) @ moved.normal, heights, atol=1e-12
    )
