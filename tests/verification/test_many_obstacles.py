"""Far obstacles are left out only of what they cannot change.

Oracle: the same asked about all of them.
"""

from dataclasses import replace

import numpy as np
import pytest

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.arrays import IntArray, rotation_from_rpy
from vdsm_pin.geometry.solids import Box
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.budget import Budget
from vdsm_pin.time_limit import NO_LIMIT
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification import coal_arm, coal_check, robust
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.brackets import ClearanceChunk
from vdsm_pin.verification.clearance import prove_clearance, prove_motion
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict

ARM = built_in("hrm8")
REACH = 0.3


def cloud(seed: int, n: int = 120) -> PlanningProblem:
    """Boxes along the arm, most of them far."""
    rng = np.random.default_rng(seed)
    boxes: list[Obstacle] = []
    for k in range(n):
        away, turn = 0.25 + rng.exponential(0.8), rng.uniform(0.0, 2.0 * np.pi)
        centre = [rng.uniform(0, 3.2), away * np.cos(turn), away * np.sin(turn)]
        rotation = rotation_from_rpy(rng.uniform(-3, 3, 3))
        size = rng.uniform(0.01, 0.05, 3)
        boxes.append(Box(f"box{k}", np.array(centre), rotation, size))
    tip = np.array([3.126, 0.0, 0.0])
    path = DesiredPath(tip, tip[None])
    return PlanningProblem(ARM, Scene(tuple(boxes)), path, 0.002, name="p")


def swaying(n_rows: int = 60) -> Trajectory:
    t = np.linspace(0.0, 5.0, n_rows)[:, None] + np.arange(8.0)
    x0, off = 0.02 * np.sin(t[:, 0]), np.zeros(n_rows, bool)
    return Trajectory(off, off, x0, 0.01 * np.sin(t), 0.01 * np.cos(1.3 * t))


def lowers(problem: PlanningProblem, motion: Trajectory) -> np.ndarray:
    lower = prove_clearance(problem, motion, ErrorBox()).least.lower
    n = len(problem.scene.obstacles)
    return np.asarray(lower[: 8 * n].reshape(n, 8).min(axis=1))


def test_many_obstacles_are_as_far_as_the_nearest_of_them() -> None:
    """Oracle: every obstacle alone. Where links meet some, only the sign is meant."""
    problem = cloud(7)
    rng = np.random.default_rng(1)
    # Some links begin in a box, some run along an axis, some are points.
    begins = rng.uniform([0, -1, -1], [3.2, 1, 1], (300, 3))
    begins[:100] = [box.centre for box in problem.scene.obstacles[:100]]
    way = rng.normal(size=(300, 3)) * rng.choice([0.0, 0.1, 0.8], (300, 1))
    way[::3, 1:] = 0.0
    ends = np.stack([begins, begins + way], axis=1)
    every = link_clearance(problem)(ends)[:, 0]
    least = np.full(300, np.inf)
    for obstacle in problem.scene.obstacles:
        alone = replace(problem, scene=Scene((obstacle,)))
        least = np.minimum(least, link_clearance(alone)(ends)[:, 0])
    apart = least > -ARM.most_radius
    assert (every <= -ARM.most_radius).tolist() == (~apart).tolist()
    assert 20 < apart.sum() < 280
    gap = TOLERANCES.bracket_gap
    np.testing.assert_allclose(every[apart], least[apart], rtol=0, atol=gap)


