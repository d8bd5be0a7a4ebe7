"""Bounds of all pairs at once, function by function; oracles: loops, closed form."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from oracles.plain import plain
from oracles.tree_queries import random_path, random_tree, unit

from vdsm_pin.geometry.convex import FlatCylinder, Hull
from vdsm_pin.proof import broad_phase, far_pairs, least_bracket, row_places
from vdsm_pin.proof.bodies import Body, ErrorBox, Pair, PairTable
from vdsm_pin.proof.layouts import BEST, KEY, LOW, PAIR, SLICE
from vdsm_pin.proof.packing import pack_task, with_errors
from vdsm_pin.proof.terms import ACROSS, Rules
from vdsm_pin.proof.workspace import new_workspace

GOAL = 1e-9
RULES = Rules(True, True, 1e-11, GOAL, 1e-6, 0.02, np.inf)
raise_bounds = plain(least_bracket._raise_bounds)
nearest_upper, fill_rows = (
    plain(broad_phase._nearest_upper),
    plain(row_places.fill_rows),
)
new_broad_phase = plain(far_pairs.new_broad_phase)


@pytest.mark.parametrize("group", [ACROSS, 1 - ACROSS])
@pytest.mark.parametrize("seed", range(5))
def test_bounds_are_raised_to_what_is_proved_of_all_intervals(
    seed: int, group: int
) -> None:
    rng = np.random.default_rng(seed)
    n, count = int(rng.integers(2, 9)), int(rng.integers(0, 12))
    groups = rng.integers(0, 2, n)
    groups[:2] = 0, 1
    heap = np.zeros((count + 3, SLICE))
    heap[:, PAIR], heap[:, KEY] = (
        rng.integers(0, n, len(heap)),
        rng.normal(size=len(heap)),
    )
    best, profile = rng.normal(size=(n, BEST)), rng.normal(size=(2, 3, 4))
    limit, overflow, gap = *rng.normal(size=(2, 2)), 0.25
    task: Any = SimpleNamespace(
        pairs=SimpleNamespace(group=groups), rules=SimpleNamespace(gap=gap)
    )
    results: Any = SimpleNamespace(
        best=best.copy(), profile=profile.copy(), limit=limit, overflow=overflow
    )
    raise_bounds(task, results, group, heap, count)
    bounds = []
    for pair in range(n):
        mine = heap[:count][heap[:count, PAIR] == pair, KEY]
        bound = min([limit[group] - gap, overflow[group], *mine.tolist()])
        if groups[pair] == group:
            bounds.append(bound)
            best[pair, LOW] = max(best[pair, LOW], bound)
    if group == ACROSS:
        profile[0] = np.maximum(profile[0], min(bounds))
    np.testing.assert_array_equal(results.best, best)
    np.testing.assert_array_equal(results.profile, profile)


@pytest.mark.parametrize("seed", range(6))
def test_the_clearance_of_a_cylinder_and_what_is_nearest_is_bounded_from_above(
    seed: int,
) -> None:
    """At the row of the nearest box, to what brackets are worked out to."""
    rng = np.random.default_rng([5, seed])
    arm = random_tree(rng, 3)
    middle = 5.0 * unit(rng)
    ball = Body(0, (Hull(middle[None], 0.2),))
    can = FlatCylinder(0.1 * rng.normal(size=3), unit(rng), 0.4, 0.3)
    bodies = [ball, Body(arm.n_frames - 1, (can,))]
    path, n = random_path(rng, arm, 6, 1), len(arm.joints)
    table = PairTable.of([Pair(1, 0, 0.0)])
    task = pack_task(arm, bodies, table, RULES, path.reach, np.array([-1, 0]))
    task = with_errors(task, ErrorBox(np.zeros(n), np.zeros(n), np.zeros(n)))
    work, broad = new_workspace(task, arm.n_columns, 4, 8), new_broad_phase(task, 1)
    for start in (0, 3):
        fill_rows(task, path.packed(), work.rows, start, 2)
        broad.gap[:], broad.when[1], row = 1.0, start + 1, start + 1
        upper = nearest_upper(task, work, broad, 0, start)
        (pose,) = arm.poses(path.knots[row : row + 1])[:, arm.n_frames - 1]
        seen = pose[:3, :3].T @ (middle - pose[:3, 3]) - can.centre
        along = abs(float(seen @ can.axis))
        across = float(np.linalg.norm(np.cross(seen, can.axis)))
        sides = max(across - can.radius, 0.0), max(along - can.half_length, 0.0)
        truth = float(np.hypot(*sides)) - 0.2
        assert truth - 1e-8 <= upper <= truth + 1e-6
