"""Step 3: scale the tip's projected path to the joints (paper, 3.4-3.5, Eq. 5, 6)."""

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.manipulator import Manipulator


def scale(manipulator: Manipulator, tip: FloatArray) -> FloatArray:
    """Reference paths P_1..P_{N+1} of the straight arm: P_i = k_{i,N+1} P_{N+1}.

    Args:
        manipulator: The arm with its ratios (Eq. 5).
        tip: Projected tip P_{N+1}, shape (n_samples, 2); [m].

    Returns:
        Projected joint centres, shape (n_samples, N + 1, 2); [m].
    """
    planar = np.zeros((len(tip), manipulator.n_links + 1, 2))
    for column in (0, 1):
        planar[..., column] = tip[:, column, None] * manipulator.ratios
    return planar
