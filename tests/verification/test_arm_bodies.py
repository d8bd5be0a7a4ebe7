"""Links of their own radii, a tool, and solids on links.

Oracles: distances by Coal at many instants, and problems whose answer is known.
"""

from dataclasses import replace
from itertools import pairwise, product
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pytest
import yaml
from oracles.certificate_cases import certificate_lines
from oracles.certificate_oracle import sealed, sha256
from scipy.spatial import Delaunay

from vdsm_pin.arm.bodies import (
    arm_bodies,
    convex_cover,
    self_pairs,
    triangle_groups,
)
from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.kinematics import joint_centres, link_frames
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.arm.mounted import LinkBody, Tool
from vdsm_pin.certificate_checker import check_certificate
from vdsm_pin.certificate_checker.solids import solid as checker_solid
from vdsm_pin.certificate_writer.certificate import write_certificate
from vdsm_pin.certificate_writer.lines import Hashes
from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry import solids
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import write_trajectory
from vdsm_pin.problem import scene
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.budget import Budget
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.brackets import ClearanceChunk
from vdsm_pin.verification.clearance import prove_clearance, prove_motion
from vdsm_pin.verification.coal_bodies import coal_bodies, distance_request, measure
from vdsm_pin.verification.records import Pair, Verdict
from vdsm_pin.verification.task import arm_assembly
from vdsm_pin.verification.verify import verify

LENGTHS = np.array([0.5, 0.4, 0.4, 0.45])
RADII = np.array([0.06, 0.05, 0.045, 0.04])
TOOL = Tool(0.15, 0.012)
COAL = 3e-6
"""How far Coal may be off; [m]."""


def arm_with(**more: Any) -> Manipulator:
    cables = CableLayout(0.01, 0.02, paper_hole_angles(len(LENGTHS)))
    known = "four", LENGTHS, 0.06, 1.3, 1.3, (-5.0, 5.0), cables
    return Manipulator(*known, radii=RADII, **more)


def problem_with(
    arm: Manipulator, *obstacles: scene.Obstacle, required: float = 0.0
) -> PlanningProblem:
    tip = np.array([arm.total_length, 0.0, 0.0])
    path = DesiredPath(tip, tip[None])
    shapes = scene.Scene(obstacles)
    return PlanningProblem(arm, shapes, path, required, name="p")


def rows_of(rng: np.random.Generator, size: float, n: int = 12) -> Trajectory:
    """Straight pieces between random configurations."""
    angles = rng.uniform(-size, size, (2, n, len(LENGTHS)))
    blank = np.zeros(n)
    return Trajectory(blank > 0.0, blank, rng.uniform(-0.2, 0.2, n), *angles)


def carried(rng: np.random.Generator, offset: FloatArray) -> list[Any]:
    """One solid of every kind that may ride on a link, near a point of its frame."""
    turn = rotation_from_rpy(rng.uniform(-3.0, 3.0, 3))
    size, axis = rng.uniform(0.02, 0.08, 3), turn[:, 0]
    notched = np.array([[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]])
    return [
        solids.Sphere("ball", offset, size[0]),
        solids.Capsule("rod", offset, axis, size[1], size[0]),
        solids.Cylinder("can", offset, axis, size[1], size[0]),
        solids.Box("box", offset, turn, size),
        solids.Prism("fork", offset, turn, 0.03 * notched, (0.0, float(size[0]))),
    ]


def test_a_plain_arm_leaves_out_neighbours_alone() -> None:
    arm = arm_with()
    found = self_pairs(arm, arm_bodies(arm))
    assert found.held.tolist() == [[0, 2], [0, 3], [1, 3]]
    reasons = [(row.body, row.other, row.reason) for row in found.left_out]
    meet = [(f"link {k}", f"link {k + 1}", k + 1) for k in (1, 2, 3)]
    assert reasons == [(a, b, f"meet at joint {k} in every pose") for a, b, k in meet]


