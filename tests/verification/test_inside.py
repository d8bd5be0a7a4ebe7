"""Verifier, certificate checker and start of a plan hold to one inside of meshes."""

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from oracles.certificate_cases import certificate_lines
from oracles.certificate_oracle import sealed, sha256
from oracles.closed_solids import (
    CLEAN,
    DOUBTFUL,
    GAPS,
    Made,
    made,
    sample_points,
    spoiled,
)

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.certificate_checker import check_certificate, main
from vdsm_pin.certificate_writer.certificate import write_certificate
from vdsm_pin.certificate_writer.lines import Hashes
from vdsm_pin.errors import InsideUnknown, InvalidFile, StartInside
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory
from vdsm_pin.planner.start import check_start
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.report.inputs import input_notes
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.brackets import ClearanceChunk
from vdsm_pin.verification.inside import mesh_notes
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict, Verification
from vdsm_pin.verification.verify import verify

RADIUS = 0.002
STEP = 0.001
NO_ERRORS = ErrorBox()


def obj(corners: FloatArray) -> str:
    """An OBJ file of triangles, every corner a vertex of its own."""
    points = (" ".join(map(repr, p)) for p in corners.reshape(-1, 3).tolist())
    lines = [f"v {point}" for point in points]
    lines += [f"f {3 * k + 1} {3 * k + 2} {3 * k + 3}" for k in range(len(corners))]
    return "\n".join(lines) + "\n"


def written(
    folder: Path, corners: FloatArray, solid: bool | None = None
) -> tuple[Path, Path]:
    """Problem and trajectory of a tiny arm at the origin beside or inside a mesh."""
    (folder / "part.obj").write_text(obj(corners))
    part = {"name": "housing", "shape": "mesh", "file": "part.obj", "check_size": False}
    problem = {
        "vdsm_problem": 1,
        "length_unit": "m",
        "manipulator": {
            "link_lengths": [0.01, 0.01],
            "link_radius": RADIUS,
            "max_link_angle_deg": 45,
            "max_joint_angle_deg": 45,
            "base_range": [-20, 20],
        },
        "obstacles": [part if solid is None else part | {"solid": solid}],
        "tip_path": {"start": [0.02, 0, 0], "points": [[0.02, 0, 0], [0.021, 0, 0]]},
        "required_clearance": 0.001,
    }  # fmt: skip
    header = (
        "waypoint,on_path,path_m,x0_m,alpha1_rad,theta1_rad,alpha2_rad,theta2_rad\n"
    )
    path = folder / f"{solid}.yaml"
    path.write_text(json.dumps(problem))
    rows = [f"{k},1,{k * STEP},{k * STEP},0.0,0.0,0.0,0.0\n" for k in range(2)]
    (folder / "t.csv").write_text(header + "".join(rows))
    return path, folder / "t.csv"


def verified(
    problem: Path, rows: Path, errors: ErrorBox = NO_ERRORS, **more: Any
) -> tuple[PlanningProblem, Verification]:
    file = read_problem(problem).under(errors)
    arm = file.manipulator
    found = verify(file, read_trajectory(rows, arm), **more)
    return file, found


def certificate(folder: Path, corners: FloatArray, solid: bool | None) -> Path:
    """A certificate of the motion where the mesh is what the problem then says."""
    problem, rows = written(folder, corners, solid)
    file, found = verified(problem, rows)
    path = folder / "c.certificate"
    write_certificate(path, found, Hashes(file.sha256, sha256(rows.read_bytes())))
    return path


def check_accepted(folder: Path, problem: Path, rows: Path) -> None:
    """The motion is certified, and the checker accepts its certificate."""
    file, found = verified(problem, rows)
    assert found.verdict is Verdict.CERTIFIED
    proof = folder / "c.certificate"
    write_certificate(proof, found, Hashes(file.sha256, sha256(rows.read_bytes())))
    outcome = check_certificate(proof, problem, rows)
    assert outcome.accepted, outcome.reason


def start_of(file: PlanningProblem) -> str:
    """What a planner says of the start."""
    try:
        check_start(file, link_clearance(file))
    except StartInside:
        return "refuted"
    except InsideUnknown:
        return "undecided"
    return "certified"


