"""Coal's distances of the pairs of a robot and a scene."""

from collections.abc import Sequence
from math import nan

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import Piece
from vdsm_pin.problem.scene import Scene, solid_of
from vdsm_pin.proof.bodies import Body, Pair
from vdsm_pin.robots.contacts import in_world
from vdsm_pin.robots.model import Robot
from vdsm_pin.robots.second_opinion import link_shapes, placed
from vdsm_pin.verification.coal_bodies import (
    CoalObstacle,
    Measured,
    coal_bodies,
    distance_request,
    measure,
)


class CoalPairs:
    """Coal's distances of the pairs of a robot and a scene.

    Poses are those of all frames at one configuration, shape (n_frames, 4, 4).
    """

    def __init__(self, bodies: Sequence[Body], robot: Robot, scene: Scene) -> None:
        self._bodies, self._n = bodies, len(robot.bodies)
        self._links = link_shapes(robot)
        self._things = [coal_bodies(solid_of(one)) for one in scene.obstacles]

    def pieces(self, pair: Pair, poses: FloatArray) -> tuple[list[Piece], list[Piece]]:
        """Of both bodies where they stand, in the world's frame."""
        both = (self._bodies[pair.one], self._bodies[pair.other])
        one, other = (list(in_world(b.pieces, poses[b.frame])) for b in both)
        return one, other

    def measured(self, pair: Pair, poses: FloatArray) -> Measured:
        """Seen from the second body's frame; NaN where Coal cannot take a shape."""
        mine, rest = pair.one, pair.other
        if pair.one >= self._n:
            mine, rest = rest, mine
        parts, theirs = self._links[mine], self._parts(rest)
        if parts is None or theirs is None:
            return Measured(nan, np.full(3, nan), np.full(3, nan))
        of_mine, of_rest = (poses[self._bodies[k].frame] for k in (mine, rest))
        seen, request = _seen(of_mine, of_rest), distance_request()
        found = (
            measure(request, one.geometry, one.pose, theirs)
            for one in (placed(seen, part) for part in parts)
        )
        return min(found, key=lambda one: one.distance)

    def _parts(self, body: int) -> CoalObstacle | None:
        """Coal's shapes of a body in its frame."""
        if body >= self._n:
            return self._things[body - self._n]
        return self._links[body]


def _seen(mine: FloatArray, rest: FloatArray) -> FloatArray:
    """T_rest_mine of two poses in the world, shape (4, 4); [m]."""
    seen, turn = np.eye(4), rest[:3, :3].T
    seen[:3, :3] = turn @ mine[:3, :3]
    seen[:3, 3] = turn @ (mine[:3, 3] - rest[:3, 3])
    return seen
