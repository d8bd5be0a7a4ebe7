"""Certificates of robots that options describe, about a problem file written then."""

import json
from pathlib import Path

import pytest
import yaml
from oracles.certificate_cases import certificate_lines
from oracles.robot_certificates import CELL, Made

from vdsm_pin.certificate_checker import check_certificate
from vdsm_pin.cli import main
from vdsm_pin.robots.cell import read_cell

MOVEIT = """world:
  collision_objects:
    - id: crate
      header: {frame_id: foot}
      primitives: [{type: 1, dimensions: [0.2, 0.2, 0.2]}]
      primitive_poses:
        - {position: {x: 0.9, y: 1.5, z: 0.9}, orientation: {x: 0, y: 0, z: 0, w: 1}}
"""
OURS = {"length_unit": "mm", "obstacles": CELL["obstacles"]}


def ends(*words: str) -> object:
    with pytest.raises(SystemExit) as ended:
        main(list(words))
    return ended.value.code


def verified(made: Made, proof: Path, *more: str) -> object:
    folder = made.folder
    options = ["--urdf", str(folder / "all.urdf"), "--srdf", str(folder / "all.srdf")]
    options += ["--trajectory", str(folder / "t.csv"), "--out", str(folder / "out")]
    return ends("verify", *options, "--certificate", str(proof), *more)


@pytest.mark.parametrize(
    "more",
    [
        (),
        ("--bodies", "parts", "--parts", "10", "--required-clearance-mm", "5"),
        ("--bodies", "primitives", "--required-self-clearance-mm", "1"),
        ("--group", "arm", "--lock", "lift=0.2", "--base-error-mm", "1"),
        ("--joint-error-deg", "bend=0.2", "--slide-error-mm", "2"),
        ("--obstacle-error-mm", "ball=3", "--obstacle-error-deg", "notch=1"),
    ],
)
def test_what_options_ask_stands_in_a_file(
    tmp_path: Path, more: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    made = Made(tmp_path)
    if "--lock" in more:
        made.rows = [[row[0], row[2]] for row in made.rows]
        made.write()
    (tmp_path / "scene.json").write_text(json.dumps(OURS))
    (tmp_path / "proofs").mkdir()
    proof = tmp_path / "proofs" / "p.certificate"
    scene = str(tmp_path / "scene.json")
    assert verified(made, proof, "--scene", scene, *more) == 0
    problem = proof.with_name("p.certificate.yaml")
    assert str(problem.name) in capsys.readouterr().out.replace("\n", "")
    outcome = check_certificate(proof, problem, tmp_path / "t.csv")
    assert outcome.accepted, outcome.reason
    text = (tmp_path / "scene.json").read_text()
    (tmp_path / "scene.json").write_text(text.replace("90", "91"))
    outcome = check_certificate(proof, problem, tmp_path / "t.csv")
    assert "of another problem file" in outcome.reason


def test_a_planning_scene_is_named_in_it(tmp_path: Path) -> None:
    made, proof = Made(tmp_path), tmp_path / "p"
    (tmp_path / "moveit.yaml").write_text(MOVEIT)
    assert verified(made, proof, "--scene", str(tmp_path / "moveit.yaml")) == 0
    problem = tmp_path / "p.yaml"
    assert yaml.safe_load(problem.read_text())["scene"] == "moveit.yaml"
    assert check_certificate(proof, problem, tmp_path / "t.csv").accepted
    assert certificate_lines(proof)[0]["pairs"][0][1] == "crate"


def test_nothing_that_is_read_is_written_over(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    made, scene = Made(tmp_path), tmp_path / "moveit.yaml"
    scene.write_text(MOVEIT)
    assert verified(made, tmp_path / "moveit", "--scene", str(scene)) == 2
    assert "moveit.yaml" in capsys.readouterr().err
    assert scene.read_text() == MOVEIT
    (tmp_path / "folder").mkdir()
    before = set(tmp_path.iterdir())
    for proof in (tmp_path / "folder", tmp_path / "all.urdf", scene):
        assert verified(made, proof, "--scene", str(scene)) == 2
        assert set(tmp_path.iterdir()) == before


def test_a_problem_names_a_scene_beside_obstacles_of_its_own(tmp_path: Path) -> None:
    made = Made(tmp_path)
    (tmp_path / "moveit.yaml").write_text(MOVEIT)
    made.cell |= {"scene": "moveit.yaml"}
    made.certified()
    assert read_cell(made.files[0]).scene.names == ("ball", "floor", "notch", "crate")
    (tmp_path / "moveit.yaml").write_text(MOVEIT.replace("crate", "ball"))
    problem, rows = map(str, made.files)
    assert ends("verify", problem, "--trajectory", rows, "--out", str(tmp_path)) == 2
