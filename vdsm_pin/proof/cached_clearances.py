"""A clearance cached from row to row: it falls no faster than the body moves, compiled.

A partner of many pieces needs a plane for each, found by a walk through its hierarchy.
What one walk proved serves the rows around it (conservative advancement).
"""

from math import sqrt

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import Body
from vdsm_pin.proof.layouts import HELD_AT, HELD_CLEARANCE
from vdsm_pin.proof.rows import Tracks
from vdsm_pin.proof.terms import Mover


@compiled
def cache_clearance(plane: FloatArray, clearance: float, body: Body) -> None:
    """Remember the clearance proved over a slice, and the body at the end of it.

    Args:
        plane: What the pair remembers.
        clearance: Lower bound over the slice; [m].
        body: The body over the slice, without a disc.
    """
    plane[HELD_CLEARANCE] = clearance
    corners = body.used[1]
    for k in range(corners):
        for c in range(3):
            plane[HELD_AT + 3 * k + c] = body.points[corners + k, c]


@compiled(inline=False)
def raise_to_held(
    mover: Mover,
    tracks: Tracks,
    plane: FloatArray,
    first: int,
    last: int,
    lower: FloatArray,
) -> None:
    """Raise lower bounds to the clearance held, less what the body has moved since.

    No point of a body moves farther than one of its corners. What errors add must not
    depend on the configuration.

    Args:
        mover: The body.
        tracks: Its corners over the block.
        plane: What the pair remembers.
        first: First interval of the block to look at.
        last: One past the last.
        lower: Updated, shape (BLOCK,); [m].
    """
    before, slots = 0.0, mover.slots
    for row in range(first, last + 1):
        moved = sag = 0.0
        for k in range(slots.size):
            squared, place = 0.0, tracks.places[slots[k]]
            for c in range(3):
                d = place[c, row] - plane[HELD_AT + 3 * k + c]
                squared += d * d
            moved = max(moved, sqrt(squared))
            if row > first:
                sag = max(sag, tracks.sags[slots[k], row - 1])
        if row > first:
            held = plane[HELD_CLEARANCE] - max(before, moved) - sag
            lower[row - 1] = max(lower[row - 1], held)
        before = moved
