"""What Coal gets wrong, one test each: with our care the answer stays sound.

The oracles are closed forms and the proved brackets, never Coal itself.
"""

import math

import coal
import numpy as np
import pytest
import trimesh

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.errors import VerificationFailed
from vdsm_pin.geometry.arrays import distinct_rows, rotation_from_rpy
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull
from vdsm_pin.geometry.pieces import pack_pieces
from vdsm_pin.geometry.row_bounds import row_brackets
from vdsm_pin.geometry.solids import (
    Box,
    Cylinder,
    HalfSpace,
    Mesh,
    PointCloud,
    Prism,
    Sphere,
    Voxels,
)
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification import coal_bodies as coal_side
from vdsm_pin.verification.coal_arm import CoalArm
from vdsm_pin.verification.coal_bodies import (
    LARGEST,
    coal_bodies,
    distance_request,
    measure,
    measure_each,
)
from vdsm_pin.verification.coal_check import check_coal
from vdsm_pin.verification.coal_hulls import (
    FLAT,
    CoalBody,
    coal_hull,
    coal_parts,
    hull_planes,
    is_solid,
    swept_polygon,
)
from vdsm_pin.verification.coal_shapes import CoalShapes, Sides, disagreement
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict

RADIUS, HALF = 0.06, 0.24
X_TO_Z = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])


def unit(rng: np.random.Generator) -> np.ndarray:
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def rotation_to(axis: np.ndarray) -> np.ndarray:
    start = np.eye(3)[np.argmin(np.abs(axis))]
    x = np.cross(start, axis)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)


def random_pairs(
    n: int, spread: float
) -> list[tuple[np.ndarray, np.ndarray, Cylinder]]:
    """Capsule centre and axis, and a cylinder nearby."""
    rng = np.random.default_rng(8)
    return [
        (
            rng.uniform(-spread, spread, 3),
            unit(rng),
            Cylinder("c", np.zeros(3), unit(rng), rng.uniform(0.1, 2.0), 0.2),
        )
        for _ in range(n)
    ]


def compared(
    pairs: list[tuple[np.ndarray, np.ndarray, Cylinder]], request: object
) -> tuple[np.ndarray, np.ndarray]:
    """Coal's distances and the proved brackets of capsule-cylinder pairs."""
    capsule = coal.Capsule(RADIUS, 2.0 * HALF)
    values, brackets = [], []
    for centre, axis, cylinder in pairs:
        pose = coal.Transform3s(rotation_to(axis), centre)
        values.append(measure(request, capsule, pose, coal_bodies(cylinder)))
        ends = np.array([[centre - HALF * axis, centre + HALF * axis]])
        pieces = pack_pieces([cylinder.pieces])
        bracket = row_brackets(pieces, ends, np.zeros(1, np.int64), 1e-9)
        brackets.append(bracket[0] - RADIUS)
    return np.array(values), np.array(brackets)


def test_settings_are_the_measured_ones() -> None:
    request = distance_request()
    assert request.gjk_tolerance == TOLERANCES.coal_gjk == 1e-8
    assert request.epa_tolerance == coal.DistanceRequest().epa_tolerance


def test_separated_pairs_are_within_1e_7_of_the_bracket() -> None:
    """At Coal's default tolerance the same pairs read up to 1.5e-6 m too far."""
    values, brackets = compared(random_pairs(1500, 1.5), distance_request())
    apart = brackets[:, 0] > 0.0
    assert apart.sum() > 700
    assert (values[apart] - brackets[apart, 1]).max() < 1e-7
    assert (brackets[apart, 0] - values[apart]).max() < 1e-7


def test_penetrating_pairs_have_an_answer_and_the_right_sign() -> None:
    """A tighter EPA tolerance loses some percent of these to -1.8e308."""
    values, brackets = compared(random_pairs(1000, 0.3), distance_request())
    inside = brackets[:, 1] < 0.0
    assert inside.sum() > 300
    assert np.isfinite(values).all()
    assert (values[inside] <= 0.0).all()
    assert (values[brackets[:, 0] > 0.0] > 0.0).all()


