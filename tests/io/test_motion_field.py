"""`motion` of obstacles and `time_s` of trajectories: what is read, what is refused."""

from pathlib import Path

import numpy as np
import pytest

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.solids import Sphere
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.problem.scene import Moving
from vdsm_pin.problem.trajectory import Trajectory

HEAD = """vdsm_problem: 1
length_unit: mm
manipulator: hrm8
base: {position: [100, 200, 300], rpy_deg: [0, 0, 90]}
required_clearance: 5
obstacles:
  - {name: ball, shape: sphere, center: [10, 20, 30], radius: 40, motion: %s}
"""


def read(folder: Path, motion: str) -> Moving:
    path = folder / "p.yaml"
    path.write_text(HEAD % motion, encoding="utf-8")
    (found,) = read_problem(path).scene.obstacles
    assert isinstance(found, Moving)
    return found


def test_a_point_stands_at_position_plus_turned_point(tmp_path: Path) -> None:
    motion = "{times_s: [1, 3], positions: [[0, 0, 0], [100, 0, 0]], rpy_deg: "
    found = read(tmp_path, motion + "[[0, 0, 0], [0, 0, 180]]}")
    assert isinstance(found.solid, Sphere)
    middle = found.solid.centre
    np.testing.assert_allclose(middle, [0.010, 0.020, 0.030], atol=1e-15)
    poses = found.poses(np.array([0.0, 1.0, 2.0, 3.0, 9.0]))
    base = poses[:, :3, :3] @ middle + poses[:, :3, 3]
    # In the file: R (10, 20, 30) + position; the base is turned by 90 deg about z.
    file = np.array(
        [[10, 20, 30], [10, 20, 30], [30, 10, 30], [90, -20, 30], [90, -20, 30]]
    )
    away = (file - [100, 200, 300]) * 1e-3
    turned = np.column_stack([away[:, 1], -away[:, 0], away[:, 2]])
    np.testing.assert_allclose(base, turned, atol=1e-12)


@pytest.mark.parametrize("whole", [3.6e11, -3.6e11, 0.0])
def test_whole_turns_before_it_begins_cost_no_digits(
    tmp_path: Path, whole: float
) -> None:
    motion = f"{{times_s: [0, 1], rpy_deg: [[0, 0, {whole}], [0, 0, {whole + 90.0}]]}}"
    knots = read(tmp_path, motion).carrier.path.knots
    np.testing.assert_allclose(np.ptp(knots, axis=0).max(), np.pi / 2, atol=1e-15)
    assert np.abs(knots[:, 3:]).max() < 7.0


@pytest.mark.parametrize(
    "motion, words",
    [
        ("{times_s: [0, 0], positions: [[0,0,0],[1,0,0]]}", "is 0, expected above 0"),
        ("{times_s: [1, 0], positions: [[0,0,0],[1,0,0]]}", r"times_s\[1\]"),
        ("{times_s: [0, 1]}", "neither positions nor rpy_deg"),
        ("{times_s: [0, 1], positions: [[0,0,0]]}", "has 1 rows, expected 2"),
        ("{times_s: [0, 1], rpy_deg: [[0,0,0]]}", "has 1 rows, expected 2"),
        ("{times_s: []}", "times_s"),
        ("{positions: [[0,0,0]]}", "times_s"),
        ("{times_s: [0], positions: [[0,0]]}", "positions"),
        ("{times_s: [0], positions: [[0,0,.nan]]}", "positions"),
        ("{times_s: [0], position: [[0,0,0]]}", "position"),
        ("{times_s: [0, 1], positions: [[0,0,0],[2e5,0,0]]}", "reaches"),
    ],
)
def test_a_bad_motion_is_named(tmp_path: Path, motion: str, words: str) -> None:
    with pytest.raises(InvalidFile, match=words) as caught:
        read(tmp_path, motion)
    assert "line 7" in str(caught.value)


def test_what_rides_on_a_link_moves_with_it_alone(tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    path.write_text(
        "vdsm_problem: 1\nlength_unit: mm\nrequired_clearance: 5\nmanipulator:\n"
        "  link_lengths: [300, 300, 300]\n  link_radius: 40\n"
        "  max_link_angle_deg: 40\n  max_joint_angle_deg: 40\n  bodies:\n"
        "    - {name: eye, link: 2, shape: sphere, center: [0, 0, 60], radius: 9,\n"
        "       motion: {times_s: [0], positions: [[0, 0, 0]]}}\n",
        encoding="utf-8",
    )
    with pytest.raises(InvalidFile, match="motion"):
        read_problem(path)


def rows(n: int = 3) -> Trajectory:
    rng = np.random.default_rng(0)
    none, angles = np.zeros(n), rng.uniform(-0.3, 0.3, (2, n, 8))
    return Trajectory(
        none > 0, none, rng.uniform(0, 1, n), *angles, times=np.array([0.1, 0.3, 2.0])
    )


def test_times_are_written_and_read_to_the_last_bit(tmp_path: Path) -> None:
    path, motion = tmp_path / "t.csv", rows()
    write_trajectory(motion, path)
    found = read_trajectory(path, built_in("hrm8"))
    assert found.times is not None and motion.times is not None
    assert found.times.tolist() == motion.times.tolist()
    assert not found.notes


def test_times_that_do_not_rise_name_their_line(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    write_trajectory(rows(), path)
    text = path.read_text().replace(",0.3\n", ",0.1\n")
    path.write_text(text)
    with pytest.raises(InvalidFile, match=r"line 3.*time_s is 0.1, expected a time"):
        read_trajectory(path, built_in("hrm8"))
