"""Trees of joints: how their frames stand in the world (docs/certificate.md).

A tree is a list of joints, parents first. Joint j, from 0, carries frame j + 1; frame 0
is the world. A frame stands as a pair of its origin and its rotation.
"""

from collections.abc import Sequence
from typing import Any, TypeAlias

from flint import arb, arb_mat

from vdsm_pin.certificate_checker.balls import Ball, Matrix, column, norm, unit

Pose: TypeAlias = list[tuple[Matrix, Matrix]]

FIXED, TURNS, SLIDES = "FIXED", "REVOLUTE", "PRISMATIC"


class Joint:
    """A joint: its place in the frame that it hangs on, and how it moves.

    Args:
        parent: The frame that it hangs on.
        kind: FIXED, TURNS or SLIDES.
        axis: In its own frame, of any length.
        placement: T_parent_joint, shape (4, 4); [m].
        column: Column of q that moves it, None for none.
        ratio: Its value is ratio q + offset.
        offset: The same; [rad] or [m].
    """

    def __init__(
        self,
        parent: int,
        kind: str,
        axis: Any,
        placement: Any,
        column_of_q: int | None = None,
        ratio: float = 1.0,
        offset: float = 0.0,
    ) -> None:
        self.parent, self.kind, self.column = parent, kind, column_of_q
        self.ratio, self.offset = arb(ratio), arb(offset)
        self.axis = unit(column(*map(float, axis)))
        rows = [[float(x) for x in row] for row in placement]
        self.shift = column(*(row[3] for row in rows[:3]))
        turned = [row[:3] for row in rows[:3]]
        whole = turned == [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
        self.rotation = None if whole else arb_mat(turned)
        self.lever, self.stroke = norm(self.shift), arb(0)
        x, y, z = self.axis.entries()
        self.cross = arb_mat([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        self.square = self.cross * self.cross
        self.turn_error = self.tilt = self.slip = arb(0)

    def err(self, error: Ball, moved: Ball, tilt: Ball) -> None:
        """Take errors of its value, and a shift and a turn of its placement."""
        self.turn_error = error if self.kind == TURNS else arb(0)
        self.slip = moved + (error if self.kind == SLIDES else 0)
        self.tilt = tilt

    def value(self, q: Sequence[Ball]) -> Ball:
        """Its value at a row of q."""
        if self.column is None:
            return self.offset
        return self.ratio * q[self.column] + self.offset


def pose(joints: Sequence[Joint], q: Sequence[Ball]) -> Pose:
    """All frames at a row of q."""
    still = arb_mat(3, 3, 1)
    frames = [(column(0, 0, 0), still)]
    for joint in joints:
        origin, turned = frames[joint.parent]
        if not joint.lever == 0:
            origin = origin + turned * joint.shift
        if joint.rotation is not None:
            turned = turned * joint.rotation
        if joint.kind == TURNS:
            sine, cosine = joint.value(q).sin_cos()
            turn = still + joint.cross * sine + joint.square * (1 - cosine)
            turned = turned * turn
        elif joint.kind == SLIDES:
            origin = origin + turned * (joint.axis * joint.value(q))
        frames.append((origin, turned))
    return frames


class Tree:
    """A list of joints and the ways between their frames.

    Args:
        joints: Parents first.
    """

    def __init__(self, joints: Sequence[Joint]) -> None:
        self.joints = joints
        self._ways: dict[tuple[int, int], list[tuple[int, bool]]] = {}

    def way(self, rest: int, frame: int) -> list[tuple[int, bool]]:
        """The joints from one frame to another, and whether each is passed upwards."""
        if (rest, frame) not in self._ways:
            up, down, start, end = [], [], rest, frame
            while start != end:
                if start > end:
                    up.append((start - 1, True))
                    start = self.joints[start - 1].parent
                else:
                    down.append((end - 1, False))
                    end = self.joints[end - 1].parent
            self._ways[rest, frame] = up + down[::-1]
        return self._ways[rest, frame]

    def slip(self, rest: int, frame: int) -> Ball:
        """How far errors that do not turn carry a frame, as seen from another."""
        return sum((self.joints[k].slip for k, _ in self.way(rest, frame)), arb(0))
