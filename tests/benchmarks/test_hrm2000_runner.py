"""The runner counts right: what is solved, refused, bad, or falsely proved."""

import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from some_slow import few_of

from benchmarks.hrm1000.families import FAMILIES as FIRST
from benchmarks.hrm2000 import attempt as attempts
from benchmarks.hrm2000 import run
from benchmarks.hrm2000.arms import PAPER
from benchmarks.hrm2000.attempt import Outcome, ProcessorTime, answer_of, attempt
from benchmarks.hrm2000.generate import generate, witness_of
from benchmarks.hrm2000.sampling import chain, clearance, outside, sample
from benchmarks.hrm2000.summary import bad_plan, document, false_proof, solved
from tests.made_up import every_shape, problem
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.errors import Infeasible, NoPlanFound, OutOfTime
from vdsm_pin.geometry.solids import (
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Mesh,
    Prism,
    Sphere,
)
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory
from vdsm_pin.problem.scene import Scene
from vdsm_pin.verification.link_clearance import link_clearance

GOOD = Outcome("port-0000", "port", 0, "fewest", "certified", "", 1.0, 2.0, 1.0, 2.0, 3)
SETTINGS = {
    "time_limit_s": 60.0, "versions": {"numpy": "2"}, "benchmark": 3,
    "processor": "p", "code": "c", "processes": 1, "python": "3",
}  # fmt: skip


def test_solved_is_certified_whole_faultless_and_in_time() -> None:
    assert solved(GOOD, 60.0)
    for wrong in (
        {"answer": "refuted"}, {"coverage": 0.99}, {"faults": "x"}, {"plan_s": 61.0},
    ):  # fmt: skip
        assert not solved(replace(GOOD, **wrong), 60.0)


def test_a_problem_without_solution_is_right_if_refused_and_bad_if_solved() -> None:
    twin = replace(GOOD, family="twins")
    assert bad_plan(twin) and not solved(twin, 60.0)
    for answer in ("infeasible", "not found", "out of time"):
        assert solved(replace(twin, answer=answer), 60.0)
    assert not solved(replace(twin, answer="error"), 60.0)


def test_a_proof_against_a_witness_is_false() -> None:
    said = replace(GOOD, answer="infeasible")
    assert false_proof(said)
    assert not false_proof(replace(said, family="twins"))
    # HRM-1000 promises no plan.
    assert not false_proof(replace(said, family="wall"))


def test_answers_tell_how_a_planner_ended() -> None:
    errors = (OutOfTime(1.0), NoPlanFound("x"), Infeasible("x"), KeyError("x"))
    told = [answer_of(error) for error in errors]
    assert told == ["out of time", "not found", "infeasible", "error"]


def test_a_limit_of_processor_time_goes_by_the_processors_clock(monkeypatch) -> None:
    now = {"processor": 5.0, "wall": 100.0}
    monkeypatch.setattr(time, "process_time", lambda: now["processor"])
    monkeypatch.setattr(time, "monotonic", lambda: now["wall"])
    deadline = ProcessorTime.after(10.0)
    now.update(processor=14.9, wall=650.0)
    assert not deadline.passed
    now["processor"] = 15.1
    with pytest.raises(OutOfTime):
        deadline.check()
    now.update(processor=6.0, wall=701.0)
    assert deadline.passed


def test_the_page_names_what_was_missed_and_what_was_not_run() -> None:
    page = document([GOOD, replace(GOOD, number=1, answer="not found")], SETTINGS)
    assert "| port | fewest | 1/2 (50%) |" in page
    assert "* port-0000: not found" in page
    assert "Not run: prismatic_x" in page


def test_the_families_of_hrm1000_alone_are_a_page_of_that_name() -> None:
    outcomes = [replace(GOOD, family=family) for family in FIRST]
    page = document(outcomes, SETTINGS)
    assert page.startswith("# HRM-1000") and "Not run" not in page
    fewer = document(outcomes[1:], SETTINGS)
    assert fewer.startswith("# HRM-2000") and f"Not run: {outcomes[0].family}" in fewer


def test_a_run_goes_on_only_with_the_same_code_and_limit(
    tmp_path: Path, monkeypatch
) -> None:
    base = tmp_path / "results"
    run.save(base, [GOOD], 60.0, 1)
    assert run.known(base, 60.0) == [GOOD]
    assert run.known(base, 10.0) == []
    assert run.known(None, 60.0) == []
    fine = replace(GOOD, plan_s=1.0 / 3.0, psi_deg=20.0 / 3.0)
    run.save(base, [fine], 60.0, 1)
    assert run.known(base, 60.0) == [replace(fine, plan_s=0.333333, psi_deg=6.66667)]
    assert "faults" not in base.with_suffix(".json").read_text()
    monkeypatch.setattr(run, "fingerprint", lambda: "another")
    assert run.known(base, 60.0) == []


