"""Mesh files: the same triangles from every format, and damage named."""

import hashlib
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from problem_texts import TETRAHEDRON, binary_stl

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.closed_meshes import close_mesh
from vdsm_pin.io.mesh_file import read_mesh
from vdsm_pin.io.meshes import raw
from vdsm_pin.io.meshes.raw import RawMesh
from vdsm_pin.io.source import BLOCK


def text_stl(corners: np.ndarray, name: str = "part") -> str:
    lines = [f"solid {name}"]
    for triangle in corners.tolist():
        lines += [" facet normal 0 0 0", "  outer loop"]
        lines += [f"   vertex {x!r} {y!r} {z!r}" for x, y, z in triangle]
        lines += ["  endloop", " endfacet"]
    return "\n".join([*lines, f"endsolid {name}", ""])


def obj(corners: np.ndarray) -> str:
    points = corners.reshape(-1, 3).tolist()
    lines = ["# made by a test", "o part"]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in points]
    lines += [
        f"f {3 * i + 1}/1 {3 * i + 2}//2 {3 * i + 3}" for i in range(len(corners))
    ]
    return "\n".join([*lines, ""])


def write(folder: Path, name: str, content: str | bytes) -> Path:
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def is_closed(mesh: RawMesh) -> bool:
    return close_mesh(mesh.vertices, mesh.triangles).closed


FORMATS = (("a.stl", binary_stl), ("b.STL", text_stl), ("c.obj", obj))


@pytest.mark.parametrize(("name", "write_as"), FORMATS)
def test_every_format_gives_the_files_triangles_in_order(
    tmp_path: Path, name: str, write_as: object
) -> None:
    corners = (
        np.random.default_rng(1).normal(size=(50, 3, 3)).astype("f4").astype(float)
    )
    mesh = read_mesh(write(tmp_path, name, write_as(corners)))
    np.testing.assert_array_equal(mesh.vertices[mesh.triangles], corners)
    assert not is_closed(mesh)


@pytest.mark.parametrize(("name", "write_as"), FORMATS)
def test_a_closed_solid_is_closed_and_one_with_a_hole_is_not(
    tmp_path: Path, name: str, write_as: object
) -> None:
    mesh = read_mesh(write(tmp_path, name, write_as(TETRAHEDRON)))
    assert is_closed(mesh)
    assert mesh.vertices.shape == (4, 3)
    assert not is_closed(read_mesh(write(tmp_path, name, write_as(TETRAHEDRON[:3]))))


def test_the_second_library_agrees_on_its_own_solids(tmp_path: Path) -> None:
    trimesh = pytest.importorskip("trimesh")
    for solid in (trimesh.creation.icosphere(2), trimesh.creation.annulus(0.5, 1, 1)):
        for kind in ("stl", "stl_ascii", "obj"):
            name = f"solid.{kind.removesuffix('_ascii')}"
            content = solid.export(file_type=kind)
            mesh = read_mesh(write(tmp_path, name, content))
            assert is_closed(mesh)
            assert len(mesh.triangles) == len(solid.faces)
            corners = mesh.vertices[mesh.triangles]
            np.testing.assert_allclose(corners, solid.triangles, atol=1e-6)


def test_negative_obj_indices_count_from_the_end(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\n"
    mesh = read_mesh(write(tmp_path, "a.obj", text))
    corners = mesh.vertices[mesh.triangles][0].tolist()
    assert corners == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def test_convex_obj_faces_of_any_size_are_filled(tmp_path: Path) -> None:
    turns = np.linspace(0, 2 * np.pi, 7)[:-1]
    lines = [f"v {np.cos(t)!s} {np.sin(t)!s} 0" for t in turns]
    text = "\n".join([*lines, "f 1 2 3 4 5 6", ""])
    mesh = read_mesh(write(tmp_path, "a.obj", text))
    sides = np.diff(mesh.vertices[mesh.triangles], axis=1)
    areas = np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=1) / 2
    assert len(areas) == 4
    assert areas.sum() == pytest.approx(1.5 * np.sqrt(3), abs=1e-14)


def test_a_binary_file_that_begins_with_solid_is_binary(tmp_path: Path) -> None:
    content = b"solid".ljust(80, b" ") + binary_stl(TETRAHEDRON)[80:]
    assert is_closed(read_mesh(write(tmp_path, "a.stl", content)))


