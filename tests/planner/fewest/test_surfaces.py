"""Bounds from points of a mesh's surface against the clearance function."""

import numpy as np
import pytest
import trimesh
from scenes_for_fewest import problem

from vdsm_pin.planner.fewest.nearby import nearby
from vdsm_pin.planner.fewest.surfaces import STEP, surfaces_of
from vdsm_pin.scene import Mesh
from vdsm_pin.verification.link_clearance import link_clearance

REACH = 0.3


def mesh(solid: trimesh.Trimesh, centre: tuple[float, float, float]) -> Mesh:
    vertices = np.asarray(solid.vertices) + np.array(centre)
    return Mesh("part", vertices, np.asarray(solid.faces), bool(solid.is_watertight))


RING = mesh(trimesh.creation.torus(0.4, 0.1, 24, 12), (2.0, 0.1, -0.2))
BRICK = mesh(trimesh.creation.box([3.0, 0.5, 0.4]), (1.5, 0.0, 0.3))
SHEET = Mesh("sheet", BRICK.vertices, BRICK.triangles[:7], False)


@pytest.mark.parametrize("part", [RING, BRICK, SHEET])
def test_bounds_from_points_lie_less_than_a_step_below_the_distance(part: Mesh) -> None:
    task, surfaces = problem(part), surfaces_of((part,))
    rng = np.random.default_rng(2)
    begin = rng.uniform([0.0, -0.7, -0.8], [3.0, 0.7, 0.8], (3000, 3))
    segments = np.stack([begin, begin + rng.normal(0.0, 0.2, (3000, 3))], axis=1)
    truth = link_clearance(task)(segments)[:, 0] + task.manipulator.link_radius
    bound = surfaces.least(segments, REACH)
    inside = np.isneginf(bound)
    # A link that touches no triangle of a closed mesh may be wholly within it.
    assert inside.any() == (part is not SHEET)
    assert (truth[inside] < 0.0).all()
    apart = truth > 0.0
    assert 200 < apart.sum() < 3000
    assert (bound <= np.maximum(truth, 0.0) + 1e-9).all()
    low = np.minimum(truth[apart], REACH) - surfaces.step
    assert (bound[apart] > low - 1e-9).all()


def test_a_large_mesh_gets_points_farther_apart() -> None:
    wall = mesh(trimesh.creation.box([0.1, 6.0, 6.0]), (2.0, 0.0, 0.0))
    assert surfaces_of((RING,)).step == STEP
    assert surfaces_of((wall,)).step > STEP
    assert surfaces_of(()).least(np.zeros((2, 2, 3)), REACH).tolist() == [np.inf] * 2


def test_the_clearance_function_is_asked_where_a_step_decides() -> None:
    task = problem(RING)
    exact, asked = link_clearance(task), []

    def counted(centres: np.ndarray) -> np.ndarray:
        asked.append(len(centres))
        return exact(centres)

    rng = np.random.default_rng(3)
    segments = rng.uniform([1.0, -1.0, -1.0], [3.0, 1.0, 1.0], (2000, 2, 3))
    bound, truth = nearby(task, counted)(segments)[:, 0], exact(segments)[:, 0]
    need = task.required_clearance
    np.testing.assert_array_equal(bound >= need, truth >= need)
    assert 0 < sum(asked) < 500
