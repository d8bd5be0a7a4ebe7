"""PLY, GLB and DAE: what trimesh finds in the same file, and damage named."""

import io
import json
import struct
import warnings
from collections.abc import Callable
from pathlib import Path

import collada
import numpy as np
import pytest
import trimesh
from scipy.spatial import cKDTree

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.closed_meshes import close_mesh
from vdsm_pin.io.mesh_file import read_mesh
from vdsm_pin.io.meshes.raw import RawMesh


def is_closed(mesh: RawMesh) -> bool:
    return close_mesh(mesh.vertices, mesh.triangles).closed


def solids(rng: np.random.Generator) -> list[trimesh.Trimesh]:
    made = [
        trimesh.creation.box(rng.uniform(0.1, 1, 3)),
        trimesh.creation.icosphere(1, float(rng.uniform(0.1, 1))),
        trimesh.creation.annulus(0.2, 0.5, float(rng.uniform(0.1, 1))),
        trimesh.creation.cone(0.3, 1.0),
    ]
    return [made[i] for i in rng.permutation(4)[: int(rng.integers(1, 5))]]


def pose(rng: np.random.Generator) -> np.ndarray:
    """A turn, a stretch, perhaps a mirror, and a shift."""
    matrix = trimesh.transformations.random_rotation_matrix(rng.uniform(size=3))
    matrix[:3, :3] = matrix[:3, :3] @ np.diag(rng.uniform(0.5, 2, 3))
    if rng.uniform() < 0.3:
        matrix[:3, :3] = matrix[:3, :3] @ np.diag([1, -1, 1])
    matrix[:3, 3] = rng.uniform(-3, 3, 3)
    return matrix


def assert_same(mesh: RawMesh, oracle: trimesh.Trimesh, *, close: float) -> None:
    """The same triangles in any order, and the same volume with its sign."""
    found, expected = mesh.vertices[mesh.triangles], np.asarray(oracle.triangles)
    assert_same_middles(found, expected, close=close)
    volumes = [volume(corners) for corners in (found, expected)]
    assert volumes[0] == pytest.approx(volumes[1], abs=1e3 * close)


def volume(corners: np.ndarray) -> float:
    products = np.cross(corners[:, 1], corners[:, 2])
    return float(np.einsum("ij,ij->", corners[:, 0], products) / 6)


def assert_same_middles(
    found: np.ndarray, expected: np.ndarray, *, close: float
) -> None:
    """As many triangles, and each has its like in the other set."""
    assert len(found) == len(expected)
    middles, others = found.mean(axis=1), expected.mean(axis=1)
    there = cKDTree(others).query(middles)[0]
    back = cKDTree(middles).query(others)[0]
    assert max(there.max(), back.max()) < close


def write(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


@pytest.mark.parametrize("encoding", ["ascii", "binary"])
@pytest.mark.parametrize("seed", range(5))
def test_ply_is_what_trimesh_wrote(tmp_path: Path, encoding: str, seed: int) -> None:
    solid = trimesh.util.concatenate(solids(np.random.default_rng(seed)))
    content = solid.export(file_type="ply", encoding=encoding)
    mesh = read_mesh(write(tmp_path, "a.ply", content))
    assert_same(mesh, solid, close=1e-7)
    assert is_closed(mesh)
    assert mesh.unit is None


@pytest.mark.parametrize("order", [">", "<", ""])
@pytest.mark.parametrize("kind", ["u1", "i4"])
@pytest.mark.parametrize("alike", [True, False])
def test_ply_of_any_order_with_other_elements_and_values(
    tmp_path: Path, order: str, kind: str, alike: bool
) -> None:
    """A cube of quads, or of quads and triangles, written here."""
    vertices = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)])
    faces = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4]]
    faces += [[1, 5, 7, 3]] if alike else [[1, 5, 7], [1, 7, 3]]
    words = {"u1": "uchar", "i4": "int"}[kind]
    name = {">": "binary_big_endian", "<": "binary_little_endian", "": "ascii"}[order]
    lines = [
        "ply", f"format {name} 1.0", "comment Gehäuse \u2028", "obj_info x",
        "element camera 2", "property list uchar short tags", "property double t",
        "element vertex 8", "property uchar red", "property double x",
        "property double y", "property float z",
        f"element face {len(faces)}", "property short flag",
        f"property list {words} uint vertex_indices", "property float more",
        "element edge 1", "property int a", "end_header",
    ]  # fmt: skip

    def put(text_or_kind: str, value: float) -> bytes:
        if not order:
            return f"{value:g} ".encode()
        return np.array(value, order + text_or_kind).tobytes()

    end = b"" if order else b"\r\n"
    body = b""
    for tags in ([], [5, 6]):
        body += put("u1", len(tags)) + b"".join(put("i2", t) for t in tags)
        body += put("f8", 0.5) + end
    for x, y, z in vertices.tolist():
        body += put("u1", 7) + put("f8", x) + put("f8", y) + put("f4", z) + end
    for face in faces:
        body += put("i2", -1) + put(kind, len(face))
        body += b"".join(put("u4", i) for i in face) + put("f4", 0) + end
    body += put("i4", 3) + end
    head = ("\r\n" if not order else "\n").join([*lines, ""]).encode()
    mesh = read_mesh(write(tmp_path, "a.ply", head + body))
    assert is_closed(mesh)
    assert len(mesh.triangles) == 12
    a, b, c = np.moveaxis(mesh.vertices[mesh.triangles], 1, 0)
    assert abs(np.einsum("ij,ij->", a, np.cross(b, c)) / 6) == pytest.approx(1.0)


