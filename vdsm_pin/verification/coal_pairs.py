"""The bodies of an arm or a robot as Coal has them, and its pairs seen from them."""

from collections.abc import Iterable
from functools import lru_cache
from typing import Final

import numpy as np

from vdsm_pin.problem.scene import Obstacle
from vdsm_pin.proof.bodies import Body
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.assembly import Assembly
from vdsm_pin.verification.coal_bodies import CoalObstacle, coal_obstacle
from vdsm_pin.verification.coal_hulls import CoalBody, coal_parts
from vdsm_pin.verification.coal_shapes import CoalShapes

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
