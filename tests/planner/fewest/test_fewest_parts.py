import itertools
from dataclasses import fields, replace

import numpy as np
import pytest
from scenes_for_fewest import problem

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.kinematics import joint_angles, joint_centres, link_angles
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.errors import NoPlanFound
from vdsm_pin.geometry.solids import Box, Capsule, Cylinder, HalfSpace, Sphere
from vdsm_pin.planner.broad_phase import broad_phase
from vdsm_pin.planner.fewest.charts import DIRECTIONS, Intervals, standing
from vdsm_pin.planner.fewest.growth import Layers, Population
from vdsm_pin.planner.fewest.interval_parts import bow_bounds
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.motion import Corners, dense_rows
from vdsm_pin.planner.fewest.offset_kernels import (
    bends_of,
    clearances_along,
    mutated_offsets,
)
from vdsm_pin.planner.fewest.roadmap import CostWeights, Roadmap, build_roadmap
from vdsm_pin.planner.fewest.roadmap_kernels import _drawing, _resting
from vdsm_pin.planner.fewest.route import tip_route
from vdsm_pin.planner.fewest.search import WEIGHTS
from vdsm_pin.planner.fewest.shapes import Shapes, one_knee_shapes
from vdsm_pin.planner.impossible.bounds import prove_tips
from vdsm_pin.planner.one_knee import pose_shapes
from vdsm_pin.planner.path_rows import path_rows
from vdsm_pin.planner.spacing import row_steps
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.link_clearance import link_clearance

ARM = built_in("hrm8")
PILLAR = Cylinder(
    "pillar", np.array([1.563, 0.7, 0.6]), np.array([1.0, 0, 0]), 4.5, 0.2
)


def posed(tips: np.ndarray) -> tuple[Shapes, np.ndarray, np.ndarray, np.ndarray]:
    shapes = one_knee_shapes(ARM, ARM.max_link_angle, 0.08, 8)
    whole = np.ones(len(tips), dtype=np.bool_)
    node, ends, bends = pose_shapes(
        tips, whole, shapes.knees, shapes.slopes, ARM.stations, ARM.max_link_angle,
        (-5.0, 5.0),
    )  # fmt: skip
    return shapes, node, ends, bends


