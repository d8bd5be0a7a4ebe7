"""Step 2: 3D to 2D (paper, 3.3).

The base slides along X, so X is free and the plan is made in the plane Y0Z0.
"""

from vdsm_pin.geometry.arrays import FloatArray


def project(points: FloatArray) -> FloatArray:
    """Projection along the rail, shape (..., 3) to (..., 2): y and z; [m]."""
    return points[..., 1:]
