"""Properties of the clearance proof over random arms, motions and all shapes.

Oracles: Coal at a thousand instants of each motion, and what geometry says must stay
the same, or must not grow.
"""

import json
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry import solids
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem import scene
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.budget import Budget
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.brackets import ClearanceChunk
from vdsm_pin.verification.clearance import prove_clearance, prove_motion
from vdsm_pin.verification.coal_shapes import Sides, assembly_shapes
from vdsm_pin.verification.pinocchio_arm import PinocchioArm, load_arm
from vdsm_pin.verification.robust import largest_joint_error, refuted_joint_error
from vdsm_pin.verification.task import arm_assembly

N_LINKS, RADIUS, SAMPLES = 3, 0.05, 1000
LENGTHS = np.array([0.5, 0.4, 0.3])
PADDING = 2e-9
"""Rounding of two proofs and the width at which a distance bracket is closed; [m]."""

SHAPES = ("sphere", "capsule", "cylinder", "box", "prism", "notched", "wall", "mesh")
NOTCHED = [[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]]
TETRAHEDRON = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])

few = settings(
    max_examples=25,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@cache
def arm() -> Manipulator:
    cables = CableLayout(0.03, 0.05, paper_hole_angles(N_LINKS))
    return Manipulator("three", LENGTHS, RADIUS, 1.3, 1.3, (-5.0, 5.0), cables)


@cache
def robot() -> PinocchioArm:
    return load_arm(arm())


def unit(vector: Any) -> FloatArray:
    return np.asarray(vector) / np.linalg.norm(vector)


def axis_of(rng: np.random.Generator) -> FloatArray:
    """Any direction, often one along an axis of the base."""
    if rng.random() < 0.4:
        return np.asarray(np.eye(3)[rng.integers(3)] * rng.choice([-1.0, 1.0]))
    return unit(rng.normal(size=3))


def obstacle_of(shape: str, rng: np.random.Generator) -> scene.Obstacle:
    """An obstacle within reach of the arm."""
    centre = rng.uniform([0.0, -0.6, -0.6], [1.4, 0.6, 0.6])
    turn = rotation_from_rpy(rng.uniform(-3.0, 3.0, 3) * rng.choice([0.0, 1.0]))
    size = 10.0 ** rng.uniform(-3.0, -0.7)
    match shape:
        case "sphere":
            return solids.Sphere(shape, centre, size)
        case "capsule":
            return solids.Capsule(
                shape, centre, axis_of(rng), rng.uniform(0.01, 1.0), size
            )
        case "cylinder":
            return solids.Cylinder(
                shape, centre, axis_of(rng), rng.uniform(0.01, 1.0), size
            )
        case "box":
            return solids.Box(shape, centre, turn, 10.0 ** rng.uniform(-3.0, -0.5, 3))
        case "prism":
            corners = size * rng.uniform(-1.0, 1.0, (3, 2))
            return solids.Prism(shape, centre, turn, corners, (-0.3, 0.5))
        case "notched":
            corners = 0.3 * size * (np.array(NOTCHED) - 1.5)
            return solids.Prism(shape, centre, turn, corners, (-0.3, 0.2))
        case "wall":
            normal = axis_of(rng)
            return solids.HalfSpace(shape, np.array([0.6, 0, 0]) - normal, normal)
    corners = centre + size * (1.0 + rng.normal(size=(4, 3)))
    return solids.Mesh(shape, corners, TETRAHEDRON)


def problem_of(*obstacles: scene.Obstacle, required: float = 0.0) -> PlanningProblem:
    tip = np.array([LENGTHS.sum(), 0.0, 0.0])
    path = DesiredPath(tip, tip[None])
    return PlanningProblem(arm(), scene.Scene(obstacles), path, required, name="any")


def motion_of(rng: np.random.Generator, n_rows: int, step: float) -> Trajectory:
    q = rng.uniform(-0.6, 0.6, 1 + 2 * N_LINKS) * rng.choice([0.0, 1.0])
    steps = rng.uniform(-step, step, (n_rows, q.size)) * rng.choice([0.1, 1.0])
    return rows_of(q + np.cumsum(steps, axis=0))


def rows_of(q: FloatArray) -> Trajectory:
    blank = np.zeros(len(q))
    return Trajectory(blank > 0.0, blank, q[:, 0], q[:, 1::2], q[:, 2::2])


def halved(q: FloatArray, n: int) -> FloatArray:
    """Each interval cut into 2^n."""
    for _ in range(n):
        between = q[:-1] + 0.5 * (q[1:] - q[:-1])
        q = np.insert(q, np.arange(1, len(q)), between, axis=0)
    return q


def brackets(problem: PlanningProblem, rows: Trajectory) -> ClearanceChunk:
    chunks: list[ClearanceChunk] = []
    motion = AskedMotion.of_arm(problem, rows, ErrorBox())
    prove_motion(motion, Budget(), [chunks.append])
    (chunk,) = chunks
    return chunk


def shown(bounds: FloatArray) -> FloatArray:
    """Bounds where axes meet obstacles mean that they do, not how deep."""
    return np.maximum(bounds, -RADIUS)


def by_coal(obstacle: scene.Obstacle, q: FloatArray) -> FloatArray:
    """Coal's distance of every link at every row, shape (n_rows, N); [m]."""
    poses = np.tile(np.eye(3, 4), (len(q), 2 * N_LINKS + 2, 1, 1))
    poses[:, 3::2] = robot().poses(q[:, 0], q[:, 1::2], q[:, 2::2])[:, :N_LINKS]
    row, link = (a.ravel() for a in np.indices((len(q), N_LINKS)))
    shapes = assembly_shapes(arm_assembly(problem_of(obstacle)))
    other = np.full(link.size, N_LINKS)
    found = shapes.distances(poses, Sides(row, link, other))
    return found.reshape(len(q), N_LINKS)


shapes = st.sampled_from(SHAPES)
seeds = st.integers(0, 2**32 - 1)


@settings(few, max_examples=3 * len(SHAPES))
@given(shape=shapes, seed=seeds)
def test_the_bracket_holds_a_thousand_distances_by_coal(shape: str, seed: int) -> None:
    """None is below the lower bound; the least is near the upper one or below it."""
    rng = np.random.default_rng(seed)
    obstacle, rows = obstacle_of(shape, rng), motion_of(rng, 2, 0.3)
    chunk, t = brackets(problem_of(obstacle), rows), np.linspace(0.0, 1.0, SAMPLES)
    q = rows.joints
    least = by_coal(obstacle, q[0] + t[:, None] * (q[1] - q[0])).min(axis=0)
    # Half a step of the sampling moves no point of the arm by more than this.
    travel = np.abs(q[1] - q[0]).sum() * LENGTHS.sum() / SAMPLES
    error = TOLERANCES.coal_agreement
    lower, upper = chunk.lower[0, :N_LINKS], chunk.upper[0, :N_LINKS]
    apart = np.isfinite(least) & (least > 0.0)
    assert (lower <= upper).all()
    assert (lower[apart] <= least[apart] + error).all()
    assert (upper[apart] >= least[apart] - travel - error).all()
    assert (lower[~apart] <= error).all(), "Coal sees them meet"


@few
@given(shape=shapes, seed=seeds)
def test_refining_a_trajectory_never_worsens_the_verdict(shape: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    obstacle, rows = obstacle_of(shape, rng), motion_of(rng, 3, 0.2)
    upper = brackets(problem_of(obstacle), rows).upper[:, :N_LINKS].min()
    close = max(0.0, upper + rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-9, -3))
    problem = problem_of(obstacle, required=close)
    found = [
        brackets(problem, rows_of(halved(rows.joints, n))).verdict[:, :N_LINKS]
        for n in (0, 1, 3)
    ]
    coarse, fine, finest = (
        verdict.reshape(2, -1, N_LINKS).max(axis=(0, 1)) for verdict in found
    )
    certified = coarse == 0
    assert (fine[certified] == 0).all()
    assert (finest[certified] == 0).all()
    refuted = (found[0] == 1).any(axis=0)
    assert not ((found[2] == 0).all(axis=0) & refuted).any()


def grown(obstacle: scene.Obstacle, much: float) -> scene.Obstacle:
    """An obstacle that holds the given one."""
    match obstacle:
        case solids.Sphere() | solids.Capsule() | solids.Cylinder():
            return replace(obstacle, radius=obstacle.radius + much)
        case solids.Box():
            return replace(obstacle, half_size=obstacle.half_size + much)
        case solids.Prism():
            low, high = obstacle.span
            return replace(obstacle, span=(low - much, high + much))
        case solids.HalfSpace():
            return replace(obstacle, point=obstacle.point + much * obstacle.normal)
    middle = obstacle.vertices.mean(axis=0)
    away = obstacle.vertices - middle
    return replace(obstacle, vertices=middle + (1.0 + much) * away)


@few
@given(shape=shapes, seed=seeds)
def test_growing_an_obstacle_never_raises_a_lower_bound(shape: str, seed: int) -> None:
    """At rest to within the padding; in motion past no upper bound of the smaller."""
    rng = np.random.default_rng(seed)
    small, much = obstacle_of(shape, rng), 10.0 ** rng.uniform(-9.0, -1.0)
    large = grown(small, much)
    for step in (0.0, 0.2):
        rows = motion_of(rng, 2, step)
        one, two = (brackets(problem_of(o), rows) for o in (small, large))
        limit = shown(one.upper if step else one.lower)[:, :N_LINKS]
        # Inside a mesh its surface is what is measured: growing moves it away.
        asked = np.full(limit.shape, True) if shape != "mesh" else limit > RADIUS
        assert (shown(two.lower)[:, :N_LINKS] <= limit + PADDING)[asked].all()


@pytest.mark.slow
@settings(few, max_examples=12)
@given(shape=shapes, seed=seeds)
def test_no_error_is_both_certified_and_refuted(shape: str, seed: int) -> None:
    """The search for counterexamples attacks the proof for error boxes, and fails."""
    rng = np.random.default_rng(seed)
    obstacle, rows = obstacle_of(shape, rng), motion_of(rng, 3, 0.05)
    box = ErrorBox(base=rng.choice([0.0, 0.003]), obstacle=rng.choice([0.0, 0.002]))
    problem = problem_of(obstacle, required=0.001)
    certified = largest_joint_error(problem, rows, box)
    refuted = refuted_joint_error(problem, rows, box, certified)
    assert not refuted <= certified
    for error in (0.5 * certified, certified, 2.0 * certified):
        asked = replace(box, joint=error)
        proof = prove_clearance(problem, rows, asked)
        found = proof.counterexamples()
        if found and not proof.counts[:, 1].any():
            assert error > certified
            assert found[0].clearance < 0.001
            chunk = brackets(
                replace(problem, required_clearance=0.001 + box.obstacle),
                rows_of(found[0].joints[None]),
            )
            assert (chunk.verdict == 1).any()


# ---- rigid motion of everything ------------------------------------------------------


def in_file(obstacle: scene.Obstacle, folder: Path) -> dict[str, Any]:
    """An obstacle as a problem file has it, in metres; rotations as matrices."""
    name = {"name": obstacle.name}
    match obstacle:
        case solids.Sphere():
            return name | {
                "shape": "sphere", "center": obstacle.centre, "radius": obstacle.radius
            }  # fmt: skip
        case solids.Capsule() | solids.Cylinder():
            return name | {
                "shape": type(obstacle).__name__.lower(),
                "center": obstacle.centre,
                "axis": obstacle.axis,
                "length": 2.0 * obstacle.half_length,
                "radius": obstacle.radius,
            }
        case solids.Box():
            return name | {
                "shape": "box",
                "center": obstacle.centre,
                "size": 2.0 * obstacle.half_size,
                "rpy_deg": obstacle.rotation,
            }
        case solids.HalfSpace():
            return name | {
                "shape": "half_space",
                "point": obstacle.point,
                "normal": obstacle.normal,
            }
    assert isinstance(obstacle, solids.Mesh)
    corners = [f"v {x!r} {y!r} {z!r}" for x, y, z in obstacle.vertices.tolist()]
    faces = [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in obstacle.triangles]
    (folder / "part.obj").write_text("\n".join([*corners, *faces]))
    return name | {
        "shape": "mesh", "file": "part.obj", "center": np.zeros(3),
        "rpy_deg": np.eye(3), "check_size": False,
    }  # fmt: skip


def rpy_deg(R: FloatArray) -> list[float]:
    """Roll, pitch and yaw of R = Rz Ry Rx."""
    angles = [
        np.arctan2(R[2, 1], R[2, 2]),
        np.arctan2(-R[2, 0], np.hypot(R[0, 0], R[1, 0])),
        np.arctan2(R[1, 0], R[0, 0]),
    ]
    return [float(np.degrees(angle)) for angle in angles]


def moved(entry: dict[str, Any], R: FloatArray, p: FloatArray) -> dict[str, Any]:
    """An obstacle of a file after a rigid motion."""
    ways = {
        "center": lambda x: (R @ x + p).tolist(),
        "point": lambda x: (R @ x + p).tolist(),
        "axis": lambda x: (R @ x).tolist(),
        "normal": lambda x: (R @ x).tolist(),
        "rpy_deg": lambda x: rpy_deg(R @ x),
        "size": lambda x: x.tolist(),
    }
    return {k: ways[k](v) if k in ways else v for k, v in entry.items()}


@few
@given(shape=st.sampled_from([s for s in SHAPES if s not in ("prism", "notched")]),
       seed=seeds)  # fmt: skip
def test_moving_everything_rigidly_changes_nothing(
    shape: str, seed: int, tmp_path: Path
) -> None:
    """The base and all obstacles of a problem file, turned and shifted together."""
    rng = np.random.default_rng(seed)
    entry = in_file(obstacle_of(shape, rng), tmp_path)
    poses = [
        (np.eye(3), np.zeros(3)),
        (rotation_from_rpy(rng.uniform(-3.0, 3.0, 3)), rng.uniform(-2.0, 2.0, 3)),
    ]
    rows, found = motion_of(rng, 1, 0.5), []
    for R, p in poses:
        data = {
            "vdsm_problem": 1,
            "length_unit": "m",
            "base": {"position": p.tolist(), "rpy_deg": rpy_deg(R)},
            "manipulator": {
                "link_lengths": LENGTHS.tolist(),
                "link_radius": RADIUS,
                "max_link_angle_deg": 60,
                "max_joint_angle_deg": 60,
            },
            "obstacles": [moved(entry, R, p)],
            "tip_path": {"start": (R @ [1.2, 0, 0] + p).tolist(),
                         "points": [(R @ [1.2, 0, 0] + p).tolist()]},
            "required_clearance": 0.0,
        }  # fmt: skip
        path = tmp_path / "problem.yaml"
        path.write_text(json.dumps(data))
        found.append(brackets(read_problem(path), rows))
    one, two = found
    assert np.abs(shown(one.lower) - shown(two.lower))[:, :N_LINKS].max() <= PADDING
    apart = one.upper[:, :N_LINKS] > -RADIUS
    assert np.abs(one.upper - two.upper)[:, :N_LINKS][apart].max(initial=0) <= PADDING


@pytest.mark.parametrize("turns", range(4))
@pytest.mark.parametrize("shape", ["prism", "notched"])
def test_turning_everything_about_the_rail_changes_nothing_for_prisms(
    shape: str, turns: int
) -> None:
    """By quarters: yaw and pitch of every joint change places."""
    rng = np.random.default_rng(turns)
    obstacle, c, s = obstacle_of(shape, rng), *[(1, 0), (0, 1), (-1, 0), (0, -1)][turns]
    R = np.array([[1, 0, 0], [0, c, -s], [0, s, c]], float)
    assert isinstance(obstacle, solids.Prism)
    turned = replace(
        obstacle, origin=R @ obstacle.origin, rotation=R @ obstacle.rotation
    )
    for joints in range(1, 1 + 2 * N_LINKS):
        q = np.zeros((2, 1 + 2 * N_LINKS))
        q[:, joints] = rng.uniform(-0.5, 0.5)
        # Turned by a quarter, yaw is -pitch and pitch is yaw.
        alpha, theta = q[:, 1::2], q[:, 2::2]
        again = q.copy()
        again[:, 1::2], again[:, 2::2] = c * alpha + s * theta, c * theta - s * alpha
        one = brackets(problem_of(obstacle), rows_of(q))
        two = brackets(problem_of(turned), rows_of(again))
        assert np.abs(shown(one.lower) - shown(two.lower)).max() <= PADDING
