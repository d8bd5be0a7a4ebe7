"""Coal against the proved brackets: agreement is seen, disagreement is reported."""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import trimesh

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry import solids
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem import scene
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification import coal_check
from vdsm_pin.verification import coal_shapes as measuring
from vdsm_pin.verification.coal_arm import CoalArm, CoalDistances, coal_reach
from vdsm_pin.verification.coal_check import CoalLog, ProvedLowers, check_coal
from vdsm_pin.verification.judgement import CLOSEST
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.verify import verify

HRM8 = built_in("hrm8")


def unit(rng: np.random.Generator) -> np.ndarray:
    vector = rng.normal(size=3)
    return np.asarray(vector / np.linalg.norm(vector))


def obstacle_of(shape: str, rng: np.random.Generator) -> scene.Obstacle:
    """An obstacle within reach of the arm, anywhere, turned anyhow."""
    centre = rng.uniform([0.3, -1.0, -1.0], [3.0, 1.0, 1.0])
    turn = rotation_from_rpy(rng.uniform(-3.0, 3.0, 3))
    size = rng.uniform(0.05, 0.4)
    match shape:
        case "sphere":
            return solids.Sphere(shape, centre, size)
        case "capsule":
            return solids.Capsule(shape, centre, unit(rng), rng.uniform(0.1, 2.0), size)
        case "cylinder":
            return solids.Cylinder(
                shape, centre, unit(rng), rng.uniform(0.1, 4.0), size
            )
        case "box":
            return solids.Box(shape, centre, turn, rng.uniform(0.05, 0.5, 3))
        case "half_space":
            normal = unit(rng)
            return solids.HalfSpace(shape, -normal * rng.uniform(0.3, 1.5), normal)
        case "prism":
            triangle = rng.uniform(-0.4, 0.4, (3, 2))
            return solids.Prism(shape, centre, turn, triangle, (-1.5, 2.0))
        case "angle iron":
            corners = [[0, 0], [0.5, 0], [0.5, 0.1], [0.1, 0.1], [0.1, 0.4], [0, 0.4]]
            return solids.Prism(shape, centre, turn, np.array(corners), (-1.0, 1.0))
        case _:
            part = trimesh.creation.icosphere(subdivisions=2, radius=size)
            return solids.Mesh(shape, part.vertices + centre, part.faces)


SHAPES = [
    "sphere",
    "capsule",
    "cylinder",
    "box",
    "half_space",
    "prism",
    "angle iron",
    "mesh",
]


def problem_with(
    *obstacles: scene.Obstacle, clearance: float = 0.0035
) -> PlanningProblem:
    tip = np.array([HRM8.total_length, 0.0, 0.0])
    path = DesiredPath(tip, tip[None])
    return PlanningProblem(HRM8, scene.Scene(obstacles), path, clearance, name="any")


def trajectory_of(n: int, seed: int = 1, size: float = 0.3) -> Trajectory:
    rng = np.random.default_rng(seed)
    alpha, theta = rng.uniform(-size, size, (2, n, 8))
    return Trajectory(np.zeros(n), np.zeros(n), rng.uniform(-0.5, 0.5, n), alpha, theta)


@pytest.mark.parametrize("shape", SHAPES)
def test_coal_agrees_with_the_brackets_everywhere(shape: str) -> None:
    """Every (row, link, obstacle), near and far, apart and through each other."""
    rng = np.random.default_rng(SHAPES.index(shape))
    three = [replace(obstacle_of(shape, rng), name=f"number {k}") for k in range(3)]
    problem = problem_with(*three)
    found = list(CoalArm(problem, links=False).near(trajectory_of(25), np.inf))
    assert sum(chunk.moment.size for chunk in found) == 25 * 8 * 3
    for chunk in found:
        assert chunk.disagreement.max() < 2e-7


@pytest.mark.parametrize("shape", SHAPES)
def test_culling_skips_only_what_is_far(shape: str) -> None:
    obstacle = obstacle_of(shape, np.random.default_rng(10 + SHAPES.index(shape)))
    problem, trajectory = problem_with(obstacle), trajectory_of(60)
    reach = problem.required_clearance + HRM8.most_radius
    assert coal_reach(problem) == reach
    arm = CoalArm(problem, links=False)

    def link(chunk: CoalDistances) -> list[int]:
        return arm.pairs.one[chunk.pair].tolist()

    full = list(arm.near(trajectory, np.inf))
    culled = list(arm.near(trajectory, HRM8.most_radius))
    near = {
        (s, i)
        for chunk in full
        for s, i, d in zip(chunk.moment, link(chunk), chunk.distance, strict=True)
        if d <= reach
    }
    seen = {
        (s, i)
        for chunk in culled
        for s, i in zip(chunk.moment, link(chunk), strict=True)
    }
    assert near <= seen
    assert {i for _, i in seen} == set(range(8)), "every pair at least once"


