"""Joint centres to joint angles and back, compiled (Eq. 1, 11-15 of the paper)."""

from math import cos, sin, sqrt

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray


@compiled
def turns_of(centres: FloatArray, lengths: FloatArray, turns: FloatArray) -> float:
    """Where every link points, seen from the link before it (Eq. 11-15).

    Args:
        centres: Joint centres, shape (n_samples, N + 1, 3); [m].
        lengths: Of the links, shape (N,); [m].
        turns: Set to the parts of the unit vector along a link that point ahead, aside,
            down, and in the horizontal plane, shape (4, n_samples, N); [-].

    Returns:
        The largest difference between a link and its length, nan if there is one; [m].
    """
    worst = 0.0
    links = np.zeros((lengths.shape[0], 3))
    for k in range(centres.shape[0]):
        for i in range(lengths.shape[0]):
            dx = centres[k, i + 1, 0] - centres[k, i, 0]
            dy = centres[k, i + 1, 1] - centres[k, i, 1]
            dz = centres[k, i + 1, 2] - centres[k, i, 2]
            span = sqrt(dx * dx + dy * dy + dz * dz)
            error = abs(span - lengths[i])
            if not error <= worst and worst == worst:  # a nan stays
                worst = error
            links[i, 0], links[i, 1], links[i, 2] = dx / span, dy / span, dz / span
        x0, x1, x2 = 1.0, 0.0, 0.0
        y0, y1, y2 = 0.0, 1.0, 0.0
        z0, z1, z2 = 0.0, 0.0, 1.0
        for i in range(lengths.shape[0]):
            a0, a1, a2 = links[i, 0], links[i, 1], links[i, 2]
            ahead = x0 * a0 + x1 * a1 + x2 * a2
            aside = y0 * a0 + y1 * a1 + y2 * a2
            down = -(z0 * a0 + z1 * a1 + z2 * a2)
            reach = sqrt(ahead * ahead + aside * aside)
            turns[0, k, i], turns[1, k, i] = ahead, aside
            turns[2, k, i], turns[3, k, i] = down, reach
            # The new y axis is the old one turned by alpha about z; z follows.
            if reach == 0.0:  # a link along z: any alpha fits, atan2 says 0
                ahead = reach = 1.0
            y0 = (y0 * ahead - x0 * aside) / reach
            y1 = (y1 * ahead - x1 * aside) / reach
            y2 = (y2 * ahead - x2 * aside) / reach
            x0, x1, x2 = a0, a1, a2
            z0, z1, z2 = x1 * y2 - x2 * y1, x2 * y0 - x0 * y2, x0 * y1 - x1 * y0
    return worst


@compiled
def centres_of(
    x0: FloatArray, alpha: FloatArray, theta: FloatArray, lengths: FloatArray
) -> FloatArray:
    """Joint centres from the joint values (Eq. 1).

    Args:
        x0: Base positions on the rail, shape (n_samples,); [m].
        alpha: Yaw angles, shape (n_samples, N); [rad].
        theta: Pitch angles, shape (n_samples, N); [rad].
        lengths: Of the links, shape (N,); [m].

    Returns:
        Shape (n_samples, N + 1, 3); [m].
    """
    centres = np.zeros((x0.size, lengths.size + 1, 3))
    for k in range(x0.size):
        px, py, pz = x0[k], 0.0, 0.0
        ax, ay, az = 1.0, 0.0, 0.0
        bx, by, bz = 0.0, 1.0, 0.0
        cx, cy, cz = 0.0, 0.0, 1.0
        centres[k, 0, 0] = px
        for i in range(lengths.size):
            ca, sa = cos(alpha[k, i]), sin(alpha[k, i])
            ax, ay, az, bx, by, bz = (
                ax * ca + bx * sa,
                ay * ca + by * sa,
                az * ca + bz * sa,
                bx * ca - ax * sa,
                by * ca - ay * sa,
                bz * ca - az * sa,
            )
            ct, st = cos(theta[k, i]), sin(theta[k, i])
            ax, ay, az, cx, cy, cz = (
                ax * ct - cx * st,
                ay * ct - cy * st,
                az * ct - cz * st,
                ax * st + cx * ct,
                ay * st + cy * ct,
                az * st + cz * ct,
            )
            px += lengths[i] * ax
            py += lengths[i] * ay
            pz += lengths[i] * az
            centres[k, i + 1, 0] = px
            centres[k, i + 1, 1] = py
            centres[k, i + 1, 2] = pz
    return centres