def hold(folder: Path, corners: FloatArray) -> str:
    """The verdict, which all three must agree on.

    A certificate of the surface alone, sealed again for the mesh as it is, must not be
    accepted where the verdict is another than certified.
    """
    problem, rows = written(folder, corners)
    file, found = verified(problem, rows)
    assert start_of(file) == found.verdict
    alone = found.verdict is not Verdict.CERTIFIED
    path = certificate(folder, corners, False if alone else None)
    if alone:
        lines = certificate_lines(path)
        lines[0]["problem_sha256"] = file.sha256
        path.write_bytes(sealed(lines[:-1]))
    outcome = check_certificate(path, problem, rows)
    assert outcome.accepted is not alone, outcome.reason
    assert not alone or "not proved outside housing" in outcome.reason
    return found.verdict.value


def box(half: float) -> FloatArray:
    return np.asarray(trimesh.creation.box(np.full(3, 2.0 * half)).triangles)


def spoil(seed: int) -> tuple[Made, FloatArray | None]:
    """A random mesh and a point of the arm's base, if there is room for the arm."""
    rng = np.random.default_rng(seed)
    mesh, faults = made(rng), ((), CLEAN, GAPS, DOUBTFUL)[seed % 4]
    if faults:
        spoiled(mesh, rng, faults)
    points = sample_points(mesh, rng, 3)
    wound = [p for p in points if any(mesh.windings(p))]
    return mesh, next(iter(wound or points), None)


def hold_random(folder: Path, seed: int) -> tuple[str, str]:
    """Truth in words and the verdict on one random mesh."""
    mesh, point = spoil(seed)
    if point is None:
        return "no room", "none"
    verdict, windings = hold(folder, mesh.corners - point), mesh.windings(point)
    told = f"seed {seed}, {mesh.faults}, {windings}"
    if sum(windings):
        truth = "inside"
        assert verdict != "certified", told
    elif any(windings):
        truth = "cavity"
    else:
        truth = "outside"
        assert verdict != "refuted", told
    return truth, verdict


def test_planner_verifier_and_checker_hold_to_the_truth(tmp_path: Path) -> None:
    seen = Counter(hold_random(tmp_path, seed) for seed in range(12))
    assert seen["inside", "refuted"] >= 2
    assert seen["outside", "certified"] >= 2


@pytest.mark.slow
def test_they_hold_to_the_truth_by_the_hundred(tmp_path: Path) -> None:
    seen = Counter(hold_random(tmp_path, seed) for seed in range(24, 900))
    assert seen["inside", "refuted"] >= 100
    assert seen["outside", "certified"] >= 100


def test_a_certificate_of_a_mesh_with_gaps_says_how_they_are_joined(
    tmp_path: Path,
) -> None:
    corners = box(0.5) + np.array([0.0, 0.0, 2.0])
    upper = corners.mean(axis=1)[:, 2] > 2.0
    corners[upper] += [0.0, 0.0, 1e-5]
    a, b, c = corners[0]
    middle = 0.5 * (a + b) + 1e-6
    below = box(0.5) - np.array([0.0, 0.0, 2.0])  # the arm is within the hull of both
    corners = np.concatenate([corners[1:], [[a, middle, c], [middle, b, c]], below])
    assert hold(tmp_path, corners) == "certified"
    for radius, verdict in ((2e-5, "certified"), (5e-6, "undecided")):
        # A feed thinner than a gap might pass through it.
        problem = json.loads((tmp_path / "None.yaml").read_text())
        problem["manipulator"]["feed"] = {"length": 0.01, "radius": radius}
        thin = tmp_path / "thin.yaml"
        thin.write_text(json.dumps(problem))
        assert verified(thin, tmp_path / "t.csv")[1].verdict == verdict
    lines = certificate_lines(tmp_path / "c.certificate")
    moved, seams = lines[0]["joined"]["housing"]
    assert moved
    assert len(seams) == 1
    files = tmp_path / "None.yaml", tmp_path / "t.csv"
    for joined, reason in (
        ([moved[1:], seams], "not closed"),
        ([moved, []], "not closed"),
        ([[*moved, [0, 30]], seams], "far apart"),
        ([moved, [[*seams[0][:3], 50]]], "far apart"),
        ([[], []], "not closed"),
    ):
        lines[0]["joined"]["housing"] = joined
        path = tmp_path / "forged"
        path.write_bytes(sealed(lines[:-1]))
        outcome = check_certificate(path, *files)
        assert not outcome.accepted
        assert reason in outcome.reason


