"""Common balls of bodies that meet, none of bodies that do not."""

from typing import Any

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull, Hulls, Piece
from vdsm_pin.geometry.solids import BOX_CORNERS
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification import clearances, contacts
from vdsm_pin.verification.contacts import (
    BESIDE,
    INNER,
    MOST_PIECES,
    NEXT,
    Placed,
    common_ball,
    nearest_pieces,
)

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


@pytest.mark.parametrize("depth", [1e-6, 1e-5, 1e-4, 1e-3, 0.05])
@pytest.mark.parametrize("other", PIECES)
@pytest.mark.parametrize("one", PIECES)
def test_ball_where_bodies_meet_by_a_known_depth(
    one: str, other: str, depth: float
) -> None:
    """A ball of at least half the room there is, and of no more."""
    turn = rotation_from_rpy(np.array([0.3, -0.5, 1.1]))
    mine = placed(PIECES[one], 0.0, turn)
    theirs = placed(PIECES[other], 2.0 * WIDTH - depth, turn)
    radius, centre = common_ball(mine, theirs, turn @ [WIDTH, 0.05, 0.05])
    room = depth / 2.0
    assert 0.5 * room <= radius <= room + 1e-9
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


ROUNDED = Hull(BOX_CORNERS * 0.1, 0.05)
SOLIDS = PIECES | {
    "rounded box": ROUNDED,
    "half-space": HalfSpacePiece(np.array([0.6, 0.0, 0.8]), 0.1),
}
DEEP = HalfSpacePiece(np.array([0.0, 0.0, 1.0]), 9.0)
LOST = TOLERANCES.bracket_gap + TOLERANCES.arithmetic
PART = 0.9 * INNER
"""Of the depth of a point the radius of the ball about it; [-]."""


def depth_of(piece: Piece, x: FloatArray) -> float:
    """How deep a point near the middle lies, in closed form."""
    if piece is BALL:
        return 0.1 - float(np.linalg.norm(x))
    if piece is CAPSULE:
        return 0.1 - float(np.hypot(x[0], x[1]))
    if piece is CYLINDER:
        return min(0.1 - float(np.hypot(x[0], x[1])), 0.2 - abs(float(x[2])))
    if isinstance(piece, HalfSpacePiece):
        return piece.offset - float(piece.normal @ x)
    assert isinstance(piece, Hull)
    return 0.1 + piece.radius - float(np.abs(x).max())


@pytest.mark.parametrize("name", SOLIDS)
def test_where_it_begins_the_ball_is_of_the_depth_there(name: str) -> None:
    """No deeper point is looked for: a part of nine tenths, less what is lost."""
    rng, piece = np.random.default_rng(5), SOLIDS[name]
    for _ in range(8):
        pose, x = np.eye(4), rng.uniform(-0.05, 0.05, 3)
        pose[:3, :3] = rotation_from_rpy(rng.uniform(-3.0, 3.0, 3))
        pose[:3, 3] = rng.uniform(-1.0, 1.0, 3)
        start = pose[:3, :3] @ x + pose[:3, 3]
        expected = PART * depth_of(piece, x) - LOST
        for both in ((piece, DEEP), (DEEP, piece)):
            mine, theirs = (
                Placed([one], np.eye(4) if one is DEEP else pose) for one in both
            )
            radius, centre = common_ball(mine, theirs, start, 0.0)
            assert radius == pytest.approx(expected, abs=1e-12)
            assert (centre == start).all()


def test_a_ball_must_be_larger_than_what_is_lost() -> None:
    """Both sides of the limit."""
    pose = np.eye(4)
    for depth in (LOST / PART + 1e-9, LOST / PART - 1e-9):
        x = np.array([0.1 - depth, 0.0, 0.0])
        radius, _ = common_ball(Placed([BOX], pose), Placed([DEEP]), x, 0.0)
        assert radius == pytest.approx(max(0.0, PART * depth - LOST), abs=1e-15)
    nowhere = np.array([0.0, np.nan, 0.0])
    assert common_ball(Placed([BOX]), Placed([DEEP]), nowhere)[0] == 0.0


