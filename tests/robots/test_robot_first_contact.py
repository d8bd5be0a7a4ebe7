"""First and last contact of robots: closed forms, dense samples, moving obstacles."""

from pathlib import Path

import numpy as np
import pytest
from oracles.shortcuts import named

from tests.robots.test_moving_beside_robots import along, cell_with, gaps
from tests.robots.test_robots import write
from vdsm_pin.proof import stretches
from vdsm_pin.proof.paths import Path as Motion
from vdsm_pin.robots.cell import read_cell
from vdsm_pin.robots.judgement import verify_robot
from vdsm_pin.verification.records import Check, Verdict

SLIDER = """<robot name="slider"><link name="base"/>
  <link name="box"><collision><geometry><box size="0.2 0.2 0.2"/></geometry>
    </collision></link>
  <joint name="slide" type="prismatic"><parent link="base"/><child link="box"/>
    <axis xyz="1 0 0"/><limit lower="-9" upper="9" effort="1" velocity="9"/></joint>
</robot>
"""
WALL = """vdsm_problem: 1
length_unit: m
robot: {{urdf: slider.urdf}}
required_clearance: {required}
obstacles:
  - {{name: wall, shape: box, center: [0.6, 0, 0], size: [0.2, 1, 1]}}
"""
ROOM = 0.4
"""Between the boxes at the start; [m]."""


def slid(
    folder: Path,
    x: list[float],
    required: float,
    start: float = 0.0,
    scene: str = WALL,
) -> Check:
    """The row of obstacles as the box slides from place to place, a second each."""
    write(folder, "slider.urdf", SLIDER)
    cell = read_cell(write(folder, "cell.yaml", scene.format(required=required)))
    times = start + np.arange(float(len(x)))
    result = verify_robot(cell, named(Motion(np.array(x)[:, None], times=times)))
    assert not result.not_done
    return next(row for row in result.checks if "obstacles" in row.name)


@pytest.mark.parametrize("required", [0.0, 0.05])
def test_a_contact_begins_and_ends_where_the_closed_form_says(
    required: float, tmp_path: Path
) -> None:
    """In and out of the wall's margin twice; with no margin balls in both prove it."""
    row = slid(tmp_path, [0.0, 0.2, 0.5, 0.1, 0.1, 0.6, -0.3], required)
    limit, off = ROOM - required, 2e-6
    assert row.verdict is Verdict.REFUTED
    assert row.first_moment == pytest.approx(1.0 + (limit - 0.2) / 0.3, abs=off)
    assert row.last_moment == pytest.approx(5.0 + (0.6 - limit) / 0.9, abs=off)
    assert (row.too_close_intervals, row.too_close_stretches) == (4, 2)
    assert "4 intervals in 2 stretches" in row.where


def test_contacts_with_two_walls_are_counted_together(tmp_path: Path) -> None:
    """Of 60 intervals four hold a contact, two with either wall."""
    places = [0.0] * 10 + [0.45] + [0.0] * 30 + [-0.5] + [0.0] * 19
    wall = WALL.splitlines()[-1]
    behind = wall.replace("wall", "behind").replace("[0.6", "[-0.6")
    row = slid(tmp_path, places, 0.0, scene=f"{WALL}{behind}\n")
    assert row.first_moment == pytest.approx(9.0 + ROOM / 0.45, abs=2e-6)
    assert row.last_moment == pytest.approx(42.0 - ROOM / 0.5, abs=2e-6)
    assert (row.too_close_intervals, row.too_close_stretches) == (4, 2)


@pytest.mark.parametrize(("ways", "counted"), [(16, 32), (17, 0)])
def test_of_contacts_in_very_many_intervals_the_first_is_told_alone(
    ways: int, counted: int, tmp_path: Path
) -> None:
    """Balls in both bodies are looked for in 32 intervals, of more in none."""
    row = slid(tmp_path, [*[0.0, 0.45] * ways, 0.0], 0.0)
    assert row.first_moment == pytest.approx(ROOM / 0.45, abs=2e-6)
    assert row.too_close_intervals == counted
    assert np.isfinite(row.last_moment) == bool(counted)


@pytest.mark.parametrize("most", [1, 1_000_000])
def test_intervals_that_take_too_much_memory_are_not_counted(
    most: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(stretches, "MOST_BRACKETS", most)
    row = slid(tmp_path, [0.0, 0.45, 0.0], 0.0)
    assert row.first_moment == pytest.approx(ROOM / 0.45, abs=2e-6)
    assert row.too_close_intervals == (0 if most == 1 else 2)


def test_a_contact_all_along_begins_with_the_first_row_and_ends_with_the_last(
    tmp_path: Path,
) -> None:
    row = slid(tmp_path, [0.5, 0.6, 0.5], 0.0)
    assert (
        row.first_moment,
        row.last_moment,
        row.too_close_intervals,
        row.too_close_stretches,
    ) == (0.0, 2.0, 2, 1)
    row = slid(tmp_path, [0.5], 0.0)
    assert (row.first_moment, row.too_close_intervals) == (0.0, 1)


def test_a_clear_motion_has_no_contact(tmp_path: Path) -> None:
    row = slid(tmp_path, [0.0, 0.3, 0.0], 0.05)
    assert row.verdict is Verdict.CERTIFIED
    assert np.isnan([row.first_moment, row.last_moment]).all()
    assert row.too_close_intervals == 0


def test_times_that_count_from_1970_are_halved_as_far_as_they_differ(
    tmp_path: Path,
) -> None:
    """A waypoint is a second and its time a multiple of 0.24 us."""
    row = slid(tmp_path, [0.0, 0.6, 0.0], 0.05, start=1.7e9)
    assert row.first_moment == pytest.approx(0.35 / 0.6, abs=2e-6)
    assert row.last_moment == pytest.approx(2.0 - 0.35 / 0.6, abs=2e-6)


@pytest.mark.parametrize("seed", range(4))
def test_contacts_beside_what_moves_are_those_of_dense_samples(
    seed: int, tmp_path: Path
) -> None:
    """Moments are in the robot's waypoints, whatever knots the obstacle has."""
    rng = np.random.default_rng(seed)
    rows, knots = rng.uniform(-1.0, 1.0, (4, 2)), rng.uniform(-0.6, 0.6, (3, 3))
    times, moves = np.array([0.0, 1.0, 1.5, 4.0]), np.array([0.5, 1.25, 3.0])
    knots[:, 2] = 0.0
    elbow = rows[1:3, 0].mean()  # at 1.25 s the ball is there
    knots[1] = [0.5 * np.cos(elbow), 0.5 * np.sin(elbow), 0.0]
    cell = cell_with(tmp_path, moves, knots)
    result = verify_robot(cell, named(Motion(rows, times=times)))
    row = next(one for one in result.checks if "obstacles" in one.name)
    moments = np.linspace(0.0, 3.0, 60_001)
    at = np.interp(moments, np.arange(4.0), times)
    close = gaps(along(times, rows, at), along(moves, knots, at)).min(axis=1) < 0.01
    assert close.any() == (row.verdict is Verdict.REFUTED)
    assert close.any()
    (met,) = np.nonzero(close)
    assert row.first_moment == pytest.approx(moments[met[0]], abs=1e-4)
    assert row.last_moment == pytest.approx(moments[met[-1]], abs=1e-4)
    intervals = np.unique(np.minimum(moments[met].astype(int), 2))
    assert row.too_close_intervals == len(intervals)
