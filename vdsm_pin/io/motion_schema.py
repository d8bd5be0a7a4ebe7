"""Obstacles of the problem file that may move, as pydantic models."""

from typing import Annotated, TypeAlias

from pydantic import Field

from vdsm_pin.io import obstacle_schema as shapes
from vdsm_pin.io.schema_types import FileModel, Number, Vector


class MotionModel(FileModel):
    """How an obstacle moves: its frame stands at the file's origin without."""

    times_s: Annotated[list[Number], Field(min_length=1)] = Field(
        description="When it passes its knots, rising; at rest before the first and "
        "after the last [s]."
    )
    positions: list[Vector] | None = Field(
        default=None,
        description="Of its frame's origin at each time [length_unit]. Default: the "
        "file's origin.",
    )
    rpy_deg: list[Vector] | None = Field(
        default=None,
        description="Roll, pitch, yaw of its frame at each time, R = Rz Ry Rx [deg]. A "
        "point c of the obstacle stands at position + R c; from knot to knot all six "
        "numbers change evenly, whole turns count. Default: not turned.",
    )


class _CanMove(FileModel):
    motion: MotionModel | None = Field(
        default=None,
        description="How it moves. Default: at rest. Trajectories then need a column "
        "time_s.",
    )


class SphereObstacle(_CanMove, shapes.SphereModel):
    """A ball."""


class CapsuleObstacle(_CanMove, shapes.CapsuleModel):
    """A segment grown by a radius."""


class CylinderObstacle(_CanMove, shapes.CylinderModel):
    """A solid cylinder with flat ends."""


class BoxObstacle(_CanMove, shapes.BoxModel):
    """A cuboid."""


class PrismObstacle(_CanMove, shapes.PrismModel):
    """A simple polygon swept along an axis; it need not be convex."""


class HalfSpaceObstacle(_CanMove, shapes.HalfSpaceModel):
    """Everything on one side of a plane: solid where (p - point) . normal <= 0."""


class MeshObstacle(_CanMove, shapes.MeshModel):
    """Triangles from an STL, OBJ, PLY, GLB or DAE file, solid where they close."""


class PointsObstacle(_CanMove, shapes.PointsModel):
    """Measured points from a PLY, PCD, XYZ, TXT, CSV or NPY file."""


class VoxelsObstacle(_CanMove, shapes.VoxelsModel):
    """Occupied cells: their centres, or a NPY array of true and false."""


MovableModel: TypeAlias = Annotated[
    CylinderObstacle
    | PrismObstacle
    | SphereObstacle
    | CapsuleObstacle
    | BoxObstacle
    | HalfSpaceObstacle
    | MeshObstacle
    | PointsObstacle
    | VoxelsObstacle,
    Field(discriminator="shape"),
]