@pytest.mark.parametrize("seed", range(6))
def test_the_largest_joint_error_is_the_same(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    problem, motion = cloud(seed), swaying()
    box = ErrorBox(base=0.001, obstacle=0.0005)
    whole = robust.largest_joint_error(problem, motion, box)
    lost = robust.refuted_joint_error(problem, motion, box, whole)
    monkeypatch.setattr(robust, "MANY", 10)
    monkeypatch.setattr(robust, "FEW", 4)
    least = lowers(problem, motion)
    found = robust.largest_joint_error(problem, motion, box, clearances=least)
    assert found == pytest.approx(whole, abs=2.0 * TOLERANCES.joint_error)
    again = robust.refuted_joint_error(problem, motion, box, found, clearances=least)
    assert np.isnan(again) == np.isnan(lost)
    assert not again <= found
    # What is left out is what made it quick.
    kept = robust.within_reach(problem, least, replace(box, joint=found))
    assert 0 < len(kept.scene.obstacles) < len(problem.scene.obstacles)


@pytest.mark.parametrize("seed", range(4))
def test_no_error_brings_a_far_obstacle_too_near(seed: int) -> None:
    problem, motion, rng = cloud(seed), swaying(), np.random.default_rng(seed)
    box = ErrorBox(joint=10.0 ** rng.uniform(-3, -0.7), base=0.01)
    near = robust.within_reach(problem, lowers(problem, motion), box).scene.names
    far = tuple(o for o in problem.scene.obstacles if o.name not in near)
    if not far:
        return
    clearance = link_clearance(replace(problem, scene=Scene(far)))
    for _ in range(20):
        signs = rng.choice([-1.0, 1.0], (3, 60, 8)) * box.joint
        x0 = motion.x0 + rng.uniform(-box.base, box.base)
        centres = joint_centres(
            ARM, x0, motion.alpha + signs[0], motion.theta + signs[1]
        )
        assert clearance(centres).min() > problem.required_clearance


def test_what_is_within_reach_follows_the_formula() -> None:
    """Required + 2 E (sum of k L_k + N r) + base + obstacles + turn of the base."""
    rng, links = np.random.default_rng(5), ARM.link_lengths
    problem = cloud(0, 200)
    for _ in range(20):
        box = ErrorBox(
            joint=rng.uniform(0, 0.02), base=rng.uniform(0, 0.02),
            obstacle=rng.uniform(0, 0.02), base_turn=rng.choice([0.0, 0.01]),
        )  # fmt: skip
        lever = 2.0 * sum((k + 1) * links[k] + ARM.most_radius for k in range(8))
        moved = box.joint * lever + box.base + box.obstacle
        far = np.abs(ARM.base_range).max() + ARM.total_length + ARM.most_radius
        moved += box.base_turn * (far + moved)
        bound = problem.required_clearance + moved + robust.SPARE
        least = bound + rng.uniform(-1e-3, 1e-3, 200)
        least[:3] = np.nan, -np.inf, np.inf
        kept = robust.within_reach(problem, least, box).scene.names
        names = np.array(problem.scene.names)
        assert kept == tuple(names[~(least > bound)])


def test_sinks_hear_of_near_obstacles_what_they_hear_of_all() -> None:
    problem, motion = cloud(1), swaying()
    everything: list[ClearanceChunk] = []
    near: list[ClearanceChunk] = []
    asked = AskedMotion.of_arm(problem, motion, ErrorBox())
    proof = prove_motion(asked, Budget(), [everything.append])
    prove_motion(asked, Budget(), [near.append], REACH)
    pairs, all_lower = near[0].pairs, everything[0].lower
    assert pairs is not None
    assert 21 < pairs.size < all_lower.shape[1]
    close = all_lower[:, : 8 * 120] <= REACH
    assert set(np.flatnonzero(close.any(axis=0))) <= set(pairs.tolist())
    ours, theirs = near[0].lower, all_lower[:, pairs]
    both = theirs <= REACH
    # Two proofs of one clearance: either bracket holds, so they overlap.
    assert (ours <= everything[0].upper[:, pairs] + 1e-9).all()
    assert (theirs <= near[0].upper + 1e-9).all()
    assert (near[0].verdict == everything[0].verdict[:, pairs])[both].all()
    least = proof.least
    assert (least.lower <= all_lower.min(axis=0) + 1e-12).all()
    assert least.verdict.shape == (len(proof.pairs),)


def test_of_very_many_obstacles_coal_measures_the_nearest_link_of_far_ones(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem, motion = cloud(2), swaying()
    (full,) = coal_check.check_coal(problem, motion)
    monkeypatch.setattr(coal_arm, "MANY", 100)
    (fewer,) = coal_check.check_coal(problem, motion)
    assert full.verdict is fewer.verdict is Verdict.CERTIFIED
    assert 120 + 21 <= fewer.count < full.count


def test_of_a_far_obstacle_the_link_is_measured_that_comes_nearest(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    problem, motion = cloud(2), swaying()
    arm, room = coal_arm.CoalArm(problem), 0.1

    def unseen() -> tuple[IntArray, IntArray]:
        *_, (row, pair) = arm._near(motion, room, 0.0, NO_LIMIT)
        beside = arm.pairs.other[pair] >= arm.pairs.n_own  # obstacles, no links
        return row[beside], pair[beside]

    (row, pair), every = unseen(), {}
    found = arm.measured(motion, row.astype(float), pair).distance
    for other, one, far in zip(arm.pairs.other[pair], pair, found, strict=True):
        every.setdefault(int(other), {})[int(one)] = far
    monkeypatch.setattr(coal_arm, "MANY", 100)
    least = [int(one) for one in unseen()[1]]
    assert {*least} < {*pair.tolist()}
    others = arm.pairs.other[least].tolist()
    assert len({*others}) == len(others)
    assert {other for other, links in every.items() if len(links) == 8} <= {*others}
    for one, other in zip(least, others, strict=True):  # a bound told it, not Coal
        assert every[other][one] <= min(every[other].values()) + 0.05
