"""Curves over time as SVG, for the page of a simulation."""

import html
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.app.explanation.canvas import round_step
from vdsm_pin.geometry.arrays import FloatArray

WIDTH, HEIGHT = 760.0, 220.0
LEFT, TOP, RIGHT, BOTTOM = 62.0, 14.0, 14.0, 34.0
MOST_POINTS: Final = 800
"""Columns of a drawn curve; of those between the least and the largest are kept."""


@dataclass(frozen=True)
class Curve:
    """Values over time.

    Args:
        name: For the legend; empty for none.
        times: Rising, shape (n,); [s].
        values: Shape (n,), in the plot's unit.
        colour: As #rrggbb, or a name of CSS.
    """

    name: str
    times: FloatArray
    values: FloatArray
    colour: str


@dataclass(frozen=True)
class Plot:
    """Curves with their limits.

    Args:
        title: What it shows.
        unit: Of the values.
        curves: At least one.
        limits: Values drawn as dashed lines, each with its name.
        note: A sentence below the title.
    """

    title: str
    unit: str
    curves: tuple[Curve, ...]
    limits: tuple[tuple[str, float], ...] = ()
    note: str = ""

    @property
    def svg(self) -> str:
        """The drawing."""
        values = [curve.values for curve in self.curves]
        bounds = [value for _, value in self.limits]
        low, high = _range(np.concatenate([*values, np.array(bounds)]))
        end = max(float(curve.times[-1]) for curve in self.curves)
        place = _Place(end, low, high)
        parts = [*_grid(place, self.unit)]
        for name, value in self.limits:
            y = place.y(value)
            parts.append(
                f'<line class="limit" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" '
                f'y2="{y:.1f}"/><text class="tick" x="{WIDTH - RIGHT}" '
                f'y="{y - 3:.1f}" text-anchor="end">{html.escape(name)}</text>'
            )
        for curve in self.curves:
            points = " ".join(
                f"{place.x(t):.1f},{place.y(v):.1f}" for t, v in thin(curve)
            )
            parts.append(f'<polyline points="{points}" style="stroke:{curve.colour}"/>')
        said = html.escape(f"{self.title} [{self.unit}] over time")
        return (
            f'<svg viewBox="0 0 {WIDTH:g} {HEIGHT:g}" role="img" aria-label="{said}">'
            f"<title>{said}</title>{''.join(parts)}</svg>"
        )

    @property
    def legend(self) -> tuple[tuple[str, str], ...]:
        """Name and colour of every curve with a name."""
        return tuple((one.name, one.colour) for one in self.curves if one.name)


@dataclass(frozen=True)
class _Place:
    """Where times and values stand."""

    end: float
    low: float
    high: float

    def x(self, time: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * time / (self.end or 1.0)

    def y(self, value: float) -> float:
        part = (value - self.low) / (self.high - self.low)
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * part


def thin(curve: Curve) -> list[tuple[float, float]]:
    """A curve's points, of long ones the extremes of each column."""
    n = len(curve.times)
    if n <= MOST_POINTS:
        return list(zip(curve.times.tolist(), curve.values.tolist(), strict=True))
    edges = np.unique(np.linspace(0, n, MOST_POINTS // 2 + 1).astype(int))
    kept: list[int] = []
    for first, last in zip(edges[:-1].tolist(), edges[1:].tolist(), strict=True):
        part = curve.values[first:last]
        both = {first + int(np.argmin(part)), first + int(np.argmax(part))}
        kept += sorted(both)
    return [(float(curve.times[k]), float(curve.values[k])) for k in kept]


def _range(values: FloatArray) -> tuple[float, float]:
    low, high = float(values.min()), float(values.max())
    pad = 0.06 * (high - low) or 0.5 * abs(high) or 1.0
    return low - pad, high + pad


def _grid(place: _Place, unit: str) -> Sequence[str]:
    """Lines and numbers of both axes."""
    parts = []
    step = round_step((place.high - place.low) / 5.0)
    for k in range(math.ceil(place.low / step), math.floor(place.high / step) + 1):
        y = place.y(k * step)
        parts.append(
            f'<line class="grid" x1="{LEFT}" x2="{WIDTH - RIGHT}" y1="{y:.1f}" '
            f'y2="{y:.1f}"/><text class="tick" x="{LEFT - 6}" y="{y + 4:.1f}" '
            f'text-anchor="end">{k * step:g}</text>'
        )
    step = round_step((place.end or 1.0) / 8.0)
    for k in range(math.floor(place.end / step) + 1):
        x = place.x(k * step)
        parts.append(
            f'<text class="tick" x="{x:.1f}" y="{HEIGHT - 16}" '
            f'text-anchor="middle">{k * step:g}</text>'
        )
    parts.append(
        f'<text class="tick" x="{WIDTH - RIGHT}" y="{HEIGHT - 3}" '
        f'text-anchor="end">time [s]</text>'
        f'<text class="tick" x="4" y="{TOP - 3}">[{html.escape(unit)}]</text>'
    )
    return parts
