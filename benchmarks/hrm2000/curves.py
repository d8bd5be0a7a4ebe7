"""Tip curves of straight lines and arcs, and the arm that rides on one.

An arm that follows its tip (follow-the-leader) is the chain of chords of the tip's own
curve; before the curve leaves the rail's axis it is straight.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray

HALVINGS: Final = 60
"""Bisections that find a joint centre on the curve: to the last bit."""


@dataclass(frozen=True)
class Bend:
    """An arc after a straight line.

    Args:
        straight: Length of the line before it; [m].
        angle: By how much the curve turns; [rad].
        radius: Of the arc; [m].
        around: Towards which side, turned about the tangent; [rad].
    """

    straight: float
    angle: float
    radius: float
    around: float


@dataclass(frozen=True)
class TipCurve:
    """A smooth curve: it comes along the x axis, bends, and goes on straight.

    Args:
        starts: Arc length at which each piece begins, shape (k,); the x axis before
            the first bend is piece 0, and arc length 0 is at the origin; [m].
        origins: Where each begins, shape (k, 3); [m].
        tangents: Unit vectors, shape (k, 3); [-].
        normals: Unit vectors towards the middle of each arc, shape (k, 3); [-].
        curvatures: 0 on a line, shape (k,); [1/m].
    """

    starts: FloatArray
    origins: FloatArray
    tangents: FloatArray
    normals: FloatArray
    curvatures: FloatArray

    def at(self, stations: FloatArray) -> FloatArray:
        """Points at arc lengths, shape (n,) to (n, 3); [m]."""
        piece = np.searchsorted(self.starts, stations, side="right") - 1
        piece = np.maximum(piece, 0)
        along = stations - self.starts[piece]
        bent = self.curvatures[piece]
        safe = np.where(bent > 0.0, bent, 1.0)
        ahead = np.where(bent > 0.0, np.sin(bent * along) / safe, along)
        aside = np.where(bent > 0.0, (1.0 - np.cos(bent * along)) / safe, 0.0)
        return np.asarray(
            self.origins[piece]
            + ahead[:, None] * self.tangents[piece]
            + aside[:, None] * self.normals[piece]
        )

    @property
    def lead(self) -> float:
        """Arc length at which the curve leaves the rail's axis; [m]."""
        return float(self.starts[1]) if len(self.starts) > 1 else float("inf")

    def frames(self, stations: FloatArray) -> FloatArray:
        """Frames that do not twist along the curve, their x axes along it.

        Args:
            stations: Arc lengths that rise, shape (n,); [m].

        Returns:
            Rotations, columns tangent and two across, shape (n, 3, 3); [-].
        """
        step = 1e-6 * max(1.0, float(np.abs(stations).max()))
        tangents = self.at(stations + step) - self.at(stations - step)
        tangents /= np.linalg.norm(tangents, axis=1)[:, None]
        across = np.cross(tangents[0], np.eye(3)[np.argmin(np.abs(tangents[0]))])
        rows = []
        for tangent in tangents:
            across = across - (across @ tangent) * tangent
            across /= np.linalg.norm(across)
            rows.append(np.column_stack([tangent, across, np.cross(tangent, across)]))
        return np.array(rows)


def tip_curve(bends: Sequence[Bend]) -> TipCurve:
    """The curve through these bends, from the x axis."""
    frame, origin, start = np.eye(3), np.zeros(3), 0.0
    rows: list[tuple[float, FloatArray, FloatArray, FloatArray, float]] = []
    for bend in bends:
        tangent = frame[:, 0]
        aside = np.cos(bend.around) * frame[:, 1] + np.sin(bend.around) * frame[:, 2]
        rows.append((start, origin, tangent, aside, 0.0))
        start, origin = start + bend.straight, origin + bend.straight * tangent
        rows.append((start, origin, tangent, aside, 1.0 / bend.radius))
        c, s = np.cos(bend.angle), np.sin(bend.angle)
        origin = origin + bend.radius * (s * tangent + (1.0 - c) * aside)
        start = start + bend.angle * bend.radius
        third = np.cross(tangent, aside)
        frame = np.column_stack(
            [c * tangent + s * aside, c * aside - s * tangent, third]
        )
    rows.append((start, origin, frame[:, 0], frame[:, 1], 0.0))
    columns = [np.array(column) for column in zip(*rows, strict=True)]
    return TipCurve(*columns)


def follow_the_leader(
    arm: Manipulator, curve: TipCurve, tips: FloatArray
) -> FloatArray:
    """The arm on its tip's curve: every joint centre is a link from the next one.

    Args:
        arm: The arm.
        curve: What the tip follows.
        tips: Arc lengths of the tip, shape (n,); [m].

    Returns:
        Joint centres, shape (n, N + 1, 3); the first ones are on the x axis only if
        the arm is long enough; [m].
    """
    centres = np.zeros((len(tips), arm.n_links + 1, 3))
    here, centres[:, -1] = tips, curve.at(tips)
    for i in range(arm.n_links - 1, -1, -1):
        length = arm.link_lengths[i]
        # A link spans less of the curve than a third more than its length.
        low, high = here - 1.35 * length, here - 0.999 * length
        for _ in range(HALVINGS):
            middle = (low + high) / 2.0
            gap = np.linalg.norm(curve.at(middle) - centres[:, i + 1], axis=1)
            low, high = (
                np.where(gap > length, middle, low),
                np.where(gap > length, high, middle),
            )
        here = (low + high) / 2.0
        centres[:, i] = curve.at(here)
    return centres


def tightest_radius(arm: Manipulator) -> float:
    """Radius of the arc on which the longest link turns by the whole cone; [m]."""
    return float(arm.link_lengths.max() / (2.0 * np.sin(arm.max_link_angle / 2.0)))
