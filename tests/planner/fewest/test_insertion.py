"""Ways in through openings: of the tip, of the arm that follows, of the motion."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scenes_for_fewest import problem
from some_slow import few_of

from benchmarks.hrm2000.curves import (
    Bend,
    follow_the_leader,
    tip_curve,
)
from benchmarks.hrm2000.solids import Tube
from benchmarks.hrm2000.sweeps import Sweep, least_bore
from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.kinematics import joint_angles, joint_centres, link_angles
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.arm.mounted import Tool
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Box, Cylinder, Sphere
from vdsm_pin.planner.broad_phase import broad_phase
from vdsm_pin.planner.fewest import elastic_band, insertion, tip_routes
from vdsm_pin.planner.fewest.charts import DIRECTIONS, OFFSETS, Intervals, standing
from vdsm_pin.planner.fewest.elastic_band import LONG_PULL, SHORT_PULL, resampled
from vdsm_pin.planner.fewest.growth import Grown, Layers, Population
from vdsm_pin.planner.fewest.insertion import insert
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.levels import Insert
from vdsm_pin.planner.fewest.motion import Corners
from vdsm_pin.planner.fewest.smoothing import sparser
from vdsm_pin.planner.fewest.strategy import plan_fewest
from vdsm_pin.planner.fewest.tip_cells import TipCells, TipRoom
from vdsm_pin.planner.fewest.tip_routes import TipSpace
from vdsm_pin.planner.path_rows import path_rows
from vdsm_pin.planner.records import Plan
from vdsm_pin.planner.tip_curve import (
    followed,
    led_along,
    own_curve,
    way_back,
)
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.verify import verify

ARM = built_in("hrm8")
START = (-0.3, 0.0, 0.0)
STRAIGHT = np.zeros((1, ARM.n_links + 1, 2))
LOOP = np.array([[1.75, -0.2, 0.05], [1.75, -0.25, 0.15], [1.75, -0.2, 0.2]])


def equal_links(count: int) -> Manipulator:
    """An arm as long as the paper's, of equal and thinner links."""
    limit, length = float(np.deg2rad(42.5)), 3.126
    cables = CableLayout(0.01, 0.005, paper_hole_angles(count))
    lengths = np.full(count, length / count)
    return Manipulator("equal", lengths, 0.05, limit, limit, (-5.0, 5.0), cables)


def wall(x: float, y: float, z: float, half: float) -> list[Obstacle]:
    """A wall across the rail at x with a square window about (y, z)."""
    far, thick = 3.0, 0.03
    spans = [
        ((-far, y - half), (-far, far)),
        ((y + half, far), (-far, far)),
        ((y - half, y + half), (-far, z - half)),
        ((y - half, y + half), (z + half, far)),
    ]
    return [
        Box(
            f"wall{x}-{n}", np.array([x, sum(ys) / 2, sum(zs) / 2]), np.eye(3),
            np.array([thick, ys[1] - ys[0], zs[1] - zs[0]]) / 2,
        )
        for n, (ys, zs) in enumerate(spans)
    ]  # fmt: skip


def two_windows(half: float) -> PlanningProblem:
    """Two walls whose windows stand at different places."""
    walls = [*wall(0.65, -0.06, 0.05, half), *wall(1.3, -0.15, 0.12, half)]
    return problem(*walls, points=LOOP, start=START)


def judge_of(task: PlanningProblem) -> Judge:
    clearance = broad_phase(task, link_clearance(task))
    return Judge(task, clearance, 0.0, 3e-4, 2e-3)


def space_of(task: PlanningProblem) -> TipSpace:
    required = judge_of(task).required
    clearance = broad_phase(task, link_clearance(task))
    exact = replace(clearance, floor=-np.inf)
    return TipSpace(task, exact, required, 0.06, 60_000)


def length_of(route: FloatArray) -> float:
    return float(np.linalg.norm(np.diff(route, axis=0), axis=1).sum())


def bent_arms(rng: np.random.Generator, count: int) -> FloatArray:
    """Joint centres of arms bent at every joint, shape (count, N + 1, 3)."""
    alpha, theta = rng.uniform(-0.25, 0.25, (2, count, ARM.n_links))
    return joint_centres(ARM, rng.uniform(-1.0, 1.0, count), alpha, theta)


def off_curve(points: FloatArray, curve: FloatArray) -> float:
    """Largest distance of points from a polyline."""
    begin, step = curve[:-1], np.diff(curve, axis=0)
    from_begin = points[:, None] - begin
    squares = np.maximum((step**2).sum(axis=1), 1e-300)
    share = np.clip((from_begin * step).sum(axis=2) / squares, 0.0, 1.0)
    gaps = np.linalg.norm(share[..., None] * step - from_begin, axis=2)
    return float(gaps.min(axis=1).max())