def test_a_tool_is_held_off_the_link_before_its_own() -> None:
    arm = arm_with(tool=TOOL)
    bodies = arm_bodies(arm)
    assert [body.name for body in bodies][-2:] == ["link 4", "tool"]
    assert [2, 4] in self_pairs(arm, bodies).held.tolist()
    # A tool that reaches back to the joint meets the link behind it.
    short = arm_with(tool=Tool(0.44, 0.012))
    left = self_pairs(short, arm_bodies(short)).left_out
    assert ("link 3", "tool") in {(row.body, row.other) for row in left}


def test_one_pair_is_named_as_among_all() -> None:
    balls = [solids.Sphere(name, np.array([9.0, 0, 0]), 0.1) for name in ("a", "b")]
    asked = arm_assembly(problem_with(arm_with(tool=TOOL), *balls))
    assert {pair.obstacle for pair in asked.pairs} == {"a", "b", ""}
    pairs, n = asked.pairs, asked.table.size
    assert [asked.pair(k) for k in range(n)] == [*pairs] == [pairs[k] for k in range(n)]
    assert pairs[-2:] == tuple(pairs)[-2:] and pairs[-1] == asked.pair(n - 1)
    with pytest.raises(IndexError):
        pairs[n]


@pytest.mark.parametrize("field", ["radius", "length"])
def test_a_wrong_tool_is_refuted_where_it_touches(field: str) -> None:
    """A ball beside the tool: 0.1 mm more of it than there is room for."""
    arm, required = arm_with(tool=TOOL), 0.002
    tip = arm.total_length
    room, off = TOOL.radius + required + 1e-4, 0.05
    places = {
        "radius": np.array([tip - 0.05, room + off, 0.0]),
        "length": np.array([tip + room + off, 0.0, 0.0]),
    }
    ball = solids.Sphere("ball", places[field], off)
    still = Trajectory(
        np.zeros(1, bool), np.zeros(1), np.zeros(1), *np.zeros((2, 1, 4))
    )
    good = prove_clearance(
        problem_with(arm, ball, required=required), still, ErrorBox()
    )
    assert not good.counts[:, 1:].any()
    more = Tool(TOOL.length + 2e-4 * (field == "length"), TOOL.radius)
    if field == "radius":
        more = Tool(TOOL.length, TOOL.radius + 2e-4)
    lengths = LENGTHS.copy()
    lengths[-1] += more.length - TOOL.length
    wrong = problem_with(
        replace(arm, tool=more, link_lengths=lengths), ball, required=required
    )
    proof = prove_clearance(wrong, still, ErrorBox())
    refuted = np.flatnonzero(proof.counts[:, 1])
    assert [proof.pairs[k] for k in refuted] == [Pair(4, "ball", body="tool")]


def composed(pose: Any, frame: FloatArray, origin: FloatArray) -> Any:
    return coal.Transform3s(frame, origin) * pose


@pytest.mark.parametrize("seed", range(6))
def test_coal_agrees_with_every_bracket_of_every_solid(seed: int) -> None:
    rng = np.random.default_rng(seed)
    ride = [
        LinkBody(int(rng.integers(1, 5)), solid)
        for solid in carried(rng, rng.uniform(-0.1, 0.3, 3))
    ]
    arm = arm_with(tool=TOOL, bodies=tuple(ride))
    around = [
        solids.Sphere("s", np.array([0.9, 0.5, 0.3]), 0.2),
        solids.Cylinder("c", np.array([0.6, -0.6, 0.0]), np.eye(3)[2], 0.5, 0.1),
        solids.Box("b", np.array([1.2, 0.0, 0.7]), np.eye(3), np.full(3, 0.15)),
        solids.HalfSpace("h", np.array([0.0, 0.0, -0.8]), np.eye(3)[2]),
    ]
    problem, rows = problem_with(arm, *around), rows_of(rng, 0.4)
    box = ErrorBox(joint=float(rng.choice([0.0, 0.01])), base=0.003, base_turn=0.004)
    chunks: list[ClearanceChunk] = []
    motion = AskedMotion.of_arm(problem, rows, box if seed % 2 else ErrorBox())
    proof = prove_motion(motion, Budget(), [chunks.append])
    lower, looked = chunks[0].lower, 0
    for _ in range(40):
        k, share = int(rng.integers(len(lower))), rng.uniform()
        q = rows.joints[k] + share * (rows.joints[k + 1] - rows.joints[k])
        turn, shift = np.eye(3), np.zeros(3)
        if seed % 2:
            q[1:] += box.joint * rng.choice([-1.0, 1.0], q.size - 1)
            away = rng.normal(size=(2, 3))
            away /= np.linalg.norm(away, axis=1)[:, None]
            turn = turned(away[0], box.base_turn)
            shift = box.base * away[1]
        looked += agree(problem, proof.pairs, q, (turn, shift), lower[k])
    assert looked > 1000
    if seed % 2 == 0:
        attained(problem, rows, proof.pairs, chunks[0])


