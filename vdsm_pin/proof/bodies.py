"""Bodies that ride on frames, which are held apart, and how far they may stray."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, frozen
from vdsm_pin.geometry.convex import HalfSpacePiece, Hull, Hulls, Piece


@dataclass(frozen=True, eq=False)
class Body:
    """Convex pieces that ride on one frame of a tree.

    Args:
        frame: The frame; 0 is the world, where obstacles rest.
        pieces: The solid is their union, in the frame's coordinates.
        name: For messages and reports.
    """

    frame: int
    pieces: Sequence[Piece]
    name: str = ""

    @property
    def is_bounded(self) -> bool:
        """Whether none of its pieces is a half-space."""
        if isinstance(self.pieces, Hulls):
            return True
        return not any(isinstance(piece, HalfSpacePiece) for piece in self.pieces)

    @cached_property
    def parts(self) -> tuple["Body", ...]:
        """Its pieces as bodies; itself where it is one piece."""
        if len(self.pieces) == 1:
            return (self,)
        return tuple(Body(self.frame, (piece,), self.name) for piece in self.pieces)

    @cached_property
    def few(self) -> tuple["FewCorners", ...]:
        """Versions of few corners, the roughest first, where it is a hull of many."""
        piece = self.pieces[0] if len(self.pieces) == 1 else None
        if not isinstance(piece, Hull):
            return ()
        return tuple(
            FewCorners(
                replace(self, pieces=(Hull(few.points, piece.radius),)), few.missed
            )
            for few in piece.few
        )


class FewCorners(NamedTuple):
    """A body by few of its corners.

    Args:
        body: Those.
        missed: How far the body is from them at most; [m].
    """

    body: Body
    missed: float


@dataclass(frozen=True)
class Pair:
    """Two bodies, by their numbers, and the clearance that they must keep.

    Args:
        one: The first body.
        other: The second one; it rides on another frame.
        required: Least clearance of the two; [m].
    """

    one: int
    other: int
    required: float = 0.0


@dataclass(frozen=True)
class LeftOut:
    """Two bodies, or a body and an obstacle, that nobody holds apart, and why."""

    body: str
    other: str
    reason: str


@dataclass(frozen=True)
class PairTable:
    """Pairs as columns, one row each, perhaps followed by rough versions of some.

    Args:
        one: Numbers of the first bodies, shape (n_rows,).
        other: Of the second ones, shape (n_rows,).
        required: Least clearances, shape (n_rows,); [m].
        rough: The rows of each pair's rough versions, the roughest first, -1 for none,
            shape (n_pairs, n_levels); None where no pair has one.
        loose: What a rough version misses of its bodies, 0 of pairs, (n_rows,); [m].
    """

    one: IntArray
    other: IntArray
    required: FloatArray
    rough: IntArray | None = None
    loose: FloatArray | None = None

    @classmethod
    def of(cls, pairs: Iterable[Pair]) -> "PairTable":
        """The same as columns."""
        rows = [(pair.one, pair.other, pair.required) for pair in pairs]
        columns = np.array(rows, dtype=np.float64).reshape(-1, 3).T
        return cls(
            frozen(columns[0], np.int64),
            frozen(columns[1], np.int64),
            frozen(columns[2]),
        )

    @property
    def size(self) -> int:
        """Number of pairs."""
        return len(self.one if self.rough is None else self.rough)


@dataclass(frozen=True)
class ErrorBox:
    """The largest errors, each from none to that, in whatever direction, at every time.

    Args:
        joints: Of each joint's value, shape (n_joints,); [rad] or [m].
        shifts: Of the origin of each joint's placement, shape (n_joints,); [m].
        tilts: Turn of each placement about its origin, shape (n_joints,); [rad].
        surfaces: By how much the surface of each body may be off, shape (n_bodies,);
            [m]. None for not at all.
    """

    joints: FloatArray
    shifts: FloatArray
    tilts: FloatArray
    surfaces: FloatArray | None = None
