"""Trajectories of robots in every format: the same numbers back, limits of rates."""

import itertools
import json
import shutil
import subprocess
import sys
import zlib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from oracles.shortcuts import read_path

from tests.robots.test_robots import CELL, SCENE, URDF, mutated, write
from vdsm_pin.app import conversion
from vdsm_pin.cli import main
from vdsm_pin.errors import InvalidFile, InvalidInput, VdsmError
from vdsm_pin.geometry.arrays import rotation_from_rpy
from vdsm_pin.io import bags
from vdsm_pin.io.bags import read_bag, write_bag
from vdsm_pin.io.places import Place
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.io.trajectory_messages import of_message, text_of
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.paths import Path as Motion
from vdsm_pin.robots.by_itself import rate_checks
from vdsm_pin.robots.files import RobotFiles
from vdsm_pin.robots.model import Robot, RobotJoint
from vdsm_pin.robots.trajectory_csv import csv_text
from vdsm_pin.robots.trajectory_files import read_motion
from vdsm_pin.robots.urdf import read_robot
from vdsm_pin.verification.records import Verdict

FORMATS = [".csv", ".yaml", ".json", ".bag", ".mcap", ""]
"""Endings of files, none of a bag's folder."""


@pytest.fixture
def urdf(tmp_path: Path) -> Path:
    return write(tmp_path, "two.urdf", URDF)


@pytest.fixture
def robot(urdf: Path) -> Robot:
    return read_robot(RobotFiles(urdf))


def motion(smooth: int, rows: int = 5) -> JointTrajectory:
    rng = np.random.default_rng(smooth)
    q, rates, changes = rng.uniform(-0.09, 0.09, (3, rows, 2))
    times = np.cumsum(rng.integers(1, 9, rows) / 8.0)
    return JointTrajectory(
        ("turn", "slide"),
        q,
        times,
        rates if smooth > 0 else None,
        changes if smooth > 1 else None,
    )


def written(folder: Path, ending: str, given: JointTrajectory, robot: Robot) -> Path:
    file = folder / f"plan{ending}"
    if file.is_dir():
        shutil.rmtree(file)
    file.unlink(missing_ok=True)
    if ending == ".csv":
        file.write_text(csv_text(given, robot))
    elif ending in (".bag", ".mcap", ""):
        pytest.importorskip("rosbags")
        write_bag(given, file)
    else:
        file.write_text(text_of(given, ending))
    return file


@pytest.mark.parametrize("ending", FORMATS)
@pytest.mark.parametrize("smooth", [0, 1, 2])
def test_what_is_written_is_read_back(
    tmp_path: Path, robot: Robot, ending: str, smooth: int
) -> None:
    given = motion(smooth)
    file = written(tmp_path, ending, given, robot)
    found = read_motion(file, robot.joints)
    for one, other in zip(
        (given.q, given.times, given.rates, given.changes),
        (found.q, found.times, found.rates, found.changes),
        strict=True,
    ):
        if one is None:
            assert other is None
        else:
            np.testing.assert_array_equal(one, other)
    path = read_path(file, robot)
    assert path.degree == (1, 3, 5)[smooth]
    assert path.times is not None