def turned(axis: FloatArray, angle: float) -> FloatArray:
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def distances(
    problem: PlanningProblem, pairs: Any, q: FloatArray, base: Any
) -> dict[int, float]:
    """Coal's distances of some pairs at a configuration; [m]."""
    arm, (turn, shift) = problem.manipulator, base
    centres = (
        joint_centres(arm, q[:1], q[None, 1::2], q[None, 2::2])[0] @ turn.T + shift
    )
    frames = turn @ link_frames(q[None, 1::2], q[None, 2::2])[0]
    placed, request = {}, distance_request()
    for body in arm_bodies(arm):
        k = body.link - 1
        solid = {one.name: one.solid for one in arm.bodies}.get(body.name)
        if solid is None and " part " in body.name:
            continue
        if solid is None:
            ends = body.corners
            middle, axis = ends.mean(axis=0), np.eye(3)[0]
            half = float(ends[1, 0] - ends[0, 0]) / 2.0
            solid = solids.Capsule(body.name, middle, axis, half, body.ball)
        (one,) = coal_bodies(solid)
        placed[body.name] = one.geometry, composed(one.pose, frames[k], centres[k])
    others = {one.name: coal_bodies(one) for one in problem.scene.obstacles}
    found = {}
    for k, pair in enumerate(pairs):
        if pair.own not in placed or not (pair.label in placed or pair.label in others):
            continue
        partner = others.get(pair.label)
        if partner is None:
            from vdsm_pin.verification.coal_hulls import CoalBody

            partner = (CoalBody(*placed[pair.label]),)
        gap = measure(request, *placed[pair.own], partner)
        if np.isfinite(gap):
            found[k] = gap
    return found


def agree(
    problem: PlanningProblem, pairs: Any, q: FloatArray, base: Any, lower: FloatArray
) -> int:
    found = distances(problem, pairs, q, base)
    for k, gap in found.items():
        if gap > 0.0:
            assert lower[k] <= gap + COAL, (pairs[k], lower[k], gap)
        else:
            assert lower[k] <= COAL, (pairs[k], lower[k], gap)
    return len(found)


def attained(
    problem: PlanningProblem, rows: Trajectory, pairs: Any, chunk: ClearanceChunk
) -> None:
    """Upper bounds are those of two points, so Coal is no farther at that time."""
    for k in range(len(chunk.upper)):
        for share in (0.0, 1.0):
            q = rows.joints[k] + share * (rows.joints[k + 1] - rows.joints[k])
            found = distances(problem, pairs, q, (np.eye(3), np.zeros(3)))
            for pair, gap in found.items():
                if chunk.share[k, pair] == share and gap > 0.0:
                    assert chunk.upper[k, pair] >= gap - COAL
                    points = chunk.link_point[k, pair] - chunk.other_point[k, pair]
                    apart = float(np.linalg.norm(points))
                    assert chunk.upper[k, pair] <= apart + 1e-9


def test_a_mesh_is_covered_by_the_hulls_of_its_own_triangles() -> None:
    rng = np.random.default_rng(4)
    corners = rng.normal(size=(400, 3)) * 0.1
    faces = rng.integers(0, 400, (500, 3))
    faces = faces[(np.diff(np.sort(faces, axis=1), axis=1) > 0).all(axis=1)]
    mesh = solids.Mesh("shell", corners, faces)
    for parts in (1, 5):
        cover = convex_cover(LinkBody(2, mesh, parts))
        assert len(cover) == parts
        normals = rng.normal(size=(200, 3))
        reach = np.stack([(piece.points @ normals.T).max(axis=0) for piece in cover])
        every = (mesh.vertices[mesh.triangles] @ normals.T).max(axis=1)
        held = (every[:, None] <= reach[None] + 1e-12).any(axis=1)
        assert held.all()


