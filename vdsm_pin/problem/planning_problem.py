"""The planning problem: arm, scene, desired tip path, required clearance."""

from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import InvalidInput, UnknownName
from vdsm_pin.geometry.arrays import FloatArray, frozen, running_sums
from vdsm_pin.notebook import Summarised
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.pointing import Pointing
from vdsm_pin.problem.scaling import Scaling
from vdsm_pin.problem.scene import Scene
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import MM_PER_M, in_mm

if TYPE_CHECKING:  # it brings compiled code, for which readers need not wait
    from vdsm_pin.geometry.pieces import PackedPieces


class Approach(StrEnum):
    """How the tip comes onto the desired path (paper, 4.2.2)."""

    SHORTEST = "shortest"
    EQUIDISTANT = "equidistant"
    NEAREST_EQUIDISTANT = "nearest_equidistant"


class Blocked(StrEnum):
    """What to do where the desired path itself cannot be drawn.

    Draw the rest of it, or refuse to plan at all.
    """

    DETOUR = "detour"
    FAIL = "fail"


class Order(StrEnum):
    """In which order the desired path may be drawn."""

    AS_GIVEN = "as_given"
    FREE = "free"


@dataclass(frozen=True)
class DesiredPath:
    """What the tip shall draw, in the base frame.

    Args:
        start: Tip position at the start, shape (3,); [m].
        points: Corners of the polyline, shape (n, 3), n >= 1; [m].
        closed: Whether the last corner joins the first.
        spacing: Largest distance of the tip between two rows; [m].
        approach: The paper's three schemes.
        retreat: Largest step back along -X while off the path; [m].
        blocked: Detour or fail.
        required_coverage: Least part of the path that must be drawn, 0 to 1; [-].
        start_joints: Joint values q = (x0, alpha1, theta1, ..) at the start, shape
            (1 + 2N,), with `start` their tip; None where the arm starts straight;
            [m] in the first entry, [rad] in the others.
        order: Whether pieces of the path may be drawn in another order or direction.
        pointing: Where the last link shall look meanwhile; None for anywhere.
        home: Whether the arm shall go back to its start by the way it came.
        insertion: Places between start and path that `follow-the-leader` takes, in this
            order, shape (k, 3); [m].

    Raises:
        InvalidInput: If a value breaks its range, or directions do not fit the corners.
    """

    start: FloatArray
    points: FloatArray
    closed: bool = False
    spacing: float = 0.010
    approach: Approach = Approach.SHORTEST
    retreat: float = 0.0
    blocked: Blocked = Blocked.DETOUR
    required_coverage: float = 1.0
    start_joints: FloatArray | None = None
    order: Order = Order.AS_GIVEN
    pointing: Pointing | None = None
    home: bool = False
    insertion: FloatArray = field(default_factory=lambda: np.zeros((0, 3)))

    def __post_init__(self) -> None:
        """Freeze the arrays and check the values."""
        object.__setattr__(self, "start", frozen(self.start))
        object.__setattr__(self, "points", frozen(self.points))
        object.__setattr__(self, "insertion", frozen(self.insertion))
        if self.insertion.shape[1:] != (3,) or not np.isfinite(self.insertion).all():
            message = "tip_path.insertion is not a list of points"
            raise InvalidInput(message)
        if self.start_joints is not None:
            object.__setattr__(self, "start_joints", frozen(self.start_joints))
        if self.start.shape != (3,) or not np.isfinite(self.start).all():
            message = (
                f"tip_path.start is {self.start.tolist()}, expected 3 finite numbers"
            )
            raise InvalidInput(message)
        if (
            self.points.ndim != 2
            or self.points.shape[1:] != (3,)
            or not self.points.size
        ):
            message = f"tip_path.points has shape {self.points.shape}, expected (n, 3)"
            raise InvalidInput(message)
        if not np.isfinite(self.points).all():
            message = "tip_path.points has a value that is not finite"
            raise InvalidInput(message)
        if not 0.0 < self.spacing < np.inf:
            message = f"tip_path.spacing is {self.spacing} m, expected above 0"
            raise InvalidInput(message)
        if not 0.0 <= self.retreat < np.inf:
            message = f"tip_path.retreat is {self.retreat} m, expected 0 or more"
            raise InvalidInput(message)
        if not 0.0 <= self.required_coverage <= 1.0:
            value = self.required_coverage
            message = f"tip_path.required_coverage is {value}, expected 0 to 1"
            raise InvalidInput(message)
        self._check_pointing()

    def _check_pointing(self) -> None:
        directions = None if self.pointing is None else self.pointing.directions
        if directions is None or len(directions) in (1, len(self.corners)):
            return
        message = (
            f"pointing has {len(directions)} directions for a path of "
            f"{len(self.corners)} corners, expected one, or one for each"
        )
        raise InvalidInput(message)

    def aims(self, tips: FloatArray, stations: FloatArray) -> FloatArray:
        """Where the last link shall look on the path; see `Pointing.aims`.

        Args:
            tips: Shape (n, 3); [m].
            stations: Arc length along the path, past its length on laps, (n,); [m].

        Returns:
            Shape (n, 3), NaN where it may look anywhere.
        """
        if self.pointing is None:
            return np.full(tips.shape, np.nan)
        if self.closed and self.length > 0.0:
            stations = np.where(
                stations > self.length, stations - self.length, stations
            )
        return self.pointing.aims(self.corner_stations, tips, stations)

    @cached_property
    def corners(self) -> FloatArray:
        """The polyline drawn, closing corner repeated, shape (m, 3); [m]."""
        if self.closed and len(self.points) > 1:
            return frozen(np.vstack([self.points, self.points[:1]]))
        return self.points

    @cached_property
    def corner_stations(self) -> FloatArray:
        """Arc length at each corner, shape (m,); [m]."""
        sides = np.linalg.norm(np.diff(self.corners, axis=0), axis=1)
        return frozen(np.concatenate([[0.0], running_sums(sides)]))

    @property
    def length(self) -> float:
        """Arc length of the whole path; [m]."""
        return float(self.corner_stations[-1])

    @cached_property
    def entry(self) -> float:
        """Arc length where the drawing begins by the "shortest distance" scheme; [m].

        On a closed path that is the point nearest to the start, of equals the first;
        an open one is drawn from its first corner.
        """
        if not self.closed or self.length == 0.0:
            return 0.0
        begins, sides = self.corners[:-1], np.diff(self.corners, axis=0)
        squared = np.einsum("ij,ij->i", sides, sides)
        towards = np.einsum("ij,ij->i", self.start - begins, sides)
        part = np.clip(towards / np.where(squared > 0.0, squared, 1.0), 0.0, 1.0)
        gaps = np.linalg.norm(begins + part[:, None] * sides - self.start, axis=1)
        k = int(np.argmax(gaps <= gaps.min() + TOLERANCES.on_path_length))
        return float(self.corner_stations[k] + part[k] * np.sqrt(squared[k]))

    def at(self, stations: FloatArray) -> FloatArray:
        """Points of the path at arc lengths, shape (k,) to (k, 3); [m].

        Stations outside [0, length] are clamped to the ends; for a closed path callers
        wrap them first.
        """
        known = self.corner_stations
        columns = [np.interp(stations, known, column) for column in self.corners.T]
        return np.stack(columns, axis=-1)


