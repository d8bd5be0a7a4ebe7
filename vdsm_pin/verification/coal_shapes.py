"""Coal's distances of bodies that ride on frames: of an arm, a robot, what moves.

The bodies of an assembly as Coal has them, and its pairs seen from them.

Whoever asks has the frames' poses, from Pinocchio where it can.
"""

from collections.abc import Iterable, Iterator, Sequence
from functools import cached_property, lru_cache
from typing import Any, Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.problem.scene import Obstacle
from vdsm_pin.proof.bodies import Body
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.assembly import Assembly
from vdsm_pin.verification.coal_bodies import (
    Call,
    CoalCloud,
    CoalObstacle,
    Witness,
    coal_obstacle,
    measure_each,
    witness,
)
from vdsm_pin.verification.coal_hulls import CoalBody, coal_parts


class Sides(NamedTuple):
    """Pairs of bodies by their numbers, each at a row of poses.

    Args:
        row: Shape (m,).
        one: The bodies that are placed, none of them a cloud, shape (m,).
        other: Those from which they are seen, shape (m,).
    """

    row: IntArray
    one: IntArray
    other: IntArray


def disagreement(
    distance: FloatArray, lower: FloatArray, upper: FloatArray
) -> FloatArray:
    """How far distances lie outside brackets, below 0 inside of them, (m,); [m].

    Where bodies meet only the sign counts, on both sides. It is inf where Coal's answer
    is unusable, NaN where there is none.
    """
    value, low, high = (np.maximum(one, 0.0) for one in (distance, lower, upper))
    outside = np.maximum(low - value, value - high)
    return np.where(np.isinf(distance), np.inf, outside)


class _Parts(NamedTuple):
    """Parts of the bodies that are placed, one body after the other.

    Args:
        first: Where each body's parts start, shape (n_bodies + 1,).
        shapes: A coal.CollisionGeometry each.
        rotations: In their body's frame, shape (n_parts, 3, 3); [-].
        shifts: Shape (n_parts, 3); [m].
    """

    first: IntArray
    shapes: list[Any]
    rotations: FloatArray
    shifts: FloatArray

    @classmethod
    def of(cls, bodies: Sequence[CoalObstacle | None]) -> "_Parts":
        """Those of all bodies; clouds have none, they are never placed."""
        clouds_too = [() if isinstance(b, CoalCloud) else b or () for b in bodies]
        parts = [part for each in clouds_too for part in each]
        return cls(
            np.cumsum([0, *map(len, clouds_too)]),
            [part.geometry for part in parts],
            np.array([part.place[0] for part in parts]).reshape(-1, 3, 3),
            np.array([part.place[1] for part in parts]).reshape(-1, 3),
        )


