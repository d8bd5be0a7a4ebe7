"""Distances from the surfaces of meshes against the clearance function."""

import numpy as np
import pytest
import trimesh
from scenes_for_fewest import problem

from vdsm_pin.geometry.solids import Box, Mesh, Sphere
from vdsm_pin.planner.broad_phase import broad_phase
from vdsm_pin.planner.mesh_distance import STEP, surfaces_of
from vdsm_pin.problem.held import Axes
from vdsm_pin.verification.link_clearance import link_clearance

REACH = 0.3
AXES = np.eye(3)


def mesh(solid: trimesh.Trimesh, centre: tuple[float, float, float]) -> Mesh:
    vertices = np.asarray(solid.vertices) + np.array(centre)
    return Mesh("part", vertices, np.asarray(solid.faces))


RING = mesh(trimesh.creation.torus(0.4, 0.1, 24, 12), (2.0, 0.1, -0.2))
BRICK = mesh(trimesh.creation.box([3.0, 0.5, 0.4]), (1.5, 0.0, 0.3))
SHEET = Mesh("sheet", BRICK.vertices, BRICK.triangles[:7])


def beside_an_edge(
    part: Mesh, segments: np.ndarray, rng: np.random.Generator
) -> np.ndarray:
    """Segments of no length, along an edge, nearly along one, and across one."""
    corners = part.pieces.corners[rng.integers(len(part.triangles), size=len(segments))]
    along, kind = corners[:, 1] - corners[:, 0], np.arange(len(segments)) % 4
    aside = rng.normal(0.0, 0.1, along.shape)
    segments[:, 0] = corners[:, 0] + aside + rng.random((len(along), 1)) * along
    segments[:, 1] = segments[:, 0] + along
    segments[kind == 0, 1] = segments[kind == 0, 0]
    segments[kind == 2, 1] += rng.normal(0.0, 1e-8, (int((kind == 2).sum()), 3))
    segments[kind == 3, 1] = segments[kind == 3, 0] - 2.0 * aside[kind == 3]
    return segments


@pytest.mark.parametrize("part", [RING, BRICK, SHEET])
def test_a_bound_lies_within_two_steps_below_the_distance(part: Mesh) -> None:
    task, surfaces = problem(part), surfaces_of((part,))
    rng = np.random.default_rng(2)
    begin = rng.uniform([0.0, -0.7, -0.8], [3.0, 0.7, 0.8], (3000, 3))
    segments = np.stack([begin, begin + rng.normal(0.0, 0.2, (3000, 3))], axis=1)
    segments[::3] = beside_an_edge(part, segments[::3], rng)
    truth = link_clearance(task)(segments)[:, 0] + task.manipulator.link_radius
    bound = surfaces.least(segments, 0.0, REACH)
    inside = np.isneginf(bound)
    # A link that touches no triangle of a closed mesh may be wholly within it.
    assert inside.any() == (part is not SHEET)
    assert (truth[inside] < 0.0).all()
    apart = truth > 0.0
    assert 200 < apart.sum() < 3000
    assert (bound <= np.maximum(truth, 0.0) + 1e-9).all()
    low = np.minimum(truth[apart], REACH) - 2.0 * STEP
    assert (bound[apart] > low).all()


@pytest.mark.parametrize("part", [RING, BRICK, SHEET])
def test_below_the_floor_nothing_is_known_and_above_it_nothing_is_lost(
    part: Mesh,
) -> None:
    surfaces, rng = surfaces_of((part,)), np.random.default_rng(4)
    begin = rng.uniform([0.0, -0.7, -0.8], [3.0, 0.7, 0.8], (3000, 3))
    segments = np.stack([begin, begin + rng.normal(0.0, 0.2, (3000, 3))], axis=1)
    every = surfaces.least(segments, 0.0, REACH)
    for floor in (0.02, 0.1, np.inf):
        some = surfaces.least(segments, floor, REACH)
        known = every >= floor - STEP
        np.testing.assert_array_equal(some[known], every[known])
        assert np.isneginf(some[~known]).all()
    assert np.array_equal(surfaces.least(segments[::-1], 0.0, REACH), every[::-1])


def test_a_scene_without_meshes_has_no_surfaces() -> None:
    distances = surfaces_of(()).least(np.zeros((2, 2, 3)), 0.0, REACH)
    assert distances.tolist() == [np.inf] * 2


def test_what_is_near_beside_a_mesh_is_measured_without_the_mesh() -> None:
    """Oracle: the clearance function, which knows all obstacles; it is never asked."""
    centre = np.array([2.0, 0.1, -0.2])
    task = problem(
        RING, Sphere("ball", centre, 0.15), Box("box", centre, AXES, AXES[0] + 0.1)
    )
    exact = link_clearance(task)

    def never(_: np.ndarray, axes: Axes = None, /) -> np.ndarray:
        raise AssertionError(axes)

    segments = np.random.default_rng(8).uniform(-0.7, 0.7, (3000, 2, 3)) + centre
    quick = broad_phase(task, never)
    bound, truth = quick(segments)[:, 0], exact(segments)[:, 0]
    near = truth < quick.far - 2.0 * STEP
    clear = near & (truth >= task.required_clearance)
    assert clear.sum() > 300
    assert (bound[clear] <= truth[clear] + 1e-9).all()
    assert (bound[clear] >= truth[clear] - 2.0 * STEP - 1e-9).all()
    assert (bound[truth < task.required_clearance] < task.required_clearance).all()
    assert (bound[~near] >= quick.far - 3.0 * STEP).all()


def test_the_clearance_function_is_asked_where_a_step_decides() -> None:
    task = problem(RING)
    exact, asked = link_clearance(task), []

    def counted(centres: np.ndarray, axes: Axes = None, /) -> np.ndarray:
        asked.append(len(centres))
        return exact(centres, axes)

    rng = np.random.default_rng(3)
    segments = rng.uniform([1.0, -1.0, -1.0], [3.0, 1.0, 1.0], (2000, 2, 3))
    quick, need = broad_phase(task, counted), task.required_clearance
    bound, truth = quick(segments)[:, 0], exact(segments)[:, 0]
    np.testing.assert_array_equal(bound >= need, truth >= need)
    assert sum(asked) < 10
    # Above the ring's highest triangles, by what decides and a little more or less.
    segments[:, 1] = segments[:, 0] = RING.vertices[RING.vertices[:, 2].argmax()]
    segments[:, :, 2] += quick.floor + task.manipulator.link_radius
    segments[:, :, 2] += rng.uniform(-3.0, 3.0, (len(segments), 1)) * STEP
    bound, truth = quick(segments)[:, 0], exact(segments)[:, 0]
    np.testing.assert_array_equal(bound >= quick.floor, truth >= quick.floor)
    assert 200 < sum(asked) < 1500