def test_the_ball_is_within_the_corners_that_are_proved(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Whichever way one looks, some corner of the icosahedron is farther out."""
    seen = list[FloatArray]()

    def hold(pieces: object, corners: FloatArray, lost: float) -> bool:
        seen.append(corners)
        return True

    monkeypatch.setattr(contacts, "_hold", hold)
    x = np.array([0.01, 0.02, 0.03])
    radius, centre = common_ball(Placed([BALL]), Placed([DEEP]), x, 0.0)
    (corners,) = seen
    ways = np.random.default_rng(4).normal(size=(20_000, 3))
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    least = ((corners - centre) @ ways.T).max(axis=0).min()
    assert radius + LOST <= least <= 1.01 * (radius + LOST)
    depth = float(np.linalg.norm(corners[0] - centre))
    assert (radius + LOST) / depth <= ((5.0 + 2.0 * 5.0**0.5) / 15.0) ** 0.5


@pytest.mark.parametrize(("out", "share"), [(0.0, 0.9), (0.5, 0.5), (0.8, 0.1)])
def test_near_a_rounded_corner_a_smaller_ball_is_tried(
    out: float, share: float
) -> None:
    """Its planes say that it is deeper there than it is."""
    x = np.full(3, 0.1 + 0.05 * out / 3**0.5)
    seeming = 0.05 * (1.0 - out / 3**0.5)
    radius, _ = common_ball(Placed([ROUNDED]), Placed([DEEP]), x, 0.0)
    assert radius == pytest.approx(INNER * share * seeming - LOST, abs=1e-12)
    assert radius <= 0.05 * (1.0 - out)


@pytest.mark.parametrize("wrong", [0.06, 0.3, 10.0])
def test_a_depth_that_is_wrong_is_not_believed(
    wrong: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All or some of the corners are outside."""

    def lying(*arguments: object) -> float:
        where = arguments[-1]
        assert isinstance(where, np.ndarray)
        where[:] = 0.0, 0.0, 0.099
        return wrong

    monkeypatch.setattr(contacts, "climb", lying)
    monkeypatch.setattr(contacts, "SHARES", (0.9,))
    assert common_ball(Placed([BOX]), Placed([CAPSULE]), np.zeros(3))[0] == 0.0


def test_pieces_without_an_inside_have_a_ball_in_the_other() -> None:
    """A line and triangles, grown or not; two of them have none."""
    line = Hull(np.array([[-1.0, 0.0, 0.0], [1.0, 0.01, 0.0]]))
    flat = np.array([[-1.0, 0.02, 0.0], [1.0, 0.0, 1.0], [1.0, 0.0, -1.0]])
    for thin in (line, Hull(flat), Hull(flat, 0.01)):
        for mine, theirs in ((thin, BOX), (BOX, thin)):
            radius, centre = common_ball(Placed([mine]), Placed([theirs]), np.zeros(3))
            assert 0.05 < radius < 0.1 * INNER
            assert abs(centre[1]) <= 0.02
    assert common_ball(Placed([line]), Placed([Hull(flat)]), np.zeros(3))[0] == 0.0


@pytest.mark.parametrize("count", [3, MOST_PIECES, MOST_PIECES + 1, 3 * MOST_PIECES])
@pytest.mark.parametrize("radius", [0.0, 0.3])
def test_pieces_are_taken_by_how_near_their_boxes_are(
    count: int, radius: float
) -> None:
    rng = np.random.default_rng(count)
    for _ in range(5):
        corners, point = rng.uniform(-2.0, 2.0, (count, 3, 3)), rng.uniform(-2, 2, 3)
        pieces: list[Piece] = [Hull(one, radius) for one in corners]
        cylinders = [
            FlatCylinder(p, q / np.linalg.norm(q), 0.1, 0.05)
            for p, q in rng.uniform(-2.0, 2.0, (count, 2, 3))
        ]
        # A cylinder is at most as far from its centre as its length and radius reach.
        for some, low, high in (
            (pieces, corners.min(axis=1), corners.max(axis=1)),
            (
                cylinders,
                np.array([c.centre - 0.15 for c in cylinders]),
                np.array([c.centre + 0.15 for c in cylinders]),
            ),
        ):
            grown = radius if some is pieces else 0.0
            off = point - np.clip(point, low - grown, high + grown)
            order = np.argsort(np.linalg.norm(off, axis=1), kind="stable")
            found = nearest_pieces(some, point)
            assert len(found) == min(count, MOST_PIECES)
            if count <= MOST_PIECES:
                assert [id(one) for one in found] == [id(one) for one in some]
            else:
                wanted = {id(some[k]) for k in order[:MOST_PIECES]}
                assert {id(one) for one in found} == wanted
        off = point - np.clip(point, corners.min(axis=1), corners.max(axis=1))
        order = np.argsort(np.linalg.norm(off, axis=1), kind="stable")
        packed = nearest_pieces(Hulls(corners, radius), point)
        kept = order[:MOST_PIECES] if count > MOST_PIECES else np.arange(count)
        for one, k in zip(packed, kept, strict=True):
            assert isinstance(one, Hull) and (one.points == corners[k]).all()


def test_a_far_piece_among_many_is_found_wherever_the_body_stands() -> None:
    """The witness is told in the world, the pieces in their frame."""
    rng = np.random.default_rng(2)
    balls = [Hull(p[None], 0.01) for p in rng.uniform(-3.0, 3.0, (300, 3))]
    for k in (7, 130, 299):
        pose = np.eye(4)
        pose[:3, :3] = rotation_from_rpy(rng.uniform(-3.0, 3.0, 3))
        pose[:3, 3] = rng.uniform(-5.0, 5.0, 3)
        point = pose[:3, :3] @ balls[k].points[0] + pose[:3, 3]
        radius, centre = common_ball(Placed(balls, pose), Placed([DEEP]), point, 0.0)
        assert radius == pytest.approx(0.01 * PART - LOST, abs=1e-12)
        assert (centre == point).all()


@pytest.mark.parametrize("off", [-0.0099, -0.004, 0.0, 0.0013, 0.0071])
@pytest.mark.parametrize("length", [1.0, 0.25, 3.0])
def test_the_moment_of_most_depth_beside_another_is_found(
    off: float, length: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Bodies that are deepest at a moment, to a share of the steps between moments."""
    reach = min(1.0, length)
    start, span = 5.0, np.array([5.0 - length / 4, 5.0 + 3 * length / 4])
    deepest = start + off * reach
    monkeypatch.setattr(clearances, "_placed", lambda _, __, at: (at, at))
    monkeypatch.setattr(clearances, "seeming_depth", lambda at, *_: -abs(at - deepest))
    motion: Any = None

    def moments(about: np.ndarray, deadline: Deadline) -> list[float]:
        asked = motion, 0, start, np.zeros(3), about, deadline
        return list(clearances._moments(*asked))

    *beside, last = moments(span, NO_LIMIT)
    assert beside == pytest.approx((start + reach * BESIDE).clip(*span), abs=1e-12)
    assert last == pytest.approx(deepest, abs=reach * NEXT * 2.0**-10)
    still = np.array([start, start])
    assert moments(still, NO_LIMIT) == [start] * 6
    assert len(moments(span, Deadline(end=0.0))) == 5


def test_bodies_whose_boxes_do_not_meet_seem_apart_and_others_as_deep_as_they_are() -> (
    None
):
    """Of two balls on a line it is half of what they share, or of the gap."""
    for gap in (-0.15, -0.01, 0.005):
        other = np.eye(4)
        other[0, 3] = 0.2 + gap
        both = Placed([BALL]), Placed([BALL], other)
        middle = np.array([0.1 + gap / 2.0, 0.0, 0.0])
        found = contacts.seeming_depth(*both, middle)
        expected = -gap / 2.0 if gap < 0.0 else -np.inf
        assert found == pytest.approx(expected, abs=1e-6)
        assert contacts.seeming_depth(*both, np.array([np.nan, 0, 0])) == -np.inf
    assert contacts.common_ball(*both, np.array([np.inf, 0, 0]))[0] == 0.0


@pytest.mark.parametrize("one", PIECES)
def test_of_a_depth_what_is_lost_to_rounding_is_taken_off(one: str) -> None:
    """Of the depth that was climbed to, to the last digit."""
    both = placed(PIECES[one], 0.0, np.eye(3)), placed(BOX, 0.11, np.eye(3))
    point = np.array([0.055, 0.01, 0.0])
    (mine, theirs), *_ = contacts._meeting(*both, point)
    depth, _ = contacts._deepest(mine, theirs, point, np.inf)
    lost = TOLERANCES.bracket_gap + TOLERANCES.arithmetic
    sizes = [INNER * share * depth - lost for share in contacts.SHARES]
    radius, _ = common_ball(*both, point)
    assert radius > 0.0
    assert min(abs(radius - size) for size in sizes) < 1e-15


def test_the_icosahedron_that_is_held_holds_the_ball_that_is_told() -> None:
    """Oracle: the planes of its faces by Qhull."""
    np.testing.assert_allclose(
        np.linalg.norm(contacts.CORNERS, axis=1), 1.0, rtol=1e-15
    )
    inner = -ConvexHull(contacts.CORNERS).equations[:, 3].max()
    assert INNER <= inner <= INNER + 0.01
