"""How near an arm's own bodies come to each other, for planners to steer by.

The pairs are those that the verification holds apart and that can come too near at all:
bodies that many links in line are between need the arm to turn far for that, so a bound
of how far it must turn spares most postures a look.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, sin, sqrt
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

from vdsm_pin.arm.bodies import ArmBody
from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.bodies import RADIUS, new_body
from vdsm_pin.geometry.kernels import LOWER, NORMAL, Goal, bracket_to
from vdsm_pin.geometry.obstacles import new_measuring
from vdsm_pin.geometry.pieces import PackedPieces, pack_pieces
from vdsm_pin.tolerances import TOLERANCES

if TYPE_CHECKING:
    from vdsm_pin.problem.planning_problem import PlanningProblem

TURNS: Final = np.deg2rad(np.arange(181.0))
"""Turns of the arm from one body to the other that are tried for the least; [rad]."""
RESERVE: Final = 1e-4
"""What planners may keep between own bodies besides, over the arm's length; [-]."""
WIDTH: Final = TOLERANCES.planned_clearance
PART: Final = 0.05
"""How far distances may be below the true ones: so much [m], or this part of them."""

NEAR: Final = 0.1
"""Bounds beyond this part of the longest lever are not made tighter; [-]."""


class Pairs(NamedTuple):
    """Bodies of an arm that are held apart, as compiled code reads them."""

    pieces: PackedPieces
    """Every body in the frame of its link."""

    corners: FloatArray
    """Of all bodies, one after the other, shape (c, 3); [m]."""

    first: IntArray
    """Number of the first corner of each, shape (b + 1,)."""

    links: IntArray
    """Of each body, 0 for the feed."""

    discs: FloatArray
    """Axis [-] and radius [m] of the disc that grows its corners, shape (b, 4)."""

    balls: FloatArray
    """Radius of the ball that does, shape (b,); [m]."""

    spheres: FloatArray
    """Centre and radius of a sphere that holds it, in its frame, shape (b, 4); [m]."""

    both: IntArray
    """Numbers of two bodies, the first rides nearer to the base, shape (p, 2)."""

    lengths: FloatArray
    """From the frame of each link to that of the next, the feed's first, (N + 1,); [m].
    """


@compiled
def _seen(
    alpha: FloatArray, theta: FloatArray, lengths: FloatArray, near: int, far: int
) -> FloatArray:
    """Pose of a link in the frame of another nearer to the base, shape (3, 4)."""
    pose = np.zeros((3, 4))
    for c in range(3):
        pose[c, c] = 1.0
    for i in range(near, far):
        ca, sa, ct, st = cos(alpha[i]), sin(alpha[i]), cos(theta[i]), sin(theta[i])
        for c in range(3):
            pose[c, 3] += lengths[i] * pose[c, 0]
            x, y, z = pose[c, 0], pose[c, 1], pose[c, 2]
            x, y = x * ca + y * sa, y * ca - x * sa
            pose[c, 0], pose[c, 1], pose[c, 2] = x * ct - z * st, y, x * st + z * ct
    return pose


@compiled
def _gaps(pairs: Pairs, alpha: FloatArray, theta: FloatArray, far: float) -> FloatArray:
    """Lower bounds of distances of pairs row by row, shape (r, p); [m].

    Args:
        pairs: The bodies.
        alpha: Yaw angles, shape (r, N); [rad].
        theta: Pitch angles, shape (r, N); [rad].
        far: From here on a distance is told as it is bounded by spheres; [m].
    """
    pairs = borrowed(pairs)
    gaps = np.zeros((alpha.shape[0], pairs.both.shape[0]))
    work, first = new_measuring(), pairs.first
    goal = Goal(WIDTH, PART, 0.0, np.inf)
    for p in range(pairs.both.shape[0]):
        one, other = pairs.both[p, 0], pairs.both[p, 1]
        s, t = pairs.spheres[one], pairs.spheres[other]
        begin, count = first[other], first[other + 1] - first[other]
        disc, body = pairs.discs[other], new_body(count, count, 0)
        for r in range(alpha.shape[0]):
            pose = _seen(
                alpha[r], theta[r], pairs.lengths, pairs.links[one], pairs.links[other]
            )
            square = 0.0
            for c in range(3):
                v = pose[c, 0] * t[0] + pose[c, 1] * t[1] + pose[c, 2] * t[2]
                work.out[NORMAL + c] = s[c] - v - pose[c, 3]
                square += work.out[NORMAL + c] ** 2
            bound = sqrt(square) - s[3] - t[3]
            if bound >= far:
                gaps[r, p] = bound
                continue
            for k in range(count):
                x, y, z = pairs.corners[begin + k]
                for c in range(3):
                    v = pose[c, 0] * x + pose[c, 1] * y + pose[c, 2] * z
                    body.points[k, c] = v + pose[c, 3]
            for c in range(3):
                v = pose[c, 0] * disc[0] + pose[c, 1] * disc[1] + pose[c, 2] * disc[2]
                body.discs[0, c] = body.discs[1, c] = v
            body.discs[0, RADIUS] = body.discs[1, RADIUS] = disc[RADIUS]
            bracket_to(pairs.pieces, one, body, goal, work.scratch, work.out)
            gaps[r, p] = work.out[LOWER] - pairs.balls[other]
    return gaps


