"""The trajectory CSV: exact round trips, and every kind of damage named."""

import csv as standard_csv
import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import vdsm_pin as vp
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.cli import main
from vdsm_pin.errors import InvalidFile
from vdsm_pin.io import tables
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import (
    PLACE,
    column_names,
    read_trajectory,
    write_trajectory,
)
from vdsm_pin.problem.trajectory import Trajectory

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


def test_places_on_a_path_may_be_missing_where_there_is_none(tmp_path: Path) -> None:
    """As docs/files.md says; a certificate of such a file is accepted."""
    problem, rows, proof = (tmp_path / name for name in ("p.yaml", "t.csv", "proof"))
    problem.write_text(
        "vdsm_problem: 1\nlength_unit: m\nrequired_clearance: 0.01\nmanipulator: "
        "{link_lengths: [1, 1], link_radius: 0.05, max_link_angle_deg: 40, "
        "max_joint_angle_deg: 40}\nobstacles: [{name: b, shape: sphere, "
        "center: [1, 1, 0], radius: 0.2}]\n"
    )
    names = ",".join(name for name in column_names(2) if name not in PLACE)
    rows.write_text(f"{names}\n0,0.0,0.1,0.2,0.3,0.4\n1,0.5,-0.1,-0.2,-0.3,-0.4\n")
    task = read_problem(problem)
    found = vp.read_trajectory(rows, task)
    np.testing.assert_array_equal(found.joints[1], [0.5, -0.1, -0.2, -0.3, -0.4])
    assert not found.on_path.any() and not found.path_m.any()
    vp.write_certificate(vp.verify(task, found), proof, rows)
    with pytest.raises(SystemExit) as ended:
        main(["check-certificate", str(proof), str(problem), str(rows)])
    assert ended.value.code == 0
    with pytest.raises(InvalidFile, match="has no column 'on_path'"):
        read_trajectory(rows, task.manipulator)


def test_file_is_text_as_stated(tmp_path: Path) -> None:
    one = np.array([[0.1, 1e-20], [-0.0, 1 / 3]])
    trajectory = Trajectory([True, False], [0.0, 0.01], [1.0, -2.5], one, -one)
    write_trajectory(trajectory, tmp_path / "t.csv")
    assert (tmp_path / "t.csv").read_bytes() == (
        b"waypoint,on_path,path_m,x0_m,alpha1_rad,theta1_rad,alpha2_rad,theta2_rad\n"
        b"0,1,0.0,1.0,0.1,-0.1,1e-20,-1e-20\n"
        b"1,0,0.01,-2.5,-0.0,0.0,0.3333333333333333,-0.3333333333333333\n"
    )


angle = st.floats(-np.pi, np.pi)
place = st.floats(-100.0, 100.0)


@settings(max_examples=60, deadline=None)
@given(
    angles=arrays(np.float64, (3, 4), elements=angle),
    x0=arrays(np.float64, 3, elements=place),
    stations=arrays(np.float64, 3, elements=st.floats(0.0, 1e4)),
    on_path=arrays(np.bool_, 3),
)
def test_every_double_comes_back_to_the_last_bit(
    tmp_path_factory: pytest.TempPathFactory,
    angles: np.ndarray,
    x0: np.ndarray,
    stations: np.ndarray,
    on_path: np.ndarray,
) -> None:
    path = tmp_path_factory.mktemp("round") / "t.csv"
    trajectory = Trajectory(on_path, np.abs(stations), x0, angles[:, :2], angles[:, 2:])
    write_trajectory(trajectory, path)
    assert same(read_trajectory(path, short_arm()), trajectory)


