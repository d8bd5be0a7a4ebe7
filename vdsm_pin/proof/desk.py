"""What a sweep works with, in compiled code: its space, and what the pairs remember."""

from typing import NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.proof.coasting import Runs, new_runs
from vdsm_pin.proof.layouts import HELD_CLEARANCE, PLANE, SLICE, SUPPORT
from vdsm_pin.proof.rows import BLOCK, Rows, new_rows
from vdsm_pin.proof.slices import Space, new_space
from vdsm_pin.proof.swept_links import Ends, load_errors, new_ends
from vdsm_pin.proof.terms import Task


class Desk(NamedTuple):
    """Working space of a sweep.

    Args:
        rows: The block.
        runs: Bounds of the block's intervals for one pair.
        planes: What the pairs remember, shape (n_pairs, PLANE).
        ends: For slices inside an interval.
        space: For bounds.
        heap: For subdivision; its length is the budget of one interval and pair.
    """

    rows: Rows
    runs: Runs
    planes: FloatArray
    ends: Ends
    space: Space
    heap: FloatArray


@compiled
def forget(planes: FloatArray) -> None:
    """No pair remembers a plane any more, shape (n_pairs, PLANE)."""
    planes[:] = 0.0
    planes[:, 0] = 1.0
    planes[:, SUPPORT] = planes[:, HELD_CLEARANCE] = -np.inf


@compiled
def new_desk(n_links: int, n_pairs: int, budget: int) -> Desk:
    """Fresh working space; no pair remembers a plane yet."""
    planes = np.zeros((n_pairs, PLANE))
    forget(planes)
    heap = np.zeros((budget, SLICE))
    ends, space = new_ends(n_links), new_space(n_links)
    return Desk(new_rows(n_links), new_runs(), planes, ends, space, heap)


@compiled
def take_rows(rows: Rows, first: int, last: int, ends: Ends) -> None:
    """Write the configurations of two rows of a block to both ends of a slice."""
    apart()
    n_links = rows.turns.shape[0]
    for k in range(2):
        row = last if k else first
        for j in range(n_links + 1):
            for c in range(3):
                ends.centres[k, j, c] = rows.centres[0, j, c, row]
        for link in range(n_links):
            for c in range(3):
                for d in range(3):
                    ends.frames[k, link, c, d] = rows.frames[link + 1, c, d, row]


@compiled
def load_rows(task: Task, desk: Desk, pair: int, first: int, last: int) -> None:
    """Load the link of a pair between two rows of a block; `last` is `first` or next.

    Of the ends only what joint errors ask for is written.
    """
    apart()
    rules, rows, body, ends = task.rules, desk.rows, desk.space.body, desk.ends
    link, frame = task.pairs.link[pair], task.pairs.frame[pair]
    f, h = frame + 1, float(last - first)
    for k in range(2):
        body.balls[k] = rows.sags[f, link + k, first] if last > first else 0.0
        for c in range(3):
            body.points[k, c] = rows.centres[f, link + k, c, first]
            body.points[2 + k, c] = rows.centres[f, link + k, c, last]
        if rules.joint_error > 0.0:
            ends.drifts[f, link + k] = rows.drifts[f, link + k, min(first, BLOCK - 1)]
    if rules.joint_error > 0.0:
        take_rows(rows, first, last, ends)
    load_errors(rules, ends, body, link, frame, h)
