"""Oracles: trimesh as a second reader of glTF, kinematics, pixels, stand-ins."""

import errno
import io
import json
import os
import shutil
import struct
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
import trimesh
from made_up import problem as made_up_problem
from made_up import trajectory
from PIL import Image
from problem_files import NEAR, write_problem

from vdsm_pin.app.export import export
from vdsm_pin.app.new_project import new_project
from vdsm_pin.arm.kinematics import joint_centres, link_frames
from vdsm_pin.cli import main
from vdsm_pin.errors import InvalidInput
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.arm_drawing import ArmDrawing
from vdsm_pin.report.film import Shot, pictures
from vdsm_pin.report.gltf import glb, play_times
from vdsm_pin.report.html import view_page
from vdsm_pin.report.robot_drawing import RobotDrawing
from vdsm_pin.robots.cell import read_cell
from vdsm_pin.robots.trajectory_files import read_motion

Y_UP = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]])

needs_chromium = [
    pytest.mark.display,
    pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium here"),
]


def opened(data: bytes) -> tuple[dict[str, Any], bytes]:
    """The JSON and the binary chunk, read by the specification."""
    magic, version, length = struct.unpack_from("<4sII", data)
    assert (magic, version, length) == (b"glTF", 2, len(data))
    size, kind = struct.unpack_from("<I4s", data, 12)
    assert (kind, size % 4) == (b"JSON", 0)
    rest = 20 + size
    binary, kind = struct.unpack_from("<I4s", data, rest)
    assert (kind, rest + 8 + binary) == (b"BIN\0", len(data))
    return json.loads(data[20:rest]), data[rest + 8 :]


def array(content: dict[str, Any], binary: bytes, number: int) -> np.ndarray:
    one = content["accessors"][number]
    view = content["bufferViews"][one["bufferView"]]
    part = binary[view["byteOffset"] : view["byteOffset"] + view["byteLength"]]
    return np.frombuffer(part, "<f4").reshape(one["count"], -1)


