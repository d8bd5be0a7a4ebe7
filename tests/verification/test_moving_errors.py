"""Errors beside what moves: no motion within the box comes nearer than is proved."""

import numpy as np
import pytest

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Sphere
from vdsm_pin.problem.error_boxes import ErrorBox, ObstacleError
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Carrier, Moving, Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.tree import free_tree
from vdsm_pin.verification.clearance import prove_clearance

SAMPLES = 4000
RADIUS = 0.03


def random_arm(rng: np.random.Generator) -> Manipulator:
    cables = CableLayout(0.8 * RADIUS, 0.01, paper_hole_angles(3))
    lengths = rng.uniform(0.15, 0.4, 3)
    return Manipulator("arm", lengths, RADIUS, 1.4, 1.4, (-3.0, 3.0), cables)


def random_motion(rng: np.random.Generator) -> Trajectory:
    n = int(rng.integers(1, 4))
    q, times, none = (
        rng.uniform(-0.6, 0.6, (n, 7)),
        rng.uniform(0.2, 1.0, n),
        np.zeros(n),
    )
    rates = rng.normal(0.0, 0.8, (n, 7)) if rng.random() < 0.5 else None
    joints = q[:, 0], q[:, 1::2], q[:, 2::2]
    return Trajectory(none > 0, none, *joints, times=np.cumsum(times), rates=rates)


def random_box(rng: np.random.Generator) -> ErrorBox:
    joint, base, shift = rng.uniform(0.0, 0.01, 3)
    turn = rng.uniform(0.0, 0.01) * (rng.random() < 0.6)
    single = (ObstacleError("ball", float(shift)),)
    wide = float(rng.uniform(0.0, 0.005))
    return ErrorBox(float(joint), float(base), wide, float(turn), obstacles=single)


def turns(rng: np.random.Generator, angle: float) -> FloatArray:
    """Rotations by an angle, or none, about random axes, shape (SAMPLES, 3, 3)."""
    axis = rng.normal(size=(SAMPLES, 3))
    x, y, z = (axis / np.linalg.norm(axis, axis=1)[:, None]).T
    zero = np.zeros(SAMPLES)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    cross = np.moveaxis(np.array(rows), 2, 0)
    by = (rng.choice([0.0, 1.0], SAMPLES) * angle)[:, None, None]
    return np.asarray(np.eye(3) + np.sin(by) * cross + (1 - np.cos(by)) * cross @ cross)


def compare(seed: int) -> None:
    rng = np.random.default_rng(seed)
    arm, motion, box = random_arm(rng), random_motion(rng), random_box(rng)
    assert motion.times is not None
    count = int(rng.integers(1, 4))
    times = np.sort(rng.uniform(0.0, motion.times[-1] + 0.3, count))
    times += 0.01 * np.arange(count)
    knots = [rng.normal([0.5, 0, 0], 0.4, (count, 3)), rng.uniform(-2, 2, (count, 3))]
    carrier = Carrier(free_tree(), Path(np.hstack(knots), times=times))
    centre, radius = rng.normal(0.0, 0.1, 3), float(rng.uniform(0.02, 0.15))
    ball = Moving(Sphere("ball", centre, radius), carrier, 6)
    problem = PlanningProblem(arm, Scene((ball,)), None, 0.005, name="p")
    lower = prove_clearance(problem, motion, box).least.lower[:3]

    moments = rng.uniform(0.0, motion.n_samples - 1, SAMPLES)
    ends = rng.choice([-1.0, 1.0], (SAMPLES, 7))
    inside = rng.uniform(-1.0, 1.0, (SAMPLES, 7))
    off = box.joint * np.where(rng.random((SAMPLES, 7)) < 0.5, inside, ends)
    q = motion.path.at_moments(moments) + off * (np.arange(7) > 0)
    points = joint_centres(arm, q[:, 0], q[:, 1::2], q[:, 2::2])
    points = np.einsum("sij,skj->ski", turns(rng, box.base_turn), points)
    shift = rng.normal(size=(SAMPLES, 1, 3))
    points += box.base * shift / np.linalg.norm(shift, axis=2, keepdims=True)
    when = motion.times_at(moments)
    assert when is not None
    poses = ball.poses(when)
    place = poses[:, :3, :3] @ centre + poses[:, :3, 3]
    grown = RADIUS + radius + max(box.obstacle, box.obstacles[0].shift)
    for link in range(3):
        start, way = points[:, link], points[:, link + 1] - points[:, link]
        along = ((place - start) * way).sum(axis=1) / (way * way).sum(axis=1)
        near = start + along.clip(0.0, 1.0)[:, None] * way
        gaps = np.linalg.norm(place - near, axis=1) - grown
        # No depth beyond the link's radius is measured.
        assert lower[link] <= max(float(gaps.min()), -RADIUS) + 1e-9


@pytest.mark.parametrize("seed", range(20))
def test_no_motion_within_the_box_is_nearer(seed: int) -> None:
    compare(seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 700))
def test_no_motion_within_many_boxes_is_nearer(seed: int) -> None:
    compare(seed)
