"""`--interpolation` of robots: the curve that is judged, its certificate, its refusal.

A joint that is at 0 at both waypoints and leaves at 4 rad/s to come back at -4 rad/s
within 1 s turns to 1 rad in between: the Hermite piece is 4 s (1 - s).
"""

import json
from pathlib import Path

import numpy as np
import pytest
from oracles.certificate_cases import certificate_lines, check_sealed

import vdsm_pin as vp
from vdsm_pin.certificate_checker import check_certificate
from vdsm_pin.cli import main
from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.trajectory_file import Interpolation

URDF = """<robot name="one">
  <link name="base"/>
  <link name="arm"><collision><origin xyz="1 0 0"/>
    <geometry><sphere radius="0.1"/></geometry></collision></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/>
    <axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="0"/></joint>
</robot>
"""
CELL = {
    "vdsm_problem": 1,
    "length_unit": "mm",
    "robot": {"urdf": "one.urdf"},
    "required_clearance": 100,
    "obstacles": [
        {
            "name": "ball",
            "shape": "sphere",
            "center": [1300 * float(np.cos(1.0)), 1300 * float(np.sin(1.0)), 0],
            "radius": 50,
        }
    ],
}
HEAD = "turn_rad,time_s,turn_velocity_rad_s,turn_acceleration_rad_s2\n"
ROWS = HEAD + "0,0,4,0\n0,1,-4,0\n"
FAR = float(np.sqrt(1.0 + 1.69 - 2.6 * np.cos(1.0)) - 0.15)
"""Clearance at 0 rad; at 1 rad it is 0.15 m."""


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    return int(str(ended.value.code))


@pytest.fixture
def cell(tmp_path: Path) -> Path:
    (tmp_path / "one.urdf").write_text(URDF)
    (tmp_path / "cell.yaml").write_text(json.dumps(CELL))
    (tmp_path / "t.csv").write_text(ROWS)
    return tmp_path / "cell.yaml"


def least(folder: Path) -> tuple[str, float]:
    """What joined the waypoints, and the least clearance; [m]."""
    file = json.loads((folder / "verification.json").read_text())
    return file["motion"]["interpolation"], file["closest"][0]["lower_m"]


def quintic_most() -> float:
    """The angle at half the time of the quintic piece, by its six conditions."""
    s = np.array([0.0, 1.0])
    conditions = np.vstack([s[:, None] ** np.arange(6)] * 3)
    for k in range(6):
        conditions[2:4, k] = k * s ** max(k - 1, 0)
        conditions[4:6, k] = k * (k - 1) * s ** max(k - 2, 0)
    parts = np.linalg.solve(conditions, [0.0, 0.0, 4.0, -4.0, 0.0, 0.0])
    return float(parts @ 0.5 ** np.arange(6))


def clearance_at(turn: float) -> float:
    return float(np.sqrt(1.0 + 1.69 - 2.6 * np.cos(1.0 - turn)) - 0.15)


def test_the_curve_that_is_asked_for_is_judged(cell: Path) -> None:
    motion, out = cell.parent / "t.csv", cell.parent / "out"
    most = quintic_most()
    assert 1.0 < most < 2.0  # beyond the ball, and past it on the way
    scene = cell.parent / "scene.yaml"
    scene.write_text(json.dumps({k: CELL[k] for k in ("length_unit", "obstacles")}))
    by_options = "--urdf", cell.parent / "one.urdf", "--scene", scene
    for asked in ((cell,), by_options):
        for joined, expected in (
            ("linear", FAR),
            ("cubic", 0.15),
            ("quintic", 0.15),
            ("auto", 0.15),
        ):
            words = "--trajectory", motion, "--interpolation", joined, "--out", out
            assert run("verify", *asked, *words) == 0
            kind, found = least(out)
            assert kind == ("quintic" if joined == "auto" else joined)
            assert found == pytest.approx(expected, abs=2e-6)


