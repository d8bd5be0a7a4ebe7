"""Random scenes with a stated property, shared by the tests of this planner."""

import numpy as np

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.geometry.solids import Box, Capsule, Cylinder, Prism, Sphere
from vdsm_pin.problem.desired_path import Blocked, DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.verification.link_clearance import link_clearance

SQUARE = np.array(
    [
        [3.126, 0.0, -0.2],
        [3.126, 1.0, -0.2],
        [3.126, 1.0, 1.3],
        [3.126, -0.5, 1.3],
        [3.126, -0.5, -0.2],
    ]
)
AXES = {
    "x": np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]),
    "y": np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]),
    "z": np.eye(3),
}
"""Rotations whose last column is the axis a prism is swept along."""


def problem(
    *obstacles: Obstacle,
    points: FloatArray = SQUARE,
    blocked: Blocked = Blocked.DETOUR,
    closed: bool = True,
    start: tuple[float, float, float] = (3.126, 0.0, 0.0),
    start_joints: FloatArray | None = None,
) -> PlanningProblem:
    path = DesiredPath(
        np.array(start), points, closed, retreat=0.1, blocked=blocked,
        start_joints=start_joints,
    )  # fmt: skip
    scene = Scene(tuple(obstacles))
    return PlanningProblem(built_in("hrm8"), scene, path, 0.0035, name="test")


def straight_arm(task: PlanningProblem, tips: FloatArray) -> FloatArray:
    """Joint centres of the straight arm at tips, shape (n, N + 1, 3)."""
    ratios, length = task.manipulator.ratios, task.manipulator.total_length
    planar = tips[:, None, 1:] * ratios[:, None]
    rise = np.sqrt(length**2 - (tips[:, 1:] ** 2).sum(axis=1))
    x = tips[:, :1] - rise[:, None] * (1.0 - ratios)
    return np.concatenate([x[..., None], planar], axis=2)


def _polygon(rng: np.random.Generator, radius: float) -> FloatArray:
    count = int(rng.integers(3, 8))
    turns = np.arange(count) * 2.0 * np.pi / count
    turns = turns + rng.uniform(0.0, 1.2 / count, count) + rng.uniform(0, 2 * np.pi)
    return radius * np.stack([np.cos(turns), np.sin(turns)], axis=1)


def _bar(rng: np.random.Generator) -> list[Obstacle]:
    axis = "xyz"[int(rng.integers(3))]
    origin = np.array([rng.uniform(0.6, 3.2), *rng.uniform(-1.2, 1.2, 2)])
    origin["xyz".index(axis)] = 0.0
    polygon = _polygon(rng, rng.uniform(0.08, 0.35))
    return [Prism("bar", origin, AXES[axis], polygon, (-4.0, 6.0))]


def _clutter(rng: np.random.Generator) -> list[Obstacle]:
    obstacles: list[Obstacle] = []
    for i in range(int(rng.integers(2, 9))):
        centre = np.array([rng.uniform(0.3, 3.4), *rng.uniform(-1.4, 1.4, 2)])
        axis = rng.normal(size=3)
        axis = axis / np.linalg.norm(axis)
        size, half = rng.uniform(0.04, 0.3, 3), rng.uniform(0.1, 1.5)
        rotation = rotation_from_rpy(rng.uniform(-3.0, 3.0, 3))
        kinds: list[Obstacle] = [
            Sphere(f"o{i}", centre, size[0]),
            Box(f"o{i}", centre, rotation, size),
            Cylinder(f"o{i}", centre, axis, half, size[0]),
            Capsule(f"o{i}", centre, axis, half, size[0]),
        ]
        obstacles.append(kinds[int(rng.integers(4))])
    return obstacles


def random_problem(seed: int, *, clutter: bool) -> PlanningProblem:
    """Path and start are 8 mm clear; somewhere the straight arm is not clear."""
    rng = np.random.default_rng([seed, int(clutter)])
    while True:
        task = problem(*(_clutter(rng) if clutter else _bar(rng)))
        clearance = link_clearance(task)
        tips = task.path.at(np.arange(0.0, task.path.length, 0.02))
        own = clearance(np.stack([tips, tips], axis=1)).min()
        start = clearance(straight_arm(task, task.path.start[None])).min()
        along = clearance(straight_arm(task, tips)).min()
        if own > 0.0115 and start > 0.0115 and along < 0.0035:
            return task