def box_mesh(low: FloatArray, high: FloatArray) -> FloatArray:
    """The triangles of a box, each side cut finely, shape (n, 3, 3)."""
    found, cells = [], np.linspace(0.0, 1.0, 5)
    for axis, end in product(range(3), (0.0, 1.0)):
        for (a, b), (c, d) in product(pairwise(cells), repeat=2):
            flat = np.array([(a, c), (b, c), (b, d), (a, c), (b, d), (a, d)])
            flat = flat if end else flat[::-1]
            found.append(np.insert(flat, axis, end, axis=1).reshape(2, 3, 3))
    return low + np.concatenate(found) * (high - low)


ELL = np.array([[0.0, 0.0, 0.0], [0.3, 0.1, 0.1], [0.0, 0.1, 0.0], [0.1, 0.3, 0.1]])
APART = ELL + np.repeat([[0.0], [0.5]], 2, axis=0)
CLOSE = np.array(
    [[0.0, 0.0, 0.0], [0.3, 0.3, 0.1], [0.3001, 0.1, 0.0], [0.4, 0.2, 0.1]]
)


@pytest.mark.parametrize(
    ("boxes", "parts", "solid"),
    [
        *[(ELL, 2, None), (ELL, 256, None), (CLOSE, 2, None), (CLOSE, 12, None)],
        *[(APART, 12, None), (APART, 256, False)],
    ],
)
def test_hulls_of_a_mesh_hold_its_inside(
    boxes: FloatArray, parts: int, solid: bool | None
) -> None:
    """By package and checker: points inside of boxes lie in one of the hulls.

    Unless only the surface is meant; and what lies between two solids stays free,
    however near they are.
    """
    rng = np.random.default_rng(parts)
    pairs = boxes.reshape(2, 2, 3)
    corners = np.concatenate([box_mesh(low, high) for low, high in pairs])
    faces = np.arange(3 * len(corners)).reshape(-1, 3)
    mesh = solids.Mesh("part", corners.reshape(-1, 3), faces, solid)
    body = LinkBody(2, mesh, parts)
    groups = [group.tolist() for group in triangle_groups(body)]
    checked = checker_solid(mesh).convex(groups)
    inside = np.concatenate(
        [low + rng.uniform(0.0, 1.0, (400, 3)) * (high - low) for low, high in pairs]
    )
    between = rng.uniform(-0.05, 1.0, (4000, 3)) * boxes.max(axis=0)
    between[:2] = [0.36, 0.38, 0.3], [0.30005, 0.15, 0.05]
    outside = [((between < low) | (between > high)).any(axis=1) for low, high in pairs]
    between = between[np.all(outside, axis=0)]
    for cover in (
        [piece.points for piece in convex_cover(body)],
        [part.points[0] for part in checked],
    ):
        assert len(cover) == parts
        held = np.zeros(len(inside), bool)
        free = True
        for points in cover:
            if np.linalg.matrix_rank(points - points[0], tol=1e-9) == 3:
                hull = Delaunay(points)
                held |= hull.find_simplex(inside, tol=1e-9) >= 0
                free &= bool((hull.find_simplex(between) < 0).all())
        assert held.all() == (solid is None)
        assert free or boxes is ELL