@pytest.mark.parametrize("bounds", [1 << 17, 8, 40])
def test_far_pairs_are_measured_where_they_come_nearest(
    bounds: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Once each, at the row that is farthest along the rail, in parts or at once."""
    monkeypatch.setattr("vdsm_pin.verification.coal_arm.CHUNK_BOUNDS", bounds)
    ball = solids.Sphere("far", np.array([9.0, 0.0, 0.0]), 0.1)
    along, still = np.array([0.0, 0.2, 0.1, 0.4, 0.3, 0.0, 0.1]), np.zeros((7, 8))
    motion = Trajectory(np.zeros(7), np.zeros(7), along, still, still)
    arm = CoalArm(problem_with(ball), links=False)
    found = list(arm.near(motion, 0.0))
    pairs = np.concatenate([one.pair for one in found])
    assert sorted(arm.pairs.one[pairs].tolist()) == list(range(8))
    assert {float(m) for one in found for m in one.moment} == {3.0}


def test_rows_close_to_each_other_are_seen_once(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shift, travel = 0.02, 1e-3
    n = 4001
    still = np.zeros((n, 8))
    along = np.concatenate([np.linspace(0.0, shift, n - 1000), np.full(1000, shift)])
    motion = Trajectory(np.zeros(n), np.zeros(n), along, still, still)
    arm, room = CoalArm(ball_near_link_4(0.03), links=False), HRM8.most_radius
    of_link_4 = arm.pairs.one == 3

    def rows() -> list[int]:
        found = arm.near(motion, room, travel)
        near = np.concatenate([one.moment[of_link_4[one.pair]] for one in found])
        return near.astype(int).tolist()

    seen = rows()
    assert len(seen) == pytest.approx(shift / travel + 1, abs=1)
    assert seen[0] == 0
    np.testing.assert_allclose(np.diff(along[seen]), travel, atol=2e-5)
    monkeypatch.setattr("vdsm_pin.verification.coal_arm.CHUNK_BOUNDS", 800)
    assert rows() == seen, "in parts or at once"
    everything = list(arm.near(motion, room))
    assert sum(int(of_link_4[chunk.pair].sum()) for chunk in everything) == n


def test_verdict_and_count_of_an_honest_scene() -> None:
    rng = np.random.default_rng(3)
    problem = problem_with(*(obstacle_of(shape, rng) for shape in SHAPES))
    (check,) = check_coal(problem, trajectory_of(40))
    assert check.verdict is Verdict.CERTIFIED
    assert check.worst <= check.limit == TOLERANCES.coal_agreement
    pairs = 8 * len(SHAPES) + 21
    assert pairs <= check.count <= 40 * pairs
    assert f"{check.count} of {40 * pairs} pairs" in check.where


def ball_near_link_4(gap: float, k: int = 3) -> PlanningProblem:
    """A ball beside the middle of link 4, or of link k + 1, of the straight arm."""
    middle = HRM8.stations[k] + HRM8.link_lengths[k] / 2.0
    centre = np.array([middle, 0.1 + HRM8.link_radius + gap, 0.0])
    return problem_with(solids.Sphere("ball", centre, 0.1))


STRAIGHT = Trajectory(
    np.zeros(2), np.zeros(2), np.zeros(2), np.zeros((2, 8)), np.zeros((2, 8))
)


@pytest.mark.parametrize("excess", [0.9, 1.1])
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_wrong_distance_is_noticed_on_both_sides(
    excess: float, sign: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    honest = measuring.measure_each

    def lying(*arguments: object) -> FloatArray:
        found = honest(*arguments)
        error = sign * excess * TOLERANCES.coal_agreement
        return found + error

    monkeypatch.setattr(measuring, "measure_each", lying)
    (check,) = check_coal(ball_near_link_4(0.01), STRAIGHT)
    expected = Verdict.CERTIFIED if excess < 1.0 else Verdict.UNDECIDED
    assert check.verdict is expected


def test_a_lie_leaves_the_whole_undecided(monkeypatch: pytest.MonkeyPatch) -> None:
    """One of Coal's distances 0.1 mm off: the row says which, nothing is certified."""
    problem, drawn = ball_near_link_4(0.01), replace(STRAIGHT, on_path=np.ones(2))
    honest = measuring.measure_each

    def lying(*arguments: object) -> FloatArray:
        found = honest(*arguments)
        near = (found > 0.0) & (found < 0.011)
        return found + 1e-4 * near

    for tell, verdict in ((honest, Verdict.CERTIFIED), (lying, Verdict.UNDECIDED)):
        monkeypatch.setattr(measuring, "measure_each", tell)
        found = verify(problem, drawn)
        row = next(c for c in found.checks if c.name == coal_check.COAL)
        assert row.verdict is verdict
        others = {c.verdict for c in found.checks if c is not row}
        assert others == {Verdict.CERTIFIED}
        assert found.verdict is verdict
    assert row.worst == pytest.approx(1e-4, abs=1e-8)
    assert "link 4 and ball: Coal 10.1" in row.where


@pytest.mark.parametrize("answer", [-np.inf, np.nan, -1.7976931348623157e308])
def test_no_answer_is_no_agreement(
    answer: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    import coal

    monkeypatch.setattr(coal, "distance", lambda *arguments: answer)
    (check,) = check_coal(ball_near_link_4(0.01), STRAIGHT)
    assert check.verdict is Verdict.UNDECIDED
    assert check.worst == np.inf


def test_a_wrong_sign_is_noticed(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = measuring.measure_each

    def flipped(*arguments: object) -> FloatArray:
        found = honest(*arguments)
        return -found

    monkeypatch.setattr(measuring, "measure_each", flipped)
    for gap in (0.01, -0.01):
        (check,) = check_coal(ball_near_link_4(gap), STRAIGHT)
        assert check.verdict is Verdict.UNDECIDED
        assert check.worst >= 0.01


@pytest.mark.parametrize("k", range(8))
def test_an_interval_proof_above_coal_is_noticed(k: int) -> None:
    problem = ball_near_link_4(0.01, k)
    interval, least = np.full((1, 8), -1.0), np.full(29, -1.0)  # 21 pairs of links
    none = np.full(29, -1)
    columns = np.where(np.arange(29) < 8, np.arange(29), -1)
    interval[0, k] = least[k] = 0.01 - 1e-6
    # A bound of the interval, or of the whole motion where there is none.
    for column, bound in ((columns, interval[0]), (none, least)):
        proved = ProvedLowers(least, column, interval)
        (check,) = check_coal(problem, STRAIGHT, proved)
        assert check.verdict is Verdict.CERTIFIED
        bound[k] = 0.01 + 1e-5
        (check,) = check_coal(problem, STRAIGHT, proved)
        assert check.verdict is Verdict.UNDECIDED
        assert f"link {k + 1} and ball" in check.where


def test_poses_come_from_pinocchio_and_match_the_centres() -> None:
    """Spheres at the joint centres touch their links at depth radius + sphere."""
    trajectory = trajectory_of(1, seed=5)
    centres = joint_centres(HRM8, trajectory.x0, trajectory.alpha, trajectory.theta)
    for i in range(8):
        outward = centres[0, i] + np.array([0.0, 0.0, 5.0])
        problem = problem_with(solids.Sphere("far", outward, 0.1))
        (chunk,) = CoalArm(problem, links=False).near(trajectory, np.inf)
        expected = np.linalg.norm(
            centres[0, :-1]
            + _nearest(centres[0, :-1], centres[0, 1:], outward)[:, None]
            * (centres[0, 1:] - centres[0, :-1])
            - outward,
            axis=1,
        )
        np.testing.assert_allclose(
            chunk.distance, expected - 0.1 - HRM8.link_radius, atol=1e-12
        )


def _nearest(start: np.ndarray, end: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Where along each segment the point is nearest, 0 to 1."""
    along = end - start
    t = np.einsum("ij,ij->i", point - start, along) / np.einsum(
        "ij,ij->i", along, along
    )
    return np.minimum(np.maximum(t, 0.0), 1.0)


def test_coal_stands_beside_every_closest_approach_and_measured_row() -> None:
    """At an approach Coal lies in its bracket, at a waypoint above the lower end."""
    problem = read_problem("paper/obs1")
    plan = plan_and_verify(problem, "paper").plan
    judged = verify(problem, plan.trajectory)
    assert len(judged.approaches) == CLOSEST == 10
    gap = TOLERANCES.coal_agreement
    for near in judged.approaches:
        assert near.lower - gap <= near.coal <= near.upper + gap
        assert near.coal == pytest.approx(near.upper, abs=1e-5)
    assert judged.coal is not None
    assert set(judged.coal.pair.tolist()) == set(range(len(judged.pairs)))
    least = judged.least.lower[judged.coal.pair]
    assert (judged.coal.distance >= least - gap).all()
    (count,) = (one.count for one in judged.checks if one.name == coal_check.COAL)
    assert count == judged.coal.pair.size + CLOSEST


def test_a_lie_of_coal_at_a_closest_approach_is_seen(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The answers at rows are honest."""
    problem = read_problem("paper/obs1")
    plan = plan_and_verify(problem, "paper").plan
    honest = CoalLog.answers

    def lying(*arguments: Any) -> Iterator[CoalDistances]:
        for found in honest(*arguments):
            yield replace(found, distance=found.distance + 2e-5)

    monkeypatch.setattr(CoalLog, "answers", lying)
    judged = verify(problem, plan.trajectory)
    row = next(check for check in judged.checks if check.name == coal_check.COAL)
    assert row.verdict is Verdict.UNDECIDED
    assert row.moment in [near.moment for near in judged.approaches]


def test_of_a_mesh_around_the_arm_coal_knows_no_clearance() -> None:
    shell = trimesh.creation.box((20.0, 20.0, 20.0))
    problem = problem_with(solids.Mesh("shell", shell.vertices, shell.faces))
    still = Trajectory([0], [0], [0], np.zeros((1, 8)), np.zeros((1, 8)))
    judged = verify(problem, still)
    assert judged.coal is not None
    assert judged.coal.pair.size > 0
    assert not any(judged.pairs[k].obstacle for k in judged.coal.pair)


@pytest.mark.parametrize("shape", ["sphere", "points", "half_space"])
def test_witness_and_normal_are_those_of_the_closed_form(shape: str) -> None:
    """Of each link and of what is nearest to its axis, apart and through each other."""
    rng, seen = np.random.default_rng(5), 0
    for _ in range(6):
        centre, size = rng.uniform([0.3, -0.8, -0.8], [3.0, 0.8, 0.8]), 0.05
        spread = [np.zeros(3)] if shape == "sphere" else rng.uniform(-0.3, 0.3, (90, 3))
        balls = centre + np.array(spread)
        normal = unit(rng)
        obstacle: scene.Obstacle = solids.PointCloud(shape, balls, size)
        if shape == "sphere":
            obstacle = solids.Sphere(shape, centre, size)
        if shape == "half_space":
            obstacle = solids.HalfSpace(shape, -0.5 * normal, normal)
        problem, motion = problem_with(obstacle), trajectory_of(4)
        arm, radius = CoalArm(problem, links=False), HRM8.most_radius
        centres = joint_centres(HRM8, motion.x0, motion.alpha, motion.theta)
        for found in arm.near(motion, np.inf):
            for moment, pair, told in zip(
                found.moment, found.pair, found.distance, strict=True
            ):
                link, row = int(arm.pairs.one[pair]), int(moment)
                begin, end = centres[row, link], centres[row, link + 1]
                way = end - begin
                if shape == "half_space":
                    foot = min((begin, end), key=lambda p: float(p @ normal))
                    away, reach = normal, float(foot @ normal) + 0.5
                    other = foot - reach * normal
                else:
                    share = np.clip((balls - begin) @ way / (way @ way), 0.0, 1.0)
                    feet = begin + share[:, None] * way
                    gaps = np.linalg.norm(feet - balls, axis=1)
                    k = int(np.argmin(gaps))
                    if len(balls) > 1 and np.partition(gaps, 1)[1] - gaps[k] < 1e-6:
                        continue
                    foot, away = feet[k], (feet[k] - balls[k]) / gaps[k]
                    reach, other = gaps[k] - size, balls[k] + size * away
                if told < 1e-3:
                    continue  # below zero the sign alone is meant
                near, far, by_coal = arm.witness(motion, row, int(pair))
                seen += 1
                assert told == pytest.approx(reach - radius, abs=1e-6)
                np.testing.assert_allclose(by_coal, away, atol=1e-4)
                np.testing.assert_allclose(near, foot - radius * away, atol=1e-4)
                np.testing.assert_allclose(far, other, atol=1e-4)
    assert seen > 50