def test_a_ball_inside_near_the_cap_of_a_cylinder_has_the_right_sign() -> None:
    """Coal reports the depth to the side, -0.23 m, where the cap is 0.06 m away."""
    rng = np.random.default_rng(2)
    cylinder = Cylinder("c", np.zeros(3), np.array([0.0, 0.0, 1.0]), 0.5, 0.3)
    ball, request = coal.Sphere(0.05), distance_request()
    for _ in range(500):
        turn, out = rng.uniform(-np.pi, np.pi), rng.uniform(0.0, 0.25)
        depth = rng.uniform(-0.2, 0.049)  # of the ball's centre above the cap
        centre = np.array([out * np.cos(turn), out * np.sin(turn), 0.5 + depth])
        pose = coal.Transform3s(np.eye(3), centre)
        assert measure(request, ball, pose, coal_bodies(cylinder)) <= 0.0
        pose = coal.Transform3s(np.eye(3), centre + np.array([0.0, 0.0, 0.051 - depth]))
        found = measure(request, ball, pose, coal_bodies(cylinder))
        assert found == pytest.approx(0.001, abs=1e-7)


@pytest.mark.parametrize("gap", [0.3, 1e-3, 2e-8, -1e-6, -0.01])
def test_coaxial_bodies(gap: float) -> None:
    """End on: apart the closed form, in contact the sign; Coal's depth is 1 mm off."""
    axis = np.array([1.0, 0.0, 0.0])
    cylinder = Cylinder("c", np.zeros(3), axis, 0.5, 0.2)
    centre = np.array([0.5 + gap + RADIUS + HALF, 0.0, 0.0])
    pose = coal.Transform3s(X_TO_Z, centre)
    capsule = coal.Capsule(RADIUS, 2.0 * HALF)
    found = measure(distance_request(), capsule, pose, coal_bodies(cylinder))
    if gap > 0.0:
        assert found == pytest.approx(gap, abs=1e-7)
    else:
        assert found <= 1e-7


def test_an_answer_does_not_depend_on_the_one_before() -> None:
    """A reused DistanceResult keeps the smaller value; ours is always fresh."""
    capsule, request = coal.Capsule(RADIUS, 2.0 * HALF), distance_request()
    cylinder = coal_bodies(Cylinder("c", np.zeros(3), np.eye(3)[0], 1.0, 0.2))
    ball = coal_bodies(Sphere("s", np.zeros(3), 0.2))
    for bodies in (cylinder, ball):
        near = coal.Transform3s(np.eye(3), np.array([0.0, 0.5, 0.0]))
        far = coal.Transform3s(np.eye(3), np.array([0.0, 2.5, 0.0]))
        first = measure(request, capsule, far, bodies)
        assert measure(request, capsule, near, bodies) < first
        assert measure(request, capsule, far, bodies) == first


def test_the_nearest_ball_of_a_cloud_is_found_where_a_manager_of_coal_errs() -> None:
    rng, request, wrong = np.random.default_rng(5), distance_request(), 0
    points = rng.uniform(-1.0, 1.0, (300, 3))
    cloud = coal_bodies(PointCloud("c", points, 0.01))
    manager, ball = coal.DynamicAABBTreeCollisionManager(), coal.Sphere(0.01)
    objects = [
        coal.CollisionObject(ball, coal.Transform3s(np.eye(3), point))
        for point in points
    ]
    for one in objects:
        manager.registerObject(one)
    manager.setup()
    for centre in rng.uniform(-2.0, 2.0, (40, 3)):
        pose = coal.Transform3s(np.eye(3), centre)
        least = np.linalg.norm(points - centre, axis=1).min() - 0.11
        found = measure(request, coal.Sphere(0.1), pose, cloud)
        assert np.maximum(found, 0.0) == pytest.approx(max(least, 0.0), abs=1e-12)
        asked = coal.DistanceCallBackDefault()
        asked.data.request = request
        manager.distance(coal.CollisionObject(coal.Sphere(0.1), pose), asked)
        wrong += abs(asked.data.result.min_distance - least) > 1e-3
    assert wrong > 10


