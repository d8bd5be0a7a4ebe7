"""Point clouds and voxels: all formats give the same points, odd files a message."""

import hashlib
import struct
from pathlib import Path

import numpy as np
import pytest

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.solids import PointCloud, Voxels
from vdsm_pin.io.clouds import RawCloud, read_cloud
from vdsm_pin.io.meshes.raw import MAX_CORNERS
from vdsm_pin.io.pcd import _from_lzf
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.inputs import assumed_sizes, input_notes

POINTS = np.array([[0.5, -1.25, 3.0], [1e-3, 2.0, -7.5], [100.0, 0.0, 0.125]])
SINGLE = POINTS.astype(np.float32)


def pcd(data: str, body: bytes, points: int = 3, fields: str = "x y z") -> bytes:
    n = len(fields.split())
    text = (
        f"# .PCD v0.7\nVERSION 0.7\nFIELDS {fields}\nSIZE {'4 ' * n}\n"
        f"TYPE {'F ' * n}\nCOUNT {'1 ' * n}\nWIDTH {points}\nHEIGHT 1\n"
        f"VIEWPOINT 0 0 0 1 0 0 0\nPOINTS {points}\nDATA {data}\n"
    )
    return text.encode() + body


def literal_lzf(data: bytes) -> bytes:
    """Packed without any copies: the simplest writer of the format."""
    parts = [data[i : i + 32] for i in range(0, len(data), 32)]
    return b"".join(bytes([len(part) - 1]) + part for part in parts)


def compressed(data: bytes) -> bytes:
    packed = literal_lzf(data)
    return struct.pack("<II", len(packed), len(data)) + packed


def npy(path: Path, array: np.ndarray) -> bytes:
    np.save(path, array)
    return path.read_bytes()


def lines(rows: np.ndarray, between: str = " ") -> bytes:
    return "".join(between.join(map(repr, r)) + "\n" for r in rows.tolist()).encode()


def ply(form: str, body: bytes) -> bytes:
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    return (
        f"ply\nformat {form} 1.0\nelement vertex 3\n{axes}end_header\n".encode() + body
    )


FILES = {
    "a.xyz": lines(POINTS),
    "b.txt": b"# remark\n\n" + lines(POINTS, "\t") + b"// more\n",
    "c.csv": b"x,y,z\n" + lines(POINTS, ", "),
    "quoted.csv": b'"x","y","z"\n' + lines(POINTS, ","),
    "quotes.csv": b'"x","y","z"\n' + lines(POINTS, ",").replace(b"100.0", b'"100.0"'),
    "mac.xyz": (lines(POINTS[:1]) + b"# one\n" + lines(POINTS[1:])).replace(
        b"\n", b"\r"
    ),
    "next.csv": b"x,y,z\n# \xc3\x85 1 2 3\n" + lines(POINTS, ", "),
    "count.xyz": b"3\n" + lines(POINTS),
    "d.xyz": lines(np.hstack([POINTS, np.ones((3, 3))])),
    "e.pcd": pcd("ascii", lines(POINTS)),
    "f.pcd": pcd("binary", SINGLE.tobytes()),
    "g.pcd": pcd("binary_compressed", compressed(SINGLE.T.tobytes())),
    "i.pcd": pcd(
        "binary",
        np.hstack([np.zeros((3, 1), np.float32), SINGLE]).tobytes(),
        fields="rgb x y z",
    ),
    "j.ply": ply("ascii", lines(POINTS)),
    "k.ply": ply("binary_big_endian", SINGLE.astype(">f4").tobytes()),
}


def read(path: Path, content: bytes) -> RawCloud:
    path.write_bytes(content)
    digest = hashlib.sha256()
    cloud = read_cloud(path, digest)
    assert digest.hexdigest() == hashlib.sha256(content).hexdigest()
    return cloud


@pytest.mark.parametrize("name", FILES)
def test_every_format_has_the_same_points(tmp_path: Path, name: str) -> None:
    found = read(tmp_path / name, FILES[name]).points
    exact = np.array_equal(found, POINTS) or np.array_equal(found, SINGLE)
    assert exact


