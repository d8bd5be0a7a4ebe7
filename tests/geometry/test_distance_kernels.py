"""Brackets of distances against closed forms that share nothing with the iteration."""

from collections.abc import Callable

import coal
import numpy as np
import pytest

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import new_body
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull, Piece
from vdsm_pin.geometry.kernels import (
    BRACKET,
    FAR,
    LOWER,
    NEAR,
    NORMAL,
    SCRATCH_ROWS,
    UPPER,
    Goal,
    bracket,
    bracket_to,
)
from vdsm_pin.geometry.obstacles import new_measuring, obstacle_bracket
from vdsm_pin.geometry.ordering import coherent_order
from vdsm_pin.geometry.pieces import PackedPieces, pack_pieces
from vdsm_pin.geometry.solids import BOX_CORNERS

GOAL = 1e-9


def measure(pieces: PackedPieces, p: int, points: FloatArray) -> FloatArray:
    out = np.zeros(BRACKET + 4)
    out[NORMAL:NEAR] = [0.3, -0.5, 0.7]
    scratch = np.zeros((SCRATCH_ROWS, 3))
    body = new_body(len(points), len(points), 0)
    body.points[:] = points
    bracket(pieces, p, body, GOAL, scratch, out)
    return out


def to_cylinder(piece: FlatCylinder) -> Callable[[FloatArray], float]:
    def distance(x: FloatArray) -> float:
        along = float((x - piece.centre) @ piece.axis)
        across = float(np.linalg.norm(x - piece.centre - along * piece.axis))
        beyond = max(0.0, abs(along) - piece.half_length)
        return float(np.hypot(beyond, max(0.0, across - piece.radius)))

    return distance


def to_box(rotation: FloatArray, centre: FloatArray, half: FloatArray):
    def distance(x: FloatArray) -> float:
        local = np.abs(rotation.T @ (x - centre)) - half
        return float(np.linalg.norm(np.maximum(local, 0.0)))

    return distance


def least_on_segment(
    distance: Callable[[FloatArray], float], ends: FloatArray
) -> float:
    """Least distance on a segment: convex in the parameter, so thirds find it."""
    low, high = 0.0, 1.0
    for _ in range(130):
        a, b = low + (high - low) / 3.0, high - (high - low) / 3.0
        at = [distance(ends[0] + t * (ends[1] - ends[0])) for t in (a, b)]
        low, high = (low, b) if at[0] <= at[1] else (a, high)
    return distance(ends[0] + 0.5 * (low + high) * (ends[1] - ends[0]))


def random_rotation(rng: np.random.Generator) -> FloatArray:
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    return np.asarray(q * np.sign(np.diag(r)))


def assert_brackets(out: FloatArray, truth: float) -> None:
    assert out[LOWER] <= truth + 1e-12
    assert out[UPPER] >= truth - 1e-12
    assert out[UPPER] - out[LOWER] <= 2.0 * GOAL
    assert np.linalg.norm(out[NORMAL:NEAR]) == pytest.approx(1.0, abs=1e-14)


def test_segment_and_flat_cylinder() -> None:
    rng = np.random.default_rng(1)
    for _ in range(150):
        axis = random_rotation(rng)[0]
        piece = FlatCylinder(rng.uniform(-1, 1, 3), axis, *rng.uniform(0.05, 1.0, 2))
        ends = rng.uniform(-2, 2, (2, 3))
        truth = least_on_segment(to_cylinder(piece), ends)
        if truth > GOAL:
            assert_brackets(measure(pack_pieces([[piece]]), 0, ends), truth)


def test_segment_and_box() -> None:
    rng = np.random.default_rng(2)
    corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    for _ in range(150):
        turn, centre = random_rotation(rng), rng.uniform(-1, 1, 3)
        half, ends = rng.uniform(0.01, 1.0, 3), rng.uniform(-2, 2, (2, 3))
        piece = Hull(centre + (corners * half) @ turn.T)
        truth = least_on_segment(to_box(turn, centre, half), ends)
        if truth > GOAL:
            assert_brackets(measure(pack_pieces([[piece]]), 0, ends), truth)


