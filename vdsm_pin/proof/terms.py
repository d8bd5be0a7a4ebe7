"""What a proof is about: the bodies, the pairs, the rules, the rows of joint values.

A body is a convex solid that rides on a link: the link itself, a tool, a camera. A pair
is a body and an obstacle or, in the frame of another link, a body that rests on that
link. Both are the same to the kernels: moving corners against an obstacle of the packed
scene, in which the bodies stand behind the obstacles.
"""

from typing import Final, NamedTuple

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.compiled import compiled
from vdsm_pin.geometry.pieces import PackedPieces

BASE: Final = -1
"""Frame of a pair whose partner rests in the base frame."""

CERTIFIED: Final = 0
REFUTED: Final = 1
UNDECIDED: Final = 2
"""Verdicts as the chunks number them."""

OBSTACLES: Final = 0
LINKS: Final = 1
"""Groups of pairs, each with a least clearance of its own."""


class Bodies(NamedTuple):
    """Convex solids that ride on the links: hulls of corners, grown by ball and disc.

    Args:
        link: The link that each rides on, from 0, shape (n_bodies,).
        first: Where a body's corners start, shape (n_bodies + 1,).
        corners: In the frames of their links, shape (n_corners, 3); [m].
        levers: Distance of each corner, with its disc, from the link's origin, shape
            (n_corners,); [m].
        radius: Of the ball that grows the body, shape (n_bodies,); [m].
        discs: Axis and radius of the disc that grows it, shape (n_bodies, 4).
        axial: Whether a body is the whole axis of its link, grown by a ball, shape
            (n_bodies,): its corners are the two joint centres.
    """

    link: IntArray
    first: IntArray
    corners: FloatArray
    levers: FloatArray
    radius: FloatArray
    discs: FloatArray
    axial: BoolArray


class Pairs(NamedTuple):
    """All pairs, those with obstacles first, in the order of the certificate.

    Args:
        body: The moving body, shape (n_pairs,).
        link: The link that it rides on, from 0, shape (n_pairs,).
        obstacle: Its partner in the packed scene, shape (n_pairs,).
        frame: Link in whose frame the partner rests, or BASE, shape (n_pairs,).
        required: Least clearance, shape (n_pairs,); [m].
        lost: What every plane loses: radius, shifts, rounding, shape (n_pairs,); [m].
        rise: What turns a distance of core points into an upper bound, (n_pairs,); [m].
    """

    body: IntArray
    link: IntArray
    obstacle: IntArray
    frame: IntArray
    required: FloatArray
    lost: FloatArray
    rise: FloatArray


class Mover(NamedTuple):
    """The moving side of a pair.

    Args:
        link: The link that the body rides on, from 0.
        first: The first joint that moves it in the frame of its partner.
        corners: In the frame of the link, shape (n, 3); [m].
        levers: As in `Bodies`, shape (n,); [m].
        disc: Axis and radius, shape (4,).
        radius: Of the ball that grows it; [m].
        axial: As in `Bodies`.
        lost: As in `Pairs`; [m].
        rise: As in `Pairs`; [m].
    """

    link: int
    first: int
    corners: FloatArray
    levers: FloatArray
    disc: FloatArray
    radius: float
    axial: bool
    lost: float
    rise: float


class Rules(NamedTuple):
    """What a proof has to cover and what it may assume.

    Args:
        lengths: Link lengths, shape (N,); [m].
        joint_errors: Largest errors of alpha_l and theta_l, shape (N, 2); [rad].
        base_turn: Largest rotation of the base about its origin; [rad].
        joints_err: Whether any angle may be off.
        steady: Whether the errors cost the same in every configuration.
        nominal: Whether the error box is empty.
        pad: Bound of all rounding in one evaluation; [m].
        goal: Width of a distance bracket at which to stop; [m].
        gap: Width of the bracket of the least clearance at which to stop; [m].
        slack: A bracket is renewed where it is wider than this part of the clearance,
            and wider by twice what it was when its plane was found; [-].
        until: When to stop, by the monotonic clock: what is not judged by then is not
            counted, or undecided; [s].
    """

    lengths: FloatArray
    joint_errors: FloatArray
    base_turn: float
    joints_err: bool
    steady: bool
    nominal: bool
    pad: float
    goal: float
    gap: float
    slack: float
    until: float


class Motion(NamedTuple):
    """Rows of joint values.

    Args:
        x0: Shape (n_rows,); [m].
        alpha: Shape (n_rows, N); [rad].
        theta: Shape (n_rows, N); [rad].
    """

    x0: FloatArray
    alpha: FloatArray
    theta: FloatArray


class Task(NamedTuple):
    """Everything that stays the same while a motion is judged."""

    pieces: PackedPieces
    bodies: Bodies
    pairs: Pairs
    rules: Rules


@compiled
def mover_of(task: Task, pair: int) -> Mover:
    """The moving side of a pair."""
    pairs, bodies = task.pairs, task.bodies
    body, frame = pairs.body[pair], pairs.frame[pair]
    first, last = bodies.first[body], bodies.first[body + 1]
    return Mover(
        pairs.link[pair],
        frame + 1,
        bodies.corners[first:last],
        bodies.levers[first:last],
        bodies.discs[body],
        bodies.radius[body],
        bodies.axial[body],
        pairs.lost[pair],
        pairs.rise[pair],
    )


@compiled
def group_of(frame: int) -> int:
    """OBSTACLES or LINKS."""
    return OBSTACLES if frame == BASE else LINKS