PLY_KINDS = {
    "b": ("char", "int8"), "B": ("uchar", "uint8"), "h": ("short", "int16"),
    "H": ("ushort", "uint16"), "i": ("int", "int32"), "I": ("uint", "uint32"),
    "f": ("float", "float32"), "d": ("double", "float64"),
}  # fmt: skip
"""Letter that `struct` has for a type, and names that PLY has for it."""


@pytest.mark.parametrize("order", [">", "<"])
@pytest.mark.parametrize("letter", PLY_KINDS)
def test_numbers_of_a_ply_are_those_that_struct_packs(
    tmp_path: Path, letter: str, order: str
) -> None:
    """Of each type the least, the largest and -1 as a coordinate; lists as long."""
    bits = 8 * struct.calcsize(f"={letter}")
    least, most = (0, 2**bits - 1) if letter.isupper() else (-(2 ** (bits - 1)), 7)
    xs = (-1.5, 1e11, 2.0) if letter in "fd" else (least, max(least, -1), most)
    name = {">": "binary_big_endian", "<": "binary_little_endian"}[order]
    corners = b"".join(struct.pack(f"{order}{letter}bb", x, k, k * k)
                       for k, x in enumerate(xs))  # fmt: skip
    for word in PLY_KINDS[letter]:
        counted = "uchar" if letter in "fd" else word
        head = (
            f"ply\nformat {name} 1.0\nelement vertex 3\nproperty {word} x\n"
            "property char y\nproperty int8 z\nelement face 2\n"
            f"property list {counted} uchar vertex_index\nend_header\n"
        ).encode()
        sized = "B" if letter in "fd" else letter
        for sizes in ((3, 3), (3, 4)):  # all alike, and one by one
            lists = [struct.pack(f"{order}{sized}{n}B", n, *range(3), *[0] * (n - 3))
                     for n in sizes]  # fmt: skip
            mesh = read_mesh(write(tmp_path, "a.ply", head + corners + b"".join(lists)))
            found = sorted(mesh.vertices.tolist(), key=lambda row: row[1])
            assert [row[0] for row in found] == np.array(xs, letter).tolist()
            assert [row[1:] for row in found] == [[0, 0], [1, 1], [2, 4]]
        if letter.islower() and letter not in "fd":  # a list of -1 is damage
            wrong = struct.pack(f"{order}{letter}", -1) + bytes(1 << 17)
            with pytest.raises(InvalidFile, match="is cut short"):
                read_mesh(write(tmp_path, "a.ply", head + corners + lists[0] + wrong))


def scene(rng: np.random.Generator) -> trimesh.Scene:
    """Solids in a tree of frames, some of them there twice."""
    made = trimesh.Scene()
    frames = ["world"]
    for i, solid in enumerate(solids(rng)):
        for k in range(int(rng.integers(1, 3))):
            name = f"n{i}-{k}"
            parent = frames[int(rng.integers(len(frames)))]
            made.add_geometry(
                solid, geom_name=f"g{i}", node_name=name, transform=pose(rng),
                parent_node_name=parent,
            )  # fmt: skip
            frames.append(name)
    return made