def test_gaps_are_a_note_of_every_result(tmp_path: Path) -> None:
    corners = box(0.5).copy()
    corners[corners.mean(axis=1)[:, 2] > 0.0] += [0.0, 0.0, 1e-5]
    file, found = verified(*written(tmp_path, corners))
    assert found.verdict is Verdict.REFUTED
    notes = input_notes(file, found.trajectory)
    (note,) = (note for note in notes if "gaps" in note)
    assert "gaps of 'housing', up to 0.01 mm wide, were joined" in note


def test_an_arm_inside_has_the_clearance_of_an_arm_inside(tmp_path: Path) -> None:
    chunks: list[ClearanceChunk] = []
    paths = written(tmp_path, box(0.5))
    _, found = verified(*paths, sinks=(chunks.append,), joint_error=True)
    rows = {row.name: row for row in found.checks}
    assert rows["clearance from obstacles"].worst == -RADIUS
    assert rows["clearance from obstacles"].where == "the arm is inside 'housing'"
    assert rows["arm outside the meshes"].where == "the arm is inside 'housing'"
    assert [(one.lower, one.upper) for one in found.approaches] == [(-RADIUS,) * 2] * 2
    assert (found.profile.obstacle_upper == -RADIUS).all()
    assert (found.profile.link_lower == -RADIUS).all()
    (chunk,) = chunks
    assert (chunk.lower == -RADIUS).all()
    assert (chunk.upper == -RADIUS).all()
    assert (chunk.verdict == 1).all()
    assert found.joint_error == 0.0


def test_an_arm_that_leaves_a_mesh_is_inside_until_it_meets_the_surface(
    tmp_path: Path,
) -> None:
    chunks: list[ClearanceChunk] = []
    problem, rows = written(tmp_path, box(0.5))
    header, first, _ = rows.read_text().splitlines()
    later = [f"{k},0,0.0,{0.2 * k},0.0,0.0,0.0,0.0" for k in range(1, 6)]
    rows.write_text("\n".join([header, first, *later]) + "\n")
    verified(problem, rows, sinks=(chunks.append,))
    (chunk,) = chunks
    assert (chunk.upper[:2] == -RADIUS).all()
    assert (chunk.lower == -RADIUS).all()
    assert (chunk.upper[3:] > 0.09).all()


def test_a_link_that_reaches_out_of_a_mesh_has_its_distance_from_it(
    tmp_path: Path,
) -> None:
    shifted = box(0.5) - np.array([0.494, 0.0, 0.0])  # its end 6 mm before O_1
    _, found = verified(*written(tmp_path, shifted))
    assert found.verdict is Verdict.REFUTED
    pairs = [pair.own for pair in found.pairs if pair.obstacle]
    first, second = pairs.index("link 1"), pairs.index("link 2")
    assert found.least.upper[first] < 0.0
    apart = 0.010 - 0.006 - RADIUS
    assert found.least.lower[second] <= apart <= found.least.upper[second] + 1e-9
    assert found.least.lower[second] > 0.0
    assert not any(
        one.pair.own == "link 2" and one.upper < 0 for one in found.approaches
    )


@pytest.mark.parametrize("solid", [None, True, False])
def test_what_an_open_mesh_is_the_problem_says(
    solid: bool | None, tmp_path: Path
) -> None:
    problem, rows = written(tmp_path, box(0.5)[1:], solid)
    if solid:
        with pytest.raises(InvalidFile, match="is not closed: 3 edges have no partner"):
            read_problem(problem)
        return
    file, found = verified(problem, rows, joint_error=True)
    notes = input_notes(file, found.trajectory)
    if solid is None:
        assert found.verdict is Verdict.UNDECIDED
        (row,) = (row for row in found.checks if row.verdict is Verdict.UNDECIDED)
        assert "3 edges have no partner, and the arm is not proved clear" in row.where
        assert "write `solid: false` under 'housing'" in row.where
        assert found.joint_error == 0.0
        assert not any("surface only" in note for note in notes)
    else:
        assert found.verdict is Verdict.CERTIFIED
        assert any("is a surface only" in note for note in notes)


