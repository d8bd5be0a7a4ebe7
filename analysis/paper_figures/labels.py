"""Labels of dots, each put where it is clear of lines, dots and other labels."""

import itertools
from typing import Final

import numpy as np
import shapely
from matplotlib.axes import Axes

from paper_figures import style
from vdsm_pin.geometry.arrays import FloatArray

POINTS_PER_INCH: Final = 72.0
RADII: Final = (6.5, 9.0, 12.0, 16.0, 20.0)
"""Distances from a dot at which its label is tried; [pt]."""

TURNS: Final = 24
"""Directions in which a label is tried."""

ROOM: Final = 7.0
"""Free space beyond this makes a place no better; [pt]."""

LED: Final = 10.5
"""From this distance on, a thin line leads from a dot to its label; [pt].

Between two of `RADII`: rounding does not decide.
"""

COVERED: Final = 5.0
"""How much more a point of overlap counts than one of distance; [-]."""

WITHIN: Final = 7.0
"""What a place within the region to avoid is worth less; [pt]."""


def label_dots(
    axes: Axes,
    dots: FloatArray,
    names: list[str],
    lines: list[FloatArray],
    avoid: shapely.Geometry | None = None,
    size: float = 6.3,
) -> None:
    """Write a name beside each dot. The limits of the axes must be final.

    Args:
        axes: Where to write, with equal axes.
        dots: Shape (n, 2); [mm].
        names: One per dot.
        lines: Polylines to keep clear of, each of shape (m, 2); [mm].
        avoid: A region to keep out of and whose edges to keep clear of; [mm].
        size: Of the letters; [pt].
    """
    to_points = axes.transData.transform
    scale = POINTS_PER_INCH / axes.figure.dpi
    edges = [] if avoid is None else _edges(avoid)
    busy = [to_points(_sampled(line)) * scale for line in [*lines, *edges]]
    obstacles = np.vstack([*busy, to_points(dots) * scale])
    (left, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    frame = to_points([[left, bottom], [right, top]]) * scale
    turn = 2.0 * np.pi * np.arange(TURNS) / TURNS
    around = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    tries = np.vstack([radius * around for radius in RADII])
    for at, name in zip(dots, names, strict=True):
        here = to_points(at) * scale
        half = np.array([0.30 * size * len(name), 0.45 * size])
        gaps = [_gap(obstacles, here + offset, half) for offset in tries]
        inside = [
            bool(
                (here + offset - half >= frame[0]).all()
                and (here + offset + half <= frame[1]).all()
            )
            for offset in tries
        ]
        far = np.linalg.norm(tries, axis=1)
        gaps = np.where(np.array(gaps) < 0.0, COVERED * np.array(gaps), gaps)
        score = np.minimum(gaps, ROOM) - 0.35 * far - 20.0 * ~np.array(inside)
        if avoid is not None:
            back = axes.transData.inverted().transform((here + tries) / scale)
            score -= WITHIN * shapely.contains_xy(avoid, *back.T)
        offset = tries[int(np.argmax(score))]
        leader = {"arrowstyle": "-", "color": style.INK, "linewidth": 0.35,
                  "shrinkA": 0.0, "shrinkB": 1.5}  # fmt: skip
        axes.annotate(
            name, at, offset, textcoords="offset points", ha="center", va="center",
            size=size, zorder=9,
            arrowprops=leader if np.linalg.norm(offset) >= LED else None,
        )  # fmt: skip
        grid = np.array([[i, j] for i in (-1, 0, 1) for j in (-1, 0, 1)])
        taken = [obstacles, here + offset + grid * half]
        if np.linalg.norm(offset) >= LED:
            taken.append(here + np.linspace(0.0, 1.0, 9)[:, None] * offset)
        obstacles = np.vstack(taken)


def _gap(obstacles: FloatArray, centre: FloatArray, half: FloatArray) -> float:
    """Distance of a label's box to the nearest thing, negative inside; [pt]."""
    x, y = (np.abs(obstacles[:, k] - centre[k]) - half[k] for k in (0, 1))
    right, up = np.maximum(x, 0.0), np.maximum(y, 0.0)
    inside = np.minimum(np.maximum(x, y), 0.0)
    return float((np.sqrt(right * right + up * up) + inside).min())


def _edges(region: shapely.Geometry) -> list[FloatArray]:
    """The outlines of a region, each of shape (m, 2)."""
    lines = shapely.get_parts(region.boundary)
    return [shapely.get_coordinates(line) for line in lines]


def _sampled(line: FloatArray) -> FloatArray:
    """Points along a polyline, close enough for a label not to fit between; [mm]."""
    parts = [
        a + np.linspace(0.0, 1.0, 40)[:, None] * (b - a)
        for a, b in itertools.pairwise(line)
    ]
    return np.vstack(parts)