def test_a_shape_reaches_its_tip_with_links_of_their_length_and_one_knee() -> None:
    rng = np.random.default_rng(0)
    tips = np.column_stack([rng.uniform(2, 4, 12), rng.uniform(-1.4, 1.4, (12, 2))])
    shapes, node, ends, bends = posed(tips)
    assert len(node) > 2000
    at = tips[node // shapes.size]
    offsets = shapes.offsets(ARM, at, node % shapes.size)
    still = Intervals(at, at, offsets, offsets)
    centres = still.centres(ARM, np.arange(len(at)), np.zeros(len(at)))
    lengths = np.linalg.norm(np.diff(centres, axis=1), axis=2)
    np.testing.assert_allclose(lengths, np.tile(ARM.link_lengths, (len(at), 1)), 1e-12)
    np.testing.assert_array_equal(centres[:, -1], at)
    np.testing.assert_allclose(centres[:, 0, 1:], 0.0, atol=1e-15)
    angles = link_angles(*joint_angles(ARM, centres))
    knee = shapes.knees[node % shapes.size]
    for joint in range(1, ARM.n_links):
        assert angles[knee != joint, joint].max() < 1e-7
    rows = np.arange(len(at))
    np.testing.assert_allclose(angles[rows, knee], bends.max(axis=1, where=np.stack(
        [knee == 0, knee > 0], axis=1), initial=0.0),
        atol=1e-7)  # fmt: skip
    np.testing.assert_allclose(ends[rows, 1], centres[rows, knee], atol=1e-12)


def test_the_lattice_of_shapes_is_a_symmetric_graph() -> None:
    shapes = one_knee_shapes(ARM, ARM.max_link_angle, 0.08, 8)
    own = np.repeat(np.arange(shapes.size), np.diff(shapes.first))
    pairs = set(zip(own.tolist(), shapes.neighbours.tolist(), strict=True))
    assert all((b, a) in pairs for a, b in pairs)
    assert not any(a == b for a, b in pairs)


def test_bounds_from_boxes_never_exceed_the_clearance_and_are_exact_when_near() -> None:
    rng = np.random.default_rng(1)
    axis = np.array([0.6, 0.0, 0.8])
    task = problem(
        PILLAR,
        Sphere("ball", np.array([2.0, -0.5, 0.3]), 0.15),
        Capsule("rod", np.array([1.0, 0.4, -0.5]), axis, 0.8, 0.05),
        Cylinder("post", np.array([2.5, 0.2, -1.0]), axis, 0.6, 0.1),
        Box("crate", np.array([0.5, -1, 0.5]), np.eye(3), np.array([0.2, 0.3, 0.1])),
        HalfSpace("floor", np.array([0.0, 0, -1.5]), np.array([0.0, 0, 1])),
    )
    exact = link_clearance(task)
    segments = rng.uniform([-1, -1.5, -1.5], [4, 1.5, 1.5], (4000, 2, 3))
    quick = broad_phase(task, exact)
    truth, bound = exact(segments)[:, 0], quick(segments)[:, 0]
    # Below zero the clearance function promises the sign alone.
    apart, near = truth > 0.0, bound < quick.far
    assert (bound[apart] <= truth[apart] + 1e-8).all()
    assert (bound[~apart] <= 0.0).all()
    assert 0.1 < near.mean() < 0.9
    enough = near & (truth >= task.required_clearance)
    np.testing.assert_allclose(bound[enough], truth[enough], atol=1e-8)


def test_bent_arms_are_tried_only_near_where_the_straight_one_does_not_do() -> None:
    task = problem(PILLAR)
    clearance = link_clearance(task)
    rows = path_rows(task.path)
    shut = np.zeros(len(rows.tips), dtype=np.bool_)
    route = tip_route(task, rows, shut, 0.08, 0.0)
    shapes = one_knee_shapes(ARM, ARM.max_link_angle, 0.08, 8)
    judge = Judge(task, clearance, 0.0, 0.0, 2e-3)
    every, some = (
        build_roadmap(judge, CostWeights(), route, shapes, around)
        for around in (None, 3)
    )
    assert set(some.node.tolist()) < set(every.node.tolist())
    straight = every.index[np.arange(len(route.tips)) * shapes.size]
    poor = np.flatnonzero((straight < 0) | (every.cost[straight] > 2.0))
    bent = np.flatnonzero(np.diff(some.tip_nodes) > 1)
    assert set(poor.tolist()) <= set(bent.tolist())
    assert all(np.abs(poor - tip).min() <= 3 for tip in bent)
    # At those tips nothing is left out, and the straight arm nowhere.
    for tip in bent:
        assert np.diff(every.tip_nodes)[tip] == np.diff(some.tip_nodes)[tip]
    again = some.index[np.arange(len(route.tips)) * shapes.size]
    np.testing.assert_array_equal(again >= 0, straight >= 0)


def test_between_two_nodes_all_joints_bend_that_do_at_either() -> None:
    """What moves cost, against link angles of the arms themselves."""
    task, graph = problem(PILLAR), roadmap_of(problem(PILLAR))
    arm, made = task.manipulator, graph.graph()
    every = np.arange(len(graph.node))
    centres = standing(arm, *graph.poses_of(arm, every))
    bent = link_angles(*joint_angles(arm, centres)) > TOLERANCES.changed_angle
    assert {tuple(np.flatnonzero(row)) for row in bent} >= {(0,), (3,), (0, 3), (0, 4)}
    rng, weights = np.random.default_rng(3), WEIGHTS._replace(angle=0.7)
    for u, v in rng.integers(len(every), size=(300, 2)):
        left, new = (bent[u] & ~bent[v]).sum(), (bent[v] & ~bent[u]).sum()
        more = weights.more * bool(left and new)
        drawn, rests = _drawing(made, weights, 0.1, u, v), _resting(made, weights, u, v)
        assert drawn == pytest.approx(0.1 * 0.7 * left + more, abs=1e-12)
        strain = 0.5 * (graph.strain[u] + graph.strain[v])
        every_bent = weights.still * (bent[u] | bent[v]).sum()
        assert rests == pytest.approx(every_bent + more + strain, abs=1e-12)


def roadmap_of(task: PlanningProblem) -> Roadmap:
    """All shapes at all tips, coarse."""
    rows = path_rows(task.path)
    route = tip_route(task, rows, np.zeros(len(rows.tips), dtype=np.bool_), 0.08, 0.0)
    shapes = one_knee_shapes(ARM, ARM.max_link_angle, 0.08, 8)
    judge = Judge(task, link_clearance(task), 0.0, 0.0, 2e-3)
    return build_roadmap(judge, CostWeights(), route, shapes)


def test_a_motion_through_a_thin_plate_is_refused_though_both_ends_are_clear() -> None:
    plate = Box("plate", np.array([2.9, 0.3, 0.0]), np.eye(3), np.array([2, 0.002, 2]))
    task = problem(plate)
    judge = Judge(task, link_clearance(task), 0.0, 0.0, 2e-3)
    a, b = np.array([[3.126, 0.15, 0.0]]), np.array([[3.126, 1.0, 0.0]])
    zero = np.zeros((1, 9, 2))
    assert not judge.clear(Intervals(a, b, zero, zero))[0]
    assert judge.clear(Intervals(a, a - 0.02, zero, zero))[0]
    # Both sides: with the plate out of the way the same motion is clear.
    free = problem()
    judge = Judge(free, link_clearance(free), 0.0, 0.0, 2e-3)
    assert judge.clear(Intervals(a, b, zero, zero))[0]


def test_no_interval_is_clear_that_bends_too_far_between_its_ends() -> None:
    """Oracle: link angles at 400 places of each interval.

    On a fixed base the first link makes up for what the others leave, so that an
    interval bends most anywhere.
    """
    rng = np.random.default_rng(5)
    fixed = replace(ARM, base_range=(0.0, 0.0))
    task = replace(problem(), manipulator=fixed)
    limit, count = ARM.max_link_angle, 1000
    psi = limit * rng.uniform(0.6, 0.999, (count, 2, 8))
    around = rng.uniform(0.0, 2.0 * np.pi, (count, 1, 8))
    around = around + rng.normal(0.0, 0.3, (count, 2, 8))
    theta = -np.arcsin(np.sin(psi) * np.sin(around)).reshape(-1, 8)
    alpha = np.arctan2(np.sin(psi) * np.cos(around), np.cos(psi)).reshape(-1, 8)
    centres = joint_centres(fixed, np.zeros(2 * count), alpha, theta)
    axes = DIRECTIONS.coordinates(fixed, centres).reshape(count, 2, 8, 3)
    tips = centres[:, -1].reshape(count, 2, 3)
    lines = Intervals(tips[:, 0], tips[:, 1], axes[:, 0], axes[:, 1])
    places, number = np.linspace(0.0, 1.0, 401), np.arange(count)
    bends = np.stack(
        [
            bends_of(lines.centres(fixed, number, np.full(count, share))).max(axis=1)
            for share in places
        ]
    )
    few = np.isfinite(bends).all(axis=0) & (bends[::100] <= limit).all(axis=0)
    hidden = few & (bends.max(axis=0) > limit + TOLERANCES.joint_limit)
    assert hidden.sum() > 5
    judge = Judge(task, link_clearance(task), 0.0, 0.0, 2e-3)
    clear = judge.clear(lines)
    assert not clear[hidden].any()
    assert clear[few & (bends.max(axis=0) <= limit)].all()


def wandering(task: PlanningProblem, seed: int, count: int) -> Intervals:
    """A chain in which knees turn and slide while the tip goes along the path."""
    rng = np.random.default_rng(seed)
    shapes = one_knee_shapes(ARM, ARM.max_link_angle, 0.08, 8)
    tips = task.path.at(np.linspace(0.0, task.path.length, count))
    shape = [int(rng.integers(1, shapes.size))]
    while len(shape) < count:
        near = shapes.neighbours[shapes.first[shape[-1]] : shapes.first[shape[-1] + 1]]
        shape.append(int(rng.choice(near)))
    offsets = shapes.offsets(ARM, tips, np.array(shape))
    return Intervals(tips[:-1], tips[1:], offsets[:-1], offsets[1:])


def test_joint_centres_bow_out_no_farther_than_their_bounds() -> None:
    """Also where a link swings past the straight one and the others come back."""
    rng, share = np.random.default_rng(6), np.linspace(0.0, 1.0, 41)
    tips = rng.uniform([3.0, -0.4, -0.4], [3.2, 0.4, 0.4], (300, 3))
    offsets = np.zeros((300, 9, 2))
    offsets[:, 1:-1] = rng.normal(0.0, 0.02, (300, 7, 2))
    offsets[1::2, :-1] = offsets[::2, :-1]
    lines = Intervals(tips[::2], tips[1::2], offsets[::2], offsets[1::2])
    number = np.repeat(np.arange(150), len(share))
    places = lines.centres(ARM, number, np.tile(share, 150)).reshape(150, -1, 9, 3)
    begin, end = places[:, 0], places[:, -1]
    bounds = np.zeros((150, 9))
    for row in range(150):
        bow_bounds(begin[row], end[row], bounds[row])
    ways = np.linalg.norm(places - begin[:, None], axis=3)
    ways += np.linalg.norm(places - end[:, None], axis=3)
    bows = (ways - np.linalg.norm(end - begin, axis=2)[:, None]).max(axis=1) / 2.0
    assert (bows <= bounds + 1e-12).all()
    assert (bows[:, 0] / bounds[:, 0]).max() > 0.5


@pytest.mark.parametrize("seed", range(4))
def test_an_interval_is_clear_exactly_where_dense_samples_are(seed: int) -> None:
    task = problem(PILLAR, Sphere("ball", np.array([2.0, -0.2, 0.3]), 0.15))
    chain, clearance, finest = wandering(task, seed, 400), link_clearance(task), 2e-3
    mixed = np.random.default_rng(seed).permutation(399)
    alone = Intervals(*(getattr(chain, f.name)[mixed] for f in fields(chain)[:4]))
    judge = Judge(task, clearance, 0.0, 0.0, finest)
    for intervals in (chain, alone):
        clear, begin = judge.measured(intervals)
        rows, places = (
            np.repeat(np.arange(399), 65),
            np.tile(np.linspace(0, 1, 65), 399),
        )
        centres = intervals.centres(ARM, rows, places)
        clearances = clearance(centres).min(axis=1)
        clearances[~(bends_of(centres).max(axis=1) <= judge.limit)] = -np.inf
        clearances = clearances.reshape(399, 65)
        assert 0.03 < clear.mean() < 0.9
        # What is clear may lose half of the finest way between two looks.
        assert clearances[clear].min() >= task.required_clearance - finest / 2.0
        assert (clearances[~clear].min(axis=1) < task.required_clearance + finest).all()
        # Below zero the clearance function promises the sign alone.
        kept, first = begin >= 0.0, clearances[:, 0]
        np.testing.assert_array_equal(kept, first >= 0.0)
        np.testing.assert_allclose(begin[kept], first[kept], atol=1e-8)


def test_pieces_cut_at_other_knees_have_the_least_room_of_what_they_share() -> None:
    rng = np.random.default_rng(3)
    knees, others = rng.random((2, 400, 9)) < 0.4
    knees[:, [0, -1]] = others[:, [0, -1]] = True
    clearances = np.where(knees[:, 1:], rng.uniform(size=(400, 8)), np.inf)
    found = clearances_along(clearances, knees, others)
    for row in range(400):
        cuts, ends = np.flatnonzero(others[row]), np.flatnonzero(knees[row])
        expected = np.full(8, np.inf)
        for a, b in itertools.pairwise(cuts):
            shared = [clearances[row, d - 1] for c, d in itertools.pairwise(ends)
                      if c < b and a < d]  # fmt: skip
            expected[b - 1] = min(shared)
        np.testing.assert_array_equal(found[row], expected)


def test_what_is_grown_passes_an_obstacle_by_ways_that_are_clear() -> None:
    tips = np.linspace([3.126, 0.0, 0.0], [3.126, 0.9, 0.0], 12)
    rod = Cylinder("rod", np.array([2.0, 0.3, 0.0]), np.array([0, 0, 1.0]), 3.0, 0.002)
    for obstacle in (Sphere("ball", np.array([2.0, 0.5, 0.1]), 0.15), rod):
        task = problem(obstacle)
        judge = Judge(task, link_clearance(task), 0.0, 0.0, 2e-3)
        layers, rng = Layers(tips, np.zeros(12)), np.random.default_rng(0)
        roots = np.zeros((2, 9, 2))
        roots[1, 1:-1, 1] = 0.05
        tree = Population(judge, layers, rng, 150).grow(roots, kept=6)
        np.testing.assert_array_equal(tree.offsets[:2], roots)
        assert tree.parent[:2].tolist() == [-1, -1]
        born = np.arange(2, len(tree.parent))
        up = tree.parent[born]
        assert ((up >= 0) & (up < born)).all()
        assert set(born[:-1]) >= set(up[up >= 2].tolist())
        steps = tree.layer[born] - tree.layer[up]
        assert np.isin(steps, [0, 1]).all()
        assert 1 <= (tree.layer == 11).sum() <= 6
        np.testing.assert_array_equal(tree.tips, tips[tree.layer])
        ways = Intervals(
            tree.tips[up], tree.tips[born], tree.offsets[up], tree.offsets[born]
        )
        assert judge.clear(ways).all()


def test_intervals_are_judged_alike_in_blocks_of_any_size(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    task = problem(PILLAR)
    judge, chain = (
        Judge(task, link_clearance(task), 0.0, 0.0, 2e-3),
        wandering(task, 3, 60),
    )
    whole = judge.measured(chain)
    for size in (1, 7, 60):
        monkeypatch.setattr("vdsm_pin.planner.fewest.judge.BLOCK", size)
        good, begin = judge.measured(chain)
        np.testing.assert_array_equal(good, whole[0])
        # Below 0 the sign alone is meant.
        np.testing.assert_allclose(begin.clip(0.0), whole[1].clip(0.0), atol=1e-9)
    assert 0 < whole[0].sum() < len(whole[0])


def test_a_motion_past_a_limit_is_refused() -> None:
    task = problem()
    judge = Judge(task, link_clearance(task), 0.0, 0.0, 2e-3)
    zero = np.zeros((1, 9, 2))
    reach = ARM.total_length * np.sin(ARM.max_link_angle)
    a = np.array([[3.126, 1.0, 0.0]])
    inside, outside = a.copy(), a.copy()
    inside[0, 1], outside[0, 1] = reach - 1e-6, reach + 1e-6
    assert judge.clear(Intervals(a, inside, zero, zero))[0]
    assert not judge.clear(Intervals(a, outside, zero, zero))[0]


def test_tips_are_proved_out_of_reach_on_the_right_side_of_both_limits() -> None:
    ball = Sphere("ball", np.array([3.126, 0.5, 0.0]), 0.1)
    task = problem(ball)
    margin = 0.1 + ARM.link_radius + task.required_clearance
    off = task.tip_tolerance  # the tip may be so far beside its place
    y = [0.5 + margin - 0.5 * off, 0.5 + margin - 1.5 * off, 2.966, 2.967]
    tips = np.column_stack([np.full(4, 3.126), y, np.zeros(4)])
    proof = prove_tips(task, link_clearance(task), tips)
    assert proof.buried.tolist() == [False, True, False, False]
    assert proof.far.tolist() == [False, False, False, True]


def test_children_differ_from_their_parent_between_two_of_its_knees_only() -> None:
    rng = np.random.default_rng(2)
    n = 500
    parents = np.zeros((n, 9, 2))
    hat = np.minimum(ARM.stations / ARM.stations[4],
                     (ARM.total_length - ARM.stations)
                     / (ARM.total_length - ARM.stations[4]))  # fmt: skip
    parents += hat[:, None] * np.array([0.3, -0.1])
    children = mutated_offsets(
        parents, ARM.stations, np.zeros((n, 2)), rng.random(n), rng.random(n),
        rng.normal(size=(n, 2)) * 0.1,
    )  # fmt: skip
    np.testing.assert_array_equal(children[:, [0, -1]], 0.0)
    slopes = np.diff(children, axis=1) / ARM.link_lengths[:, None]
    bent = np.abs(np.diff(slopes, axis=1)).max(axis=2) > TOLERANCES.straight_slope
    assert bent.sum(axis=1).max() == 2
    assert bent.sum(axis=1).min() <= 1


@pytest.mark.parametrize("spacing", [0.01, 0.0333, 0.7])
def test_rows_of_the_path_hold_every_corner_and_keep_the_spacing(
    spacing: float,
) -> None:
    task = problem(start=(3.126, 0.4, 0.0))
    path = task.path
    rows = path_rows(type(path)(path.start, path.points, path.closed, spacing=spacing))
    gaps = np.linalg.norm(np.diff(rows.tips, axis=0), axis=1)
    assert gaps.max() <= spacing + 1e-12
    np.testing.assert_allclose(rows.tips[0], [3.126, 0.4, -0.2], atol=1e-12)
    np.testing.assert_allclose(rows.tips[-1], rows.tips[0], atol=1e-12)
    for corner in path.points:
        assert np.linalg.norm(rows.tips - corner, axis=1).min() < 1e-12
    for a, b in itertools.pairwise(rows.stations):
        assert b > a


@pytest.mark.parametrize("start", [(3.126, 0.0, 0.0), (3.126, 0.7, 1.0)])
def test_a_closed_path_may_be_begun_at_any_of_its_rows(
    start: tuple[float, float, float],
) -> None:
    path = problem(start=start).path
    rows = path_rows(path)
    for first in range(0, len(rows.tips) - 1, 17):
        other = rows.begun_at(first, path.length)
        np.testing.assert_array_equal(other.tips[[0, -1]], rows.tips[[first, first]])
        np.testing.assert_allclose(other.tips[other.as_stated], rows.tips, atol=1e-12)
        assert 0.0 <= other.stations[0] < path.length
        span = other.stations[-1] - other.stations[0]
        assert span == pytest.approx(path.length, abs=1e-12)
        assert (np.diff(other.stations) > 0.0).all()
        np.testing.assert_allclose(
            path.at(np.mod(other.stations, path.length)), other.tips, atol=1e-12
        )
        assert other.corner[[0, -1]].all()
        assert other.corner.sum() - rows.corner.sum() in (0, 1)


def test_rows_crowd_where_a_stretched_arm_is_drawn_back() -> None:
    """The base at rest, angles go with the root of the way: few rows will do."""
    arm = replace(ARM, base_range=(0.0, 0.0))
    tips = np.array([[arm.total_length, 0.0, 0.0], [0.97 * arm.total_length, 0.1, 0.0]])
    bent = np.tile([1.0, 0.1, 0.0], (arm.n_links, 1))
    bent[1::2, 1] *= -1.0
    links = np.stack([np.tile([1.0, 0.0, 0.0], (arm.n_links, 1)), bent])
    corners = Corners(
        tips, links / np.linalg.norm(links, axis=2, keepdims=True), np.zeros(2),
        np.zeros(1, dtype=np.bool_),
    )  # fmt: skip
    turn, stray = np.deg2rad(4.9), 3e-4
    rows = dense_rows(arm, corners, 0.01, turn, stray)
    alpha, theta = joint_angles(arm, rows.centres)
    steps = np.abs(np.diff(np.concatenate([alpha, theta], axis=1), axis=0))
    assert steps.max() <= turn
    assert len(rows.share) < 1000
    assert np.diff(rows.share).max() > 20.0 * np.diff(rows.share).min()


@pytest.mark.parametrize("spacing", [1e-4, 3e-4, 1e-3])
def test_the_bound_of_the_tips_way_between_drawn_rows_is_within_the_spacing(
    spacing: float,
) -> None:
    """Links swing to and fro while the tip creeps: far less happens to it than may."""
    arm = replace(ARM, base_range=(-9.0, 9.0))
    offsets = np.zeros((2, arm.n_links + 1, 2))
    offsets[1, 1:-1:2, 0], offsets[1, 2:-1:2, 0] = 0.02, -0.02
    tips = np.array([[3.0, 0.0, 0.0], [3.0 + 2.0 * spacing, 0.0, 0.0]])
    some = Corners(tips, offsets, np.zeros(2), np.ones(1, dtype=np.bool_))
    rows = dense_rows(arm, some, spacing, np.deg2rad(4.9), 1.0)
    _, bound = row_steps(arm, *joint_angles(arm, rows.centres))
    assert bound.max() <= spacing
    assert len(rows.share) < 200


def test_rows_are_refused_where_no_arm_stands_between_two_corners() -> None:
    # From elbow up to elbow down by way of the stretched arm, which is too long.
    arm = replace(
        built_in("hrm8"), link_lengths=np.ones(2), base_range=(0.0, 0.0),
        cables=CableLayout(0.04, 0.1, paper_hole_angles(2)),
    )  # fmt: skip
    up = np.array([[0.6, 0.8, 0.0], [0.6, -0.8, 0.0]])
    corners = Corners(
        np.tile([1.2, 0.0, 0.0], (2, 1)), np.stack([up, up[::-1]]), np.zeros(2),
        np.zeros(1, np.bool_),
    )  # fmt: skip
    ends = standing(arm, corners.tips, corners.offsets)
    assert np.isfinite(ends).all()
    with pytest.raises(NoPlanFound, match="no arm can stand"):
        dense_rows(arm, corners, 0.01, 0.08, 1e-4)