@pytest.mark.parametrize("seed", range(12))
def test_glb_is_the_scene_that_trimesh_finds_in_it(tmp_path: Path, seed: int) -> None:
    made = scene(np.random.default_rng(seed))
    path = write(tmp_path, "a.glb", made.export(file_type="glb"))
    oracle = trimesh.load_scene(path, process=False).to_mesh()
    mesh = read_mesh(path)
    assert mesh.unit == 1.0
    assert not mesh.notes
    assert_same(mesh, oracle, close=1e-6)


def dae(body: str, *, unit: str = "", root: str = "") -> str:
    """A tetrahedron in a library, and a scene that puts it somewhere."""
    points = "0 0 0 1 0 0 0 1 0 0 0 1"
    return f"""<?xml version="1.0" encoding="utf-8"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset>{unit}<up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
 <source id="s"><float_array id="a" count="12">{points}</float_array>
  <technique_common><accessor source="#a" count="4" stride="3">
   <param name="X" type="float"/><param name="Y" type="float"/>
   <param name="Z" type="float"/></accessor></technique_common></source>
 <vertices id="v"><input semantic="POSITION" source="#s"/></vertices>
 {root or TRIANGLES}
</mesh></geometry></library_geometries>
<library_nodes><node id="lib"><scale>2 2 2</scale><instance_geometry url="#g"/></node>
</library_nodes>
<library_visual_scenes><visual_scene id="vs">{body}</visual_scene>
<visual_scene id="other"><node><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes>
<scene><instance_visual_scene url="#vs"/></scene></COLLADA>"""


@pytest.mark.parametrize(("axis", "noted"), [("Z", 0), ("Y", 1), ("X", 1)])
def test_a_dae_that_does_not_point_up_along_z_says_so(
    tmp_path: Path, axis: str, noted: int
) -> None:
    """Its axes are kept: what was drawn upright may lie down in the scene."""
    text = dae(HERE).replace("Z_UP", f"{axis}_UP")
    mesh = read_mesh(write(tmp_path, "a.dae", text))
    note = f"its {axis} axis points up; axes are kept as they are"
    assert mesh.notes == (note,) * noted
    upright = read_mesh(write(tmp_path, "z.dae", dae(HERE)))
    np.testing.assert_array_equal(mesh.vertices, upright.vertices)


def test_a_dae_that_moves_says_that_it_is_read_at_rest(tmp_path: Path) -> None:
    moving = "<library_animations><animation id='m'/></library_animations>"
    text = dae(HERE).replace("<library_nodes>", f"{moving}<library_nodes>")
    (note,) = read_mesh(write(tmp_path, "a.dae", text)).notes
    assert note.startswith("its motion is not read")


def test_a_dae_names_nothing_that_is_there_twice(tmp_path: Path) -> None:
    """One of two geometries of one name would be left out silently."""
    text = dae(HERE)
    start, end = text.index("<geometry"), text.index("</library_geometries>")
    twice = text[:end] + text[start:end] + text[end:]
    with pytest.raises(InvalidFile, match="'#g', which is there 2 times"):
        read_mesh(write(tmp_path, "a.dae", twice))


TRIANGLES = """<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>
 <input semantic="NORMAL" source="#s" offset="1"/>
 <p>0 0 2 0 1 0 0 1 1 1 3 1 0 2 3 2 2 2 1 3 2 3 3 3</p></triangles>"""
HERE = '<node><instance_geometry url="#g"/></node>'


