"""What a proof is about: bodies, the places of their corners, pairs, rules.

A body is a convex solid that rides on a frame of the tree. A pair is a body and a
partner that rests in a frame, the world or another one: an obstacle of the packed scene
in the coordinates of that frame. Both are the same to the kernels: moving corners
against pieces at rest.
"""

from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.proof.packed_tree import PackedTree
from vdsm_pin.proof.ways import WayErrors, Ways

WORLD: Final = 0
"""The frame in which obstacles rest."""

CERTIFIED: Final = 0
REFUTED: Final = 1
UNDECIDED: Final = 2
"""Verdicts as the chunks number them."""

ACROSS: Final = 0
WITHIN: Final = 1
"""Groups of pairs, each with a least clearance of its own: of bodies on different
branches, one of which may be the world, and of bodies on one."""


class Bodies(NamedTuple):
    """Convex solids that ride on frames: hulls of corners, grown by ball and disc.

    Args:
        number: Which of all bodies each is, shape (n_bodies,).
        frame: The frame that each rides on, shape (n_bodies,).
        first: Where a body's corners start, shape (n_bodies + 1,).
        corners: In their frames, shape (n_corners, 3); [m].
        levers: Distance of each corner, with its disc, from the frame's origin, shape
            (n_corners,); [m].
        radius: Of the ball that grows the body, shape (n_bodies,); [m].
        discs: Axis and radius of the disc that grows it, shape (n_bodies, 4).
        inverse: 1 / length^2 of a body that is a segment grown by a ball, 0 of one that
            is a ball, below 0 of any other, shape (n_bodies,); [1/m^2].
        column: Where the profile has its bounds, shape (n_bodies,).
    """

    number: IntArray
    frame: IntArray
    first: IntArray
    corners: FloatArray
    levers: FloatArray
    radius: FloatArray
    discs: FloatArray
    inverse: FloatArray
    column: IntArray


class Places(NamedTuple):
    """Points that ride on frames as seen from frames at rest, each once.

    Those seen from the world stand first; all others are among them too.

    Args:
        n_points: How many are seen from the world.
        point: Number of the same point as seen from the world, shape (n_places,).
        way: The way to the point's frame, shape (n_places,).
        at: In that frame, shape (n_places, 3); [m].
        lever: Distance from the frame's origin, a disc included, (n_places,); [m].
        every: Their numbers, shape (n_places,).
    """

    n_points: int
    point: IntArray
    way: IntArray
    at: FloatArray
    lever: FloatArray
    every: IntArray


class Pairs(NamedTuple):
    """All pairs, in the order of the certificate, then rough versions of some.

    A rough version has fewer corners: its bodies lie within those of the pair, and no
    point of these is farther than a distance `loose` from them, in sum of both. So the
    pair's clearance is at least a lower bound of the rough version less `loose`, and at
    most its upper bound.

    Args:
        rough: The rows of each pair's rough versions, the roughest first, -1 for none,
            shape (n_pairs, n_levels); all others have n_rows.
        body: The moving body, shape (n_rows,).
        obstacle: Its partner in the packed scene, shape (n_rows,).
        way: From the partner's frame to the body's, shape (n_rows,).
        slot: Where the numbers of its corners' places start, shape (n_rows,).
        slots: Numbers of places, for each pair one a corner of its body.
        group: ACROSS or WITHIN, shape (n_rows,).
        column: Where the profile has the partner's bounds, -1 for nowhere, (n_rows,).
        required: Least clearance, shape (n_rows,); [m].
        loose: What a rough version misses of both bodies, shape (n_rows,); [m].
        lost: What every plane loses: radius, shifts, rounding and what is missed, shape
            (n_rows,); [m].
        rise: What turns a distance of core points into an upper bound, (n_rows,); [m].
    """

    rough: IntArray
    body: IntArray
    obstacle: IntArray
    way: IntArray
    slot: IntArray
    slots: IntArray
    group: IntArray
    column: IntArray
    required: FloatArray
    loose: FloatArray
    lost: FloatArray
    rise: FloatArray


class Mover(NamedTuple):
    """The moving side of a pair.

    Args:
        rest: The frame in which the partner rests.
        frame: The frame that the body rides on.
        way: From one to the other.
        slots: Places of the corners, shape (n,).
        corners: In the body's frame, shape (n, 3); [m].
        disc: Axis and radius, shape (4,).
        radius: Of the ball that grows it; [m].
        inverse: As in `Bodies`.
        loose: As in `Pairs`; [m].
        lost: As in `Pairs`; [m].
        rise: As in `Pairs`; [m].
    """

    rest: int
    frame: int
    way: int
    slots: IntArray
    corners: FloatArray
    disc: FloatArray
    radius: float
    inverse: float
    loose: float
    lost: float
    rise: float


class Rules(NamedTuple):
    """What a proof has to cover and what it may assume.

    Args:
        steady: Whether the errors cost the same in every configuration.
        nominal: Whether the error box is empty.
        pad: Bound of all rounding in one evaluation; [m].
        goal: Width of a distance bracket at which to stop; [m].
        gap: Width of the bracket of the least clearance at which to stop; [m].
        slack: A bracket is renewed where it is wider than this part of the clearance,
            and wider by twice what it was when its plane was found; [-].
        until: When to stop, by the monotonic clock: what is not judged by then is not
            counted, or undecided; [s].
        far: Of clearances beyond it, and beyond the least one met, wider brackets do;
            [m].
    """

    steady: bool
    nominal: bool
    pad: float
    goal: float
    gap: float
    slack: float
    until: float
    far: float = np.inf


class Task(NamedTuple):
    """Everything that stays the same while a motion is judged."""

    pieces: PackedPieces
    tree: PackedTree
    ways: Ways
    errors: WayErrors
    places: Places
    bodies: Bodies
    pairs: Pairs
    rules: Rules


@compiled
def finer(pairs: Pairs, pair: int, row: int) -> int:
    """The row of the next finer version of a pair, the pair itself at last.

    Args:
        pairs: All pairs.
        pair: The pair.
        row: That of a version; of the pair itself it leads to the roughest.
    """
    passed = row == pair
    for level in range(pairs.rough.shape[1]):
        found = pairs.rough[pair, level]
        if passed and found >= 0:
            return int(found)
        passed |= found == row
    return pair


@compiled
def mover_of(task: Task, pair: int) -> Mover:
    """The moving side of a pair, or of a rough version."""
    pairs, bodies = task.pairs, task.bodies
    body, way = pairs.body[pair], pairs.way[pair]
    first, last = bodies.first[body], bodies.first[body + 1]
    slot = pairs.slot[pair]
    return Mover(
        task.ways.rest[way],
        bodies.frame[body],
        way,
        pairs.slots[slot : slot + last - first],
        bodies.corners[first:last],
        bodies.discs[body],
        bodies.radius[body],
        bodies.inverse[body],
        pairs.loose[pair],
        pairs.lost[pair],
        pairs.rise[pair],
    )