@pytest.mark.parametrize("odd", ["-nan(ind)", "1.#QNAN", "none"])
def test_values_beside_the_coordinates_may_be_any_words(
    tmp_path: Path, odd: str
) -> None:
    rows = [row.split() for row in lines(POINTS).decode().splitlines()]
    body = "\n".join(f"{odd} {x} {y} 0.5 {z}" for x, y, z in rows)
    content = pcd("ascii", body.encode(), fields="normal x y intensity z")
    assert np.array_equal(read(tmp_path / "a.pcd", content).points, POINTS)
    wrong = body.replace("0.5", "0.5 7", 1)
    content = pcd("ascii", wrong.encode(), fields="normal x y intensity z")
    with pytest.raises(InvalidFile, match=r"line 12: has 6 values, expected 5"):
        read(tmp_path / "a.pcd", content)


def test_blank_lines_in_the_header_of_a_pcd_say_nothing(tmp_path: Path) -> None:
    """As in PCL's reader."""
    content = pcd("ascii", lines(POINTS)).replace(b"VERSION", b"\n\nVERSION")
    for more in (b"", b"\n", b"\n# one\n"):
        assert np.array_equal(read(tmp_path / "a.pcd", more + content).points, POINTS)
    for nothing in (b"\n", b"\n" * 99):
        with pytest.raises(InvalidFile, match="is no PCD file: no line DATA"):
            read(tmp_path / "a.pcd", nothing)


