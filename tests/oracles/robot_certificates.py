"""A robot of every kind of joint and shape in a folder, and certificates of it."""

import copy
import json
from collections.abc import Callable
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
from oracles.shortcuts import read_rows

from vdsm_pin.certificate_checker import Outcome
from vdsm_pin.certificate_writer.certificate import write_certificate
from vdsm_pin.certificate_writer.lines import Hashes
from vdsm_pin.io.source import sha256_of_file
from vdsm_pin.robots.cell import read_cell
from vdsm_pin.robots.judgement import RobotVerification, verify_robot
from vdsm_pin.verification.records import Verdict

URDF = """<robot name="all">
  <link name="foot"><collision><geometry><box size="0.4 0.3 0.1"/></geometry>
    </collision></link>
  <link name="mast"><collision><origin xyz="0 0 0.3" rpy="0.1 0.2 0.3"/>
    <geometry><cylinder radius="0.05" length="0.3"/></geometry></collision>
    <collision><origin xyz="0 0.2 0.3"/><geometry><sphere radius="0.04"/></geometry>
    </collision></link>
  <link name="boom"><collision><origin xyz="0.4 0 0" rpy="0 1.5 0.2"/>
    <geometry><capsule radius="0.04" length="0.5"/></geometry></collision></link>
  <link name="tool"><collision><origin xyz="0.1 0 0" rpy="0.3 0 0.1"/>
    <geometry><mesh filename="tool.stl" scale="0.02 0.01 0.01"/></geometry>
    </collision></link>
  <link name="finger"><collision><origin xyz="0.1 0 0"/>
    <geometry><mesh filename="finger.obj" scale="0.01 0.01 -0.01"/></geometry>
    </collision></link>
  <joint name="turn" type="continuous"><parent link="foot"/><child link="mast"/>
    <origin xyz="0 0 0.1"/><axis xyz="0 0 2"/></joint>
  <joint name="lift" type="prismatic"><parent link="mast"/><child link="boom"/>
    <origin xyz="0.2 0 0.5" rpy="0.1 0.2 0.3"/><axis xyz="0 0.1 1"/>
    <limit lower="-0.1" upper="0.4" effort="1" velocity="0.5"/></joint>
  <joint name="bend" type="revolute"><parent link="boom"/><child link="tool"/>
    <origin xyz="0.8 0 0"/><axis xyz="0 1 0.2"/>
    <limit lower="-2" upper="2" effort="1" velocity="1"/></joint>
  <joint name="follow" type="revolute"><parent link="tool"/><child link="finger"/>
    <origin xyz="0.3 0 0"/><axis xyz="1 1 0"/>
    <mimic joint="bend" multiplier="-0.5" offset="0.1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/></joint>
</robot>
"""
SRDF = """<robot name="all"><virtual_joint name="roll" type="{base}"
    parent_frame="world" child_link="foot"/>
  <group name="arm"><chain base_link="foot" tip_link="tool"/></group>
  <disable_collisions link1="mast" link2="boom" reason="near"/>
  <disable_collisions link1="tool" link2="finger" reason="near"/>
  <disable_collisions link1="boom" link2="tool" reason="near"/>
  <disable_collisions link1="foot" link2="mast" reason="near"/></robot>
"""
VIRTUAL = """<robot name="random"><virtual_joint name="roll" type="{base}"
    parent_frame="world" child_link="l0"/></robot>
"""
CELL: dict[str, Any] = {
    "vdsm_problem": 1,
    "length_unit": "mm",
    "robot": {"urdf": "all.urdf", "srdf": "all.srdf"},
    "base": {"position": [10, 20, 30], "rpy_deg": [0, 0, 20]},
    "required_clearance": 5,
    "required_self_clearance": 1,
    "obstacles": [
        {"name": "ball", "shape": "sphere", "center": [900, 1500, 900], "radius": 90},
        {
            "name": "floor",
            "shape": "half_space",
            "point": [0, 0, -600],
            "normal": [0, 0.1, 1],
        },
        {
            "name": "notch",
            "shape": "prism",
            "axis": "z",
            "from": 1500,
            "to": 1700,
            "polygon": [[0, 0], [300, 0], [300, 300], [100, 100], [0, 300]],
        },
    ],
}
ERRING = 5e-6
"""How much more the verifier counts of errors than the checker; [m]."""