@pytest.mark.parametrize("n", [1, 4_999, 5_000, 5_001])
def test_round_trip_across_chunks(tmp_path: Path, n: int) -> None:
    trajectory = random_trajectory(n, 2)
    write_trajectory(trajectory, tmp_path / "t.csv")
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
        (0, "", "line 1: has no column 'waypoint'"),
        (0, "x" + csv()[0], "has no column 'waypoint'; found 'xwaypoint'"),
        (0, csv()[0].replace("x0_m", "x0_mm"), "'x0_m', but 'x0_mm'; expected in m"),
        (0, csv()[0].replace("1_rad", "1_deg"), "'alpha1_rad', but 'alpha1_deg'; exp"),
        (0, csv()[0] + ",alpha3_rad", "'alpha3_rad', but the arm has 2 links"),
        (0, csv()[0] + ",x0_m", "line 1: has the column 'x0_m' 2 times"),
        (0, csv()[0][: csv()[0].rindex(",")], "has no column 'theta2_rad'"),
        (0, "\u2460", "line 1: has no column 'waypoint'; found '\u2460'"),
        (0, csv()[0].replace(",", "|"), "line 1: has no column 'waypoint'; found 'way"),
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
        (2, '1,1,0,0,0,0,"0,5",0', "line 3: alpha2_rad is '0,5', but numbers before"),
        (2, "1,1,0,0,0,0,+-1,0", "line 3: alpha2_rad is '+-1', expected a number"),
        (2, "1,1,0,0,0,0,infinity,0", "alpha2_rad is infinity, expected a finite"),
        (2, "1,1,0,0,0,0,30,0", "alpha2_rad is 30, expected radians, at most pi eith"),
        (2, "1,1,0,0,0,0,0,-3.15", "theta2_rad is -3.15, expected radians, at most"),
        (2, "1,1,0,3126,0,0,0,0", "x0_m is 3126, expected metres, at most 100 either"),
        (2, "# a remark", "line 3: waypoint is '# a remark', expected a number"),
        (2, "", "line 3: is blank, and rows follow; expected none in between"),
        (2, ",,,,,,,", "line 3: is blank, and rows follow; expected none in between"),
        (2, "1;1;0;0;0;0;0;0", "line 3: waypoint is '1;1;0;0;0;0;0;0', expected a num"),
        (2, "1,1,0,0,0,0,0,0,5", "has 9 values, expected 8; decimal commas need semi"),
        (2, "0,1,0,0,0,0,0,0", "line 3: waypoint is 0, expected a whole number above"),
        (2, "1.5,1,0,0,0,0,0,0", "line 3: waypoint is 1.5, expected a whole number"),
        (1, "-1,1,0,0,0,0,0,0", "line 2: waypoint is -1, expected a whole number"),
        (2, "1,2,0,0,0,0,0,0", "line 3: on_path is 2, expected 0 or 1"),
        (2, "1,1,-0.1,0,0,0,0,0", "line 3: path_m is -0.1, expected 0 to 10000 m"),
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
    monkeypatch.setattr(tables, "CHUNK_ROWS", 7)
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
        last = content[:end].rpartition("\n")[2]
        if last and last[-1] != "," and last.count(",") == 7 and "\n" in content[:end]:
            (tmp_path / "t.csv").write_text(content[:end])
            (note,) = read_trajectory(tmp_path / "t.csv", short_arm()).notes
            assert "the last row has no line end" in note
        elif end not in whole_rows:
            message = refused(tmp_path, content[:end])
            assert (
                "cut short" in message or "is empty" in message or "no row" in message
            )


def test_a_last_row_without_line_end_is_read(tmp_path: Path) -> None:
    (tmp_path / "plain.csv").write_text(WHOLE)
    (tmp_path / "t.csv").write_text(WHOLE.rstrip("\n"))
    found = read_trajectory(tmp_path / "t.csv", short_arm())
    assert same(found, read_trajectory(tmp_path / "plain.csv", short_arm()))
    assert "the last row has no line end" in found.notes[0]
    for cut in ("0.5e", "0.5e-", "0.5e-0", "5e1", "5.E+0", "-", "0.5,"):
        message = refused(tmp_path, WHOLE.rstrip("\n").rpartition(",")[0] + "," + cut)
        assert "the line has no end: is the file cut short?" in message
    for whole in ("1.5e-05", "0.5e-10", '"1e-5"'):
        text = WHOLE.rstrip("\n").rpartition(",")[0] + "," + whole
        (tmp_path / "t.csv").write_text(text)
        read_trajectory(tmp_path / "t.csv", short_arm())


def test_what_is_no_table_is_refused(tmp_path: Path) -> None:
    assert refusal(tmp_path) == "is a folder, expected a file"
    assert refusal(tmp_path / "none.csv") == "does not exist"
    assert refused(tmp_path, "") == "is empty"
    assert refused(tmp_path, csv()[0] + "\n") == "has no row"
    assert "found 'steps', 'x'" in refused(tmp_path, "steps,x\n")
    assert "cut short" in refused(tmp_path, b"\0" * 1000)
    assert "no column" in refused(tmp_path, bytes(range(256)) * 100 + b"\n\n")
    assert refused(tmp_path, csv()[0] + "\n" + "\n" * 20_000) == "has no row"


def test_what_a_row_has_too_many_is_not_taken_for_the_next_one(tmp_path: Path) -> None:
    """A line end between two other values leaves as many values in all."""
    lines = csv()
    first, last = lines[2].rsplit(",", 1)
    longer, shorter = f"{lines[1]},{first}", last
    moved = [lines[0], f"{lines[1]},0", first, *lines[3:], ""]
    assert refused(tmp_path, "\n".join(moved)).startswith("line 2: has 9 values")
    moved = [lines[0], longer, shorter, *lines[3:], ""]
    assert refused(tmp_path, "\n".join(moved)).startswith("line 2: has 15 values")


