"""Formats of meshes where other programs go other ways: by quaternions and by hand."""

import json
import struct
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from test_mesh_formats import HERE, INPUT, dae, glb, setting, triangles_of, write

from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.mesh_file import read_mesh
from vdsm_pin.io.meshes import dae as dae_format
from vdsm_pin.io.meshes.faces import cut_faces
from vdsm_pin.io.obstacle_builder import unit_vector, without_repeats


def turned(q: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Oracle: q p q* by products of quaternions, scalar last."""

    def times(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        vector = a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3])
        return np.array([*vector, a[3] * b[3] - a[:3] @ b[:3]])

    conjugate = q * [-1, -1, -1, 1]
    return times(times(q, np.array([*point, 0.0])), conjugate)[:3]


def made(
    positions: np.ndarray, faces: list[int], indices: str = "H", **node: Any
) -> bytes:
    """A GLB of one node, by hand."""
    kinds = dict(zip("bBhHIf", (5120, 5121, 5122, 5123, 5125, 5126), strict=True))
    kind = "f" if positions.dtype == np.float32 else positions.dtype.char
    skipped = node.pop("skipped", 0)
    data = b"head" + positions.tobytes() + b"\0" * (-positions.nbytes % 4)
    order = np.array(faces, indices)
    normalized = node.pop("normalized", False)
    stride = positions.itemsize * 3
    document = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, **node}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": len(data) + order.nbytes}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 4, "byteLength": positions.nbytes}
            | {"byteStride": stride},
            {"buffer": 0, "byteOffset": len(data), "byteLength": order.nbytes},
        ],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": kinds[kind],
                "byteOffset": stride * skipped,
                "count": len(positions) - skipped,
                "type": "VEC3",
                "normalized": normalized,
            },
            {
                "bufferView": 1,
                "componentType": kinds[indices],
                "count": len(order),
                "type": "SCALAR",
            },
        ],
    }
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    body = data + order.tobytes()
    body += b"\0" * (-len(body) % 4)
    chunks = struct.pack("<I", len(text)) + b"JSON" + text
    chunks += struct.pack("<I", len(body)) + b"BIN\0" + body
    return b"glTF" + struct.pack("<II", 2, 12 + len(chunks)) + chunks


CORNERS = np.array([[1, 2, 3], [4, -5, 6], [-7, 8, 9]], np.float32)


def test_an_accessor_begins_so_far_behind_its_view(tmp_path: Path) -> None:
    more = np.concatenate([np.zeros((2, 3), np.float32), CORNERS])
    content = made(more, [0, 1, 2], skipped=2)
    (found,) = triangles_of(content, tmp_path)
    np.testing.assert_array_equal(found, CORNERS)
    assert read_mesh(write(tmp_path, "a.glb", content)).bend == 0.0


@pytest.mark.parametrize("seed", range(4))
def test_a_node_of_glb_turns_by_its_quaternion(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    q, scale, shift = rng.normal(size=4), rng.uniform(0.5, 2, 3), rng.normal(size=3)
    node = {"rotation": (3.0 * q).tolist(), "scale": scale.tolist()}
    content = made(CORNERS, [0, 1, 2], **node, translation=shift.tolist())
    q /= np.linalg.norm(q)
    expected = [turned(q, scale * p) + shift for p in CORNERS.astype(float)]
    (found,) = triangles_of(content, tmp_path)
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("key", ["translation", "scale", "rotation", "matrix"])
def test_what_a_node_of_glb_does_not_state_changes_nothing(
    key: str, tmp_path: Path
) -> None:
    values: dict[str, list[float]] = {
        "translation": [1.0, 2.0, 3.0],
        "scale": [2.0, 3.0, 4.0],
        "rotation": [0.0, 0.0, 1.0, 0.0],  # half a turn about z
        "matrix": [2.0, 0, 0, 0, 0, 3, 0, 0, 0, 0, 4, 0, 1, 2, 3, 1],  # by columns
    }
    (found,) = triangles_of(made(CORNERS, [0, 1, 2], **{key: values[key]}), tmp_path)
    expected = {
        "translation": CORNERS + np.array([1, 2, 3]),
        "scale": CORNERS * [2, 3, 4],
        "rotation": CORNERS * [-1, -1, 1],
        "matrix": CORNERS * [2, 3, 4] + [1, 2, 3],
    }[key]
    np.testing.assert_allclose(found, expected, atol=1e-12)


@pytest.mark.parametrize("kind", "bBhHIf")
def test_indices_of_glb_are_of_the_three_types_without_a_sign(
    kind: str, tmp_path: Path
) -> None:
    content = made(CORNERS, [2, 0, 1], indices=kind)
    if kind.isupper():
        np.testing.assert_array_equal(
            triangles_of(content, tmp_path), [CORNERS[[2, 0, 1]]]
        )
        return
    with pytest.raises(InvalidFile):
        triangles_of(content, tmp_path)


@pytest.mark.parametrize(
    "spoiled",
    [
        lambda glb: b"glTX" + glb[4:],
        lambda glb: glb[:4] + struct.pack("<I", 3) + glb[8:],
        lambda glb: glb[:-4],
    ],
)
def test_a_glb_of_another_kind_or_cut_short_is_no_glb(
    spoiled: Callable[[bytes], bytes], tmp_path: Path
) -> None:
    with pytest.raises(InvalidFile, match="is no GLB file of version 2, or cut short"):
        triangles_of(spoiled(made(CORNERS, [0, 1, 2])), tmp_path)


def test_indices_of_glb_beyond_whole_triangles_are_left(tmp_path: Path) -> None:
    for count in (3, 4, 5):
        found = triangles_of(made(CORNERS, [0, 1, 2, 2, 1][:count]), tmp_path)
        np.testing.assert_array_equal(found, [CORNERS])


@pytest.mark.parametrize("offset", [0, 10**6])
def test_an_accessor_of_nothing_needs_no_bytes(offset: int, tmp_path: Path) -> None:
    def change(document: dict[str, Any]) -> None:
        document["accessors"][0] |= {"count": 0, "byteOffset": offset}

    with pytest.raises(InvalidFile, match="has no triangle"):
        read_mesh(write(tmp_path, "a.glb", glb(change)))


def test_whole_numbers_of_glb_are_shares_where_they_are_said_to_be(
    tmp_path: Path,
) -> None:
    shorts = np.array([[32767, 0, -32767], [-32768, 16384, 1], [5, 6, 7]], np.int16)
    for normalized, expected in (
        (True, np.maximum(shorts / 32767.0, -1.0)),
        (False, shorts.astype(float)),
    ):
        content = made(shorts, [0, 1, 2], normalized=normalized)
        (found,) = triangles_of(content, tmp_path)
        np.testing.assert_allclose(found, expected, rtol=1e-15)
    for kind in (np.int8, np.uint8, np.int16, np.uint16):
        low, high = np.iinfo(kind).min, np.iinfo(kind).max
        whole = np.array([[high, 0, 51], [low, 2, 3], [9, 8, 7]], kind)
        (found,) = triangles_of(made(whole, [0, 1, 2]), tmp_path)
        np.testing.assert_array_equal(found, whole)
    bytes_ = np.array([[255, 0, 51], [1, 2, 3], [9, 8, 7]], np.uint8)
    (found,) = triangles_of(made(bytes_, [0, 1, 2], normalized=True), tmp_path)
    np.testing.assert_allclose(found, bytes_ / 255.0, rtol=1e-15)
    content = made(CORNERS, [0, 1, 2], normalized=True)
    np.testing.assert_array_equal(triangles_of(content, tmp_path), [CORNERS])


def test_a_chunk_of_glb_that_promises_more_than_there_is(tmp_path: Path) -> None:
    content = bytearray(made(CORNERS, [0, 1, 2]))
    size = int.from_bytes(content[12:16], "little")
    at = 20 + size
    there = int.from_bytes(content[at : at + 4], "little")
    content[at : at + 4] = (there + 1).to_bytes(4, "little")
    with pytest.raises(InvalidFile, match=f"a chunk promises {there + 1} bytes, fewer"):
        read_mesh(write(tmp_path, "a.glb", bytes(content)))
    other = made(CORNERS, [0, 1, 2])  # an unknown chunk behind the others is no matter
    more = struct.pack("<I", 4) + b"MORE" + b"1234"
    longer = other[:8] + struct.pack("<I", len(other) + len(more)) + other[12:] + more
    np.testing.assert_array_equal(triangles_of(longer, tmp_path), [CORNERS])


def test_glb_by_hand_and_by_trimesh_are_read_alike(tmp_path: Path) -> None:
    ours = triangles_of(glb(setting("asset", "generator", "hand")), tmp_path)
    assert len(ours) == 12


@pytest.mark.parametrize(
    ("faces", "count"),
    [
        ("<vcount>2 3 0 1</vcount><p>0 1 0 1 2 3</p>", 1),
        ("<vcount>3</vcount><p>0 1 2</p>", 1),
    ],
)
def test_faces_of_dae_with_too_few_corners_are_left_out(
    faces: str, count: int, tmp_path: Path
) -> None:
    root = f"<polylist>{INPUT}{faces}</polylist>"
    mesh = read_mesh(write(tmp_path, "a.dae", dae(HERE, root=root)))
    assert len(mesh.triangles) == count


@pytest.mark.parametrize("before", ['offset="0"/>', 'stride="3"', 'count="4" st'])
def test_numbers_of_dae_are_not_left_blank(before: str, tmp_path: Path) -> None:
    name, _, rest = before.split('"')
    text = dae(HERE).replace(before, f'{name}""{rest}', 1)
    with pytest.raises(InvalidFile, match="where numbers are meant"):
        read_mesh(write(tmp_path, "a.dae", text))


@pytest.mark.parametrize("counts", ["-1 4", "4 -1", "3 1", "2"])
def test_faces_of_dae_have_as_many_corners_as_are_counted(
    counts: str, tmp_path: Path
) -> None:
    root = f"<polylist>{INPUT}<vcount>{counts}</vcount><p>0 1 2</p></polylist>"
    with pytest.raises(InvalidFile, match="names vertices that are not there, or is"):
        read_mesh(write(tmp_path, "a.dae", dae(HERE, root=root)))


@pytest.mark.parametrize("stride", [1, 2, 5, 64])
def test_corners_of_dae_have_as_many_numbers_as_inputs(
    stride: int, tmp_path: Path
) -> None:
    more = "".join(
        f'<input semantic="TEXCOORD" source="#s" offset="{k}"/>'
        for k in range(1, stride)
    )
    numbers = " ".join(
        " ".join([str(v), *["7"] * (stride - 1)]) for v in (0, 1, 2, 0, 2, 3)
    )
    root = f'<triangles count="2">{INPUT}{more}<p>{numbers}</p></triangles>'
    mesh = read_mesh(write(tmp_path, "a.dae", dae(HERE, root=root)))
    np.testing.assert_array_equal(
        mesh.vertices[mesh.triangles][0], [[0, 0, 0], [1, 0, 0], [0, 1, 0]]
    )
    assert len(mesh.triangles) == 2


def test_a_dae_is_as_large_as_it_may_be(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = write(tmp_path, "a.dae", dae(HERE))
    monkeypatch.setattr(dae_format, "MAX_BYTES", file.stat().st_size)
    assert len(read_mesh(file).triangles) == 4
    monkeypatch.setattr(dae_format, "MAX_BYTES", file.stat().st_size - 1)
    with pytest.raises(InvalidFile, match="is larger than"):
        read_mesh(file)


@pytest.mark.parametrize("far", [1 << 40, -(1 << 40), 1 << 70])
def test_corners_of_dae_are_no_huge_numbers(tmp_path: Path, far: int) -> None:
    root = f'<triangles count="1">{INPUT}<p>0 1 {far}</p></triangles>'
    with pytest.raises(InvalidFile, match="where numbers are meant"):
        read_mesh(write(tmp_path, "a.dae", dae(HERE, root=root)))


def test_a_note_of_dae_counts_the_parts_that_have_it(tmp_path: Path) -> None:
    lines = f"<lines>{INPUT}<p>0 1</p></lines>"
    triangles = f'<triangles count="1">{INPUT}<p>0 1 2</p></triangles>'
    mesh = read_mesh(
        write(tmp_path, "a.dae", dae(HERE, root=triangles + lines + lines))
    )
    assert mesh.notes == ("lines and points left out: 2",)


@pytest.mark.parametrize("n", [4, 5, 7, 12])
def test_a_concave_face_is_cut_into_all_of_itself(n: int) -> None:
    """Oracle: the shoelace formula; every triangle has the sense of the face."""
    rng = np.random.default_rng(n)
    turn = np.sort(rng.uniform(0, 2 * np.pi, n))
    turn = np.linspace(0, 2 * np.pi, n, endpoint=False)
    radius = np.where(np.arange(n) % 2 == 0, 1.0, 0.35)
    flat = np.stack([radius * np.cos(turn), radius * np.sin(turn)], axis=1)
    points = np.column_stack([flat, np.zeros(n)])
    cut = cut_faces(points, np.arange(n), np.array([n]))
    assert len(cut.triangles) == n - 2
    corners = flat[cut.triangles]
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    areas = 0.5 * (a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])
    ring = [*flat.tolist(), flat[0].tolist()]
    whole = 0.5 * sum(p[0] * q[1] - p[1] * q[0] for p, q in pairwise(ring))
    assert (areas > 0.0).all()
    assert areas.sum() == pytest.approx(whole, rel=1e-12)


@pytest.mark.parametrize("bad", [0.0, np.inf, np.nan])
def test_a_direction_needs_a_length(bad: float) -> None:
    assert unit_vector(np.array([bad, 0.0, 0.0])) is None
    assert unit_vector(np.array([1e-300, 0.0, 0.0])) is not None
    found = unit_vector(np.array([1e300, -1e300, 0.0]))
    assert found is not None
    np.testing.assert_allclose(found, np.array([1, -1, 0]) / np.sqrt(2.0), rtol=1e-15)


def test_repeats_are_left_out_and_the_last_of_a_closed_line() -> None:
    a, b, c = [0.0, 0.0], [1.0, 0.0], [1.0, 1.0]
    for points, closed, kept in (
        ([a, b, b, c], False, [a, b, c]),
        ([a, b, c, a], False, [a, b, c, a]),
        ([a, b, c, a], True, [a, b, c]),
        ([a, a], True, [a]),
        ([a], True, [a]),
        ([a, b, a], True, [a, b]),
    ):
        found = without_repeats(np.array(points), closed=closed)
        assert found.tolist() == kept


@pytest.mark.parametrize("encoding", ["ascii", "binary_little_endian"])
@pytest.mark.parametrize(
    ("doubled", "said"),
    [
        ("property float y", r"line 6: has the property 'y' twice"),
        ("element vertex 3", r"line 6: has the element 'vertex' twice"),
    ],
)
def test_a_name_that_a_ply_has_twice_is_refused(
    encoding: str, doubled: str, said: str, tmp_path: Path
) -> None:
    """Which of the two is meant nobody can know."""
    head = ["ply", f"format {encoding} 1.0", "element vertex 3"]
    head += ["property float x", "property float y", doubled, "property float z"]
    head += ["element face 1", "property list uchar int vertex_indices", "end_header"]
    with pytest.raises(InvalidFile, match=said):
        read_mesh(write(tmp_path, "a.ply", "\n".join(head) + "\n" + "0 " * 60))


def test_strips_and_fans_are_unrolled_as_they_turn(tmp_path: Path) -> None:
    """Of a strip every other triangle is named the other way round; a fan has none."""
    strip = [[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5], [4, 5, 6]]
    fan = [[0, k, k + 1] for k in range(1, 6)]
    points = np.random.default_rng(0).normal(size=(7, 3)).astype(np.float32)
    order = " ".join(map(str, range(7)))
    for kind, mode, triangles in (("tristrips", 5, strip), ("trifans", 6, fan)):
        content = made(points, list(range(7))).replace(
            b'"indices": 1}', f'"mode":{mode:5}}}'.encode()
        )
        root = f"<{kind}>{INPUT}<p>{order}</p></{kind}>"
        numbers = " ".join(map(repr, points.astype(float).ravel().tolist()))
        text = dae(HERE, root=root).replace("0 0 0 1 0 0 0 1 0 0 0 1", numbers)
        text = text.replace('count="4" st', 'count="7" st')
        for name, data in (("a.glb", content), ("a.dae", text)):
            mesh = read_mesh(write(tmp_path, name, data))
            found = {cycle(t) for t in mesh.vertices[mesh.triangles].tolist()}
            expected = {cycle(t) for t in points.astype(float)[triangles].tolist()}
            assert found == expected


def cycle(triangle: list[list[float]]) -> tuple[tuple[float, ...], ...]:
    """A triangle from its least corner on, the same way round."""
    a, b, c = map(tuple, triangle)
    return min((a, b, c), (b, c, a), (c, a, b))


@pytest.mark.parametrize("corner", ["x", "", "1.0", "1_0", "0", "4", "-4", "/1", "1e0"])
def test_a_corner_of_obj_names_a_vertex_above(corner: str, tmp_path: Path) -> None:
    text = f"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 {corner or '//'}\n"
    with pytest.raises(InvalidFile, match="line 4: the face corner"):
        read_mesh(write(tmp_path, "a.obj", text))


def test_a_note_of_dae_counts_the_lists_that_cross_themselves(tmp_path: Path) -> None:
    crossed = f"<polygons>{INPUT}<p>0 1 2 0 2 1</p></polygons>"
    bow = f"<polylist>{INPUT}<vcount>4</vcount><p>0 1 2 3</p></polylist>"
    text = dae(HERE, root=bow * 2 + crossed).replace(
        "0 0 0 1 0 0 0 1 0 0 0 1", "0 0 0 1 1 0 1 0 0 0 1 0"
    )
    notes = read_mesh(write(tmp_path, "a.dae", text)).notes
    assert notes[0] == "1 face crosses itself and may be covered too widely: 3"


@pytest.mark.parametrize("place", range(16))
@pytest.mark.parametrize("value", [5e11, 2e12, float("nan")])
def test_a_place_of_a_part_is_affine_and_finite(
    place: int, value: float, tmp_path: Path
) -> None:
    """One number of a matrix is large, or too large, or none."""
    matrix = np.eye(4)
    matrix.flat[place] = value
    numbers = " ".join(map(repr, matrix.ravel().tolist()))
    node = HERE.replace("<instance", f"<matrix>{numbers}</matrix><instance")
    path = write(tmp_path, "a.dae", dae(node))
    if value == 5e11 and place < 12:
        assert len(read_mesh(path).triangles) == 4
        return
    with pytest.raises(InvalidFile, match="not affine or not finite"):
        read_mesh(path)


def test_places_of_parts_multiply_up_to_a_size(tmp_path: Path) -> None:
    """1e16 is too large on the way, though a smaller node stands below it."""
    scale = "<scale>{0} {0} {0}</scale>"
    for sizes, good in (((1e6, 1e5, 1e-9), True), ((1e8, 1e8, 1e-15), False)):
        begin = "".join(f"<node>{scale.format(size)}" for size in sizes)
        text = dae(begin + HERE + "</node>" * 3)
        path = write(tmp_path, "a.dae", text)
        if good:
            assert read_mesh(path).vertices.max() == pytest.approx(100.0)
            continue
        with pytest.raises(InvalidFile, match="not affine or not finite"):
            read_mesh(path)
