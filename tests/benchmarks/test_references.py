"""The references that need no extra library, on scenes where the answer is known."""

from dataclasses import replace
from itertools import islice
from math import inf

import numpy as np
import pytest
from some_slow import few_of

from benchmarks.hrm2000.references import REFERENCES, intelligent, reference
from benchmarks.hrm2000.references.arm import Arm
from benchmarks.hrm2000.references.follow_the_leader import behind
from benchmarks.hrm2000.references.intelligent import Task
from benchmarks.hrm2000.references.multi_directional import _turned
from benchmarks.hrm2000.references.neural_network import Network
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.errors import NoPlanFound
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.pinocchio_arm import load_arm
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.verify import verify

FREE = read_problem("paper/free")
ROBOT = load_arm(FREE.manipulator)


def ahead(problem: PlanningProblem = FREE) -> PlanningProblem:
    """A gently bent path straight ahead of the arm, as long as the first links."""
    along = np.linspace(0.0, 0.5, 26)
    start = problem.path.start
    points = np.stack([start[0] + along, 0.1 * along**2, 0.0 * along], axis=1)
    path = DesiredPath(start, points[1:], spacing=0.02, retreat=0.0)
    return replace(problem, tip_path=path)


@pytest.mark.parametrize("name", ["pseudo-inverse", "gradient-projection", "spiral"])
def test_methods_without_obstacles_draw_the_free_square_and_change_every_angle(
    name: str,
) -> None:
    coarse = replace(FREE, tip_path=replace(FREE.path, spacing=0.05))
    motion = reference(name)(coarse, ROBOT, link_clearance(coarse))
    assert verify(coarse, motion).verdict is Verdict.CERTIFIED
    assert (np.abs(motion.joints[-1, 1:]) > 1e-4).any()


def test_a_method_that_looks_at_no_obstacle_is_refuted_by_the_judge() -> None:
    problem = read_problem("paper/obs1")
    problem = replace(problem, tip_path=replace(problem.path, spacing=0.05))
    motion = reference("pseudo-inverse")(problem, ROBOT, link_clearance(problem))
    assert verify(problem, motion).verdict is Verdict.REFUTED


def test_the_arm_lies_on_the_trail_of_its_tip() -> None:
    problem = ahead()
    motion = reference("follow-the-leader")(problem, ROBOT, link_clearance(problem))
    assert verify(problem, motion).verdict is Verdict.CERTIFIED
    centres = joint_centres(problem.manipulator, motion.x0, motion.alpha, motion.theta)
    trail = centres[:, -1]
    for place in centres[-1, :-1]:
        if place[0] < trail[0, 0]:  # still on the rail
            assert np.hypot(*place[1:]) < 1e-9
        else:
            y = np.interp(place[0], trail[:, 0], trail[:, 1])
            assert abs(place[1] - y) < 1e-6


@pytest.mark.parametrize("name", few_of(["follow-the-leader", "mda-rrt"], 1))
def test_the_square_across_the_rail_cannot_be_followed(name: str) -> None:
    with pytest.raises(NoPlanFound):
        reference(name)(FREE, ROBOT, link_clearance(FREE))


class Bowl(Task):
    """A penalty whose least place is known."""

    def cost(self, rows: FloatArray, below: FloatArray | float = inf) -> FloatArray:
        return np.asarray(((rows - self.tip) ** 2).sum(axis=1))


@pytest.mark.parametrize(
    "name", [at.split(":")[1] for at in REFERENCES.values() if "intelligent:" in at]
)
def test_intelligent_algorithms_find_the_bottom_of_a_bowl(name: str) -> None:
    arm = Arm(FREE, ROBOT, link_clearance(FREE))
    rng = np.random.default_rng(8)
    bottom, box = rng.uniform(-0.5, 0.5, arm.nq), np.ones(arm.nq)
    task = Bowl(arm, np.zeros(arm.nq), bottom, -box, box, rng)
    search = getattr(intelligent, name).__wrapped__(task)
    found = list(islice(search, intelligent.GENERATIONS))[-1]
    assert (np.abs(found) <= 1.0).all()
    assert task.cost(found[None]) < 0.1 * (bottom**2).sum()


def test_a_penalty_is_whole_below_a_bound_and_stays_above_it_elsewhere() -> None:
    def between_walls(centres: FloatArray) -> FloatArray:
        return np.asarray(0.2 - np.abs(centres[:, 1:, 1]))

    arm, rng = Arm(FREE, ROBOT, between_walls), np.random.default_rng(9)
    before, box = np.zeros(arm.nq), np.full(arm.nq, 0.7)
    task = Task(arm, before, FREE.path.corners[1], -box, box, rng)
    rows = np.vstack([task.first(), 0.1 * task.first()])
    whole = task.cost(rows)
    bounds = whole + rng.normal(scale=0.1, size=len(rows))
    found, below = task.cost(rows, bounds), whole < bounds
    assert 20 < below.sum() < 180
    np.testing.assert_allclose(found[below], whole[below], rtol=1e-12)
    assert (found[~below] >= bounds[~below]).all()
    assert (found[~below] < whole[~below]).any(), "something was left out"


def test_a_swarm_reaches_a_path_ahead() -> None:
    problem = ahead()
    problem = replace(problem, tip_path=replace(problem.path, spacing=0.1))
    follow = reference("particle-swarm")
    motion = follow(problem, ROBOT, link_clearance(problem))
    row = verify(problem, motion).checks
    assert all(c.verdict is Verdict.CERTIFIED for c in row if "waypoints" in c.name)


def test_a_place_behind_is_at_its_distance_and_on_the_trail() -> None:
    rng = np.random.default_rng(5)
    for _ in range(200):
        trail = np.cumsum(rng.normal(size=(12, 3)), axis=0)
        length = rng.uniform(0.1, 3.0)
        found = behind(trail, trail[-1], 10, length)
        if found is None:
            gaps = np.linalg.norm(trail - trail[-1], axis=1)
            assert gaps.max() < length
            continue
        place, k = found
        assert np.linalg.norm(place - trail[-1]) == pytest.approx(length)
        ways = place - trail[k], trail[k + 1] - place
        whole = np.linalg.norm(trail[k + 1] - trail[k])
        assert sum(map(np.linalg.norm, ways)) == pytest.approx(whole)


def test_a_branch_turns_no_more_than_allowed() -> None:
    rng = np.random.default_rng(6)
    for _ in range(200):
        old, wish = rng.normal(size=(2, 3))
        old /= np.linalg.norm(old)
        new = _turned(old, wish, 0.3)
        assert np.linalg.norm(new) == pytest.approx(1.0)
        assert np.arccos(np.clip(old @ new, -1.0, 1.0)) <= 0.3 + 1e-9


def test_a_network_is_trained_by_its_gradients_and() -> None:
    rng = np.random.default_rng(7)
    network = Network(3, 5, rng)
    inputs, wanted = rng.normal(size=(20, 3)), rng.normal(size=(20, 5))

    def loss() -> float:
        return float(((network.layers(inputs)[-1] - wanted) ** 2).sum() / 40)

    slopes = network.gradients(inputs, wanted)
    for weights, slope in zip(network.weights, slopes, strict=True):
        weights[1, 2] += 1e-6
        more = loss()
        weights[1, 2] -= 2e-6
        assert slope[1, 2] == pytest.approx((more - loss()) / 2e-6, abs=1e-8)
        weights[1, 2] += 1e-6


def test_every_reference_names_a_module_and_a_function() -> None:
    for where in REFERENCES.values():
        module, function = where.split(":")
        assert module.isidentifier()
        assert function.isidentifier()
