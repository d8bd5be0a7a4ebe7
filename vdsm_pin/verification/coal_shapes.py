"""Coal's distances of bodies that ride on frames: of an arm, a robot, what moves.

Whoever asks has the frames' poses, from Pinocchio where it can.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.verification.coal_bodies import (
    NOTHING,
    CoalCloud,
    CoalObstacle,
    distance_request,
    measure,
)


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


class Distances(NamedTuple):
    """What Coal says of some pairs.

    Args:
        distance: As `Measured` has it; NaN where Coal cannot take a shape, (m,); [m].
        near: Witnesses on the first bodies, in the frames of the second, (m, 3); [m].
        far: Witnesses on the second, in their own frames, shape (m, 3); [m].
    """

    distance: FloatArray
    near: FloatArray
    far: FloatArray


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
    """Parts of a body in its frame.

    Args:
        shapes: A coal.CollisionGeometry each.
        rotations: Shape (n_parts, 3, 3); [-].
        shifts: Shape (n_parts, 3); [m].
    """

    shapes: list[Any]
    rotations: FloatArray
    shifts: FloatArray

    @classmethod
    def of(cls, parts: CoalObstacle) -> "_Parts":
        """Those of a body that is no cloud."""
        assert not isinstance(parts, CoalCloud)  # an obstacle is the other one
        return cls(
            [part.geometry for part in parts],
            np.array([part.pose.getRotation() for part in parts]),
            np.array([part.pose.getTranslation() for part in parts]),
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
        self._parts = dict[int, _Parts | None]()

    def distances(self, poses: FloatArray, sides: Sides) -> Distances:
        """Coal's distance of each pair.

        Args:
            poses: T_base_frame at some rows, shape (n_rows, n_frames, 3, 4); [m].
            sides: The pairs.
        """
        count = len(sides.row)
        found = Distances(np.full(count, np.nan), *np.full((2, count, 3), np.nan))
        for body in dict.fromkeys(sides.one.tolist()):
            parts = self._parts_of(body)
            if parts is not None:
                mine = np.flatnonzero(sides.one == body)
                self._measure(parts, poses, sides, mine, found)
        return found

    def _parts_of(self, body: int) -> _Parts | None:
        """Those of a body that is placed, made once."""
        if body not in self._parts:
            bodies = self._bodies[body]
            self._parts[body] = None if bodies is None else _Parts.of(bodies)
        return self._parts[body]

    def _measure(
        self,
        parts: _Parts,
        poses: FloatArray,
        sides: Sides,
        mine: IntArray,
        found: Distances,
    ) -> None:
        """Measure the pairs `mine` of one body and write what is found."""
        import coal

        row, one, other = (side[mine] for side in sides)
        frame, rest = (poses[row, self._frames[body]] for body in (one, other))
        turns = frame[:, None, :, :3] @ parts.rotations
        shifts = np.einsum("nij,pj->npi", frame[..., :3], parts.shifts)
        shifts += frame[:, None, :, 3]
        if self._frames[other].any():  # seen from others than those at rest
            back = rest[:, :, :3].swapaxes(1, 2)[:, None]
            turns = back @ turns
            shifts = (back @ (shifts - rest[:, None, :, 3])[..., None])[..., 0]
        theirs = [self._bodies[k] for k in other.tolist()]
        request, best = distance_request(), [NOTHING] * len(theirs)
        for part, shape in enumerate(parts.shapes):
            placed = zip(theirs, turns[:, part], shifts[:, part], strict=True)
            for k, (partner, *pose) in enumerate(placed):
                if partner is not None:
                    answer = measure(request, shape, coal.Transform3s(*pose), partner)
                    if answer.distance < best[k].distance:
                        best[k] = answer
        found.near[mine] = [one.near for one in best]
        found.far[mine] = [one.far for one in best]
        found.distance[mine] = [one.distance for one in best]
        unknown = [partner is None for partner in theirs]
        found.distance[mine[unknown]] = np.nan