def turned(q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return v + 2.0 * np.cross(q[:3], np.cross(q[:3], v) + q[3] * v)


def test_gltf_moves_every_link_as_the_arm_does() -> None:
    task, rows = made_up_problem(), trajectory(60)
    content, binary = opened(glb(ArmDrawing(task, rows), 12.0))
    (motion,) = content["animations"]
    centres = joint_centres(task.manipulator, rows.x0, rows.alpha, rows.theta)
    frames = link_frames(rows.alpha, rows.theta)
    seen = set()
    for channel in motion["channels"]:
        sampler = motion["samplers"][channel["sampler"]]
        times = array(content, binary, sampler["input"])[:, 0]
        assert times[0] == 0.0
        assert times[-1] == pytest.approx(12.0)
        assert (np.diff(times) > 0.0).all()
        values = array(content, binary, sampler["output"])
        node = content["nodes"][channel["target"]["node"]]
        link = int(node["name"].split()[1])
        seen.add((link, channel["target"]["path"]))
        for k in range(rows.n_samples):
            if channel["target"]["path"] == "translation":
                np.testing.assert_allclose(values[k], centres[k, link - 1], atol=1e-6)
                continue
            for axis in range(3):
                found = turned(values[k].astype(float), np.eye(3)[axis])
                np.testing.assert_allclose(
                    found, frames[k, link - 1, :, axis], atol=1e-5
                )
    assert seen == {(k, p) for k in range(1, 9) for p in ("translation", "rotation")}


def test_a_second_reader_finds_every_body_where_it_is() -> None:
    task = made_up_problem()
    scene = trimesh.load(
        io.BytesIO(glb(ArmDrawing(task, trajectory(2)), 1.0)), file_type="glb"
    )
    solids = {one.name: one for one in task.scene.obstacles}
    assert solids.keys() | {f"link {k}" for k in range(1, 9)} == set(scene.geometry)
    for name in ("pillar", "ball", "crate"):
        shape = scene.geometry[name]
        turn, _ = scene.graph[name]
        middle = trimesh.transform_points(shape.bounds, turn).mean(axis=0)
        centre = Y_UP @ task.T_world_base[:3, :3] @ solids[name].centre
        np.testing.assert_allclose(middle, centre, atol=1e-5)


def test_a_motion_plays_evenly_by_what_moves_most_and_by_its_own_times() -> None:
    task, rows = made_up_problem(), trajectory(60)
    centres = joint_centres(task.manipulator, rows.x0, rows.alpha, rows.theta)
    most = np.linalg.norm(np.diff(centres, axis=0), axis=2).max(axis=1)
    drawing = ArmDrawing(task, rows)
    speed = most / np.diff(play_times(drawing, np.arange(60.0), 7.0))
    np.testing.assert_allclose(speed, speed[0], rtol=1e-4)
    times = np.linspace(3.0, 8.0, 60) ** 2
    timed = ArmDrawing(task, replace(rows, times=times))
    played = play_times(timed, np.arange(60.0))
    np.testing.assert_allclose(played, times - times[0], rtol=1e-12)
    played = play_times(timed, np.arange(60.0), 7.0)
    np.testing.assert_allclose(played, (times - 9.0) * 7.0 / 55.0, rtol=1e-12)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--out", "a.gif"], "ends in '.gif', expected .glb, .png or .mp4"),
        (["--out", "a.png", "--look", "below"], "expected one of overview"),
        (["--out", "a.png", "--moment", "3"], "a waypoint from 0 to 0"),
        (["--out", "a.mp4"], "an MP4 needs ffmpeg: 'nothing' is not installed"),
        (["--out", "near.yaml"], "is an input, read as near.yaml"),
        (["--out", "a.glb", "--moment", "3"], "--moment has no meaning with .glb"),
        (["--out", "a.glb", "--moment", "0"], "--moment has no meaning with .glb"),
        (["--out", "a.GLB", "--look", "side"], "--look has no meaning with .glb"),
        (["--out", "a.glb", "--width", "99"], "--width has no meaning with .glb"),
        (["--out", "a.png", "--seconds", "3"], "--seconds has no meaning with .png"),
        (["--out", "a.mp4", "--moment", "3"], "--moment has no meaning with .mp4"),
    ],
)
def test_what_cannot_be_exported_is_one_message(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    words: list[str],
    said: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("FFMPEG", "nothing")
    write_problem(tmp_path / "near.yaml", NEAR)
    with pytest.raises(SystemExit) as ended:
        main(["export", "near.yaml", *words])
    assert ended.value.code == 2
    told = capsys.readouterr().err
    assert said in told
    assert told.count("\n") == 1
    assert [path.name for path in tmp_path.iterdir()] == ["near.yaml"]


def test_the_clock_of_a_gltf_rises_where_the_arm_rests() -> None:
    """By the specification (2.0, 3.11); times have single precision."""
    rows = trajectory(60)
    still = np.sort(np.r_[np.arange(60), np.full(30, 20)])
    joints = Trajectory.of_joints(rows.joints[still])
    content, binary = opened(glb(ArmDrawing(made_up_problem(), joints)))
    (motion,) = content["animations"]
    for sampler in motion["samplers"]:
        times = array(content, binary, sampler["input"])[:, 0]
        assert (np.diff(times) > 0.0).all()
        assert len(array(content, binary, sampler["output"])) == len(times) > 50


@pytest.mark.parametrize("seconds", ["inf", "nan", "0", "1e6"])
def test_a_motion_plays_for_some_time(seconds: str, tmp_path: Path) -> None:
    file = str(write_problem(tmp_path / "near.yaml", NEAR))
    with pytest.raises(SystemExit) as ended:
        main(["export", file, "--out", str(tmp_path / "a.glb"), "--seconds", seconds])
    assert ended.value.code == 2
    assert not (tmp_path / "a.glb").exists()


def test_glb_is_written_without_a_browser(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CHROMIUM", "nothing")
    file = write_problem(tmp_path / "near.yaml", NEAR)
    with pytest.raises(SystemExit) as ended:
        main(["export", str(file), "--out", str(tmp_path / "near.glb")])
    assert ended.value.code == 0
    content, _ = opened((tmp_path / "near.glb").read_bytes())
    assert len(content["meshes"]) == 8 + 1 + 1


def test_a_full_folder_of_temporary_files_is_not_told_as_the_output(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def full(*_: object) -> list[bytes]:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "/elsewhere/view.html")

    monkeypatch.setattr("vdsm_pin.app.export.pictures", full)
    file = write_problem(tmp_path / "near.yaml", NEAR)
    with pytest.raises(SystemExit) as ended:
        main(["export", str(file), "--out", str(tmp_path / "near.png")])
    assert ended.value.code == 2
    told = capsys.readouterr().err
    assert "/elsewhere/view.html: No space left on device" in told
    assert "near.png" not in told


class TestWithABrowser:
    pytestmark = needs_chromium

    def test_a_picture_has_its_size_and_shows_another_moment_differently(
        self, tmp_path: Path
    ) -> None:
        page = view_page(ArmDrawing(made_up_problem(), trajectory(60)))
        shot = Shot("side", 640, 360)
        first, same, other = pictures(page, [0.0, 0.0, 20.0], shot, "png", tmp_path)
        seen = [Image.open(io.BytesIO(one)) for one in (first, same, other)]
        assert {one.size for one in seen} == {(640, 360)}
        colours = np.asarray(seen[0].convert("RGB")).reshape(-1, 3)
        assert len(np.unique(colours, axis=0)) > 100
        assert first == same != other

    def test_the_encoder_gets_every_frame(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        program = tmp_path / "encoder"
        program.write_text('#!/bin/sh\nfor to; do :; done\ncat > "$to"\n')
        program.chmod(0o755)
        monkeypatch.setenv("FFMPEG", str(program))
        problem = read_problem(write_problem(tmp_path / "near.yaml", NEAR))
        film, shot = tmp_path / "near.mp4", Shot(width=320, height=180)
        export(problem, None, film, seconds=1.0, shot=shot)
        written = film.read_bytes()
        assert written.count(b"\xff\xd8\xff\xe0") == 2  # it stands still

    def test_a_browser_that_draws_nothing_is_told(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        program = tmp_path / "browser"
        program.write_text("#!/bin/sh\nexit 0\n")
        program.chmod(0o755)
        monkeypatch.setenv("CHROMIUM", str(program))
        page = view_page(ArmDrawing(made_up_problem(), trajectory(5)))
        with pytest.raises(InvalidInput, match="drew 0 of 1 pictures"):
            pictures(page, [0.0], Shot(), "png", tmp_path / "a.png")


@pytest.mark.parametrize("smooth", [False, True])
def test_gltf_moves_a_robot_s_links_as_pinocchio_does(
    tmp_path: Path, smooth: bool
) -> None:
    """Oracle: Pinocchio's own reading of the URDF, at every moment of the file."""
    new_project(tmp_path / "cell", "robot")
    cell = read_cell(tmp_path / "cell" / "problem.yaml")
    motion = read_motion(tmp_path / "cell" / "plan.csv", cell.robot.joints)
    if smooth:
        times = np.arange(float(len(motion.q)))
        rates = np.gradient(motion.q, axis=0)
        motion = replace(motion, times=times, rates=rates)
    drawing = RobotDrawing(cell, motion)
    content, binary = opened(glb(drawing))
    model = pinocchio.buildModelFromUrdf(str(tmp_path / "cell" / "robot.urdf"))
    data, moments = model.createData(), drawing.told_moments()
    names = [node["name"] for node in content["nodes"]]
    found: dict[str, dict[str, np.ndarray]] = {}
    (played,) = content["animations"]
    for channel in played["channels"]:
        sampler = played["samplers"][channel["sampler"]]
        clock = array(content, binary, sampler["input"])[:, 0]
        assert clock[-1] == pytest.approx(motion.path.n_intervals if smooth else 10.0)
        name, path = names[channel["target"]["node"]], channel["target"]["path"]
        found.setdefault(name, {})[path] = array(content, binary, sampler["output"])
    assert found.keys() == {body.name for body in cell.robot.bodies}
    order = [model.joints[model.getJointId(j)].idx_q for j in motion.names]
    for k, q in enumerate(motion.path.at_moments(moments)):
        values = np.zeros(model.nq)
        values[order] = q
        pinocchio.framesForwardKinematics(model, data, values)
        for body in cell.robot.bodies:
            pose = data.oMf[model.getFrameId(body.name)]
            (piece,) = body.pieces
            middle = getattr(piece, "centre", None)
            if middle is None:
                middle = piece.points.mean(axis=0)  # type: ignore[union-attr]
            place, turn = found[body.name]["translation"], found[body.name]["rotation"]
            np.testing.assert_allclose(place[k], pose.act(middle), atol=1e-5)
            for axis in np.eye(3):
                at = turned(turn[k].astype(float), axis)
                np.testing.assert_allclose(at, pose.rotation @ axis, atol=1e-5)


@pytest.mark.parametrize("n", [2, 3000])
def test_gltf_moves_what_moves_between_the_rows_too(tmp_path: Path, n: int) -> None:
    """A ball that goes out and back in one interval, and rows that are thinned out."""
    ball = """vdsm_problem: 1
length_unit: mm
manipulator: {link_lengths: [300, 300], link_radius: 40, max_link_angle_deg: 40,
              max_joint_angle_deg: 40}
obstacles:
  - {name: ball, shape: sphere, center: [0, 0, 0], radius: 50, motion:
      {times_s: [1, 2, 3], positions: [[0, 0, 900], [0, 0, 500], [0, 0, 900]]}}
required_clearance: 5
"""
    file = tmp_path / "p.yaml"
    file.write_text(ball)
    problem = read_problem(file)
    none, angles = np.zeros(n), np.zeros((2, n, 2))
    rows = Trajectory(none > 0, none, none, *angles, times=np.linspace(0.0, 4.0, n))
    content, binary = opened(glb(ArmDrawing(problem, rows)))
    (motion,) = content["animations"]
    numbers = [k for k, node in enumerate(content["nodes"]) if node["name"] == "ball"]
    for channel in motion["channels"]:
        if channel["target"] == {"node": numbers[0], "path": "translation"}:
            sampler = motion["samplers"][channel["sampler"]]
            times = array(content, binary, sampler["input"])[:, 0]
            places = array(content, binary, sampler["output"])
    heights = np.interp(times, [1.0, 2.0, 3.0], [0.9, 0.5, 0.9])
    np.testing.assert_allclose(places[:, 2], heights, atol=1e-6)
    assert places[:, 2].min() < 0.501
