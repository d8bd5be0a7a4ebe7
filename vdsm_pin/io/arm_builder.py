"""The arm of a problem file to a `Manipulator`, in metres and radians."""

from dataclasses import dataclass
from typing import Final, TypeAlias, cast

import numpy as np

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.manipulator import BUILT_IN, FEED, TOOL, Manipulator, built_in
from vdsm_pin.arm.mounted import BodySolid, Feed, LinkBody, Tool
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io import arm_schema as schema
from vdsm_pin.io.frames import Builder, radians
from vdsm_pin.io.obstacle_builder import ObstacleBuilder
from vdsm_pin.io.problem_errors import ErrorCollector
from vdsm_pin.io.urdf_arm import read_urdf_arm
from vdsm_pin.io.yaml_reader import Location
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import UNITS_PER_METRE

DEFAULT_HOLE_RADIUS: Final = 0.8
"""Radius of the circle of cable holes over the body radius; [-]."""

DEFAULT_HALF_GAP: Final = 0.1
"""Half gap of a joint over the shortest link; [-]."""

DEFAULT_STROKE: Final = 2.0
"""Stroke of the rail either way over the arm's length; [-]."""


ArmModel: TypeAlias = str | schema.ManipulatorModel | schema.UrdfManipulatorModel


@dataclass(frozen=True)
class ArmBuilder(Builder):
    """Converts an arm.

    Args:
        at: Where the arm stands in the file.
    """

    at: Location = ("manipulator",)

    def build(self, model: ArmModel) -> Manipulator:
        """The arm by name, by its numbers, or from a URDF.

        Raises:
            InvalidFile: If the name is unknown or the numbers do not fit together.
        """
        if isinstance(model, str):
            if model not in BUILT_IN:
                fault = f"is {model!r}; known: {', '.join(BUILT_IN)}, or a mapping"
                raise self.invalid(self.at, fault)
            return built_in(model)
        if isinstance(model, schema.UrdfManipulatorModel):
            return self._from_urdf(model)
        errors, lengths = ErrorCollector(), self.frame.metres(model.link_lengths)
        radii = errors.attempt(self._radii, model)
        tool = None
        if model.tool:
            size = model.tool.length, model.tool.radius
            tool = Tool(*(float(x) for x in self.frame.metres(size)))
            lengths[-1] += tool.length
        bodies = errors.attempt(self._bodies, model, float(lengths.sum()))
        rail = errors.attempt(self._rail, model, float(lengths.sum()))
        thin = float(np.min(model.link_radius))
        cables = errors.attempt(self._cables, model.cables, model.link_lengths, thin)
        errors.raise_if_any()
        assert radii is not None and bodies is not None
        assert rail and cables  # what is None was raised
        with self.document.naming(self.at):
            return Manipulator(
                name=model.name,
                link_lengths=lengths,
                link_radius=float(radii.max()),
                max_link_angle=float(radians(model.max_link_angle_deg)),
                max_joint_angle=float(radians(model.max_joint_angle_deg)),
                base_range=rail,
                cables=cables,
                radii=radii if isinstance(model.link_radius, list) else None,
                tool=tool,
                feed=self._feed(model, float(radii[0])),
                bodies=bodies,
                ignore_pairs=tuple((a, b) for a, b in model.ignore_pairs),
            )

    def _rail(
        self, model: schema.ManipulatorModel, length: float
    ) -> tuple[float, float]:
        """Where the base may stand; twice the arm's length either way if not stated."""
        low, high = -DEFAULT_STROKE * length, DEFAULT_STROKE * length
        if model.base_range is not None:
            low, high = (float(x) for x in self.frame.metres(model.base_range))
            if not low <= high:
                fault = f"is {model.base_range}, expected the smaller value first"
                raise self.invalid((*self.at, "base_range"), fault)
        self._check_extent(length, max(-low, high))
        return low, high

    def _radii(self, model: schema.ManipulatorModel) -> FloatArray:
        """Radius of every link; [m]."""
        count = len(model.link_lengths)
        if not isinstance(model.link_radius, list):
            return np.full(count, self.frame.metres(model.link_radius))
        at = (*self.at, "link_radius")
        self.check_count(at, model.link_radius, count, "values", "link")
        return self.frame.metres(model.link_radius)

    def _feed(self, model: schema.ManipulatorModel, radius: float) -> Feed | None:
        """What is behind the first joint, as thick as the first link if not stated."""
        if model.feed is None:
            return None
        if model.feed.radius is not None:
            radius = float(self.frame.metres(model.feed.radius))
        return Feed(float(self.frame.metres(model.feed.length)), radius)

    def _bodies(
        self, model: schema.ManipulatorModel, arm_length: float
    ) -> tuple[LinkBody, ...]:
        """What the links carry, in their frames."""
        at, count = (*self.at, "bodies"), len(model.link_lengths)
        for i, body in enumerate(model.bodies):
            if body.link > count:
                fault = f"is {body.link}, expected 1 to {count}"
                raise self.invalid((*at, i, "link"), fault)
            if body.name in (TOOL, FEED):
                fault = f"is {body.name!r}, which the arm's own is called"
                raise self.invalid((*at, i, "name"), fault)
        own = self.reading.in_own_frame()
        reader = ObstacleBuilder(own, arm_length, "its joint")
        solids = cast("tuple[BodySolid, ...]", reader.build_all(model.bodies, at))
        parts = (getattr(body, "parts", 1) for body in model.bodies)
        links = (body.link for body in model.bodies)
        return tuple(map(LinkBody, links, solids, parts))

    def _from_urdf(self, model: schema.UrdfManipulatorModel) -> Manipulator:
        """The arm of a URDF; its bytes belong to the problem as those of meshes do."""
        found = self.reading.read(model.urdf, read_urdf_arm)
        low, high = found.base_range
        self._check_extent(float(found.link_lengths.sum()), max(-low, high))
        unit = UNITS_PER_METRE[self.frame.unit]
        lengths = (unit * found.link_lengths).tolist()
        with self.document.naming((*self.at, "urdf")):
            return Manipulator(
                name=found.name,
                link_lengths=found.link_lengths,
                link_radius=found.link_radius,
                max_link_angle=float(radians(model.max_link_angle_deg)),
                max_joint_angle=found.max_joint_angle,
                base_range=found.base_range,
                cables=self._cables(model.cables, lengths, unit * found.link_radius),
            )

    def _check_extent(self, length: float, stroke: float) -> None:
        """Distances are proved within a stated extent only, so the arm stays there."""
        limit = TOLERANCES.scene_extent
        if not length + stroke <= limit:
            fault = (
                f"is an arm of {self.frame.shown(length)} on a rail that goes "
                f"{self.frame.shown(stroke)} out; expected at most "
                f"{self.frame.shown(limit)} together"
            )
            raise self.invalid(self.at, fault)

    def _cables(
        self,
        cables: schema.CablesModel | None,
        link_lengths: list[float],
        radius: float,
    ) -> CableLayout:
        """Cable holes; lengths in the file's unit."""
        count, shortest = len(link_lengths), min(link_lengths)
        hole_radius = DEFAULT_HOLE_RADIUS * radius
        half_gap = DEFAULT_HALF_GAP * shortest
        angles = paper_hole_angles(count)
        if cables is not None:
            at = (*self.at, "cables")
            hole_radius, half_gap = cables.hole_radius, cables.half_gap
            if not hole_radius < radius:
                fault = f"is {hole_radius:g}, expected below the body radius {radius:g}"
                raise self.invalid((*at, "hole_radius"), fault)
            if not 2.0 * half_gap < shortest:
                fault = (
                    f"is {half_gap:g}, expected below half the shortest link "
                    f"{shortest:g}"
                )
                raise self.invalid((*at, "half_gap"), fault)
            if cables.hole_angles_deg is not None:
                at, rows = (*at, "hole_angles_deg"), cables.hole_angles_deg
                self.check_count(at, rows, count, "rows", "link")
                angles = radians(cables.hole_angles_deg)
        metres = self.frame.metres([hole_radius, half_gap])
        return CableLayout(float(metres[0]), float(metres[1]), angles)
