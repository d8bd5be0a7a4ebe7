"""The broad phase: boxes over some intervals settle the pairs that are far.

A pair is far where the distance of the boxes exceeds the required clearance, the
least clearance met so far, and the distance of the body's nearest obstacle: then no
narrower bracket could change what is reported.
"""

from typing import Final

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.kernels import NORMAL, UPPER
from vdsm_pin.geometry.obstacles import Measuring, obstacle_bracket
from vdsm_pin.proof.boxes import body_box, box_gaps, box_reaches
from vdsm_pin.proof.far_pairs import BroadPhase, dense_far, keep_least, profile_far
from vdsm_pin.proof.pair_sweep import Block
from vdsm_pin.proof.plane_bounds import place_disc
from vdsm_pin.proof.results import Results
from vdsm_pin.proof.row_places import seen
from vdsm_pin.proof.terms import ACROSS, Task, finer
from vdsm_pin.proof.workspace import Workspace, load_rows

FEW: Final = 8
"""Up to so many obstacles nothing is culled and every bracket is narrow."""

SPREAD: Final = 1.5
"""A box over several intervals may be larger than one of an interval by this; [-]."""


@compiled(inline=False)
def _nearest_upper(
    task: Task, work: Workspace, broad: BroadPhase, body: int, start: int
) -> float:
    """Upper bound of the clearance of a body and of the obstacle whose box is nearest.

    At a row of the block, whose number is that of the first interval of the nearest
    box; inf for a body without pairs.
    """
    pair, row, least, space = -1, 0, np.inf, work.space
    for o in range(broad.number.shape[1]):
        if broad.number[body, o] >= 0 and broad.gap[body, o] < least:
            pair, least = broad.number[body, o], broad.gap[body, o]
            row = broad.when[1, o] - start
    if pair < 0:
        return np.inf
    pair = finer(task.pairs, pair, pair)
    mover = seen(task, work.rows, pair)
    place_disc(mover, work.rows, work.runs, row + 1)
    load_rows(task, mover, work, row, row)
    space.out[NORMAL : NORMAL + 3] = 1.0
    measuring = Measuring(space.scratch, space.nodes, space.trial, space.out)
    obstacle = task.pairs.obstacle[pair]
    obstacle_bracket(task.pieces, obstacle, space.core, task.rules.goal, measuring)
    return float(space.out[UPPER] + mover.rise)


@compiled(inline=False)
def _settle_body(
    task: Task,
    results: Results,
    broad: BroadPhase,
    body: int,
    upper: float,
    n_near: int,
) -> int:
    """Tell which obstacles are far from a body; adds the near ones, their number.

    Args:
        task: The scene, pairs and rules.
        results: For the least clearance met.
        broad: `gap` and `reach` of the body become inf where not far, `far` is written.
        body: The body.
        upper: Upper bound of the distance of its nearest obstacle; [m].
        n_near: Near pairs so far.
    """
    threshold = max(upper, results.limit[ACROSS])
    gap, reach = broad.gap[body], broad.reach[body]
    far, number = broad.far[body], broad.number[body]
    for o in range(gap.size):
        required = task.pairs.required[max(number[o], 0)]
        far[o] = gap[o] >= max(threshold, required) and number[o] >= 0
    for o in range(gap.size):
        if not far[o]:
            gap[o] = reach[o] = np.inf
            if number[o] >= 0:
                broad.near[n_near] = number[o]
                n_near += 1
    return n_near


@compiled(inline=False)
def _bound_body(
    task: Task, work: Workspace, broad: BroadPhase, body: int, block: Block
) -> None:
    """Bounds of a body over a block to all obstacles, by boxes over a few intervals."""
    rows, pair, low, high = work.rows, broad.some[body], np.zeros(3), np.zeros(3)
    gap, reach, when = broad.gap[body], broad.reach[body], broad.when
    count, rise = block.size, task.rules.pad - task.bodies.radius[body]
    gap[:] = reach[:] = np.inf
    length, own = count, body_box(task, rows, (0, 1), pair, low, high)
    while length > 1:
        if body_box(task, rows, (0, length), pair, low, high) <= SPREAD * own:
            break
        length //= 2
    for first in range(0, count, length):
        body_box(task, rows, (first, min(first + length, count)), pair, low, high)
        box_gaps(broad.box, low, high, broad.trial[0])
        box_reaches(broad.point, low, high, rise, broad.trial[1])
        when[0] = block.start + first
        keep_least(broad.trial[0], when[0], gap, when[1])
        keep_least(broad.trial[1], when[0], reach, when[2])
    for o in range(gap.size):
        number = broad.number[body, o]
        gap[o] -= task.pairs.lost[number] if number >= 0 else 0.0


@compiled(inline=False)
def settle_far(
    task: Task, work: Workspace, results: Results, broad: BroadPhase, block: Block
) -> int:
    """Record the pairs that are far over a block and list the others.

    Args:
        task: The scene, pairs and rules.
        work: Working space; its rows are filled.
        results: Where to write.
        broad: Where to write; `near` lists the pairs that need a closer look.
        block: The block.

    Returns:
        The number of near pairs.
    """
    n_bodies, n_obstacles = broad.gap.shape
    if n_obstacles <= FEW:
        return broad.near.size
    n_near, start, count = 0, block.start, block.size
    for body in range(n_bodies):
        if broad.some[body] < 0:
            broad.gap[body, :] = broad.reach[body, :] = np.inf
            broad.far[body, :] = False
            continue
        _bound_body(task, work, broad, body, block)
        upper = _nearest_upper(task, work, broad, body, start)
        if task.rules.nominal:
            results.limit[ACROSS] = min(results.limit[ACROSS], upper)
        n_near = _settle_body(task, results, broad, body, upper, n_near)
        for o in range(n_obstacles):
            broad.settled[body, o] += count if broad.far[body, o] else 0
        gap, reach, when = broad.gap[body], broad.reach[body], broad.when
        keep_least(gap, when[1], broad.lower[body], broad.at_lower[body])
        keep_least(reach, when[2], broad.upper[body], broad.at_upper[body])
    for pair in broad.others:
        broad.near[n_near] = pair
        n_near += 1
    profile_far(task, results, broad, start, count)
    if results.dense.verdict.shape[0] > 0:
        dense_far(task, results.dense, work.rows, broad, block.offset, count)
    return n_near
