"""Proofs that no way leads to a tip, from both sides of what passes."""

import itertools
from contextlib import suppress
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scenes_for_fewest import problem, random_problem
from some_slow import few_of

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.errors import CutOff, OutOfTime
from vdsm_pin.geometry.arrays import FloatArray, IntArray, rotation_from_rpy
from vdsm_pin.geometry.pieces import pack_pieces
from vdsm_pin.geometry.solids import Box, Sphere
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.broad_phase import broad_phase
from vdsm_pin.planner.fewest.explore import _leads_there, explore
from vdsm_pin.planner.fewest.levels import Effort, Insert, Search
from vdsm_pin.planner.fewest.roadmap import CostWeights
from vdsm_pin.planner.fewest.strategy import plan_fewest
from vdsm_pin.planner.impossible.cut_off import CutOffProof, cut_off
from vdsm_pin.planner.octree import DEPTH, Octree, adjoining, places
from vdsm_pin.planner.path_rows import path_rows
from vdsm_pin.planner.upper_clearance import (
    nearest_bounds,
    upper_bounds,
    upper_bounds_to,
)
from vdsm_pin.problem.desired_path import Blocked
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.link_clearance import link_clearance

KEEP = built_in("hrm8").link_radius + 0.0035
"""What the tip keeps from every surface."""


def plate(name: str, centre: FloatArray, R: FloatArray, size: list[float]) -> Box:
    return Box(name, centre, R, np.array(size) / 2.0)


def cage(window: float, R: FloatArray, centre: FloatArray) -> list[Box]:
    """A room of 0.8 m whose one window is a square of twice `window`."""
    room, thick = 0.8, 0.03
    boxes = []
    for axis in range(3):
        for side in (-1.0, 1.0):
            if axis == 0 and side < 0.0:
                continue
            size = [room + 2 * thick] * 3
            size[axis] = thick
            off = np.zeros(3)
            off[axis] = side * (room + thick) / 2.0
            boxes.append(plate(f"p{axis}{side:+.0f}", centre + R @ off, R, size))
    wide = (room + 2 * thick - 2 * window) / 2.0
    for c, a in ((1, 2), (2, 1)):
        for side in (-1.0, 1.0):
            size = [thick] * 3
            size[c], size[a] = wide, room + 2 * thick
            off = np.array([-(room + thick) / 2.0, 0.0, 0.0])
            off[c] = side * (window + wide / 2.0)
            boxes.append(plate(f"w{c}{side:+.0f}", centre + R @ off, R, size))
    return boxes


@pytest.mark.parametrize("seed", few_of(2, 1))
def test_a_window_lets_the_tip_in_from_the_bodys_width_on(seed: int) -> None:
    rng = np.random.default_rng([91, seed])
    R = rotation_from_rpy(rng.uniform(-0.7, 0.7, 3))
    centre = np.array([2.6, *rng.uniform(-0.4, 0.4, 2)])
    inside, outside = centre + R @ [0.1, 0.1, 0.0], centre + R @ [0.7, 0.0, 0.0]
    start = tuple((centre - R @ np.array([0.8, 0.0, 0.0])).tolist())
    tips = np.stack([inside, outside])
    for window, answer in ((KEEP - 4e-4, True), (KEEP + 4e-4, False)):
        task = problem(*cage(window, R, centre), start=start, points=tips, closed=False)
        assert cut_off(task, tips).tolist() == [answer, False]