def test_the_nearest_of_many_is_found_from_every_side() -> None:
    """A long rod beside balls and cells, in every pose; oracle: each by itself."""
    rng, request = np.random.default_rng(6), distance_request()
    rod, turn = coal.Capsule(0.02, 3.0), rotation_to(unit(rng))
    cells = distinct_rows(rng.integers(-9, 9, (90, 3))).astype(float)
    half = np.array([0.05, 0.04, 0.03])
    grid = Voxels("v", 0.2 * cells @ turn.T, turn, half)
    boxes = [coal_bodies(Box("b", c, turn, half)) for c in grid.centres]
    points = rng.uniform(-1.0, 1.0, (90, 3))
    balls = coal_bodies(PointCloud("c", points, 0.01))
    alone = [coal_bodies(Sphere("s", point, 0.01)) for point in points]
    wedge = coal_hull(np.array([1.0, 2.0, 3.0]) + 0.3 * rng.uniform(size=(20, 3)))
    for _ in range(30):
        centre, axis = rng.uniform(-1.5, 1.5, 3), unit(rng)
        pose = coal.Transform3s(rotation_to(axis), centre)
        along = np.clip((points - centre) @ axis, -1.5, 1.5)
        gaps = np.linalg.norm(points - centre - along[:, None] * axis, axis=1) - 0.03
        found = measure(request, rod, pose, balls)
        assert max(found, 0.0) == pytest.approx(max(gaps.min(), 0.0), abs=1e-9)
        least = min(measure(request, rod, pose, one) for one in boxes)
        found = measure(request, rod, pose, coal_bodies(grid))
        assert max(found, 0.0) == pytest.approx(max(least, 0.0), abs=1e-7)
        pose.setTranslation(centre - pose.getRotation() @ [1.0, 2.0, 3.0])
        least = min(measure(request, wedge, pose, one) for one in alone)
        found = measure(request, wedge, pose, balls)
        assert max(found, 0.0) == pytest.approx(max(least, 0.0), abs=1e-7)


def test_the_nearest_part_counts_whatever_its_place_in_the_list() -> None:
    iron = [[0, 0], [1.0, 0], [1.0, 0.1], [0.1, 0.1], [0.1, 0.8], [0, 0.8]]
    prism = Prism("iron", np.zeros(3), np.eye(3), np.array(iron), (-1.0, 1.0))
    bodies = coal_bodies(prism)
    assert len(bodies) > 1
    ball = coal.Sphere(0.01)
    for place, gap in (([1.2, 0.05, 0.0], 0.19), ([0.05, 1.0, 0.0], 0.19)):
        pose = coal.Transform3s(np.eye(3), np.array(place))
        for order in (bodies, bodies[::-1]):
            found = measure(distance_request(), ball, pose, order)
            assert found == pytest.approx(gap, abs=1e-7)


