"""Trees of joints: frames, their poses, how fast they turn.

A tree is a list of joints, parents first. Joint j (from 0) carries frame j + 1; frame 0
is the world. Several joints may hang on the world: an obstacle that moves or a second
arm is another branch of the same tree.

    tree = Tree((
        Joint(0, Kind.PRISMATIC, axis=(1.0, 0.0, 0.0), column=0, name="rail"),
        Joint(1, Kind.REVOLUTE, axis=(0.0, 0.0, 1.0), column=1, name="shoulder"),
        Joint(2, placement=shifted(0.3, 0.0, 0.0), name="flange"),
    ))
    tree.poses(q)                # T_world_frame, (n_rows, 4, 4, 4)
    tree.joined(free_tree())     # and a body that floats, with 6 more columns of q

Readers of robots build on it: `Joint`, `Tree`, `shifted`, `free_tree` and their
arguments are kept stable.
"""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import (
    FloatArray,
    IntArray,
    freeze,
    frozen,
    is_rigid,
    is_unit,
)

IDENTITY: Final = frozen(np.eye(4))
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


class Kind(IntEnum):
    """How a joint moves its frame."""

    FIXED = 0
    REVOLUTE = 1
    PRISMATIC = 2


@dataclass(frozen=True)
class Joint:
    """One joint and the frame that it carries.

    Its value is ratio q[column] + offset. At value v the frame stands at
    T_parent_frame = placement @ (turn by v, or shift by v, along the axis).

    Args:
        parent: Frame that it hangs on; 0 is the world.
        kind: Fixed, revolute (also without limits) or prismatic.
        axis: Unit vector in the joint's own frame, shape (3,); [-].
        placement: T_parent_joint, shape (4, 4); [m].
        column: Column of q that moves it; None: its value is the offset. Joints that
            mimic each other share a column.
        ratio: Value per unit of q; [-] or, where q is in other units, as they ask for.
        offset: Value at q = 0; [rad] or [m].
        name: For messages.

    Raises:
        ValueError: If the axis is no unit vector, or the placement no rigid motion.
    """

    parent: int
    kind: Kind = Kind.FIXED
    axis: FloatArray | tuple[float, float, float] = Z
    placement: FloatArray = field(default_factory=lambda: IDENTITY)
    column: int | None = None
    ratio: float = 1.0
    offset: float = 0.0
    name: str = ""

    def __post_init__(self) -> None:
        """Refuse what is no joint."""
        freeze(self, "axis", "placement")
        if not is_unit(np.asarray(self.axis)):
            message = f"joint {self.name!r}: axis {self.axis} is no unit vector"
            raise ValueError(message)
        if not is_rigid(self.placement):
            message = f"joint {self.name!r}: its placement is no rigid motion"
            raise ValueError(message)
        if not np.isfinite([self.ratio, self.offset]).all():
            message = f"joint {self.name!r}: ratio and offset must be finite"
            raise ValueError(message)


def shifted(x: float, y: float, z: float) -> FloatArray:
    """A placement without rotation, shape (4, 4); [m]."""
    placement = np.eye(4)
    placement[:3, 3] = x, y, z
    return placement


