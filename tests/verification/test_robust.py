"""Oracle: the proof over the whole motion; motions drawn from the error box."""

from dataclasses import replace
from itertools import permutations

import numpy as np
import pytest

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.geometry.solids import Box, Cylinder, Sphere
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.layouts import SLICES
from vdsm_pin.proof.terms import CERTIFIED
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification import robust
from vdsm_pin.verification.clearance import prove_clearance
from vdsm_pin.verification.robust import (
    LARGEST,
    STRETCH,
    largest_joint_error,
    sturdiest,
)
from vdsm_pin.verification.yes_or_no import YesOrNoProof, is_certified

ARM = built_in("hrm8")
CENTRE, BALL = np.array([2.0, 0.45, 0.1]), 0.2
REQUIRED = 0.003


def asked(radius: float) -> PlanningProblem:
    point = np.array([3.126, 0.0, 0.0])
    path, ball = DesiredPath(point, point[None]), Sphere("ball", CENTRE, radius)
    return PlanningProblem(ARM, Scene((ball,)), path, REQUIRED, name="p")


def swaying(n_rows: int) -> Trajectory:
    """Some periods of all joints, weakest somewhere in the middle."""
    t = np.linspace(0.0, 9.0, n_rows)[:, None] + np.arange(8.0)
    x0, off = 0.02 * np.sin(t[:, 0]), np.zeros(n_rows, bool)
    return Trajectory(off, off, x0, 0.02 * np.sin(t), 0.02 * np.cos(1.3 * t))


@pytest.mark.parametrize("n_rows", [1, 2, 40, 3 * STRETCH + 7])
def test_what_is_found_is_proved_and_little_more_is_not(n_rows: int) -> None:
    problem, rows = asked(BALL), swaying(n_rows)
    found = largest_joint_error(problem, rows, ErrorBox())
    assert 1e-3 < found < LARGEST
    assert is_certified(problem, rows, ErrorBox(joint=found))
    above = found + 2.0 * TOLERANCES.joint_error
    assert not is_certified(problem, rows, ErrorBox(joint=above))
    besides = ErrorBox(base=0.001, obstacle=0.002)
    assert largest_joint_error(problem, rows, besides) < found


def as_printed(error: float) -> float:
    """Rounded down to a ten-thousandth of a degree."""
    return float(np.deg2rad(np.floor(np.rad2deg(error) * 1e4) / 1e4))


@pytest.mark.parametrize("seed", range(12))
def test_the_whole_proof_certifies_what_is_survived(seed: int) -> None:
    """Random scenes and motions, near the limit and far; other errors besides."""
    rng = np.random.default_rng(seed)
    rows = swaying(int(rng.integers(1, 400)))
    bodies: list[Obstacle] = []
    for k in range(int(rng.integers(1, 12))):
        away = 0.35 + rng.exponential(0.3)
        turn, x = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.3, 3.0)
        centre = np.array([x, away * np.cos(turn), away * np.sin(turn)])
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        size = rng.uniform(0.02, 0.15, 3)
        bodies.append(
            Cylinder(f"bar{k}", centre, axis, 0.3, size[0])
            if k % 2
            else Box(f"box{k}", centre, rotation_from_rpy(axis), size)
        )
    problem = replace(asked(BALL), scene=Scene(tuple(bodies)))
    besides = ErrorBox(base=rng.choice([0.0, 0.001]), obstacle=rng.choice([0.0, 0.001]))
    found = largest_joint_error(problem, rows, besides)
    assert found == 0.0 or found > TOLERANCES.joint_error
    for joint in (found, as_printed(found)) if found else ():
        proof = prove_clearance(problem, rows, replace(besides, joint=joint))
        assert proof.counts[:, CERTIFIED].all()
        assert proof.counts.sum() == proof.counts[:, CERTIFIED].sum()


def test_the_sturdiest_is_found_wherever_it_stands() -> None:
    problem = asked(BALL)
    rows = [replace(swaying(20), alpha=swaying(20).alpha * k) for k in (1.0, 0.5, 2.0)]
    survived = [largest_joint_error(problem, one, ErrorBox()) for one in rows]
    best = int(np.argmax(survived))
    for order in permutations(range(3)):
        found = sturdiest(problem, [rows[k] for k in order])
        assert found == (order.index(best), survived[best])
    twice = [rows[k] for k in (best, best)]
    assert sturdiest(problem, twice) == (0, survived[best])


