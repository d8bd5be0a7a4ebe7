"""Eq. 22-24: distance of the arm's axis from the obstacle's axis.

As printed they mix up coordinates. obs1 lies along X at (y, z) = (700, 600), obs2 along
X at (400, 400), obs3 along Z at (x, y) = (2126, 600) (section 4.1), and so they are
evaluated here, over whole links and not only at joint centres.
"""

from typing import Final

import numpy as np

from paper_figures.runs import Run
from vdsm_pin.geometry.arrays import FloatArray

AXES: Final = {
    "obs1": ((1, 2), (0.700, 0.600)),
    "obs2": ((1, 2), (0.400, 0.400)),
    "obs2-small": ((1, 2), (0.400, 0.400)),
    "obs3": ((0, 1), (2.126, 0.600)),
}
"""The two coordinates seen along each obstacle's axis, and the axis in them; [m]."""


def axis_distance(run: Run) -> FloatArray:
    """Smallest distance over the links at every waypoint, shape (n_samples,); [m]."""
    columns, axis = AXES[run.scene]
    points = run.centres[..., columns] - np.array(axis)
    begin, along = points[:, :-1], np.diff(points, axis=1)
    squared = np.einsum("nij,nij->ni", along, along)
    part = -np.einsum("nij,nij->ni", begin, along)
    part = np.minimum(
        np.maximum(part / np.where(squared > 0.0, squared, 1.0), 0.0), 1.0
    )
    nearest = np.linalg.norm(begin + part[..., None] * along, axis=2)
    return np.asarray(nearest.min(axis=1))