def test_trailing_bytes_and_counts_of_streaming_programs_are_read(
    tmp_path: Path,
) -> None:
    for content, note in (
        (binary_stl(TETRAHEDRON) + b"\n", "bytes behind the last triangle: 1"),
        (with_count(0), "its header counts 0 triangles, 4 are there"),
        (with_count(0xFFFFFFFF), "its header counts 4294967295 triangles, 4 are there"),
    ):
        mesh = read_mesh(write(tmp_path, "a.stl", content))
        np.testing.assert_array_equal(mesh.vertices[mesh.triangles], TETRAHEDRON)
        assert mesh.notes == (note,)


@pytest.mark.parametrize("name", ["Gehäuse", "корпус", "外壳", "solid", "\x1b[31m"])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "cp1251"])
@pytest.mark.parametrize("ends", ["\n", "\r\n", "\r"])
def test_names_and_remarks_may_be_in_any_encoding_and_lines_end_anyhow(
    tmp_path: Path, name: str, encoding: str, ends: str
) -> None:
    for file, text in (
        ("a.stl", text_stl(TETRAHEDRON, name)),
        ("a.obj", f"# {name}\no {name}\n{obj(TETRAHEDRON)}"),
    ):
        content = text.replace("\n", ends).encode(encoding, "replace")
        mesh = read_mesh(write(tmp_path, file, content))
        np.testing.assert_array_equal(mesh.vertices[mesh.triangles], TETRAHEDRON)


def test_an_obj_line_goes_on_behind_a_backslash_but_not_behind_one_in_a_remark(
    tmp_path: Path,
) -> None:
    text = "# C:\\parts\\\nv 0 0 \\\n0\nv 1 0 0 # x \\\nv 0 1 0\nf 1 \\\n 2\\\n3"
    mesh = read_mesh(write(tmp_path, "a.obj", text))
    corners = mesh.vertices[mesh.triangles][0].tolist()
    assert corners == [[0, 0, 0], [1, 0, 0], [0, 1, 0]]


def test_lines_and_points_of_an_obj_have_no_surface_and_are_counted(
    tmp_path: Path,
) -> None:
    text = "v 0 0 0 0.5 0.5 0.5\nv 1 0 0 1\nv 0 1 0\nf 1 2 3\nl 1 2\np 1\n"
    mesh = read_mesh(write(tmp_path, "a.obj", text))
    assert len(mesh.triangles) == 1
    assert mesh.notes == ("lines and points left out: 2",)


def test_more_than_there_may_be_is_refused_while_it_is_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(raw, "MAX_CORNERS", 20)
    for name, text in (
        ("a.obj", "v 0 0 0\n" * 21),
        ("a.obj", "v 0 0 0\n" + "f 1 1 1\n" * 7),
        ("a.stl", text_stl(np.zeros((7, 3, 3)))),
    ):
        with pytest.raises(InvalidFile, match="has more than 20 vertices or corners"):
            read_mesh(write(tmp_path, name, text))


def test_vertices_that_no_face_uses_do_not_count(tmp_path: Path) -> None:
    text = "v nan 0 0\nv 0 0 0\nv 1e20 0 0\nv 1 0 0\nv 0 1 0\nf 2 4 5\n"
    mesh = read_mesh(write(tmp_path, "a.obj", text))
    assert mesh.vertices.shape == (3, 3)


def test_the_digest_sees_every_byte_of_the_file_once(tmp_path: Path) -> None:
    for name, content in (
        ("a.stl", binary_stl(TETRAHEDRON) + b"tail"),
        ("a.stl", text_stl(TETRAHEDRON).encode()),
        ("a.obj", obj(TETRAHEDRON).encode() * 3),
    ):
        digest = hashlib.sha256(b"before")
        read_mesh(write(tmp_path, name, content), digest)
        assert digest.digest() == hashlib.sha256(b"before" + content).digest()


