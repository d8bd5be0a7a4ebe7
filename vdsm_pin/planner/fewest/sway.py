"""How far an arm may stand from its ideal while its angles count as unchanged.

Unchanged means at most `TOLERANCES.changed_angle`, not 0. Let joint k alone be changed
(joints counted from 0, e the threshold, L_l the links, R the length from joint k on).

* Links before k lean at most (l + 1) e: joint k is at most a = sum_{l<k} L_l (l + 1) e
  off the rail, and its distance from the base falls short by at most
  b = sum_{l<k} L_l ((l + 1) e)^2 / 2.
* Links after k lean at most (l - k) e from link k. A point of them, at whatever arc
  length, is at most s = sum_{l>k} L_l (l - k) e from its place on the chord between
  joint k and tip. That chord is at least R - c long, where
  c = sum_{l>k} L_l ((l - k) e)^2 / 2.
* No link leans more than w = limit + N e from the rail. So the tip's distance t from
  the rail is at most R sin(w) + a, and tip and joint k are R cos(w) apart along it.

The ideal arm draws the same tip, lies on the rail up to joint k and runs straight from
there: sqrt(R^2 - t^2) along the rail. With the chord squared less what it is across,
joint k of both differs along the rail by at most

    d = (2 R c + (2 t + a) a) / (R cos(w) + sqrt(R^2 - t^2)) .

So within a + b + s + d of every point of the ideal axis lies one of the arm's axis, and
the bases differ by less than that.
"""

from dataclasses import dataclass

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.manipulator import Manipulator
from vdsm_pin.tolerances import TOLERANCES


@dataclass(frozen=True)
class Sway:
    """What sub-threshold angles can add to an arm with one changed angle.

    Args:
        straight: Largest distance of the tip from the rail with none changed; [m].
        bend: Largest angle of the ideal arm's bend at each joint, shape (N,), NaN where
            there is no ideal arm for some reachable tips; [rad].
        body: Distance of the ideal axis from the arm's, shape (n, N), NaN where the
            ideal arm does not reach the tip; [m].
    """

    straight: float
    bend: FloatArray
    body: FloatArray


def sway(manipulator: Manipulator, off: FloatArray) -> Sway:
    """The bounds above.

    Args:
        manipulator: The arm.
        off: Distance of tips from the rail, shape (n,); [m].
    """
    count, lengths = manipulator.n_links, manipulator.link_lengths
    small = TOLERANCES.changed_angle
    link = np.arange(count)
    before = np.where(link[None] < link[:, None], link + 1, 0) * small
    after = np.maximum(link[None] - link[:, None], 0) * small
    aside, ahead = before @ lengths, (before**2 / 2.0) @ lengths
    chord, short = after @ lengths, (after**2 / 2.0) @ lengths
    rest = manipulator.total_length - manipulator.stations[:-1]
    lean = manipulator.max_link_angle + TOLERANCES.joint_limit + count * small
    if lean < np.pi / 2.0:
        sine = np.sin(lean) + aside / rest
        bend = np.arcsin(np.where(sine < 1.0, sine, np.nan))
    else:
        bend = np.full(count, np.nan)
    square = rest**2 - off[:, None] ** 2
    along = np.sqrt(np.where(square > 0.0, square, np.nan))
    shift = 2.0 * rest * short + (2.0 * off[:, None] + aside) * aside
    shift = shift / (rest * np.cos(lean) + along)
    body = aside + ahead + chord + shift
    return Sway(float(lengths @ ((link + 1) * small)), bend, body)
