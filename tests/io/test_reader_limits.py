"""Every limit of the readers: as much as it says is read, one more is refused."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
import trimesh
import yaml
from problem_texts import EVERYTHING, write_everything
from test_mesh_formats import HERE, dae

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.errors import InvalidFile
from vdsm_pin.io import (
    clouds,
    mesh_file,
    path_builder,
    pcd,
    problem_file,
    tables,
    yaml_reader,
)
from vdsm_pin.io.clouds import read_cloud
from vdsm_pin.io.mesh_file import read_mesh
from vdsm_pin.io.meshes import dae as dae_format
from vdsm_pin.io.meshes import glb, obj, ply, raw
from vdsm_pin.io.path_builder import read_points
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.io.waypoint_tables import read_centres
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.tables import write_centres

Reader = Callable[[Path], object]
Made = Callable[[Path], Path]


def made(folder: Path, name: str, content: bytes | str) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def motion(n: int) -> Trajectory:
    still = np.zeros((n, 8))
    return Trajectory(np.zeros(n, bool), np.arange(n) / n, np.zeros(n), still, still)


def cloud(path: Path) -> object:
    return read_cloud(path, hashlib.sha256())


def points(path: Path) -> object:
    return read_points(path, hashlib.sha256())


def meshes(name: str, content: bytes | str) -> tuple[Reader, Made]:
    return read_mesh, lambda folder: made(folder, name, content)


def table(write: Callable[[Path], None]) -> Made:
    def make(folder: Path) -> Path:
        write(folder / "t.csv")
        return folder / "t.csv"

    return make


FREE = read_problem("paper/free")
BOX = trimesh.creation.box()
PLY = BOX.export(file_type="ply")
GLB = BOX.export(file_type="glb")
XYZ = "".join(f"{i},0,0\n" for i in range(7))
PCD = "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nPOINTS 1\nDATA ascii\n1 2 3\n"
CONTINUED = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 \\\n2 \\\n3\n"  # a line of 5 + 3 + 1
LIMITS: dict[str, tuple[ModuleType, str, int, Reader, Made]] = {
    "ply": (raw, "MAX_TRIANGLES", 12, *meshes("a.ply", PLY)),
    "glb": (raw, "MAX_TRIANGLES", 12, *meshes("a.glb", GLB)),
    "dae": (raw, "MAX_TRIANGLES", 8, *meshes("a.dae", dae(HERE + HERE))),
    "obj": (raw, "MAX_TRIANGLES", 12, *meshes("a.obj", BOX.export(file_type="obj"))),
    "stl": (raw, "MAX_TRIANGLES", 12, *meshes("a.stl", BOX.export(file_type="stl"))),
    "stl text": (
        raw,
        "MAX_TRIANGLES",
        12,
        *meshes("a.stl", BOX.export(file_type="stl_ascii").encode()),
    ),
    "text": (
        raw, "MAX_CORNERS", 36, *meshes("a.stl", BOX.export(file_type="stl_ascii"))
    ),
    "corners": (
        raw, "MAX_CORNERS", 36, *meshes("a.obj", BOX.export(file_type="obj"))
    ),
    "bytes": (
        mesh_file, "MAX_MESH_BYTES", len(CONTINUED), *meshes("a.obj", CONTINUED)
    ),
    "line": (obj, "MAX_MESH_LINE", 9, *meshes("a.obj", CONTINUED)),
    "header": (
        ply, "_MOST_LINES", PLY[: PLY.index(b"end_header")].count(b"\n") + 1,
        *meshes("a.ply", PLY),
    ),
    "json": (
        glb, "_MOST_JSON", int.from_bytes(GLB[12:16], "little"), *meshes("a.glb", GLB)
    ),
    "nodes": (dae_format, "MAX_NODES", 5, *meshes("a.dae", dae(HERE * 5))),
    "points": (clouds, "MAX_POINTS", 7, cloud, lambda f: made(f, "a.xyz", XYZ)),
    "cloud": (clouds, "MAX_BYTES", len(XYZ), cloud, lambda f: made(f, "a.xyz", XYZ)),
    "pcd": (pcd, "_MOST_LINES", 6, cloud, lambda f: made(f, "a.pcd", PCD)),
    "path": (
        tables, "MAX_ROWS", 7, points, lambda f: made(f, "a.csv", "x,y,z\n" + XYZ)
    ),
    "path bytes": (
        path_builder, "MAX_POINT_BYTES", 6 + len(XYZ), points,
        lambda f: made(f, "a.csv", "x,y,z\n" + XYZ),
    ),
    "rows": (
        tables, "MAX_ROWS", 7,
        lambda path: read_trajectory(path, built_in("hrm8")),
        table(lambda path: write_trajectory(motion(7), path)),
    ),
    "centres": (
        tables, "MAX_ROWS", 7, lambda path: read_centres(path, FREE),
        table(lambda path: write_centres(path, FREE, motion(7))),
    ),
    "problem": (
        problem_file, "MAX_PROBLEM_BYTES", len(EVERYTHING), read_problem,
        write_everything,
    ),
    "values": (
        yaml_reader, "MAX_VALUES", len(list(yaml.parse(EVERYTHING))) - 1, read_problem,
        write_everything,
    ),
    "levels": (yaml_reader, "MAX_DEPTH", 5, read_problem, write_everything),
}  # fmt: skip


def read_with(
    module: ModuleType, name: str, limit: int, read: Reader, path: Path
) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, name, limit)
        read(path)


@pytest.mark.parametrize("which", LIMITS)
def test_as_much_as_a_limit_says_is_read_and_no_more(
    which: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module, name, most, read, make = LIMITS[which]
    path = make(tmp_path)
    monkeypatch.setattr(module, name, most)
    read(path)
    monkeypatch.setattr(module, name, most - 1)
    with pytest.raises(InvalidFile):
        read(path)


@pytest.mark.parametrize(("depth", "good"), [(100, True), (101, False)])
@pytest.mark.parametrize("last", ["node", "instance_node"])
def test_nodes_of_dae_stand_a_hundred_deep(
    depth: int, good: bool, last: str, tmp_path: Path
) -> None:
    here = '<instance_geometry url="#g"/>'
    inner = f"<node>{here}</node>" if last == "node" else '<instance_node url="#lib"/>'
    text = dae("<node>" * depth + inner + "</node>" * depth)
    path = made(tmp_path, "a.dae", text)
    if good:
        assert len(read_mesh(path).triangles) == 4
        return
    with pytest.raises(InvalidFile, match="has nodes 100 deep"):
        read_mesh(path)


def test_a_path_is_cut_into_as_many_rows_as_there_may_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = read_problem(write_everything(tmp_path)).path
    approach = float(np.linalg.norm(path.points[0] - path.start))
    rows = (path.length + approach) / path.spacing
    monkeypatch.setattr(path_builder, "MAX_ROWS", rows)
    read_problem(tmp_path / "everything.yaml")
    monkeypatch.setattr(path_builder, "MAX_ROWS", rows * (1.0 - 1e-12))
    with pytest.raises(InvalidFile, match="into more than"):
        read_problem(tmp_path / "everything.yaml")