@dataclass(frozen=True)
class ProblemSource:
    """The files a problem was read from.

    Args:
        path: The problem file.
        sha256: Of its bytes followed by those of the files it names.
        named: The files it names: the arm's URDF, then meshes in the order of the
            obstacles.
        of_obstacles: Names of the obstacles that have a file of their own, with it.
    """

    path: Path
    sha256: str
    named: tuple[Path, ...] = ()
    of_obstacles: tuple[tuple[str, Path], ...] = ()

    @property
    def files(self) -> tuple[Path, ...]:
        """Everything that was read."""
        return (self.path, *self.named)


@dataclass(frozen=True)
class Posture:
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
        object.__setattr__(self, "tip", frozen(self.tip))
        if self.joints is not None:
            object.__setattr__(self, "joints", frozen(self.joints))


@dataclass(frozen=True, repr=False)
class PlanningProblem(Summarised):
    """All the planner may read, in the base frame: x along the rail.

    Args:
        name: Name for reports and folders.
        manipulator: The arm.
        scene: The obstacles.
        tip_path: What the tip shall draw, and from where; None where it shall draw
            nothing: clearance, limits, start and goal are asked for, no more.
        required_clearance: Least distance between surfaces; [m].
        T_world_base: Pose of the base frame in the user's frame, shape (4, 4), [m] in
            its last column; readers and writers apply it, nobody else needs it.
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
        InvalidInput: If a required clearance is negative, a tolerance or limit not
            above 0, or one of them not finite, joint values do not fit the arm, or a
            start or goal stands beside a tip path.
    """

    name: str
    manipulator: Manipulator
    scene: Scene
    tip_path: DesiredPath | None
    required_clearance: float
    T_world_base: FloatArray
    required_self_clearance: float = 0.0
    tip_tolerance: float = TOLERANCES.tip_on_path
    max_row_change: float | None = None
    start: Posture | None = None
    goal: Posture | None = None
    errors: ErrorBox = field(default_factory=ErrorBox)
    scaling: Scaling | None = None
    source: ProblemSource | None = field(default=None, init=False, compare=False)

    def __post_init__(self) -> None:
        """Freeze the pose and check the values."""
        object.__setattr__(self, "T_world_base", frozen(self.T_world_base))
        for name in ("required_clearance", "required_self_clearance"):
            value = getattr(self, name)
            if not 0.0 <= value < np.inf:
                message = f"{name} is {value} m, expected 0 or more"
                raise InvalidInput(message)
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

    @property
    def files(self) -> tuple[Path, ...]:
        """The files it was read from, the problem file first."""
        return () if self.source is None else self.source.files

    @property
    def sha256(self) -> str:
        """SHA-256 of those files one after the other; empty where there are none."""
        return "" if self.source is None else self.source.sha256

    def under(self, errors: ErrorBox) -> "PlanningProblem":
        """The same, its clearances asked for under more errors.

        Raises:
            UnknownName: If they name an obstacle that there is not.
            InvalidInput: If they are of joints that only other robots have.
        """
        known = self.scene.names
        for one in errors.obstacles:
            if one.name not in known:
                raise UnknownName(kind="obstacle", name=one.name, known=known)
        widened = self.errors.widened(errors)
        widened.angles(self.manipulator.n_links)
        return replace(self, errors=widened).read_from(self.source)

    @cached_property
    def packed(self) -> "PackedPieces":
        """The obstacles, then the bodies of the arm in the frames of their links."""
        from vdsm_pin.arm.bodies import arm_bodies  # compiled code, which few need
        from vdsm_pin.geometry.pieces import pack_pieces

        bodies = [[body.piece] for body in arm_bodies(self.manipulator)]
        obstacles = [obstacle.pieces for obstacle in self.scene.obstacles]
        return pack_pieces([*obstacles, *bodies])

    @property
    def packed_obstacles(self) -> "PackedPieces":
        """The obstacles alone, as views of the same."""
        from vdsm_pin.geometry.pieces import first_groups

        return first_groups(self.packed, len(self.scene.obstacles))

    @property
    def path(self) -> DesiredPath:
        """What the tip shall draw, of a problem that says so.

        Raises:
            InvalidInput: If the tip shall draw nothing.
        """
        if self.tip_path is None:
            message = f"problem {self.name!r} has no tip_path: there is nothing to draw"
            raise InvalidInput(message)
        return self.tip_path

    def in_file(self, point: FloatArray) -> str:
        """A point of the base frame as messages tell it: in the file's frame, in mm."""
        moved = self.T_world_base[:3, :3] @ point + self.T_world_base[:3, 3]
        moved = MM_PER_M * moved
        return f"({', '.join(f'{value:.1f}' for value in moved.round(1) + 0.0)}) mm"

    @property
    def begin(self) -> Posture | None:
        """Where a motion begins; None where anywhere will do."""
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

    def read_from(self, source: ProblemSource | None) -> "PlanningProblem":
        """The same problem, known to stand in these files."""
        same = replace(self)
        object.__setattr__(same, "source", source)
        return same
