"""The trajectory CSV: exact round trips, and every kind of damage named."""

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from vdsm_pin.errors import InvalidFile
from vdsm_pin.io import trajectory_file
from vdsm_pin.io.trajectory_file import column_names, read_trajectory, write_trajectory
from vdsm_pin.manipulator import Manipulator, built_in
from vdsm_pin.trajectory import Trajectory

HRM8 = built_in("hrm8")
FIELDS = ("on_path", "path_m", "x0", "alpha", "theta")


def short_arm() -> Manipulator:
    lengths = np.full(2, 0.5)
    cables = type(HRM8.cables)(0.05, 0.03, HRM8.cables.hole_angles[:2])
    return Manipulator("two", lengths, 0.06, 0.7, 0.7, (-1.0, 1.0), cables)


def random_trajectory(n: int, n_links: int, seed: int = 0) -> Trajectory:
    rng = np.random.default_rng(seed)
    q = rng.uniform(-0.7, 0.7, (n, 1 + 2 * n_links))
    stations = np.cumsum(rng.uniform(0, 0.01, n))
    return Trajectory(
        rng.uniform(size=n) < 0.5, stations, q[:, 0], q[:, 1::2], q[:, 2::2]
    )


def same(a: Trajectory, b: Trajectory) -> bool:
    """Equal to the last bit, the sign of zero included."""
    return all(getattr(a, f).tobytes() == getattr(b, f).tobytes() for f in FIELDS)


def test_header_is_the_contract() -> None:
    assert ",".join(column_names(2)) == (
        "waypoint,on_path,path_m,x0_m,alpha1_rad,theta1_rad,alpha2_rad,theta2_rad"
    )
    assert column_names(8)[-2:] == ("alpha8_rad", "theta8_rad")


def test_file_is_text_as_stated(tmp_path: Path) -> None:
    one = np.array([[0.1, 1e-20], [-0.0, 1 / 3]])
    trajectory = Trajectory([True, False], [0.0, 0.01], [1.0, -2.5], one, -one)
    write_trajectory(tmp_path / "t.csv", trajectory)
    assert (tmp_path / "t.csv").read_bytes() == (
        b"waypoint,on_path,path_m,x0_m,alpha1_rad,theta1_rad,alpha2_rad,theta2_rad\n"
        b"0,1,0.0,1.0,0.1,-0.1,1e-20,-1e-20\n"
        b"1,0,0.01,-2.5,-0.0,0.0,0.3333333333333333,-0.3333333333333333\n"
    )


finite = st.floats(allow_nan=False, allow_infinity=False)


@settings(max_examples=60, deadline=None)
@given(
    angles=arrays(np.float64, (3, 4), elements=finite),
    stations=arrays(np.float64, 3, elements=st.floats(0.0, 1e300)),
    on_path=arrays(np.bool_, 3),
)
def test_every_double_comes_back_to_the_last_bit(
    tmp_path_factory: pytest.TempPathFactory,
    angles: np.ndarray,
    stations: np.ndarray,
    on_path: np.ndarray,
) -> None:
    path = tmp_path_factory.mktemp("round") / "t.csv"
    trajectory = Trajectory(
        on_path, np.abs(stations), angles[:, 0], angles[:, :2], angles[:, 2:]
    )
    write_trajectory(path, trajectory)
    assert same(read_trajectory(path, short_arm()), trajectory)


@pytest.mark.parametrize("n", [1, 4_999, 5_000, 5_001])
def test_round_trip_across_chunks(tmp_path: Path, n: int) -> None:
    trajectory = random_trajectory(n, 2)
    write_trajectory(tmp_path / "t.csv", trajectory)
    assert same(read_trajectory(tmp_path / "t.csv", short_arm()), trajectory)


def test_other_programs_habits_are_read(tmp_path: Path) -> None:
    """A byte order mark, CR LF, blanks, floats for whole numbers, gaps in waypoint."""
    path = tmp_path / "t.csv"
    header = ",".join(column_names(2))
    path.write_bytes(
        f"\ufeff{header}\r\n1.0,1, 0.0,1,0,+0,0,1E-3\r\n7,0.0,0,1,.5,0,0,0\r\n".encode()
    )
    trajectory = read_trajectory(path, short_arm())
    assert trajectory.on_path.tolist() == [True, False]
    assert trajectory.theta[0].tolist() == [0.0, 1e-3]
    assert trajectory.alpha[1].tolist() == [0.5, 0.0]


def csv(rows: int = 3) -> list[str]:
    header = ",".join(column_names(2))
    return [header, *(f"{k},1,{k / 100},0.5,0.1,0.2,0.3,0.4" for k in range(rows))]


def refusal(path: Path) -> str:
    with pytest.raises(InvalidFile) as caught:
        read_trajectory(path, short_arm())
    message = str(caught.value)
    assert "\n" not in message
    assert message.startswith(f"{path}: ")
    return message.removeprefix(f"{path}: ")


def refused(folder: Path, content: str | bytes) -> str:
    path = folder / "t.csv"
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return refusal(path)


