"""The file's frame and unit against the base frame and the metre.

Coordinates in a file may be far larger than what is left of them beside the base. So
frames are subtracted first, in the file's unit, where a difference is rounded once;
what remains is converted and turned, and loses no more than its own size allows.
A `Builder` of a part of a problem file has the `Reading` of it.
"""

import math
from collections.abc import Callable, Sequence, Sized
from dataclasses import dataclass, field, replace
from fractions import Fraction
from pathlib import Path
from typing import Any, Final, TypeVar

import numpy as np

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.io.source import Digest
from vdsm_pin.io.yaml_reader import Location, YamlDocument
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import UNITS_PER_METRE

T = TypeVar("T")

PRECISION: Final = 256
"""Bits in which a mesh far from its own origin is turned about it.

Its coordinates and its scale reach 1e12 each, and what is left of them is wanted to
1e-14 m: 2^-130 of their product.
"""


def radians(degrees: object) -> FloatArray:
    """Angles of a file, any shape; whole turns are taken off exactly; [rad]."""
    values = np.asarray(degrees, dtype=np.float64)
    return np.asarray(np.deg2rad(np.fmod(values, 360.0)))


@dataclass(frozen=True)
class Frame:
    """The file's frame and unit.

    Args:
        unit: Name of the length unit.
        rotation: R_world_base, shape (3, 3); [-].
        origin: Origin of the base in the file's frame, shape (3,); [unit].
    """

    unit: str
    rotation: FloatArray
    origin: FloatArray

    @property
    def pose(self) -> FloatArray:
        """T_world_base: the base in the frame of the file, shape (4, 4); [m]."""
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = self.rotation, self.metres(self.origin)
        return pose

    def metres(self, lengths: object) -> FloatArray:
        """Lengths of the file in metres, any shape."""
        return np.asarray(lengths, dtype=np.float64) / UNITS_PER_METRE[self.unit]

    def shown(self, metres: float) -> str:
        """A length as the user would write it."""
        return f"{metres * UNITS_PER_METRE[self.unit]:.6g} {self.unit}"

    def point(self, lengths: object) -> FloatArray:
        """Points of the file in the base frame, shape (..., 3); [m]."""
        away = np.asarray(lengths, dtype=np.float64) - self.origin
        return self.metres(away) @ self.rotation

    def direction(self, vector: FloatArray) -> FloatArray:
        """A direction of the file in the base frame, shape (3,)."""
        return vector @ self.rotation

    def orientation(self, rpy_deg: list[float]) -> FloatArray:
        """Roll, pitch, yaw of the file as R_base_body, shape (3, 3)."""
        return self.rotation.T @ rotation_from_rpy(radians(rpy_deg))

    def height(self, point: Sequence[float], normal: Sequence[float]) -> float:
        """Height of a plane over the base's origin, along its normal; [m].

        Args:
            point: Any point of the plane, as the file has it; its coordinates may be
                large and cancel in the product.
            normal: Of any length but 0, as the file has it.
        """
        terms = zip(normal, point, self.origin.tolist(), strict=True)
        product = sum(Fraction(n) * (Fraction(p) - Fraction(o)) for n, p, o in terms)
        return float(self.metres(float(product / Fraction(math.hypot(*normal)))))

    def placed(
        self,
        vertices: FloatArray,
        scale: float,
        rpy_deg: list[float],
        center: list[float],
    ) -> FloatArray:
        """Vertices of a mesh in the base frame.

        Args:
            vertices: Shape (n, 3), n >= 1, in the mesh's unit and frame.
            scale: Units of the file per unit of the mesh.
            rpy_deg: Roll, pitch, yaw of the mesh; [deg].
            center: Where the mesh's origin goes; [unit].

        Returns:
            Shape (n, 3); [m].
        """
        pivot, shift = np.zeros(3), np.array(center) - self.origin
        reach = float(self.metres(np.abs(vertices).max() * scale))
        if not reach <= TOLERANCES.mesh_extent:
            pivot = vertices[0]
            shift = self._far_shift(pivot, scale, rpy_deg, center)
        turn = rotation_from_rpy(radians(rpy_deg))
        turned = ((vertices - pivot) * scale) @ turn.T
        return self.metres(turned + shift) @ self.rotation

    def _far_shift(
        self, pivot: FloatArray, scale: float, rpy_deg: list[float], center: list[float]
    ) -> FloatArray:
        """Where a vertex goes that lies far from the mesh's origin; [unit]."""
        from flint import arb, ctx  # only such a mesh needs it

        def balls(values: object) -> Any:
            entries = np.asarray(values, dtype=np.float64).tolist()
            return np.array([arb(value) for value in entries], dtype=object)

        with ctx.workprec(PRECISION):
            turn: Any = rotation_from_rpy(balls(rpy_deg) * arb.pi() / 180)
            place = turn @ (balls(pivot) * arb(scale)) + balls(center)
            return np.array([float(x) for x in place - balls(self.origin)])


@dataclass(frozen=True)
class Reading:
    """The file that is read.

    Args:
        document: The file, for messages.
        frame: Its unit and base.
        folder: Where relative paths start.
        digest: Gets the bytes of the files that it names, in the order of `files`.
        files: Those that it names, in the order in which they are read.
    """

    document: YamlDocument
    frame: Frame
    folder: Path
    digest: Digest
    files: list[Path] = field(default_factory=list)

    def read(self, name: str, reader: Callable[[Path, Digest], T]) -> T:
        """What a reader makes of a file that is named, whose bytes it hands on."""
        self.files.append(self.folder / name)
        return reader(self.files[-1], self.digest)

    def in_own_frame(self) -> "Reading":
        """The file as bodies are read that have a frame of their own."""
        return replace(self, frame=Frame(self.frame.unit, np.eye(3), np.zeros(3)))


@dataclass(frozen=True)
class Builder:
    """Converts a part of a file.

    Args:
        reading: The file.
    """

    reading: Reading

    @property
    def document(self) -> YamlDocument:
        """The file, for messages."""
        return self.reading.document

    @property
    def frame(self) -> Frame:
        """Its unit and base."""
        return self.reading.frame

    def invalid(self, at: Location, fault: str) -> InvalidFile:
        """The error that names a value by its field and line."""
        return self.document.invalid(at, fault)

    def check_count(
        self, at: Location, rows: Sized, count: int, noun: str, per: str
    ) -> None:
        """Refuse a list of another length.

        Raises:
            InvalidFile: If it has other than `count` values or rows (the noun), one
                per link or joint.
        """
        if len(rows) != count:
            fault = f"has {len(rows)} {noun}, expected {count}, one per {per}"
            raise self.invalid(at, fault)

    def check_extent(self, at: Location, reach: float, what: str, origin: str) -> None:
        """Distances are exact to a stated bound only within a stated extent.

        Args:
            at: The value.
            reach: How far it goes; [m].
            what: The message up to the length, as `'crate' reaches`.
            origin: From where, as `the base`.

        Raises:
            InvalidFile: If that is too far.
        """
        limit = TOLERANCES.scene_extent
        if not reach <= limit:
            far, most = self.frame.shown(reach), self.frame.shown(limit)
            fault = f"{what} {far} from {origin}, expected at most {most}"
            raise self.invalid(at, fault)
