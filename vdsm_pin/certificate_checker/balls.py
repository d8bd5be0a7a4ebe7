"""Vectors of flint balls and the two ways to refuse, for the certificate checker."""

from collections.abc import Sequence
from math import isfinite
from typing import Any, Final, TypeAlias

from flint import arb, arb_mat

Ball: TypeAlias = Any  # flint.arb and flint.arb_mat carry no types
Matrix: TypeAlias = Any  # a vector is a column

SLACK: Final = arb("1e-9")
"""How far a claim may understate what is proved, and a limit be passed; [m], [rad]."""


class Rejected(Exception):
    """A claim is false or missing."""

    def at(self, place: str) -> "Rejected":
        """The same with its place in front."""
        return Rejected(f"{place}: {self}")


def claim(holds: object, reason: str) -> None:
    """Reject a certificate unless something certain holds.

    Raises:
        Rejected: If it does not hold.
    """
    if not holds:
        raise Rejected(reason)


def require(holds: object, problem: str) -> None:
    """Refuse a file.

    Raises:
        ValueError: If the condition does not hold.
    """
    if not holds:
        raise ValueError(problem)


def number(value: object) -> Ball:
    """A number of a certificate, which is the nearest double."""
    good = type(value) in (int, float) and isfinite(value)  # type: ignore[arg-type]
    require(good, f"{value!r} is not a finite number")
    return arb(float(value))  # type: ignore[arg-type]


def column(x: Ball, y: Ball, z: Ball) -> Matrix:
    """A vector."""
    return arb_mat(3, 1, [x, y, z])


def dot(a: Matrix, b: Matrix) -> Ball:
    """Scalar product."""
    return (a.transpose() * b)[0, 0]


def norm(a: Matrix) -> Ball:
    """Length of a vector."""
    return dot(a, a).nonnegative_part().sqrt()


def unit(a: Matrix) -> Matrix:
    """A vector scaled to length 1."""
    require(dot(a, a) > 0, "a direction has length 0")
    return a / norm(a)


def cross(a: Matrix, b: Matrix) -> Matrix:
    """Vector product."""
    (ax, ay, az), (bx, by, bz) = a.entries(), b.entries()
    return column(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)


def turn(axis: int, angle: Ball) -> Matrix:
    """Rotation about x, y or z (0, 1, 2)."""
    matrix, i, j = arb_mat(3, 3, 1), (axis + 1) % 3, (axis + 2) % 3
    sine, cosine = angle.sin_cos()
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = cosine, -sine, sine, cosine
    return matrix


def sign(ball: Ball) -> int:
    """1 or -1 where the sign is certain, else 0."""
    return int(ball > 0) - int(ball < 0)


def near(ball: Ball) -> str:
    """A ball for people."""
    return f"{float(ball):.12g}"


def is_index(value: object, numbers: Sequence[int]) -> bool:
    """Whether a value of a certificate is one of these whole numbers."""
    return type(value) is int and value in numbers