def test_the_nearest_of_many_obstacles_is_that_of_all_of_them() -> None:
    """Oracle: closed forms of boxes and balls, every one of them."""
    rng = np.random.default_rng(7)
    centres, half = rng.uniform(-1.0, 1.0, (60, 3)), rng.uniform(0.01, 0.2, (60, 3))
    turned = rotation_from_rpy(np.array([0.3, -0.5, 0.8]))
    solids = [
        Box(f"o{k}", centres[k], turned, half[k])
        if k % 2
        else Sphere(f"o{k}", centres[k], half[k, 0])
        for k in range(60)
    ]
    pieces = pack_pieces([solid.pieces for solid in solids])
    points = rng.uniform(-1.5, 1.5, (200, 3))
    away = points[:, None] - centres
    boxes = np.maximum(np.abs(away @ turned) - half, 0.0)
    balls = np.maximum(np.linalg.norm(away, axis=2) - half[:, 0], 0.0)
    is_box = np.arange(60) % 2 == 1
    truth = np.where(is_box, np.linalg.norm(boxes, axis=2), balls)
    upper, which = nearest_bounds(pieces, points, np.inf)
    np.testing.assert_allclose(np.maximum(upper, 0.0), truth.min(axis=1), atol=1e-9)
    to_it = upper_bounds_to(pieces, points, which, np.inf)
    np.testing.assert_allclose(to_it, upper, atol=1e-9)
    every = upper_bounds(pieces, np.stack([points, points], axis=1), np.inf)
    np.testing.assert_allclose(np.maximum(every, 0.0), truth, atol=1e-9)
    late, _ = nearest_bounds(pieces, points, 0.0)
    assert np.isinf(late).all()
    assert np.isinf(upper_bounds_to(pieces, points, which, 0.0)).all()


def test_the_tip_of_a_plan_is_never_cut_off() -> None:
    for name in ("obs1", "obs2", "obs3"):
        task = read_problem(f"paper/{name}")
        assert not cut_off(task, path_rows(task.path).tips).any()
    for seed in range(3):
        task = random_problem(seed, clutter=True)
        tips = plan_fewest(task, link_clearance(task), 0.0).tip_path.points[::10]
        assert not cut_off(task, tips).any()


def once_more(halved: list[int]) -> Deadline:
    """A deadline that passes as soon as there is one entry more."""
    seen = len(halved)

    class Once(Deadline):
        @property
        def passed(self) -> bool:
            return len(halved) > seen

    return Once()


