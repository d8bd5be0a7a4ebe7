"""Rays through edges and corners of closed meshes, against formulas."""

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.closed_meshes import SIGNED, SOLID
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.geometry.mesh_insides import encloses
from vdsm_pin.geometry.pieces import PackedPieces, pack_pieces
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.verification.link_clearance import link_clearance


def packed(mesh: trimesh.Trimesh) -> PackedPieces:
    corners = mesh.vertices[mesh.faces]
    return pack_pieces([[Hull(np.ascontiguousarray(t)) for t in corners]])


def is_inside(pieces: PackedPieces, point: FloatArray) -> bool:
    covers = np.full(len(pieces.kind), SOLID + SIGNED)
    return encloses(pieces, covers, 0, point)


HALVES = st.integers(-6, 6).map(lambda k: 0.5 * k)


@given(HALVES, HALVES, st.floats(-2.9, 2.9))
@settings(deadline=None)
def test_rays_on_the_grid_of_a_box_made_of_cubes(x: float, y: float, z: float) -> None:
    """Every ray meets edges or corners: the box's faces are cut at every half."""
    box = trimesh.creation.box([4.0, 4.0, 4.0]).subdivide().subdivide().subdivide()
    within = -2.0 <= x < 2.0 and -2.0 <= y < 2.0 and -2.0 <= z < 2.0
    if abs(z) != 2.0:
        assert is_inside(packed(box), np.array([x, y, z])) == within


def test_rays_through_the_corners_of_a_round_body() -> None:
    ball = trimesh.creation.icosphere(subdivisions=2)
    pieces, up = packed(ball), np.array([0.0, 0.0, 1.5])
    for corner in ball.vertices:
        if np.hypot(*corner[:2]) < 0.9:
            below = np.array([corner[0], corner[1], 0.0])
            assert is_inside(pieces, below)
            assert not is_inside(pieces, below + up)
            assert not is_inside(pieces, below - up)


@pytest.mark.parametrize("width", [0.923, 1.0, 3.0])
def test_a_link_inside_a_closed_box_is_not_clear(width: float) -> None:
    """Its first joint lies below the diagonals of two faces of the box."""
    solid = trimesh.creation.box([12.0, width, width])
    arm = built_in("hrm8")
    box = Mesh("box", np.asarray(solid.vertices), np.asarray(solid.faces))
    point = np.array([arm.total_length, 0.0, 0.0])
    path = DesiredPath(point, point[None])
    problem = PlanningProblem(arm, Scene((box,)), path, 0.0, name="box")
    along = np.concatenate([[0.0], np.cumsum(arm.link_lengths)])
    centres = np.stack([along, 0.0 * along, 0.0 * along], axis=1)[None]
    assert (link_clearance(problem)(centres) < 0.0).all()
    assert (link_clearance(problem)(centres + np.array([0.0, 0.0, width])) > 0.0).all()