def test_a_crash_is_an_outcome(tmp_path: Path, monkeypatch) -> None:
    def crash(name: str):
        message = "boom"
        raise ZeroDivisionError(message)

    monkeypatch.setattr(attempts, "strategy", crash)
    path = generate(tmp_path, "short_rail", 0).path
    outcome = attempt(path, ("short_rail", 0), "fewest", 10.0)
    assert (outcome.answer, outcome.reason) == ("error", "boom")


def test_chains_agree_with_the_closed_form() -> None:
    arm = PAPER
    rng = np.random.default_rng(0)
    rows = rng.uniform(-0.7, 0.7, (50, 1 + 2 * arm.n_links))
    expected = joint_centres(arm, rows[:, 0], rows[:, 1::2], rows[:, 2::2])
    np.testing.assert_allclose(chain(arm, rows), expected, rtol=0, atol=1e-12)


def test_sampled_clearances_lie_little_above_the_proved_ones() -> None:
    rng = np.random.default_rng(2)
    asked = problem(every_shape())
    rows = rng.uniform(-0.4, 0.4, (40, 1 + 2 * PAPER.n_links))
    for obstacle in asked.scene.obstacles:
        alone = replace(asked, scene=Scene((obstacle,)))
        proved = link_clearance(alone)(chain(PAPER, rows)).min(axis=1)
        for row, lower in zip(rows, proved, strict=True):
            seen = clearance(obstacle, PAPER, chain(PAPER, row[None]))
            if lower > 0.0:
                assert 0.0 < seen <= lower + 2e-3, obstacle.name
                # Far from a mesh a bound does.
                known = not isinstance(obstacle, Mesh) or lower <= 0.01
                assert not known or seen >= lower - 1e-6, obstacle.name


def test_distances_from_solids_agree_with_the_nearest_of_many_points() -> None:
    rng = np.random.default_rng(1)
    z = np.array([0.0, 0.0, 1.0])
    square = np.array([[-0.2, -0.3], [0.2, -0.3], [0.2, 0.3], [-0.2, 0.3]])
    box = Box("b", np.zeros(3), np.eye(3), np.array([0.2, 0.3, 0.4]))
    prism = Prism("p", np.zeros(3), np.eye(3), square, (-0.4, 0.4))
    points = rng.uniform(-1.0, 1.0, (200, 3))
    np.testing.assert_allclose(outside(box, points), outside(prism, points), atol=1e-12)
    inside = np.abs(points) <= np.array([0.2, 0.3, 0.4])
    assert ((outside(box, points) <= 0.0) == inside.all(axis=1)).all()
    ball = Sphere("s", np.zeros(3), 0.3)
    rod = Capsule("c", np.zeros(3), z, 1e-9, 0.3)
    np.testing.assert_allclose(outside(ball, points), outside(rod, points), atol=1e-8)
    can = Cylinder("y", np.zeros(3), z, 0.4, 0.3)
    beside = np.array([[0.5, 0.0, 0.1], [0.0, 0.1, 0.9], [0.6, 0.0, 0.8]])
    expected = [0.2, 0.5, 0.5]
    np.testing.assert_allclose(outside(can, beside), expected, atol=1e-12)
    half = HalfSpace("h", z, z)
    np.testing.assert_allclose(outside(half, points), points[:, 2] - 1.0, atol=1e-15)


@pytest.mark.parametrize(
    "family", few_of(["short_rail", "windows", "port", "blades"], 1)
)
def test_sampling_finds_no_fault_in_a_witness_and_each_kind_in_a_spoiled_one(
    family: str, tmp_path: Path
) -> None:
    path = generate(tmp_path, family, 2).path
    asked = read_problem(path)
    motion = read_trajectory(witness_of(path), asked.manipulator)
    assert sample(asked, motion).faults == ()

    def said(**changes) -> str:
        return " ".join(sample(asked, replace(motion, **changes)).faults)

    alpha = motion.alpha.copy()
    alpha[:, -1] += np.deg2rad(45.0)
    assert "joint angle" in said(alpha=alpha)
    assert "does not begin at its start" in said(x0=motion.x0 + 1e-5)
    assert "off its rail" in said(x0=motion.x0 + 10.0)
    on = motion.on_path & (np.arange(motion.n_samples) < motion.n_samples - 20)
    assert "is missed" in said(on_path=on)
    least = sample(asked, motion).clearance
    closer = replace(asked, required_clearance=least + 1e-4)
    assert "clearance" in " ".join(sample(closer, motion).faults)