SINGLE = "turn", "lift", "bend"
BASES = {
    "fixed": (),
    "planar": ("roll/x", "roll/y", "roll/theta"),
    "floating": ("roll/x", "roll/y", "roll/z", "roll/yaw", "roll/pitch", "roll/roll"),
}


class Made:
    """A robot's files in a folder, and a certificate of a motion."""

    def __init__(self, folder: Path, base: str = "fixed", smooth: int = 0) -> None:
        self.folder, self.cell, self.erring = folder, copy.deepcopy(CELL), ERRING
        self.most = ROUNDED
        names = (*BASES[base], *SINGLE)
        rng = np.random.default_rng(len(names) + smooth)
        q = np.cumsum(rng.uniform(-0.03, 0.05, (3, len(names))), axis=0)
        parts, heads = [q], [f"{n}_{unit(n)}" for n in names]
        if smooth:
            heads.append("time_s")
            parts.append(np.arange(3.0)[:, None])
        for kind, per in (("velocity", "s"), ("acceleration", "s2"))[:smooth]:
            heads += [f"{n}_{kind}_{unit(n)}_{per}" for n in names]
            parts.append(rng.uniform(-0.1, 0.1, q.shape))
        self.rows = [heads, *np.hstack(parts).tolist()]
        self.texts = {"all.urdf": URDF, "all.srdf": SRDF.format(base=base)}
        for mesh in ("tool.stl", "finger.obj"):
            write_cube(folder / mesh, 5.0)
        self.write()

    def write(self) -> None:
        for name, text in self.texts.items():
            (self.folder / name).write_text(text)
        (self.folder / "c.yaml").write_text(json.dumps(self.cell))
        lines = [",".join(map(str, row)) for row in self.rows]
        (self.folder / "t.csv").write_text("\n".join(lines) + "\n")

    @property
    def files(self) -> tuple[Path, Path]:
        return self.folder / "c.yaml", self.folder / "t.csv"

    def hashes(self) -> Hashes:
        source = read_cell(self.files[0]).source
        assert source is not None
        return Hashes(source.sha256, sha256_of_file(self.files[1]))

    def verified(self) -> RobotVerification:
        self.write()
        cell = read_cell(self.files[0])
        return verify_robot(cell, read_rows(self.files[1], cell.robot))

    def is_certified(self) -> bool:
        return self.verified().verdict is Verdict.CERTIFIED

    def certified(self) -> list[Any]:
        """The lines of the certificate, which is accepted."""
        found = self.verified()
        wrong = [row for row in found.checks if row.verdict is not Verdict.CERTIFIED]
        assert not wrong, wrong
        proof = self.folder / "good"
        write_certificate(proof, found, self.hashes())
        most = self.erring if self.cell.get("errors") else self.most
        accepted_closely(proof, *self.files, most=most)
        return certificate_lines(proof)[:-1]

    def check(self, lines: list[Any], fits: bool = True) -> Outcome:
        """Of other lines beside the files as they are; hashes fit unless told."""
        self.write()
        hashes = self.hashes() if fits else None
        return check_sealed(lines, self.folder, self.files, hashes)


def unit(joint: str) -> str:
    return "m" if joint == "lift" or joint[-2:] in ("/x", "/y", "/z") else "rad"


def text(old: str, new: str, file: str = "all.urdf") -> Callable[[Made], None]:
    def change(made: Made) -> None:
        assert old in made.texts[file]
        made.texts[file] = made.texts[file].replace(old, new)

    return change


def cell(**more: Any) -> Callable[[Made], None]:
    return lambda made: made.cell.update(more)