def test_topics_are_chosen(tmp_path: Path, robot: Robot) -> None:
    pytest.importorskip("rosbags")
    file = written(tmp_path, ".mcap", motion(1), robot)
    assert len(read_bag(file, "/joint_trajectory#0").q) == 5
    for topic, expected in (
        ("/other", "has no trajectory under topic '/other'; topics: /joint_trajectory"),
        ("/joint_trajectory#1", "has messages 0 to 0, not '1'"),
        (f"/joint_trajectory#{'1' * 5000}", "has messages 0 to 0, not '1"),
    ):
        with pytest.raises(InvalidFile, match=expected):
            read_bag(file, topic)
    csv = written(tmp_path, ".csv", motion(1), robot)
    with pytest.raises(InvalidFile, match="is no bag"):
        read_motion(csv, robot.joints, "/joint_trajectory")
    data = file.read_bytes()
    for end in (0, 20, len(data) // 2):
        file.write_bytes(data[:end])
        with pytest.raises(InvalidFile, match=r"has no|cannot"):
            read_bag(file)


def test_the_message_of_a_bag_is_the_one_asked_for() -> None:
    """Measured states are all of them; of plans there is one, or one is chosen."""
    stamp = SimpleNamespace(sec=1, nanosec=0)
    header = SimpleNamespace(stamp=stamp)
    states = [SimpleNamespace(name=["a"], position=np.array([q]), header=header)
              for q in (0.5, 1.5)]  # fmt: skip
    found = bags._chosen(states, bags.STATES, "/a", "")
    assert [one["positions"] for one in found["points"]] == [[0.5], [1.5]]
    assert bags._chosen([7], bags.PLANS[0], "/a", "") == 7
    assert [bags._chosen([7, 8], bags.PLANS[0], "/a", k) for k in "01"] == [7, 8]
    with pytest.raises(InvalidInput, match="has 2 messages; choose by topic /a#K"):
        bags._chosen([7, 8], bags.PLANS[0], "/a", "")
    with pytest.raises(InvalidInput, match="has messages 0 to 1, not '2'"):
        bags._chosen([7, 8], bags.PLANS[0], "/a", "2")


def test_without_rosbags_it_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with pytest.raises(InvalidFile, match=r"none\.mcap: does not exist"):
        read_bag(tmp_path / "none.mcap")
    monkeypatch.setattr(bags, "find_spec", lambda _: None)
    with pytest.raises(InvalidFile, match=r"t\.bag: bags need rosbags: pip install"):
        read_bag(tmp_path / "t.bag")
    for ending in (".bag", ".mcap"):
        with pytest.raises(
            InvalidInput, match=rf"^\{ending} needs rosbags: pip install"
        ):
            write_bag(motion(0), tmp_path / f"t{ending}")
    assert not any(tmp_path.iterdir())


def test_bags_without_trajectories_are_told(tmp_path: Path) -> None:
    """No topic of one, and a topic without a message: there is none to choose."""
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    types = pytest.importorskip("rosbags.typesys")
    store = types.get_typestore(types.Stores.ROS2_HUMBLE)
    for kind, said in (
        ("std_msgs/msg/String", "bag: has no topic of trajectories$"),
        (bags.PLANS[0], "bag: topic /a has no message$"),
        (bags.STATES, "bag: topic /a has no message$"),
    ):
        bag = tmp_path / kind.replace("/", "_") / "bag"
        bag.parent.mkdir()
        with rosbag2.Writer(bag, version=9) as writer:
            writer.add_connection("/a", kind, typestore=store)
        with pytest.raises(InvalidFile, match=said):
            read_bag(bag)


@pytest.mark.parametrize("key", ["positions", "velocities", "accelerations"])
@pytest.mark.parametrize("lacking", [0, 1])
def test_what_some_points_have_all_must_have(key: str, lacking: int) -> None:
    """Else straight lines would be judged in place of smooth pieces."""
    keys = "positions", "velocities", "accelerations"
    points = [{key: [0.5] for key in keys} | {"time_from_start": k} for k in range(2)]
    assert of_message(Place.of("t", {"joint_names": ["a"], "points": points}))
    del points[lacking][key]
    with pytest.raises(InvalidFile, match=rf"points\[{lacking}\].{key}"):
        of_message(Place.of("t", {"joint_names": ["a"], "points": points}))


def test_recorded_states_are_rows_at_times_from_the_first() -> None:
    def state(names: str, q: list[float], sec: int, nanosec: int) -> SimpleNamespace:
        stamp = SimpleNamespace(sec=sec, nanosec=nanosec)
        header = SimpleNamespace(stamp=stamp)
        return SimpleNamespace(name=[*names], position=np.array(q), header=header)

    states = [state("ab", [1.0, 2.0], 7, 5), state("ba", [3.0, 4.0], 9, 250_000_005)]
    found = of_message(Place.of("t", bags._states(states)))
    assert found.names == ("a", "b")
    assert found.q.tolist() == [[1.0, 2.0], [4.0, 3.0]]
    assert found.times is not None
    assert found.times.tolist() == [0.0, 2.25]


@pytest.mark.parametrize("ending", [".json", ".yaml"])
def test_what_is_wrong_with_messages_is_said(
    tmp_path: Path, robot: Robot, ending: str
) -> None:
    good = json.loads(text_of(motion(0), ".json"))
    display = {"trajectory": [{"joint_trajectory": good}] * 2}
    turned = {"positions": [90.0, 0.0]}
    for data, said in (
        (display, r"trajectory .*: has 2 trajectories, expected one$"),
        (display | {"trajectory": [good, good]}, r"trajectory .*: has 2 traj"),
        ({"trajectory": [good | {"points": []}]}, r"trajectory\[0\].*is no JointTraj"),
        ({"trajectory": []}, r"trajectory .*: has 0 trajectories, expected one$"),
        (good | {"points": [turned]}, "is it in degrees. expected radians$"),
        (good | {"points": [[0, 0]]}, r"points\[0\] .*: has no positions$"),
        (good | {"points": {}}, "is no JointTrajectory"),
        (good | {"joint_names": ["turn", 1]}, "joint_names .*'1', expected names"),
        ([good], "is no trajectory: expected joint_names and points$"),
    ):
        file = write(tmp_path, f"t{ending}", json.dumps(data, indent=1))
        with pytest.raises(InvalidFile, match=said):
            read_motion(file, robot.joints)


@pytest.mark.parametrize(
    ("names", "q"), [(["a", "b"], 3), (["a", "b"], 1), (["a"], 1), (["a", "b", "c"], 3)]
)
def test_no_position_of_a_state_is_left_out(names: list[str], q: int) -> None:
    """Each message has one position of each joint of the first, in any order."""
    stamp = SimpleNamespace(sec=0, nanosec=0)

    def state(names: list[str], q: int) -> SimpleNamespace:
        header = SimpleNamespace(stamp=stamp)
        return SimpleNamespace(header=header, name=names, position=np.arange(q) + 0.5)

    good = [state(["a", "b"], 2), state(["b", "a"], 2)]
    points = bags._states(good)["points"]
    assert [p["positions"] for p in points] == [[0.5, 1.5], [1.5, 0.5]]
    with pytest.raises(InvalidInput, match=f"message 1: has {q} positions of"):
        bags._states([good[0], state(names, q)])


def test_sizes_of_bags_are_held_before_they_are_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("rosbags")
    file = tmp_path / "t.mcap"
    write_bag(JointTrajectory(("a",), np.zeros((3, 1))), file)
    assert len(read_bag(file).q) == 3
    monkeypatch.setattr(bags, "MOST", 0)
    with pytest.raises(InvalidFile, match="more than 0 messages under topic"):
        read_bag(file)
    monkeypatch.setattr(bags, "LARGEST", file.stat().st_size - 1)
    with pytest.raises(InvalidFile, match="GiB that are read of a bag"):
        read_bag(file)


def test_joints_of_several_degrees_turn_about_z(tmp_path: Path) -> None:
    text = URDF.replace('type="prismatic"', 'type="planar"')
    text = text.replace('<axis xyz="0 1 0"/>', "")
    text = text.replace('joint="slide"', 'joint="turn"')
    robot = read_robot(RobotFiles(write(tmp_path, "planar.urdf", text)))
    angles = [3.0, 3.3]
    message = {
        "joint_trajectory": {
            "joint_names": ["turn"],
            "points": [{"positions": [0.1]}, {"positions": [0.2]}],
        },
        "multi_dof_joint_trajectory": {
            "joint_names": ["slide"],
            "points": [
                {
                    "transforms": [
                        {
                            "translation": {"x": 1, "y": 2, "z": 0},
                            "rotation": {
                                "x": 0,
                                "y": 0,
                                "z": np.sin(angle / 2),
                                "w": np.cos(angle / 2),
                            },
                        }
                    ]
                }
                for angle in angles
            ],
        },
    }
    found = read_motion(write(tmp_path, "t.json", json.dumps(message)), robot.joints)
    np.testing.assert_allclose(found.q[:, 3], angles)
    np.testing.assert_array_equal(found.q[:, :3], [[0.1, 1, 2], [0.2, 1, 2]])
    bad = json.dumps(message).replace('"x": 0', '"x": 0.5', 1)
    with pytest.raises(InvalidFile, match="rotation has length"):
        read_motion(write(tmp_path, "t.json", bad), robot.joints)
    tilted = json.dumps(message).replace('"x": 0', '"x": 0.03', 1)
    with pytest.raises(InvalidFile, match="another axis than z"):
        read_motion(write(tmp_path, "t.json", tilted), robot.joints)
    high = json.dumps(message).replace('"z": 0}', '"z": 0.2}', 1)
    with pytest.raises(InvalidFile, match="'slide' is planar, expected z 0"):
        read_motion(write(tmp_path, "t.json", high), robot.joints)


@pytest.mark.parametrize("tilt", [0.0, 1.2, 0.5 * np.pi, 0.5 * np.pi - 1e-12, -1e-9])
def test_quaternions_turn_as_their_roll_pitch_and_yaw(tilt: float) -> None:
    """Oracle: Rodrigues' products; where the pitch is 90 deg too, which has no yaw."""
    half = np.linspace(-1.5, 1.5, 7) / 2.0
    for sign, a, b in itertools.product((1.0, -1.0), half, half):
        turned = np.array([1.0, 0.0, 0.0, 0.0])  # w, x, y, z
        for axis, angle in ((3, a), (2, sign * tilt / 2.0), (1, b)):
            about = np.eye(4)[0] * np.cos(angle) + np.eye(4)[axis] * np.sin(angle)
            w, v = turned[0], turned[1:]
            turned = np.array(
                [
                    w * about[0] - v @ about[1:],
                    *(w * about[1:] + about[0] * v + np.cross(v, about[1:])),
                ]
            )
        pose = {
            "translation": dict.fromkeys("xyz", 0.0),
            "rotation": dict(zip("wxyz", turned.tolist(), strict=True)),
        }
        message = {"joint_names": ["f"], "points": [{"transforms": [pose]}]}
        data = {"multi_dof_joint_trajectory": message}
        found = of_message(Place.of("t", data))
        rows = rotation_from_rpy(found.q[0, :2:-1])
        w, v = turned[0], turned[1:]
        for row, unit in zip(rows.T, np.eye(3), strict=True):
            expected = unit + 2.0 * np.cross(v, np.cross(v, unit) + w * unit)
            np.testing.assert_allclose(row, expected, rtol=0, atol=2e-15)


POINT = '{{"positions": [{}, 0], {}"time_from_start": {}}}'


@pytest.mark.parametrize(
    ("rates", "time", "said"),
    [
        ('"velocities": [0, 1], ', 0, "velocities, expected times too"),
        ('"accelerations": [0, 1], ', 1, "accelerations, expected velocities too"),
        ("", '{"sec": 1, "nsec": 5}', r"time_from_start .*: is .*expected seconds"),
        ("", "{}", r"time_from_start .*: is .*expected seconds"),
        ("", '{"sec": 1, "secs": 2}', r"time_from_start .*: is .*expected seconds"),
        ("", '{"sec": 1, "nsecs": 5}', r"time_from_start .*: is .*expected seconds"),
        ('"velocities": [0, 0], ', 0, None),
        ('"velocities": [0, 0], "accelerations": [0, 1], ', 1, None),
    ],
)
def test_rates_without_what_they_need_are_refused(
    tmp_path: Path, robot: Robot, rates: str, time: int | str, said: str | None
) -> None:
    """As of a table: straight lines would be judged, which no controller runs."""
    points = ", ".join(
        POINT.format(k, rates, time if isinstance(time, str) else k * time)
        for k in range(2)
    )
    text = f'{{"joint_names": ["turn", "slide"], "points": [{points}]}}'
    file = write(tmp_path, "t.json", text)
    if said is None:
        assert len(read_path(file, robot).knots) == 2
        return
    with pytest.raises(InvalidFile, match=said):
        read_path(file, robot)


@pytest.mark.parametrize(
    ("stated", "seconds"),
    [
        *[(1.25, 1.25), ({"sec": 2, "nanosec": 5}, 2.000000005), ({"sec": 3}, 3.0)],
        *[({"secs": 2, "nsecs": 5}, 2.000000005), ({"nsecs": 7}, 7e-9)],
        ({"nanosec": 250_000_000}, 0.25),
    ],
)
def test_times_are_seconds_or_durations_of_either_ros(
    stated: object, seconds: float
) -> None:
    points = [{"positions": [0.0]}, {"positions": [0.0], "time_from_start": stated}]
    points[0]["time_from_start"] = 0  # type: ignore[assignment]
    found = of_message(Place.of("t", {"joint_names": ["a"], "points": points}))
    assert found.times is not None
    assert found.times.tolist() == [0.0, pytest.approx(seconds, rel=1e-15)]


SPIN = {
    "translation": dict.fromkeys("xyz", 0.0),
    "rotation": dict.fromkeys("xyz", 0.0) | {"w": 1.0},
}
ROW = {"positions": [0.0], "velocities": [0.0], "time_from_start": 1.0}


def message(*points: object, free: list[object] | None = None) -> dict[str, object]:
    """Of a joint, and of one of several degrees where there are points of it."""
    one = {"joint_names": ["a"], "points": [*points]} if points else {}
    other = {"joint_names": ["f"], "points": free}
    return {"joint_trajectory": one, "multi_dof_joint_trajectory": other}


@pytest.mark.parametrize(
    ("data", "said"),
    [
        ({"joint_names": ["a"], "points": {"a": 1}}, "points: is no list"),
        (message({"positions": [10**400]}), "expected 1 finite numbers"),
        (message(free=[{"transforms": []}]), "transforms: expected one for each of 1"),
        (
            message(free=[{"transforms": [SPIN], "velocities": [1]}]),
            "has velocities of joints of several degrees, expected none",
        ),
        (
            message(free=[{"transforms": [SPIN | {"rotation": {"w": 1}}]}]),
            "rotation: is {'w': 1}, expected numbers x, y, z, w",
        ),
        (
            message(free=[{"transforms": [SPIN | {"translation": [0, 0, 0]}]}]),
            r"translation: is \[0, 0, 0\], expected numbers x, y, z",
        ),
        (
            message({"positions": [0]}, free=2 * [{"transforms": [SPIN]}]),
            "has 2 points beside 1 of joint_trajectory",
        ),
        (
            message(ROW, free=[{"transforms": [SPIN]}]),
            "has no velocities, but joint_trajectory has: leave them out",
        ),
        (
            message(
                ROW | {"velocities": []},
                free=[{"transforms": [SPIN], "time_from_start": 2}],
            ),
            "has other times than joint_trajectory",
        ),
    ],
)
def test_odd_messages_are_refused(data: object, said: str) -> None:
    with pytest.raises((InvalidFile, InvalidInput), match=said):
        of_message(Place.of("t", data))


ODD = {
    "turn_rad,slide_m,turn_velocity_rad_s\n0,0,0\n": "no column slide_velocity_m_s",
    "turn_rad,slide_m,turn_velocity_m_s,slide_velocity_m_s\n": "expected _rad or _deg",
    "turn_rad,slide_m,turn_velocity_rad_s,slide_velocity_m_s\n": "expected time_s",
    "turn_rad,slide_m,turn_velocity_rad_s,turn_velocity_deg_s\n": "expected one of",
    "turn_rad,slide_m,time_s\n0,0,1\n0,0,1\n": "line 3: time is 1 s after 1 s",
    "turn_rad,slide_m,time_s\n0,0,1\n0,0,2\n0,0,1.5\n": "line 4: time is 1.5 s after 2",
}


@pytest.mark.parametrize("text", ODD)
def test_odd_tables_are_refused(tmp_path: Path, robot: Robot, text: str) -> None:
    with pytest.raises(InvalidFile) as caught:
        read_path(write(tmp_path, "t.csv", text), robot)
    assert ODD[text] in str(caught.value)


def test_points_of_messages_whose_times_do_not_rise_are_named(
    tmp_path: Path, robot: Robot
) -> None:
    given = replace(motion(0), times=np.array([0.0, 1.0, 2.0, 2.0, 3.0]))
    file = written(tmp_path, ".yaml", given, robot)
    with pytest.raises(InvalidFile, match=r"points\[3\]: time is 2 s after 2 s"):
        read_path(file, robot)


def test_rates_agree_with_dense_samples() -> None:
    """Limits just above and below what samples find; near a limit, neither is wrong."""
    rng = np.random.default_rng(3)
    verdicts = set()
    for trial in range(60):
        rows = int(rng.integers(2, 5))
        q, rates, changes = rng.normal(size=(3, rows, 1))
        times = np.cumsum(rng.uniform(0.1, 2.0, rows))
        path = (
            Motion.through(q, times, rates)
            if trial % 2
            else Motion.through(q, times, rates, changes)
        )
        dense = np.linspace(times[0], times[-1], 20_001)
        step = dense[1] - dense[0]
        speeds = np.gradient(path.at(dense)[:, 0], step)
        bends = np.gradient(speeds, step)
        inner = [float(np.abs(values).max()) for values in (speeds, bends)]
        for share in (0.98, 1.02):
            joint = RobotJoint("a", -9, 9, True, share * inner[0], share * inner[1])
            speed, bend = rate_checks((joint,), path)
            expected = Verdict.REFUTED if share < 1 else Verdict.CERTIFIED
            assert speed.verdict is expected
            verdicts.add(bend.verdict)
    assert Verdict.REFUTED in verdicts


def test_limits_of_rates_are_judged_where_times_are(
    tmp_path: Path, robot: Robot
) -> None:
    """1 rad/s of the URDF: 2 rad in 1.9 s refuted, in 2.1 s certified, by hand."""
    write(tmp_path, "s.yaml", SCENE)
    for seconds, verdict in ((1.9, Verdict.REFUTED), (2.1, Verdict.CERTIFIED)):
        text = f"turn_rad,slide_m,time_s\n0,0,0\n2,0,{seconds}\n"
        path = read_path(write(tmp_path, "t.csv", text), robot)
        turn, slide = rate_checks(robot.joints, path)
        assert turn.verdict is verdict
        assert turn.worst == pytest.approx(2.0 / seconds)
        assert slide.verdict is Verdict.CERTIFIED
    bent = RobotJoint("turn", -3, 3, True, acceleration=1.0)
    assert rate_checks((bent,), path)[0].verdict is Verdict.UNDECIDED
    assert rate_checks(robot.joints, read_path(tmp_path / "t.csv", robot)) != []


def test_damaged_trajectories_never_end_in_a_traceback(
    tmp_path: Path, robot: Robot
) -> None:
    rng = np.random.default_rng(5)
    refused = 0
    for ending in (".csv", ".yaml", ".json"):
        text = written(tmp_path, ending, motion(2), robot).read_text()
        for _ in range(100):
            try:
                read_path(write(tmp_path, f"t{ending}", mutated(text, rng)), robot)
            except VdsmError as error:
                refused += 1
                assert len(str(error).splitlines()) == 1
    assert refused > 100


@pytest.mark.parametrize("ending", [".bag", ".mcap"])
def test_damaged_bags_end_in_one_sentence(
    tmp_path: Path, robot: Robot, ending: str
) -> None:
    """Bytes changed or cut off; sizes that are damaged may ask for any memory."""
    rng, refused = np.random.default_rng(8), 0
    whole = written(tmp_path, ending, motion(2), robot).read_bytes()
    for k in range(60):
        content = bytearray(whole)
        for at in rng.integers(len(content), size=int(rng.integers(1, 4))):
            content[at] = int(rng.integers(256))
        end = int(rng.integers(len(whole))) if k % 3 == 0 else len(whole)
        (tmp_path / f"t{ending}").write_bytes(content[:end])
        try:
            found = read_bag(tmp_path / f"t{ending}")
        except VdsmError as error:
            refused += 1
            assert len(str(error).splitlines()) == 1
            assert str(error).isprintable()
        else:
            assert np.isfinite(found.q).all()
    assert 20 < refused < 60


def test_a_changed_byte_of_a_message_in_mcap_is_refused(
    tmp_path: Path, robot: Robot
) -> None:
    """Oracle: zlib.crc32 over the chunk, as the MCAP format has it."""
    given = motion(2)
    file = written(tmp_path, ".mcap", given, robot)
    whole = file.read_bytes()
    begin = 8 + 9 + int.from_bytes(whole[9:17], "little") + 9  # magic, header, chunk
    size = int.from_bytes(whole[begin - 8 : begin], "little")
    records = whole[begin + 40 : begin + size]
    assert whole[begin + 24 : begin + 28] == zlib.crc32(records).to_bytes(4, "little")
    first = whole.index(given.q.tobytes()[:16])
    for at in range(first, first + 16):
        file.write_bytes(whole[:at] + bytes([whole[at] ^ 1]) + whole[at + 1 :])
        with pytest.raises(InvalidFile, match="cannot be read by rosbags: Chunk check"):
            read_bag(file)


def run(*arguments: object) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(argument) for argument in arguments])
    return int(str(ended.value.code))