def test_one_unusable_part_makes_the_whole_unusable(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    answers = iter([0.5, -1.7976931348623157e308])
    monkeypatch.setattr(coal, "distance", lambda *arguments: next(answers))
    body = CoalBody(coal.Sphere(0.1), coal.Transform3s())
    found = measure(distance_request(), coal.Sphere(1.0), body.pose, (body, body))
    assert found == -np.inf


HRM8 = built_in("hrm8")


def room(half: float, solid: bool) -> PlanningProblem:
    """The arm inside a closed mesh whose skin is far away."""
    shell = trimesh.creation.box(extents=[12.0, 2.0 * half, 2.0 * half])
    mesh = Mesh("room", shell.vertices, shell.faces, solid)
    tip = np.array([HRM8.total_length, 0.0, 0.0])
    path = DesiredPath(tip, tip[None])
    return PlanningProblem(HRM8, Scene((mesh,)), path, 0.0035, name="in")


def test_inside_a_solid_mesh_coal_speaks_of_its_skin_only() -> None:
    """Coal calls the arm 0.4 m clear; that it is inside is found elsewhere."""
    problem = room(0.4 + HRM8.link_radius, True)
    still, x0 = np.zeros((1, 8)), np.full(1, 0.1)
    trajectory = Trajectory(np.zeros(1), np.zeros(1), x0, still, still)
    arm = CoalArm(problem, links=False)
    (found,) = arm.near(trajectory, np.inf)
    np.testing.assert_allclose(found.distance, np.full(8, 0.4), atol=1e-7)
    (check,) = check_coal(problem, trajectory)
    assert check.verdict is Verdict.CERTIFIED, "the distances to the skin agree"
    centres = joint_centres(HRM8, x0, still, still)
    assert (link_clearance(problem)(centres) < 0.0).all(), "and yet it is inside"
    surface = room(0.4 + HRM8.link_radius, False)
    assert (link_clearance(surface)(centres) > 0.0).all()


def test_a_shape_coal_refuses_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*arguments: object) -> None:
        message = "the simplex is flat"
        raise RuntimeError(message)

    monkeypatch.setattr(coal, "Convex", refuse)
    triangle = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    prism = Prism("bar", np.zeros(3), np.eye(3), triangle, (0.0, 1.0))
    with pytest.raises(VerificationFailed, match=r"'bar': Coal refuses.*flat"):
        coal_bodies(prism)


def random_prism(rng: np.random.Generator) -> Prism:
    """Thick or flat, of three corners or of many, in any pose."""
    corners = int(rng.choice([3, 4, 7, 40, 600]))
    turns = np.sort(rng.uniform(0.0, 2.0 * np.pi, corners))
    turns[:3] = np.array([0.0, 2.0, 4.0]) + rng.uniform(0.0, 1.0, 3)
    turns = np.sort(turns)
    flat = [1.0, 10.0 ** rng.uniform(-15, -1)][rng.integers(2)]
    section = np.column_stack([np.cos(turns), flat * np.sin(turns)])
    span = [1.0, 10.0 ** rng.uniform(-15, -1)][rng.integers(2)]
    rotation = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    rotation *= np.linalg.det(rotation)
    turned = section[:: int(rng.choice([-1, 1]))]
    return Prism("bar", rng.uniform(-1, 1, 3), rotation, turned, (0.0, span))


def test_flat_prisms_and_many_corners_are_measured() -> None:
    """Coal's own hull ends the process where a body is flat, without a word."""
    rng, request = np.random.default_rng(4), distance_request()
    capsule, apart = coal.Capsule(RADIUS, 2.0 * HALF), 0
    for _ in range(400):
        prism, axis = random_prism(rng), unit(rng)
        centre = rng.uniform(-2.0, 2.0, 3)
        pose = coal.Transform3s(rotation_to(axis), centre)
        found = measure(request, capsule, pose, coal_bodies(prism))
        ends = np.array([[centre - HALF * axis, centre + HALF * axis]])
        pieces = pack_pieces([prism.pieces])
        bracket = row_brackets(pieces, ends, np.zeros(1, np.int64), 1e-9)[0] - RADIUS
        if bracket[0] > 0.0:
            apart += 1
            assert bracket[0] - 1e-7 < found < bracket[1] + 1e-7
        else:
            assert found < 1e-7
    assert apart > 150


NEAR = np.array([1.0, 2.0, 3.0])