@pytest.mark.parametrize("seed", range(3))
def test_the_tip_finds_its_way_through_a_slot_hardly_wider_than_the_body(
    seed: int,
) -> None:
    """Oracle: the plates' planes, and posts between them.

    The slot leaves the tip 0.6 mm, far less than the smallest cells.
    """
    rng = np.random.default_rng([12, seed])
    turn = rng.uniform(0.0, np.pi)
    up = np.array([0.0, -np.sin(turn), np.cos(turn)])
    R = np.column_stack([[1.0, 0.0, 0.0], np.cross(up, [1.0, 0.0, 0.0]), up])
    keep = ARM.link_radius + 0.0035 + 3e-4
    gap, thick = keep + 3e-4, 0.1
    plates = [
        Box(f"plate{side}", R @ [1.4, 0.0, side * (gap + thick)], R, [1.2, 1.3, thick])
        for side in (-1.0, 1.0)
    ]
    posts = [
        Cylinder(f"post{k}", R @ [0.5 + 0.4 * k, y, 0.0], up, gap, 0.12)
        for k, y in enumerate(rng.uniform(-0.15, 0.15, 3))
    ]
    goal = R @ [1.75, 0.1, 0.0]
    task = problem(*plates, *posts, points=np.stack([goal, goal]), start=START)
    _, route = space_of(task)._begun(goal, 60_000)
    assert route is not None
    places = resampled(route, 0.002) @ R
    within = (places[:, 0] > 0.2) & (places[:, 0] < 2.6)
    assert np.abs(places[within, 2]).max() <= gap - keep + 3e-4 + 1e-9
    for post in posts:
        away = np.linalg.norm((places - post.centre @ R)[:, :2], axis=1)
        assert away.min() >= 0.12 + keep - 3e-4 - 1e-9


def test_arms_that_follow_keep_their_links_and_the_curve() -> None:
    rng = np.random.default_rng(4)
    before = bent_arms(rng, 200)
    ahead = before[:, -1] - before[:, -2]
    tips = before[:, -1] + 0.2 * ahead + rng.normal(size=(200, 3)) * 0.005
    after = followed(before, tips, ARM.link_lengths)
    assert np.isfinite(after).all(axis=(1, 2)).mean() > 0.9
    for old, tip, new in zip(before, tips, after, strict=True):
        if not np.isfinite(new).all():
            continue
        links = np.linalg.norm(np.diff(new, axis=0), axis=1)
        np.testing.assert_allclose(links, ARM.link_lengths, atol=1e-12)
        np.testing.assert_array_equal(new[-1], tip)
        np.testing.assert_array_equal(new[0, 1:], 0.0)
        rail = old[0] - np.array([9.0, 0.0, 0.0])
        curve = np.vstack([rail, old, tip])
        assert off_curve(new[1:], curve) < 1e-12


def test_a_straight_arm_that_follows_along_the_rail_stays_straight() -> None:
    x = np.append(0.0, np.cumsum(ARM.link_lengths))
    before = np.stack([x, 0.0 * x, 0.0 * x], axis=1)[None]
    for step in (0.1, -0.1):
        move = np.array([step, 0.0, 0.0])
        after = followed(before, before[:, -1] + move, ARM.link_lengths)
        np.testing.assert_allclose(after, before + move, atol=1e-12)


def test_an_arm_that_cannot_follow_is_not_a_number() -> None:
    before = bent_arms(np.random.default_rng(5), 1)
    after = followed(before, before[:, -1] + [0.0, 50.0, 0.0], ARM.link_lengths)
    assert np.isnan(after).all() or np.isfinite(after).all()
    # With the last joint far from the rail no first link reaches it.
    high = before + np.array([0.0, 5.0, 0.0])
    assert np.isnan(followed(high, high[:, -1], ARM.link_lengths)).all()


def test_points_along_a_way_are_even_and_keep_its_ends() -> None:
    route = np.array([[0.0, 0, 0], [0.0, 0, 0], [1.0, 0, 0], [1.0, 1.05, 0]])
    points = resampled(route, 0.1)
    gaps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    assert gaps.max() <= 0.1 + 1e-12
    np.testing.assert_array_equal(points[[0, -1]], route[[0, -1]])
    assert len(resampled(route[:2], 0.1)) == 1


@pytest.mark.parametrize("half", few_of([0.07, 0.085, 0.075], 1))
def test_the_tip_finds_windows_and_no_way_where_they_are_shut(half: float) -> None:
    task = two_windows(half)
    goal = task.path.points[0]
    (route, *_) = space_of(task).routes(goal, 1)
    clearances = link_clearance(task)(np.stack([route[:-1], route[1:]], axis=1))[:, 0]
    assert clearances.min() >= task.required_clearance
    np.testing.assert_array_equal(route[[0, -1]], [START, goal])
    shut = two_windows(ARM.link_radius + 0.003)
    assert not list(space_of(shut).routes(goal, 1))


def two_ways(middle: float) -> PlanningProblem:
    """A wall with windows on both sides, the wider one at positive y.

    Args:
        middle: Where it begins, 0.45 being its end; [m].
    """
    spans = ((-3.0, -0.4), (-0.2, middle), (0.45, 3.0))
    bars = [
        Box(f"bar{n}", np.array([1.0, (a + b) / 2, 0.0]), np.eye(3),
            np.array([0.02, (b - a) / 2, 3.0]))
        for n, (a, b) in enumerate(spans)
    ]  # fmt: skip
    lintels = [
        Box(f"lintel{z}", np.array([1.0, 0.0, z]), np.eye(3), np.array([0.02, 3, 2.9]))
        for z in (-3.0, 3.0)
    ]
    ends = np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0]])
    return problem(
        *bars, *lintels, points=ends[1:], start=(0.0, 0.0, 0.0), closed=False
    )


