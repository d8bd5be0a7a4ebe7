"""Coal's distances of the pairs of a robot and a scene."""

from math import nan

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import Piece
from vdsm_pin.problem.scene import Scene, solid_of
from vdsm_pin.proof.bodies import Pair
from vdsm_pin.robots.contacts import in_world
from vdsm_pin.robots.model import Robot
from vdsm_pin.robots.second_opinion import link_shapes, placed
from vdsm_pin.verification.coal_bodies import (
    CoalBody,
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

    def __init__(self, robot: Robot, scene: Scene) -> None:
        self._robot, self._scene, self._n = robot, scene, len(robot.bodies)
        self._links = link_shapes(robot)
        self._things = [coal_bodies(solid_of(one)) for one in scene.obstacles]

    def pieces(self, pair: Pair, poses: FloatArray) -> tuple[list[Piece], list[Piece]]:
        """Of both bodies where the links stand, in the world's frame."""
        found = []
        for body in (pair.one, pair.other):
            if body >= self._n:
                found.append(list(self._scene.obstacles[body - self._n].pieces))
            else:
                link = self._robot.bodies[body]
                found.append(list(in_world(link.pieces, poses[link.frame])))
        return found[0], found[1]

    def measured(self, pair: Pair, poses: FloatArray) -> Measured:
        """Where the links stand; NaN where Coal cannot take a shape."""
        outer = pair.one >= self._n
        mine = self._placed(pair.other if outer else pair.one, poses)
        if outer:
            theirs: CoalObstacle | None = self._things[pair.one - self._n]
        else:
            theirs = self._placed(pair.other, poses)
        if mine is None or theirs is None:
            return Measured(nan, np.full(3, nan), np.full(3, nan))
        request = distance_request()
        found = (measure(request, b.geometry, b.pose, theirs) for b in mine)
        return min(found, key=lambda one: one.distance)

    def _placed(self, body: int, poses: FloatArray) -> tuple[CoalBody, ...] | None:
        parts = self._links[body]
        if parts is None:
            return None
        return tuple(placed(poses[self._robot.bodies[body].frame], p) for p in parts)
