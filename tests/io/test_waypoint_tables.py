"""Centres and cables read back: round trips in any frame, and refusals by line."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import rotation_from_rpy
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.waypoint_tables import read_cables, read_centres
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.tables import write_cables, write_centres

FREE = read_problem("paper/free")


def problem_with(n_links: int, rng: np.random.Generator) -> PlanningProblem:
    """Any arm on any rail."""
    arm = Manipulator(
        "any", rng.uniform(0.1, 0.6, n_links), 0.03, 0.9, 0.9, (-5.0, 5.0),
        CableLayout(0.025, 0.02, paper_hole_angles(n_links)),
    )  # fmt: skip
    pose = np.eye(4)
    pose[:3, :3] = rotation_from_rpy(rng.uniform(-3.0, 3.0, 3))
    pose[:3, 3] = rng.uniform(-5.0, 5.0, 3)
    return replace(FREE, manipulator=arm, T_world_base=pose)


def motion(n: int, n_links: int, rng: np.random.Generator) -> Trajectory:
    alpha, theta = rng.uniform(-0.6, 0.6, (2, n, n_links))
    alpha[0] = theta[0] = 0.0  # the straight arm is a case of its own
    along = np.sort(rng.uniform(0.0, 3.0, n))
    return Trajectory(rng.random(n) < 0.5, along, rng.normal(size=n), alpha, theta)


@pytest.mark.parametrize("seed", range(12))
def test_centres_and_cables_read_back_as_the_same_motion(
    seed: int, tmp_path: Path
) -> None:
    rng = np.random.default_rng(seed)
    n_links = int(rng.integers(2, 14))
    problem, given = problem_with(n_links, rng), motion(30, n_links, rng)
    write_centres(tmp_path / "o.csv", problem, given)
    write_cables(tmp_path / "l.csv", problem, given)
    for found in (
        read_centres(tmp_path / "o.csv", problem),
        read_cables(tmp_path / "l.csv", problem),
    ):
        assert (found.on_path == given.on_path).all()
        np.testing.assert_allclose(found.path_m, given.path_m, rtol=0, atol=1e-12)
        np.testing.assert_allclose(found.joints, given.joints, rtol=0, atol=1e-9)


def changed(path: Path, row: int, column: str, value: str) -> Path:
    lines = path.read_text(encoding="utf-8").splitlines()
    place = lines[0].split(",").index(column)
    words = lines[row + 1].split(",")
    words[place] = value
    lines[row + 1] = ",".join(words)
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("column", "value", "said"),
    [
        ("o5_z_m", "0.4", "line 5: o5 and o6 are|line 5: o4 and o5 are"),
        ("o1_y_m", "0.001", "line 5: o1 is 1 mm off the rail"),
        ("o9_x_m", "3126", "line 5: o9_x_m is 3126, expected metres, at most 100"),
        ("waypoint", "0", "line 5: waypoint is 0, expected a whole number above"),
        ("on_path", "2", "line 5: on_path is 2, expected 0 or 1"),
        ("path_m", "-1", "line 5: path_m is -1, expected 0 to"),
        ("o2_x_m", "nan", "line 5: o2_x_m is nan, expected a finite number"),
        ("o2_x_m", "", "line 5: o2_x_m is '', expected a number"),
    ],
)
def test_centres_that_fit_no_posture_are_refused_by_line(
    column: str, value: str, said: str, tmp_path: Path
) -> None:
    given = motion(6, 8, np.random.default_rng(0))
    write_centres(tmp_path / "o.csv", FREE, given)
    bad = changed(tmp_path / "o.csv", 3, column, value)
    with pytest.raises(InvalidFile, match=said):
        read_centres(bad, FREE)


def test_cables_that_contradict_each_other_are_refused_by_line(tmp_path: Path) -> None:
    given = motion(6, 8, np.random.default_rng(0))
    write_cables(tmp_path / "l.csv", FREE, given)
    bad = changed(tmp_path / "l.csv", 2, "l3b_m", "1.46")
    said = r"line 4: the cable lengths of link 3 fit no joint angles; the nearest leave"
    with pytest.raises(InvalidFile, match=said):
        read_cables(bad, FREE)
    bad = changed(tmp_path / "l.csv", 2, "l3b_m", "0.9")  # Newton's method diverges
    with pytest.raises(InvalidFile, match=r"link 3 fit no joint angles$"):
        read_cables(bad, FREE)


def test_columns_that_are_not_read_are_noted(tmp_path: Path) -> None:
    given = motion(6, 8, np.random.default_rng(0))
    for write, read in (write_centres, read_centres), (write_cables, read_cables):
        write(tmp_path / "a.csv", FREE, given)
        assert read(tmp_path / "a.csv", FREE).notes == ()
        head, *rows = (tmp_path / "a.csv").read_text(encoding="utf-8").splitlines()
        text = "\n".join([f"{head},time_s", *(f"{row},1" for row in rows), ""])
        (tmp_path / "a.csv").write_text(text, encoding="utf-8")
        notes = read(tmp_path / "a.csv", FREE).notes
        assert notes == ("columns that are not read: 'time_s'",)


def test_a_file_without_the_path_claims_to_draw_nothing(tmp_path: Path) -> None:
    given = motion(5, 8, np.random.default_rng(1))
    write_cables(tmp_path / "l.csv", FREE, given)
    lines = (tmp_path / "l.csv").read_text(encoding="utf-8").splitlines()
    rows = [line.split(",") for line in lines]
    text = "\n".join(",".join([row[0], *row[3:]]) for row in rows) + "\n"
    (tmp_path / "short.csv").write_text(text, encoding="utf-8")
    found = read_cables(tmp_path / "short.csv", FREE)
    assert not found.on_path.any()
    assert not found.path_m.any()
    np.testing.assert_allclose(found.joints, given.joints, rtol=0, atol=1e-9)


@pytest.mark.parametrize("text", ["", "waypoint,x0_m\n", "waypoint,x0_m\n0,1\n"])
def test_a_file_of_something_else_is_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    for read in (read_centres, read_cables):
        with pytest.raises(InvalidFile):
            read(tmp_path / "a.csv", FREE)


def test_a_file_of_one_of_the_two_path_columns_is_refused(tmp_path: Path) -> None:
    given = motion(5, 8, np.random.default_rng(1))
    write_cables(tmp_path / "l.csv", FREE, given)
    text = (tmp_path / "l.csv").read_text(encoding="utf-8")
    (tmp_path / "l.csv").write_text(text.replace("path_m", "way", 1), encoding="utf-8")
    with pytest.raises(InvalidFile, match="has no column 'path_m'"):
        read_cables(tmp_path / "l.csv", FREE)