def test_brackets_hold_the_distances_of_coal() -> None:
    """Coal's capsule against its cylinder and box, within 0.1 um."""
    rng, request = np.random.default_rng(7), coal.DistanceRequest()
    request.gjk_tolerance = 1e-9
    radius, agreed = 0.05, 1e-7
    corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    compared = 0
    for trial in range(200):
        turn, centre = random_rotation(rng), rng.uniform(-1, 1, 3)
        turn[:, 2] *= np.linalg.det(turn)
        half, ends = rng.uniform(0.05, 1.0, 3), rng.uniform(-2, 2, (2, 3))
        if trial % 2:
            piece: Piece = Hull(centre + (corners * half) @ turn.T)
            body = coal.Box(*(2.0 * half))
        else:
            piece = FlatCylinder(centre, turn[:, 2], half[0], half[1])
            body = coal.Cylinder(half[1], 2.0 * half[0])
        along = ends[1] - ends[0]
        length = float(np.linalg.norm(along))
        across = np.cross(along, rng.normal(size=3))
        across /= np.linalg.norm(across)
        axes = np.stack([across, np.cross(along / length, across), along / length], 1)
        capsule = coal.Capsule(radius, length)
        place = coal.Transform3s(axes, ends.mean(axis=0))
        distance = coal.distance(
            capsule, place, body, coal.Transform3s(turn, centre), request,
            result := coal.DistanceResult(),
        )  # fmt: skip
        assert result.min_distance == distance
        if distance > agreed:
            out = measure(pack_pieces([[piece]]), 0, ends)
            assert out[LOWER] - agreed <= distance + radius <= out[UPPER] + agreed
            compared += 1
    assert compared > 100


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-9, 1e-12])
def test_parallel_and_rim_contacts(gap: float) -> None:
    """A segment beside a cylinder, over its cap, and opposite its rim."""
    piece = FlatCylinder(np.zeros(3), np.array([0.0, 0.0, 1.0]), 1.0, 0.5)
    pieces = pack_pieces([[piece]])
    slant = np.array([1.0, 0.0, 1.0]) / np.sqrt(2.0)
    rim = np.array([0.5, 0.0, 1.0]) + gap * slant
    across = np.array([0.0, 1.0, 0.0])
    for ends in (
        np.array([[0.5 + gap, 0.0, -0.7], [0.5 + gap, 0.0, 0.8]]),
        np.array([[-0.2, 0.1, 1.0 + gap], [0.3, -0.2, 1.0 + gap]]),
        np.array([rim - across, rim + across]),
    ):
        out = measure(pieces, 0, ends)
        assert out[LOWER] <= gap + 1e-15
        assert out[UPPER] >= gap - 1e-15
        # The direction of a vector as short as the gap is known to ulp / gap only.
        assert out[UPPER] - out[LOWER] <= max(2.0 * GOAL, 1e-16 / gap)


def test_meeting_bodies_have_no_positive_bound() -> None:
    rng = np.random.default_rng(3)
    for _ in range(100):
        centre = rng.uniform(-1, 1, 3)
        hull = Hull(centre + rng.uniform(-0.5, 0.5, (8, 3)), 0.05)
        inner = hull.points[:4].mean(axis=0)
        ends = np.array([inner, rng.uniform(-3, 3, 3)])
        out = measure(pack_pieces([[hull]]), 0, ends)
        assert out[LOWER] <= out[UPPER] <= 0.0 + 1e-12
        assert np.isfinite(out[LOWER])


@pytest.mark.parametrize("gap", [1e-5, 3e-5, 1e-4])
def test_what_lies_nearly_flat_on_the_rim_of_a_plate_is_measured(gap: float) -> None:
    """A foot of many corners beside a plate that is far larger: brackets are narrow.

    Long edges of their difference pass so near to the origin that a point on them,
    told to a rounding, does not tell where the origin is seen from. Oracle: where its
    lowest corner is above the plate, that is as far away as it is high.
    """
    rng, plate = np.random.default_rng(11), np.array([0.6, 0.5, 0.02])
    above = 0
    for _ in range(60):
        turn, count = random_rotation(rng), int(rng.integers(20, 90))
        angles = np.linspace(0.0, 2.0 * np.pi, count)
        ring = np.stack([0.02 * np.cos(angles), 0.05 * np.sin(angles)], axis=1)
        rings = [ring, 1.01 * ring, 0.8 * ring]
        heights = np.repeat([0.0, 8e-4, 0.1], count)
        foot = np.column_stack([np.concatenate(rings), heights])
        foot[:, 2] += foot[:, :2] @ (10.0 ** rng.uniform(-6, -2) * rng.normal(size=2))
        foot[:, :2] += plate[0], rng.uniform(-0.4, 0.4)
        foot[:, 2] += plate[2] + gap - foot[:, 2].min()
        piece = Hull((BOX_CORNERS * plate) @ turn.T)
        out = measure(pack_pieces([[piece]]), 0, foot @ turn.T)
        inside = foot[np.argmin(foot[:, 2]), 0] <= plate[0]
        assert_brackets(out, gap if inside else out[LOWER])
        assert out[LOWER] >= gap - GOAL
        above += inside
    assert 0 < above < 60


