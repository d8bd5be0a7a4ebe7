"""Solids of a problem file, obstacles and what links carry, in metres."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import singledispatchmethod
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry import solids
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io import obstacle_schema as schema
from vdsm_pin.io.clouds import read_cloud
from vdsm_pin.io.frames import Builder
from vdsm_pin.io.mesh_file import MeshSize, read_mesh
from vdsm_pin.io.motion_field import FLOATING, MotionModel, MovableModel
from vdsm_pin.io.problem_errors import ErrorCollector
from vdsm_pin.io.source import Digest
from vdsm_pin.io.yaml_reader import Location
from vdsm_pin.problem import scene
from vdsm_pin.units import UNITS_PER_METRE

T = TypeVar("T")

AXES: Final = {"x": 0, "y": 1, "z": 2}
_LINK_NAME: Final = re.compile(r"link ?\d+", re.IGNORECASE)


def unit_vector(vector: FloatArray) -> FloatArray | None:
    """A vector scaled to length 1, or None where it has no direction."""
    largest = float(np.abs(vector).max())
    if not 0.0 < largest < np.inf:
        return None
    scaled = vector / largest  # neither overflows nor underflows when squared
    return np.asarray(scaled / np.linalg.norm(scaled))


@dataclass(frozen=True)
class ObstacleBuilder(Builder):
    """Converts the obstacles of one file.

    Args:
        arm_length: For judging the size of a mesh; None where nobody knows; [m].
        origin: What the frame's origin is called.
    """

    arm_length: float | None
    origin: str = "the base"

    def build_scene(
        self, models: Sequence[MovableModel], arm: Manipulator | None
    ) -> scene.Scene:
        """All obstacles, in file order.

        Args:
            models: Of the file.
            arm: Whose bodies have names too; None where nobody knows.

        Raises:
            InvalidFile: If one is not a solid, has a body's name, or two share one.
        """

        def check(model: MovableModel, at: Location) -> None:
            if arm is not None and arm.owner_of(model.name) in arm.body_names:
                fault = f"is {model.name!r}, which a body of the arm is called"
                raise self.invalid((*at, "name"), fault)

        errors, at = ErrorCollector(), ("obstacles",)
        obstacles = errors.attempt(self.build_all, models, at)
        for i, model in enumerate(models):
            errors.attempt(check, model, (*at, i))
        errors.raise_if_any()
        return scene.Scene(obstacles or ())

    def build_all(
        self, models: Sequence[Any], at: Location
    ) -> tuple[scene.Obstacle, ...]:
        """All solids of a list of the file, in its order.

        Args:
            models: Models of shapes.
            at: Where the list is.

        Raises:
            InvalidFile: If one is not a solid, has a link's name, or two share one.
        """
        first: dict[str, int] = {}
        errors = ErrorCollector()
        found = []
        for i, model in enumerate(models):
            same = first.setdefault(model.name, i)
            errors.attempt(self._check_name, model.name, (*at, i), same)
            found.append(errors.attempt(self._checked, model, (*at, i)))
        errors.raise_if_any()
        return tuple(one for one in found if one is not None)

    def _check_name(self, name: str, at: Location, first: int) -> None:
        """Refuse the name of a link, and one that an entry before it has."""
        *_, where, i = at
        if _LINK_NAME.fullmatch(name):
            fault = f"is {name!r}, which is how links of the arm are named"
            raise self.invalid((*at, "name"), fault)
        if first != i:
            fault = f"is {name!r}, which {where}[{first}] is called already"
            raise self.invalid((*at, "name"), f"{fault}; names are unique")

    def _checked(self, model: Any, at: Location) -> scene.Obstacle:
        motion: MotionModel | None = getattr(model, "motion", None)
        with self.document.naming(at):
            if motion is None:
                obstacle: scene.Obstacle = self.build(model, at)
            else:
                obstacle = self._moving(model, motion, at)
        reach, what = scene.reach_of(obstacle), f"{obstacle.name!r} reaches"
        self.check_extent(at, reach, what, self.origin)
        return obstacle

    def _moving(self, model: Any, motion: MotionModel, at: Location) -> scene.Moving:
        """An obstacle in its own frame, and what carries it."""
        own = replace(self, reading=self.reading.in_own_frame())
        solid = own.build(model, at)
        path = motion.carrier(self.frame, self.document, (*at, "motion"))
        return scene.Moving(solid, path, FLOATING)

    @singledispatchmethod
    def build(self, model: object, at: Location) -> solids.Solid:
        """One obstacle, in the frame of the base."""
        raise NotImplementedError(type(model))

    @build.register
    def _(self, model: schema.SphereModel, at: Location) -> solids.Solid:
        radius = float(self.frame.metres(model.radius))
        return solids.Sphere(model.name, self.frame.point(model.center), radius)

    @build.register
    def _(self, model: schema.CylinderModel, at: Location) -> solids.Solid:
        return self._round(solids.Cylinder, model, at)

    @build.register
    def _(self, model: schema.CapsuleModel, at: Location) -> solids.Solid:
        return self._round(solids.Capsule, model, at)

    def _round(
        self,
        make: Callable[..., solids.Solid],
        model: schema.CylinderModel | schema.CapsuleModel,
        at: Location,
    ) -> solids.Solid:
        if isinstance(model.axis, str):
            vector = np.eye(3)[AXES[model.axis]]
        else:
            vector = self._unit(model.axis, (*at, "axis"))
        return make(
            model.name,
            self.frame.point(model.center),
            self.frame.direction(vector),
            float(self.frame.metres(model.length)) / 2.0,
            float(self.frame.metres(model.radius)),
        )

    @build.register
    def _(self, model: schema.BoxModel, at: Location) -> solids.Solid:
        centre, half_size = self.frame.point(model.center), np.array(model.size) / 2.0
        rotation = self.frame.orientation(model.rpy_deg)
        return solids.Box(model.name, centre, rotation, self.frame.metres(half_size))

    @build.register
    def _(self, model: schema.PrismModel, at: Location) -> solids.Solid:
        if not model.from_ < model.to:
            fault = f"is {model.to:g}, expected above from = {model.from_:g}"
            raise self.invalid((*at, "to"), fault)
        polygon = np.array(model.polygon)
        self._check_simple(without_repeats(polygon, closed=True), (*at, "polygon"))
        # Columns: the two axes of the section, then the sweep; right-handed.
        order = np.roll(np.arange(3), -1 - AXES[model.axis])
        base = self.frame.origin[order]
        low, high = self.frame.metres(np.array([model.from_, model.to]) - base[2])
        if not low < high:
            fault = f"is {model.to!r}, too near to from = {model.from_!r}"
            raise self.invalid((*at, "to"), fault)
        return solids.Prism(
            model.name,
            np.zeros(3),
            self.frame.rotation.T[:, order],
            without_repeats(self.frame.metres(polygon - base[:2]), closed=True),
            (float(low), float(high)),
        )

    def _check_simple(self, polygon: FloatArray, at: Location) -> None:
        import shapely

        hull = shapely.MultiPoint(polygon).convex_hull
        if not hull.area > 0.0:
            raise self.invalid(at, "encloses no area")
        shape = shapely.Polygon(polygon)
        if not shape.is_valid:
            reason = shapely.is_valid_reason(shape)
            fault = f"crosses or touches itself ({reason}); expected a simple polygon"
            raise self.invalid(at, fault)

    @build.register
    def _(self, model: schema.HalfSpaceModel, at: Location) -> solids.Solid:
        unit = self._unit(model.normal, (*at, "normal"))
        normal = self.frame.direction(unit)
        foot = self.frame.height(model.point, model.normal) * normal
        return solids.HalfSpace(model.name, foot, normal)

    @build.register
    def _(self, model: schema.MeshModel, at: Location) -> solids.Solid:
        mesh = self._read(read_mesh, model, at)
        size = MeshSize.of(mesh.vertices, model, self.frame, mesh.unit)
        found = solids.Mesh(
            model.name,
            self._placed(mesh.vertices, size, at),
            mesh.triangles,
            model.solid,
            assumed_size="" if size.stated else size.shown,
            notes=(*mesh.notes, *size.bent(mesh.bend)),
        )
        if model.solid and not found.closed_mesh.closed:
            fault = f"is true, but {model.file!r} {found.closed_mesh.why_open}"
            raise self.invalid((*at, "solid"), fault)
        return found

    @build.register
    def _(self, model: schema.PointsModel, at: Location) -> solids.Solid:
        cloud = self._read(read_cloud, model, at)
        if cloud.grid:
            fault = f"{model.file!r} is a grid of cells; expected points, or "
            raise self.invalid((*at, "file"), fault + "shape: voxels")
        size = MeshSize.of(cloud.points, model, self.frame)
        return solids.PointCloud(
            model.name,
            self._placed(cloud.points, size, at),
            float(self.frame.metres(model.radius)),
            assumed_size="" if size.stated else size.shown,
            notes=cloud.notes,
        )

    @build.register
    def _(self, model: schema.VoxelsModel, at: Location) -> solids.Solid:
        cloud = self._read(read_cloud, model, at)
        points, edges = cloud.points, np.array(model.size)
        stray = [
            key for key in ("length_unit", "scale") if key in model.model_fields_set
        ]
        if cloud.grid and stray:
            fault = f"has no meaning: {model.file!r} is a grid, whose cells are `size`"
            raise self.invalid((*at, stray[0]), fault)
        points = points * edges if cloud.grid else points
        # A grid is in the problem's unit, as the size of its cells.
        unit = 1.0 / UNITS_PER_METRE[self.frame.unit] if cloud.grid else None
        size = MeshSize.of(points, model, self.frame, unit)
        return solids.Voxels(
            model.name,
            self._placed(points, size, at),
            self.frame.orientation(model.rpy_deg),
            self.frame.metres(edges / 2.0),
            assumed_size="" if size.stated else size.shown,
            notes=cloud.notes,
        )

    def _read(
        self,
        reader: Callable[[Path, Digest], T],
        model: schema.FromFileModel,
        at: Location,
    ) -> T:
        """The content of an obstacle's own file."""
        try:
            return self.reading.read(model.file, reader)
        except InvalidFile as error:
            at = (*at, "file")
            raise self.document.invalid_file(at, model.file, error) from None

    def _placed(self, points: FloatArray, size: MeshSize, at: Location) -> FloatArray:
        """Points of a file in the base frame, of a size that is no slip; [m]."""
        model = size.model
        if model.check_size and self.arm_length is not None:
            size.check(self.arm_length, self.document, at)
        return self.frame.placed(points, size.scale, model.rpy_deg, model.center)

    def _unit(self, vector: list[float], at: Location) -> FloatArray:
        unit = unit_vector(np.array(vector))
        if unit is None:
            raise self.invalid(at, f"is {vector}, which has no direction")
        return unit


def without_repeats(points: FloatArray, *, closed: bool) -> FloatArray:
    """Points without those equal to the one before; of a closed line, the last too."""
    keep = np.ones(len(points), dtype=np.bool_)
    keep[1:] = (points[1:] != points[:-1]).any(axis=1)
    kept: FloatArray = points[keep]
    if closed and len(kept) > 1 and (kept[-1] == kept[0]).all():
        kept = kept[:-1]
    return kept
