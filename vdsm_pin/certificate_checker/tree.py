"""Trees of joints: how their frames stand in the world (docs/certificate.md).

A tree is a list of joints, parents first. Joint j, from 0, carries frame j + 1; frame 0
is the world. How a frame stands is a matrix of shape (4, 4).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from flint import arb, arb_mat

from vdsm_pin.certificate_checker.balls import UP, column, norm, unit

Pose: TypeAlias = list[arb_mat]  # T_world_frame of every frame

FIXED, TURNS, SLIDES = "FIXED", "REVOLUTE", "PRISMATIC"


@dataclass(eq=False)
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

    parent: int
    kind: str
    axis: Any
    placement: Any
    moves: tuple[int | None, Any, Any]
    errors: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Work out what every pose and bound needs."""
        self.column, self.ratio, self.offset = self.moves[0], *map(arb, self.moves[1:])
        self.placement = arb_mat(self.placement.tolist())
        self.lever = float(norm(point_of(self.placement, 0, 0, 0))) * UP
        x, y, z = unit(column(*map(float, self.axis))).entries()
        twist: Any = [[0, 0, 0, x], [0, 0, 0, y], [0, 0, 0, z], [0] * 4]
        if self.kind == TURNS:
            twist = [[0, -z, y, 0], [z, 0, -x, 0], [-y, x, 0, 0], [0] * 4]
        self.first = self.placement * arb_mat(twist)
        self.second = self.first * arb_mat(twist)
        line = self.placement * arb_mat([[0, x], [0, y], [0, z], [1, 0]])
        self.line = np.array(line.tolist()[:3], float)  # where it stands, and its axis
        self.err(*self.errors)

    def err(self, value: float, moved: float, tilt: float) -> None:
        """Take other errors."""
        value, moved, self.tilt = UP * value, UP * moved, UP * tilt
        self.turn_error = angle = value if self.kind == TURNS else 0.0
        self.erring = np.array([[0.0], [0.0], [angle], [angle + self.tilt]])
        self.slip = moved + (value if self.kind == SLIDES else 0.0)

    def carries(self, q: Sequence[arb]) -> Any:
        """T_parent_frame at a row of q: by the exponential of its twist."""
        value = self.offset
        if self.column is not None:
            value = self.ratio * q[self.column] + value
        if self.kind == FIXED:
            return self.placement
        if self.kind == SLIDES:
            return self.placement + self.first * value
        sine, cosine = value.sin_cos()
        return self.placement + self.first * sine + self.second * (1 - cosine)

    def bounds(self, columns: Any) -> Any:
        """Bounds of its value, rate and how fast that changes, shape (3, n).

        Args:
            columns: Those of the columns of q, shape (n_columns, 3, n).
        """
        found = np.array([[UP * abs(float(self.offset))], [0.0], [0.0]])
        if self.column is not None:
            found = found + abs(float(self.ratio)) * columns[self.column]
        return found


def point_of(frame: arb_mat, x: Any, y: Any, z: Any) -> arb_mat:
    """Where a point of a frame stands."""
    return column(*(frame * arb_mat(4, 1, [x, y, z, 1])).entries()[:3])


def frame_of(link: int) -> int:
    """The frame of an arm's link from 1, or of its feed (0), which never turns."""
    return 2 * link + 1


def hung(one: Any, base: int, columns: int) -> Joint:
    """A joint, as a reader gives it too, behind so many others and columns of q."""
    parent, column = one.parent and one.parent + base, one.column
    moves = None if column is None else column + columns, one.ratio, one.offset
    kind = one.kind if isinstance(one, Joint) else one.kind.name
    return Joint(parent, kind, one.axis, one.placement, moves)


class Tree:
    """A list of joints and the ways between their frames.

    Args:
        joints: Parents first.
    """

    def __init__(self, joints: Sequence[Joint]) -> None:
        self.joints = joints
        self._ways: dict[tuple[int, int], list[tuple[int, bool]]] = {}

    def pose(self, q: Sequence[arb]) -> Pose:
        """All frames at a row of q."""
        frames = [arb_mat(4, 4, 1)]
        for joint in self.joints:
            frames.append(frames[joint.parent] * joint.carries(q))
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
