"""A clearance held from row to row: it falls no faster than the link moves, compiled.

A partner of many pieces needs a plane for each, found by a walk through its hierarchy.
What one walk proved serves the rows around it.
"""

from math import sqrt

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import Body
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.proof.layouts import HELD_AT, HELD_CLEARANCE


@compiled
def hold(plane: FloatArray, clearance: float, body: Body) -> None:
    """Remember the clearance proved over a slice, and the link at the end of it.

    Args:
        plane: What the pair remembers, shape (PLANE,).
        clearance: Lower bound over the slice; [m].
        body: The link over the slice.
    """
    plane[HELD_CLEARANCE] = clearance
    for end in range(2):
        for c in range(3):
            plane[HELD_AT + 3 * end + c] = body.points[2 + end, c]


@compiled
def raise_to_held(
    centres: FloatArray,
    sags: FloatArray,
    plane: FloatArray,
    link: int,
    first: int,
    last: int,
    lower: FloatArray,
) -> None:
    """Raise lower bounds to the clearance held, less what the link has moved since.

    No point of a link moves farther than one of its ends. What errors add must not
    depend on the configuration.

    Args:
        centres: Joint centres in the partner's frame, shape (N + 1, 3, BLOCK + 1); [m].
        sags: Of that frame, shape (N + 1, BLOCK); [m].
        plane: What the pair remembers, shape (PLANE,).
        link: The link.
        first: First interval of the block to look at.
        last: One past the last.
        lower: Updated, shape (BLOCK,); [m].
    """
    apart()
    before = 0.0
    for row in range(first, last + 1):
        moved = 0.0
        for end in range(2):
            squared = 0.0
            for c in range(3):
                d = centres[link + end, c, row] - plane[HELD_AT + 3 * end + c]
                squared += d * d
            moved = max(moved, sqrt(squared))
        if row > first:
            sag = max(sags[link, row - 1], sags[link + 1, row - 1])
            held = plane[HELD_CLEARANCE] - max(before, moved) - sag
            lower[row - 1] = max(lower[row - 1], held)
        before = moved