@dataclass(frozen=True, eq=False)
class Tree:
    """Joints and the frames that they carry; a forest is a tree with branches at 0.

    Args:
        joints: Parents before children; joint j carries frame j + 1.

    Raises:
        ValueError: If a joint hangs on a frame that does not come before its own, or
            the columns of q are not 0, 1, .. without a gap.
    """

    joints: tuple[Joint, ...]

    def __post_init__(self) -> None:
        """Refuse what is no tree."""
        for number, joint in enumerate(self.joints):
            if not 0 <= joint.parent <= number:
                message = (
                    f"joint {joint.name!r} carries frame {number + 1} and hangs on "
                    f"frame {joint.parent}, expected one from 0 to {number}"
                )
                raise ValueError(message)
        used = {j.column for j in self.joints if j.column is not None}
        if used != set(range(len(used))):
            message = f"columns of q are {sorted(used)}, expected 0, 1, .. without gaps"
            raise ValueError(message)

    @property
    def n_frames(self) -> int:
        """Number of frames, the world among them."""
        return len(self.joints) + 1

    @property
    def n_columns(self) -> int:
        """Length of a row of q."""
        return len({j.column for j in self.joints if j.column is not None})

    @property
    def branches(self) -> IntArray:
        """The first frame on the way to each frame from the world, (n_frames,)."""
        branch = np.arange(self.n_frames)
        for number, joint in enumerate(self.joints):
            if joint.parent:
                branch[number + 1] = branch[joint.parent]
        return branch

    def joined(self, other: "Tree") -> "Tree":
        """One tree of both: the other's frames and columns count on after these."""
        moved = tuple(
            replace(
                joint,
                parent=joint.parent + len(self.joints) if joint.parent else 0,
                column=None if joint.column is None else joint.column + self.n_columns,
            )
            for joint in other.joints
        )
        return Tree(self.joints + moved)

    def values(self, q: FloatArray) -> FloatArray:
        """Values of the joints at rows of q (n_rows, n_columns), (n_rows, n_joints)."""
        q = np.asarray(q, dtype=np.float64)
        if q.ndim != 2 or q.shape[1] != self.n_columns:
            message = f"q has shape {q.shape}, expected (n_rows, {self.n_columns})"
            raise ValueError(message)
        values = np.zeros((len(q), len(self.joints)))
        for number, joint in enumerate(self.joints):
            moved = 0.0 if joint.column is None else joint.ratio * q[:, joint.column]
            values[:, number] = moved + joint.offset
        return values

    def poses(self, q: FloatArray) -> FloatArray:
        """Poses of all frames.

        Args:
            q: Shape (n_rows, n_columns); [rad], [m].

        Returns:
            T_world_frame, shape (n_rows, n_frames, 4, 4); [m].
        """
        values = self.values(q)
        poses = np.tile(np.eye(4), (len(values), self.n_frames, 1, 1))
        for number, joint in enumerate(self.joints):
            placed = poses[:, joint.parent] @ joint.placement
            poses[:, number + 1] = placed @ _motions(joint, values[:, number])
        return poses

    def way(self, start: int, end: int) -> tuple[IntArray, IntArray]:
        """The joints between two frames, by their nearest common ancestor.

        Returns:
            Those from `start` up to the ancestor, then those from it down to `end`.
        """
        up, down = [], []
        while start != end:
            if start > end:
                up.append(start - 1)
                start = self.joints[start - 1].parent
            else:
                down.append(end - 1)
                end = self.joints[end - 1].parent
        return np.array(up, dtype=np.int64), np.array(down[::-1], dtype=np.int64)


def _motions(joint: Joint, values: FloatArray) -> FloatArray:
    """What a joint does at each of its values, shape (n, 4, 4)."""
    motion = np.tile(np.eye(4), (len(values), 1, 1))
    axis = np.asarray(joint.axis)
    if joint.kind is Kind.PRISMATIC:
        motion[:, :3, 3] = values[:, None] * axis
    elif joint.kind is Kind.REVOLUTE:
        x, y, z = axis
        cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        sine, rest = np.sin(values)[:, None, None], 1.0 - np.cos(values)[:, None, None]
        motion[:, :3, :3] += sine * cross + rest * (cross @ cross)
    return motion


def added_up(joints: Iterable[Joint], reach: FloatArray) -> float:
    """What joints come to where each is as far as it gets; [m], [rad].

    Args:
        joints: Of one tree.
        reach: How large each column of q gets, shape (n_columns,).
    """
    moved = (one for one in joints if one.column is not None)
    return sum(abs(one.ratio) * float(reach[one.column]) for one in moved)


def free_tree() -> Tree:
    """A frame that floats: six joints x, y, z, yaw, pitch, roll, columns 0 to 5.

    Frame 6 stands at (x, y, z) and is turned by Rz(yaw) Ry(pitch) Rx(roll).
    """
    shifts = [
        Joint(k, Kind.PRISMATIC, axis, column=k) for k, axis in enumerate((X, Y, Z))
    ]
    turns = [
        Joint(3 + k, Kind.REVOLUTE, axis, column=3 + k)
        for k, axis in enumerate((Z, Y, X))
    ]
    return Tree((*shifts, *turns))