@pytest.mark.filterwarnings("ignore:the matrix subclass")
@pytest.mark.parametrize("seed", range(12))
def test_dae_is_the_scene_that_pycollada_finds_in_it(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)

    def node(depth: int) -> str:
        axis, by, size = rng.normal(size=(3, 3))
        axis /= np.linalg.norm(axis)
        moves = [
            f"<translate>{by[0]:.3f} {by[1]:.3f} {by[2]:.3f}</translate>",
            f"<rotate>{' '.join(map(str, axis))} {rng.uniform(-400, 400):.2f}</rotate>",
            f"<scale>{size[0]:.3f} {size[1]:.3f} {size[2]:.3f}</scale>",
            f"<matrix>{' '.join(f'{x:.6f}' for x in pose(rng).ravel())}</matrix>",
        ]
        picked = [moves[i] for i in rng.permutation(4)[: int(rng.integers(0, 5))]]
        inner = "".join(node(depth + 1) for _ in range(2 if depth < 2 else 0))
        at = '<instance_geometry url="#g"/>'
        return f"<node>{''.join(picked)}{at}{inner}</node>"

    path = write(tmp_path, "a.dae", dae(node(0), unit='<unit meter="0.0254"/>'))
    mesh = read_mesh(path)
    assert mesh.unit == 0.0254
    bound = collada.Collada(str(path)).scene.objects("geometry")
    parts = [p for one in bound for p in one.primitives()]
    expected = np.concatenate([p.vertex[p.vertex_index] for p in parts])
    found = mesh.vertices[mesh.triangles]
    assert_same_middles(found, expected.astype(float), close=1e-4)


def test_the_axis_of_a_turn_in_dae_may_be_of_any_length(tmp_path: Path) -> None:
    turned = HERE.replace("<instance", "<rotate>0 0 7 90</rotate><instance")
    mesh = read_mesh(write(tmp_path, "a.dae", dae(turned)))
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    np.testing.assert_allclose([low, high], [[-1, 0, 0], [0, 1, 1]], atol=1e-15)


def test_a_node_of_a_dae_library_stands_where_it_is_named(tmp_path: Path) -> None:
    there = HERE.replace("instance_geometry", "instance_node").replace("#g", "#lib")
    there = there.replace("<node>", "<node><translate>1 0 0</translate>")
    mesh = read_mesh(write(tmp_path, "a.dae", dae(there)))
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    assert (low.tolist(), high.tolist()) == ([1, 0, 0], [3, 2, 2])


def test_a_mirror_in_dae_does_not_turn_the_solid_inside_out(tmp_path: Path) -> None:
    mirror = HERE.replace("<instance", "<scale>2 -1 1</scale><instance")
    mesh = read_mesh(write(tmp_path, "a.dae", dae(mirror)))
    plain = read_mesh(write(tmp_path, "a.dae", dae(HERE)))
    volumes = [volume(m.vertices[m.triangles]) for m in (mesh, plain)]
    assert volumes[0] == pytest.approx(2 * volumes[1])
    assert is_closed(plain)


@pytest.mark.parametrize("seed", range(3))
def test_dae_is_what_trimesh_wrote(tmp_path: Path, seed: int) -> None:
    solid = trimesh.util.concatenate(solids(np.random.default_rng(seed)))
    mesh = read_mesh(write(tmp_path, "a.dae", solid.export(file_type="dae")))
    assert mesh.unit == 1.0
    assert_same(mesh, solid, close=1e-6)


INPUT = '<input semantic="VERTEX" source="#v" offset="0"/>'


@pytest.mark.parametrize(
    ("faces", "count"),
    [
        (f"<polylist>{INPUT}<vcount>3 4</vcount><p>0 1 2 0 1 3 2</p></polylist>", 3),
        (f"<polygons>{INPUT}<p>0 1 2</p><p>0 1 2 3</p></polygons>", 3),
        (f"<tristrips>{INPUT}<p>0 1 2 3</p></tristrips>", 2),
        (f"<trifans>{INPUT}<p>0 1 2 3</p><p>1 2 3</p></trifans>", 3),
    ],
)  # fmt: skip
def test_dae_has_faces_of_many_kinds(tmp_path: Path, faces: str, count: int) -> None:
    mesh = read_mesh(write(tmp_path, "a.dae", dae(HERE, root=faces)))
    assert len(mesh.triangles) == count
    lines = f"<lines>{INPUT}<p>0 1</p></lines>"
    mesh = read_mesh(write(tmp_path, "a.dae", dae(HERE, root=faces + lines)))
    assert mesh.notes == ("lines and points left out: 1",)


