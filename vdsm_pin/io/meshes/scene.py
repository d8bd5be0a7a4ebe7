"""Meshes that stand in a tree of frames: triangles from all the places they are put."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.io.meshes.raw import MeshStream, RawMesh
from vdsm_pin.io.schema_types import LARGEST


def composed(stream: MeshStream, pose: FloatArray, move: FloatArray) -> FloatArray:
    """One affine map behind another, both of shape (4, 4).

    Raises:
        InvalidFile: If it is not affine, or a number is not finite or too large.
    """
    good = np.abs(move) <= LARGEST
    result = pose @ move if good.all() else np.full((4, 4), np.inf)
    if not (np.abs(result) <= LARGEST).all() or (result[3] != [0, 0, 0, 1]).any():
        fault = "places a part by a matrix that is not affine or not finite"
        raise stream.invalid(fault)
    return np.asarray(result)


def strip_triangles(corners: IntArray, *, fan: bool) -> IntArray:
    """The triangles of a strip or a fan, shape (n - 2, 3), in the order of the file.

    Args:
        corners: Vertex indices, shape (n,).
        fan: Whether all triangles share the first corner.
    """
    i = np.arange(max(len(corners) - 2, 0))
    odd = i % 2
    places = (0 * i, i + 1, i + 2) if fan else (i, i + 1 + odd, i + 2 - odd)
    return np.asarray(corners[np.column_stack(places)])


@dataclass
class Placed:
    """Parts as they are put into the frame of the file.

    Args:
        stream: The file, for messages.
    """

    stream: MeshStream
    vertices: list[FloatArray] = field(default_factory=list)
    triangles: list[IntArray] = field(default_factory=list)
    n_vertices: int = 0
    n_triangles: int = 0

    def put(self, parts: Sequence[RawMesh], pose: FloatArray) -> None:
        """Put parts into the frame of the file.

        A mirror turns triangles over; they are turned back.

        Args:
            parts: Any number, as their triangles stand in their own frames.
            pose: T_file_part, shape (4, 4), affine.

        Raises:
            InvalidFile: If there are too many triangles, or a coordinate is not finite
                or too large.
        """
        mirrored = np.linalg.det(pose[:3, :3]) < 0.0
        for part in parts:
            self.n_triangles += len(part.triangles)
            self.stream.check_count(self.n_triangles)
            self.stream.check_numbers(part.vertices, "vertex", used=part.triangles)
            turned = part.triangles[:, ::-1] if mirrored else part.triangles
            self.triangles.append(turned + self.n_vertices)
            with np.errstate(over="ignore", invalid="ignore"):  # of unused vertices
                self.vertices.append(part.vertices @ pose[:3, :3].T + pose[:3, 3])
            self.n_vertices += len(part.vertices)

    def mesh(self, unit: float, *, bend: float, notes: Sequence[str]) -> RawMesh:
        """All that was put.

        Args:
            unit: Metres per unit of the file.
            bend: As in `RawMesh`.
            notes: As in `RawMesh`.

        Raises:
            InvalidFile: If a coordinate is not finite or too large.
        """
        vertices = np.concatenate([np.zeros((0, 3)), *self.vertices])
        triangles = np.concatenate([np.zeros((0, 3), np.int64), *self.triangles])
        self.stream.check_numbers(vertices, "vertex", used=triangles)
        return RawMesh(vertices, triangles, unit, bend, tuple(notes))
