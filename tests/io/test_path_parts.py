"""Paths of arcs, circles, splines and files, beside the same path of points."""

from pathlib import Path

import numpy as np
import pytest

from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.problem_file import read_problem

HEAD = """\
vdsm_problem: 1
length_unit: mm
manipulator: hrm8
base: {position: [10, 20, 30], rpy_deg: [0, 0, 90]}
required_clearance: 0
tip_path:
  start: [10, 3146, 30]
  points:
"""

CORNER = "    - [10, 3146, -170]\n"


def written(folder: Path, parts: str, rest: str = "") -> Path:
    path = folder / "curves.yaml"
    path.write_text(HEAD + parts + rest, encoding="utf-8")
    return path


def test_a_circle_in_the_file_is_one_in_the_base_frame(tmp_path: Path) -> None:
    circle = "    - {circle: {center: [10, 3146, 30], normal: [0, 1, 0]}}\n"
    path = read_problem(written(tmp_path, CORNER + circle)).path
    radii = np.linalg.norm(path.points - [3.126, 0.0, 0.0], axis=1)
    assert radii == pytest.approx(0.2, abs=1e-12)
    assert path.points[:, 0] == pytest.approx(3.126, abs=1e-12)
    assert (path.points[-1] == path.points[0]).all()
    assert 0.0 < 0.4 * np.pi - path.length < 1e-3
    coarse = written(tmp_path, CORNER + circle, "  curve_tolerance: 10\n")
    assert len(read_problem(coarse).path.points) < len(path.points) / 5


def test_parts_go_on_where_the_one_before_ends(tmp_path: Path) -> None:
    (tmp_path / "rows.csv").write_text(
        "t;x;y;z\n0;10;3146;30\n1;10,5;3146;30\n", encoding="utf-8"
    )
    parts = (
        CORNER
        + "    - {arc: {through: [210, 3146, 30], to: [10, 3146, 230]}}\n"
        + "    - {spline: [[0, 3140, 200], [0, 3130, 100]]}\n"
        + "    - {file: rows.csv}\n"
        + "    - [20, 3146, 30]\n"
    )
    found = read_problem(written(tmp_path, parts))
    last = found.path.points[-3:]
    assert last == pytest.approx(
        np.array([[3.126, 0, 0], [3.126, -0.0005, 0], [3.126, -0.01, 0]]), abs=1e-12
    )
    assert tmp_path / "rows.csv" in found.source.files


def test_the_hash_of_a_problem_counts_its_path_files(tmp_path: Path) -> None:
    rows, hashes = tmp_path / "rows.csv", set()
    for text in ("x,y,z\n10,3146,30\n", "x,y,z\n10,3146,31\n"):
        rows.write_text(text, encoding="utf-8")
        hashes.add(read_problem(written(tmp_path, "    - {file: rows.csv}\n")).sha256)
    assert len(hashes) == 2


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        ("    - 3\n", "points[0] (line 9): is 3, expected 3 numbers or one of arc, c"),
        ("    - {square: 3}\n", "points[0] (line 9): is a mapping, expected 3 numbers"),
        ("    - {spline: [[1, 2, 3]]}\n", "points[0] (line 9): has no point before it"),
        (
            CORNER + "    - {circle: {centre: [0, 0, 0], normal: [1, 0, 0]}}\n",
            "circle.centre (line 10): is not a known key; known: center, normal, turn_",
        ),
        (
            CORNER + "    - {arc: {through: [0, 0, 0], to: [1, 0, 0]}, turn: 3}\n",
            "points[1].turn (line 10): is not a known key; known: arc",
        ),
        (
            CORNER + "    - {circle: {center: [0, 3146, 0], normal: [0, 0, 0]}}\n",
            "points[1] (line 10): has a normal without direction",
        ),
        (
            CORNER + "    - {spline: [[1e9, 0, 0]]}\n",
            "points[1] (line 10): lies 1e+09 mm from the base, expected at most",
        ),
        (
            CORNER + "  insertion: [[0, 0, 0], [0, 1e11, 0]]\n",
            "tip_path.insertion[1] (line 10): lies 1e+11 mm from the base, expected at",
        ),
        (
            CORNER + "  insertion: [[5e4, 0, 0], [-5e4, 0, 0]]\n  spacing: 0.02\n",
            "mm of path into more than 5000000 rows",
        ),
        ("    - {file: none.csv}\n", "points[0] (line 9): 'none.csv': does not exist"),
        ("    - {file: bad.csv}\n", "'bad.csv': line 2: z is 'a', expected a number"),
        ("    - {file: empty.csv}\n", "'empty.csv': has no row"),
    ],
)
def test_what_is_no_path_is_told_by_part_and_line(
    tmp_path: Path, parts: str, message: str
) -> None:
    (tmp_path / "bad.csv").write_text("x,y,z\n1,2,a\n", encoding="utf-8")
    (tmp_path / "empty.csv").write_text("x,y,z\n", encoding="utf-8")
    with pytest.raises(InvalidFile) as refused:
        read_problem(written(tmp_path, parts))
    assert message in str(refused.value)