@pytest.mark.parametrize(
    ("distance", "stored", "away", "usable"),
    [
        (0.5, 0.5, 0.5, True),
        (0.5, 0.5000001, 0.5, False),  # two answers
        (0.5, 0.5, 0.51, False),  # a witness farther or nearer than it says
        (0.5, 0.5, 0.49, False),
        (-0.5, -0.5, 0.1, True),  # of what overlaps the sign alone is a result
        (-0.5, -0.4, 0.5, False),
        (0.0, 0.0, 0.1, True),
        *((far, far, 0.5, False) for far in (LARGEST, -LARGEST, np.inf, np.nan)),
        (LARGEST, 0.5, 0.5, False),
    ],
)
def test_an_answer_of_coal_is_used_where_all_it_says_agrees(
    distance: float, stored: float, away: float, usable: bool
) -> None:
    gap = math.dist(NEAR, NEAR + np.array([0.0, away, 0.0]))
    assert bool(coal_side._usable(distance, stored, gap)) is usable


@pytest.mark.parametrize("n", [3, 4, 5, 12, 40])
def test_the_faces_of_a_swept_polygon_enclose_it(n: int) -> None:
    """Coal's own volume of the faces it is told: area times length."""
    turn = np.arange(n) * 2.0 * np.pi / n
    ends = [np.column_stack([np.cos(turn), np.sin(turn), 0 * turn + z]) for z in (1, 3)]
    swept = swept_polygon(np.vstack(ends))
    area = n / 2.0 * np.sin(2.0 * np.pi / n)
    assert swept.computeVolume() == pytest.approx(2.0 * area, rel=1e-12)


CUBE = np.array(np.meshgrid([0, 1], [0, 1], [0, 1], indexing="ij")).reshape(3, 8).T


def test_pieces_stand_where_they_are() -> None:
    """A ball, a rod with round ends or flat ones, a cube: a small ball beside each."""
    rng, request = np.random.default_rng(6), distance_request()
    for _ in range(20):
        turn, shift = rotation_from_rpy(rng.uniform(-3, 3, 3)), rng.uniform(-5, 5, 3)
        x, y, z = turn.T
        length = rng.uniform(0.5, 3.0)
        rod = np.array([shift - z * length, shift + z * length])
        for piece, out, gap in (
            (Hull(shift[None], 0.3), 2.0 * x, 1.6),
            (Hull(rod, 0.3), 2.0 * x, 1.6),
            (Hull(rod, 0.3), (length + 1.0) * z, 0.6),
            (FlatCylinder(shift, z, length, 0.3), 2.0 * y, 1.6),
            (FlatCylinder(shift, z, length, 0.3), (length + 1.0) * z, 0.9),
            (Hull(CUBE @ turn.T + shift), 2.0 * x + 0.5 * y + 0.5 * z, 0.9),
        ):
            parts = coal_parts([piece])
            assert parts is not None
            pose = coal.Transform3s(np.eye(3), shift + out)
            found = measure(request, coal.Sphere(0.1), pose, parts)
            assert found == pytest.approx(gap, abs=1e-7)


def test_pieces_that_coal_cannot_take_are_told() -> None:
    ball, point = Hull(np.zeros((1, 3)), 0.1), np.ones(3)
    flat, half = Hull(CUBE[:4]), HalfSpacePiece(np.eye(3)[0], 1.0)
    for bad in (flat, half, Hull(np.array([point, point]), 0.1)):
        assert coal_parts([ball, bad]) is None
    two = coal_parts([ball, Hull(CUBE)])
    assert two is not None and len(two) == 2
    assert hull_planes(CUBE[:4]) is None


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("away", [0.0, 1e3])
def test_points_are_solid_where_they_are_far_from_every_plane(
    size: float, away: float
) -> None:
    rng, turn = np.random.default_rng(1), rotation_from_rpy(np.array([0.3, 0.5, 2.0]))
    tetrahedron = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
    assert not is_solid(size * rng.normal(size=(3, 3)) + away)
    for share, solid in ((1.0, True), (10.0 * FLAT, True), (0.1 * FLAT, False)):
        points = size * tetrahedron * [1.0, 1.0, share] @ turn.T
        if away * 1e-16 < 1e-3 * size * share:  # else lost in rounding
            assert is_solid(points + away) is solid