def test_an_obstacle_in_the_middle_of_a_mesh_on_a_link_is_refuted() -> None:
    """However many hulls stand for it: a ball in a box that nothing fills."""
    corners = box_mesh(np.array([0.1, 0.2, -0.1]), np.array([0.3, 0.4, 0.1]))
    faces = np.arange(3 * len(corners)).reshape(-1, 3)
    ball = solids.Sphere("ball", np.array([0.7, 0.3, 0.0]), 0.01)
    for parts, solid in product((1, 12, 200), (None, False)):
        mesh = solids.Mesh("part", corners.reshape(-1, 3), faces, solid)
        arm = arm_with(bodies=(LinkBody(2, mesh, parts),))
        problem = problem_with(arm, ball)
        rows = Trajectory.of_joints(np.zeros((1, 9)))
        proof = prove_clearance(replace(problem, tip_path=None), rows, ErrorBox())
        clear = bool((proof.counts[:, [1, 2]] == 0).all())
        assert clear == (solid is False and parts > 1)


# ---- files ---------------------------------------------------------------------------

FILE = {
    "vdsm_problem": 1,
    "length_unit": "m",
    "manipulator": {
        "link_lengths": [0.5, 0.4, 0.4, 0.3],
        "link_radius": RADII.tolist(),
        "max_link_angle_deg": 40,
        "max_joint_angle_deg": 40,
        "tool": {"length": 0.15, "radius": 0.012},
    },
    "obstacles": [
        {"name": "post", "shape": "sphere", "center": [1.4, 0.3, 0.1], "radius": 0.1}
    ],
    "required_clearance": 0.002,
}


def written(folder: Path, **arm: Any) -> tuple[Path, Path]:
    """A problem file and a trajectory that certifies it."""
    problem, rows = folder / "p.yaml", folder / "rows.csv"
    file = FILE | {"manipulator": FILE["manipulator"] | arm}
    problem.write_text(yaml.safe_dump(file))
    t = np.linspace(0.0, 1.0, 6)[:, None]
    alpha, theta = -0.2 * t * np.ones((1, 4)), 0.1 * t * np.ones((1, 4))
    blank = np.zeros(6)
    motion = Trajectory(blank > 0.0, blank, 0.1 * t[:, 0], alpha, theta)
    write_trajectory(motion, rows)
    return problem, rows


def certificate(folder: Path, problem: Path, rows: Path) -> Path:
    file = read_problem(problem)
    from vdsm_pin.io.trajectory_file import read_trajectory

    motion = read_trajectory(rows, file.manipulator)
    box = ErrorBox(0.002, 0.001, 0.001)
    found = verify(file.under(box), motion)
    assert found.verdict is Verdict.CERTIFIED, found.checks
    path = folder / "c.certificate"
    digest = sha256(rows.read_bytes())
    write_certificate(path, found, Hashes(file.sha256, digest))
    return path


def test_the_certificate_of_a_tool_is_accepted_and_of_a_thicker_one_is_not(
    tmp_path: Path,
) -> None:
    problem, rows = written(tmp_path)
    path = certificate(tmp_path, problem, rows)
    outcome = check_certificate(path, problem, rows)
    assert outcome.accepted, outcome.reason
    lines = certificate_lines(path)[:-1]
    assert ["tool", "post"] in lines[0]["pairs"]
    assert ["tool", "link 3"] in lines[0]["pairs"]
    for change, where in (
        ({"tool": {"length": 0.15, "radius": 0.0121}}, "tool"),
        ({"link_lengths": [0.5, 0.4, 0.4001, 0.3]}, "link 3"),
        ({"link_radius": [0.0601, *RADII[1:].tolist()]}, "link 1"),
    ):
        other, _ = written(tmp_path, **change)
        lines[0]["problem_sha256"] = read_problem(other).sha256
        path.write_bytes(sealed(lines))
        outcome = check_certificate(path, other, rows)
        assert not outcome.accepted
        assert where in outcome.reason


def test_radii_and_tools_are_refused_with_their_line(tmp_path: Path) -> None:
    for arm, words in (
        ({"link_radius": [0.05, 0.05]}, "has 2 values, expected 4"),
        ({"link_radius": [0.05, 0.05, 0.05, -1]}, "link_radius"),
        ({"tool": {"length": 0.0, "radius": 0.01}}, "tool.length"),
        ({"tool": {"length": 0.1}}, "tool.radius"),
        ({"link_radius": "thick"}, "link_radius"),
    ):
        problem, _ = written(tmp_path, **arm)
        with pytest.raises(InvalidFile, match=words):
            read_problem(problem)
