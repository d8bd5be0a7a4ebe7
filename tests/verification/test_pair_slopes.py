"""Slopes of a pair's clearance, against differences of distances found otherwise."""

import numpy as np
import pytest
from oracles.shortcuts import start_proof
from oracles.tree_queries import random_tree, unit

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import FlatCylinder, Hull
from vdsm_pin.geometry.pieces import pack_pieces
from vdsm_pin.geometry.row_bounds import link_gaps, row_brackets
from vdsm_pin.geometry.solids import Box, Capsule, HalfSpace, Mesh, Sphere
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.proof.bodies import Body, PairTable
from vdsm_pin.proof.bodies import Pair as BodyPair
from vdsm_pin.proof.paths import Path
from vdsm_pin.verification.pair_slopes import pair_slopes
from vdsm_pin.verification.records import Pair
from vdsm_pin.verification.task import arm_assembly

ARM = built_in("hrm8")
GOAL, STEP = 1e-11, 1e-6
SHAPES = [
    Sphere("o", np.array([2.0, 0.5, -0.9]), 0.2),
    Capsule("o", np.array([2.0, 0.6, 0.6]), np.array([0.0, 0.6, 0.8]), 0.1, 0.1),
    Box("o", np.array([1.5, -0.9, 0.4]), np.eye(3), np.array([0.2, 0.1, 0.15])),
    HalfSpace("o", np.array([0.0, 0.0, 2.5]), np.array([0.0, 0.0, -1.0])),
    Sphere("o", np.array([2.0, 0.0, 0.1]), 0.9),
    HalfSpace("o", np.array([0.0, 0.0, -0.3]), np.array([0.0, 0.0, -1.0])),
    Mesh(
        "o",
        np.array([[1.5, 0.8, -0.1], [2.5, 0.8, 0.0], [2.0, 0.9, 0.4], [2.0, 1.2, 0.2]]),
        np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]]),
    ),
]
ROUND = (Sphere, Capsule, HalfSpace)
"""Shapes whose distance has a slope inside too, but at the core."""


def poses(count: int, size: float) -> FloatArray:
    rng = np.random.default_rng(3)
    q = rng.uniform(-size, size, (count, 1 + 2 * ARM.n_links))
    q[:, 0] *= 0.2
    return q


def centres(q: FloatArray) -> FloatArray:
    return joint_centres(ARM, q[:, 0], q[:, 1::2], q[:, 2::2])


def obstacle_gaps(shape: Obstacle, q: FloatArray, link: int) -> FloatArray:
    ends = np.ascontiguousarray(centres(q)[:, link : link + 2])
    pieces, only = pack_pieces([shape.pieces]), np.zeros(len(q), np.int64)
    return row_brackets(pieces, ends, only, GOAL)[:, 1] - ARM.link_radius


def asked(scene: Scene, pair: Pair, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Clearances of a pair and their slopes."""
    tip = np.array([ARM.total_length, 0.0, 0.0])
    path = DesiredPath(tip, tip[None])
    problem = PlanningProblem(ARM, scene, path, 0.0, name="p")
    assembly = arm_assembly(problem)
    task = assembly.question.about(Path(q[:1])).task
    return pair_slopes(task, assembly.pairs.index(pair), q)


def differences(gaps: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Central differences, and where both sides agree that there is a slope."""
    here, ahead, behind = gaps
    smooth = np.abs(ahead + behind - 2.0 * here) <= 1e-9
    return (ahead - behind) / (2.0 * STEP), smooth


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_slopes_from_an_obstacle_are_those_of_differences(shape: Obstacle) -> None:
    q, looked = poses(40, 0.25), 0
    for link in (0, 4, 7):
        gaps, slopes = asked(Scene((shape,)), Pair(link + 1, shape.name), q)
        np.testing.assert_allclose(gaps, obstacle_gaps(shape, q, link), atol=1e-9)
        for j in range(q.shape[1]):
            step = STEP * np.eye(q.shape[1])[j]
            around = [obstacle_gaps(shape, q + k * step, link) for k in (0, 1, -1)]
            found, smooth = differences(around)
            smooth &= np.abs(gaps) > 0.01
            if not isinstance(shape, ROUND):
                smooth &= gaps > 0.0  # inside the others only the sign is known
            np.testing.assert_allclose(slopes[smooth, j], found[smooth], atol=2e-4)
            looked += int(smooth.sum())
        assert not slopes[:, 1 + 2 * (link + 1) :].any()
    assert looked > 1000


def test_slopes_between_links_are_those_of_differences() -> None:
    q, looked = poses(40, 0.7), 0
    for link, other in ((0, 2), (1, 5), (3, 7)):
        pair = Pair(link + 1, other_link=other + 1)
        gaps, slopes = asked(Scene(), pair, q)
        gaps += 2.0 * ARM.link_radius
        known = link_gaps(centres(q), np.zeros(ARM.n_links))[:, link, other]
        np.testing.assert_allclose(gaps, known, atol=1e-9)
        for j in range(q.shape[1]):
            step = STEP * np.eye(q.shape[1])[j]
            around = [
                link_gaps(centres(q + k * step), np.zeros(ARM.n_links))[:, link, other]
                for k in (0, 1, -1)
            ]
            found, smooth = differences(around)
            smooth &= gaps > 0.01
            np.testing.assert_allclose(slopes[smooth, j], found[smooth], atol=2e-4)
            looked += int(smooth.sum())
    assert looked > 1000


@pytest.mark.parametrize("seed", range(4))
def test_slopes_of_a_cylinder_from_a_ball_are_those_of_the_closed_form(
    seed: int,
) -> None:
    """A body with a disc, as links of robots have."""
    rng = np.random.default_rng([5, seed])
    tree = random_tree(rng, 4)
    rod, centre = (
        FlatCylinder(rng.normal(size=3), unit(rng), 0.3, 0.2),
        rng.normal(size=3),
    )
    bodies = Body(tree.n_frames - 1, (rod,)), Body(0, (Hull(centre[None], 0.05),))
    path = Path(np.zeros((1, tree.n_columns)))
    task = start_proof(tree, bodies, path, PairTable.of([BodyPair(0, 1)])).task
    q = rng.uniform(-1.0, 1.0, (40, tree.n_columns))

    def closed(q: FloatArray) -> FloatArray:
        T_rod_world = np.linalg.inv(tree.poses(q)[:, -1])
        away = T_rod_world[:, :3, :3] @ centre + T_rod_world[:, :3, 3] - rod.centre
        along = away @ rod.axis
        aside = np.linalg.norm(away - along[:, None] * rod.axis, axis=1)
        over = np.stack([np.abs(along) - 0.3, aside - 0.2]).clip(min=0.0)
        return np.asarray(np.hypot(*over) - 0.05)

    gaps, slopes = pair_slopes(task, 0, q)
    apart = gaps > 0.01
    assert apart.sum() > 20
    np.testing.assert_allclose(gaps[apart], closed(q)[apart], atol=1e-8)
    for j, step in enumerate(STEP * np.eye(tree.n_columns)):
        found, smooth = differences([closed(q + k * step) for k in (0, 1, -1)])
        smooth &= apart
        np.testing.assert_allclose(slopes[smooth, j], found[smooth], atol=2e-4)
