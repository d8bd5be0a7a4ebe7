"""The planning problem: arm, scene, desired tip path, required clearance."""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import InvalidInput, UnknownName
from vdsm_pin.geometry.arrays import (
    BoolArray,
    ByValue,
    FloatArray,
    check_numbers,
    freeze,
)
from vdsm_pin.problem.any_problem import AnyProblem, ProblemSource
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.held import HeldApart
from vdsm_pin.problem.scaling import Scaling
from vdsm_pin.problem.scene import Scene
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import MM_PER_M, in_mm

if TYPE_CHECKING:  # it brings compiled code, for which readers need not wait
    from vdsm_pin.geometry.pieces import PackedPieces
    from vdsm_pin.problem.own_pairs import OwnPairs


@dataclass(frozen=True, eq=False)
class Posture(ByValue):
    """Where the arm stands, in the base frame.

    Args:
        tip: Position of the tip, shape (3,); [m].
        joints: Joint values q = (x0, alpha1, theta1, ..), shape (1 + 2N,), with `tip`
            their tip; None where the tip alone is known; [m] in the first entry, [rad]
            in the others.
    """

    tip: FloatArray
    joints: FloatArray | None = None

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self, "tip", "joints")


@dataclass(frozen=True, eq=False, repr=False)
class PlanningProblem(AnyProblem, ByValue):
    """All the planner may read, in the base frame: x along the rail.

    Args:
        manipulator: The arm.
        scene: The obstacles.
        tip_path: What the tip shall draw, and from where; None where it shall draw
            nothing: clearance, limits, start and goal are asked for, no more.
        required_clearance: Least distance between surfaces; [m].
        name: Name for reports and folders.
        T_world_base: Pose of the base frame in the user's frame, shape (4, 4), [m] in
            its last column; readers and writers apply it, nobody else needs it.
            Default: at the origin.
        required_self_clearance: Least distance between the surfaces of two links that
            are not neighbours; [m].
        tip_tolerance: How far the tip may be off its start, its goal and, at waypoints,
            the path; [m].
        max_row_change: Largest change of a joint angle from row to row; None where none
            is asked for; [rad].
        start: Where a motion without tip path begins; None where anywhere will do.
        goal: Where a motion without tip path ends; None where anywhere will do.
        errors: How far the motion, base and obstacles may be off: every clearance is
            asked for under them.
        scaling: What takes the place of constant ratios about the rail in the paper's
            Step 3; None for those.
        source: The files it was read from; None where it was built in Python or changed
            since by more than its errors.

    Raises:
        InvalidInput: If the pose is no rigid motion, a required clearance is negative,
            a tolerance or limit not above 0, or one of them not finite, joint values do
            not fit the arm, or a start or goal stands beside a tip path.

    Example:
        >>> arm, tip = vp.built_in("hrm8"), np.array([3.126, 0.0, 0.0])
        >>> path = vp.DesiredPath(tip, tip + [[0.0, 0.2, 0.0], [0.0, 0.2, 0.3]])
        >>> vp.Problem(arm, vp.Scene(), path, 0.005, name="mine").name
        'mine'
    """

    manipulator: Manipulator
    scene: Scene
    tip_path: DesiredPath | None
    required_clearance: float
    name: str = "problem"
    T_world_base: FloatArray = field(default_factory=lambda: np.eye(4))
    required_self_clearance: float = 0.0
    tip_tolerance: float = TOLERANCES.tip_on_path
    max_row_change: float | None = None
    start: Posture | None = None
    goal: Posture | None = None
    errors: ErrorBox = field(default_factory=ErrorBox)
    scaling: Scaling | None = None
    source: ProblemSource | None = field(default=None, init=False, compare=False)

    def __post_init__(self) -> None:
        """Check the values."""
        self.check_asked()
        check_numbers(self, "tip_tolerance")
        if self.max_row_change is not None:
            check_numbers(self, "max_row_change")
        if not 0.0 < self.tip_tolerance < np.inf:
            message = f"tip_tolerance is {self.tip_tolerance} m, expected above 0"
            raise InvalidInput(message)
        if self.max_row_change is not None and not 0.0 < self.max_row_change < np.inf:
            message = f"max_row_change is {self.max_row_change} rad, expected above 0"
            raise InvalidInput(message)
        if self.tip_path is not None and (self.start or self.goal):
            message = "start and goal belong to problems without tip_path"
            raise InvalidInput(message)
        if self.scaling is not None:
            self.scaling.check(self.manipulator.n_links)
        for name in self.scene.names:
            if self.manipulator.owner_of(name) in self.manipulator.body_names:
                message = f"obstacle {name!r}: a body of the arm has this name"
                raise InvalidInput(message)
        for posture in (self.begin, self.goal):
            if posture is not None and posture.joints is not None:
                self._check_joints(posture.joints)

    def _check_joints(self, joints: FloatArray) -> None:
        count = 1 + 2 * self.manipulator.n_links
        if joints.shape != (count,) or not np.isfinite(joints).all():
            message = f"joint values are {joints.tolist()}, expected {count} numbers"
            raise InvalidInput(message)

    def check_errors(self, errors: ErrorBox) -> None:
        """Refuse errors of obstacles or joints that do not exist.

        Raises:
            UnknownName: If they name an obstacle that is not in the scene.
            InvalidInput: If they are of as many joints as the arm has not, name joints
                or have a slide, as for other robots.
        """
        known = self.scene.names
        for one in errors.obstacles:
            if one.name not in known:
                raise UnknownName(kind="obstacle", name=one.name, known=known)
        found, expected = len(errors.joints), self.manipulator.n_links
        if found not in (0, expected):
            message = (
                f"errors of {found} joints are given one by one, expected {expected} "
                "(or one error for all)"
            )
            raise InvalidInput(message)
        errors.angles(expected)

    @cached_property
    def packed(self) -> "PackedPieces":
        """The obstacles, then the bodies of the arm in the frames of their links."""
        from vdsm_pin.geometry.pieces import pack_pieces  # compiled code, few need it

        bodies = [[body.piece] for body in self.manipulator.convex_bodies]
        obstacles = [obstacle.pieces for obstacle in self.scene.obstacles]
        return pack_pieces([*obstacles, *bodies])

    @property
    def packed_obstacles(self) -> "PackedPieces":
        """The obstacles alone, as views of `packed`."""
        from vdsm_pin.geometry.pieces import first_groups

        return first_groups(self.packed, len(self.scene.obstacles))

    def among(self, chosen: BoolArray) -> "PlanningProblem":
        """The same with those obstacles alone, (n_obstacles,); itself with all."""
        if chosen.all():
            return self  # with what it keeps packed
        obstacles = self.scene.obstacles
        kept = Scene(tuple(obstacles[k] for k in np.flatnonzero(chosen)))
        return replace(self, scene=kept)

    @cached_property
    def held(self) -> HeldApart:
        """What of the arm is held apart from each obstacle."""
        return HeldApart.of(self.manipulator, self.scene.names)

    @cached_property
    def own_pairs(self) -> "OwnPairs":
        """Which bodies of the arm can come too near to each other."""
        from vdsm_pin.problem.own_pairs import OwnPairs

        return OwnPairs.of(self)

    @property
    def slides(self) -> bool:
        """Whether the base can move along the rail."""
        low, high = self.manipulator.base_range
        return low < high

    @property
    def path(self) -> DesiredPath:
        """What the tip shall draw, of a problem that says so.

        Raises:
            InvalidInput: If the tip shall draw nothing.
        """
        if self.tip_path is None:
            message = f"problem {self.name!r} has no tip_path: there is nothing to draw"
            if (self.start is None) != (self.goal is None):
                has, lacks = ("start", "goal") if self.start else ("goal", "start")
                message = (
                    f"problem {self.name!r} has a {has} and no {lacks}, expected both, "
                    "or a tip_path"
                )
            raise InvalidInput(message)
        return self.tip_path

    def in_file(self, point: FloatArray) -> str:
        """A point of the base frame as messages tell it: in the file's frame, in mm."""
        moved = self.T_world_base[:3, :3] @ point + self.T_world_base[:3, 3]
        moved = MM_PER_M * moved
        return f"({', '.join(f'{value:.1f}' for value in moved.round(1) + 0.0)}) mm"

    @property
    def begin(self) -> Posture | None:
        """Where a motion begins, by tip path or start; None where anywhere will do."""
        if self.tip_path is None:
            return self.start
        return Posture(self.tip_path.start, self.tip_path.start_joints)

    @property
    def planned_row_change(self) -> float:
        """Largest change of a joint angle from row to row in a plan; [rad].

        A little below the limit, as a CSV rounds, and never above what plans promise.
        """
        limit = min(self.max_row_change or np.inf, TOLERANCES.row_change)
        return TOLERANCES.planned_step / TOLERANCES.row_change * limit

    def summary(self) -> tuple[tuple[str, str], ...]:
        """Arm, scene, path and what is required."""
        return (
            ("name", self.name),
            ("arm", f"{self.manipulator.name}, {self.manipulator.n_links} links"),
            ("obstacles", ", ".join(self.scene.names[:8]) or "none"),
            ("path", in_mm(self.path.length) if self.tip_path else "none"),
            ("required clearance", in_mm(self.required_clearance)),
            ("file", str(self.source.path) if self.source else "built in Python"),
        )