def test_the_planes_of_a_hull_hold_it_closely() -> None:
    """Of a cube moved and turned: six directions, each at its face."""
    turn, shift = rotation_from_rpy(np.array([0.3, 0.5, 2.0])), np.array([3.0, -2, 1])
    corners = CUBE @ turn.T + shift
    planes = hull_planes(corners)
    assert planes is not None
    normals, offsets = planes
    heights = corners @ normals.T - offsets
    np.testing.assert_allclose(heights.max(axis=0), 0.0, atol=1e-12)
    np.testing.assert_allclose(heights.min(axis=0), -1.0, atol=1e-12)
    seen = {tuple(np.round(n @ turn).astype(int)) for n in normals}
    assert seen == {tuple(s * row) for row in np.eye(3, dtype=int) for s in (1, -1)}


def test_bodies_on_frames_are_as_far_apart_as_their_nearest_balls() -> None:
    """Bodies of one ball, of three, a cloud and none, on frames at rest and not."""
    rng = np.random.default_rng(12)
    balls = [rng.uniform(-1, 1, (n, 3)) for n in (1, 3, 200, 2, 0, 1)]
    radii, frames = [0.1, 0.05, 0.02, 0.07, 0.0, 0.03], [1, 2, 0, 0, 3, 3]
    bodies = [coal_parts([Hull(c[None], r) for c in some])
              for some, r in zip(balls, radii, strict=True)]  # fmt: skip
    shapes = [*bodies[:2], coal_bodies(PointCloud("c", balls[2], 0.02)), bodies[3],
              None, bodies[5]]  # fmt: skip
    poses = np.zeros((4, 4, 3, 4))
    poses[..., :3] = np.eye(3)
    for row in range(4):
        for frame in (1, 2, 3):
            poses[row, frame, :, :3] = rotation_from_rpy(rng.uniform(-3, 3, 3))
            poses[row, frame, :, 3] = rng.uniform(-4, 4, 3)
    pairs = [(i, j) for i in (0, 1, 3, 4, 5) for j in range(6) if i != j]
    rows = rng.integers(0, 4, len(pairs))
    for some in (range(len(pairs)), [k for k, p in enumerate(pairs) if p[1] in (2, 3)]):
        sides = Sides(rows[some], *np.array([pairs[k] for k in some]).T)
        found = CoalShapes(frames, shapes).distances(poses, sides)
        for n, k in enumerate(some):
            i, j = pairs[k]
            if 4 in (i, j):
                assert np.isnan(found[n])
                continue
            place = [poses[rows[k], frames[b]] for b in (i, j)]
            one, other = (
                balls[b] @ T[:, :3].T + T[:, 3]
                for b, T in zip((i, j), place, strict=True)
            )
            gaps = np.linalg.norm(one[:, None] - other[None], axis=2)
            gap = gaps.min() - radii[i] - radii[j]
            assert gap > 0.0 and found[n] == pytest.approx(gap, abs=1e-12)


def test_a_disagreement_is_what_lies_outside_the_bracket() -> None:
    cases = (
        (0.5, 0.4, 0.6, -0.1),
        (0.3, 0.4, 0.6, 0.1),
        (0.8, 0.4, 0.6, 0.2),
        (-0.5, -0.9, -0.1, 0.0),  # where bodies meet the sign alone counts
        (-0.5, 0.25, 0.5, 0.25),
        (0.5, -0.9, -0.1, 0.5),
        (-np.inf, -1.0, 1.0, np.inf),
        (np.nan, -1.0, 1.0, np.nan),
    )
    distance, lower, upper, expected = np.array(cases).T
    np.testing.assert_allclose(disagreement(distance, lower, upper), expected)