def side_of(route: FloatArray) -> float:
    """Where a way passes the wall; [m]."""
    return float(route[np.abs(route[:, 0] - 1.0).argmin(), 1])


def test_a_thin_tool_goes_where_its_link_does_not() -> None:
    """A window wider than the tool and narrower than the link that carries it."""
    arm = replace(ARM, tool=Tool(0.2, 0.012))
    points = np.array([[0.62, -0.06, 0.05], [0.66, -0.06, 0.05]])
    task = problem(*wall(0.55, -0.06, 0.05, 0.025), points=points, closed=False)
    task = replace(
        task, manipulator=arm, tip_path=replace(task.path, start=np.array(START))
    )
    found = plan_and_verify(task, "fewest")
    assert found.verification.verdict is Verdict.CERTIFIED
    assert found.verification.coverage == pytest.approx(1.0)


def test_a_second_way_takes_the_other_window() -> None:
    task = two_ways(0.25)
    one, other = space_of(task).routes(task.path.points[0], 2)
    assert sorted(np.sign([side_of(one), side_of(other)])) == [-1.0, 1.0]
    assert length_of(one) < length_of(other) + 0.2


def test_a_second_way_is_short_where_the_first_is_wide() -> None:
    """A slot straight ahead, as long as it is narrow, between two wide windows."""
    half = ARM.link_radius + 0.0035 + 0.008
    bars = [
        Box(f"bar{n}", np.array([1.0, (a + b) / 2, 0.0]), np.eye(3),
            np.array([0.4, (b - a) / 2, 3.0]))
        for n, (a, b) in enumerate(
            [(-3.0, -0.6), (-0.3, -half), (half, 0.3), (0.6, 3.0)]
        )
    ]  # fmt: skip
    roofs = [
        Box(f"roof{z}", np.array([1.0, 0.0, z]), np.eye(3), np.array([0.02, 3, 2.9]))
        for z in (-3.0, 3.0)
    ]
    goal = np.array([[2.0, 0.0, 0.0], [2.1, 0.0, 0.0]])
    task = problem(*bars, *roofs, points=goal, start=(0.0, 0.0, 0.0), closed=False)
    wide, short = space_of(task).routes(goal[0], 2)
    assert 0.3 < abs(side_of(wide)) < 0.6
    assert abs(side_of(short)) < half
    assert length_of(short) < length_of(wide) - 0.02


