"""Oracle: distances of meshes at instants; how often the hierarchy is walked."""

from dataclasses import replace

import numpy as np
import pytest

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.pieces import pack_pieces
from vdsm_pin.geometry.row_bounds import row_brackets
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.layouts import RENEWED
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.brackets import ClearanceChunk
from vdsm_pin.verification.clearance import prove_clearance, prove_motion

ARM = built_in("hrm8")
N = ARM.n_links
BOXES = (ErrorBox(), ErrorBox(base=0.002, obstacle=0.001), ErrorBox(joint=1e-4))


def swaying(n_rows: int) -> Trajectory:
    t = np.linspace(0.0, 3.0, n_rows)[:, None] + np.arange(8.0)
    off = np.zeros(n_rows, bool)
    x0 = 0.05 * np.sin(t[:, 0])
    return Trajectory(off, off, x0, 0.05 * np.sin(t), 0.05 * np.cos(t))


def tunnel(radius: float, around: int = 24, along: int = 30) -> Mesh:
    """A rough pipe around the arm, open at both ends."""
    rng = np.random.default_rng(2)
    turn = 2.0 * np.pi * np.arange(around) / around
    x, angle = np.meshgrid(np.linspace(-0.4, 3.5, along + 1), turn, indexing="ij")
    wall = radius * rng.uniform(1.0, 1.2, x.shape)
    points = np.stack([x, wall * np.cos(angle), wall * np.sin(angle)], axis=-1)
    k, j = np.meshgrid(np.arange(along), np.arange(around), indexing="ij")
    a, b = k * around + j, k * around + (j + 1) % around
    faces = np.stack([a, b, a + around, b, b + around, a + around], axis=-1)
    return Mesh("tunnel", points.reshape(-1, 3), faces.reshape(-1, 3), solid=False)


def problem_of(mesh: Mesh, required: float = 0.0) -> PlanningProblem:
    tip = np.array([ARM.total_length, 0.0, 0.0])
    path, scene = DesiredPath(tip, tip[None]), Scene((mesh,))
    return PlanningProblem(ARM, scene, path, required, name="tunnel")


def clearances(mesh: Mesh, rows: Trajectory, at: FloatArray) -> FloatArray:
    """Upper bounds at times counted in intervals, shape (n_times, N)."""
    k, after = at.astype(int), np.minimum(at.astype(int) + 1, rows.n_samples - 1)
    q = [
        v[k] + (at - k).reshape(-1, *[1] * (v.ndim - 1)) * (v[after] - v[k])
        for v in (rows.x0, rows.alpha, rows.theta)
    ]
    centres = joint_centres(ARM, *q)
    ends = np.stack([centres[:, :-1], centres[:, 1:]], axis=2).reshape(-1, 2, 3)
    only = np.zeros(len(ends), np.int64)
    pieces = pack_pieces([mesh.pieces])
    found = row_brackets(pieces, np.ascontiguousarray(ends), only, 1e-10)[:, 1]
    return np.asarray(found.reshape(-1, N) - ARM.link_radius)


@pytest.mark.parametrize("box", BOXES)
def test_what_is_held_from_row_to_row_stays_below_the_distance(box: ErrorBox) -> None:
    mesh, rows = tunnel(0.55), swaying(150)
    chunks: list[ClearanceChunk] = []
    motion = AskedMotion.of_arm(problem_of(mesh), rows, box)
    proof = prove_motion(motion, Budget(), [chunks.append])
    assert proof.counts.sum() == proof.counts[:, 0].sum()
    lower = np.concatenate([chunk.lower for chunk in chunks])[:, :N]
    at = np.sort(np.random.default_rng(1).uniform(0.0, rows.n_samples - 1, 100))
    for base in (-box.base, 0.0, box.base):
        moved = replace(rows, x0=rows.x0 + base)
        above = clearances(mesh, moved, at) - box.obstacle
        assert (lower[at.astype(int)] <= above + 1e-9).all()
        if not box.joint:
            assert (lower[at.astype(int)] >= 0.9 * above - 0.01).all()


def test_the_hierarchy_is_not_walked_for_every_row() -> None:
    """Ten times the rows of one motion: the walks do not multiply with them."""
    walks = []
    for n_rows in (200, 2000):
        about = problem_of(tunnel(0.55)), swaying(n_rows), ErrorBox()
        proving = AskedMotion.of_arm(*about).proving()
        proving.sweep(0, proving.n_intervals)
        walks.append(int(proving.results.tally[RENEWED]))
    assert walks[1] < 2 * walks[0]
    assert walks[1] < 0.1 * 2000 * N


def test_the_least_clearance_in_a_tunnel_is_exact() -> None:
    mesh, rows = tunnel(0.55), swaying(150)
    proof = prove_clearance(problem_of(mesh), rows, ErrorBox())
    low, up = proof.least.lower[:N].min(), proof.least.upper[:N].min()
    assert up - low <= TOLERANCES.least_bracket
    sampled = clearances(mesh, rows, np.linspace(0.0, rows.n_samples - 1.0, 1490))
    assert low - 1e-9 <= sampled.min() <= up + 1e-4