def glb(change: Callable[[dict], None]) -> bytes:
    """A box by trimesh with its JSON changed."""
    content = trimesh.Scene(trimesh.creation.box()).export(file_type="glb")
    size = int.from_bytes(content[12:16], "little")
    document = json.loads(content[20 : 20 + size])
    change(document)
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    rest = content[20 + size :]
    body = len(text).to_bytes(4, "little") + b"JSON" + text + rest
    return b"glTF" + (2).to_bytes(4, "little") + (12 + len(body)).to_bytes(
        4, "little"
    ) + body  # fmt: skip


def setting(*path: object) -> Callable[[dict], None]:
    """Sets the last value at the place that the others lead to."""

    def change(document: dict) -> None:
        holder = document
        *steps, key, value = path
        for step in steps:
            holder = holder[step]
        holder[key] = value

    return change


def triangles_of(content: bytes, folder: Path) -> np.ndarray:
    mesh = read_mesh(write(folder, "a.glb", content))
    return mesh.vertices[mesh.triangles]


def test_glb_strips_and_fans_are_triangles_of_one_sense(tmp_path: Path) -> None:
    for mode, name in ((5, "strip"), (6, "fan")):
        change = setting("meshes", 0, "primitives", 0, "mode", mode)
        found = triangles_of(glb(change), tmp_path)
        assert len(found) == 34, name
    last = setting("meshes", 0, "primitives", 0, "mode", 4)
    assert len(triangles_of(glb(last), tmp_path)) == 12


DRACO = "KHR_draco_mesh_compression"
GLB_DAMAGE = [
    (setting("extensionsRequired", [DRACO]), "requires the ext"),
    (setting("meshes", 0, "primitives", 0, "mode", 9), "glTF is damaged: Input should"),
    (
        setting("meshes", 0, "primitives", 0, "attributes", "POSITION", 99),
        "names acces",
    ),
    (setting("accessors", 0, "count", 10**9), "promises 1000000000 values, too many"),
    (setting("accessors", 0, "byteOffset", 10**9), "values, too many"),
    (setting("accessors", 0, "sparse", {}), "is sparse or no"),
    (setting("bufferViews", 0, "byteLength", 10**9), "values, too many"),
    (setting("buffers", 0, "uri", "x.bin"), "has data in another file or compressed"),
    (setting("scenes", 0, "nodes", [0, 0]), "stands in the scene twice"),
    (setting("scenes", 0, "nodes", [77]), "names nodes[77], there are"),
    (setting("scene", 7), "names scenes[7], there are 1"),
    (setting("nodes", 0, "scale", [1e12, 1e13, 1]), "its glTF is damaged"),
    (setting("nodes", 0, "matrix", [0.0] * 16), "matrix that is not affine"),
    (setting("nodes", 0, {"mesh": 0, "skin": 0}), "is bent by a skin or by morph"),
    (setting("nodes", 0, {"mesh": 0, "weights": [0.5]}), "is bent by a skin or by"),
    (setting("nodes", 0, {"extensions": {"EXT_mesh_gpu_instancing": {}}}), "instanc"),
    (setting("scenes", 0, "nodes", []), "has no triangle"),
    (setting("accessors", 0, "bufferView", None), "accessors[0] has no data"),
    (
        setting("meshes", 0, "primitives", 0, "extensions", {DRACO: {}}),
        "is compressed",
    ),
]


@pytest.mark.parametrize(("change", "expected"), GLB_DAMAGE)
def test_damage_of_glb_is_named(
    tmp_path: Path, change: Callable[[dict], None], expected: str | None
) -> None:
    path = write(tmp_path, "a.glb", glb(change))
    if expected is None:
        read_mesh(path)
        return
    with pytest.raises(InvalidFile, match=expected.replace("[", r"\[")):
        read_mesh(path)


def test_a_glb_without_its_json_is_refused(tmp_path: Path) -> None:
    body = b"glTF" + (2).to_bytes(4, "little") + (20).to_bytes(4, "little")
    path = write(tmp_path, "a.glb", body + bytes(4) + b"BIN\0")
    with pytest.raises(InvalidFile, match="has no JSON chunk"):
        read_mesh(path)


def with_more(key: str, *more: dict) -> Callable[[dict], None]:
    """Adds primitives, nodes or scenes to the first mesh or the document."""

    def change(document: dict) -> None:
        holder = document["meshes"][0] if key == "primitives" else document
        holder[key] = [*holder.get(key, []), *more]

    return change


