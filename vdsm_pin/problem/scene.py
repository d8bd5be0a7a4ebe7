"""Obstacles, at rest and moving, in the base frame."""

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Final, TypeAlias, cast

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.convex import Piece
from vdsm_pin.geometry.primitives import NamedSolid
from vdsm_pin.geometry.solids import ConvexCover, Mesh, Solid
from vdsm_pin.notebook import Summarised
from vdsm_pin.proof.tree import Kind, Tree
from vdsm_pin.tolerances import TOLERANCES

if TYPE_CHECKING:  # it brings compiled code, for which readers need not wait
    from vdsm_pin.arm.manipulator import Manipulator
    from vdsm_pin.geometry.pieces import PackedPieces
    from vdsm_pin.problem.trajectory import Trajectory
    from vdsm_pin.proof.paths import Path


SHOWN: Final = 8
"""Names of obstacles that a console shows."""


@dataclass(frozen=True, eq=False)
class ByItself:
    """What is known of another arm or robot, beside where its bodies are.

    Args:
        notes: What a reader should know, a sentence each.
        covers: By link, of each of its meshes the triangles under each hull, or the
            primitive around it, where that is not one hull each.
        arm: It, where it is a snake arm, and its motion.
        checks: Rows of evidence about it alone where it is none, such as its limits.
    """

    notes: tuple[str, ...] = ()
    covers: Mapping[str, Sequence[Any]] = field(default_factory=dict)
    arm: "tuple[Manipulator, Trajectory] | None" = None
    checks: Callable[[], Sequence[Any]] = tuple


@dataclass(frozen=True, eq=False)
class Carrier:
    """Joints that carry obstacles about as time goes by.

    Args:
        tree: The joints, hung on the base's frame.
        path: How they move, with times; at rest before and after.
        robot: Name of the other robot that it is; empty for what only moves.
        itself: What is known of that.
    """

    tree: Tree
    path: "Path"
    robot: str = ""
    itself: ByItself = ByItself()

    def poses(self, times: FloatArray) -> FloatArray:
        """T_base_frame of all frames at some times (m,), (m, n_frames, 4, 4); [m]."""
        return self.tree.poses(self.path.at(times))

    @cached_property
    def reach(self) -> float:
        """No frame is ever farther from the base's origin than this; [m]."""
        far, most = 0.0, self.path.reach
        for joint in self.tree.joints:
            far += float(np.linalg.norm(np.asarray(joint.placement)[:3, 3]))
            if joint.kind is Kind.PRISMATIC:
                moved = 0.0 if joint.column is None else float(most[joint.column])
                far += abs(joint.offset) + abs(joint.ratio) * moved
        return far


@dataclass(frozen=True)
class Moving:
    """A solid that moves.

    Args:
        solid: In the frame that carries it.
        carrier: The joints that move it; several solids may share one carrier.
        frame: Number of the carrier's frame that the solid is fixed to, from 1.
    """

    solid: "Solid | ConvexCover"
    carrier: Carrier
    frame: int

    @property
    def name(self) -> str:
        """Name of the solid."""
        return self.solid.name

    @property
    def pieces(self) -> Sequence[Piece]:
        """The convex pieces, in the frame that carries them."""
        return self.solid.pieces

    def poses(self, times: FloatArray) -> FloatArray:
        """T_base_solid at some times (m,), shape (m, 4, 4); [m]."""
        return np.asarray(self.carrier.poses(times)[:, self.frame])


Obstacle: TypeAlias = Solid | Moving


def solid_of(obstacle: Obstacle) -> Solid:
    """The solid that an obstacle is, in its own frame where it moves."""
    found = obstacle.solid if isinstance(obstacle, Moving) else obstacle
    return cast("Solid", found)


def reach_of(obstacle: Obstacle | ConvexCover) -> float:
    """Largest distance of an obstacle from the base's origin, at any time; [m].

    For a half-space it is the distance of the stated point.
    """
    if isinstance(obstacle, Moving):
        return obstacle.solid.reach + obstacle.carrier.reach
    return obstacle.reach