def test_more_rows_than_any_trajectory_has_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tables, "MAX_ROWS", 2)
    assert refused(tmp_path, "\n".join(csv()) + "\n") == "has more than 2 rows"


def test_one_endless_line_is_refused_without_reading_it_at_once(tmp_path: Path) -> None:
    content = csv()[0] + "\n" + "0," * 5_000_000 + "\n"
    (tmp_path / "t.csv").write_text(content)
    tracemalloc.start()
    message = refusal(tmp_path / "t.csv")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert message == "line 2: is longer than 65536 characters"
    assert peak < 40e6


def test_a_second_row_behind_blanks_on_one_line_is_not_a_row(tmp_path: Path) -> None:
    """A line is cut where it is longest: what is left of it is no line of its own."""
    lines = csv()
    for padding in (65_536, 65_535, 65_500, 200_000):
        joined = lines[2].ljust(padding) + lines[3]
        message = refused(tmp_path, "\n".join([*lines[:2], joined, ""]))
        assert message.startswith("line 3: ")


WHOLE = "\n".join(csv()) + "\n"
SEMICOLONS = WHOLE.replace(",", ";").replace(".", ",")


@pytest.mark.parametrize(
    "content",
    [
        WHOLE.encode("utf-8-sig"),
        WHOLE.encode("utf-16"),
        WHOLE.encode("utf-16-le"),
        WHOLE.encode("utf-16-be"),
        b"\xfe\xff" + WHOLE.encode("utf-16-be"),
        WHOLE.replace("\n", "\r\n").encode(),
        WHOLE.replace("\n", "\r").encode(),
        (WHOLE + "\n\n").encode(),
        (WHOLE + " ,,,,,,,\r\n").encode(),
        WHOLE.replace(",", "\t").encode(),
        WHOLE.replace(",", ";").encode(),
        SEMICOLONS.encode(),
        SEMICOLONS.replace(";", "\t").encode("utf-16"),
        WHOLE.replace(",", " , ").encode(),
        "\n".join(f'"{line}"'.replace(",", '","') for line in WHOLE.splitlines())
        .encode() + b"\n",
        "\n".join(f'"{line}"'.replace(";", '";"') for line in SEMICOLONS.splitlines())
        .encode() + b"\n",
    ],
    ids=range(16),
)  # fmt: skip
def test_every_programs_table_gives_the_same_numbers(
    tmp_path: Path, content: bytes
) -> None:
    (tmp_path / "plain.csv").write_text(WHOLE)
    (tmp_path / "t.csv").write_bytes(content)
    expected = read_trajectory(tmp_path / "plain.csv", short_arm())
    found = read_trajectory(tmp_path / "t.csv", short_arm())
    assert same(found, expected)
    assert not found.notes


@pytest.mark.parametrize("text", ["0.1", "12:30:05.5", "grün, alt", "", "nan", "1e999"])
def test_other_columns_anywhere_are_left_out_and_named(
    tmp_path: Path, text: str
) -> None:
    """Oracle: the csv module of the standard library writes them."""
    rows = [line.split(",") for line in csv()]
    expected = tmp_path / "plain.csv"
    expected.write_text(WHOLE)
    for place in (0, 3, 8):
        for between in (",", ";"):
            with (tmp_path / "t.csv").open("w", newline="", encoding="utf-8") as file:
                writer = standard_csv.writer(file, delimiter=between)
                for row in rows:
                    extra = "t_s" if row is rows[0] else text
                    writer.writerow([*row[:place], extra, *row[place:]])
            found = read_trajectory(tmp_path / "t.csv", short_arm())
            assert same(found, read_trajectory(expected, short_arm()))
            assert found.notes == ("columns that are not read: 't_s'",)


def test_columns_stand_in_any_order(tmp_path: Path) -> None:
    order = np.random.default_rng(0).permutation(8)
    lines = [",".join(np.array(line.split(","))[order]) for line in csv()]
    (tmp_path / "t.csv").write_text("\n".join([*lines, ""]))
    (tmp_path / "plain.csv").write_text(WHOLE)
    found = read_trajectory(tmp_path / "t.csv", short_arm())
    assert same(found, read_trajectory(tmp_path / "plain.csv", short_arm()))


