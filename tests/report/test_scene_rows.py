"""The list of obstacles. Oracles: the files themselves, hashed here."""

import hashlib
from pathlib import Path

import made_up
import numpy as np
import pytest
from problem_files import NEAR, write_problem

from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.scene import Scene
from vdsm_pin.report.facts import verification_file
from vdsm_pin.report.html import write_report
from vdsm_pin.report.inputs import (
    CHANGED,
    MOST_LISTED,
    SceneRow,
    scene_rows,
    scene_words,
)
from vdsm_pin.report.run_record import now

EXAMPLES = Path(__file__).parents[2] / "examples"
TETRAHEDRON = """\
v 1 2 1
v 1.2 2 1
v 1 2.2 1
v 1 2 1.2
f 1 3 2
f 1 2 4
f 2 3 4
f 3 1 4
"""
MESHES = """\
obstacles:
  - {name: whole, shape: mesh, file: whole.obj, length_unit: m}
  - {name: skin, shape: mesh, file: whole.obj, length_unit: m, solid: false}
  - {name: open, shape: mesh, file: open.obj, length_unit: m}
  - {name: ground, shape: half_space, point: [0, 0, -2000], normal: [0, 0, 1]}
"""


def scene_file(folder: Path) -> Path:
    (folder / "whole.obj").write_text(TETRAHEDRON)
    (folder / "open.obj").write_text("".join(TETRAHEDRON.splitlines(True)[:-1]))
    head, tail = NEAR.split("obstacles:\n")
    text = head + MESHES + tail.split("\n", 1)[1]
    return write_problem(folder / "meshes.yaml", text)


def test_every_obstacle_is_listed_with_its_file_and_hash(tmp_path: Path) -> None:
    problem = read_problem(scene_file(tmp_path)).under(ErrorBox(base=0.001))
    rows = scene_rows(problem)
    digest = {
        name: hashlib.sha256((tmp_path / name).read_bytes()).hexdigest()
        for name in ("whole.obj", "open.obj")
    }
    assert rows == (
        SceneRow("whole", "mesh", "whole.obj", 4, "solid", digest["whole.obj"]),
        SceneRow("skin", "mesh", "whole.obj", 4, "surface only", digest["whole.obj"]),
        SceneRow("open", "mesh", "open.obj", 3, "not known", digest["open.obj"]),
        SceneRow("ground", "half space", "", None, "solid", ""),
    )


def test_a_hash_is_of_what_was_read_or_there_is_none(tmp_path: Path) -> None:
    problem = read_problem(scene_file(tmp_path))
    (tmp_path / "open.obj").write_text(TETRAHEDRON)
    assert {row.sha256 for row in scene_rows(problem)} == {CHANGED, ""}
    (tmp_path / "open.obj").unlink()
    assert {row.sha256 for row in scene_rows(problem)} == {CHANGED, ""}


def test_scenes_without_files_and_long_ones_are_listed_too() -> None:
    problem = made_up.problem()
    assert [row.shape for row in scene_rows(problem)] == [
        "cylinder", "sphere", "capsule", "box", "prism", "mesh", "half space",
    ]  # fmt: skip
    assert MOST_LISTED >= 100


def field(name: str, n: int) -> Mesh:
    """A surface of 2 (n - 1)^2 triangles over a square."""
    x, y = np.meshgrid(np.linspace(4.0, 5.0, n), np.linspace(2.0, 3.0, n))
    points = np.stack([x, y, 0.1 * np.sin(9.0 * x)], axis=2).reshape(-1, 3)
    k = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
    halves = [[k, k + 1, k + n], [k + 1, k + n + 1, k + n]]
    triangles = np.concatenate([np.stack(half, axis=1) for half in halves])
    return Mesh(name, points, triangles, solid=False)


def test_a_page_says_which_meshes_are_thinned_in_its_picture(tmp_path: Path) -> None:
    scene = Scene((field("fine", 160), field("coarse", 20)))
    judged = made_up.verification(scene=scene)
    page = tmp_path / "report.html"
    write_report(page, judged, verification_file(judged, made_up.RECORD))
    rows = page.read_text(encoding="utf-8").split('<th scope="row">')
    (fine,) = (row for row in rows if row.startswith("fine"))
    (coarse,) = (row for row in rows if row.startswith("coarse"))
    assert "50562" in fine
    assert int(fine.split("thinned to ")[1].split("<")[0]) <= 20_000
    assert "whole" in coarse


def test_the_date_can_be_fixed(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "86400")
    assert now() == "1970-01-02 00:00:00 UTC"
    monkeypatch.delenv("SOURCE_DATE_EPOCH")
    assert now() > "2024"


def test_links_of_another_arm_are_not_counted_as_obstacles() -> None:
    scene = read_problem(EXAMPLES / "two_arms" / "cell.yaml").scene
    assert scene_words(scene) == "0 obstacles and 1 other robot of 4 links"
    assert scene_words(scene.at_rest) == "0 obstacles"