@pytest.mark.parametrize(
    ("change", "notes"),
    [
        (with_more("primitives", {"mode": 1, "attributes": {"POSITION": 0}},
                   {"mode": 0, "attributes": {}}), ("lines and points left out: 2",)),
        (with_more("primitives", {"attributes": {}}), ()),
        (with_more("nodes", {"mesh": 0}), ()),
        (lambda document: document["nodes"].append({"name": "camera"})
         or document["scenes"][0]["nodes"].append(len(document["nodes"]) - 1), ()),
        (with_more("scenes", {"nodes": []}), ("one of 2 scenes is read",)),
        (with_more("animations", {}),
         ("its motion is not read: parts stand where their nodes do",)),
        (lambda document: (document.pop("scenes"), document.pop("scene")), ()),
    ],
)  # fmt: skip
def test_what_stands_beside_the_scene_of_a_glb_leaves_it_as_it_is(
    tmp_path: Path, change: Callable[[dict], None], notes: tuple[str, ...]
) -> None:
    expected = triangles_of(glb(lambda _: None), tmp_path)
    mesh = read_mesh(write(tmp_path, "a.glb", glb(change)))
    assert mesh.notes == notes
    np.testing.assert_array_equal(mesh.vertices[mesh.triangles], expected)


PLY = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
    "property float z\nelement face 1\nproperty list uchar int vertex_indices\n"
    "end_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n"
)
TEXT_DAMAGE = [
    ("a.ply", "plx\n", "line 1: is no header of a PLY file: 'plx'"),
    ("a.ply", PLY.replace("ascii", "asci"), "line 2: is no header of a PLY file"),
    ("a.ply", PLY.replace("float x", "float w"), "has no x, y, z of its vertices"),
    ("a.ply", PLY.replace("list uchar", "list float"), "line 8: is no header of a PLY"),
    (
        "a.ply",
        PLY.replace("ty float x", "ty list uchar float x").replace(
            "d_header\n0 0 0\n1 0 0\n0 1 0", "d_header\n" + 3 * "2 0 0 0 0\n"
        ),
        "has lists where x, y and z are meant",
    ),
    ("a.ply", PLY.replace("vertex 3", "vertex 4"), "has 4 values, 'vertex' has 3"),
    ("a.ply", PLY.replace("face 1", "face 2"), "promises 2 of 'face', has 1"),
    ("a.ply", f"{PLY}\n3 0 1 2", "announces: 3 of 'vertex', 1 of 'face'"),
    (
        "a.ply",
        PLY.replace("face 1", "face 99999999999"),
        "has more than 15000000 vertices",
    ),
    ("a.ply", PLY.replace("3 0 1 2", "3 0 1"), "line 13: has 3 values, too few"),
    ("a.ply", PLY.replace("3 0 1 2", "3 0 1 2 4"), "line 13: has 5 values, 'face' ha"),
    ("a.ply", PLY.replace("3 0 1 2", "3 0 1 3"), "a face names vertex 3, expected 0 "),
    ("a.ply", PLY.replace("3 0 1 2", "3 0 1 1.5"), "a face names vertex 1.5, expecte"),
    *(
        ("a.ply", PLY.replace("3 0 1 2", f"{n} 0 1 2"), "line 13: has 4 values, too f")
        for n in ("-3", "3.5", "inf", "nan", "1e300")
    ),
    ("a.ply", PLY.replace("1 0 0", "nan 0 0"), "vertex 2: has a coordinate that is n"),
    ("a.ply", PLY.replace("3 0 1 2", "2 0 1"), "has no triangle"),
    ("a.ply", PLY.replace("ascii", "binary_little_endian"), "promises 3 of 'vertex'"),
    ("a.ply", PLY.replace("face 1", "tristrips 1"), "has triangle strips"),
    ("a.ply", "ply\n" + "comment\n" * 20_000, "has a header of more than 10000"),
    ("a.dae", "<x/>", "is no COLLADA file: its root is 'x'"),
    ("a.dae", "<COLLADA>", "is not XML"),
    ("a.dae", "\0\1\2", "is not XML"),
    ("a.dae", '<!DOCTYPE a [<!ENTITY b "c">]><COLLADA>&b;</COLLADA>', "has a DOCTYPE"),
    ("a.dae", "<COLLADA/>", "has no triangle"),
    ("a.dae", dae(HERE.replace("#g", "#h")), "names '#h', which is not in this file"),
    ("a.dae", dae(HERE.replace("#g", "b.dae#g")), "names 'b.dae#g', which is not"),
    ("a.dae", dae(HERE, unit='<unit meter="0"/>'), "its unit is 0 m, expected 1e-9"),
    ("a.dae", dae(HERE, unit='<unit meter="inch"/>'), "found 'inch' where numbers"),
    ("a.dae", dae(HERE).replace("3 3 3</p>", "3 3 9</p>"), None),
    ("a.dae", dae(HERE).replace("0 0 2 0", "0 0 9 0"), "names vertices that are not"),
    ("a.dae", dae(HERE).replace("0 0 2 0", f"0 0 {10**30} 0"), "where numbers are me"),
    ("a.dae", dae(HERE).replace('count="4" st', 'count="5" st'), "or is cut short"),
    ("a.dae", dae(HERE).replace('count="4" st', 'count="-1" st'), "or is cut short"),
    ("a.dae", dae(HERE).replace('4" st', '1" offset="-3" st'), "or is cut short"),
    ("a.dae", dae(HERE).replace("0 0 1</f", "0 0 inf</f"), "vertex 4: has a coordin"),
    ("a.dae", dae("<node><skew>1</skew></node>"), "places a part by <skew>"),
    ("a.dae", dae("<node><instance_controller/></node>"), "is bent by a skin"),
    ("a.dae", dae("<node><matrix>1 2</matrix></node>"), "found '1 2' where numbers"),
    ("a.dae", dae(f"<node><scale>{'1e300 ' * 3}</scale></node>"), "that is not affine"),
    ("a.dae", dae('<node id="n"><instance_node url="#n"/></node>'), "nodes 100 deep"),
    ("a.dae", dae(HERE, root="<tristrips><p>0 1 2</p></tristrips>"), "names no vert"),
    (
        "a.dae",
        dae(HERE).replace(TRIANGLES, "").replace("mesh>", "spline>"),
        "has a <spline>, which is not read",
    ),
    (
        "a.dae",
        dae(HERE, root=f"<polygons>{INPUT}<ph><p>0 1 2</p></ph></polygons>"),
        "has faces with holes (<ph>), which are not read",
    ),
    ("a.dae", dae(HERE).replace("POSITION", "NORMAL"), "<vertices> without POSITION"),
    ("a.dae", dae(HERE).replace("accessor", "extra"), "has a source without accessor"),
]


