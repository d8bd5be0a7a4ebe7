"""The convex solids of a robot's links, from its URDF and meshes."""

import xml.etree.ElementTree as ET
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, TypeAlias

import numpy as np

from vdsm_pin.arm.bodies import covering_points, grouped
from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray, IntArray, distinct_rows
from vdsm_pin.geometry.convex import FlatCylinder, Hull
from vdsm_pin.geometry.solids import BOX_CORNERS
from vdsm_pin.io.mesh_file import read_mesh
from vdsm_pin.io.xml_reader import origin_of
from vdsm_pin.robots.files import HULLS, MeshCover, find_mesh
from vdsm_pin.robots.hulls import covering_hull, covering_primitive
from vdsm_pin.text import plain_number
from vdsm_pin.units import MM_PER_M

LARGEST_LINK: Final = 20.0
"""A link's mesh larger than this must be in another unit; [m]."""

MOST_REACHES: Final = 5.0
"""A link's mesh larger than this times the way along all joints is noted; [-]."""

SMALLEST_LINK: Final = 2e-3
"""A link's mesh smaller than this may be scaled once too often, and is noted; [m]."""

LinkPiece: TypeAlias = Hull | FlatCylinder
MeshPieces: TypeAlias = tuple[IntArray, ...] | Hull


