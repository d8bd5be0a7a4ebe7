"""A snake arm beside all that a problem file knows, in a folder, and certificates."""

import json
from pathlib import Path
from typing import Any

import numpy as np
from oracles.certificate_cases import (
    ROUNDED,
    accepted_closely,
    certificate_lines,
    check_sealed,
    write_cube,
)

from vdsm_pin.app.motions import MotionOptions
from vdsm_pin.app.subjects import read_problem_or_cell, subject_of
from vdsm_pin.certificate_checker import Outcome
from vdsm_pin.certificate_writer.certificate import write_certificate
from vdsm_pin.certificate_writer.lines import Hashes
from vdsm_pin.io.source import sha256_of_file
from vdsm_pin.io.trajectory_file import write_trajectory
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.records import Verdict

ARM: dict[str, Any] = {
    "link_lengths": [500, 400, 350],
    "link_radius": [40, 35, 30],
    "max_link_angle_deg": 70,
    "max_joint_angle_deg": 60,
    "base_range": [-500, 500],
    "tool": {"length": 90, "radius": 12},
    "feed": {"length": 300, "radius": 45},
    "bodies": [
        {"name": "camera", "link": 2, "shape": "box", "center": [150, 60, 10]}
        | {"size": [60, 40, 50], "rpy_deg": [10, 20, 30]},
        {"name": "valve", "link": 3, "shape": "mesh", "file": "valve.stl", "parts": 2}
        | {"length_unit": "mm", "center": [120, -50, 20], "rpy_deg": [0, 30, 0]},
    ],
    "ignore_pairs": [["camera", "link 1"], ["valve", "link 2"]],
}
MATE: dict[str, Any] = {
    "name": "mate",
    "manipulator": {"link_lengths": [300, 250], "link_radius": 30}
    | {"max_link_angle_deg": 70, "max_joint_angle_deg": 60}
    | {"tool": {"length": 50, "radius": 10}},
    "base": {"position": [400, 900, 200], "rpy_deg": [0, 10, -20]},
    "trajectory": "mate.csv",
}
HELPER: dict[str, Any] = {
    "name": "helper",
    "robot": {"urdf": "helper.urdf", "bodies": "parts", "parts": 4},
    "base": {"position": [900, -900, 300], "rpy_deg": [0, 0, 40]},
    "trajectory": "helper.csv",
}
URDF = """<robot name="helper">
  <link name="foot"><collision><origin xyz="0 0 0.1"/>
    <geometry><box size="0.2 0.1 0.2"/></geometry></collision>
    <collision><origin xyz="0 0.1 0.1" rpy="0.1 0.4 0"/>
    <geometry><cylinder radius="0.08" length="0.1"/></geometry></collision></link>
  <link name="hand"><collision><origin xyz="0.3 0 0" rpy="0.3 0 0.1"/>
    <geometry><mesh filename="hand.stl" scale="0.01 0.02 0.01"/></geometry>
    </collision></link>
  <joint name="turn" type="revolute"><parent link="foot"/><child link="hand"/>
    <origin xyz="0.05 0 0.2"/><axis xyz="0 1 3"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
</robot>
"""
DOOR: dict[str, Any] = {
    "name": "door", "shape": "box", "center": [0, 200, 0], "size": [30, 400, 300],
    "motion": {
        "times_s": [0, 1, 2],
        "positions": [[1900, 100, 0], [1880, 120, 0], [1900, 100, 40]],
        "rpy_deg": [[0, 0, 0], [0, 5, -20], [10, 0, -30]],
    },
}  # fmt: skip
OBSTACLES: tuple[dict[str, Any], ...] = (
    DOOR,
    {"name": "crate", "shape": "box", "center": [700, 0, -500], "size": [300, 200, 100]}
    | {"rpy_deg": [5, 10, 45]},
    {"name": "pillar", "shape": "cylinder", "axis": [0.2, 1, 0.1], "radius": 60}
    | {"center": [900, 0, 500], "length": 400},
    {"name": "floor", "shape": "half_space", "point": [9, 8, -900]}
    | {"normal": [0.1, 0.2, 1]},
    {"name": "notch", "shape": "prism", "axis": "x", "from": 1650, "to": 1700}
    | {"polygon": [[0, 0], [300, 0], [300, 300], [100, 100], [0, 300]]},
)
ERRORS: dict[str, Any] = {
    "joint_deg": [0.05, 0.1, 0.02],
    "base": 1.5,
    "base_deg": 0.1,
    "obstacle": 0.5,
    "obstacles": [{"name": "crate", "shift": 2, "turn_deg": 0.5}],
}


class MadeArm:
    """The files of a motion beside obstacles, and a certificate of it."""

    def __init__(self, folder: Path, smooth: bool = False, **more: Any) -> None:
        self.folder, self.most = folder, ROUNDED
        data = {
            "vdsm_problem": 1,
            "length_unit": "mm",
            "manipulator": ARM,
            "base": {"position": [20, -30, 10], "rpy_deg": [3, -2, 1]},
            "required_clearance": 5,
            "required_self_clearance": 1,
        }
        self.data: dict[str, Any] = json.loads(json.dumps(data | more))
        self.texts = {"helper.urdf": URDF}
        rng = np.random.default_rng(len(more))
        self.motions = {
            "t.csv": rows(rng, 3, smooth),
            "mate.csv": rows(rng, 2, smooth),
        }
        self.texts["helper.csv"] = "time_s,turn_rad\n0.0,-0.2\n1.0,0.1\n2.0,0.2\n"
        self.write_meshes()
        self.write()

    def write_meshes(self) -> None:
        for name, half in (("valve.stl", 20.0), ("hand.stl", 5.0)):
            write_cube(self.folder / name, half)

    def write(self) -> None:
        (self.folder / "p.yaml").write_text(json.dumps(self.data))
        for name, text in self.texts.items():
            (self.folder / name).write_text(text)
        for name, motion in self.motions.items():
            write_trajectory(motion, self.folder / name)

    @property
    def files(self) -> tuple[Path, Path]:
        return self.folder / "p.yaml", self.folder / "t.csv"

    def hashes(self) -> Hashes:
        source = read_problem_or_cell(self.files[0]).source
        assert source is not None
        return Hashes(source.sha256, sha256_of_file(self.files[1]))

    def certified(self) -> list[Any]:
        """The lines of the certificate, which is accepted."""
        self.write()
        subject = subject_of(read_problem_or_cell(self.files[0]), MotionOptions())
        found = subject.judge(subject.read(self.files[1]))
        wrong = [row for row in found.checks if row.verdict is not Verdict.CERTIFIED]
        assert not wrong, wrong
        proof = self.folder / "good"
        write_certificate(proof, found, self.hashes())
        accepted_closely(proof, *self.files, most=self.most)
        return certificate_lines(proof)[:-1]

    def check(self, lines: list[Any]) -> Outcome:
        """Of other lines beside the files as they are, by hashes that fit."""
        self.write()
        return check_sealed(lines, self.folder, self.files, self.hashes())


def rows(rng: np.random.Generator, n_links: int, smooth: bool) -> Trajectory:
    """Three rows that bend an arm gently, a second apart."""
    q = np.cumsum(rng.uniform(-0.04, 0.06, (3, 1 + 2 * n_links)), axis=0)
    rates = rng.uniform(-0.05, 0.05, q.shape) if smooth else None
    none = np.zeros(3)
    joints = q[:, 0], q[:, 1::2], q[:, 2::2]
    return Trajectory(none > 0, none, *joints, times=np.arange(3.0), rates=rates)