def test_half_space_is_exact() -> None:
    normal = np.array([0.0, 0.6, 0.8])
    pieces = pack_pieces([[HalfSpacePiece(normal, -0.5)]])
    out = measure(pieces, 0, np.array([[1.0, 0.0, 0.0], [2.0, 1.0, 1.0]]))
    assert out[LOWER] == out[UPPER] == pytest.approx(0.5, abs=1e-15)
    np.testing.assert_allclose(out[NORMAL:NEAR], -normal)
    assert normal @ out[FAR:BRACKET] == pytest.approx(-0.5, abs=1e-15)


def test_rounded_hulls_lose_their_radius() -> None:
    sphere = pack_pieces([[Hull(np.zeros((1, 3)), 0.25)]])
    out = measure(sphere, 0, np.array([[1.0, -1.0, 0.0], [1.0, 1.0, 0.0]]))
    assert_brackets(out, 0.75)
    np.testing.assert_allclose(out[FAR:BRACKET], [0.25, 0.0, 0.0], atol=1e-8)


def test_the_hierarchy_finds_the_nearest_of_many_pieces() -> None:
    rng = np.random.default_rng(4)
    centres = rng.uniform(-2, 2, (300, 1, 3))
    group: list[Piece] = [Hull(c + rng.uniform(-0.1, 0.1, (3, 3))) for c in centres]
    many, single = pack_pieces([group]), pack_pieces([[piece] for piece in group])
    assert sorted(many.order) == list(range(300))
    for _ in range(20):
        ends, body = rng.uniform(-3, 3, (2, 3)), new_body(2, 2, 0)
        body.points[:] = ends
        work = new_measuring()
        obstacle_bracket(many, 0, body, GOAL, work)
        out = work.out
        each = np.array([measure(single, p, ends)[:2] for p in range(300)])
        if each[:, 1].min() > GOAL:
            assert out[LOWER] == pytest.approx(each[:, 0].min(), abs=2.0 * GOAL)
            assert out[UPPER] >= each[:, 0].min() - 1e-12
        else:
            assert out[LOWER] <= 0.0


def test_coherent_order_is_a_permutation_with_compact_halves() -> None:
    points = np.random.default_rng(5).uniform(0, 1, (1000, 3))
    order = coherent_order(points)
    assert sorted(order) == list(range(1000))
    spread = np.ptp(points[order].reshape(8, 125, 3), axis=1).prod(axis=1)
    assert spread.sum() <= 1.0


def test_a_bracket_stops_where_it_is_narrow_or_far_enough() -> None:
    """Wherever it stops, the distance of two balls in closed form lies in it."""
    rng, early = np.random.default_rng(12), 0
    for _ in range(300):
        points, radius = rng.uniform(-1, 1, (30, 3)), float(rng.uniform(0.0, 0.3))
        centre = rng.uniform(1.5, 4.0) * np.array([0.6, 0.0, 0.8])
        pieces = pack_pieces([[Hull(centre[None], radius)]])
        exact = measure(pieces, 0, points)
        part, lost = float(rng.uniform(0.0, 0.5)), float(rng.uniform(0.0, 0.5))
        enough = float(rng.uniform(0.0, 4.0))
        out, scratch = np.zeros(BRACKET + 4), np.zeros((SCRATCH_ROWS, 3))
        out[NORMAL:NEAR] = [0.3, -0.5, 0.7]
        body = new_body(30, 30, 0)
        body.points[:] = points
        bracket_to(pieces, 0, body, Goal(GOAL, part, lost, enough), scratch, out)
        low, high = out[LOWER], out[UPPER]
        assert low <= exact[UPPER] + 1e-12 and high >= exact[LOWER] - 1e-12
        n = out[NORMAL:NEAR]
        assert low <= n @ centre - radius - (points @ n).max() + 1e-12
        wide = max(GOAL, part * (low - lost))
        assert high - low <= wide + 1e-12 or low >= enough
        early += bool(high - low > 2.0 * GOAL)
    assert early > 100


def test_radius_counts_as_what_clearance_is_less_by() -> None:
    """A ball of 1 m at 1 mm: a tenth of the clearance is 0.1 mm, not 100 mm."""
    box = np.array(BOX_CORNERS, dtype=np.float64) @ random_rotation(
        np.random.default_rng(4)
    )
    face = float((box @ [1.0, 0.0, 0.0]).max())
    ball = Hull(np.array([[face + 1.001, 0.1, 0.2]]), 1.0)
    pieces, out = pack_pieces([[ball]]), np.zeros(BRACKET + 4)
    out[NORMAL:NEAR] = [0.9, 0.3, -0.3]
    body, scratch = new_body(8, 8, 0), np.zeros((SCRATCH_ROWS, 3))
    body.points[:] = box
    bracket_to(pieces, 0, body, Goal(GOAL, 0.1, 0.0, np.inf), scratch, out)
    assert out[UPPER] - out[LOWER] <= max(GOAL, 0.1 * out[LOWER]) + 1e-12
