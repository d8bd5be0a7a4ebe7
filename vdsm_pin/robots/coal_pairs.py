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
from vdsm_pin.robots.second_opinion import link_shapes
from vdsm_pin.verification.coal_bodies import (
    CoalObstacle,
    coal_bodies,
    distance_request,
    measure,
)


class CoalPairs:
    """Coal's distances of the pairs of a robot and a scene."""

    def __init__(self, bodies: Sequence[Body], robot: Robot, scene: Scene) -> None:
        self._bodies, self._n = bodies, len(robot.bodies)
        self._links = link_shapes(robot)
        self._things = [coal_bodies(solid_of(one)) for one in scene.obstacles]

    def pieces(self, pair: Pair, poses: FloatArray) -> tuple[list[Piece], list[Piece]]:
        """Of both bodies in the world at poses of all frames, (n_frames, 4, 4); [m]."""
        both = (self._bodies[pair.one], self._bodies[pair.other])
        one, other = (list(in_world(b.pieces, poses[b.frame])) for b in both)
        return one, other

    def distances(self, pairs: Sequence[Pair], poses: FloatArray) -> FloatArray:
        """Of each pair at poses of its own, seen from its second body, (n_pairs,); [m].

        NaN where Coal cannot take a shape.

        Args:
            pairs: The pairs.
            poses: Of all frames, shape (n_pairs, n_frames, 4, 4); [m].
        """
        import coal

        sides = np.array([self._sides(p) for p in pairs], np.int64).reshape(-1, 2)
        frames = np.array([body.frame for body in self._bodies])[sides]
        rows, request = np.arange(len(pairs)), distance_request()
        mine, rest = (poses[rows, frames[:, k], :3] for k in range(2))
        back = np.swapaxes(rest[:, :, :3], 1, 2)
        turns = back @ mine[:, :, :3]
        shifts = (back @ (mine[:, :, 3:] - rest[:, :, 3:]))[:, :, 0]
        found = np.full(len(pairs), nan)
        for k, (one, other) in enumerate(sides.tolist()):
            parts, theirs = self._links[one], self._parts(other)
            if parts is None or theirs is None:
                continue
            seen = coal.Transform3s(turns[k], shifts[k])
            found[k] = min(
                measure(request, part.geometry, seen * part.pose, theirs).distance
                for part in parts
            )
        return found

    def _sides(self, pair: Pair) -> tuple[int, int]:
        """The body that is placed, a link, and the one from which it is seen."""
        swapped = pair.one >= self._n
        return (pair.other, pair.one) if swapped else (pair.one, pair.other)

    def _parts(self, body: int) -> CoalObstacle | None:
        """Coal's shapes of a body in its frame."""
        if body >= self._n:
            return self._things[body - self._n]
        return self._links[body]
