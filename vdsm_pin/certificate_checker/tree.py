"""Trees of joints: how their frames stand in the world (docs/certificate.md).

A tree is a list of joints, parents first. Joint j, from 0, carries frame j + 1; frame 0
is the world. A frame stands as a pair of its origin and its rotation.
"""

from collections.abc import Sequence
from typing import Any, TypeAlias

import numpy as np
from flint import arb, arb_mat

from vdsm_pin.certificate_checker.balls import UP, Ball, Matrix, column, norm, unit

Pose: TypeAlias = list[tuple[Matrix, Matrix]]

FIXED, TURNS, SLIDES = "FIXED", "REVOLUTE", "PRISMATIC"


class Joint:
    """A joint: its place in the frame that it hangs on, and how it moves.

    Args:
        parent: The frame that it hangs on.
        kind: FIXED, TURNS or SLIDES.
        axis: In its own frame, of any length.
        placement: T_parent_joint, shape (4, 4), doubles or balls; [m].
        moves: Column of q that moves it, None for none, ratio and offset: its value is
            ratio q + offset; [rad] or [m].
        errors: Of its value, and a shift and a turn of its placement; [rad] or [m].
    """

    def __init__(
        self,
        parent: int,
        kind: str,
        axis: Any,
        placement: Any,
        moves: tuple[int | None, float, float],
        errors: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> None:
        self.parent, self.kind = parent, kind
        self.column, self.ratio, self.offset = moves[0], *map(arb, moves[1:])
        rows = [[*row] for row in placement]
        self.shift = column(*(row[3] for row in rows[:3]))
        turned = [row[:3] for row in rows[:3]]
        self.rotation = None if turned == np.eye(3).tolist() else arb_mat(turned)
        self.lever = float(norm(self.shift)) * UP
        self.axis = unit(column(*map(float, axis)))
        along = self.axis if self.rotation is None else self.rotation * self.axis
        line = [[*map(float, x.entries())] for x in (self.shift, along)]
        self.line = np.array(line).T  # shift and axis in the frame that it hangs on
        self.gain, self.past = abs(moves[1]), UP * abs(moves[2])
        x, y, z = self.axis.entries()
        self.cross = arb_mat([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        self.square = self.cross * self.cross
        self.err(*errors)

    def err(self, value: float, moved: float, tilt: float) -> None:
        """Take other errors."""
        value, moved, self.tilt = UP * value, UP * moved, UP * tilt
        self.turn_error = value if self.kind == TURNS else 0.0
        self.slip = moved + (value if self.kind == SLIDES else 0.0)


def frame_of(link: int) -> int:
    """The frame of an arm's link from 1, or of its feed (0), which never turns."""
    return 2 * link + 1


def hung(one: Any, base: int, columns: int) -> Any:
    """A joint, as a reader gives it too, behind so many others and columns of q."""
    if not isinstance(one, Joint):
        moves = one.column, one.ratio, one.offset
        one = Joint(one.parent, one.kind.name, one.axis, one.placement, moves)
    one.parent += base if one.parent else 0
    one.column = None if one.column is None else one.column + columns
    return one


class Tree:
    """A list of joints and the ways between their frames.

    Args:
        joints: Parents first.
    """

    def __init__(self, joints: Sequence[Joint]) -> None:
        self.joints = joints
        self._ways: dict[tuple[int, int], list[tuple[int, bool]]] = {}

    def pose(self, q: Sequence[Ball]) -> Pose:
        """All frames at a row of q."""
        still = arb_mat(3, 3, 1)
        frames = [(column(0, 0, 0), still)]
        for joint in self.joints:
            origin, turned = frames[joint.parent]
            if joint.lever > 0.0:
                origin = origin + turned * joint.shift
            if joint.rotation is not None:
                turned = turned * joint.rotation
            value = joint.offset
            if joint.column is not None:
                value = joint.ratio * q[joint.column] + value
            if joint.kind == TURNS:
                sine, cosine = value.sin_cos()
                turn = still + joint.cross * sine + joint.square * (1 - cosine)
                turned = turned * turn
            elif joint.kind == SLIDES:
                origin = origin + turned * (joint.axis * value)
            frames.append((origin, turned))
        return frames

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

    def slip(self, rest: int, frame: int) -> float:
        """How far errors that do not turn carry a frame, as seen from another; [m]."""
        return sum(self.joints[k].slip for k, _ in self.way(rest, frame))