# ---- open meshes: their convex hull ----------------------------------------------


def bowl(height: float) -> FloatArray:
    """A box without its lid, its rim at a height; the arm is about the origin."""
    lid = (box(0.5)[:, :, 2] == 0.5).all(axis=1)
    return box(0.5)[~lid] + np.array([0.0, 0.0, height - 0.5])


def test_an_arm_far_from_an_open_mesh_is_outside_whatever_its_inside(
    tmp_path: Path,
) -> None:
    assert hold(tmp_path, bowl(-0.1)) == "certified"
    lines = certificate_lines(tmp_path / "c.certificate")
    assert lines[0]["pieces"] == {}
    outer = lines[1]["proofs"][:2]  # of the links and the mesh
    planes = [plane for proof in outer for _, _, some in proof for plane in some]
    assert {(first, last) for first, last, *_ in planes} == {(0, 10)}


@pytest.mark.parametrize(
    ("height", "verdict"),
    [(-0.0031, "certified"), (-0.0029, "undecided"), (0.1, "undecided")],
)
def test_an_open_mesh_must_be_kept_clear_of_by_the_required_clearance_of_its_hull(
    height: float, verdict: str, tmp_path: Path
) -> None:
    """Radius 2 mm and 1 mm of clearance above a rim that is half a metre away."""
    assert hold(tmp_path, bowl(height)) == verdict


def test_two_planes_for_an_open_mesh_are_no_proof(tmp_path: Path) -> None:
    """A plane for each half proves the surface clear, not what is between."""
    problem, rows = written(tmp_path, bowl(-0.1))
    path = certificate(tmp_path, bowl(-0.1), None)
    lines = certificate_lines(path)
    for proof in lines[1]["proofs"][:2]:
        for _, _, planes in proof:
            (plane,) = planes
            planes[:] = [[0, 4, *plane[2:]], [4, 10, *plane[2:]]]
    path.write_bytes(sealed(lines[:-1]))
    outcome = check_certificate(path, problem, rows)
    assert not outcome.accepted
    assert "not proved outside housing: the mesh is not closed" in outcome.reason


def test_errors_may_bring_the_arm_into_the_hull_of_an_open_mesh(
    tmp_path: Path,
) -> None:
    problem, rows = written(tmp_path, bowl(-0.01))
    _, found = verified(problem, rows, errors=ErrorBox(base=0.006), joint_error=True)
    assert found.verdict is Verdict.CERTIFIED
    assert found.joint_error == pytest.approx(0.001 / 0.03, rel=0.2)
    _, found = verified(problem, rows, errors=ErrorBox(base=0.008))
    assert found.verdict is Verdict.UNDECIDED
    surface, rows = written(tmp_path, bowl(-0.01), False)
    _, found = verified(surface, rows, errors=ErrorBox(base=0.008), joint_error=True)
    assert found.verdict is Verdict.CERTIFIED
    assert found.joint_error > 0.1


def test_a_time_limit_leaves_an_open_mesh_undecided(tmp_path: Path) -> None:
    problem, rows = written(tmp_path, bowl(-0.1))
    _, found = verified(problem, rows, deadline=Deadline.after(0.0))
    (row,) = (row for row in found.checks if row.name == "arm outside the meshes")
    assert row.verdict is Verdict.UNDECIDED
    assert "the time limit of 0 s came first" in row.where


