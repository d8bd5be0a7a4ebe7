"""A snake arm beside a robot, either judged: closed forms, both certificates."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from oracles.certificate_cases import certificate_lines, write_cube
from oracles.certificate_oracle import sealed
from oracles.random_robots import MESH

from tests.robots.test_robots import write
from tests.robots.test_two_robots import BASES, TIMES, rows_text, urdf
from tests.verification.test_other_arms import centres
from vdsm_pin import api
from vdsm_pin.app.motions import MotionOptions
from vdsm_pin.app.subjects import Subject, read_problem_or_cell, subject_of
from vdsm_pin.certificate_checker import check_certificate
from vdsm_pin.certificate_writer.certificate import write_certificate
from vdsm_pin.certificate_writer.lines import Hashes
from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import ends_of
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.source import sha256_of_file
from vdsm_pin.io.trajectory_file import write_trajectory
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.inputs import file_notes
from vdsm_pin.report.page_data import report_data
from vdsm_pin.robots.by_itself import POSES
from vdsm_pin.verification.limits import check_limits
from vdsm_pin.verification.records import Verdict, Verification

ARM = {"link_lengths": [0.3, 0.25], "link_radius": 0.03, "max_link_angle_deg": 80.0,
       "max_joint_angle_deg": 80.0, "base_range": [-0.5, 0.5]}  # fmt: skip
BALL, REQUIRED = 0.08, 0.01


def both(folder: Path, seed: int) -> tuple[Path, Path]:
    """The problem of a snake arm beside a swing, and that of the swing beside it."""
    rng = np.random.default_rng(seed)
    rows = np.column_stack([rng.uniform(-0.2, 0.2, 3), rng.uniform(-0.7, 0.7, (3, 4))])
    arm = Trajectory.of_joints(
        rows, np.zeros(3, bool), np.zeros(3), times=TIMES["left"]
    )
    write_trajectory(arm, folder / "arm.csv")
    write(folder, "ball.urdf", urdf(BALL))
    turns = rng.uniform(-2.5, 2.5, 3)
    write(folder, "ball.csv", rows_text(turns, TIMES["right"]))
    bases = [{"position": place, "rpy_deg": rpy} for place, rpy in BASES.values()]
    known = [{"manipulator": {"name": "arm", **ARM}}, {"robot": {"urdf": "ball.urdf"}}]
    files = []
    for k, name in enumerate(("arm", "ball")):
        other = {"name": "other", **known[1 - k], "base": bases[1 - k]}
        other["trajectory"] = ("ball.csv", "arm.csv")[k]
        text = {"vdsm_problem": 1, "length_unit": "m", **known[k], "base": bases[k],
                "required_clearance": REQUIRED, "others": [other]}  # fmt: skip
        files.append(write(folder, f"{name}.yaml", json.dumps(text)))
    return files[0], files[1]


def truth(arm: Path, turns: FloatArray, at: FloatArray) -> FloatArray:
    """Clearance of the ball from each of both links at some times, (n, 2); [m]."""
    problem = api.read_problem(arm)
    motion = api.read_trajectory(arm.parent / "arm.csv", problem)
    assert isinstance(motion, Trajectory)
    joints = centres(problem, motion, at)
    place, rpy = BASES["right"]
    angle = np.interp(at, TIMES["right"], turns) + np.radians(rpy[2])
    circle = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    ball = (0.5 * circle + np.array(place))[:, None]
    start, way = joints[:, :-1], np.diff(joints, axis=1)
    share = ((ball - start) * way).sum(axis=2) / (way**2).sum(axis=2)
    near = start + share.clip(0.0, 1.0)[..., None] * way
    away = np.linalg.norm(ball - near, axis=2)
    return np.asarray(away - BALL - ARM["link_radius"])


def judged(subject: Subject, file: Path, certificate: Path) -> Verification:
    """The verdict; what is certified has a certificate that the checker accepts."""
    found, source = subject.judge(subject.read(file)), subject.problem.source
    assert source is not None
    if found.verdict is Verdict.CERTIFIED:
        hashes = Hashes(source.sha256, sha256_of_file(file))
        write_certificate(certificate, found, hashes)
        outcome = check_certificate(certificate, source.path, file)
        assert outcome.accepted, outcome.reason
    return found


@pytest.mark.parametrize("seed", range(6))
def test_closed_form_and_either_judged(seed: int, tmp_path: Path) -> None:
    files = both(tmp_path, seed)
    rows = np.loadtxt(tmp_path / "ball.csv", delimiter=",", skiprows=1)
    for k, name in enumerate(("arm", "ball")):
        subject = subject_of(read_problem_or_cell(files[k]), MotionOptions())
        found = judged(subject, tmp_path / f"{name}.csv", tmp_path / "proof")
        own = TIMES["left" if name == "arm" else "right"]
        gaps = truth(files[0], rows[:, 0], np.linspace(own[0], own[-1], 20_001))
        assert len(found.pairs) == 2
        for at, least in enumerate(gaps.min(axis=0).tolist()):
            pair, link = found.pairs[at], f"other: link {at + 1}"
            named = (pair.link, pair.obstacle) if name == "arm" else pair.obstacle
            assert named == ((at + 1, "other: ball") if name == "arm" else link)
            lower, upper = found.least.lower[at], found.least.upper[at]
            assert lower <= max(least, 0.0) + 1e-9
            assert max(least, 0.0) <= max(upper, 0.0) + 1e-4
        certified = gaps.min() >= REQUIRED
        assert found.verdict is (Verdict.CERTIFIED if certified else Verdict.REFUTED)
        (note, *_) = file_notes(subject.problem)
        assert note.startswith("other: is judged by its")
        names = [check.name for check in found.checks]
        assert (f"other: {POSES}" in names) == (name == "arm")
        assert "other: " in report_data(found)["data"]


@pytest.mark.parametrize("share", [0.999, 1.001])
def test_limits_of_a_snake_arm_among_others(share: float, tmp_path: Path) -> None:
    """As of the arm itself; its angles are largest at waypoints."""
    arm, ball = both(tmp_path, 0)
    angles = np.array([[-0.1, 0.6, 0.2, 0.3, -0.4], [0.1, -0.7, 0.1, 0.2, 0.5]])
    none = np.zeros(2, bool), np.zeros(2)
    motion = Trajectory.of_joints(angles, *none, times=np.array([0.0, 3.0]))
    write_trajectory(motion, tmp_path / "arm.csv")
    limit, problem = share * np.rad2deg(0.7), json.loads(ball.read_text())
    problem["others"][0]["manipulator"] |= {"max_joint_angle_deg": limit}
    ball.write_text(json.dumps(problem))
    cell, itself = read_problem_or_cell(ball), api.read_problem(arm)
    found = subject_of(cell).judge(api.read_trajectory(tmp_path / "ball.csv", cell))
    checks = {one.name: one for one in found.checks}
    box = checks["other: alpha in its box"]
    assert box.worst == pytest.approx(0.7) and box.limit == np.deg2rad(limit)
    refuted = share < 1.0
    assert box.verdict is (Verdict.REFUTED if refuted else Verdict.CERTIFIED)
    assert not refuted or found.verdict is Verdict.REFUTED
    for one in check_limits(itself, motion):
        other = checks[f"other: {one.name}"]
        assert (other.worst, other.where) == (one.worst, one.where)


def test_meshes_of_the_other_robot_and_its_errors(tmp_path: Path) -> None:
    """In two hulls; the certificate is of them, and of errors of that link."""
    file, _ = both(tmp_path, 5)
    write_cube(tmp_path / MESH, 0.05)
    text = (tmp_path / "ball.urdf").read_text()
    mesh = text.replace(f'<sphere radius="{BALL}"/>', f'<mesh filename="{MESH}"/>')
    write(tmp_path, "ball.urdf", mesh)
    problem = json.loads(file.read_text())
    problem["others"][0]["robot"] |= {"bodies": "parts", "parts": 2}
    least = []
    for shift in (0.0, 0.02):
        problem["errors"] = {"obstacles": [{"name": "other: ball", "shift": shift}]}
        file.write_text(json.dumps(problem))
        subject = subject_of(read_problem_or_cell(file), MotionOptions())
        found = judged(subject, tmp_path / "arm.csv", tmp_path / "proof")
        assert found.verdict is Verdict.CERTIFIED
        least.append(found.least.lower.min())
    assert least[0] - least[1] == pytest.approx(0.02, abs=1e-3)
    lines, name = certificate_lines(tmp_path / "proof"), "other: ball"
    assert len({*lines[0]["links"][name]["meshes"][0]}) == 2
    for links, why in (
        ({}, "do not tile|pieces end at"),
        ({name: {"order": [], "meshes": [[0] * 11]}}, "over each triangle"),
        (lines[0]["links"] | {"link 1": {"order": [], "meshes": []}}, "without solids"),
    ):
        forged = [lines[0] | {"links": links}, *lines[1:]]
        (tmp_path / "forged").write_bytes(sealed(forged[:-1]))
        outcome = check_certificate(tmp_path / "forged", file, tmp_path / "arm.csv")
        assert re.search(why, outcome.reason)


def test_what_is_wrong_with_others_is_said(tmp_path: Path) -> None:
    for file, kind in zip(both(tmp_path, 0), ("robot", "manipulator"), strict=True):
        good = json.loads(file.read_text())
        other = good["others"][0]
        none = {key: value for key, value in other.items() if key != kind}
        more = {"robot": {"urdf": "ball.urdf"}, "manipulator": "hrm8"}
        wrong = [
            (none, r"others\[0\].*none of manipulator and robot"),
            (none | more, r"others\[0\].*both"),
            (other | {"trajectory": "no.csv"}, r"others\[0\].trajectory.*'no.csv'"),
            (other | {"base": {"position": [2e5, 0, 0]}}, r"others.*reaches"),
        ]
        if kind == "manipulator":
            wrong.append((other | {"topic": "/plan"}, r"others\[0\].topic.*no bags"))
        else:
            wrong.append((other | {"robot": {"urdf": "no.urdf"}}, r"no\.urdf"))
            with pytest.raises(InvalidFile, match=r"others\[0\].robot.*not read here"):
                read_problem(file)
        for entry, why in wrong:
            file.write_text(json.dumps(good | {"others": [entry]}))
            with pytest.raises(InvalidFile, match=why):
                read_problem_or_cell(file)


def test_an_arm_plans_beside_a_robot_that_rests(tmp_path: Path) -> None:
    """The robot's links at rest are where its joints end, cylinders too."""
    file, _ = both(tmp_path, 1)
    text = (tmp_path / "ball.urdf").read_text()
    more = '<collision><origin xyz="0.2 0.1 0" rpy="0.3 1 0"/><geometry>'
    more += '<cylinder radius="0.03" length="0.2"/></geometry></collision></link>\n'
    write(tmp_path, "ball.urdf", more.join(text.split("</link>\n")))
    scene = api.read_problem(file).scene
    (link,), (still,) = scene.obstacles, scene.at_time(scene.rest_time).obstacles
    pose = link.poses(np.array([scene.rest_time]))[0]
    pieces = zip(link.pieces, still.pieces, strict=True)
    for one, there in pieces:
        at = ends_of(one) @ pose[:3, :3].T + pose[:3, 3]
        np.testing.assert_allclose(ends_of(there), at, atol=1e-15)
    problem = json.loads(file.read_text())
    straight = {"x0": -0.2, "alpha_deg": [0, 0], "theta_deg": [0, 0]}
    problem |= {"start": {"joints": straight}, "goal": {"tip": [0.3, 0.15, 0.15]}}
    file.write_text(json.dumps(problem))
    asked = api.read_problem(file)
    found = api.verify(asked, api.plan(asked).trajectory)
    assert found.verdict is Verdict.CERTIFIED
