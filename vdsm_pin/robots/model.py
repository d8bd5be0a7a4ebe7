"""A robot of any kind: a tree of joints and the solids of its links."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from vdsm_pin.geometry.arrays import IntArray
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.proof.bodies import Body, LeftOut
from vdsm_pin.proof.packed_tree import TreePoses
from vdsm_pin.proof.tree import Tree
from vdsm_pin.robots.files import HULLS, MeshCover
from vdsm_pin.robots.srdf import Base
from vdsm_pin.text import listed

Values: TypeAlias = Mapping[str, tuple[int | None, float, float]]
"""Of a joint by name: column of q, None where it stands still, ratio and offset."""

MOST_TURNS: Final = 4.0 * np.pi
"""An angle beyond this, not stated in degrees, must be in degrees; [rad]."""

MOST_SLID: Final = 10.0
"""A place beyond a metre and so many times its limits must be in millimetres; [-]."""


@dataclass(frozen=True)
class RobotJoint:
    """A joint that a trajectory moves.

    Args:
        name: As in the URDF.
        lower: Least value, -inf where there is no limit; [rad] or [m].
        upper: Largest value.
        turns: Whether its values are angles.
        velocity: Largest rate, inf where there is no limit; [rad/s] or [m/s].
        acceleration: Largest change of it; [rad/s^2] or [m/s^2].
        narrowed_by: Joints that mimic it and whose limits are the stricter ones.
    """

    name: str
    lower: float
    upper: float
    turns: bool
    velocity: float = np.inf
    acceleration: float = np.inf
    narrowed_by: tuple[str, ...] = ()

    @property
    def unit(self) -> str:
        """Of its values."""
        return "rad" if self.turns else "m"

    @property
    def other_unit(self) -> str:
        """In which tables may have them too."""
        return "deg" if self.turns else "mm"

    @property
    def most_unstated(self) -> float:
        """The largest value that is taken for radians or metres, unless others are."""
        if self.turns:
            return max(MOST_TURNS, 2.0 * self.farthest)
        return max(1.0, MOST_SLID * self.farthest) if self.farthest else np.inf

    @property
    def farthest(self) -> float:
        """The larger one of its limits, either way; 0 where it has none."""
        limits = (abs(x) for x in (self.lower, self.upper) if np.isfinite(x))
        return max(limits, default=0.0)

    @property
    def whose(self) -> str:
        """Whose limits count besides its own, in words; empty if none do."""
        names = listed(self.narrowed_by)
        return f"narrowed by limits of what mimics it: {names}" if names else ""


def reach_of(tree: Tree) -> float:
    """The way along all joints of a tree in one; 1 where there is none; [m]."""
    shifts = [np.linalg.norm(joint.placement[:3, 3]) for joint in tree.joints]
    return float(sum(shifts)) or 1.0


@dataclass(frozen=True, eq=False)
class Robot:
    """A robot as it is judged.

    Args:
        name: As in the URDF.
        text: The URDF, for Pinocchio to read by itself.
        tree: The joints; column c of q is `joints[c]`.
        joints: Those that a trajectory moves.
        frames: The frame of each link by name.
        bodies: The links that have collision solids.
        held: Numbers of two bodies that are held apart, each.
        left_out: Pairs of links with solids that are not.
        base: The joint between world and root link; None where it stands.
        solids: What stands for the meshes of links.
        notes: What else a reader should know, a sentence each.
        more_files: What the file of its URDF includes, and its links' meshes.
        covers: By link, of each of its meshes the triangles under each hull, or the
            primitive around it.
        urdf: Its file, where it was read from one; None where nobody knows how its
            links look.
        package_dirs: Where `package://NAME/REST` is looked for.
    """

    name: str
    text: str
    tree: Tree
    joints: tuple[RobotJoint, ...]
    frames: dict[str, int]
    bodies: tuple[Body, ...]
    held: tuple[tuple[int, int], ...]
    left_out: tuple[LeftOut, ...]
    base: Base | None = None
    solids: MeshCover = HULLS
    notes: tuple[str, ...] = ()
    more_files: tuple[Path, ...] = ()
    covers: Mapping[str, Sequence[tuple[IntArray, ...] | Hull]] = field(
        default_factory=dict
    )
    urdf: Path | None = None
    package_dirs: tuple[Path, ...] = ()

    @property
    def reach(self) -> float:
        """How far it reaches at most, roughly; 1 where all is in one place; [m]."""
        return reach_of(self.tree)

    @property
    def values(self) -> Values:
        """The value of every joint by the columns of q."""
        joints = (joint for joint in self.tree.joints if joint.name)
        return {one.name: (one.column, one.ratio, one.offset) for one in joints}

    @cached_property
    def poses(self) -> TreePoses:
        """T_world_frame of its frames, a function of rows of q."""
        return TreePoses(self.tree)