def test_trajectories_are_converted(
    tmp_path: Path, robot: Robot, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a robot and of the arm, to every format and back to the same numbers."""
    pytest.importorskip("rosbags")
    formats = [word for name in conversion.FORMATS for word in ("--also", name)]
    given = motion(1)
    cell = write(tmp_path, "cell.yaml", CELL + SCENE)
    file, out = written(tmp_path, ".csv", given, robot), tmp_path / "out"
    assert run("convert", cell, "--trajectory", file, "--out", out, *formats) == 0
    robots = "robot_trajectory.yaml", "robot_trajectory.json"
    names = [*(f"trajectory{ending}" for ending in FORMATS), *robots]
    for name in names:
        found = read_motion(out / name, robot.joints)
        np.testing.assert_array_equal(found.q, given.q)
        np.testing.assert_array_equal(found.rates, given.rates)
    assert [*json.loads((out / robots[1]).read_text())] == ["joint_trajectory"]
    again = "convert", cell, "--trajectory", out / "trajectory", "--out", out
    assert run(*again, "--also", "db3") == 2
    assert "is an input" in capsys.readouterr().err
    assert run(*again) == 0
    assert run("convert", cell, "--cables", file, "--out", out) == 2
    problem = read_problem("paper/obs1")
    rng = np.random.default_rng(8)
    angles = rng.uniform(-0.1, 0.1, (2, 4, 8))
    flags = np.zeros(4, dtype=np.bool_)
    arm = Trajectory(flags, np.zeros(4), rng.uniform(0, 1, 4), *angles)
    write_trajectory(arm, tmp_path / "arm.csv")
    words = ("convert", "paper/obs1", "--trajectory")
    assert run(*words, tmp_path / "arm.csv", "--out", out, *formats) == 0
    for name in names:
        back = tmp_path / "back"
        assert run(*words, out / name, "--out", back) == 0
        found = read_trajectory(back / "trajectory.csv", problem.manipulator)
        np.testing.assert_array_equal(found.joints, arm.joints)
        if name != "trajectory.csv":
            judge = "verify", "paper/obs1", "--trajectory", out / name
            assert run(*judge, "--out", back) == 2
            assert f"{name}: is no CSV; `vdsm convert" in capsys.readouterr().err
    bag = out / "trajectory.bag"
    for topic, status in (("/joint_trajectory", 0), ("/other", 2)):
        assert run(*words, bag, "--topic", topic, "--out", back) == status
    for asked in (words, ("convert", cell, "--trajectory")):
        assert run(*asked, out / "trajectory.csv", "--topic", "a", "--out", back) == 2
        assert "is no bag, so topic 'a' has no" in capsys.readouterr().err


@pytest.mark.parametrize("ending", [".json", ".mcap", ".bag"])
def test_times_of_whole_nanoseconds_come_back(
    tmp_path: Path, robot: Robot, ending: str
) -> None:
    """Of any length, stamps of our day too: their nearest doubles, to the last bit."""
    rng = np.random.default_rng(3)
    nanos = np.sort(rng.integers(0, 2 * 10 ** rng.integers(8, 19, 200)))
    times = np.array([*dict.fromkeys(k / 10**9 for k in nanos.tolist())])
    given = JointTrajectory(("turn", "slide"), np.zeros((len(times), 2)), times)
    found = read_motion(written(tmp_path, ending, given, robot), robot.joints)
    assert len(times) > 150
    np.testing.assert_array_equal(found.times, times)


@pytest.mark.parametrize("name", [*conversion.FORMATS])
def test_times_that_no_duration_tells_are_refused(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str
) -> None:
    write(tmp_path, "two.urdf", URDF)
    cell, out = write(tmp_path, "cell.yaml", CELL + SCENE), tmp_path / "out"
    for times, expected in {
        (0.0, 3e9): "time is 3e+09 s, but durations of ROS end at",
        (-1e300, 0.0): "time is -1e+300 s, but durations",
        (1.0, 1.0 + 1e-12): "a nanosecond apart",
    }.items():
        rows = "".join(f"0,0,{time!r}\n" for time in times)
        file = write(tmp_path, "t.csv", f"turn_rad,slide_m,time_s\n{rows}")
        asked = "convert", cell, "--trajectory", file, "--also", name, "--out", out
        assert run(*asked) == 2
        assert expected in capsys.readouterr().err
        assert not [*out.iterdir()]


def test_a_disk_that_is_full_is_told(tmp_path: Path) -> None:
    pytest.importorskip("rosbags")
    code = (
        "import resource, sys\nfrom vdsm_pin.cli import main\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))\nmain(sys.argv[1:])\n"
    )
    write(tmp_path, "two.urdf", URDF)
    cell = write(tmp_path, "cell.yaml", CELL + SCENE)
    file = write(tmp_path, "t.csv", "turn_rad,slide_m,time_s\n0,0,0\n0,0,1\n")
    asked = ["convert", cell, "--trajectory", file, "--also", "db3", "--out", tmp_path]
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, asked[:-1]), str(tmp_path / "out")],
        capture_output=True,
        check=False,
        text=True,
    )
    assert done.returncode == 2
    assert "trajectory: cannot be written: disk I/O error" in done.stderr
    assert "Traceback" not in done.stderr


@pytest.mark.parametrize("ending", FORMATS)
def test_joints_that_stand_still_are_not_moved(
    tmp_path: Path, urdf: Path, ending: str
) -> None:
    """Where the file moves a joint that is held, its motion is not what is judged."""
    whole, given = read_robot(RobotFiles(urdf)), motion(0)
    held = float(given.q[0, 1])
    robot = read_robot(RobotFiles(urdf, lock={"slide": held}))
    file = written(tmp_path, ending, given, whole)
    with pytest.raises(InvalidFile, match=r"'slide' at .* stands still and is judged"):
        read_motion(file, robot.joints, values=robot.values)
    q = given.q.copy()
    q[:, 1] = held
    file = written(tmp_path, ending, replace(given, q=q), whole)
    found = read_motion(file, robot.joints, values=robot.values)
    assert found.names == ("turn",)
    assert found.notes == ()
    q[2, 1] += 5e-7
    file = written(tmp_path, ending, replace(given, q=q), whole)
    found = read_motion(file, robot.joints, values=robot.values)
    assert found.notes == ("joint 'slide' is up to 5e-07 off where it is judged",)
    q[2, 1] += 2e-6
    file = written(tmp_path, ending, replace(given, q=q), whole)
    with pytest.raises(InvalidFile, match=r"'slide' at .* stands still and is judged"):
        read_motion(file, robot.joints, values=robot.values)


def test_joints_that_follow_agree_with_what_they_follow(
    tmp_path: Path, robot: Robot
) -> None:
    """Follow = 2 slide + 0.1."""
    for value, why in ((0.3, ""), (0.31, "mimics another and is judged at 0.3")):
        rows = f"turn_rad,slide_m,follow_rad\n0,0.1,{value}\n"
        file = write(tmp_path, "t.csv", rows)
        if not why:
            assert read_motion(file, robot.joints, values=robot.values).notes == ()
            near = write(tmp_path, "n.csv", rows.replace("0.3\n", "0.3005\n"))
            (note,) = read_motion(near, robot.joints, values=robot.values).notes
            assert note == "joint 'follow' is up to 0.0005 off where it is judged"
            continue
        with pytest.raises(InvalidFile, match=why):
            read_motion(file, robot.joints, values=robot.values)


def test_what_is_not_read_is_noted(tmp_path: Path, robot: Robot) -> None:
    file = write(tmp_path, "t.csv", "turn_rad,slide_m,wheel_rad,label\n0,0,9,1\n")
    (note,) = read_motion(file, robot.joints, values=robot.values).notes
    assert note == "columns that are not read: 'wheel_rad', 'label'"
    rows = {
        "joint_names": ["turn", "slide", "wheel"],
        "points": [{"positions": [0] * 3}],
    }
    file = write(tmp_path, "t.json", json.dumps(rows))
    (note,) = read_motion(file, robot.joints, values=robot.values).notes
    assert note == "joints that are not read: 'wheel'"


def test_a_joint_that_goes_the_long_way_round_is_noted(tmp_path: Path) -> None:
    """One without limits; half a turn, or one between limits, is as it must be."""
    free = URDF.replace('type="revolute"', 'type="continuous"', 1)
    robot = read_robot(RobotFiles(write(tmp_path, "free.urdf", free)))
    for values, words in (
        ((0, 3, -3, -2), "344° between waypoints 1 and 2: judged as it stands"),
        (
            (0, 3, -3, 3),
            "344° between waypoints 1 and 2, the first of 2 such turns: jud",
        ),
        ((-1.5, 1.5, 4), ""),
        ((0,), ""),
    ):
        rows = "".join(f"{value},0\n" for value in values)
        file = write(tmp_path, "t.csv", f"turn_rad,slide_m\n{rows}")
        notes = read_motion(file, robot.joints, values=robot.values).notes
        assert len(notes) == bool(words)
        assert all(f"joint 'turn' turns by {words}" in note for note in notes)
    file = write(tmp_path, "t.csv", "turn_deg,slide_m\n0,0\n36000,0\n")
    many = read_motion(file, robot.joints, values=robot.values)
    assert many.q[1, 0] == pytest.approx(200.0 * np.pi)
    assert "turns by 36000° between" in many.notes[0]
    again = write(tmp_path, "again.csv", csv_text(many, robot))
    np.testing.assert_allclose(read_path(again, robot).knots, many.q, rtol=1e-15)
    file = write(tmp_path, "t.csv", "turn_rad,slide_m\n3,0\n-3,0\n")
    limited = read_robot(RobotFiles(write(tmp_path, "two.urdf", URDF)))
    assert read_motion(file, limited.joints, values=limited.values).notes == ()


def test_a_joint_has_one_column(tmp_path: Path, robot: Robot) -> None:
    file = write(tmp_path, "t.csv", "turn_rad,slide_m,turn_deg\n0,0,90\n")
    with pytest.raises(InvalidFile, match="expected one of them"):
        read_motion(file, robot.joints)


def test_names_with_signs_of_csv_are_read_back(tmp_path: Path) -> None:
    name = "a;b, 'c' &quot;d&quot;"
    text = URDF.replace('"turn"', f'"{name}"')
    robot = read_robot(RobotFiles(write(tmp_path, "odd.urdf", text)))
    given = replace(motion(0), names=tuple(joint.name for joint in robot.joints))
    file = write(tmp_path, "t.csv", csv_text(given, robot))
    np.testing.assert_array_equal(read_motion(file, robot.joints).q, given.q)


def test_a_folder_of_a_ros_2_bag_is_verified_and_checked(
    tmp_path: Path, robot: Robot, capsys: pytest.CaptureFixture[str]
) -> None:
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    types = pytest.importorskip("rosbags.typesys")
    store, bag = types.get_typestore(types.Stores.ROS2_HUMBLE), tmp_path / "bag"
    message = store.serialize_cdr(bags._typed(store, motion(0)), bags.PLANS[0])
    with rosbag2.Writer(bag, version=9) as writer:
        topic = writer.add_connection(bags.TOPIC, bags.PLANS[0], typestore=store)
        writer.write(topic, 0, message)
    free = CELL.replace("149", "0").replace("robot:", "length_unit: mm\nrobot:")
    cell, proof = write(tmp_path, "cell.yaml", free), tmp_path / "proof"
    asked = "--trajectory", bag, "--out", tmp_path / "out", "--certificate", proof
    assert run("verify", cell, *asked) == 0
    assert run("check-certificate", proof, cell, bag) == 0
    (bag / "metadata.yaml").write_bytes((bag / "metadata.yaml").read_bytes() + b"\n")
    assert run("check-certificate", proof, cell, bag) == 1
    (bag / "more").mkdir()
    assert run("check-certificate", proof, cell, bag) == 1
    (bag / "metadata.yaml").unlink()
    assert run("check-certificate", proof, cell, bag) == 2
    assert f"{bag}: is a folder, expected a file" in capsys.readouterr().err
