"""Mesh files to triangles in the order of the file, and how large they are.

No vertex is moved: corners are joined only where they are equal to the last bit, so
that a proof about these triangles is a proof about the file.
"""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray, first_equal
from vdsm_pin.io.frames import Frame
from vdsm_pin.io.meshes.obj import read_obj
from vdsm_pin.io.meshes.ply import read_ply
from vdsm_pin.io.meshes.raw import MeshStream, RawMesh
from vdsm_pin.io.meshes.stl import read_stl
from vdsm_pin.io.obstacle_schema import FromFileModel
from vdsm_pin.io.source import Digest, check_ending, opened
from vdsm_pin.io.yaml_reader import Location, YamlDocument
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import UNITS_PER_METRE

MAX_MESH_BYTES: Final = 1 << 30


def _read_glb(stream: MeshStream) -> RawMesh:
    from vdsm_pin.io.meshes.glb import read_glb  # models that few meshes need

    return read_glb(stream)


def _read_dae(stream: MeshStream) -> RawMesh:
    from vdsm_pin.io.meshes.dae import read_dae  # XML, which few meshes need

    return read_dae(stream)


_READERS: Final[dict[str, Callable[[MeshStream], RawMesh]]] = {
    ".stl": read_stl,
    ".obj": read_obj,
    ".ply": read_ply,
    ".glb": _read_glb,
    ".dae": _read_dae,
}


def read_mesh(path: Path, digest: Digest | None = None) -> RawMesh:
    """The triangles of a mesh file.

    Args:
        path: The file; its ending tells the format.
        digest: Gets every byte of the file.

    Raises:
        InvalidFile: If the file cannot be read, is of another kind, is damaged, has no
            triangle, or has a coordinate that is not finite.
    """
    kind = check_ending(path, _READERS)
    digest = hashlib.sha256() if digest is None else digest
    with opened(path, limit=MAX_MESH_BYTES, digest=digest) as (size, content):
        raw = _READERS[kind](MeshStream(path, size, content))
    if not len(raw.triangles):
        raise InvalidFile(file=path, fault="has no triangle")
    used = np.zeros(len(raw.vertices), dtype=np.bool_)
    used[raw.triangles] = True
    vertices = raw.vertices[used]
    first, index = first_equal(vertices)
    triangles = index[(np.cumsum(used) - 1)[raw.triangles]]
    return replace(raw, vertices=vertices[first], triangles=triangles)


_THOUSAND: Final = 1e3
"""By which a unit taken for the other one is off."""


@dataclass(frozen=True)
class MeshSize:
    """The size of a mesh in a problem.

    Args:
        model: What the problem says of it.
        frame: The problem's frame and unit.
        extents: Size of the mesh along its axes, shape (3,), in its own unit.
        scale: Units of the problem per unit of the mesh.
        stated: Whether the problem or the mesh's file states its unit or scale.
    """

    model: FromFileModel
    frame: Frame
    extents: FloatArray
    scale: float
    stated: bool

    @classmethod
    def of(
        cls,
        points: FloatArray,
        model: FromFileModel,
        frame: Frame,
        unit: float | None = None,
    ) -> "MeshSize":
        """The size of points; the problem has the first word, then their file.

        Args:
            points: Shape (n, 3), in their own unit.
            model: What the problem says of them.
            frame: The problem's frame and unit.
            unit: Metres per unit as their file states it; None where it does not.
        """
        stated, per_unit = True, 1.0
        if model.length_unit is not None:
            here, there = (UNITS_PER_METRE[u] for u in (frame.unit, model.length_unit))
            per_unit = here / there
        elif unit is not None:
            per_unit = unit * UNITS_PER_METRE[frame.unit]
        else:
            stated = "scale" in model.model_fields_set
        extents = np.ptp(points, axis=0)
        return cls(model, frame, extents, model.scale * per_unit, stated)

    @property
    def shown(self) -> str:
        """The size in words, 12 x 3 x 0.6 mm; nothing scales what is not stated."""
        sides = " x ".join(f"{side:.4g}" for side in self.extents)
        return f"{sides} {self.frame.unit}"

    @property
    def diagonal(self) -> float:
        """Of the box around the mesh; [m]."""
        return float(self.frame.metres(np.linalg.norm(self.extents) * self.scale))

    def bent(self, bend: float) -> tuple[str, ...]:
        """What to say where faces are not flat.

        Args:
            bend: How far they are off their planes, in the mesh's unit.
        """
        if not bend > TOLERANCES.flat_face * np.linalg.norm(self.extents):
            return ()
        off = f"{bend * self.scale:.3g} {self.frame.unit}"
        return (
            f"faces bent by up to {off} are cut into triangles one way of several, all "
            f"within {off}; an obstacle error of as much covers them",
        )

    def check(self, arm_length: float, document: YamlDocument, at: Location) -> None:
        """Refuse a size that must be one in another unit, and ask where it may be.

        Args:
            arm_length: What the size is held against; [m].
            document: The problem file, for messages.
            at: The obstacle in it.

        Raises:
            InvalidFile: If the mesh is far too large or small; or rather small, taken
                in millimetres without a word, and of a usual size in metres.
        """
        if not self.diagonal:  # a single point
            return
        low, high = TOLERANCES.mesh_size_low, TOLERANCES.mesh_size_high
        ratio = self.diagonal / arm_length
        beside = f"beside an arm of {self.frame.shown(arm_length)}"
        if not low <= ratio <= high:
            factor = 1.0 / _THOUSAND if ratio > 1.0 else _THOUSAND
            fault = (
                f"makes {self.model.file!r} {self.frame.shown(self.diagonal)} large "
                f"{beside}; if the file is in another unit, try "
                f"scale: {self.model.scale * factor:g}, else set check_size: false"
            )
            raise document.invalid((*at, "scale"), fault)
        millimetres = not self.stated and self.frame.unit == "mm"
        if millimetres and ratio * _THOUSAND <= high:
            size = f"{self.diagonal * UNITS_PER_METRE['mm']:.4g}"
            fault = (
                f"{self.model.file!r} states no unit and is {size} mm or {size} m "
                f"large {beside}; expected length_unit: mm or length_unit: m"
            )
            raise document.invalid((*at, "file"), fault)