def test_a_proof_that_had_no_time_goes_on_from_there(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """The time is over after each halving: it ends after as many, with the answer."""
    centre = np.array([2.6, 0.5, 0.0])
    task = problem(*cage(KEEP - 0.02, np.eye(3), centre), start=(1.8, 0.0, 0.0))
    halved: list[int] = []
    split = Octree.split

    def counted(cells: Octree, chosen: IntArray) -> None:
        split(cells, chosen)
        halved.append(cells.codes.size)

    monkeypatch.setattr(Octree, "split", counted)
    tips = centre[None]
    whole = cut_off(task, tips)
    at_once, proof = halved.copy(), CutOffProof(task, tips)
    halved.clear()
    found = None
    while found is None:
        with suppress(OutOfTime):
            found = proof.proved(once_more(halved))
    assert whole.tolist() == found.tolist() == [True]
    assert halved == at_once and len(halved) > 3


def test_no_proof_is_tried_where_a_way_of_the_tip_is_known(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = list[object]()

    def counted(*given: object) -> NDArray[np.bool_]:
        asked.append(given)
        return np.zeros(len(path_rows(task.path).tips), dtype=np.bool_)

    monkeypatch.setattr(CutOffProof, "proved", counted)
    centre = np.array([2.6, 0.5, 0.0])
    tips = centre + np.array([[0.2, 0.0, 0.0], [0.2, 0.1, 0.0]])
    for window, tries in ((KEEP + 0.02, 0), (KEEP - 0.02, 1)):
        task = problem(
            *cage(window, np.eye(3), centre), points=tips, closed=False,
            start=(1.8, 0.0, 0.0),
        )  # fmt: skip
        quick = broad_phase(task, link_clearance(task))
        insert = Insert(population=1, routes=0, backtracks=0, seed=0, cells=9000)
        levels = Search(rounds=1, back=0.0, grow=0, around=0), insert
        effort = Effort(levels, proves=True)
        found = explore(task, quick, 0.0, CostWeights(), effort)
        # What is known before any search, after the first, and what is proved.
        assert len(list(itertools.islice(found, 3))) == 3
        assert len(asked) == tries
        asked.clear()


@pytest.mark.parametrize("wall", [0.025, 1.0])
def test_behind_a_wall_between_two_rows_the_path_does_not_lead(wall: float) -> None:
    """Rows are 10 mm apart; a wall between two of them blocks none of them."""
    tips, blank = np.outer(np.arange(5), [0.01, 0.0, 0.0]), np.zeros(5, np.bool_)

    def spare(points: FloatArray, ends: FloatArray) -> FloatArray:
        return np.where((points[:, 0] < wall) & (ends[:, 0] > wall), -0.001, 0.001)

    asked: list[float] = []

    def leads_to(tip: FloatArray, _: int) -> bool:
        asked.append(tip[0])
        return bool(tip[0] < wall)

    room = SimpleNamespace(spare=spare)
    room._replace = lambda required: room
    judge = SimpleNamespace(problem=SimpleNamespace(required_clearance=0.0))
    outcome: Any = SimpleNamespace(
        rows=SimpleNamespace(tips=tips), judge=judge, drawn=blank,
        proof=SimpleNamespace(undrawable=blank),
    )  # fmt: skip
    space: Any = SimpleNamespace(room=room, leads_to=leads_to)
    assert _leads_there(space, outcome) == (wall > 0.04)
    assert asked == ([0.0] if wall > 0.04 else [0.0, 0.03])


def test_a_tip_beyond_reach_or_in_an_obstacle_counts_as_cut_off() -> None:
    ball = Sphere("ball", np.array([3.126, 1.0, 0.5]), 0.1)
    tips = np.array([[3.126, 1.0, 0.55], [3.126, 0.5, 0.5], [3.126, 3.5, 0.0]])
    assert cut_off(problem(ball), tips).tolist() == [True, False, True]


def test_what_lies_behind_a_narrow_hole_is_refused_with_place_and_obstacles() -> None:
    centre, R = np.array([2.9, 0.0, 0.0]), np.eye(3)
    points = np.array([[2.9, 0.1, 0.1], [2.9, -0.1, 0.1]])
    start = (2.2, 0.0, 0.0)

    narrow = problem(*cage(KEEP - 0.002, R, centre), start=start, points=points,
                     closed=False, blocked=Blocked.FAIL)  # fmt: skip
    with pytest.raises(
        CutOff, match=r"narrowest at \(2\d{3}\.\d, .* 'w\d.*: 12(5\.9|6\.0)"
    ):
        plan_fewest(narrow, link_clearance(narrow), 0.0)


def _random_cells(rng: np.random.Generator) -> tuple[IntArray, IntArray]:
    """Codes and levels of an octree that is deep in some places."""
    codes, levels = np.zeros(1, np.int64), np.zeros(1, np.int64)
    for _ in range(DEPTH):
        deepest = np.flatnonzero(levels == levels.max())
        some = np.append(rng.integers(0, len(codes), 25), rng.choice(deepest, 4))
        chosen = np.unique(some[levels[some] < DEPTH])
        count = np.ones(len(codes), dtype=np.int64)
        count[chosen] = 8
        kids = ((np.cumsum(count) - count)[chosen, None] + np.arange(8)).ravel()
        codes, levels = np.repeat(codes, count), np.repeat(levels, count)
        levels[kids] += 1
        codes[kids] += np.tile(np.arange(8), len(chosen)) << (
            3 * (DEPTH - levels[kids])
        )
    return codes, levels


def test_cells_adjoin_where_their_boxes_share_a_part_of_a_face() -> None:
    """Against every pair of boxes, down to the finest cells."""
    rng = np.random.default_rng(2)
    codes, levels = _random_cells(rng)
    assert levels.max() == DEPTH
    passable = rng.random(len(codes)) < 0.8
    first, neighbours = adjoining(codes, levels, passable)
    low = places(codes)
    high = low + (1 << (DEPTH - levels))[:, None]
    for n in range(len(codes)):
        shared = np.minimum(high[n], high) - np.maximum(low[n], low)
        touches = (shared >= 0).all(axis=1) & ((shared == 0).sum(axis=1) == 1)
        known = np.flatnonzero(touches & passable) if passable[n] else np.zeros(0, int)
        found = np.unique(neighbours[first[n] : first[n + 1]])
        np.testing.assert_array_equal(found, known)
