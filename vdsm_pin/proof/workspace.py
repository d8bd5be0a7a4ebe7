"""What a sweep works with, in compiled code: its space, and what the pairs remember."""

from typing import NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray, paged_zeros, uncleared
from vdsm_pin.geometry.bodies import RADIUS
from vdsm_pin.proof.layouts import HELD_AT, HELD_CLEARANCE, SLICE, SUPPORT, VERSION
from vdsm_pin.proof.packed_tree import REVOLUTE, Pose
from vdsm_pin.proof.plane_bounds import Runs, new_runs
from vdsm_pin.proof.rows import BLOCK, DRIFT, TURN, Rows, new_rows, new_tracks
from vdsm_pin.proof.slices import Space, new_space
from vdsm_pin.proof.swept_bodies import Ends, load_errors, new_ends
from vdsm_pin.proof.terms import Mover, Task


class Workspace(NamedTuple):
    """Working space of a sweep.

    Args:
        rows: The block.
        runs: Bounds of the block's intervals for one pair.
        planes: What the pairs remember, one row each.
        ends: For slices inside an interval.
        space: For bounds.
        heap: For subdivision; its length is the budget of one interval and pair.
        intervals: The same memory and more of it, where the least bracket is narrowed.
    """

    rows: Rows
    runs: Runs
    planes: FloatArray
    ends: Ends
    space: Space
    heap: FloatArray
    intervals: FloatArray


@compiled
def forget(planes: FloatArray) -> None:
    """No pair remembers a plane any more, one row each."""
    planes[:] = 0.0
    for pair in range(planes.shape[0]):
        planes[pair, VERSION] = pair
    planes[:, SUPPORT] = planes[:, HELD_CLEARANCE] = -np.inf


def new_workspace(
    task: Task, n_columns: int, budget: int, block: int = BLOCK, candidates: int = 0
) -> Workspace:
    """Fresh working space; no pair remembers a plane yet.

    Args:
        task: What is asked.
        n_columns: Length of a row of q.
        budget: Most slices of one interval and pair.
        block: Most intervals whose rows are filled at once, BLOCK at most.
        candidates: Most intervals kept for refining the least bracket.
    """
    n_joints, n_ways = task.tree.parent.size, task.ways.rest.size
    corners = int(np.diff(task.bodies.first).max(initial=1))
    many = np.diff(task.pieces.first_piece).max(initial=0) > 1
    held = HELD_AT + 3 * corners if many else HELD_AT
    planes = np.zeros((len(task.pairs.rough), held))
    tracks = new_tracks(task.places.way.size, block)
    intervals = uncleared(candidates + budget, SLICE)
    forget(planes)
    return Workspace(
        new_rows(n_joints + 1, n_ways, tracks, block),
        new_runs(0, block)._replace(growth=paged_zeros(corners, block)),
        planes,
        new_ends(n_joints + 1, n_ways, n_columns),
        new_space(int((task.tree.kind == REVOLUTE).sum()), corners),
        intervals[:budget],
        intervals,
    )


@compiled
def take_frame(rows: Rows, row: int, frame: int, pose: Pose) -> None:
    """Write one frame of one row of a block to a pose."""
    for c in range(3):
        pose.origins[frame, c] = rows.origins[frame, c, row]
        for d in range(3):
            pose.frames[frame, c, d] = rows.frames[frame, c, d, row]


@compiled(inline=False)
def take_row(rows: Rows, row: int, pose: Pose) -> None:
    """Write the configuration of one row of a block to a pose."""
    for frame in range(1, pose.origins.shape[0]):
        take_frame(rows, row, frame, pose)


@compiled(inline=False)
def load_rows(task: Task, mover: Mover, work: Workspace, first: int, last: int) -> None:
    """Load a body between two rows of a block; `last` is `first` or next.

    Of the ends only what errors ask for is written.
    """
    rows, runs, loaded, ends = work.rows, work.runs, work.space.body, work.ends
    corners, tracks = mover.slots.size, rows.tracks
    instants = 2 if last > first else 1
    loaded.used[0], loaded.used[1] = instants * corners, corners
    for k in range(corners):
        place = tracks.places[mover.slots[k]]
        sag = tracks.sags[mover.slots[k], first] if last > first else 0.0
        loaded.balls[k] = sag
        for c in range(3):
            loaded.points[k, c] = place[c, first]
            if last > first:
                loaded.points[corners + k, c] = place[c, last]
    disc = mover.disc[RADIUS]
    loaded.discs[0, RADIUS] = loaded.discs[1, RADIUS] = disc
    if disc > 0.0:
        for c in range(3):
            loaded.discs[0, c] = runs.axis[c, first]
            loaded.discs[1, c] = runs.axis[c, last]
    if not task.rules.steady:
        interval, way = min(first, rows.ways.shape[2] - 1), mover.way
        while way >= 0:
            ends.bends.drifts[way] = rows.ways[way, DRIFT, interval]
            ends.bends.turns[way] = rows.ways[way, TURN, interval]
            way = task.ways.before[way]
        take_row(rows, first, ends.start)
        take_row(rows, last, ends.end)
    load_errors(task, mover, ends, loaded, float(last - first))
