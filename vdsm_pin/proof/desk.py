"""What a sweep works with, in compiled code: its space, and what the pairs remember."""

from typing import NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import RADIUS
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.proof.coasting import Runs, new_runs
from vdsm_pin.proof.layouts import HELD_AT, HELD_CLEARANCE, SLICE, SUPPORT
from vdsm_pin.proof.rows import BLOCK, Rows, new_rows
from vdsm_pin.proof.slices import Space, new_space
from vdsm_pin.proof.swept_bodies import Ends, load_errors, new_ends
from vdsm_pin.proof.terms import Mover, Rules


class Desk(NamedTuple):
    """Working space of a sweep.

    Args:
        rows: The block.
        runs: Bounds of the block's intervals for one pair.
        planes: What the pairs remember, one row each.
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
    """No pair remembers a plane any more, one row each."""
    planes[:] = 0.0
    planes[:, 0] = 1.0
    planes[:, SUPPORT] = planes[:, HELD_CLEARANCE] = -np.inf


@compiled
def new_desk(n_links: int, n_pairs: int, corners: int, budget: int) -> Desk:
    """Fresh working space; no pair remembers a plane yet.

    Args:
        n_links: Links of the arm.
        n_pairs: Number of pairs.
        corners: Most corners of a body.
        budget: Most slices of one interval and pair.
    """
    planes = np.zeros((n_pairs, HELD_AT + 3 * corners))
    forget(planes)
    heap = np.zeros((budget, SLICE))
    ends, space = new_ends(n_links), new_space(n_links, corners)
    return Desk(new_rows(n_links), new_runs(corners), planes, ends, space, heap)


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
def load_rows(rules: Rules, mover: Mover, desk: Desk, first: int, last: int) -> None:
    """Load a body between two rows of a block; `last` is `first` or next.

    Its corners over the block are placed. Of the ends only what errors ask for is
    written.
    """
    apart()
    rows, runs, loaded, ends = desk.rows, desk.runs, desk.space.body, desk.ends
    link, f, corners = mover.link, mover.first, mover.levers.size
    loaded.used[0], loaded.used[1] = 2 * corners, corners
    for k in range(corners):
        loaded.balls[k] = runs.sags[k, first] if last > first else 0.0
        for c in range(3):
            loaded.points[k, c] = runs.points[k, c, first]
            loaded.points[corners + k, c] = runs.points[k, c, last]
    disc = mover.disc[RADIUS]
    loaded.discs[0, RADIUS] = loaded.discs[1, RADIUS] = disc
    if disc > 0.0:
        for c in range(3):
            loaded.discs[0, c] = runs.axis[c, first]
            loaded.discs[1, c] = runs.axis[c, last]
    if not rules.steady:
        interval = min(first, BLOCK - 1)
        ends.drifts[f, link] = rows.drifts[f, link, interval]
        ends.rates[f, link] = 0.0
        for k in range(f, link + 1):
            ends.rates[f, link] += rows.turns[k, interval]
        take_rows(rows, first, last, ends)
    load_errors(rules, mover, ends, loaded, float(last - first))
