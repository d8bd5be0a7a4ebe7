"""Named solids, which are made of convex pieces.

Everything that measures a distance works on pieces (`geometry/convex.py`).
"""

from typing import TypeAlias

from vdsm_pin.geometry.file_solids import (
    ConvexCover,
    FromFile,
    Mesh,
    PointCloud,
    Voxels,
)
from vdsm_pin.geometry.primitives import (
    BOX_CORNERS,
    Box,
    Capsule,
    Cylinder,
    HalfSpace,
    Prism,
    Sphere,
)

__all__ = [
    "BOX_CORNERS",
    "Box",
    "Capsule",
    "ConvexCover",
    "Cylinder",
    "FromFile",
    "HalfSpace",
    "Mesh",
    "PointCloud",
    "Prism",
    "Solid",
    "Sphere",
    "Voxels",
]

Solid: TypeAlias = (
    Sphere | Capsule | Cylinder | Box | Prism | HalfSpace | Mesh | PointCloud | Voxels
)