def test_arrays_are_points_or_cells(tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    assert np.array_equal(read(path, npy(path, POINTS)).points, POINTS)
    grid = np.zeros((2, 3, 4), np.bool_)
    grid[1, 2, 3] = grid[0, 0, 0] = True
    cells = read(path, npy(path, grid))
    assert cells.grid
    assert cells.points.tolist() == [[0.5, 0.5, 0.5], [1.5, 2.5, 3.5]]


def test_points_without_a_measurement_are_told(tmp_path: Path) -> None:
    holes = np.vstack([POINTS, [[np.nan, 0.0, 0.0]]])
    path = tmp_path / "a.npy"
    cloud = read(path, npy(path, holes))
    assert np.array_equal(cloud.points, POINTS)
    assert cloud.notes == ("points without a measurement (NaN) left out: 1",)


def copying_lzf(data: bytes, rng: np.random.Generator) -> bytes:
    """Packed with a copy, near or far, wherever three bytes were there before."""
    packed, at = b"", 0
    while at < len(data):
        farthest = max(at - 8192, 0)
        places = [data.find(data[at : at + 3], farthest, at + 2)]
        places.append(data.rfind(data[at : at + 3], farthest, at + 2))
        back = at - places[int(rng.integers(2))] - 1
        length = 0
        while length < 264 and at + length < len(data):
            if data[at + length] != data[at + length - back - 1]:
                break
            length += 1
        if places[0] < 0 or length < 3:
            packed, at = packed + bytes([0, data[at]]), at + 1
            continue
        at, length = at + length, length - 2
        head = min(length, 7) << 5 | back >> 8
        more = [length - 7] if length >= 7 else []
        packed += bytes([head, *more, back & 255])
    return packed


@pytest.mark.parametrize("seed", range(6))
def test_copies_of_what_came_before_are_unpacked(seed: int) -> None:
    """A writer of every kind of copy; what is cut short is not of the size promised."""
    rng = np.random.default_rng(seed)
    words = [rng.bytes(int(rng.integers(1, 12))) for _ in range(5)]
    data = b"".join(
        words[k] * int(rng.integers(1, 60)) for k in rng.integers(5, size=40)
    )
    data = data + rng.bytes(seed * 2000) + data[:3000]
    packed = copying_lzf(data, rng)
    assert _from_lzf(packed, len(data)) == data
    assert _from_lzf(literal_lzf(data), len(data)) == data
    for end in range(0, len(packed), 1 + len(packed) // 60):
        assert len(_from_lzf(packed[:end], len(data))) < len(data)


@pytest.mark.parametrize(
    "packed",
    [
        bytes([0, 7, 1 << 5, 1]),  # from before the beginning
        bytes([0, 7, 1 << 5]),  # without the place of the copy
        bytes([0, 7, 7 << 5, 1]),  # a long one without it
    ],
)
def test_copies_of_nothing_are_damage(packed: bytes) -> None:
    assert _from_lzf(packed, 100) == b""


@pytest.mark.parametrize(
    ("frame", "expected"),
    [
        ("0 0 0 1.0 0 -0 0", None),
        ("0 0 0.5 1 0 0 0", "has the VIEWPOINT 0 0 0.5 1 0 0 0, which may place"),
        ("0 0 0 0.6 0.8 0 0", "has the VIEWPOINT"),
        ("0 0 0 nan 0 0 0", "has the VIEWPOINT"),
        ("0 0 0 1", "expected 7 numbers"),
    ],
)
def test_points_that_a_viewpoint_may_move_are_refused(
    tmp_path: Path, frame: str, expected: str | None
) -> None:
    content = pcd("ascii", lines(SINGLE)).replace(b"0 0 0 1 0 0 0", frame.encode())
    if expected is None:
        assert read(tmp_path / "a.pcd", content).points.tolist() == SINGLE.tolist()
        return
    with pytest.raises(InvalidFile) as caught:
        read(tmp_path / "a.pcd", content)
    assert expected in str(caught.value)


PCD_KINDS = {
    **{f"I{n}": f"<i{n}" for n in (1, 2, 4, 8)},
    **{f"U{n}": f"<u{n}" for n in (1, 2, 4, 8)},
    **{f"F{n}": f"<f{n}" for n in (4, 8)},
}


@pytest.mark.parametrize("form", ["ascii", "binary", "binary_compressed"])
@pytest.mark.parametrize("seed", range(8))
def test_pcd_of_any_fields_is_what_numpy_reads(
    form: str, seed: int, tmp_path: Path
) -> None:
    """Oracle: a structured array of numpy, other fields before, between and behind."""
    rng = np.random.default_rng(seed)
    names = rng.permutation(["x", "y", "z", "rgb", "normal"]).tolist()
    kinds = [str(kind) for kind in rng.choice(list(PCD_KINDS), 5)]
    counts = [1 if name in "xyz" else int(rng.integers(1, 4)) for name in names]
    fields = [
        (n, PCD_KINDS[k], (c,)) for n, k, c in zip(names, kinds, counts, strict=True)
    ]
    table = np.zeros(9, np.dtype(fields))
    for name in names:
        shape, sign = table[name].shape, table[name].dtype.kind
        low, high = (0, 250) if sign == "u" else (-120, 120)
        table[name] = rng.integers(low, high, shape)
    columns = b"".join(table[name].tobytes() for name in names)
    rows = [" ".join(f"{v:g}" for name in names for v in row[name]) for row in table]
    body = {
        "ascii": "\n".join(rows).encode() + b"\n",
        "binary": table.tobytes(),
        "binary_compressed": struct.pack(
            "<II", len(packed := copying_lzf(columns, rng)), len(columns)
        ) + packed,
    }[form]  # fmt: skip
    text = (
        f"VERSION .7\nFIELDS {' '.join(names)}\nSIZE {' '.join(k[1] for k in kinds)}\n"
        f"TYPE {' '.join(k[0] for k in kinds)}\nCOUNT {' '.join(map(str, counts))}\n"
        f"WIDTH 3\nHEIGHT 3\nPOINTS 9\nDATA {form}\n"
    )
    found = read(tmp_path / "a.pcd", text.encode() + body).points
    expected = np.column_stack([table[axis][:, 0] for axis in "xyz"])
    np.testing.assert_array_equal(found, expected)


PCD_HEADER = {
    "FIELDS": "x y z", "SIZE": "4 4 4", "TYPE": "F F F", "COUNT": "1 1 1",
    "POINTS": "1", "DATA": "ascii",
}  # fmt: skip


@pytest.mark.parametrize(
    ("key", "value", "good"),
    [
        ("FIELDS", "x y", False),
        ("FIELDS", "x y z x", False),
        ("FIELDS", "x y y", False),
        ("SIZE", "4 4 3", False),
        ("SIZE", "4 4 -4", False),
        ("SIZE", "4 4 2", False),  # floating numbers of two bytes, or of one
        ("SIZE", "4 4 1", False),
        ("SIZE", "4 4 8", True),
        ("TYPE", "F F D", False),
        ("TYPE", "I U F", True),
        ("COUNT", "1 1", False),
        ("COUNT", None, True),
        ("POINTS", None, False),
        ("POINTS", "1 1", False),
        ("POINTS", "00000000001", True),
        ("POINTS", "000000000001", False),
        ("DATA", "text", False),
        ("HEIGHT", "1", True),
    ],
)
def test_headers_of_pcd_are_whole_or_refused(
    key: str, value: str | None, good: bool, tmp_path: Path
) -> None:
    said = {key: value} | PCD_HEADER | {key: value}
    lines = [f"{k} {v}" for k, v in said.items() if v is not None and k != "DATA"]
    text = "\n".join([*lines, f"DATA {said['DATA']}", "1 2 3", ""])
    if good:
        assert read(tmp_path / "a.pcd", text.encode()).points.tolist() == [[1, 2, 3]]
        return
    with pytest.raises(InvalidFile, match="no PCD's"):
        read(tmp_path / "a.pcd", text.encode())


ANNOUNCED = [
    name for name in FILES if name[:-4] == "count" or name[-3:] in ("pcd", "ply")
]


@pytest.mark.parametrize("name", [*ANNOUNCED, "m.npy"])
def test_no_point_beyond_those_announced_is_left_out(tmp_path: Path, name: str) -> None:
    """Fewer announced, or one byte or line more: refused, never dropped."""
    content = FILES.get(name) or npy(tmp_path / name, POINTS)
    fewer = {
        "xyz": [(b"3\n", b"2\n")],
        "pcd": [(b"WIDTH 3", b"WIDTH 2"), (b"POINTS 3", b"POINTS 2")],
        "ply": [(b"vertex 3", b"vertex 2")],
        "npy": [(b"(3, 3)", b"(2, 3)")],
    }[name[-3:]]
    text = name in ("count.xyz", "e.pcd", "j.ply")
    odd = [content + more for more in ((b"1 2 3\n",) if text else (b"1", b"\0\1"))]
    if not text:  # PCL fills the last page of memory with zeros
        filled = read(tmp_path / name, content + bytes(4087)).points
        np.testing.assert_array_equal(filled, read(tmp_path / name, content).points)
        odd.append(content + bytes(1 << 17))
    for old, new in fewer:
        assert old in content
        odd.append(content.replace(old, new, 1))
    less = content
    for old, new in fewer:
        less = less.replace(old, new, 1)
    for damaged in (*odd, less):
        with pytest.raises(InvalidFile):
            read(tmp_path / name, damaged)


def test_a_pcd_without_points_has_width_times_height(tmp_path: Path) -> None:
    grid = np.vstack([POINTS, POINTS + 1.0])
    head = pcd("ascii", lines(grid)).replace(b"POINTS 3\n", b"")
    sides = head.replace(b"WIDTH 3\nHEIGHT 1", b"WIDTH 2\nHEIGHT 3")
    assert np.array_equal(read(tmp_path / "a.pcd", sides).points, grid)
    with pytest.raises(InvalidFile, match="more data than its header announces: 3 po"):
        read(tmp_path / "a.pcd", head)
    odd = sides.replace(b"VIEWPOINT", b"POINTS 5\nVIEWPOINT")
    with pytest.raises(InvalidFile, match="has WIDTH x HEIGHT = 6, but POINTS 5"):
        read(tmp_path / "a.pcd", odd)


def test_odd_lines_of_points_are_told_apart(tmp_path: Path) -> None:
    """The first line may be a title or a number of points, and no other."""
    path = tmp_path / "a.xyz"
    for first in (b"2", b"x y z", b"x_m,y_m,z_m,i", b"# 7"):
        found = read(path, first + b"\n1 2 3 # one\n\n4;5;6;7 // two\n").points
        assert found.tolist() == [[1, 2, 3], [4, 5, 6]]
    for text in (b"1 2 3\n2\n", b"1 2 3\nx y z\n", b"1 2\n", b"1 2 y\n"):
        with pytest.raises(InvalidFile, match=r"line \d: found"):
            read(path, text)


BAD = {
    "many.pcd": (
        pcd("ascii", b"", MAX_CORNERS + 1),
        f"has more than {MAX_CORNERS} ver",
    ),
    "a.las": (b"x", "ends in '.las', expected .ply, .pcd"),
    "b.xyz": (b"1 2\n", "line 1: found '1 2', expected 3 numbers"),
    "c.xyz": (b"1 2 3\n1 b 3\n", "line 2: found '1 b 3', expected 3 numbers"),
    "d.xyz": (b"1,5 2,5 3,5\n", "has commas inside numbers"),
    "e.csv": (b"1,5;2,5;3,5\n", "has commas inside numbers"),
    "q.csv": (b'"x";"y";"z"\n"1,5";"2,5";"3,5"\n', "line 2: found"),
    "r.csv": (b'"1,5","2,5","3,5"\n' * 2, "line 1: found"),
    "s.csv": (b'1,2,3\n"",,\n', "line 2: found"),
    "f.csv": (b"x,y,z\n1,5,0,3,2,1\n", "line 2: has another number of commas"),
    "g.csv": (b"0,0,3\n1,5,0,3\n", "line 2: has another number of commas"),
    "f.xyz": (b"# nothing\n", "has no point"),
    "g.xyz": (b"1 2 inf\n", "point 1: has a coordinate that is not a number"),
    "h.xyz": (b"nan nan nan\n", "has no point"),
    "i.npy": (b"no", "is no array of numbers"),
    "i.csv": (b"i,x,y,z\n0,1,2,3\n", "line 1: has the columns i x y z"),
    "i.txt": (b"x z y\n1 2 3\n", "expected x, y and z first"),
    "j.pcd": (b"DATA binary\n", "has a header that is no PCD's"),
    "k.pcd": (b"hello\n" * 300, "no line DATA"),
    "l.pcd": (pcd("binary", b"123"), "promises 3 points"),
    "m.pcd": (pcd("ascii", b"1 2 3\n1 2\n1 2 3\n"), "line 13: has 2 values"),
    "n.pcd": (pcd("binary_compressed", b"12345678"), "promises 3 points"),
    "o.pcd": (pcd("binary", b"", 999999999999), "no PCD's"),
    "p.pcd": (
        pcd("binary_compressed", struct.pack("<II", 4, 36) + b"\xff\x00\x00\x01"),
        "compressed data that is damaged",
    ),
    **{
        f"count{k}.pcd": (
            pcd("binary", b"0" * 36).replace(b"COUNT 1", b"COUNT %d" % count),
            "expected FIELDS with x y z, SIZE, TYPE, COUNT from 1",
        )
        for k, count in enumerate((0, 1 << 20, (1 << 31) - 1, 10**10))
    },
    **{
        f"head{k}.npy": (
            b"\x93NUMPY\x01\0" + struct.pack("<H", len(head)) + head,
            "is no array of numbers",
        )
        for k, head in enumerate(
            (
                b"(",
                b"-" * 5000 + b"1",
                b"{b'descr': 1, 'shape': 2}",
                b"{'descr': '<f8', 'fortran_order': False, 'shape': (True, 3)}",
                b"{'descr': '<f8', 'fortran_order': False, 'shape': (1%s, 3)}"
                % (b"0" * 30),
            )
        )
    },
    "zip.npy": (b"PK\x03\x04" + bytes(40), "is no array of numbers: it is no NPY file"),
    "q.ply": (FILES["j.ply"].replace(b"float z", b"float w"), "has no x, y, z"),
    "r.pcd": (pcd("ascii", b"", 0), "has no point"),
    "s.pcd": (pcd("ascii", lines(np.hstack([POINTS, POINTS]))), "line 12: has 6 val"),
    "t.xyz": (b"3\n1 2 3\n1 2 3\n", "line 1: announces 3 points, 2 follow"),
    "u.xyz": (b"0.5\n1 2 3\n", "line 1: found '0.5', expected 3 numbers"),
}


@pytest.mark.parametrize("name", BAD)
def test_odd_files_are_refused_in_one_sentence(tmp_path: Path, name: str) -> None:
    content, expected = BAD[name]
    with pytest.raises(InvalidFile) as caught:
        read(tmp_path / name, content)
    assert expected in str(caught.value)


def test_arrays_of_other_shapes_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    odd = (
        np.zeros(3),
        np.zeros((3, 2)),
        np.zeros((3, 7)),  # points in columns
        np.zeros((200, 200), np.uint8),  # a map of two dimensions
        np.zeros((5, 3), np.bool_),
        np.full((1, 1, 1), 2),
        np.zeros((2, 2, 2)),
        np.array([["a", "b", "c"]]),
    )
    for array in odd:
        with pytest.raises(InvalidFile):
            read(path, npy(path, array))


def test_damaged_files_never_end_in_a_traceback(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    files = [*FILES.items(), ("z.npy", npy(tmp_path / "z.npy", POINTS))]
    for name, content in files:
        for _ in range(40):
            data = bytearray(content)
            for _ in range(int(rng.integers(1, 4))):
                data[int(rng.integers(len(data)))] = int(rng.integers(256))
            cut = int(rng.integers(1, len(data) + 1))
            (tmp_path / name).write_bytes(bytes(data[:cut]))
            try:
                cloud = read_cloud(tmp_path / name, hashlib.sha256())
            except InvalidFile:
                continue
            assert np.isfinite(cloud.points).all()


PROBLEM = """\
vdsm_problem: 1
length_unit: mm
manipulator: hrm8
base: {position: [10, 20, 30], rpy_deg: [0, 0, 90]}
obstacles:
  - OBSTACLE
required_clearance: 1
"""


def problem(folder: Path, obstacle: str) -> Path:
    path = folder / "p.yaml"
    path.write_text(PROBLEM.replace("OBSTACLE", obstacle))
    return path


def test_points_stand_where_a_mesh_with_their_corners_would(tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_bytes(lines(POINTS))
    text = (
        "{name: scan, shape: points, file: a.xyz, scale: 10, center: [1, 2, 3], "
        "rpy_deg: [0, 0, 90], radius: 2}"
    )
    found = read_problem(problem(tmp_path, text))
    (cloud,) = found.scene.obstacles
    assert isinstance(cloud, PointCloud)
    x, y, z = (10.0 * POINTS).T
    file = np.column_stack([1.0 - y, 2.0 + x, 3.0 + z]) - [10.0, 20.0, 30.0]
    base = np.column_stack([file[:, 1], -file[:, 0], file[:, 2]]) / 1000.0
    np.testing.assert_allclose(cloud.points, base, atol=1e-15)
    assert cloud.radius == 0.002
    assert len(cloud.pieces) == 3
    assert cloud.pieces[1].radius == 0.002


def test_a_cloud_without_unit_says_what_was_assumed(tmp_path: Path) -> None:
    (tmp_path / "a.xyz").write_bytes(lines(100.0 * POINTS) + b"nan 0 0\n")
    text = "{name: scan, shape: points, file: a.xyz, radius: 2, check_size: false}"
    found = read_problem(problem(tmp_path, text))
    assert assumed_sizes(found) == ("'scan' is 1e+04 x 325 x 1050 mm",)
    none = Trajectory(*(np.zeros(1) for _ in range(3)), *np.zeros((2, 1, 8)))
    assert any("cloud 'scan': points" in note for note in input_notes(found, none))


def test_a_grid_has_its_cells_and_no_unit_of_its_own(tmp_path: Path) -> None:
    grid = np.zeros((2, 1, 1), np.uint8)
    grid[1] = 1
    np.save(tmp_path / "a.npy", grid)
    text = "{name: map, shape: voxels, file: a.npy, size: [100, 40, 20]}"
    found = read_problem(problem(tmp_path, text))
    (cells,) = found.scene.obstacles
    assert isinstance(cells, Voxels)
    corners = cells.pieces[0].points
    low, high = corners.min(axis=0), corners.max(axis=0)
    # In the file's frame x from 100 to 200, y 0 to 40, z 0 to 20.
    np.testing.assert_allclose(low, [-0.02, -0.19, -0.03], atol=1e-15)
    np.testing.assert_allclose(high, [0.02, -0.09, -0.01], atol=1e-15)
    assert assumed_sizes(found) == ()
    for odd in ("length_unit: m", "scale: 2"):
        with pytest.raises(InvalidFile, match="is a grid, whose cells"):
            read_problem(problem(tmp_path, text.replace("}", f", {odd}}}")))
    points = "{name: map, shape: points, file: a.npy, radius: 1}"
    with pytest.raises(InvalidFile, match="expected points, or shape: voxels"):
        read_problem(problem(tmp_path, points))
