"""Records made up for tests of the reports: every shape, every verdict, no physics."""

import numpy as np

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.solids import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Mesh,
    Prism,
    Sphere,
)
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.run_record import RunRecord
from vdsm_pin.verification.brackets import (
    ClearanceChunk,
    ClearanceProfile,
    LeastClearances,
)
from vdsm_pin.verification.records import (
    ArmVerification,
    Check,
    ClosestApproach,
    Pair,
    Verdict,
)

X, Y, Z = np.eye(3)
RECORD = RunRecord(
    command="vdsm verify made-up.yaml --trajectory 'a b.csv' --out out",
    problem_sha256="1" * 64,
    trajectory_sha256="2" * 64,
    urdf_sha256="3" * 64,
)


def every_shape() -> Scene:
    corner = np.array([[2.6, -1.2, -0.4], [3.0, -1.2, -0.4], [2.8, -0.8, -0.4]])
    tetrahedron = np.vstack([corner, [[2.8, -1.0, 0.1]]])
    faces = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]])
    outline = np.array([[0, 0], [0.5, 0], [0.5, 0.2], [0.2, 0.2], [0.2, 0.5], [0, 0.5]])
    return Scene(
        (
            Cylinder("pillar", np.array([1.563, 0.7, 0.6]), X, 2.5, 0.2),
            Sphere("ball", np.array([1.0, -0.8, 0.6]), 0.25),
            Capsule("rod", np.array([2.0, 1.6, 0.0]), (Y + Z) / np.sqrt(2), 0.4, 0.08),
            Box("crate", np.array([0.6, 0.9, -0.3]), np.eye(3), np.full(3, 0.2)),
            Prism("angle", np.array([1.8, -1.3, 1.0]), np.eye(3), outline, (0.0, 0.6)),
            Mesh("part <1>", tetrahedron, faces),
            HalfSpace("wall", -1.0 * Z, Z),
        )
    )


def problem(scene: Scene | None = None) -> PlanningProblem:
    square = [[3.126, 0, -0.2], [3.126, 1, -0.2], [3.126, 1, 1], [3.126, -0.5, 1]]
    path = DesiredPath(np.array([3.126, 0, 0]), np.array(square), closed=True)
    arm = built_in("hrm8")
    obstacles = every_shape() if scene is None else scene
    return PlanningProblem(arm, obstacles, path, 0.0035, name="made up")


def trajectory(n: int = 200) -> Trajectory:
    turn = np.linspace(0.0, 2.0 * np.pi, n)
    alpha, theta = np.zeros((n, 8)), np.zeros((n, 8))
    alpha[:, 0] = 0.35 * np.sin(turn)
    theta[:, 0] = -0.3 * np.sin(turn) ** 2
    alpha[:, 4] = 0.3 * np.sin(2.0 * turn)
    theta[:, 6] = 0.2 * np.sin(3.0 * turn)
    on_path = (turn > 0.4) & (np.abs(turn - 3.0) > 0.3)
    return Trajectory(on_path, turn, 0.3 * np.sin(turn) ** 2, alpha, theta)


def verification(
    verdict: Verdict = Verdict.CERTIFIED,
    *,
    n: int = 200,
    scene: Scene | None = None,
    joint_error: float = 0.0023,
) -> ArmVerification:
    task, rows = problem(scene), trajectory(n)
    names, intervals = task.scene.names, max(n - 1, 1)
    pairs = tuple(Pair(link, name) for name in names for link in range(1, 9))
    phase = np.linspace(0.0, 6.0, intervals)[:, None]
    links = 0.4 + 0.395 * np.sin(phase + np.arange(8))
    others = 0.4 + 0.395 * np.sin(phase + np.arange(len(names)) + 0.5)
    profile = ClearanceProfile(
        links, 1.2 * links, others, 1.2 * others, np.arange(intervals)
    )
    closest = tuple(
        ClosestApproach(
            interval=min(17 * i, intervals - 1),
            share=0.25,
            pair=pair,
            lower=0.0041 + 0.01 * i,
            upper=0.0042 + 0.01 * i,
            station=0.1,
            link_point=np.array([1.5, 0.4, 0.5]),
            other_point=np.array([1.5, 0.4041, 0.5]),
        )
        for i, pair in enumerate(pairs[:10])
    )
    checks = (
        Check("forward kinematics", Verdict.CERTIFIED, n * 9, 4e-16, 1e-9, "m"),
        Check("clearance", verdict, intervals * len(pairs), 0.0041, 0.0035, "m", "x"),
        Check("link angle cone", Verdict.CERTIFIED, n * 8, 0.65, 0.7418, "rad", "ψ5"),
    )
    return ArmVerification(
        problem=task,
        trajectory=rows,
        pairs=pairs,
        checks=checks,
        approaches=closest,
        profile=profile,
        least=least(len(pairs)),
        coverage=0.873,
        undrawn=np.array([[1.0, 1.5]]),
        joint_error=joint_error,
    )


def least(pairs: int) -> LeastClearances:
    """One pair after the other, each farther off than that before."""
    lower, points = 0.0041 + 0.01 * np.arange(pairs), np.full((2, pairs, 3), 1.5)
    none = np.zeros(pairs, np.int64)
    return LeastClearances(
        none, 0.25 + 0.0 * lower, lower, lower + 0.0001, none, *points
    )


def chunk(first: int, m: int, pairs: int, share: float = 0.0) -> ClearanceChunk:
    values = np.linspace(0.1, 0.2, m * pairs).reshape(m, pairs)
    points = np.stack([values] * 3, axis=2)
    verdicts = np.arange(m * pairs).reshape(m, pairs) % 3
    return ClearanceChunk(
        first,
        values,
        values + 0.01,
        0.0 * values + share,
        verdicts,
        points,
        points + 1.0,
    )
