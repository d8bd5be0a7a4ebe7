"""The report page of a robot: what its scripts read is what was judged."""

import base64
import json
import re
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from vdsm_pin.cli import app
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.robots.files import RobotFiles
from vdsm_pin.robots.hulls import hull_triangles
from vdsm_pin.robots.urdf import read_robot

URDF = """<robot name="r&amp;b"><link name="foot"><collision>
<geometry><cylinder radius="0.1" length="0.2"/></geometry></collision></link>
<link name="&lt;arm&gt;"><collision><origin xyz="0.3 0 0"/>
<geometry><box size="0.6 0.05 0.05"/></geometry></collision><collision>
<origin xyz="0.6 0 0"/><geometry><sphere radius="0.06"/></geometry></collision></link>
<link name="tool"><collision><origin xyz="0 0 -0.1"/>
<geometry><sphere radius="0.04"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="foot"/><child link="&lt;arm&gt;"/>
<origin xyz="0 0 0.3"/><axis xyz="0 0.6 0.8"/>
<limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
<joint name="lift" type="prismatic"><parent link="&lt;arm&gt;"/><child link="tool"/>
<origin xyz="0.6 0 0"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>"""
PROBLEM = """vdsm_problem: 1
length_unit: m
robot: {urdf: r.urdf}
base: {position: [1, 2, 3]}
required_clearance: 0.01
obstacles:
  - {name: post, shape: sphere, center: CENTRE, radius: 0.1}
"""


def unpacked(text: str, kind: str = "<f4") -> FloatArray:
    return np.frombuffer(base64.b64decode(text), kind)


def judged(
    tmp_path: Path, status: int, more: str = "", centre: str = "[1.32, 2.4, 3.0]"
) -> Path:
    """The folder of results of a problem to which more is added."""
    (tmp_path / "r.urdf").write_text(URDF)
    (tmp_path / "p.yaml").write_text(PROBLEM.replace("CENTRE", centre) + more)
    (tmp_path / "t.csv").write_text("turn_rad,lift_m\n-0.5,0\n1.5,0.1\n2,0\n")
    asked = ["verify", str(tmp_path / "p.yaml"), "--trajectory"]
    asked += [str(tmp_path / "t.csv"), "--out", str(tmp_path / "out")]
    ended = CliRunner().invoke(app, asked, obj="vdsm verify")
    assert ended.exit_code == status, ended.output
    return tmp_path / "out"


@pytest.fixture
def out(tmp_path: Path) -> Path:
    return judged(tmp_path, 1)


def page_data(page: str) -> dict[str, Any]:
    found = re.search(r'<script type="application/json" id="data">(.*?)</script>', page)
    assert found is not None
    return dict(json.loads(found[1]))


def test_the_page_moves_the_links_as_the_tree_does(out: Path) -> None:
    """Corners drawn at every moment told are corners of the link where it stands."""
    page = (out / "report.html").read_text()
    data = page_data(page)
    robot = read_robot(RobotFiles(out.parent / "r.urdf"))
    motion, links = data["motion"], data["scene"]["links"]
    assert [link["name"] for link in links] == ["foot", "<arm>", "tool"]
    assert "<arm>" not in page.split('id="data"')[0]
    moments = unpacked(motion["moments"], "<f8")
    assert moments[[0, -1]].tolist() == [0.0, 2.0]
    rows = np.array([[-0.5, 0.0], [1.5, 0.1], [2.0, 0.0]])
    q = np.column_stack([np.interp(moments, [0, 1, 2], rows[:, k]) for k in (0, 1)])
    assert np.abs(np.diff(q, axis=0)).max() < np.radians(4.1)
    poses = robot.poses(q)
    frames = {body.name: poses[:, body.frame] for body in robot.bodies}
    places = unpacked(motion["places"]).reshape(3, len(moments), 3)
    turns = unpacked(motion["turns"]).reshape(3, len(moments), 4)
    for k, (body, link) in enumerate(zip(robot.bodies, links, strict=True)):
        x, y, z, w = turns[k].astype(float).T
        quarter = [1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)]
        ahead = np.stack(quarter, axis=1)
        np.testing.assert_allclose(ahead, frames[body.name][:, :3, 0], atol=1e-5)
        first = frames[body.name][0]
        corners = unpacked(link["vertices"]).reshape(-1, 3).astype(float)
        placed = corners @ first[:3, :3].T + places[k, 0]
        inner = (placed - first[:3, 3]) @ first[:3, :3]
        low, high = {
            "foot": ([-0.1, -0.1, -0.1], [0.1, 0.1, 0.1]),
            "<arm>": ([0, -0.06, -0.06], [0.66, 0.06, 0.06]),
            "tool": ([-0.04, -0.04, -0.14], [0.04, 0.04, -0.06]),
        }[body.name]
        np.testing.assert_allclose(inner.min(axis=0), low, atol=2e-3)
        np.testing.assert_allclose(inner.max(axis=0), high, atol=2e-3)