def test_memory_stays_near_that_of_the_triangles(tmp_path: Path) -> None:
    n = 150
    grid = np.arange(n * n).reshape(n, n) + 1
    faces = np.stack([grid[:-1, :-1], grid[1:, :-1], grid[1:, 1:], grid[:-1, 1:]], -1)
    lines = [f"v {i / 7} {j / 7} 0" for i in range(n) for j in range(n)]
    lines += [f"f {a} {b} {c} {d}" for a, b, c, d in faces.reshape(-1, 4).tolist()]
    path = write(tmp_path, "a.obj", "\n".join(lines))
    tracemalloc.start()
    mesh = read_mesh(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 2 * BLOCK + 600 * len(mesh.triangles)


NAN = np.where(np.arange(36).reshape(4, 3, 3) == 20, np.nan, TETRAHEDRON)


def with_count(count: int) -> bytes:
    """A binary STL whose header promises another number of triangles."""
    whole = binary_stl(TETRAHEDRON)
    return whole[:80] + count.to_bytes(4, "little") + whole[84:]


FACET = "outer loop\n" + 3 * "vertex 0 0 0\n" + "endloop\n"
DAMAGE = [
    ("a.stl", b"", "is empty"),
    ("a.stl", b"\x01" * 50, "is neither text nor binary STL: only 50 bytes"),
    ("a.stl", binary_stl(TETRAHEDRON)[:-7], "damaged: its header promises 4 tria"),
    ("a.stl", binary_stl(TETRAHEDRON[:0]), "has no triangle"),
    ("a.stl", binary_stl(NAN), "triangle 3: has a coordinate that is not a number"),
    ("a.stl", "solid a\nendsolid a\n", "has no triangle"),
    ("a.stl", text_stl(TETRAHEDRON)[:400], "is truncated"),
    ("a.stl", text_stl(TETRAHEDRON).replace("1.0", "one"), "expected 3 numbers"),
    (
        "a.stl",
        "solid\nouter loop\nvertex 0 0 0\nendloop\nendsolid",
        "has 1 corners",
    ),
    (
        "a.stl",
        "solid\n" + FACET + FACET.replace("end", "vertex 1 1 1\nend") + "endsolid\n",
        "line 12: the facet has 4 corners, expected 3",
    ),
    ("a.stl", "solid \xff".encode("latin-1"), "is truncated"),
    ("a.stl", text_stl(TETRAHEDRON).encode("utf-16"), "is UTF-16 text, expected"),
    ("a.stl", "solid a\n".encode("utf-16"), "is UTF-16 text, expected UTF-8 or"),
    ("a.stl", "facet normal 0 0 1\n" * 9, "is neither text nor binary STL"),
    ("a.stl", binary_stl(TETRAHEDRON)[:-50], "damaged: its header promises 4 tria"),
    ("a.stl", binary_stl(TETRAHEDRON) + b"x" * 50, "damaged: its header promises 4"),
    ("a.stl", with_count(0) + b"x", "damaged: its header promises 0 tria"),
    ("a.stl", with_count(5_000_001)[:84], "damaged: its header promises 5000001 tr"),
    ("a.stl", text_stl(TETRAHEDRON).replace("1.0", "1_0"), "line 5: found '0.0 1_0 "),
    ("a.obj", "v 0 0 0\n".encode("utf-16"), "is UTF-16 text, expected UTF-8 or ASC"),
    ("a.obj", "v 0 0 0\nf 1 1 \\\n\\\n9\n", "line 2: the face corner '9' names none"),
    ("a.obj", "v 0,5 0 0\n", "line 1: found '0,5 0 0', expected 3 numbers"),
    ("a.obj", "v 0 0 0\nsurf 0 1 0 1\n", "line 2: has a free-form curve or surface"),
    ("a.obj", "call b.obj\n", "line 1: takes in another file (call), expected all"),
    ("a.obj", "v" + " 0" * 600_000, "line 1: is longer than 1048576 characters"),
    ("a.obj", "v \\\n" * 550_000, "line 1: goes on for more than 1048576 char"),
    ("a.obj", "v 0 0\n", "line 1: found '0 0', expected 3 numbers"),
    ("a.obj", "v 0 0 0\nf 1 1 2\n", "line 2: the face corner '2' names none of"),
    ("a.obj", "v 0 0 0\nf 1 1 0\n", "line 2: the face corner '0' names none of"),
    ("a.obj", "v 0 0 0\nf 1 1\n", "line 2: a face has 2 corners, expected 3 or more"),
    (
        "a.obj",
        "v 0 0 0\nv 0 0 inf\nf 1 1 2\n",
        "vertex 2: has a coordinate that is not",
    ),
    ("a.obj", "hello\n", "has no triangle"),
    ("a.step", "x", "ends in '.step', expected .stl, .obj, .ply, .glb or .dae"),
]


@pytest.mark.parametrize(
    ("name", "content", "expected"), DAMAGE, ids=[case[2] for case in DAMAGE]
)
def test_damage_is_named(
    tmp_path: Path, name: str, content: str | bytes, expected: str
) -> None:
    path = write(tmp_path, name, content)
    with pytest.raises(InvalidFile) as caught:
        read_mesh(path)
    assert expected in str(caught.value)
    assert str(caught.value).startswith(str(path))
