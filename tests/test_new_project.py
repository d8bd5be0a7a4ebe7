"""`vdsm new` makes folders that the other commands take as they are."""

import json
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest
import trimesh

from vdsm_pin.app.new_project import KINDS, TEMPLATES, new_project
from vdsm_pin.cli import main
from vdsm_pin.errors import CannotWrite, InvalidInput
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.robots.cell import read_cell


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["mine", "12", "1e3", "straße-2.b"])
def test_what_is_made_is_read_under_its_name(
    tmp_path: Path, kind: str, name: str
) -> None:
    files = new_project(tmp_path / "a" / name, kind)
    folder = tmp_path / "a" / name
    if kind == "robot":
        assert read_cell(folder / "problem.yaml").robot.joints
    else:
        problem = read_problem(folder / "problem.yaml")
        assert problem.name == name
        assert problem.tip_path is not None
    assert files == sorted(path.name for path in folder.iterdir())
    assert f"# {name}\n" in (folder / "README.md").read_text(encoding="utf-8")
    assert "NAME" not in (folder / "problem.yaml").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "kind", ["snake", pytest.param("port", marks=pytest.mark.slow)]
)
def test_what_is_made_is_planned_as_is_told_and_certified(
    tmp_path: Path, kind: str, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "mine"
    with pytest.raises(SystemExit):
        main(["new", str(folder), "--from", kind, "--json"])
    program, *words = shlex.split(json.loads(capsys.readouterr().out)["next"])
    assert (program, words[-1]) == ("vdsm", str(folder / "out"))
    with pytest.raises(SystemExit) as ended:
        main(words)
    assert ended.value.code == 0


def test_the_robot_is_certified_and_beside_a_higher_wall_repaired(
    tmp_path: Path,
) -> None:
    folder = tmp_path / "cell"
    new_project(folder, "robot")
    given = ["--trajectory", str(folder / "plan.csv"), "--out", str(tmp_path / "out")]

    def ends(command: str) -> int:
        with pytest.raises(SystemExit) as ended:
            main([command, str(folder / "problem.yaml"), *given])
        return int(ended.value.code or 0)

    assert ends("verify") == 0
    text = (folder / "problem.yaml").read_text(encoding="utf-8")
    low, high = (
        "[600, 0, 210], size: [500, 30, 420]",
        "[600, 0, 230], size: [500, 30, 460]",
    )
    (folder / "problem.yaml").write_text(text.replace(low, high), encoding="utf-8")
    assert ends("verify") == 1
    assert ends("repair") == 0


def test_the_vessel_has_the_port_that_its_problem_states() -> None:
    mesh = trimesh.load_mesh(TEMPLATES / "port" / "vessel.stl")
    assert mesh.is_watertight
    assert mesh.extents == pytest.approx([1100.0, 1000.0, 800.0])
    rim = mesh.vertices[np.isclose(mesh.vertices[:, 0], 700.0)]
    radii = np.linalg.norm(rim[:, 1:], axis=1)
    assert radii.min() == pytest.approx(110.0, abs=1e-3)


@pytest.mark.parametrize("name", ["a b", "-x", "a:b", "a'b", "x" * 101, "a\nb", "."])
def test_names_that_no_problem_can_have_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InvalidInput, match="cannot name a problem"):
        new_project(tmp_path / name if name != "." else Path(), "snake")
    assert not list(tmp_path.iterdir())


def test_nothing_that_is_there_is_overwritten(tmp_path: Path) -> None:
    folder = tmp_path / "mine"
    folder.mkdir()
    (folder / "problem.yaml").write_text("precious")
    with pytest.raises(InvalidInput, match="is there already"):
        new_project(folder, "snake")
    with pytest.raises(InvalidInput, match="unknown template 'boat'"):
        new_project(tmp_path / "other", "boat")
    assert (folder / "problem.yaml").read_text() == "precious"
    assert list(tmp_path.iterdir()) == [folder]


def test_a_folder_that_cannot_be_filled_leaves_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(shutil, "copyfile", full)
    with pytest.raises(CannotWrite, match="mine: cannot be written: No space left"):
        new_project(tmp_path / "mine", "port")
    assert not list(tmp_path.iterdir())
