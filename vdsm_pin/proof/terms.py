"""What a proof is about: the pairs, the rules, the rows of joint values.

A pair is a link and an obstacle or, in the frame of another link, that link. Both
are the same to the kernels: two moving joint centres against an obstacle of the packed
scene, in which the axes of the links stand behind the obstacles.
"""

from typing import Final, NamedTuple

from vdsm_pin.geometry.arrays import FloatArray, IntArray
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


class Pairs(NamedTuple):
    """All pairs, in the order of the certificate.

    Args:
        link: The moving link, from 0, shape (n_pairs,).
        obstacle: Its partner in the packed scene, shape (n_pairs,).
        frame: Link in whose frame the partner rests, or BASE, shape (n_pairs,).
        required: Least clearance, shape (n_pairs,); [m].
    """

    link: IntArray
    obstacle: IntArray
    frame: IntArray
    required: FloatArray


class Rules(NamedTuple):
    """What a proof has to cover and what it may assume.

    Args:
        lengths: Link lengths, shape (N,); [m].
        radius: Radius of the links; [m].
        joint_error: Largest error of an angle; [rad].
        base_error: Largest error of x0; [m].
        obstacle_error: Largest displacement of an obstacle's surface; [m].
        pad: Bound of all rounding in one evaluation; [m].
        goal: Width of a distance bracket at which to stop; [m].
        gap: Width of the bracket of the least clearance at which to stop; [m].
        slack: A bracket is renewed where it is wider than this part of the clearance,
            and wider by twice what it was when its plane was found; [-].
        until: When to stop, by the monotonic clock: what is not judged by then is not
            counted, or undecided; [s].
    """

    lengths: FloatArray
    radius: float
    joint_error: float
    base_error: float
    obstacle_error: float
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
    pairs: Pairs
    rules: Rules


@compiled
def losses(rules: Rules, frame: int) -> float:
    """What every plane loses: radius of the link, obstacle error, rounding; [m]."""
    own = rules.radius + rules.pad
    return own + rules.obstacle_error if frame == BASE else own


@compiled
def is_nominal(rules: Rules) -> bool:
    """Whether the error box is empty."""
    return rules.joint_error + rules.base_error + rules.obstacle_error == 0.0


@compiled
def group_of(frame: int) -> int:
    """OBSTACLES or LINKS."""
    return OBSTACLES if frame == BASE else LINKS