def test_slower_pieces_come_as_near_as_their_formula_says(cell: Path) -> None:
    """At half the speed: 1/2 rad by the cubic piece, by the quintic one 5/8."""
    problem = vp.read_cell(cell)
    (cell.parent / "t.csv").write_text(ROWS.replace("4,", "2,"))
    turns: dict[Interpolation, float] = {
        "linear": 0.0,
        "cubic": 0.5,
        "quintic": quintic_most() / 2.0,
    }
    for joined, turn in turns.items():
        motion = vp.read_trajectory(cell.parent / "t.csv", problem, joined)
        assert motion.interpolation == joined
        assert ("not read" in " ".join(motion.notes)) == (joined != "quintic")
        found = vp.verify(problem, motion)
        assert found.min_clearance == pytest.approx(clearance_at(turn), abs=2e-6)
        proof = cell.parent / f"{joined}.certificate"
        vp.write_certificate(found, proof, cell.parent / "t.csv")
        assert certificate_lines(proof)[0]["interpolation"] == joined
        assert check_certificate(proof, cell, cell.parent / "t.csv").accepted


def test_a_certificate_of_another_curve_is_refused(cell: Path) -> None:
    """Straight lines are 0.98 m clear, which the smooth pieces are not."""
    motion, out = cell.parent / "t.csv", cell.parent / "out"
    proof = cell.parent / "good"
    words = "--trajectory", motion, "--out", out, "--certificate", proof
    assert run("verify", cell, *words, "--interpolation", "linear") == 0
    assert run("check-certificate", proof, cell, motion) == 0
    lines = certificate_lines(proof)[:-1]
    for joined, reason in (
        ("cubic", "claims"),
        ("quintic", "claims"),
        ("auto", "interpolation is auto, the file's is quintic"),
        ("septic", "interpolation is septic, the file's is quintic"),
        (None, "interpolation is None, the file's is quintic"),
    ):
        lines[0]["interpolation"] = joined
        outcome = check_sealed(lines, cell.parent, (cell, motion), None)
        assert not outcome.accepted
        assert reason in outcome.reason
    lines[0]["interpolation"] = ["linear"]
    with pytest.raises(InvalidFile, match="cannot be read as a certificate"):
        check_sealed(lines, cell.parent, (cell, motion), None)


def test_what_the_pieces_need_is_asked_for(
    cell: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = cell.parent / "out"
    point = {"positions": [0.0], "velocities": [1.0]}
    given = {
        "t.csv": "turn_rad,time_s\n0,0\n1,1\n",
        "t.json": json.dumps({"joint_names": ["turn"], "points": [point, point]}),
        "u.csv": "turn_rad,turn_velocity_rad_s\n0,1\n1,1\n",
    }
    for name, text in given.items():
        (cell.parent / name).write_text(text)
        words = "--trajectory", cell.parent / name, "--out", out, "--interpolation"
        for joined in ("cubic", "quintic"):
            assert run("verify", cell, *words, joined) == 2
            said = capsys.readouterr().err
            assert said.startswith("vdsm: ")
            assert "has" in said
            assert "expected" in said or "smooth pieces between waypoints need" in said
        assert run("verify", cell, *words, "linear") == 0, capsys.readouterr().err
        assert least(out)[0] == "linear"


def test_a_batch_judges_the_curve_that_is_asked_for(
    cell: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = cell.parent / "out"
    words = "batch", cell, "--trajectories", cell.parent / "t.csv", "--out", out
    kinds = []
    for joined in ("linear", "cubic"):
        assert run(*words, "--interpolation", joined, "--resume") == 0
        (file,) = out.glob("*/verification.json")
        kinds.append(least(file.parent)[0])
    assert kinds == ["linear", "cubic"]
    assert run("batch", cell, "--interpolation", "linear", "--out", out) == 2
    assert "no meaning without --trajectories" in capsys.readouterr().err