@dataclass(frozen=True, repr=False)
class Scene(Summarised):
    """All obstacles of one problem, in the base frame.

    Args:
        obstacles: Any number, names unique, within `TOLERANCES.scene_extent`.

    Raises:
        InvalidInput: If two share a name, or one is too far from the base.

    Example:
        >>> ball = vp.Sphere("ball", np.array([1.0, 0.5, 0.0]), 0.1)
        >>> vp.Scene((ball,)).names
        ('ball',)
    """

    obstacles: tuple[Obstacle, ...] = ()

    def __post_init__(self) -> None:
        """Refuse duplicate names, and what distances are not proved for."""
        given: Any = self.obstacles  # of callers whom no type checker told
        if not isinstance(given, Iterable):
            message = f"obstacles is a {type(given).__name__}, expected a list of them"
            raise InvalidInput(message)
        object.__setattr__(self, "obstacles", tuple(given))
        for obstacle in self.obstacles:
            if not isinstance(obstacle, NamedSolid | ConvexCover | Moving):
                found = type(obstacle).__name__
                message = f"expected obstacles, as Sphere or Box; found {found}"
                raise InvalidInput(message)
            with np.errstate(over="ignore"):  # too far, as is said
                reach = reach_of(obstacle)
            if not reach <= TOLERANCES.scene_extent:
                message = (
                    f"obstacle {obstacle.name!r} reaches {reach:.6g} m from the base, "
                    f"expected at most {TOLERANCES.scene_extent:g} m"
                )
                raise InvalidInput(message)
        seen: set[str] = set()
        for name in self.names:
            if name in seen:
                message = f"two obstacles are named {name!r}; names are unique"
                raise InvalidInput(message)
            seen.add(name)

    def summary(self) -> tuple[tuple[str, str], ...]:
        """How many obstacles there are, what they are, and which."""
        kinds = Counter(type(solid_of(one)).__name__ for one in self.obstacles)
        counted = (f"{count} {kind}" for kind, count in kinds.items())
        more = ", ..." if len(self.names) > SHOWN else ""
        return (
            ("obstacles", ", ".join(counted) or "none"),
            ("names", ", ".join(self.names[:SHOWN]) + more or "-"),
            ("that move", str(len(self.moving))),
        )

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Names in file order."""
        return tuple(obstacle.name for obstacle in self.obstacles)

    @property
    def moving(self) -> tuple[Moving, ...]:
        """The obstacles that move, in file order."""
        return tuple(one for one in self.obstacles if isinstance(one, Moving))

    @property
    def at_rest(self) -> "Scene":
        """The scene without the obstacles that move."""
        still = (one for one in self.obstacles if not isinstance(one, Moving))
        return Scene(tuple(still)) if self.moving else self

    @property
    def rest_time(self) -> float:
        """From when on nothing moves; -inf where nothing ever does; [s]."""
        ends = (one.path.own_times[-1] for one in self.carriers)
        return float(max(ends, default=-np.inf))

    @property
    def start_time(self) -> float:
        """When the first one begins to move; inf where nothing ever does; [s]."""
        begins = (one.path.own_times[0] for one in self.carriers)
        return float(min(begins, default=np.inf))

    def at_time(self, time: float) -> "Scene":
        """The scene as it stands at a time, nothing of it moving any more; [s]."""
        when = np.array([time])
        return Scene(
            tuple(
                solid_of(one).placed(one.poses(when)[0])
                if isinstance(one, Moving)
                else one
                for one in self.obstacles
            )
        )

    @property
    def carriers(self) -> tuple[Carrier, ...]:
        """The carriers of the obstacles that move, each once."""
        return tuple(dict.fromkeys(one.carrier for one in self.moving))


def with_hulls(scene: Scene, names: Collection[str]) -> Scene:
    """A scene with the convex hulls of some meshes in their places.

    For whoever asks obstacles for their names and pieces alone: proofs and planners.

    Args:
        scene: All obstacles.
        names: Of meshes.
    """
    obstacles: list[Obstacle | ConvexCover] = []
    for one in scene.obstacles:
        solid = solid_of(one)
        if not isinstance(solid, Mesh) or one.name not in names:
            obstacles.append(one)
        elif isinstance(one, Moving):
            obstacles.append(replace(one, solid=solid.hull))
        else:
            obstacles.append(solid.hull)
    return Scene(tuple(cast("list[Obstacle]", obstacles)))


def covers_of(obstacles: Sequence[Obstacle], pieces: "PackedPieces") -> IntArray:
    """How the pieces of obstacles count where an inside is asked for, (n_pieces,).

    Args:
        obstacles: Any.
        pieces: The packed pieces of these obstacles.
    """
    covers = np.zeros(len(pieces.kind), np.int64)
    for k, mesh in enumerate(obstacles):
        if isinstance(mesh, Mesh) and mesh.has_inside:
            mine = slice(pieces.first_piece[k], pieces.first_piece[k + 1])
            covers[mine] = mesh.closed_mesh.covers[pieces.order[mine]]
    return covers
