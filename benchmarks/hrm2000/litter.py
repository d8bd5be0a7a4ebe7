"""Things that lie about a sweep: pipes, rods, crates and balls, each clear of it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from benchmarks.hrm2000.motions import DraftRejected
from benchmarks.hrm2000.sweeps import Rng, Sweep
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Box, Capsule, Cylinder, Sphere
from vdsm_pin.problem.scene import Obstacle


def _rotation(rng: Rng) -> FloatArray:
    matrix, upper = np.linalg.qr(rng.normal(size=(3, 3)))
    matrix = matrix * np.sign(np.diag(upper))
    return np.asarray(matrix if np.linalg.det(matrix) > 0.0 else -matrix)


def _axis(rng: Rng) -> FloatArray:
    if rng.random() < 0.4:
        return np.eye(3)[1 + int(rng.integers(2))]
    return _rotation(rng)[:, 0]


def ball(rng: Rng, name: str, centre: FloatArray, size: float) -> Obstacle:
    """A sphere of about that size."""
    return Sphere(name, centre, size * rng.uniform(0.2, 0.5))


def crate(rng: Rng, name: str, centre: FloatArray, size: float) -> Obstacle:
    """A box of about that size, turned."""
    return Box(name, centre, _rotation(rng), size * rng.uniform(0.15, 0.6, 3))


def rod(rng: Rng, name: str, centre: FloatArray, size: float) -> Obstacle:
    """A capsule some times as long as thick."""
    half, radius = size * rng.uniform(0.3, 1.0), size * rng.uniform(0.12, 0.25)
    return Capsule(name, centre, _axis(rng), half, radius)


def pipe(rng: Rng, name: str, centre: FloatArray, size: float) -> Obstacle:
    """A long cylinder."""
    half, radius = size * rng.uniform(1.0, 4.0), size * rng.uniform(0.12, 0.3)
    return Cylinder(name, centre, _axis(rng), half, radius)


Maker: TypeAlias = Callable[[Rng, str, FloatArray, float], Obstacle]


@dataclass(frozen=True)
class Litter:
    """What shall lie about.

    Args:
        count: How many.
        makers: Of what.
        size: About how large, from and to; [m].
        away: How far their middles lie from the arm's axis, from and to; [m].
        beyond: Least x of the places about which they lie; [m].
    """

    count: int
    makers: tuple[Maker, ...]
    size: tuple[float, float]
    away: tuple[float, float]
    beyond: float


def scattered(rng: Rng, swept: Sweep, litter: Litter) -> list[Obstacle]:
    """Things about the sweep, each clear of it.

    Raises:
        DraftRejected: If there is no place for so many.
    """
    kept: list[Obstacle] = []
    for centre in swept.places(rng, 12 * litter.count, litter.beyond):
        make = litter.makers[int(rng.integers(len(litter.makers)))]
        aside = rng.normal(size=3)
        aside *= rng.uniform(*litter.away) / np.linalg.norm(aside)
        thing = make(rng, f"i{len(kept)}", centre + aside, rng.uniform(*litter.size))
        if swept.is_clear(thing):
            kept.append(thing)
        if len(kept) == litter.count:
            return kept
    raise DraftRejected