@dataclass(frozen=True)
class OwnPairs:
    """Bodies of one arm that are held apart from each other and can come too near.

    Args:
        pairs: The bodies.
        kept: What each pair keeps: what is required, and what errors may take, shape
            (p,); [m].
        levers: What a turn of each joint moves each pair against each other by at most,
            shape (p, N); [m].
        turn: The link angles of an arm whose pairs come too near are in sum at least
            this, inf where none can; [rad].
    """

    pairs: Pairs
    kept: FloatArray
    levers: FloatArray
    turn: float

    @classmethod
    def of(cls, problem: "PlanningProblem") -> "OwnPairs":
        """Those of a problem's arm, with what it requires and errors take."""
        arm, bodies = problem.manipulator, problem.manipulator.convex_bodies
        angles = problem.errors.angles(arm.n_links)
        turns, held = np.hypot(angles[:, 0], angles[:, 1]), arm.self_pairs.held
        levers = np.array(
            [_levers(arm.link_lengths, bodies[i], bodies[k]) for i, k in held.tolist()]
        ).reshape(-1, arm.n_links)
        kept = problem.required_self_clearance + levers @ turns
        least = _least_turns(arm.link_lengths, bodies, held, kept + _reserve(problem))
        links = np.array([body.link for body in bodies])
        apart = links[held[:, 1]] - links[held[:, 0]]
        near = least <= apart * arm.max_link_angle
        discs = np.array([[*_axis(body), body.disc] for body in bodies])
        pairs = Pairs(
            pieces=pack_pieces([[body.piece] for body in bodies]),
            corners=np.concatenate([body.corners for body in bodies]),
            first=np.cumsum([0, *(len(body.corners) for body in bodies)]),
            links=links,
            discs=discs,
            balls=np.array([body.ball for body in bodies]),
            spheres=np.array([_sphere(body) for body in bodies]),
            both=held[near],
            lengths=np.append(0.0, arm.link_lengths),
        )
        turn = float(least[near].min(initial=np.inf))
        return cls(pairs, kept[near], levers[near], turn)

    def spare(self, alpha: FloatArray, theta: FloatArray) -> FloatArray:
        """What pairs have beyond what they keep, at least, shape (r, p); [m].

        Args:
            alpha: Yaw angles, shape (r, N); [rad].
            theta: Pitch angles, shape (r, N); [rad].
        """
        far = float(self.kept.max(initial=0.0) + NEAR * self.levers.max(initial=0.0))
        return _gaps(self.pairs, alpha, theta, far) - self.kept


def _reserve(problem: "PlanningProblem") -> float:
    """What planners may keep besides, at most; [m]."""
    return RESERVE * problem.manipulator.total_length


def _axis(body: ArmBody) -> FloatArray:
    """Unit axis of a cylinder, zero for a hull, shape (3,)."""
    if not body.disc:
        return np.zeros(3)
    along = body.corners[1] - body.corners[0]
    return np.asarray(along / np.linalg.norm(along))


def _sphere(body: ArmBody) -> FloatArray:
    corners = body.corners
    centre = (corners.min(axis=0) + corners.max(axis=0)) / 2.0
    reach = float(np.linalg.norm(corners - centre, axis=1).max())
    return np.append(centre, reach + body.disc + body.ball)


def _levers(lengths: FloatArray, near: ArmBody, far: ArmBody) -> FloatArray:
    """What turns of joints move a body by at most, seen from the other, (N,); [m]."""
    reach = float(np.linalg.norm(far.corners, axis=1).max()) + far.disc + far.ball
    levers = np.zeros(len(lengths))
    for joint in range(near.link, far.link):
        levers[joint] = lengths[joint : far.link - 1].sum() + reach
    return levers


def _reach(body: ArmBody, begin: float, sign: float) -> FloatArray:
    """How far a body reaches at most along a direction within each of `TURNS` / 2.

    Args:
        body: The body.
        begin: Where its link is counted from, along it; [m].
        sign: 1 for a direction ahead along the link, -1 for one back.

    Returns:
        Shape (t,); [m].
    """
    corners = body.corners
    x, y = sign * (corners[:, 0] - begin), np.hypot(corners[:, 1], corners[:, 2])
    most = np.minimum(np.arctan2(y, x), TURNS[:, None] / 2.0)
    reach = (x * np.cos(most) + y * np.sin(most)).max(axis=1)
    return np.asarray(reach + body.disc + body.ball)


def _least_turns(
    lengths: FloatArray, bodies: Sequence[ArmBody], held: IntArray, kept: FloatArray
) -> FloatArray:
    """Turns of the arm between two bodies up to which they stay apart, (p,); [rad].

    Where links turn by t in all, each is within t / 2 of the direction half-way. Along
    that the near body ends, links go on, and the far one begins.

    Args:
        lengths: Of the links, shape (N,); [m].
        bodies: Those of the arm.
        held: Numbers of two of them, shape (p, 2).
        kept: How far apart they are to stay, shape (p,); [m].
    """
    near, far = held.T
    ends = np.append(0.0, lengths)
    ahead = np.array([_reach(body, ends[body.link], 1.0) for body in bodies])
    back = np.array([_reach(body, 0.0, -1.0) for body in bodies])
    links, along = np.array([body.link for body in bodies]), np.cumsum(ends)
    between = along[links[far] - 1] - along[links[near]]
    gap = between[:, None] * np.cos(TURNS / 2.0) - ahead[near] - back[far]
    apart = np.logical_and.accumulate(gap > kept[:, None], axis=1).sum(axis=1)
    return np.asarray(TURNS[np.maximum(apart - 1, 0)])