class CoalShapes:
    """Bodies as Coal has them, each on a frame.

    Args:
        frames: Of each body.
        bodies: In their frames; None where Coal cannot take a shape.
    """

    def __init__(
        self, frames: Sequence[int], bodies: Sequence[CoalObstacle | None]
    ) -> None:
        self._bodies, self._frames = bodies, np.array(frames, np.int64)
        self._parts = _Parts.of(bodies)

    @cached_property
    def _balls(self) -> tuple[FloatArray, FloatArray]:
        """Coal's ball about each body of one part in its frame, NaN of others; [m]."""
        found = []
        for body in self._bodies:
            parts = body if isinstance(body, tuple) else ()
            none = np.full(3, np.nan), np.nan
            found.append(parts[0].ball if len(parts) == 1 else none)
        middles, radii = zip(*found, strict=True)
        return np.array(middles), np.array(radii)

    def untold(self, names: Sequence[str]) -> str:
        """Which bodies, by the names of all, Coal says nothing of; "" where it does."""
        silent = (k for k, body in enumerate(self._bodies) if body is None)
        which = ", ".join(f"'{names[k]}'" for k in silent)
        return f"; none of {which}, whose shape Coal cannot take" if which else ""

    def distances(self, poses: FloatArray, sides: Sides) -> FloatArray:
        """Coal's distance of each pair, NaN where it tells none, (n_pairs,); [m].

        Args:
            poses: T_base_frame at some rows, shape (n_rows, n_frames, 3, 4); [m].
            sides: The pairs.
        """
        return measure_each(self._calls(poses, sides), len(sides.row))

    def witness(self, poses: FloatArray, sides: Sides) -> Witness:
        """Coal's witness of one pair, which it tells a distance of.

        Args:
            poses: As for `distances`.
            sides: That pair.
        """
        return witness(self._calls(poses, sides))

    def _calls(self, poses: FloatArray, sides: Sides) -> Iterator[Call]:
        """Every part of every first body, pair by pair; as for `distances`."""
        first = self._parts.first
        n_parts = first[sides.one + 1] - first[sides.one]
        pair = np.repeat(np.arange(len(sides.row)), n_parts)
        within = np.arange(pair.size) - np.repeat(np.cumsum(n_parts) - n_parts, n_parts)
        part = first[sides.one][pair] + within
        places = self._places(poses, Sides(*(side[pair] for side in sides)), part)
        shapes = [self._parts.shapes[k] for k in part.tolist()]
        partners = [self._bodies[k] for k in sides.other[pair].tolist()]
        return zip(pair.tolist(), shapes, *places, partners, strict=True)

    def between_balls(
        self, poses: FloatArray, sides: Sides
    ) -> tuple[FloatArray, FloatArray]:
        """The least and the most that each pair is apart, by Coal's balls about bodies.

        Args:
            poses: As for `distances`.
            sides: The pairs.

        Returns:
            Shape (m,) each; NaN where a body is of several parts or none; [m].
        """
        middles, radii = self._balls
        ends = []
        for body in (sides.one, sides.other):
            frame = poses[sides.row, self._frames[body]]
            turned = np.einsum("nij,nj->ni", frame[..., :3], middles[body])
            ends.append(turned + frame[..., 3])
        away = np.linalg.norm(ends[1] - ends[0], axis=1)
        both = radii[sides.one] + radii[sides.other]
        return away - both, away + both

    def _places(
        self, poses: FloatArray, sides: Sides, part: IntArray
    ) -> tuple[FloatArray, FloatArray]:
        """R and p of parts as seen from the frames of their partners.

        Args:
            poses: As for `distances`.
            sides: The pair of each.
            part: The part of its first body, shape (m,).
        """
        frame = poses[sides.row, self._frames[sides.one]]
        turns = frame[:, :, :3] @ self._parts.rotations[part]
        shifts = np.einsum("nij,nj->ni", frame[..., :3], self._parts.shifts[part])
        shifts += frame[..., 3]
        seen_from = self._frames[sides.other]
        if seen_from.any():  # others than those at rest
            rest = poses[sides.row, seen_from]
            back = rest[:, :, :3].swapaxes(1, 2)
            turns = back @ turns
            shifts = (back @ (shifts - rest[..., 3])[..., None])[..., 0]
        return turns, shifts


KEPT: Final = 8
"""Robots whose shapes are kept for their next scene."""


class CoalPairs:
    """The pairs of an assembly; a body of its own comes first, the partner second.

    Args:
        asked: What is held apart.

    Attributes:
        names: Of its bodies, then of the obstacles.
        n_own: How many of them are its own.
        one: Number of the first body of each pair, one of its own, shape (n_pairs,).
        other: Of the second, shape (n_pairs,).
    """

    def __init__(self, asked: Assembly) -> None:
        own = [body.name for body in asked.own]
        self.n_own, self.names = len(own), [*own, *asked.scene.names]
        sides = asked.table.one, asked.table.other
        self.one, self.other = np.where(asked.outer, sides[::-1], sides)

    def named(self, pair: int) -> tuple[str, str]:
        """The names of both bodies of a pair."""
        return self.names[self.one[pair]], self.names[self.other[pair]]


def assembly_shapes(asked: Assembly, deadline: Deadline = NO_LIMIT) -> CoalShapes:
    """Coal's shapes of all bodies, on the frames of the tree.

    Raises:
        OutOfTime: If the time is over.
        VerificationFailed: If Coal refuses a shape.
    """

    def shape(solid: Obstacle) -> CoalObstacle | None:
        deadline.check()
        return coal_obstacle(solid)

    own = link_shapes(tuple(asked.own))
    frames = [body.frame for body in asked.bodies]
    return CoalShapes(frames, [*own, *map(shape, asked.scene.obstacles)])


@lru_cache(maxsize=KEPT)
def link_shapes(bodies: Iterable[Body]) -> tuple[tuple[CoalBody, ...] | None, ...]:
    """Coal's shapes of bodies in their frames; None where it cannot take one."""
    return tuple(coal_parts(body.pieces) for body in bodies)
