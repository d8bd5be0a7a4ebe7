"""Balls, and the one way to refuse, for the certificate checker.

A ball surely holds the real number it stands for. Comparisons of balls are true only
where they are certain: rounding can reject a certificate and never accept one.
"""

from math import isfinite
from typing import Any, Final

import numpy as np
from flint import arb, arb_mat

MM: Final = 1000  # messages tell lengths in millimetres
SLACK: Final = 1e-9  # limits may be passed by this; [m], [rad], [-]
COMMON: Final = "vdsm_certificate problem_sha256 trajectory_sha256 versions"
UP: Final = 1 + 2.0**-40  # lifts bounds above what rounding loses of all made of them


class Rejected(Exception):
    """A claim is false or missing."""


def claim(holds: object, reason: str, *numbers: Any) -> None:
    """Reject a certificate unless something certain holds.

    Raises:
        Rejected: If it does not hold; `reason` has a {} for each number.
    """
    if not holds:
        shown = [f"{float(number):.12g}" for number in numbers]
        raise Rejected(reason.format(*shown) if shown else reason)


def number(value: Any) -> float:
    """A number of a certificate, which is the nearest double."""
    if type(value) not in (int, float) or not isfinite(value):
        claim(False, f"{value!r} is not a finite number")
    return float(value)


def belongs(header: Any, keys: str, problem: str, trajectory: str) -> None:
    """Reject a header with other keys, or of other files than those of two hashes."""
    wanted = {*f"{COMMON} interpolation pairs pieces joined links {keys}".split()}
    claim(set(header) == wanted, f"has other keys than {sorted(wanted)}")
    for kind, sha256 in (("problem", problem), ("trajectory", trajectory)):
        claim(header[f"{kind}_sha256"] == sha256, f"is of another {kind} file")


def column(x: Any, y: Any, z: Any) -> arb_mat:
    """A vector of balls or doubles."""
    return arb_mat(3, 1, [x, y, z])


def doubles(a: arb_mat) -> Any:
    """The entries of a vector in doubles."""
    return np.array([*map(float, a.entries())])


def dot(a: arb_mat, b: arb_mat) -> arb:
    """Scalar product."""
    return (a.transpose() * b)[0, 0]


def cross(a: arb_mat, b: arb_mat) -> arb_mat:
    """Vector product."""
    (ax, ay, az), (bx, by, bz) = a.entries(), b.entries()
    return column(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx)


def norm(a: arb_mat) -> arb:
    """Length of a vector."""
    return dot(a, a).nonnegative_part().sqrt()


def angle(a: arb_mat, b: arb_mat) -> arb:
    """Between two vectors; [rad]."""
    return arb.atan2(norm(cross(a, b)), dot(a, b))


def unit(a: arb_mat) -> arb_mat:
    """A vector scaled to length 1."""
    length = norm(a)
    claim(length > 0, "a direction has length 0")
    return a / length
