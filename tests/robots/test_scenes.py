"""Scenes of other programs: MoveIt's text, MuJoCo's worlds."""

import copy
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from oracles.shortcuts import read_scene

from tests.robots.test_robots import CELL, URDF, mutated, write
from vdsm_pin.errors import InvalidFile, VdsmError
from vdsm_pin.geometry.solids import Box, Capsule, Cylinder, HalfSpace, Mesh, Sphere
from vdsm_pin.robots import mjcf
from vdsm_pin.robots.cell import cell_of, read_cell
from vdsm_pin.robots.files import RobotFiles

OLD = """(noname)+
* big box
1
box
0.1 0.2 0.4
1 2 3
0 0 0.70710678 0.70710678
0 0 0 0
* can
2
cylinder
0.05 0.3
0 0 1
0 0 0 1
0 0 0 0
sphere
0.1
0 0 2
0 0 0 1
0 0 0 0
.
"""
NEW = """(noname)+
* big box
1 2 3
0 0 0.70710678 0.70710678
1
box
0.1 0.2 0.4
0 0 0
0 0 0 1
0 0 0 0
1
handle
0 0 0.1
0 0 0 1
* floor
0 0 0
0 0 0 1
1
plane
0 0 1 0.5
0 0 0
0 0 0 1
0 0 0 0
0
.
"""
WORLD = """<mujoco>
  <worldbody>
    <geom name="floor" type="plane" size="0 0 1" pos="0 0 -1"/>
    <geom name="picture" type="ellipsoid" size="1 1 1" contype="0" conaffinity="0"/>
    <body pos="1 0 0" euler="0 0 90">
      <geom name="crate" type="box" size="0.1 0.2 0.3"/>
      <geom name="rod" type="capsule" fromto="0 0 0 0 0 1" size="0.05"/>
      <body pos="0 1 0"><geom name="can" type="cylinder" size="0.05 0.2"/></body>
      <geom type="sphere" size="0.1" pos="0 0 3"/>
    </body>
  </worldbody>
</mujoco>
"""


def test_scene_text_is_read_in_both_forms(tmp_path: Path) -> None:
    box, can, ball = read_scene(write(tmp_path, "old.scene", OLD), 1.0).obstacles
    other, floor = read_scene(write(tmp_path, "new.scene", NEW), 1.0).obstacles
    assert isinstance(box, Box)
    assert isinstance(other, Box)
    for one in (box, other):
        assert one.name == "big box"
        np.testing.assert_array_equal(one.centre, [1, 2, 3])
        np.testing.assert_array_equal(one.half_size, [0.05, 0.1, 0.2])
        np.testing.assert_allclose(one.rotation[:, 0], [0, 1, 0], atol=1e-8)
    assert isinstance(can, Cylinder)
    assert (can.radius, can.half_length) == (0.05, 0.15)
    assert isinstance(ball, Sphere)
    assert isinstance(floor, HalfSpace)
    assert floor.normal @ floor.point == pytest.approx(-0.5)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        (
            "box\n0.1",
            "cone\n0.1",
            "line 4: is the shape 'cone', expected one of sphere",
        ),
        ("0.2 0.4", "0.2 x", "line 5: is 'x', expected a number"),
        ("0.2 0.4", "0.2 1_0", "line 5: is '1_0', expected a number"),
        ("\n1\nbox", f"\n{'1' * 5000}\nbox", "expected a number of shapes"),
        ("\n.\n", "\n", "the file ends"),
        ("\n.\n", "\n.\n* can\n", "is '*', expected nothing behind '.'"),
        ("* can", "can", "is 'can', expected"),
        ("0.1 0.2 0.4", "0.1 -0.2 0.4", "half_size is"),
        ("0 0 0.70710678 0.70710678", "0 0 1 1", "orientation of length 1.41"),
    ],
)
def test_odd_scene_text_is_refused(
    tmp_path: Path, old: str, new: str, expected: str
) -> None:
    with pytest.raises(InvalidFile) as caught:
        read_scene(write(tmp_path, "s.scene", OLD.replace(old, new, 1)), 1.0)
    assert expected in str(caught.value)