@dataclass(frozen=True)
class LinkReader:
    """Reads the solids of the links of one URDF.

    Args:
        path: The URDF.
        package_dirs: Where `package://NAME/REST` is looked for.
        solids: What stands for meshes.
        covers: By link, of each of its meshes that was read the triangles under each
            hull, or the primitive around it.
        notes: What is odd about the meshes that were read.
    """

    path: Path
    package_dirs: tuple[Path, ...] = ()
    solids: MeshCover = HULLS
    covers: dict[str, list[MeshPieces]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    _sizes: list[tuple[str, str, float]] = field(default_factory=list)

    def too_large(self, reach: float) -> Iterator[str]:
        """Notes on meshes that were read, too large beside the robot's reach; [m]."""
        for link, name, size in self._sizes:
            if size > MOST_REACHES * reach:
                odd = f"its mesh {name!r} is {size:.3g} m large, all joints {reach:.3g}"
                yield f"link {link!r}: {odd} m apart; is it in inches, or centimetres?"

    def pieces(self, link: ET.Element) -> tuple[LinkPiece, ...]:
        """The convex pieces of a link, in its frame, which hold all of it.

        Raises:
            InvalidFile: If a mesh is missing, far too large or scaled oddly.
        """
        name, found = link.get("name", ""), list[LinkPiece]()
        for collision in link.findall("collision"):
            placement = origin_of(collision)
            for shape in self._shapes(name, collision, placement):
                if isinstance(shape, np.ndarray):
                    found += self._cover(name, shape, placement)
                else:
                    found.append(shape)
        return tuple(found)

    def surfaces(
        self, link: ET.Element, visual: ET.Element
    ) -> Iterator[LinkPiece | FloatArray]:
        """What a visual element of a link shows, in the link's frame.

        Of a mesh the corners of its triangles, shape (n, 3, 3); [m].

        Raises:
            InvalidFile: If a mesh is missing, far too large or scaled oddly.
        """
        placement = origin_of(visual)
        for shape in self._shapes(link.get("name", ""), visual, placement):
            if isinstance(shape, np.ndarray):
                yield placement[:3, 3] + shape @ placement[:3, :3].T
            else:
                yield shape

    def meshes(self, document: ET.Element) -> tuple[Path, ...]:
        """The mesh files of all links, each once.

        Raises:
            InvalidFile: If one is missing.
        """
        found = [
            self._found(link.get("name", ""), mesh.get("filename", ""))
            for link in document.findall("link")
            for mesh in link.findall("collision/geometry/mesh")
        ]
        return tuple(dict.fromkeys(found))

    def _shapes(
        self, link: str, element: ET.Element, placement: FloatArray
    ) -> Iterator[LinkPiece | FloatArray]:
        """The shapes of an element where T_link_shape places them.

        Of a mesh the corners of its triangles, not placed, shape (n, 3, 3); [m].
        """
        turn, shift = placement[:3, :3], placement[:3, 3]
        geometry = element.find("geometry")
        for shape in [] if geometry is None else list(geometry):
            match shape.tag:
                case "box":
                    size = np.array([float(w) for w in shape.get("size", "").split()])
                    yield Hull(shift + (BOX_CORNERS * size / 2.0) @ turn.T)
                case "sphere":
                    yield Hull(shift[None], float(shape.get("radius", "")))
                case "cylinder":
                    half = float(shape.get("length", "")) / 2.0
                    radius = float(shape.get("radius", ""))
                    yield FlatCylinder(shift, turn[:, 2], half, radius)
                case "capsule":
                    along = float(shape.get("length", "")) / 2.0 * turn[:, 2]
                    ends = np.array([shift - along, shift + along])
                    yield Hull(ends, float(shape.get("radius", "")))
                case "mesh":
                    yield self._triangles(link, shape)

    def _cover(
        self, link: str, corners: FloatArray, placement: FloatArray
    ) -> Iterator[LinkPiece]:
        """Pieces that hold all triangles, (n, 3, 3), where T_link_mesh places them."""
        turn, shift = placement[:3, :3], placement[:3, 3]
        covers = self.covers.setdefault(link, [])
        if self.solids.cover == "primitives":
            around = covering_primitive(shift + corners.reshape(-1, 3) @ turn.T)
            covers.append(around)
            yield around
            return
        count = self.solids.parts if self.solids.cover == "parts" else 1
        groups = grouped(corners, count)
        covers.append(groups)
        for points in covering_points(corners, groups):
            # Fewer are placed, and where they are placed some may come to be equal.
            placed = shift + distinct_rows(points) @ turn.T
            yield covering_hull(distinct_rows(placed))

    def _triangles(self, link: str, shape: ET.Element) -> FloatArray:
        """The corners of a link's mesh, scaled, shape (n, 3, 3); [m]."""
        name = shape.get("filename", "")
        mesh = read_mesh(self._found(link, name))
        scale = np.array([plain_number(w) for w in shape.get("scale", "1 1 1").split()])
        if scale.shape != (3,) or not (np.isfinite(scale) & (scale != 0.0)).all():
            word = shape.get("scale")
            fault = f"scale is {word!r}, expected 3 numbers that are not 0"
            raise self._invalid(link, fault)
        metres = 1.0 if mesh.unit is None else mesh.unit  # COLLADA states its own
        points: FloatArray = metres * mesh.vertices * scale
        size = float(np.ptp(points, axis=0).max())
        if not size <= LARGEST_LINK:
            fault = (
                f"its mesh {name!r} is {size:.4g} m large; is it in "
                'millimetres? expected scale="0.001 0.001 0.001"'
            )
            raise self._invalid(link, fault)
        self._sizes.append((link, name, size))
        if size < SMALLEST_LINK:
            odd = f"its mesh {name!r} is {MM_PER_M * size:.3g} mm large"
            self.notes.append(f"link {link!r}: {odd}; is it in metres without a scale?")
        return np.asarray(points[mesh.triangles])

    def _found(self, link: str, name: str) -> Path:
        """The file of a mesh."""
        if (found := find_mesh(name, self.path, self.package_dirs)) is None:
            how = "say where with --package-dir"
            if "$(" in name:
                how = "expected no $( ), but in xacro files, which end in .xacro"
            fault = f"mesh {name!r} is not found; {how}"
            raise self._invalid(link, fault)
        return found

    def _invalid(self, link: str, fault: str) -> InvalidFile:
        return InvalidFile(file=self.path, fault=f"link {link!r}: {fault}")