def test_the_checker_names_what_was_assumed_of_a_mesh(tmp_path: Path) -> None:
    corners = box(0.5) + np.array([0.0, 0.0, 2.0])
    corners[corners.mean(axis=1)[:, 2] > 2.0] += [0.0, 0.0, 1e-5]
    path = certificate(tmp_path, corners, None)
    notes = check_certificate(path, tmp_path / "None.yaml", tmp_path / "t.csv").notes
    size, gaps, joined = notes
    assert size == "housing is taken to be 1 x 1 x 1 m; no unit is stated"
    assert gaps == "gaps of housing, up to 0.01 mm wide, are joined"
    assert joined == "linear pieces join the rows"
    assert main([str(path), str(tmp_path / "None.yaml"), str(tmp_path / "t.csv")]) == 0


def test_what_is_carried_alone_inside_a_mesh_is_the_nearest(tmp_path: Path) -> None:
    """A camera 15 mm beside the arm, within a hollow box that the arm is outside of."""
    hollow = np.array([0.005, 0.0, 0.015]) + box(0.008)
    path, rows = written(tmp_path, hollow)
    asked = json.loads(path.read_text())
    camera = {"name": "camera", "link": 1, "shape": "sphere"}
    camera |= {"center": [0.005, 0.0, 0.015], "radius": 0.001}
    asked["manipulator"] |= {"bodies": [camera]}
    asked |= {"required_clearance": 0.0}
    path.write_text(json.dumps(asked))
    _, found = verified(path, rows)
    assert found.verdict is Verdict.REFUTED
    first = found.approaches[0]
    assert (first.pair.own, first.pair.obstacle) == ("camera", "housing")
    assert first.deeper and first.lower == first.upper == -0.001
    assert found.min_clearance == found.least.upper.min() == -0.001
    worst = next(c for c in found.checks if c.name == "clearance from obstacles")
    assert (worst.worst, worst.where) == (-0.001, "the arm is inside 'housing'")


def test_a_link_that_is_not_held_off_a_mesh_may_begin_within(tmp_path: Path) -> None:
    """O_1 stands in one of two boxes, out of which link 1, left out, reaches.

    Link 2 is clear of both, which lie before and behind it: no one plane serves both.
    """
    boxes = np.concatenate([box(0.004), np.array([0.03, 0.0, 0.0]) + box(0.004)])
    path, rows = written(tmp_path, boxes)
    asked = json.loads(path.read_text())
    asked["manipulator"]["ignore_pairs"] = [["link 1", "housing"]]
    path.write_text(json.dumps(asked))
    check_accepted(tmp_path, path, rows)


def test_a_closed_path_may_be_drawn_on_without_leaving_it(tmp_path: Path) -> None:
    """One and a half times to and fro: begun again is only what was left before."""
    path, rows = written(tmp_path, box(0.004))
    asked = json.loads(path.read_text())
    ball = {"name": "far", "shape": "sphere", "center": [0, 3, 0], "radius": 0.1}
    points = [[0.02, 0, 0], [0.024, 0, 0]]
    asked["tip_path"] = {"start": points[0], "points": points, "closed": True}
    path.write_text(json.dumps(asked | {"obstacles": [ball]}))
    header, lap = rows.read_text().splitlines()[0], 0.008
    stations = [0.001 * k % lap for k in range(13)]
    lines = [
        f"{k},1,{s!r},{min(s, lap - s)!r},0.0,0.0,0.0,0.0"
        for k, s in enumerate(stations)
    ]
    rows.write_text("\n".join([header, *lines, ""]))
    check_accepted(tmp_path, path, rows)


@pytest.mark.parametrize(("gap", "told"), [(5e-11, 0), (5e-10, 1)])
def test_gaps_are_told_where_they_are_more_than_rounding(gap: float, told: int) -> None:
    """Of a box whose diagonal is 139 m, a part in 10^12 is 1.4e-10 m."""
    corners = np.asarray(trimesh.creation.box(np.full(3, 80.0)).triangles).copy()
    corners[corners.mean(axis=1)[:, 2] > 0.0] += [0.0, 0.0, gap]
    faces = np.arange(len(corners) * 3).reshape(-1, 3)
    mesh = Mesh("hall", corners.reshape(-1, 3), faces)
    scene = Scene((mesh,))
    problem = PlanningProblem(built_in("hrm8"), scene, None, 0.0, name="p")
    assert mesh.closed_mesh.closed and mesh.closed_mesh.gap > 0.5 * gap
    assert len(mesh_notes(problem)) == told