def test_no_motion_of_the_box_comes_too_near() -> None:
    problem, rows, rng = asked(BALL), swaying(300), np.random.default_rng(1)
    error = largest_joint_error(problem, rows, ErrorBox())
    for _ in range(200):
        pushed = rng.choice([-error, error], (2, 8))
        centres = joint_centres(ARM, rows.x0, *(
            angles + push
            for angles, push in zip((rows.alpha, rows.theta), pushed, strict=True)
        ))  # fmt: skip
        assert clearance(centres) >= REQUIRED


def clearance(centres: FloatArray) -> float:
    link = np.diff(centres, axis=1)
    t = ((CENTRE - centres[:, :-1]) * link).sum(axis=2) / (link**2).sum(axis=2)
    foot = centres[:, :-1] + np.clip(t, 0.0, 1.0)[..., None] * link
    gap = np.linalg.norm(CENTRE - foot, axis=2).min()
    return float(gap - BALL - ARM.link_radius)


def test_a_motion_that_fails_at_one_place_survives_nothing() -> None:
    rows = swaying(1000)
    assert largest_joint_error(asked(BALL + 1.0), rows, ErrorBox()) == 0.0
    x0 = rows.x0.copy()
    x0[777] -= 1.2  # one waypoint of a link in the ball
    alpha = rows.alpha.copy()
    alpha[777, 0] += 0.3
    spoilt = Trajectory(rows.on_path, rows.path_m, x0, alpha, rows.theta)
    assert not is_certified(asked(BALL), spoilt, ErrorBox())
    assert largest_joint_error(asked(BALL), spoilt, ErrorBox()) == 0.0


def test_nothing_in_the_way_is_looked_at_up_to_a_limit() -> None:
    point = np.array([3.126, 0.0, 0.0])
    free = PlanningProblem(
        built_in("hrm8"), Scene(), DesiredPath(point, point[None]), 0.0, name="free"
    )
    found = largest_joint_error(free, swaying(20), ErrorBox())
    assert 0.0 < found <= LARGEST
    assert is_certified(free, swaying(20), ErrorBox(joint=found))


def test_many_obstacles_are_culled_and_change_nothing() -> None:
    """Far balls beside the near one: culled block by block, deep into the motion."""
    problem, rows = asked(BALL), swaying(3 * STRETCH)
    far = [
        Sphere(f"far {k}", CENTRE + (9.0 + k) * np.eye(3)[2], BALL) for k in range(20)
    ]
    scene = Scene((*problem.scene.obstacles, *far))
    crowded = replace(problem, scene=scene)
    found = largest_joint_error(problem, rows, ErrorBox())
    assert largest_joint_error(crowded, rows, ErrorBox()) == found
    proof = YesOrNoProof(crowded, rows)
    results = proof._proving.results
    assert (proof.n_intervals - 1) // results.stride < results.profile.shape[2]


def test_what_is_asked_before_makes_no_question_harder() -> None:
    """The nominal motion takes as few slices after an error of 45 degrees as before."""
    proof = YesOrNoProof(asked(BALL), swaying(300))

    def slices(joint: float) -> int:
        before = int(proof._proving.results.tally[SLICES])
        proof.holds(ErrorBox(joint=joint), 0, proof.n_intervals)
        return int(proof._proving.results.tally[SLICES]) - before

    nominal = slices(0.0)
    slices(LARGEST)
    assert slices(0.0) == nominal


@pytest.mark.parametrize(("more", "best"), [(5e-6, 0), (2e-5, 1)])
def test_the_last_digits_of_a_bisection_decide_nothing(
    more: float, best: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What two motions survive is known to 1e-5 rad: of equals the first is taken."""
    survived = iter((0.1, 0.1 + more))
    monkeypatch.setattr(robust, "largest_joint_error", lambda *_: next(survived))
    monkeypatch.setattr(robust, "is_certified", lambda *_: True)
    motions = [Trajectory.of_joints(np.zeros((1, 17)))] * 2
    found, _ = robust.sturdiest(read_problem("paper/obs1"), motions)
    assert found == best
