"""Files as programs write them, in hundreds of ways, and what is in them.

Oracles: the numbers that were written, trimesh, the csv and yaml modules. Run as a
program it does the same within a limit of memory:

    python tests/io/reader_variants.py SEED COUNT MIBIBYTES
"""

import csv
import io
import json
import resource
import sys
import tempfile
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
import yaml
from mutations import changed_bytes
from problem_texts import binary_stl

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.errors import InvalidInput
from vdsm_pin.io.mesh_file import read_mesh
from vdsm_pin.io.trajectory_file import column_names, read_trajectory
from vdsm_pin.io.yaml_reader import read_yaml

Rng = np.random.Generator
ENDS = ("\n", "\r\n", "\r")
REMARKS = ("Gehäuse", "корпус", "x\u2028y", "C:\\", "1 2 3", "")
HUGE = (0xFFFFFFFF, 0xFFFFFFFE, 10**9, 2**31, 10**7)


def picked(rng: Rng, options: Any) -> Any:
    return options[int(rng.integers(len(options)))]


def solid(rng: Rng) -> trimesh.Trimesh:
    make = trimesh.creation
    shape = picked(rng, (make.box(), make.icosphere(1), make.annulus(0.2, 0.5, 1.0)))
    corners = shape.vertices * rng.uniform(0.1, 1e3) + rng.normal(size=3)
    vertices = corners.astype("f4").astype(float)
    return trimesh.Trimesh(vertices, shape.faces, process=False)


def text_stl(mesh: trimesh.Trimesh, rng: Rng) -> bytes:
    name, end = picked(rng, REMARKS), picked(rng, ENDS)
    lines = [f"solid {name}"]
    for triangle in np.asarray(mesh.triangles).tolist():
        lines += ["facet normal 0 0 0", "\touter loop"]
        lines += [f"  vertex {x!r}  {y!r} {z!r}" for x, y, z in triangle]
        lines += ["endloop", "endfacet"]
        if rng.uniform() < 0.05:
            lines.append("")
    lines += [f"endsolid {name}", ""]
    text = end.join(line.upper() if rng.uniform() < 0.1 else line for line in lines)
    return text.encode(picked(rng, ("utf-8", "utf-8-sig", "latin-1")), "replace")


def any_stl(mesh: trimesh.Trimesh, rng: Rng) -> bytes:
    if rng.uniform() < 0.5:
        return text_stl(mesh, rng)
    content = binary_stl(np.asarray(mesh.triangles))
    head = picked(rng, (b"", b"solid x", b"\xff\xfe", b"COLOR=\1\2\3\4")).ljust(
        80, b" "
    )
    tail = b"\n" * int(rng.integers(50)) if rng.uniform() < 0.3 else b""
    count = content[80:84]
    if not tail and rng.uniform() < 0.3:
        count = picked(rng, (b"\0" * 4, b"\xff" * 4))
    return head + count + content[84:] + tail


def any_obj(mesh: trimesh.Trimesh, rng: Rng) -> bytes:
    end, count = picked(rng, ENDS), len(mesh.vertices)
    lines = [f"# {picked(rng, REMARKS)}", "mtllib a b.mtl", "o part"]
    lines += [f"v {x!r} {y!r} {z!r}" for x, y, z in mesh.vertices.tolist()]
    lines += ["vn 0 0 1", "vt 0 0", "s off", "usemtl none"]
    tails, below = picked(rng, ("", "/1", "/1/1", "//1")), rng.uniform() < 0.3
    for face in mesh.faces.tolist():
        words = [f"{i - count if below else i + 1}{tails}" for i in face]
        between = f" \\{end}" if rng.uniform() < 0.1 else " "
        lines.append(f"f {between.join(words)}{picked(rng, ('', ' # x', '  '))}")
    text = end.join([*lines, picked(rng, ("", f"# {end}"))])
    return text.encode(picked(rng, ("utf-8", "utf-8-sig", "latin-1")), "replace")


def any_ply(mesh: trimesh.Trimesh, rng: Rng) -> bytes:
    encoding = picked(rng, ("ascii", "binary"))
    return bytes(mesh.export(file_type="ply", encoding=encoding))


def any_glb(mesh: trimesh.Trimesh, rng: Rng) -> bytes:
    return bytes(trimesh.Scene(mesh).export(file_type="glb"))


MESHES = {"stl": any_stl, "obj": any_obj, "ply": any_ply, "glb": any_glb}


def believing(content: bytes, rng: Rng) -> bytes:
    """The same with a size in it that no file of this length has."""
    data, size = bytearray(content), picked(rng, HUGE)
    for old in (b"element vertex ", b"element face ", b'"count":', b'"byteLength":'):
        at = content.find(old)
        if at >= 0 and rng.uniform() < 0.7:
            at += len(old)
            data[at:at] = str(size).encode()
            return bytes(data)
    if len(data) > 84:
        data[80:84] = size.to_bytes(4, "little")
    return bytes(data)


def check_mesh(folder: Path, rng: Rng) -> str:
    """`read` or `refused`; what is whole is read to the numbers that are in it."""
    mesh, kind = solid(rng), picked(rng, tuple(MESHES))
    content = MESHES[kind](mesh, rng)
    path = folder / f"a.{kind}"
    damage = picked(rng, ("", "", changed_bytes, believing))
    path.write_bytes(damage(content, rng) if damage else content)
    try:
        found = read_mesh(path)
    except InvalidInput:
        assert damage, content
        return "refused"
    if not damage:
        corners = found.vertices[found.triangles]
        close = 1e-7 if kind == "ply" else 0.0  # trimesh writes eight decimals
        expected = np.asarray(mesh.triangles)
        np.testing.assert_allclose(corners, expected, rtol=0, atol=close)
        assert found.vertices.shape == np.unique(mesh.vertices, axis=0).shape
    return "read"


