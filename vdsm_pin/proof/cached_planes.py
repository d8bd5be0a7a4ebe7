"""What proves most intervals: the plane and the witness point that a pair keeps.

Most pairs keep apart along much the same direction for many rows: the plane that
served last is tried first (temporal coherence).
"""

from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import RADIUS
from vdsm_pin.proof.cached_clearances import raise_to_held
from vdsm_pin.proof.error_growth import grow_corners, set_direction
from vdsm_pin.proof.layouts import HELD_CLEARANCE, WIDTH
from vdsm_pin.proof.plane_bounds import Runs, bound_above, bound_below, take_disc
from vdsm_pin.proof.rows import Rows
from vdsm_pin.proof.terms import Mover, Task
from vdsm_pin.tolerances import TOLERANCES

WIDE: Final = TOLERANCES.far_bracket
"""Slack of clearances that are far; [-]."""


class Demand(NamedTuple):
    """What a cached plane has to come up to.

    Args:
        first: First interval of the block to look at.
        last: One past the last.
        bar: A lower bound below it does not serve; [m].
        slack: As for `served`; inf where narrow brackets are not wanted.
        far: As for `served`; [m].
        fresh: Whether the plane was made for the first interval: its bracket there is
            what the following ones are measured by.
        proved: Clearance proved for that interval otherwise, or -inf; [m].
    """

    first: int
    last: int
    bar: float
    slack: float
    far: float
    fresh: bool
    proved: float


@compiled
def served(
    lower: FloatArray,
    upper: FloatArray,
    bar: float,
    slack: float,
    width: float,
    far: float,
) -> int:
    """How many of the first intervals a plane serves.

    Args:
        lower: Lower bounds, shape (count,); [m].
        upper: Upper bounds, shape (count,); [m].
        bar: A lower bound below it does not serve; [m].
        slack: Nor does a bracket wider than this part of its upper bound and
        width: this in sum; [m].
        far: From this lower bound on the slack is WIDE at least; [m].
    """
    missed, loose = 0, max(slack, WIDE)
    for r in range(lower.size):
        low, part = not lower[r] >= bar, slack if lower[r] < far else loose
        wide = not upper[r] - lower[r] <= width + part * upper[r]
        missed |= low | wide
    if not missed:
        return lower.size
    for r in range(lower.size):
        if not lower[r] >= bar:
            return r
        part = slack if lower[r] < far else loose
        if not upper[r] - lower[r] <= width + part * upper[r]:
            return r
    return lower.size


@compiled
def _grow(
    task: Task,
    mover: Mover,
    rows: Rows,
    runs: Runs,
    plane: FloatArray,
    demand: Demand,
    crudely: bool,
) -> None:
    """What errors that turn add to n.x of a body's corners, to `runs.growth`; [m]."""
    first, end = demand.first, demand.last + 1
    if not crudely:
        set_direction(rows, mover.rest, plane[:3], first, end, runs.toward)
    toward = runs.toward[:, :end]
    grow_corners(task, mover, rows, toward, first, crudely, runs.growth)


@compiled(inline=False)
def try_plane(
    task: Task, mover: Mover, rows: Rows, runs: Runs, plane: FloatArray, demand: Demand
) -> int:
    """Bound intervals with a pair's cached plane and witness.

    Args:
        task: The tree, the rules and the error box.
        mover: The body of the pair.
        rows: The block.
        runs: The disc and witness are placed; bounds of the intervals are written.
        plane: What the pair remembers.
        demand: Which intervals, and what serves.

    Returns:
        The first interval that the plane does not serve, or `demand.last`.
    """
    first, last, steady = demand.first, demand.last, task.rules.steady
    done, disc = first, mover.disc[RADIUS]
    crudely = not steady and np.isinf(demand.slack)
    lower, upper = runs.lower[first:last], runs.upper[first:last]
    bound_above(mover, rows.tracks, runs, plane, first, last)
    for _ in range(2):
        if not steady:
            _grow(task, mover, rows, runs, plane, demand, crudely)
        bound_below(mover, rows.tracks, runs, plane, first, last)
        if disc > 0.0:
            take_disc(runs.axis, plane, disc, first, last, runs.lower)
        if steady and plane[HELD_CLEARANCE] > -np.inf:
            raise_to_held(mover, rows.tracks, plane, first, last, runs.lower)
        if demand.fresh:
            lower[0] = max(lower[0], demand.proved)
            plane[WIDTH] = upper[0] - lower[0] - mover.loose
        width = 2.0 * plane[WIDTH]
        slack, far = demand.slack, demand.far
        done = first + served(lower, upper, demand.bar, slack, width, far)
        if not crudely or done == last:
            break
        crudely = False
    return done