def test_worlds_stand_where_mujoco_has_them(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    pytest.importorskip("mujoco")
    monkeypatch.chdir(tmp_path)
    floor, crate, rod, ball, can = read_scene(
        write(tmp_path, "world.xml", WORLD), 1.0
    ).obstacles
    assert isinstance(floor, HalfSpace)
    assert floor.normal @ floor.point == pytest.approx(-1.0)
    assert isinstance(crate, Box)
    np.testing.assert_allclose(crate.rotation[:, 0], [0, 1, 0], atol=1e-12)
    np.testing.assert_array_equal(crate.half_size, [0.1, 0.2, 0.3])
    assert isinstance(rod, Capsule)
    np.testing.assert_allclose(rod.centre, [1, 0, 0.5], atol=1e-12)
    assert (rod.radius, rod.half_length) == (0.05, 0.5)
    assert isinstance(can, Cylinder)
    np.testing.assert_allclose(can.centre, [0, 0, 0], atol=1e-12)
    assert isinstance(ball, Sphere)
    joint = WORLD.replace(
        "<body pos=", "<body><freejoint/><geom size='1'/></body>\n<body pos=", 1
    )
    flex = '<flexcomp name="f" type="grid" count="3 3 1" dim="2" rigid="true"/>'
    bent = WORLD.replace("</worldbody>", f"{flex}</worldbody>")
    for text, expected in (
        (joint, "rides on a joint"),
        (bent, "world.xml: has a flex, which bends"),
        (
            WORLD.replace('"sphere" size="0.1"', '"ellipsoid" size="1 1 1"'),
            "is a ellipsoid, expected plane",
        ),
        (WORLD[:200], "is not XML"),
        (WORLD.replace("box", "bax"), "is refused by mujoco"),
        (WORLD.replace('pos="1 0', 'pos="nan 0'), "centre is .nan  0"),
    ):
        with pytest.raises(InvalidFile, match=expected):
            read_scene(write(tmp_path, "world.xml", text), 1.0)
    assert (
        "NaN" in caplog.text
    )  # mujoco's own words; nothing is written beside the file
    assert [file.name for file in tmp_path.iterdir()] == ["world.xml"]


def test_a_geom_that_collides_by_a_pair_is_there(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    pair = '<contact><pair geom1="crate" geom2="picture"/></contact>'
    text = WORLD.replace("</mujoco>", f"{pair}</mujoco>").replace("ellipsoid", "sphere")
    names = read_scene(write(tmp_path, "world.xml", text), 1.0).names
    assert "picture" in names


BALL_OFTEN = '<geom type="sphere" size="0.1"/>'


def replicated(content: str, *counts: object) -> str:
    for count in counts:
        content = f'<replicate count="{count}" offset="0.001 0 0">{content}</replicate>'
    return content


@pytest.mark.parametrize(
    ("content", "elements"),
    [
        (replicated(BALL_OFTEN, 49), 100),
        (replicated(BALL_OFTEN, 7, 5), 77),
        (replicated('<body><include file="part.xml"/></body>', 7), 58),
        ('<composite type="cable" count="4 4 3"/>', 50),
        (replicated('<attach model="part"/>', 10), 74),
    ],
)
def test_what_a_world_repeats_is_counted_before_it_is_made(
    content: str, elements: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Counted by hand: an element as often as it and what it stands in stand there."""
    part = f"<mujocoinclude>{replicated(BALL_OFTEN, 2)}</mujocoinclude>"
    write(tmp_path, "part.xml", part)
    asset = '<asset><model name="part" file="part.xml"/></asset>'
    head = asset if "attach" in content else ""
    text = f"<mujoco>{head}<worldbody>{content}</worldbody></mujoco>"
    file = write(tmp_path, "world.xml", text)
    monkeypatch.setattr(mjcf, "MOST", elements)
    mjcf.check_size(file)
    monkeypatch.setattr(mjcf, "MOST", elements - 1)
    with pytest.raises(InvalidFile, match=f"has {elements} elements"):
        mjcf.check_size(file)


def test_what_a_world_includes_is_in_the_hash(tmp_path: Path) -> None:
    """A batch that goes on, and reports, would take another scene for the same."""
    pytest.importorskip("mujoco")
    content = '<include file="part.xml"/>'
    world = write(
        tmp_path, "w.xml", f"<mujoco><worldbody>{content}</worldbody></mujoco>"
    )
    write(tmp_path, "two.urdf", URDF)
    problem = write(tmp_path, "cell.yaml", CELL + "length_unit: mm\nscene: w.xml\n")
    found = []
    for size in ("0.1", "0.2"):
        ball = f'<geom type="sphere" size="{size}" pos="0 0 9"/>'
        part = write(tmp_path, "part.xml", f"<mujocoinclude>{ball}</mujocoinclude>")
        cells = read_cell(problem), cell_of(RobotFiles(tmp_path / "two.urdf"), world)
        for cell in cells:
            assert cell.source is not None
            assert part in cell.source.files
        found.append([cell.source.sha256 for cell in cells if cell.source])
    assert not set(found[0]) & set(found[1])


def test_a_world_that_includes_too_deep_is_refused(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    for k in range(1200):
        write(tmp_path, f"w{k}.xml", f"<mujoco><include file='w{k + 1}.xml'/></mujoco>")
    with pytest.raises(InvalidFile, match=r"w101\.xml: is included by 101 files"):
        read_scene(tmp_path / "w0.xml", 1.0)


def test_a_world_of_hundreds_of_millions_is_refused_at_once(tmp_path: Path) -> None:
    pytest.importorskip("mujoco")
    for count in ("1e8", "100000000", "1e999"):
        text = replicated(BALL_OFTEN, count)
        world = f"<mujoco><worldbody>{text}</worldbody></mujoco>"
        with pytest.raises(InvalidFile, match="expected at most 50000"):
            read_scene(write(tmp_path, "world.xml", world), 1.0)


@pytest.mark.parametrize(
    ("name", "content", "expected"),
    [
        (b"w\xff.xml", WORLD.encode(), "has a name that is not UTF-8 text"),
        (b"w.xml", WORLD.encode().replace(b"crate", b"\xff"), "is not XML"),
        (b"w.xml", b'<?xml version="1.0" encoding="foo"?>' + WORLD.encode(), "foo"),
        (b"w.xml", b'<?xml version="1.0" encoding="utf-7"?>' + WORLD.encode(), "multi"),
    ],
)
def test_names_that_are_no_text_are_refused(
    tmp_path: Path, name: bytes, content: bytes, expected: str
) -> None:
    pytest.importorskip("mujoco")
    (tmp_path / os.fsdecode(name)).write_bytes(content)
    with pytest.raises(InvalidFile, match=expected):
        read_scene(tmp_path / os.fsdecode(name), 1.0)


def test_damaged_scenes_never_end_in_a_traceback(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    refused = 0
    for name, text in (("s.scene", OLD), ("n.scene", NEW), ("w.xml", WORLD)):
        for _ in range(80):
            try:
                read_scene(write(tmp_path, name, mutated(text, rng)), 1.0)
            except VdsmError as error:
                refused += 1
                assert len(str(error).splitlines()) == 1
    assert refused > 100


def test_whole_numbers_of_any_size_are_refused(tmp_path: Path) -> None:
    text = (
        f"world: {{collision_objects: [{{id: a, pose: {{position: [0, 0, {10**400}]}}"
    )
    text += ", primitives: [], primitive_poses: []}]}"
    with pytest.raises(InvalidFile, match="expected 3 finite numbers"):
        read_scene(write(tmp_path, "m.yaml", text), 1.0)


@pytest.mark.parametrize(
    ("size", "noted"), [(31.0, True), (29.0, False), (0.0034, False), (0.0032, True)]
)
def test_meshes_of_a_planning_scene_in_another_unit_are_noted(
    tmp_path: Path, size: float, noted: bool
) -> None:
    """Beside a robot of 1 m: more than 30 times as large, or 300 times smaller."""
    corners = [[0, 0, 0], [size, 0, 0], [size / 2, size / 9, 0], [0, 0, size / 9]]
    text = (
        "world:\n  collision_objects:\n    - id: part\n"
        "      mesh_poses: [{position: [1, 0, 0], orientation: [0, 0, 0, 1]}]\n"
        f"      meshes: [{{vertices: {corners}, triangles: [[0, 1, 3], [0, 2, 1]]}}]\n"
    )
    (mesh,) = read_scene(write(tmp_path, "s.yaml", text), 1.0).obstacles
    assert isinstance(mesh, Mesh)
    assert len(mesh.notes) == noted
    assert all("is it in another unit?" in note for note in mesh.notes)


def pose(*numbers: float) -> dict[str, Any]:
    return {"position": list(numbers[:3]), "orientation": list(numbers[3:])}


def of_shape(kind: str | int, *sizes: float) -> dict[str, Any]:
    return {"type": kind, "dimensions": list(sizes)}


TURNED = 0.6, 0.0, 0.0, 0.8
WORLDLY: dict[str, Any] = {"header": {"frame_id": "world"}}
OBJECTS: list[dict[str, Any]] = [
    {"id": "can", **WORLDLY, "pose": pose(1, 2, 3, *TURNED), "primitives": [
        of_shape("cylinder", 0.2, 0.05), of_shape(2, 0.1)],
     "primitive_poses": [pose(0, 0, 0.5, 0, 0.6, 0, 0.8), pose(0, 0, 1, 0, 0, 0, 1)]},
    {"id": "shelf", **WORLDLY,
     "primitives": [of_shape(1, 0.1, 0.2, 0.3)],
     "primitive_poses": [pose(-1, 0.5, 0.25, 0, 0, 0.6, -0.8)]},
    {"id": "slab", **WORLDLY, "primitives": [of_shape("box", 1, 2, 0.1)],
     "primitive_poses": [pose(0, 0, -1, 0, 0, 0, 1)]},
]  # fmt: skip


def planning_scene(**more: Any) -> dict[str, Any]:
    return copy.deepcopy({"world": {"collision_objects": OBJECTS}, **more})


def placement(stated: Any) -> np.ndarray:
    """T of a pose, by Rodrigues' rule, where its numbers are named or listed."""
    found = np.eye(4)
    if stated is None:
        return found
    place, turn = stated.get("position"), stated.get("orientation")
    x = [place[k] for k in "xyz"] if isinstance(place, dict) else place or [0, 0, 0]
    q = [turn[k] for k in "xyzw"] if isinstance(turn, dict) else turn or [0, 0, 0, 1]
    found[:3, 3] = x
    q = np.array(q) / np.linalg.norm(q)
    for k, e in enumerate(np.eye(3)):
        side = np.cross(q[:3], e)
        found[:3, k] = e + 2.0 * (q[3] * side + np.cross(q[:3], side))
    return found


def expected(data: dict[str, Any]) -> list[tuple[Any, ...]]:
    """Name, kind, T and sizes of every solid, of plain numbers and mappings."""
    solids: list[tuple[Any, ...]] = []
    for thing in data["world"]["collision_objects"]:
        base = placement(thing.get("pose"))
        both = [*zip(thing["primitives"], thing["primitive_poses"], strict=True)]
        for k, (shape, at) in enumerate(both, 1):
            name = thing["id"] if len(both) == 1 else f"{thing['id']}/{k}"
            kind = ("box", "sphere", "cylinder")[shape["type"] - 1] if isinstance(
                shape["type"], int) else shape["type"]  # fmt: skip
            sizes = [float(x) for x in shape["dimensions"]]
            solids.append((name, kind, base @ placement(at), sizes))
    return solids


def assert_as_expected(found: Any, name: str, kind: str, pose: Any, sizes: Any) -> None:
    assert (found.name, type(found).__name__.lower()) == (name, kind)
    np.testing.assert_allclose(found.centre, pose[:3, 3], atol=1e-9)
    if isinstance(found, Box):
        np.testing.assert_allclose(found.rotation, pose[:3, :3], atol=1e-9)
        np.testing.assert_allclose(2.0 * found.half_size, sizes)
    elif isinstance(found, Cylinder):
        np.testing.assert_allclose(found.axis, pose[:3, 2], atol=1e-9)
        assert [2.0 * found.half_length, found.radius] == pytest.approx(sizes)
    else:
        assert [found.radius] == pytest.approx(sizes)


def test_planning_scenes_with_one_thing_changed_are_refused_or_read_as_stated(
    tmp_path: Path,
) -> None:
    """Another number, nothing, a list for a mapping, a mapping for a list, any word."""
    rng, read = np.random.default_rng(7), 0
    odd = None, -1, 0, 5.5, "x", "", [], {}, True, [1, 2, 3], {"x": 1}, 1e13, [[0] * 7]
    for k in range(400):
        data = planning_scene()
        holder, key = data["world"], "collision_objects"
        for _ in range(int(rng.integers(2, 7))):
            inner = holder[key]
            if not isinstance(inner, dict | list) or not inner:
                break
            holder = inner
            some = [*inner] if isinstance(inner, dict) else [*range(len(inner))]
            key = some[int(rng.integers(len(some)))]
        value = holder[key]
        if k % 3 == 0 and type(value) in (int, float):
            holder[key] = value * float(rng.choice([-1, 1.5, 1 + 1e-9]))
        elif k % 3 == 1 and isinstance(value, list) and len(value) in (3, 4):
            holder[key] = dict(zip("xyzw", value, strict=False))
        else:
            holder[key] = odd[int(rng.integers(len(odd)))]
        file = write(tmp_path, "s.yaml", json.dumps(data))
        try:
            scene = read_scene(file, 1.0)
        except InvalidFile as error:
            assert len(str(error).splitlines()) == 1
            continue
        read += 1
        told = zip(scene.obstacles, expected(data), strict=True)
        for found, solid in told:
            assert_as_expected(found, *solid)
    assert 50 < read < 300


@pytest.mark.parametrize(
    ("frame", "shift", "good"),
    [("world", [0, 0, 0], True), ("world", [0, 0, 1e-3], False), ("", [1, 0, 0], True),
     ("camera", [1, 0, 0], True)],
)  # fmt: skip
def test_objects_in_a_frame_that_stands_elsewhere_are_refused(
    tmp_path: Path, frame: str, shift: list[float], good: bool
) -> None:
    """A PlanningScene tells where frames stand besides those of links."""
    where = {"translation": shift, "rotation": [0, 0, 0, 1]}
    data = planning_scene(
        fixed_frame_transforms=[{"child_frame_id": frame, "transform": where}]
    )
    file = write(tmp_path, "s.yaml", json.dumps(data))
    if good:
        assert len(read_scene(file, 1.0).obstacles) == 4
        return
    with pytest.raises(InvalidFile, match="'world', expected that of the root link"):
        read_scene(file, 1.0)