def table(rng: Rng, rows: np.ndarray, names: list[str]) -> bytes:
    """Rows as some program writes them; returns the file."""
    between = picked(rng, (",", ";", "\t"))
    quoting = picked(rng, (csv.QUOTE_MINIMAL, csv.QUOTE_ALL, csv.QUOTE_NONNUMERIC))
    comma = between != "," and rng.uniform() < 0.5
    extra = picked(rng, ("", "t_s", "Bemerkung, grün"))
    out = io.StringIO()
    writer = csv.writer(
        out, delimiter=between, quoting=quoting, lineterminator=picked(rng, ENDS)
    )
    order = rng.permutation(len(names)) if rng.uniform() < 0.3 else range(len(names))
    tail = [extra] if extra else []
    writer.writerow([names[i] for i in order] + tail)
    for row in rows.tolist():
        words = [repr(row[i]).replace(".", "," if comma else ".") for i in order]
        writer.writerow(
            words + ([picked(rng, ("0.5", "", "a b", "nan"))] if extra else [])
        )
    text = out.getvalue() + picked(rng, ("", "\n", "\n\n"))
    return text.encode(picked(rng, ("utf-8", "utf-8-sig", "utf-16", "utf-16-le")))


def check_table(folder: Path, rng: Rng) -> str:
    arm, n = built_in("hrm8"), int(rng.integers(1, 30))
    names = list(column_names(8))
    rows = rng.uniform(-1, 1, (n, len(names))) * 10.0 ** rng.integers(-9, 1)
    rows[:, 0], rows[:, 1] = np.arange(n), rng.integers(0, 2, n)
    rows[:, 2] = np.abs(rows[:, 2])
    content, path = table(rng, rows, names), folder / "t.csv"
    damaged = rng.uniform() < 0.4
    path.write_bytes(changed_bytes(content, rng) if damaged else content)
    try:
        found = read_trajectory(path, arm)
    except InvalidInput:
        assert damaged, content
        return "refused"
    if not damaged:
        np.testing.assert_array_equal(found.joints, rows[:, 3:])
        np.testing.assert_array_equal(found.path_m, rows[:, 2])
        np.testing.assert_array_equal(found.on_path, rows[:, 1] == 1.0)
    return "read"


def any_data(rng: Rng, more: tuple[str, ...], depth: int = 0) -> Any:
    if depth > 2 or rng.uniform() < 0.5:
        number = float(rng.normal() * 10.0 ** rng.integers(-5, 6))
        texts = ("a b", "é", "no", "12:30", "#4", "- a", "", *more)
        return picked(rng, (number, int(rng.integers(-99, 99)), True, None, *texts))
    inner = [any_data(rng, more, depth + 1) for _ in range(int(rng.integers(1, 4)))]
    if rng.uniform() < 0.5:
        return inner
    return {f"k{i}": value for i, value in enumerate(inner)}


def check_yaml(folder: Path, rng: Rng) -> str:
    unicode = rng.uniform() < 0.5
    if rng.uniform() < 0.5:
        more = ("x\u2028y", "\x85", "1e3")  # which the yaml module takes by YAML 1.1
        data = {"a": any_data(rng, more), "b": any_data(rng, more)}
        text = json.dumps(data, ensure_ascii=not unicode, indent=picked(rng, (None, 1)))
    else:
        data = {"a": any_data(rng, ()), "b": any_data(rng, ())}
        flow = picked(rng, (True, False, None))
        text = yaml.safe_dump(data, allow_unicode=unicode, default_flow_style=flow)
    remark = f"# {picked(rng, REMARKS)}\x85b: 7\n"
    text = remark + text.replace("\n", picked(rng, ("\n", "\r\n"))) + f"\n{remark}"
    damaged = rng.uniform() < 0.3
    if damaged:
        text = changed_bytes(text.encode(), rng).decode(errors="replace")
    try:
        found = read_yaml(text, file="f")
    except InvalidInput:
        assert damaged, text
        return "refused"
    if not damaged:
        assert found.data == data, text
    return "read"


CHECKS = (check_mesh, check_table, check_yaml)


def check_many(folder: Path, seed: int, count: int) -> Counter[str]:
    """How each kind ended, over so many files of each."""
    counts: Counter[str] = Counter()
    for check in CHECKS:
        for i in range(count):
            try:
                ended = check(folder, np.random.default_rng([seed, i]))
            except BaseException as error:
                error.add_note(f"{check.__name__}, seed {seed}, number {i}")
                raise
            counts[f"{check.__name__} {ended}"] += 1
    return counts


def main(seed: str, count: str, mebibytes: str) -> None:
    """Run within so much memory beyond what the libraries take."""
    status = Path("/proc/self/statm").read_text().split()
    limit = int(status[0]) * resource.getpagesize() + (int(mebibytes) << 20)
    resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    with tempfile.TemporaryDirectory() as folder:
        counts = check_many(Path(folder), int(seed), int(count))
    sys.stdout.write(json.dumps(counts))


if __name__ == "__main__":
    main(*sys.argv[1:])