@pytest.mark.parametrize(
    ("line", "text", "expected"),
    [
        (0, "", "line 1: column 1 is missing, expected 'waypoint'"),
        (0, "x" + csv()[0], "line 1: column 1 is 'xwaypoint', expected 'waypoint'"),
        (0, csv()[0].replace("x0_m", "x0_mm"), "column 4 is 'x0_mm', expected 'x0_m'"),
        (
            0,
            csv()[0] + ",alpha3_rad",
            "has 9 columns, expected 8 for an arm of 2 links",
        ),
        (0, csv()[0][: csv()[0].rindex(",")], "column 8 is missing, expected 'theta2"),
        (0, "\u2460", "line 1: column 1 is '\u2460', expected 'waypoint'"),
        (2, "1,1,0,0,0,0,0", "line 3: has 7 values, expected 8"),
        (2, "1,1,0,0,0,0,0,0,0", "line 3: has 9 values, expected 8"),
        (2, "1,1,0,0,0,abc,0,0", "line 3: theta1_rad is 'abc', expected a number"),
        (2, "1,1,0,0,0,,0,0", "line 3: theta1_rad is '', expected a number"),
        (2, "1,1,0,0,0,nan,0,0", "line 3: theta1_rad is nan, expected a finite number"),
        (2, "1,1,0,0,0,0,-inf,0", "line 3: alpha2_rad is -inf, expected a finite"),
        (2, "1,1,0,0,0,0,1e999,0", "line 3: alpha2_rad is 1e999, expected a finite"),
        (2, "1,1,0,0,0,0,1_0,0", "line 3: alpha2_rad is '1_0', expected a number"),
        (2, "1,1,0,0,0,0,0x1,0", "line 3: alpha2_rad is '0x1', expected a number"),
        (2, "1,1,0,0,0,0,\u0661,0", "line 3: alpha2_rad is '\u0661', expected a num"),
        (2, '1,1,0,0,0,0,"0",0', "line 3: alpha2_rad is '\"0\"', expected a number"),
        (2, "# a remark", "line 3: waypoint is '# a remark', expected a number"),
        (2, "", "line 3: waypoint is '', expected a number"),
        (2, "0,1,0,0,0,0,0,0", "line 3: waypoint is 0, expected a whole number above"),
        (2, "1.5,1,0,0,0,0,0,0", "line 3: waypoint is 1.5, expected a whole number"),
        (1, "-1,1,0,0,0,0,0,0", "line 2: waypoint is -1, expected a whole number"),
        (2, "1,2,0,0,0,0,0,0", "line 3: on_path is 2, expected 0 or 1"),
        (2, "1,1,-0.1,0,0,0,0,0", "line 3: path_m is -0.1, expected 0 or more"),
        (3, csv()[0], "line 4: waypoint is 'waypoint', expected a number"),
    ],
)
def test_damage_is_named_by_line_and_column(
    tmp_path: Path, line: int, text: str, expected: str
) -> None:
    lines = csv()
    lines[line] = text
    assert expected in refused(tmp_path, "\n".join(lines) + "\n")


def test_damage_far_down_is_named_by_its_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trajectory_file, "CHUNK_ROWS", 7)
    lines = csv(50)
    lines[40] = lines[40].replace(",0.3,", ",O.3,")
    assert "line 41: alpha2_rad is 'O.3'" in refused(tmp_path, "\n".join(lines) + "\n")
    lines = csv(50)
    lines[36] = lines[35]  # the first row of a chunk repeats the last one before it
    assert "line 37: waypoint is 34, expected" in refused(
        tmp_path, "\n".join(lines) + "\n"
    )


def test_a_file_cut_short_inside_a_line_is_refused_wherever_the_cut_is(
    tmp_path: Path,
) -> None:
    content = "\n".join(csv()) + "\n"
    whole_rows = [i + 1 for i, c in enumerate(content) if c == "\n"][1:]
    for end in range(len(content)):
        if end not in whole_rows:
            message = refused(tmp_path, content[:end])
            assert (
                "cut short" in message or "is empty" in message or "no row" in message
            )


def test_what_is_no_table_is_refused(tmp_path: Path) -> None:
    assert refusal(tmp_path) == "is a folder, expected a file"
    assert refusal(tmp_path / "none.csv") == "does not exist"
    assert refused(tmp_path, "") == "is empty"
    assert refused(tmp_path, csv()[0] + "\n") == "has no row"
    assert "column 1 is 'steps'" in refused(tmp_path, "steps,x\n")
    assert "cut short" in refused(tmp_path, b"\0" * 1000)
    assert "column 1 is" in refused(tmp_path, bytes(range(256)) * 100 + b"\n\n")
    assert "line 2: waypoint is" in refused(tmp_path, csv()[0] + "\n" + "\n" * 20_000)


def test_more_rows_than_any_trajectory_has_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(trajectory_file, "MAX_ROWS", 2)
    assert refused(tmp_path, "\n".join(csv()) + "\n") == "has 3 rows, the most is 2"


def test_one_endless_line_is_refused_without_reading_it_at_once(tmp_path: Path) -> None:
    content = csv()[0] + "\n" + "0," * 5_000_000 + "\n"
    (tmp_path / "t.csv").write_text(content)
    tracemalloc.start()
    message = refusal(tmp_path / "t.csv")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert message == "line 2: has 32769 values, expected 8"
    assert peak < 40e6


def test_failed_writing_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    write_trajectory(path, random_trajectory(3, 2))
    before = path.read_bytes()
    broken = random_trajectory(3, 2)
    object.__setattr__(broken, "theta", None)
    with pytest.raises(TypeError):
        write_trajectory(path, broken)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["t.csv"]


def test_memory_stays_near_that_of_the_arrays(tmp_path: Path) -> None:
    n = 15_000
    trajectory = random_trajectory(n, 8)
    arrays_size = sum(getattr(trajectory, field).nbytes for field in FIELDS)
    tracemalloc.start()
    write_trajectory(tmp_path / "t.csv", trajectory)
    writing = tracemalloc.get_traced_memory()[1]
    tracemalloc.reset_peak()
    read_trajectory(tmp_path / "t.csv", HRM8)
    reading = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # One chunk of rows: a Python number, a slot and a few copies of 20 letters each.
    chunk = trajectory_file.CHUNK_ROWS * 20 * 150
    assert writing < chunk
    assert reading < 2 * arrays_size + chunk