@pytest.mark.parametrize(("name", "content", "expected"), TEXT_DAMAGE)
def test_damage_of_ply_and_dae_is_named(
    tmp_path: Path, name: str, content: str, expected: str | None
) -> None:
    path = write(tmp_path, name, content)
    if expected is None:
        read_mesh(path)
        return
    with pytest.raises(InvalidFile) as caught:
        read_mesh(path)
    assert expected in str(caught.value)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig"])
def test_entities_of_dae_are_refused_in_every_encoding(
    tmp_path: Path, encoding: str
) -> None:
    text = '<!DOCTYPE a [<!ENTITY b "c">]><COLLADA>&b;</COLLADA>'
    (tmp_path / "a.dae").write_bytes(text.encode(encoding))
    with pytest.raises(InvalidFile, match="has a DOCTYPE"):
        read_mesh(tmp_path / "a.dae")


@pytest.mark.parametrize("kind", ["obj", "ply", "glb", "dae"])
@pytest.mark.parametrize("odd", ["nan", "inf", "1e300"])
def test_vertices_that_no_triangle_names_may_be_anything(
    tmp_path: Path, kind: str, odd: str
) -> None:
    """The same in all formats, and without a warning."""
    corners = ["0 0 0", "1 0 0", "0 1 0", f"{odd} 0 0"]
    last = trimesh.creation.box().vertices[-1].astype("<f4").tobytes()
    with np.errstate(over="ignore"):
        wrong = np.array([float(odd), 0.0, 0.0]).astype("<f4").tobytes()
    before, _, behind = glb(setting("accessors", 0, "count", 3)).rpartition(last)
    face = '<triangles><input semantic="VERTEX" source="#v"/><p>0 1 2</p></triangles>'
    content = {
        "obj": "".join(f"v {corner}\n" for corner in corners) + "f 1 2 3\n",
        "ply": PLY.replace("vertex 3", "vertex 4").replace(
            "\n3 0", f"\n{corners[3]}\n3 0"
        ),
        "glb": before + wrong + behind,
        "dae": dae(HERE, root=face).replace(
            "0 0 0 1 0 0 0 1 0 0 0 1", " ".join(corners)
        ),
    }[kind]
    path = write(tmp_path, f"a.{kind}", content)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert len(read_mesh(path).triangles) == 1


