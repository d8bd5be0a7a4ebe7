"""How links look: drawn where it can be read, of no weight in a verdict."""

import json
from pathlib import Path

import numpy as np
import pytest
import trimesh
from typer.testing import CliRunner

from tests.robots.test_robot_page import PROBLEM, URDF, unpacked
from vdsm_pin.cli import app
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.report.gltf import glb
from vdsm_pin.report.robot_drawing import LOOK_TRIANGLES, RobotDrawing
from vdsm_pin.robots.cell import Cell, read_cell
from vdsm_pin.robots.files import RobotFiles
from vdsm_pin.robots.urdf import read_robot
from vdsm_pin.robots.visuals import PLAIN, Visuals, visuals_of

BALL = trimesh.creation.icosphere(subdivisions=3, radius=0.05)
MESH = '<mesh filename="ball.stl" scale="1 1 2"/>'
OWN = '<material name="own"><color rgba="1 0.5 0 1"/></material>'


def look(shape: str, more: str = "", origin: str = "0 0 0") -> str:
    return (
        f'<visual><origin xyz="{origin}" rpy="0 0 1.5707963267948966"/>'
        f"<geometry>{shape}</geometry>{more}</visual>"
    )


def looking(tmp_path: Path, *visuals: str, more: str = "") -> Path:
    """The file of a robot whose tool looks like that."""
    text = URDF.replace('<link name="tool">', f'<link name="tool">{"".join(visuals)}')
    (tmp_path / "r.urdf").write_text(text.replace("</robot>", f"{more}</robot>"))
    BALL.export(tmp_path / "ball.stl")
    return tmp_path / "r.urdf"


def seen(file: Path) -> Visuals:
    return visuals_of(read_robot(RobotFiles(file)))


def test_shapes_stand_where_the_urdf_says_in_its_colours(tmp_path: Path) -> None:
    colour = '<material name="blue"><color rgba="0 0 1 1"/></material>'
    file = looking(
        tmp_path,
        look(MESH, OWN, "1 0 0"),
        look('<box size="2 1 1"/>', '<material name="blue"/>'),
        look('<sphere radius="0.3"/>', '<material name="unknown"/>'),
        more=colour,
    )
    links, notes = seen(file)
    assert not notes and not links[0] and not links[1]
    mesh, box, ball = links[2]
    assert [one.colour for one in links[2]] == ["#ff8000", "#0000ff", PLAIN]
    assert isinstance(mesh.shape, np.ndarray) and mesh.shape.shape == (1280, 3, 3)
    low, high = (one(mesh.shape.reshape(-1, 3), axis=0) for one in (np.min, np.max))
    np.testing.assert_allclose(low, [0.95, -0.05, -0.1], atol=1e-3)
    np.testing.assert_allclose(high, [1.05, 0.05, 0.1], atol=1e-3)
    assert isinstance(box.shape, Hull)
    np.testing.assert_allclose(box.shape.points.max(axis=0), [0.5, 1.0, 0.5])
    assert isinstance(ball.shape, Hull) and ball.shape.radius == 0.3


@pytest.mark.parametrize(
    ("shape", "told"),
    [
        ('<mesh filename="none.stl"/>', "'none.stl' is not found"),
        ('<mesh filename="ball.stl" scale="900 900 900"/>', "large"),
        ('<mesh filename="r.urdf"/>', ""),
        ('<box size="1 two 3"/>', ""),
        ('<box size="1 2"/>', ""),
        ('<sphere radius="nan"/>', None),
        ("", None),
    ],
)
def test_what_cannot_be_read_is_told_and_changes_no_verdict(
    shape: str, told: str | None, tmp_path: Path
) -> None:
    file = looking(tmp_path, look(shape), look('<sphere radius="0.02"/>'))
    links, notes = seen(file)
    assert len(links[2]) == 1
    assert len(notes) == (told is not None)
    for note in notes:
        assert note.startswith("'tool' is not drawn whole: ") and (told or "") in note
    (tmp_path / "p.yaml").write_text(PROBLEM.replace("CENTRE", "[1.32, 2.9, 3.0]"))
    (tmp_path / "t.csv").write_text("turn_rad,lift_m\n-0.5,0\n0.2,0.1\n")
    files = "--trajectory", str(tmp_path / "t.csv"), "--out", str(tmp_path / "out")
    asked = ["verify", str(tmp_path / "p.yaml"), *files]
    ended = CliRunner().invoke(app, asked, obj="vdsm verify")
    assert ended.exit_code == 0, ended.output
    page = (tmp_path / "out" / "report.html").read_text()
    assert ("is not drawn whole" in page) == (told is not None)


def drawing(tmp_path: Path, *visuals: str) -> RobotDrawing:
    looking(tmp_path, *visuals)
    (tmp_path / "p.yaml").write_text(PROBLEM.replace("CENTRE", "[1.32, 2.9, 3.0]"))
    cell = read_cell(tmp_path / "p.yaml")
    assert isinstance(cell, Cell)
    rows = np.array([[-0.5, 0.0], [0.2, 0.1]])
    return RobotDrawing(cell, JointTrajectory(("turn", "lift"), rows))


def test_a_page_has_both_and_few_triangles(tmp_path: Path) -> None:
    fine = trimesh.creation.icosphere(subdivisions=6, radius=0.05)
    file = tmp_path / "fine.stl"
    fine.export(file)
    assert len(fine.faces) > LOOK_TRIANGLES
    shown = drawing(tmp_path, look('<mesh filename="fine.stl"/>', OWN), look(MESH))
    tool = shown.scene([])["links"][2]
    assert [one["colour"] for one in tool["looks"]] == ["#ff8000", PLAIN]
    counts = [len(unpacked(one["triangles"], "<u4")) // 3 for one in tool["looks"]]
    assert 100 < sum(counts) <= LOOK_TRIANGLES
    corners = unpacked(tool["looks"][0]["vertices"]).reshape(-1, 3)
    middle = np.array([0.0, 0.0, -0.1])  # of its ball that is judged
    away = np.linalg.norm(corners + middle, axis=1)
    np.testing.assert_allclose(away, 0.05, atol=1e-3)
    solid: FloatArray = unpacked(tool["vertices"]).reshape(-1, 3)
    np.testing.assert_allclose(np.linalg.norm(solid, axis=1), 0.04, atol=1e-6)


def test_exports_show_how_links_look_and_pictures_what_is_judged(
    tmp_path: Path,
) -> None:
    shown = drawing(tmp_path, look(MESH, OWN))
    parts = shown.parts(np.array([0.0]))
    assert [part.name for part in parts] == ["foot", "<arm>", "tool"]
    assert parts[2].colour == "#ff8000" and len(parts[2].skin.triangles) == 1280
    content = glb(shown)
    size = int.from_bytes(content[12:16], "little")
    nodes = json.loads(content[20 : 20 + size])["nodes"]
    assert [node["name"] for node in nodes[:3]] == ["foot", "<arm>", "tool"]
    judged = shown.silhouette(0.0).links[2]
    assert np.ptp(judged, axis=0) == pytest.approx(0.08, abs=1e-3)


def test_a_page_without_looks_says_nothing_of_them(tmp_path: Path) -> None:
    shown = drawing(tmp_path)
    assert not shown.not_drawn
    assert not any(link["looks"] for link in shown.scene([])["links"])
