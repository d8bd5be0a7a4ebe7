"""The loop follows its plan, recovers from a kick, and says what it cannot do."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import vdsm_pin as vp
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.errors import InvalidInput, VerificationFailed
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.simulation.closed_loop import Simulation, simulate
from vdsm_pin.simulation.folder import (
    SUMMARY,
    cleared,
    show_simulation,
    simulate_to_folder,
)
from vdsm_pin.simulation.settings import Controller, Kick, Sensors, Settings, Speed
from vdsm_pin.simulation.time_law import row_times

pytest.importorskip("mujoco")
HRM8 = built_in("hrm8")
CALM = Sensors(resolution_deg=0.0, noise_deg=0.0)


def bending(rows: int = 40, angle: float = 0.05) -> vp.Trajectory:
    """Joint 3 lifts the arm, joint 5 turns it."""
    share = np.linspace(0.0, 1.0, rows)
    alpha, theta = np.zeros((2, rows, 8))
    theta[:, 2], alpha[:, 4] = -angle * share, angle * share
    off = np.zeros(rows, bool)
    return vp.Trajectory(off, np.zeros(rows), 0.05 * share, alpha, theta)


def run(**changed: object) -> Simulation:
    return simulate(HRM8, bending(), Settings(sensors=CALM).model_copy(update=changed))


@pytest.fixture(scope="module")
def calm() -> Simulation:
    return run()


@pytest.mark.parametrize("rows", [2, 3, 40])
def test_rates_and_accelerations_keep_their_limits(rows: int) -> None:
    speed = Speed(joint_deg_s=5.0, joint_deg_s2=20.0, tip_m_s=10.0)
    motion = bending(rows, angle=0.1)
    times = row_times(HRM8, motion, speed)
    assert times[0] == 0.0
    rates = np.abs(np.diff(motion.joints[:, 1:], axis=0)) / np.diff(times)[:, None]
    assert np.rad2deg(rates.max()) <= 5.0 * (1.0 + 1e-9)
    # 0.1 rad with 20 deg/s^2 up and down, 5 deg/s between: never less than that.
    assert times[-1] >= 0.1 / np.deg2rad(5.0)


def test_rows_that_do_not_move_take_no_time() -> None:
    still = bending(5, angle=0.0)
    rest = vp.Trajectory(
        still.on_path, still.path_m, np.zeros(5), still.alpha, still.theta
    )
    assert row_times(HRM8, rest, Speed())[-1] == 0.0


def test_without_mujoco_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing() -> None:
        raise ImportError

    monkeypatch.setattr("vdsm_pin.simulation.closed_loop.load_mujoco", missing)
    with pytest.raises(InvalidInput, match=r"pip install 'vdsm-pin\[simulation\]'"):
        run()


def test_the_arm_follows_within_a_tenth_of_a_degree_or_so(calm: Simulation) -> None:
    assert np.rad2deg(calm.largest_error) < 0.5
    settled = calm.errors[-10:]
    assert np.rad2deg(np.abs(settled).max()) < 0.15
    assert (calm.tensions >= 0.0).all()


def test_without_gravity_feed_forward_it_sags(calm: Simulation) -> None:
    blind = run(controller=Controller(gravity_feed_forward=False))
    assert blind.largest_error > 5.0 * calm.largest_error


@pytest.mark.parametrize("regulates", ["angles", "lengths"])
def test_a_kick_is_felt_at_its_joint_and_recovered_from(
    calm: Simulation, regulates: str
) -> None:
    kick = Kick(axis="alpha", joint=5, share=0.5, torque_nm=10.0, duration_s=0.2)
    control = Controller.model_validate({"regulates": regulates})
    kicked = run(kicks=(kick,), controller=control)
    before = kicked.errors[kicked.times < 1.0]
    assert np.rad2deg(np.abs(before).max()) < 0.15
    more = np.abs(kicked.errors - calm.errors).max(axis=0)
    assert 2.0 < np.rad2deg(more.max()) < 8.0  # the paper saw about 4 deg
    assert np.argmax(more) in (8, 10, 6)  # alpha5, or its neighbours in the chain
    assert np.rad2deg(np.abs(kicked.errors[-5:]).max()) < 0.3


def test_largest_errors_and_tension_do_not_depend_on_what_is_recorded(
    calm: Simulation,
) -> None:
    """Recorded at every step of the controller, nothing is larger than what is told."""
    every = run(record_s=0.005)
    worst = np.abs(every.executed - every.planned).max(axis=0)
    np.testing.assert_allclose(every.largest_errors, worst, rtol=0.0, atol=1e-15)
    assert every.largest_tension == every.tensions.max()
    np.testing.assert_array_equal(calm.largest_errors, every.largest_errors)
    assert calm.largest_tension == every.largest_tension
    assert every.largest_errors[0] > 1e-4  # the rail's drive lags behind


def test_half_the_step_changes_angles_by_less_than_a_hundredth_of_a_degree(
    calm: Simulation,
) -> None:
    fine = run(step_s=0.00025)
    change = np.abs(calm.executed[:, 1:] - fine.executed[:, 1:]).max()
    assert np.rad2deg(change) < 0.01


def test_a_step_that_does_not_divide_the_period_is_shortened(calm: Simulation) -> None:
    """0.005 s hold seven steps of 0.0008 s: the clock keeps the time of the plan."""
    coarse = run(step_s=0.0008)
    np.testing.assert_array_equal(coarse.times, calm.times)
    change = np.abs(calm.executed[:, 1:] - coarse.executed[:, 1:]).max()
    assert np.rad2deg(change) < 0.02


def test_the_same_seed_gives_the_same_motion() -> None:
    noisy, short = Settings(seed=3), bending(10, angle=0.02)
    one, two = (simulate(HRM8, short, noisy) for _ in range(2))
    np.testing.assert_array_equal(one.executed, two.executed)


def test_a_kick_at_no_joint_is_refused() -> None:
    with pytest.raises(InvalidInput, match=r"kicks\[0\].joint is 9, expected 1 to 8"):
        run(kicks=(Kick(axis="theta", joint=9, share=0.1, torque_nm=1.0),))


def test_settings_that_do_not_fit_the_arm_are_refused_by_their_file(
    tmp_path: Path,
) -> None:
    kick = Kick(axis="theta", joint=9, share=0.1, torque_nm=1.0)
    problem, rows = read_problem("paper/obs3"), tmp_path / "t.csv"
    vp.write_trajectory(bending(10, angle=0.02), rows)
    settings, file = Settings(kicks=(kick,)), tmp_path / "set.yaml"
    with pytest.raises(InvalidInput, match=r"set\.yaml: kicks\[0\]\.joint is 9"):
        simulate_to_folder(problem, rows, tmp_path / "out", settings, file)


def test_a_step_at_which_it_diverges_is_told() -> None:
    with pytest.raises(VerificationFailed, match="diverges"):
        run(step_s=0.02, controller=Controller(period_s=0.02))


def test_what_is_proved_covers_the_errors_that_the_problem_states() -> None:
    """Obstacles off by more than the clearance: nothing is certified, whoever asks."""
    problem, none = read_problem("paper/obs3"), ErrorBox()
    nominal = cleared(problem, bending(), none)
    assert nominal.verdict == "certified"
    assert nominal.min_clearance_m is not None
    off = ErrorBox(obstacle=nominal.min_clearance_m)
    stated = cleared(replace(problem, errors=off), bending(), none)
    assert stated == cleared(problem, bending(), off)
    assert stated.verdict != "certified"


def test_a_folder_holds_what_the_verifier_takes(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    problem = read_problem("paper/obs3")
    file = tmp_path / "t.csv"
    vp.write_trajectory(bending(10, angle=0.02), file)
    told = simulate_to_folder(problem, file, tmp_path / "out", Settings())
    executed = vp.read_trajectory(tmp_path / "out" / "executed.csv", problem)
    assert executed.n_links == 8
    assert told.executed.verdict == "certified"
    assert told.executed.min_clearance_m is not None
    off = ErrorBox(joint=told.largest_error_rad, base=told.largest_base_error_m)
    plan = vp.read_trajectory(file, problem)
    assert told.within_error_box == cleared(problem, plan, off)
    content = json.loads((tmp_path / "out" / SUMMARY).read_text())
    assert content["settings"]["cables"]["stiffness_ea_n"] == 3.5e5
    record = (tmp_path / "out" / "simulation.csv").read_text().splitlines()
    assert len(record[0].split(",")) == 1 + 17 + 17 + 24
    assert len(record) == executed.n_samples + 1
    less = told.executed.model_copy(update={"min_clearance_m": 0.0101369})
    told = told.model_copy(update={"executed": less, "largest_error_rad": 0.00101641})
    show_simulation(told, tmp_path)
    shown = capsys.readouterr().out
    assert "10.136 mm" in shown  # what is proved is rounded down
    assert "0.059°" in shown  # and 0.05824° up


def test_places_on_a_path_are_not_asked_for_where_there_is_none(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def reached(_: object, planned: vp.Trajectory, __: object) -> None:
        message = f"{planned.n_samples} rows simulated"
        raise InvalidInput(message)

    monkeypatch.setattr("vdsm_pin.simulation.folder.simulate", reached)
    with_path, file = read_problem("paper/obs3"), tmp_path / "t.csv"
    vp.write_trajectory(bending(10, angle=0.02), file)
    lines = [line.split(",") for line in file.read_text().splitlines()]
    file.write_text("\n".join(",".join([row[0], *row[3:]]) for row in lines) + "\n")
    assert lines[0][:4] == ["waypoint", "on_path", "path_m", "x0_m"]
    more = file, tmp_path / "out", Settings()
    with pytest.raises(InvalidInput, match="has no column 'on_path'"):
        simulate_to_folder(with_path, *more)
    with pytest.raises(InvalidInput, match="10 rows simulated"):
        simulate_to_folder(replace(with_path, tip_path=None), *more)