@pytest.mark.parametrize("element", ["element a 0\nproperty int b", "element a 3"])
def test_elements_of_a_ply_without_values_take_no_bytes(
    tmp_path: Path, element: str
) -> None:
    content = trimesh.creation.box().export(file_type="ply")
    assert b"binary" in content
    more = content.replace(b"element vertex", element.encode() + b"\nelement vertex")
    assert len(read_mesh(write(tmp_path, "a.ply", more)).triangles) == 12


OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"


@pytest.mark.parametrize(
    ("name", "text", "notes"),
    [
        ("a.ply", PLY, ()),
        ("a.ply", PLY.replace("face 1", "face 3") + "2 0 1\n0\n",
         ("faces of less than three corners left out: 2",)),
        ("a.obj", OBJ, ()),
        ("a.obj", f"{OBJ}l 1 2\np 1\n", ("lines and points left out: 2",)),
    ],
)  # fmt: skip
def test_what_is_left_out_of_a_mesh_is_told(
    tmp_path: Path, name: str, text: str, notes: tuple[str, ...]
) -> None:
    mesh = read_mesh(write(tmp_path, name, text))
    assert mesh.notes == notes
    assert len(mesh.triangles) == 1


@pytest.mark.parametrize("kind", ["stl", "ply", "glb"])
def test_no_triangle_behind_those_announced_is_left_out(
    tmp_path: Path, kind: str
) -> None:
    """More bytes, or a second mesh behind the first: refused, never dropped."""
    content = trimesh.creation.box().export(file_type=kind)
    more = bytes([1, *49 * [0]])
    for damaged in (content + more, content + content):
        with pytest.raises(InvalidFile, match=r"announces|promises"):
            read_mesh(write(tmp_path, f"a.{kind}", damaged))
    if kind != "stl":
        filled = read_mesh(write(tmp_path, f"a.{kind}", content + bytes(4000) + b"\n"))
        assert len(filled.triangles) == 12
    if kind == "glb":
        size = len(content).to_bytes(4, "little")
        twice = content + content[12:]
        whole = twice.replace(size, len(twice).to_bytes(4, "little"), 1)
        with pytest.raises(InvalidFile, match="two chunks of a kind"):
            read_mesh(write(tmp_path, "a.glb", whole))


@pytest.mark.parametrize("kind", ["stl", "ply", "glb"])
def test_a_number_that_signals_it_is_none_is_refused_in_one_message(
    tmp_path: Path, kind: str
) -> None:
    corner = trimesh.creation.box((1.5, 1.5, 1.5)).export(file_type=kind)
    wrong = corner.replace(np.float32(0.75).tobytes(), b"\1\0\xa0\x7f")
    with pytest.raises(InvalidFile, match="a coordinate that is not a number"):
        read_mesh(write(tmp_path, f"a.{kind}", wrong))


def test_a_binary_ply_that_promises_more_than_it_has_is_refused(tmp_path: Path) -> None:
    box = trimesh.creation.box()
    content = box.export(file_type="ply", encoding="binary")
    for old, new in ((b"face 12", b"face 99"), (b"vertex 8", b"vertex 14000000")):
        assert old in content
        with pytest.raises(InvalidFile, match="is cut short"):
            read_mesh(write(tmp_path, "a.ply", content.replace(old, new)))
    for end in range(len(content) - 160, len(content), 7):
        with pytest.raises(InvalidFile):
            read_mesh(write(tmp_path, "a.ply", io.BytesIO(content[:end]).read()))