@pytest.mark.parametrize("chunk", [1, 5_000])
def test_a_table_has_decimal_points_or_decimal_commas(
    chunk: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(tables, "CHUNK_ROWS", chunk)
    rows = [line.replace(",", ";") for line in csv()]
    for first, second, third in (("0.5", "0,5", "2"), ("0,5", "0.5", "2")):
        rows[2] = f"1;1;0;{first};0;0;0;0"
        rows[1] = "0;1;0;0;0;0;0;0"
        rows[3] = f"{third};1;0;{second};0;0;0;0"
        message = refused(tmp_path, "\n".join([*rows, ""]))
        assert message.startswith(f"line 4: x0_m is {second!r}, but numbers before it")
    rows[3] = "2;1;0;1.234,5;0;0;0;0"
    assert "line 4: x0_m is '1.234,5'" in refused(tmp_path, "\n".join([*rows, ""]))


def test_failed_writing_leaves_the_old_file(tmp_path: Path) -> None:
    path = tmp_path / "t.csv"
    write_trajectory(random_trajectory(3, 2), path)
    before = path.read_bytes()
    broken = random_trajectory(3, 2)
    object.__setattr__(broken, "path_m", None)
    with pytest.raises(TypeError):
        write_trajectory(broken, path)
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["t.csv"]


def test_memory_stays_near_that_of_the_arrays(tmp_path: Path) -> None:
    n = 15_000
    trajectory = random_trajectory(n, 8)
    arrays_size = sum(getattr(trajectory, field).nbytes for field in FIELDS)
    tracemalloc.start()
    write_trajectory(trajectory, tmp_path / "t.csv")
    writing = tracemalloc.get_traced_memory()[1]
    tracemalloc.reset_peak()
    read_trajectory(tmp_path / "t.csv", HRM8)
    reading = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    # One chunk of rows: a Python number, a slot and a few copies of 20 letters each.
    chunk = tables.CHUNK_ROWS * 20 * 150
    assert writing < chunk
    assert reading < 2 * arrays_size + chunk


def smooth_file(folder: Path, *, quintic: bool = True) -> Path:
    rng = np.random.default_rng(5)
    q, rates, changes = rng.uniform(-0.2, 0.2, (3, 4, 17))
    motion = Trajectory(
        np.zeros(4, bool), np.zeros(4), q[:, 0], q[:, 1::2], q[:, 2::2],
        times=np.array([0.0, 0.25, 1.0, 1.5]),
        rates=rates,
        changes=changes if quintic else None,
    )  # fmt: skip
    write_trajectory(motion, folder / "t.csv")
    return folder / "t.csv"


def test_velocities_and_accelerations_are_read_to_the_last_bit(tmp_path: Path) -> None:
    path, arm = smooth_file(tmp_path), built_in("hrm8")
    motion = read_trajectory(path, arm)
    assert motion.is_smooth and motion.changes is not None
    copy = tmp_path / "again.csv"
    write_trajectory(motion, copy)
    assert copy.read_bytes() == path.read_bytes()
    cubic = read_trajectory(path, arm, "cubic")
    assert cubic.rates is not None and cubic.changes is None
    assert "x0_acceleration_m_s2" in cubic.notes[0]
    linear = read_trajectory(path, arm, "linear")
    assert not linear.is_smooth
    assert "x0_velocity_m_s" in linear.notes[0]


@pytest.mark.parametrize(
    "drop, interpolation, words",
    [
        ("time_s", "auto", "no column 'time_s'"),
        ("theta3_velocity_rad_s", "auto", "no column 'theta3_velocity_rad_s'"),
        ("x0_velocity_m_s", "cubic", "no column 'x0_velocity_m_s'"),
        ("alpha2_acceleration_rad_s2", "quintic", "'alpha2_acceleration_rad_s2'"),
        ("alpha2_acceleration_rad_s2", "auto", "'alpha2_acceleration_rad_s2'"),
    ],
)
def test_a_curve_that_lacks_a_column_is_refused(
    tmp_path: Path, drop: str, interpolation: str, words: str
) -> None:
    path = smooth_file(tmp_path)
    lines = [line.split(",") for line in path.read_text().splitlines()]
    k = lines[0].index(drop)
    path.write_text("".join(",".join(x[:k] + x[k + 1 :]) + "\n" for x in lines))
    with pytest.raises(InvalidFile, match=words) as caught:
        read_trajectory(path, built_in("hrm8"), interpolation)  # type: ignore[arg-type]
    assert "line 1" in str(caught.value)


def test_a_file_without_velocities_makes_no_curve(tmp_path: Path) -> None:
    path = smooth_file(tmp_path, quintic=False)
    with pytest.raises(InvalidFile, match="x0_acceleration_m_s2"):
        read_trajectory(path, built_in("hrm8"), "quintic")
    assert read_trajectory(path, built_in("hrm8")).changes is None
