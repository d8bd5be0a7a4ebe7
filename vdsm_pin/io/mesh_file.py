"""Mesh files to triangles in the order of the file.

No vertex is moved: corners are joined only where they are equal to the last bit, so
that a proof about these triangles is a proof about the file.
"""

import hashlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Final

import numpy as np

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import first_equal
from vdsm_pin.io.meshes.obj import read_obj
from vdsm_pin.io.meshes.ply import read_ply
from vdsm_pin.io.meshes.raw import MeshStream, RawMesh, check_ending
from vdsm_pin.io.meshes.stl import read_stl
from vdsm_pin.io.source import Digest, opened

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
        raise InvalidFile(file=path, problem="has no triangle")
    used = np.zeros(len(raw.vertices), dtype=np.bool_)
    used[raw.triangles] = True
    vertices = raw.vertices[used]
    first, index = first_equal(vertices)
    triangles = index[(np.cumsum(used) - 1)[raw.triangles]]
    return replace(raw, vertices=vertices[first], triangles=triangles)
