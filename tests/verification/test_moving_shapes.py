"""Every shape that moves against the same shape at rest: two ways to say one thing."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene, solid_of
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.brackets import ClearanceChunk
from vdsm_pin.verification.records import Check, Verdict, Verification
from vdsm_pin.verification.verify import verify

NONE = ErrorBox()
HEAD = """
vdsm_problem: 1
name: shapes
length_unit: mm
manipulator: {link_lengths: [300, 300, 300], link_radius: 40, max_link_angle_deg: 80,
              max_joint_angle_deg: 80, base_range: [-4000, 4000]}
base: {position: [120, -80, 40], rpy_deg: [20, -10, 70]}
required_clearance: 5
obstacles:
"""
SHAPES = {
    "sphere": "shape: sphere, center: [0, 0, 0], radius: 90",
    "capsule": "shape: capsule, axis: [1, 2, 3], center: [5, 0, 0], radius: 40, "
    "length: 200",
    "cylinder": "shape: cylinder, axis: [1, 0, 1], center: [0, 9, 0], radius: 60, "
    "length: 150",
    "box": "shape: box, center: [0, 0, 20], size: [100, 150, 200], rpy_deg: [9, 8, 7]",
    "prism": "shape: prism, axis: z, polygon: [[0, 0], [200, 0], [200, 60], [60, 60], "
    "[60, 200], [0, 200]], from: -50, to: 90",
    "mesh": "shape: mesh, file: cube.obj, length_unit: mm, check_size: false",
    "open": "shape: mesh, file: open.obj, length_unit: mm, check_size: false",
    "surface": "shape: mesh, file: open.obj, length_unit: mm, check_size: false, "
    "solid: false",
    "points": "shape: points, file: cloud.xyz, length_unit: mm, radius: 25, "
    "check_size: false",
    "voxels": "shape: voxels, file: cloud.xyz, size: [40, 30, 20], length_unit: mm, "
    "check_size: false",
}
SEEDS = [0, *(pytest.param(seed, marks=pytest.mark.slow) for seed in range(1, 5))]
CORNERS = [[x, y, z] for x in (-80, 80) for y in (-70, 70) for z in (-60, 60)]
FACES = ["1 2 4 3", "5 7 8 6", "1 5 6 2", "3 4 8 7", "1 3 7 5", "2 6 8 4"]


def write_files(folder: Path) -> None:
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
    faces = "".join(f"f {face}\n" for face in FACES)
    (folder / "cube.obj").write_text(vertices + faces)
    (folder / "open.obj").write_text(vertices + faces[: faces.rindex("f ")])
    rows = np.random.default_rng(0).uniform(-90, 90, (40, 3))
    np.savetxt(folder / "cloud.xyz", rows)


def problem_of(folder: Path, name: str, text: str) -> PlanningProblem:
    path = folder / f"{name}.yaml"
    path.write_text(HEAD + text, encoding="utf-8")
    return read_problem(path)


def motion_of(q: FloatArray, times: FloatArray | None) -> Trajectory:
    none = np.zeros(len(q))
    return Trajectory(none > 0, none, q[:, 0], q[:, 1::2], q[:, 2::2], times=times)


def judged(
    problem: PlanningProblem,
    motion: Trajectory,
    errors: ErrorBox | None = None,
    *,
    joint_error: bool = True,
) -> Verification:
    return verify(problem.under(errors or NONE), motion, joint_error=joint_error)


def clearance(found: Verification) -> Check:
    return next(c for c in found.checks if c.name == "clearance from obstacles")


def compare(one: Verification, other: Verification) -> None:
    """Whether two verifications of one thing say the same."""
    a, b = clearance(one), clearance(other)
    assert a.verdict is b.verdict
    inside = [
        next((c.verdict for c in found.checks if c.name == "arm outside the meshes"), 0)
        for found in (one, other)
    ]
    assert inside[0] == inside[1]
    if a.verdict is Verdict.CERTIFIED:
        assert a.worst == pytest.approx(b.worst, abs=3e-6)
    if a.verdict is Verdict.REFUTED and a.first_moment == a.first_moment:
        assert a.first_moment == pytest.approx(b.first_moment, abs=2e-6)
        assert a.last_moment == pytest.approx(b.last_moment, abs=2e-6)
    assert one.joint_error == pytest.approx(other.joint_error, abs=3e-5, nan_ok=True)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("seed", SEEDS)
def test_a_motion_that_stands_still_is_rest(
    shape: str, seed: int, tmp_path: Path
) -> None:
    write_files(tmp_path)
    rng = np.random.default_rng(seed)
    place, rpy = rng.normal([300, 300, 0], 200.0), rng.uniform(-180, 180, 3)
    motion = f"motion: {{times_s: [0, 9], positions: {[place.tolist()] * 2}, "
    motion += f"rpy_deg: {[rpy.tolist()] * 2}}}"
    q = rng.uniform(-0.5, 0.5, (4, 7))
    times = np.array([0.0, 1.0, 2.5, 3.0])
    moving = problem_of(tmp_path, "m", f"  - {{name: a, {SHAPES[shape]}, {motion}}}\n")
    # The same at rest: the base seen from the thing's own frame.
    still = problem_of(tmp_path, "s", f"  - {{name: a, {SHAPES[shape]}}}\n")
    (one,) = moving.scene.moving
    pose = one.poses(np.zeros(1))[0]
    back = problem_at(still, pose)
    both = (
        judged(one, motion_of(q, times), joint_error=False) for one in (moving, back)
    )
    compare(*both)


def problem_at(problem: PlanningProblem, pose: FloatArray) -> PlanningProblem:
    """The problem whose only solid stands at T_base_solid, whatever its shape."""
    (solid,) = problem.scene.obstacles
    base = problem.T_world_base  # the solid was read in the base's frame
    there = solid_of(solid).placed(base).placed(pose)
    return replace(problem, scene=Scene((there,)))


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("seed", SEEDS)
def test_what_slides_past_the_arm_is_the_arm_that_slides(
    shape: str, seed: int, tmp_path: Path
) -> None:
    """x0 + s with the thing at rest, or x0 with the thing moved by -s: one distance."""
    write_files(tmp_path)
    rng = np.random.default_rng(100 + seed)
    q, slide = rng.uniform(-0.5, 0.5, (4, 7)), rng.uniform(-0.4, 0.4, 4)
    times = np.array([0.0, 1.0, 2.5, 3.0])
    place = rng.normal([300, 300, 0], 200.0)
    still = problem_of(tmp_path, "s", f"  - {{name: a, {SHAPES[shape]}}}\n")
    axis = still.T_world_base[:3, 0]
    places = place - 1000.0 * slide[:, None] * axis
    motion = f"motion: {{times_s: {times.tolist()}, positions: {places.tolist()}}}"
    moving = problem_of(tmp_path, "m", f"  - {{name: a, {SHAPES[shape]}, {motion}}}\n")
    pose = np.eye(4)
    base = still.T_world_base
    pose[:3, :3] = base[:3, :3].T
    pose[:3, 3] = base[:3, :3].T @ (place * 1e-3 - base[:3, 3])
    rested = problem_at(still, pose)
    slid = q.copy()
    slid[:, 0] += slide
    one = judged(moving, motion_of(q, times))
    compare(one, judged(rested, motion_of(slid, None)))
    # Knots of its own in between change nothing.
    more = np.sort(np.concatenate([times, [0.2, 0.9, 2.0, 2.6]]))
    fine = np.stack([np.interp(more, times, x) for x in places.T], axis=1)
    motion = f"motion: {{times_s: {more.tolist()}, positions: {fine.tolist()}}}"
    knotted = problem_of(tmp_path, "k", f"  - {{name: a, {SHAPES[shape]}, {motion}}}\n")
    chunks: list[ClearanceChunk] = []
    motion_q = motion_of(q, times)
    sinks = [chunks.append]
    two = verify(knotted, motion_q, sinks=sinks, joint_error=True, reach=np.inf)
    compare(one, two)
    # Three intervals of the trajectory, however many pieces they are proved in.
    rows = np.concatenate([chunk.lower for chunk in chunks])
    assert len(rows) == 3
    assert ((chunks[0].share >= 0.0) & (chunks[0].share <= 1.0)).all()
    if clearance(two).verdict is Verdict.CERTIFIED:
        near = [k for k, pair in enumerate(two.pairs) if pair.obstacle]
        least = float(two.least.lower[near].min())
        assert rows[:, near].min() == pytest.approx(least, abs=1e-9)


def test_an_arm_within_a_mesh_that_moves_along_is_inside(tmp_path: Path) -> None:
    write_files(tmp_path)
    text = (
        "  - {name: hull, shape: mesh, file: cube.obj, scale: 40, check_size: false, "
    )
    text += "motion: {times_s: [0, 3], positions: [[120, -80, 40], [320, -80, 40]]}}\n"
    found = judged(
        problem_of(tmp_path, "p", text), motion_of(np.zeros((2, 7)), np.arange(2.0))
    )
    assert found.verdict is Verdict.REFUTED
    row = next(c for c in found.checks if c.name == "arm outside the meshes")
    assert row.verdict is Verdict.REFUTED
    assert clearance(found).worst == pytest.approx(-0.04)


def test_a_counterexample_is_found_where_the_thing_then_is(tmp_path: Path) -> None:
    """A ball comes near only at 2 s; joint errors lose the clearance there."""
    path = tmp_path / "p.yaml"
    text = (
        HEAD.replace("position: [120, -80, 40], rpy_deg: [20, -10, 70]", "")
        + "  - {name: ball, shape: sphere, center: [0, 0, 0], radius: 50, motion: "
        "{times_s: [0, 2, 4], positions: "
        "[[850, 0, 500], [850, 0, 110], [850, 0, 500]]}}\n"
    )
    path.write_text(text)
    problem = read_problem(path)
    still = motion_of(np.zeros((3, 7)), np.array([0.0, 3.0, 4.0]))
    # 15 mm of room; the ball is 850 mm out.
    small, large = (ErrorBox(joint=np.deg2rad(e)) for e in (0.2, 1.5))
    assert clearance(judged(problem, still, small)).verdict is Verdict.CERTIFIED
    found = judged(problem, still, large)
    assert clearance(found).verdict is Verdict.REFUTED
    (lost,) = found.counterexamples
    assert lost.moment == pytest.approx(2.0 / 3.0, abs=0.02)
    assert lost.joints.shape == lost.offsets.shape == (7,)
    assert lost.clearance < 0.005
    assert found.nominal_clear
    assert 0.0 < found.joint_error < np.deg2rad(1.5)
    assert found.joint_error < found.refuted_joint_error < np.deg2rad(3.0)
