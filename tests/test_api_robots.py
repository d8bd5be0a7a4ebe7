"""Any robot from Python: closed forms, files that are bound, and what is refused."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import vdsm_pin as vp
from vdsm_pin.certificate_checker import check_certificate

# A ball on a circle of 1 m about z, at the end of a joint that turns.
URDF = """<robot name="one"><link name="base"/>
<link name="arm"><collision><origin xyz="1 0 0"/>
<geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="base"/><child link="arm"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="9"/></joint></robot>
"""
CELL = """vdsm_problem: 1
length_unit: mm
robot: {urdf: one.urdf}
required_clearance: 149
obstacles:
  - {name: ball, shape: sphere, center: [0, 1300, 0], radius: 50}
"""
BALL = vp.Sphere("ball", np.array([0.0, 1.3, 0.0]), 0.05)
SWEEP = vp.JointTrajectory(("turn",), np.array([[0.0], [2.9]]))


@pytest.fixture
def files(tmp_path: Path) -> vp.RobotFiles:
    (tmp_path / "one.urdf").write_text(URDF)
    return vp.RobotFiles(tmp_path / "one.urdf")


@pytest.fixture
def cell(files: vp.RobotFiles) -> vp.Cell:
    path = files.urdf.with_name("cell.yaml")
    path.write_text(CELL)
    return vp.read_cell(path)


def test_obstacles_built_in_python_are_those_of_a_file(
    files: vp.RobotFiles, cell: vp.Cell
) -> None:
    """1.3 m - 1 m - 0.1 m - 0.05 m are left, either way."""
    built = vp.cell_of(files, vp.Scene((BALL,)), required_clearance=0.149)
    for asked in (built, cell):
        result = vp.verify(asked, SWEEP)
        assert result.verdict is vp.Verdict.CERTIFIED
        assert result.min_clearance == pytest.approx(0.15, rel=0.02)
        assert result.min_clearance <= 0.15
        assert result.closest(1)[0].pair.obstacle == "ball"
    tight = replace(cell, required_clearance=0.1501)
    assert vp.verify(tight, SWEEP).verdict is vp.Verdict.REFUTED
    # A base that is 2 mm off may stand 2 mm nearer to the ball.
    box = vp.ErrorBox(joint_deg=0.1, base_mm=2.0)
    assert vp.verify(cell, SWEEP, errors=box).verdict is vp.Verdict.REFUTED
    near = replace(cell, required_clearance=0.147)
    assert vp.verify(near, SWEEP, errors=box).verdict is vp.Verdict.CERTIFIED


def test_a_report_and_a_certificate_are_of_what_was_verified(
    tmp_path: Path, cell: vp.Cell
) -> None:
    result = vp.verify(cell, SWEEP)
    file, proof = tmp_path / "t.csv", tmp_path / "proof"
    vp.write_trajectory(SWEEP, file, cell)
    assert vp.read_trajectory(file, cell).q.tolist() == SWEEP.q.tolist()
    vp.write_report(result, tmp_path / "report.html")
    assert "certified" in (tmp_path / "report.html").read_text(encoding="utf-8")
    vp.write_certificate(result, proof, file)
    assert cell.source is not None
    assert check_certificate(proof, cell.source.path, file).accepted
    vp.write_trajectory(replace(SWEEP, q=0.5 * SWEEP.q), file, cell)
    with pytest.raises(vp.InvalidInput, match="another motion"):
        vp.write_certificate(result, proof, file)


def test_what_stands_in_no_file_gets_no_certificate(
    tmp_path: Path, files: vp.RobotFiles, cell: vp.Cell
) -> None:
    file = tmp_path / "t.csv"
    vp.write_trajectory(SWEEP, file, cell)
    for asked in (
        vp.cell_of(files, vp.Scene((BALL,))),
        replace(cell, required_clearance=0.1),
        replace(cell, scene=vp.Scene()),
    ):
        result = vp.verify(asked, SWEEP)
        with pytest.raises(vp.InvalidInput, match="this problem has none"):
            vp.write_certificate(result, tmp_path / "proof", file)


def test_rates_make_another_motion(tmp_path: Path, cell: vp.Cell) -> None:
    """Cubic pieces overshoot where straight lines do not, and files tell them apart."""
    times, rates = np.array([0.0, 1.0]), np.array([[0.0], [-6.0]])
    smooth = replace(SWEEP, q=np.array([[-1.5], [0.5]]), times=times, rates=rates)
    near = replace(cell, required_clearance=0.5)
    chord = replace(smooth, rates=None)
    assert vp.verify(near, chord).verdict is vp.Verdict.CERTIFIED
    assert vp.verify(near, smooth).verdict is vp.Verdict.REFUTED
    file = tmp_path / "t.csv"
    vp.write_trajectory(smooth, file, cell)
    again = vp.read_trajectory(file, cell)
    assert again.rates is not None
    assert again.rates.tolist() == rates.tolist()
    result = vp.verify(cell, smooth)
    vp.write_certificate(result, tmp_path / "proof", file)
    vp.write_trajectory(replace(smooth, rates=rates / 2.0), file, cell)
    with pytest.raises(vp.InvalidInput, match="another motion"):
        vp.write_certificate(result, tmp_path / "proof", file)


def test_what_is_read_can_be_judged_and_written_and_read_again(
    tmp_path: Path, cell: vp.Cell
) -> None:
    """Many turns stated in degrees; velocities without times, which join nothing."""
    urdf = cell.files[1]
    urdf.write_text(URDF.replace("revolute", "continuous"))
    turned, first, again = vp.read_cell(cell.files[0]), tmp_path / "a", tmp_path / "b"
    first.write_text("turn_deg\n0\n1800\n")
    still = vp.JointTrajectory(SWEEP.names, SWEEP.q, rates=np.zeros((2, 1)))
    for motion in (vp.read_trajectory(first, turned), still):
        judged = vp.verify(turned, motion).trajectory
        assert judged is not None
        assert judged.q.tolist() == motion.q.tolist()
        vp.write_trajectory(motion, again, turned)
        read = vp.read_trajectory(again, turned)
        np.testing.assert_allclose(read.q, motion.q, rtol=1e-15)


def test_rates_of_an_arm_make_another_motion(tmp_path: Path) -> None:
    problem = vp.read_problem("paper/free")
    still = np.zeros((2, 8))
    rates, times = np.full((2, 17), 1e-6), np.array([0.0, 1.0])
    none = np.zeros(2)
    smooth = vp.Trajectory(none, none, none, still, still, times=times, rates=rates)
    file = tmp_path / "t.csv"
    vp.write_trajectory(replace(smooth, rates=2.0 * rates), file)
    with pytest.raises(vp.InvalidInput, match="another motion"):
        vp.write_certificate(vp.verify(problem, smooth), tmp_path / "proof", file)


def test_a_motion_is_repaired(files: vp.RobotFiles) -> None:
    """With nothing to get out of the way by, it cannot be, and says so."""
    far = vp.cell_of(files, vp.Scene((replace(BALL, radius=0.01),)))
    found = vp.repair_trajectory(far, SWEEP)
    assert found.trajectory.q.tolist() == SWEEP.q.tolist()
    hit = vp.cell_of(files, vp.Scene((replace(BALL, radius=0.25),)))
    with pytest.raises(vp.Infeasible, match="arm"):
        vp.repair_trajectory(hit, SWEEP)


def test_what_is_of_no_robot_is_refused_in_a_sentence(
    files: vp.RobotFiles, cell: vp.Cell
) -> None:
    arm, turn = vp.read_problem("paper/free"), ("turn",)
    still = vp.Trajectory([False], [0.0], [0.0], np.zeros((1, 8)), np.zeros((1, 8)))
    late = replace(SWEEP, times=np.array([1.0, 0.5]))
    refused: dict[str, Callable[[], object]] = {
        "found JointTrajectory": lambda: vp.verify(arm, SWEEP),  # type: ignore[call-overload]
        "found Trajectory": lambda: vp.verify(cell, still),  # type: ignore[call-overload]
        "expected Problem, as": lambda: vp.plan(cell),  # type: ignore[arg-type]
        "expected Cell": lambda: vp.verify("cell.yaml", SWEEP),  # type: ignore[call-overload]
        "of snake arms": lambda: vp.verify(cell, SWEEP, joint_error=True),  # type: ignore[call-overload]
        "no joint 'turn'": lambda: vp.verify(cell, replace(SWEEP, names=("x",))),
        "in degrees": lambda: vp.verify(cell, replace(SWEEP, q=30.0 * SWEEP.q)),
        "expected it to rise": lambda: vp.verify(cell, late),
        "positions have shape": lambda: vp.JointTrajectory(turn, np.zeros(3)),
        "rates have shape": lambda: replace(SWEEP, rates=np.zeros((1, 1))),
        "each once": lambda: vp.JointTrajectory(2 * turn, np.zeros((1, 2))),
        "with problem=": lambda: vp.write_trajectory(SWEEP, "t.csv"),
        "expected 0 or more": lambda: replace(cell, required_clearance=-1.0),
        "required_clearance has text": lambda: replace(cell, required_clearance="5"),  # type: ignore[arg-type]
        "scene is a list": lambda: vp.cell_of(files, [BALL]),  # type: ignore[arg-type]
        "joint 'elbow'": lambda: vp.cell_of(replace(files, lock={"elbow": 0.0})),
        "no rigid motion": lambda: replace(cell, T_world_base=2.0 * np.eye(4)),
        "one of hull": lambda: vp.MeshCover("hulls"),  # type: ignore[arg-type]
    }
    for expected, call in refused.items():
        with pytest.raises(vp.InvalidInput, match=expected):
            call()


def test_a_cell_shows_itself_in_a_few_lines(cell: vp.Cell) -> None:
    result = vp.verify(cell, SWEEP)
    for value in (cell, result, SWEEP):
        assert len(repr(value).splitlines()) < 12
        assert value._repr_html_().startswith("<table>")
    assert "turn" in repr(cell)


def test_values_of_another_kind_are_refused_in_a_sentence(
    cell: vp.Cell, files: vp.RobotFiles
) -> None:
    still = [[0.0], [float("nan")]]
    refused: dict[str, Callable[[], object]] = {
        "joint 'turn' is nan at waypoint 1": lambda: vp.JointTrajectory(
            ("turn",),
            still,  # type: ignore[arg-type]
        ),
        "names are .3,., expected text": lambda: vp.JointTrajectory((3,), [[0.0]]),  # type: ignore[arg-type]
        "expected RobotFiles, as of": lambda: vp.cell_of("one.urdf"),  # type: ignore[arg-type]
        "text or Path; found NoneType": lambda: vp.RobotFiles(None),  # type: ignore[arg-type]
        "text or Path; found int": lambda: vp.RobotFiles(files.urdf, srdf=3),  # type: ignore[arg-type]
        "interpolation is 'septic', expected one of": lambda: vp.read_trajectory(
            "a.csv",
            cell,
            "septic",  # type: ignore[call-overload]
        ),
    }
    for expected, call in refused.items():
        with pytest.raises(vp.InvalidInput, match=expected):
            call()


def test_the_problem_of_an_arm_is_no_cell(tmp_path: Path) -> None:
    file = tmp_path / "arm.yaml"
    file.write_text("vdsm_problem: 1\nmanipulator: hrm8\n")
    with pytest.raises(vp.InvalidInput, match="snake arm, which read_problem reads"):
        vp.read_cell(file)