def test_many_pairs_are_measured_as_each_by_itself() -> None:
    """Obstacles of one part and of several, a cloud, what Coal cannot take, no call."""
    rng, request = np.random.default_rng(7), distance_request()
    cloud = coal_bodies(PointCloud("scan", rng.normal(size=(300, 3)), 0.01))
    balls = [Hull(2.0 * rng.normal(size=(1, 3)), 0.1) for _ in range(4)]
    obstacles = [coal_parts(balls[:1]), coal_parts(balls), cloud, None]
    calls, pairs = [], 100
    for k in range(pairs - 1):  # two bodies in a pair, or one
        for _ in range(1 + k % 2):
            size, shift = rng.uniform(0.1, 1.0, 2), rng.normal(size=3)
            capsule, turn = coal.Capsule(*size), rotation_from_rpy(rng.normal(size=3))
            calls.append((k, capsule, turn, shift, obstacles[k % 4]))
    found = measure_each(calls, pairs)
    for k in range(pairs):
        answers = [
            measure(request, shape, coal.Transform3s(turn, shift), bodies)
            for number, shape, turn, shift, bodies in calls
            if number == k and bodies is not None
        ]
        if not answers:
            assert np.isnan(found[k])
            continue
        assert found[k] == min(answers)


def test_one_unusable_answer_of_many_spoils_its_pair_alone(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    usual, ball, turn = coal.distance, coal.Sphere(0.1), np.eye(3)
    parts = coal_parts([Hull(np.array([[x, 0.0, 0.0]]), 0.1) for x in (1.0, 2.0)])
    calls = [(k, ball, turn, np.array([0.0, k, 0.0]), parts) for k in range(3)]
    answered = 0

    def failing(*arguments: object) -> float:
        nonlocal answered
        answered += 1
        return -LARGEST if answered == 4 else usual(*arguments)

    honest = measure_each(calls, 3)
    monkeypatch.setattr(coal, "distance", failing)
    found = measure_each(calls, 3)
    assert found.tolist() == [honest[0], -np.inf, honest[2]]


def test_bodies_are_as_far_as_the_balls_around_them_say() -> None:
    """Coal's distance lies between the two; of several parts there is no ball."""
    rng, eye = np.random.default_rng(5), np.eye(4)[None, None, :3]
    cube = rng.uniform(-0.2, 0.2, (12, 3))
    bodies = [
        coal_bodies(Box("b", np.array([0.1, 0.2, 0.0]), np.eye(3), np.full(3, 0.3))),
        coal_bodies(Sphere("s", np.array([0.0, 0.5, 0.0]), 0.2)),
        coal_parts([Hull(cube)]),
        coal_parts([Hull(cube), Hull(cube + 1.0)]),
        coal_bodies(HalfSpace("h", np.array([0.0, 0.0, -3.0]), np.eye(3)[2])),
    ]  # fmt: skip
    shapes = CoalShapes(range(1, 6), bodies)
    for _ in range(20):
        poses = np.tile(eye, (1, 6, 1, 1))
        for frame in range(1, 6):
            poses[0, frame, :, :3] = rotation_from_rpy(rng.uniform(-3.0, 3.0, 3))
            poses[0, frame, :, 3] = rng.uniform(-2.0, 2.0, 3)
        one, other = np.array([0, 0, 1, 0, 0]), np.array([1, 2, 2, 3, 4])
        sides = Sides(np.zeros(5, np.int64), one, other)
        low, high = shapes.between_balls(poses, sides)
        told = shapes.distances(poses, sides)[:3]
        assert (low[:3] <= told + 1e-9).all() and (told <= high[:3] + 1e-9).all()
        assert (high[:3] - low[:3] < 2.5).all()
        assert np.isnan(low[3]) and np.isnan(high[3])
        assert low[4] == -np.inf and high[4] == np.inf