def test_a_longer_pull_comes_before_a_way_that_takes_long_to_find(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    task = two_ways(0.25)
    space, asked, efforts = space_of(task), list[int](), list[object]()
    cheapest = TipCells.cheapest

    def looked_for(
        cells: TipCells,
        start: FloatArray,
        goal: FloatArray,
        most: int,
        shortest: bool = False,
    ) -> FloatArray | None:
        asked.append(most)
        few = len(asked) == 2
        return None if few else cheapest(cells, start, goal, space.most, shortest)

    def pulled(_: TipSpace, short: FloatArray, effort: object) -> FloatArray:
        efforts.append(effort)
        return short

    monkeypatch.setattr(TipCells, "cheapest", looked_for)
    monkeypatch.setattr(TipSpace, "_pulled", pulled)
    monkeypatch.setattr(tip_routes, "is_followed", lambda *_: False)
    ways = list(space.routes(task.path.points[0], 3))
    assert len(ways) == 3
    assert efforts == [SHORT_PULL, LONG_PULL, SHORT_PULL]
    assert asked[1] < asked[0] == asked[2] == space.most


def test_ways_avoid_where_an_arm_got_stuck() -> None:
    """The wider window, unless an arm got stuck in it."""
    task = two_ways(0.15)
    goal = task.path.points[0]
    space, again = space_of(task), space_of(task)
    (first,) = space.routes(goal, 1)
    assert side_of(first) > 0.15
    again.avoid(first[np.abs(first[:, 0] - 1.0).argmin()])
    (other,) = again.routes(goal, 1)
    assert side_of(other) < -0.2


def test_ways_end_however_often_one_place_is_to_be_avoided() -> None:
    """Costs stay such that sums of them can be told apart."""
    task = two_ways(0.15)
    space, goal = space_of(task), task.path.points[0]
    for _ in range(60):
        space.avoid(goal)
        space.avoid(task.path.start)
    (route,) = space.routes(goal, 1)
    np.testing.assert_array_equal(route[[0, -1]], [task.path.start, goal])


def bent_tube(start: float, spare: float, *bends: Bend) -> PlanningProblem:
    """A tube closed at its end, with room for an arm that follows its middle.

    Args:
        start: Where on the rail the tip begins; [m].
        spare: What it is wider than such an arm needs; [m].
        bends: Of its middle.
    """
    curve = tip_curve(bends)
    end = float(curve.starts[-1]) + 0.1
    laid = follow_the_leader(ARM, curve, np.linspace(-0.2, end, 120))
    span = (0.1, end + 0.3)
    bore = least_bore(Sweep(ARM, laid), curve, span) + spare
    tube = Tube(curve, span, bore, 0.01, 24, 40, capped=True).mesh("tube")
    task = problem(tube, points=laid[-1:, -1], start=(start, 0, 0), closed=False)
    return replace(task, manipulator=replace(ARM, base_range=(start - 4.0, 5.0)))


def test_a_way_from_afar_does_not_cut_the_corners_of_its_cells() -> None:
    """Where large cells end at a wall, their corners may be within its margin."""
    bends = Bend(0.2, 0.6, 0.7, 0.3), Bend(0.1, 0.6, 0.7, 2.8)
    task = bent_tube(-9.0, 0.004, *bends)
    space, ends = space_of(task), np.stack([task.path.start, task.path.points[0]])
    points = space._cells(ends).cheapest(*ends, 300_000)
    assert points is not None
    lines = np.stack([points[:-1], points[1:]], axis=1)
    assert link_clearance(task)(lines).min() >= space.room.required


def test_the_way_through_a_bent_tube_is_one_that_an_arm_can_follow() -> None:
    """Its middle is not: links are chords, and bow to the inside of the bends."""
    bends = [
        Bend(*row)
        for row in [
            (0.22, 0.4, 0.76, 3.64),
            (0.19, 0.64, 0.79, 5.92),
            (0.21, 0.35, 0.91, 5.82),
        ]
    ]
    task = bent_tube(-0.2, 0.008, *bends)
    (route,) = space_of(task).routes(task.path.points[0], 1)
    start = np.zeros((ARM.n_links + 1, 3))
    start[:, 0] = ARM.stations - ARM.total_length - 0.2
    arms = led_along(route, start, ARM.link_lengths)
    assert link_clearance(task)(arms).min() >= task.required_clearance


def blocked(room: TipRoom, route: FloatArray) -> int:
    """Number of lines between the points of a way that are not clear."""
    return int((room.spare(route[:-1], route[1:]) < 0.0).sum())


@pytest.mark.parametrize("seed", range(8))
def test_a_way_is_never_pulled_through_a_wall(seed: int) -> None:
    """Round a plate far thinner than its points are apart the other side is nearer."""
    rng = np.random.default_rng(seed)
    half = rng.uniform(0.1, 0.4)
    middle = np.array([0.6, half - 0.2, 0.0])
    plate = Box("plate", middle, np.eye(3), np.array([5e-4, half, 2.0]))
    task = problem(plate, points=LOOP, start=START)
    space = space_of(task)
    far = ARM.most_radius + task.required_clearance + rng.uniform(0.005, 0.03)
    near, behind, under = 0.6 - far, 0.6 + far, -0.2 - far
    round_ = [[near, 0, 0], [near, under, 0], [behind, under, 0], [behind, 0, 0]]
    route = resampled(np.vstack([START, round_, LOOP[:1]]), far / 3.0)
    assert blocked(space.room, route) == 0
    for sizes in elastic_band.SIZES, elastic_band.NARROW_SIZES:
        way = elastic_band.pulled(space.room, route, space.behind, sizes)
        assert blocked(space.room, way) == 0


def test_a_way_bends_no_more_than_the_arm() -> None:
    """To an oblique window a thin arm must come from aside: the shortest way does not.

    Links of 130 mm that turn by 12 deg need a radius of 623 mm.
    """
    limit = float(np.deg2rad(12.0))
    arm = replace(equal_links(24), max_link_angle=limit, link_radius=0.035)
    turn = np.deg2rad(50.0)
    c, s = np.cos(turn), np.sin(turn)
    rotation = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    at = np.array([1.35, 0.55, 0.0])
    plates: list[Obstacle] = []
    for n, (y, z) in enumerate([(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)]):
        size = np.array([0.02, 0.4 if y else 0.06, 0.4 if z else 0.9])
        centre = at + rotation @ np.array([0.0, y * 0.46, z * 0.46])
        plates.append(Box(f"plate{n}", centre, rotation, size))
    goal = at + rotation @ np.array([0.3, 0.0, 0.0])
    task = problem(*plates, points=goal[None], start=START, closed=False)
    task = replace(task, manipulator=arm)
    (route, *_) = space_of(task).routes(goal, 1)
    start = np.zeros((arm.n_links + 1, 3))
    start[:, 0] = START[0] + arm.stations - arm.total_length
    laid = led_along(route, start, arm.link_lengths)
    psi = link_angles(*joint_angles(arm, laid))
    assert np.abs(psi).max() <= limit
    assert link_clearance(task)(laid).min() >= task.required_clearance


def test_an_arm_led_along_a_curve_lies_on_it() -> None:
    """By the closed form of an arc: its joints are its chords."""
    radius, lead = 1.2, 0.5
    turn = np.linspace(0.0, 1.2, 400)
    arc = np.stack([np.sin(turn), 1.0 - np.cos(turn), 0.0 * turn], axis=1) * radius
    arc[:, 0] += lead
    route = np.vstack([np.zeros((1, 3)), arc])
    start = np.zeros((ARM.n_links + 1, 3))
    start[:, 0] = ARM.stations - ARM.total_length
    laid = led_along(route, start, ARM.link_lengths)
    gaps = np.linalg.norm(np.diff(laid, axis=1), axis=2)
    np.testing.assert_allclose(gaps, np.broadcast_to(ARM.link_lengths, gaps.shape))
    np.testing.assert_array_equal(laid[:, -1], route)
    np.testing.assert_array_equal(laid[:, 0, 1:], 0.0)
    bent = laid[..., 0] > lead
    off = np.linalg.norm(laid - [lead, radius, 0.0], axis=2) - radius
    assert np.abs(off[bent]).max() < 1e-5
    assert np.abs(laid[:, 1:][~bent[:, 1:]][:, 1:]).max() == 0.0
    # One that starts bent goes on along its own arc; on its chords joints would cut in
    # by up to 8 mm; cut in eight pieces each, by a 64th of that and its own rounding.
    later = led_along(route[300:], laid[300], ARM.link_lengths)[:, -3:-1]
    off = np.linalg.norm(later - [lead, radius, 0.0], axis=2) - radius
    assert np.abs(off).max() < 0.0086 / 64


def test_an_arm_that_draws_back_lies_where_it_lay() -> None:
    """Back as it came; one that starts bent along its own curve, until straight."""
    rng = np.random.default_rng(3)
    turn = np.linspace(0.0, 1.0, 60)
    arc = np.stack([np.sin(turn), 0.0 * turn, 1.0 - np.cos(turn)], axis=1) * 1.3
    start = np.zeros((ARM.n_links + 1, 3))
    start[:, 0] = ARM.stations - ARM.total_length
    there = led_along(arc, start, ARM.link_lengths)
    both = led_along(np.vstack([arc, arc[-2::-1]]), start, ARM.link_lengths)
    np.testing.assert_allclose(both[60:], there[-2::-1], rtol=0, atol=1e-12)
    for bent in [there[-1], *bent_arms(rng, 5)]:
        tips = way_back(bent)
        laid = led_along(tips, bent, ARM.link_lengths)
        np.testing.assert_array_equal(tips[0], bent[-1])
        assert np.abs(laid[-1, :, 1:]).max() < 1e-9
        curve = np.vstack([bent[-1:], own_curve(bent)])
        assert off_curve(laid[:, 1:].reshape(-1, 3), curve) < 1e-9
    np.testing.assert_array_equal(way_back(start), start[-1:])


def test_a_leader_is_followed_through_a_tube_where_chance_is_lost() -> None:
    """A bore 0.5 mm wider than the arm that follows its curve exactly needs."""
    curve = tip_curve([Bend(0.2, 0.5, 1.0, 0.3), Bend(0.1, 0.5, 1.0, 2.0)])
    marks = np.linspace(-0.2, 1.3, 120)
    centres = follow_the_leader(ARM, curve, marks)
    span = (0.1, 1.35)
    bore = least_bore(Sweep(ARM, centres), curve, span) + 0.0005
    tube = Tube(curve, span, bore, 0.01, 32, 100).mesh("tube")
    task = problem(tube, points=curve.at(marks[-1:]), start=(-0.2, 0, 0), closed=False)
    layers = Layers(curve.at(marks), np.zeros(len(marks)))
    for exactly in (True, False):
        rng = np.random.default_rng(0)
        population = Population(
            judge_of(task), layers, rng, 2, led=0.0 if exactly else None
        )
        chain = population.grow(STRAIGHT)
        assert (chain.layer[-1] == len(marks) - 1) == exactly


def test_what_is_inserted_keeps_clearance_limits_and_layers() -> None:
    task = two_windows(0.08)
    judge = judge_of(task)
    (route, *_) = space_of(task).routes(task.path.points[0], 1)
    tolerance = np.full(len(route), 0.02)
    tolerance[[0, -1]] = 0.0
    rng = np.random.default_rng(0)
    layers = Layers(route, tolerance)
    chain = Population(judge, layers, rng, 24, led=0.0).grow(STRAIGHT, 3)
    assert chain.layer[-1] == len(route) - 1
    assert (np.diff(chain.layer) >= 0).all()
    np.testing.assert_array_equal(chain.tips[[0, -1]], route[[0, -1]])
    lines = Intervals(
        chain.tips[:-1], chain.tips[1:], chain.offsets[:-1], chain.offsets[1:]
    )
    assert judge.clear(lines).all()


def test_nothing_is_inserted_through_a_wall() -> None:
    task = two_windows(ARM.link_radius + 0.003)
    judge = judge_of(task)
    tips = np.linspace(START, task.path.points[0], 30)
    layers = Layers(tips, np.zeros(30))
    rng = np.random.default_rng(0)
    chain = Population(judge, layers, rng, 24, led=0.0).grow(STRAIGHT, 3)
    assert chain.tips[-1, 0] < 0.65


def test_a_path_behind_a_pipe_is_drawn_in_visits_that_come_home() -> None:
    """No arm encircles the pipe's whole length: the tip goes out and in again."""
    pipe = Cylinder("pipe", np.array([1.2, 0.0, 0.0]), np.array([0.0, 0, 1]), 3.0, 0.3)
    points = np.array([[2.4, -0.6, 0.0], [2.4, 0.6, 0.0]])
    task = problem(
        pipe, *wall(0.4, 0.0, 0.0, 0.16), points=points, closed=False, start=START
    )
    judge, rows = judge_of(task), path_rows(task.path)
    closed = np.zeros(len(rows.tips), dtype=np.bool_)
    effort = Insert(population=24, routes=2, backtracks=3, seed=0)
    found = insert(judge, space_of(task), rows, closed, effort)[0]
    assert found is not None
    # Late, one visit is enough, but not none.
    late = Deadline(1.0, 0.0)
    soon = insert(judge, space_of(task), rows, closed, effort, late)[0]
    assert soon is not None
    assert found.missing <= soon.missing < task.path.length
    assert judge.clear(found.corners.pick(np.arange(len(found.corners.drawn)))).all()
    drawn = found.corners.drawn
    route = np.linalg.norm(np.diff(found.corners.tips, axis=0), axis=1)
    assert route[drawn].sum() == pytest.approx(task.path.length - found.missing)
    on_line = found.corners.tips[:-1][drawn]
    np.testing.assert_allclose(on_line[:, [0, 2]] - [2.4, 0.0], 0.0, atol=1e-12)


def test_an_arm_that_gets_in_farther_on_draws_from_where_it_did_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    visited, places = insertion._Visits._visit, list[int]()

    def visit(self: insertion._Visits, k: int) -> insertion._Visit | None:
        places.append(k)
        return visited(self, k) if k == 2 else None

    monkeypatch.setattr(insertion._Visits, "_visit", visit)
    points = np.array([[1.5, 0.2, 0.0], [1.5, 0.4, 0.0]])
    task = problem(points=points, closed=False, start=START)
    rows = path_rows(task.path)
    closed = np.zeros(len(rows.tips), dtype=np.bool_)
    effort = Insert(population=4, routes=1, backtracks=1, seed=0)
    found = insert(judge_of(task), space_of(task), rows, closed, effort)[0]
    assert found is not None
    assert places == [0, 1, 2]
    assert not found.skipped
    drawn = found.corners.drawn
    steps = np.linalg.norm(np.diff(found.corners.tips, axis=0), axis=1)
    assert steps[drawn].sum() == pytest.approx(0.2)
    np.testing.assert_allclose(found.corners.tips[:-1][drawn][0], points[0])


@pytest.mark.parametrize("turn", [0.7, 2.0])
def test_arms_that_lean_backwards_are_inserted_by_directions_at_once(
    turn: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Along an arc by less and by more than a quarter turn."""
    grown = list[Population]()
    grow = Population.grow

    def counted(self: Population, *given: Any) -> Grown:
        grown.append(self)
        return grow(self, *given)

    monkeypatch.setattr(Population, "grow", counted)
    angle, radius = np.linspace(0.0, turn, 40), 0.7
    arc = np.stack([np.sin(angle), 1.0 - np.cos(angle), 0.0 * angle], axis=1)
    way = np.array(START) + radius * arc
    path = DesiredPath(way[0], way[-3:], closed=False, insertion=way[1:-3])
    arm = replace(equal_links(12), base_range=(-9.0, 5.0))
    task = replace(problem(points=way[-3:], start=START, closed=False), tip_path=path)
    task = replace(task, manipulator=arm)
    rows = path_rows(task.path)
    closed = np.zeros(len(rows.tips), dtype=np.bool_)
    effort = Insert(population=2, routes=1, backtracks=0, seed=0)
    insert(judge_of(task), space_of(task), rows, closed, effort)
    assert bool(grown) == (turn < np.pi / 2.0)
    directed = replace(effort, directed=True)
    insert(judge_of(task), space_of(task), rows, closed, directed)
    assert grown


@pytest.mark.parametrize("count", [3, 8])
@pytest.mark.parametrize("rail", [(-0.02, 0.02), (0.0, 0.0), (-5.0, 0.0)])
def test_between_directions_the_arm_moves_steadily(
    count: int, rail: tuple[float, float]
) -> None:
    """At an end of the rail too: steps twice as small move it by half."""
    rng = np.random.default_rng(9)
    arm = replace(equal_links(count), base_range=rail)
    alpha, theta = rng.uniform(-0.6, 0.6, (2, 200, count))
    turns = rng.uniform(-0.5, 0.5, (2, 200, count))
    x0 = np.clip(rng.uniform(-0.02, 0.02, (2, 200)), *rail)
    here = joint_centres(arm, x0[0], alpha, theta)
    there = joint_centres(arm, x0[1], alpha + turns[0], theta + turns[1])
    tips = here[:, -1].copy(), there[:, -1].copy()
    ends, steps = (DIRECTIONS.coordinates(arm, one) for one in (here, there)), []
    lines = Intervals(*tips, *ends)
    for parts in (200, 400):
        share = np.tile(np.linspace(0.0, 1.0, parts + 1), 200)
        places = lines.centres(arm, np.repeat(np.arange(200), parts + 1), share)
        places = places.reshape(200, parts + 1, count + 1, 3)
        moves = np.linalg.norm(np.diff(places, axis=1), axis=3)
        steps.append(moves.max(axis=(1, 2)))
    found = np.isfinite(steps[1])
    assert found.mean() > 0.9
    assert (steps[1][found] <= 0.6 * steps[0][found]).all()


def test_knees_are_taken_away_and_the_motion_stays_clear() -> None:
    task = two_windows(0.09)
    judge, rows = judge_of(task), path_rows(task.path)
    effort = Insert(population=10, routes=1, backtracks=2, seed=0, directed=True)
    closed = np.zeros(len(rows.tips), dtype=np.bool_)
    found = insert(judge, space_of(task), rows, closed, effort)[0]
    assert found is not None
    assert not found.missing > 0.0
    fewer = sparser(judge, found.corners)
    assert judge.clear(fewer.pick(np.arange(len(fewer.drawn)))).all()
    np.testing.assert_array_equal(fewer.tips, found.corners.tips)
    on = fewer.drawn.nonzero()[0]
    counts = [
        judge.look(corners.tips[on], corners.offsets[on])[1]
        for corners in (found.corners, fewer)
    ]
    assert counts[1].mean() < 0.4 * counts[0].mean()


@pytest.mark.parametrize("drawn", [True, False])
def test_knees_of_an_arm_whose_base_is_fixed_are_taken_away(drawn: bool) -> None:
    """On a path and on the way to a goal; base and tips stay where they are."""
    arm = replace(ARM, base_range=(0.0, 0.0))
    task = replace(problem(points=LOOP, start=START), manipulator=arm)
    size = np.linspace(0.5, 1.0, 5)[:, None]
    alpha, theta = size * np.full(8, 0.2), size * np.linspace(-0.1, 0.2, 8)
    centres = joint_centres(arm, np.zeros(5), alpha, theta)
    corners = Corners(
        centres[:, -1], DIRECTIONS.coordinates(arm, centres), np.arange(5.0),
        np.full(4, drawn),
    )  # fmt: skip
    judge = judge_of(task)
    fewer = sparser(judge, corners)
    assert judge.clear(fewer.pick(np.arange(4))).all()
    np.testing.assert_array_equal(fewer.tips, corners.tips)
    placed = standing(arm, fewer.tips, fewer.offsets)
    np.testing.assert_allclose(placed[:, 0], 0.0, atol=1e-12)
    # The first corner is the start.
    assert judge.look(fewer.tips[1:], fewer.offsets[1:])[1].max() <= 4


@pytest.mark.parametrize("half", few_of([0.09, 0.075], 1))
def test_two_windows_are_passed_and_the_same_plan_comes_again(half: float) -> None:
    task = two_windows(half)
    one = plan_and_judge(task)
    two = plan_fewest(task, link_clearance(task), 0.0)
    np.testing.assert_array_equal(one.trajectory.joints, two.trajectory.joints)


def test_an_arm_bent_through_two_windows_goes_on_from_where_it_is() -> None:
    task = two_windows(0.09)
    plan = plan_fewest(task, link_clearance(task), 0.0)
    rows = plan.trajectory
    half = int(np.flatnonzero(rows.on_path)[0] * 0.8)
    joints = rows.joints[half]
    tip = plan.tip_path.points[half]
    bent = problem(
        *task.scene.obstacles, points=LOOP, start=tuple(tip), start_joints=joints
    )
    again = plan_and_judge(bent)
    np.testing.assert_allclose(again.trajectory.joints[0], joints, atol=1e-9)


def test_directions_and_projections_place_the_same_arms() -> None:
    rng = np.random.default_rng(7)
    centres = bent_arms(rng, 100)
    centres[:, :, 1:] -= centres[:, :1, 1:]
    tips, number, still = centres[:, -1].copy(), np.arange(100), np.zeros(100)
    for directed in (False, True):
        shapes = (DIRECTIONS if directed else OFFSETS).coordinates(ARM, centres)
        placed = Intervals(tips, tips, shapes, shapes).centres(ARM, number, still)
        np.testing.assert_allclose(placed, centres, atol=1e-12)


@pytest.mark.parametrize("rail", [(-9.0, 9.0), (-0.001, 0.001), (-0.3, 0.05)])
def test_between_directions_tip_links_and_rail_are_exact(
    rail: tuple[float, float],
) -> None:
    rng = np.random.default_rng(8)
    arm = replace(ARM, base_range=rail)
    alpha, theta = rng.uniform(-0.5, 0.5, (2, 200, ARM.n_links))
    here = joint_centres(ARM, np.full(200, rail[0]), alpha, theta)
    turns = rng.uniform(-0.1, 0.1, (2, 200, ARM.n_links))
    there = joint_centres(ARM, np.full(200, rail[1]), alpha + turns[0], theta)
    ends = [DIRECTIONS.coordinates(ARM, one) for one in (here, there)]
    tips = here[:, -1].copy(), there[:, -1].copy()
    lines = Intervals(*tips, *ends)
    for share in (0.0, 0.3, 1.0):
        placed = lines.centres(arm, np.arange(200), np.full(200, share))
        good = np.isfinite(placed).all(axis=(1, 2))
        assert good.mean() > 0.97
        placed, tip = placed[good], (1.0 - share) * tips[0] + share * tips[1]
        np.testing.assert_array_equal(placed[:, -1], tip[good])
        np.testing.assert_array_equal(placed[:, 0, 1:], 0.0)
        assert (placed[:, 0, 0] >= rail[0]).all()
        assert (placed[:, 0, 0] <= rail[1]).all()
        links = np.linalg.norm(np.diff(placed, axis=1), axis=2)
        lengths = np.broadcast_to(ARM.link_lengths, links.shape)
        np.testing.assert_allclose(links, lengths, atol=1e-12)
    beyond = Intervals(tips[0] + 50.0, tips[0] + 50.0, ends[0], ends[0])
    assert np.isnan(beyond.centres(arm, np.arange(200), np.zeros(200))).all()


def test_an_interval_whose_base_leaves_a_short_rail_in_between_is_not_clear() -> None:
    lone, knee = np.zeros((1, 9, 2)), np.zeros((1, 9, 2))
    knee[0, 1:8, 0] = np.minimum(np.arange(1, 8), 8 - np.arange(1, 8)) * 0.08
    # Bent to one side and to the other the base is ahead, straight in between behind.
    tip = np.array([[3.126, 0.0, 0.0]])
    lines = Intervals(tip, tip, knee, -knee)
    ends = lines.centres(ARM, np.zeros(2, int), np.array([0.0, 1.0]))[:, 0, 0]
    middle = lines.centres(ARM, np.zeros(1, int), np.full(1, 0.5))[0, 0, 0]
    assert middle < ends.min() - 0.01
    for low, kept in ((middle + 1e-4, False), (middle - 1e-9, True)):
        task = problem()
        arm = replace(task.manipulator, base_range=(low, 9.0))
        judge = judge_of(replace(task, manipulator=arm))
        assert bool(judge.clear(lines)[0]) is kept
        assert bool(judge.clear(Intervals(tip, tip, lone, lone))[0]) is kept


def test_a_base_that_cannot_move_draws_by_its_joints_alone() -> None:
    arm = replace(ARM, base_range=(-1e-6, 1e-6))
    joints = np.zeros(1 + 2 * ARM.n_links)
    joints[[2, 4, 6]] = 0.2, -0.4, 0.3
    centres = joint_centres(arm, joints[:1], joints[None, 1::2], joints[None, 2::2])
    tip = centres[0, -1]
    points = tip + np.array([[0.0, 0.05, 0.05], [-0.05, 0.15, 0.05]])
    ball = Sphere("ball", tip + np.array([-0.3, 0.1, 0.5]), 0.2)
    task = problem(
        ball, points=points, closed=False, start=tuple(tip), start_joints=joints
    )
    plan_and_judge(replace(task, manipulator=arm))


def test_a_box_that_opens_away_from_the_base_is_entered_backwards() -> None:
    arm, half, thick = equal_links(16), 0.15, 0.02
    middle = np.array([1.2, 0.75, 0.0])
    plates = []
    for name, axis, side in (
        ("left", 1, -1.0), ("right", 1, 1.0), ("low", 2, -1.0), ("high", 2, 1.0),
        ("bottom", 0, -1.0),
    ):  # fmt: skip
        at, size = middle.copy(), np.full(3, half + thick)
        at[axis] += side * (half + thick / 2.0)
        size[axis] = thick / 2.0
        plates.append(Box(name, at, np.eye(3), size))
    path = np.array([[1.4, 0.75, 0.0], [1.2, 0.77, 0.0]])
    task = problem(*plates, points=path, closed=False, start=(0.8, 0.0, 0.0))
    centres = plan_and_judge(replace(task, manipulator=arm)).centres
    assert (centres[-1, -1, 0] - centres[-1, -2, 0]) < -0.1


def plan_and_judge(task: PlanningProblem) -> Plan:
    """A plan that draws everything, certified."""
    plan = plan_fewest(task, link_clearance(task), 0.0)
    result = verify(task, plan.trajectory)
    assert result.verdict is Verdict.CERTIFIED
    assert result.coverage == pytest.approx(1.0, abs=1e-9)
    return plan


def test_a_short_rail_is_served_by_a_swing_round_it() -> None:
    rail = replace(ARM, base_range=(-0.04, 0.1))
    goal = np.array([1.9, 0.3, 1.9])
    points = np.stack([goal, goal + 0.1])
    path = DesiredPath(np.array([3.126, 0.0, 0.0]), points)
    task = PlanningProblem(rail, Scene(()), path, 0.0035, name="swing")
    space = space_of(task)
    (route,) = space.swing(goal)
    np.testing.assert_array_equal(route[[0, -1]], [path.start, goal])
    steps = np.linalg.norm(np.diff(route, axis=0), axis=1)
    assert steps.max() <= 1.5 * space.spacing
    far = np.linalg.norm(route - [0.03, 0.0, 0.0], axis=1)
    assert (np.diff(far) * np.sign(far[-1] - far[0]) >= -1e-12).all()
    long = replace(task, manipulator=replace(ARM, base_range=(-3.0, 1.0)))
    assert not list(space_of(long).swing(goal))


def test_thin_links_pass_where_thick_ones_do_not() -> None:
    """The window is narrower than the links that stay before it."""
    arm = replace(ARM, link_radius=0.12, radii=np.repeat([0.12, 0.05], 4))
    points = np.array([[1.35, 0.01, 0.0], [1.55, 0.02, 0.01]])
    walls = wall(0.65, 0.0, 0.0, 0.1)
    task = problem(*walls, points=points, closed=False, start=START)
    task = replace(task, manipulator=arm)
    plan = plan_fewest(task, link_clearance(task), 0.0)
    assert plan.undrawn == ()
    found = verify(task, plan.trajectory)
    assert found.verdict is Verdict.CERTIFIED