def test_the_page_names_what_the_file_finds(out: Path) -> None:
    """Closest pairs, plots and marks by the names of the URDF."""
    data = page_data((out / "report.html").read_text())
    file = json.loads((out / "verification.json").read_text())
    assert [chart["id"] for chart in data["charts"]] == [
        "clearance-link",
        "clearance-obstacle",
        "turning",
        "sliding",
    ]
    series = [one["name"] for one in data["charts"][0]["series"]]
    assert series == ["foot", "<arm>", "tool"]
    lower = [unpacked(one["values"]) for one in data["charts"][0]["series"]]
    first, near = data["closest"][0], file["closest"][0]
    assert (near["body"], near["obstacle"], near["deeper"]) == ("<arm>", "post", True)
    link = series.index("<arm>")
    assert (first["link"], first["moment"]) == (link + 1, near["moment"])
    assert lower[link].min() <= 1e3 * near["upper_m"] < -10.0
    # The frame of the file is not the base frame.
    shift = np.array(near["other_point_m"]) - np.array(first["otherPoint"])
    np.testing.assert_allclose(shift, [1, 2, 3], atol=1e-12)


def test_hull_triangles_are_closed_and_face_outwards() -> None:
    """Each edge once in either direction; the volume of a box in closed form."""
    rng = np.random.default_rng(3)
    for points, volume in (
        (np.array([[x, y, z] for x in (0, 1) for y in (0, 2) for z in (0, 3)]), 6.0),
        (rng.normal(size=(60, 3)), None),
    ):
        found = hull_triangles(points.astype(float))
        assert found is not None
        corners, triangles = found
        edges = Counter(
            (int(t[i]), int(t[(i + 1) % 3])) for t in triangles for i in range(3)
        )
        assert set(edges.values()) == {1}
        assert all(edge[::-1] in edges for edge in edges)
        a, b, c = (corners[triangles[:, i]] for i in range(3))
        size = float(np.einsum("ij,ij->", a, np.cross(b, c))) / 6.0
        assert size > 0.0
        assert volume is None or size == pytest.approx(volume, rel=1e-9)
    assert hull_triangles(np.zeros((4, 3))) is None


def test_a_counterexample_is_told_by_joint_and_drawn_as_a_ghost(
    tmp_path: Path,
) -> None:
    """The arm ends 162 mm before the post, and 20 degrees more lead into it."""
    out = judged(tmp_path, 1, "errors: {joint_deg: 20}\n", "[0.49, 2.25, 3.11]")
    told = json.loads((out / "verification.json").read_text())
    (lost,) = told["counterexamples"]
    assert (lost["body"], lost["obstacle"], lost["moment"]) == ("tool", "post", 2.0)
    assert lost["clearance_m"] < 0.01
    turn, lift = lost["joints"]
    assert (turn["name"], turn["error_m"], lift["name"]) == ("turn", None, "lift")
    assert turn["error_rad"] == pytest.approx(np.radians(20.0))
    assert (lift["error_rad"], lift["error_m"], lost["x0_m"]) == (None, 0.0, None)
    assert told["nominal_clear"]
    data = page_data((out / "report.html").read_text())
    (ghost,) = data["scene"]["ghosts"]
    assert ghost["moment"] == lost["moment"]
    assert ghost["words"][0].endswith("tool comes too near post")
    robot = read_robot(RobotFiles(tmp_path / "r.urdf"))
    q = np.array([[turn["value_rad"], lift["value_m"]]])
    tool = robot.poses(q)[0, robot.frames["tool"]] @ [0.0, 0.0, -0.1, 1.0]
    np.testing.assert_allclose(ghost["centres"][2], tool[:3], atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(ghost["turns"], axis=1), 1.0)
