"""The rule of a side against every rule tried to the end, one after the other."""

from itertools import product

import numpy as np
import pytest

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.planner.paper.joint_paths import (
    COARSE,
    CROSS,
    LARGEST_SWING,
    SideRule,
    _lines,
    _regions,
    choose_rule,
    links_of,
    slide_joints,
)
from vdsm_pin.planner.paper.region_kernels import keeps_out
from vdsm_pin.planner.paper.sliding_kernels import Standing, standing
from vdsm_pin.problem.planning_problem import PlanningProblem

CORES = {
    "disc": [[0.7, 0.6]],
    "bar": [[0.5, 0.7], [0.8, 0.6]],
    "triangle": [[0.35, 0.3], [0.5, 0.4], [0.4, 0.55]],
}

NONE = np.zeros(8)
"""No margins."""


def score(
    problem: PlanningProblem,
    forbidden: DangerRegion,
    rule: SideRule,
    sequences: list[FloatArray],
) -> tuple[int, float]:
    """Tips reached and minus the shortening, nothing left out."""
    arm = problem.manipulator
    reached, shortening = 0, 0.0
    for tip in sequences:
        for stride, swing in ((COARSE, np.inf), (1, LARGEST_SWING)):
            planar = slide_joints(arm, tip[::stride].copy(), rule)
            links = links_of(arm, NONE)
            able = standing(planar, Standing(links, forbidden.core, swing))
            count = len(able) if able.all() else int(np.argmin(able))
            gaps = np.diff(planar[:count], axis=1) / arm.link_lengths[:, None]
            along = np.sqrt(1.0 - (gaps**2).sum(axis=2)) @ arm.link_lengths
            shortened = float((arm.total_length - along).max(initial=0.0))
            count = min(count * stride, len(tip))
            if count < len(tip):
                break
        reached, shortening = reached + count, max(shortening, shortened)
    return reached, -shortening


def best_of_all(
    problem: PlanningProblem,
    forbidden: DangerRegion,
    side: int,
    sequences: list[FloatArray],
) -> tuple[int, float]:
    lines, regions = _lines(forbidden, side), _regions(problem, [forbidden])
    best = (-1, 0.0)
    for numbers in (range(CROSS), range(CROSS, len(lines))):
        for k, region in product(numbers, regions):
            rule = SideRule(region, side, lines[k], NONE)
            mine = score(problem, forbidden, rule, sequences)
            best = max(best, mine)
            if k < CROSS and mine[0] == sum(map(len, sequences)):
                return mine
    return best


@pytest.mark.parametrize("core", CORES)
@pytest.mark.parametrize("side", [1, -1])
def test_no_rule_left_early_would_have_won(core: str, side: int) -> None:
    problem = read_problem("paper/obs1")
    rng = np.random.default_rng(len(core))
    for _ in range(4):
        forbidden = DangerRegion(core, np.array(CORES[core]), rng.uniform(0.05, 0.2))
        sequences = []
        for _ in range(rng.integers(1, 3)):
            ends = rng.uniform([0.8, 0.3], [1.3, 1.3], (2, 2))
            part = np.linspace(0.0, 1.0, rng.integers(20, 60))[:, None]
            sequences.append(ends[0] + part * (ends[1] - ends[0]))
        rule = choose_rule(problem, forbidden, [forbidden], side, sequences, NONE)
        mine = score(problem, forbidden, rule, sequences)
        assert mine == pytest.approx(
            best_of_all(problem, forbidden, side, sequences), abs=1e-12
        )


def test_nothing_wanted_takes_the_first_rule() -> None:
    problem = read_problem("paper/obs1")
    forbidden = DangerRegion("disc", np.array(CORES["disc"]), 0.1)
    rule = choose_rule(problem, forbidden, [forbidden], 1, [], NONE)
    assert rule.region.radius == forbidden.radius


@pytest.mark.parametrize("core", CORES)
def test_a_segment_keeps_out_where_its_distance_says_so(core: str) -> None:
    rng = np.random.default_rng(3)
    region = DangerRegion(core, np.array(CORES[core]), 0.15)
    chains = rng.uniform(0.0, 1.2, (2000, 2, 2))
    for chain, distance in zip(chains, region.core_distance(chains), strict=True):
        out = keeps_out(region.corners, region.radius, *map(float, chain.ravel()))
        assert out == (distance >= region.radius)
