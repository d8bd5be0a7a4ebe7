"""Common balls of bodies that meet, none of bodies that do not."""

import numpy as np
import pytest

from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.geometry.convex import FlatCylinder, Hull, Hulls, Piece
from vdsm_pin.geometry.solids import BOX_CORNERS
from vdsm_pin.verification.contacts import Placed, common_ball

BALL = Hull(np.zeros((1, 3)), 0.1)
CAPSULE = Hull(np.array([[0.0, 0.0, -0.2], [0.0, 0.0, 0.2]]), 0.1)
BOX = Hull(BOX_CORNERS * 0.1)
CYLINDER = FlatCylinder(np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.2, 0.1)
PIECES = {"ball": BALL, "capsule": CAPSULE, "box": BOX, "cylinder": CYLINDER}
WIDTH = 0.1
"""Half of each along x, turned about x or not; [m]."""


def placed(piece: Piece, x: float, turn: FloatArray) -> Placed:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = turn, turn @ [x, 0.0, 0.0]
    return Placed([piece], pose)


@pytest.mark.parametrize("depth", [1e-4, 1e-3, 0.05])
@pytest.mark.parametrize("other", PIECES)
@pytest.mark.parametrize("one", PIECES)
def test_ball_where_bodies_meet_by_a_known_depth(
    one: str, other: str, depth: float
) -> None:
    """A ball of at least a fifth of the room there is, and of no more."""
    turn = rotation_from_rpy(np.array([0.3, -0.5, 1.1]))
    mine = placed(PIECES[one], 0.0, turn)
    theirs = placed(PIECES[other], 2.0 * WIDTH - depth, turn)
    radius, centre = common_ball(mine, theirs, turn @ [WIDTH, 0.05, 0.05])
    room = depth / 2.0
    assert 0.2 * room <= radius <= room + 1e-9
    along = centre @ turn[:, 0]
    assert WIDTH - depth + radius - 1e-6 <= along <= WIDTH - radius + 1e-6


@pytest.mark.parametrize("other", PIECES)
@pytest.mark.parametrize("one", PIECES)
def test_no_ball_where_bodies_are_apart(one: str, other: str) -> None:
    """A gap of a micrometre is enough."""
    mine = placed(PIECES[one], 0.0, np.eye(3))
    theirs = placed(PIECES[other], 2.0 * WIDTH + 1e-6, np.eye(3))
    radius, _ = common_ball(mine, theirs, np.array([WIDTH, 0.0, 0.0]))
    assert radius == 0.0


@pytest.mark.parametrize("one", PIECES)
@pytest.mark.parametrize("depth", [1e-3, 0.05, -1e-6])
def test_ball_about_a_point_of_a_triangle_that_goes_in(one: str, depth: float) -> None:
    """It has no inside; its corner is that deep, and apart where that is negative."""
    turn = rotation_from_rpy(np.array([0.3, -0.5, 1.1]))
    tip = np.array([WIDTH - depth, 0.0, 0.0])
    triangle = Hull(
        (tip + np.array([[0, 0, 0], [1, 0.2, 0.3], [1, -0.4, 0.1]])) @ turn.T
    )
    radius, centre = common_ball(
        placed(PIECES[one], 0.0, turn), Placed([triangle]), turn @ [WIDTH, 0.0, 0.0]
    )
    assert (radius > 0.0) == (depth > 0.0)
    if depth > 0.0:
        assert radius <= depth
        assert 0.0 <= (centre - turn @ tip) @ turn[:, 0] <= depth


def test_of_many_pieces_the_near_ones_are_looked_at() -> None:
    """One triangle of a thousand crosses the body, the last."""
    rng = np.random.default_rng(0)
    far = rng.normal([5.0, 0.0, 0.0], 1.0, (1000, 3, 3))
    through = np.array([[[-1.0, 0.01, 0], [1.0, 0.02, 1], [1.0, -0.03, -1]]])
    body = placed(BOX, 0.0, np.eye(3))
    many = Placed(Hulls(np.concatenate([far, through])))
    assert common_ball(many, body, np.zeros(3))[0] > 0.01
    assert common_ball(Placed(Hulls(far)), body, np.zeros(3))[0] == 0.0
