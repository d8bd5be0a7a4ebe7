"""Small plane drawings as SVG: equal scales, axes in millimetres."""

import math
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.report.html import rendered
from vdsm_pin.units import MM_PER_M

WIDTH: Final = 560.0
MARGIN: Final = 46.0
MOST_HEIGHT: Final = 620.0
TICKS: Final = 6
"""About so many ticks on the longer axis."""


class Canvas:
    """A drawing that holds some points.

    Args:
        points: What must be inside, shape (n, 2); [m].
        across: Name of the first coordinate.
        up: Name of the second one.
    """

    def __init__(self, points: FloatArray, across: str, up: str) -> None:
        low, high = points.min(axis=0), points.max(axis=0)
        pad = 0.05 * float(np.max(high - low)) + 0.05
        self._low, span = low - pad, high - low + 2.0 * pad
        room = WIDTH - 2.0 * MARGIN, MOST_HEIGHT - 2.0 * MARGIN
        self._scale = float(min(room / span))
        self._size = self._scale * span + 2.0 * MARGIN
        self._parts: list[dict[str, str]] = []
        self._axes(low - pad, high + pad, (across, up))

    def line(
        self, points: FloatArray, style: str, colour: str = "", width: float = 1.4
    ) -> None:
        """A polyline of shape (n, 2), in one of the page's styles; [m]."""
        points_text, thick = self._text(points), f"{width:g}"
        self._put("line", style, points=points_text, colour=colour, width=thick)

    def area(self, outline: FloatArray, style: str) -> None:
        """An outline of shape (n, 2), as far as it lies inside the drawing; [m]."""
        width, height = (f"{size:.1f}" for size in self._size - 2.0 * MARGIN)
        self._put("area", style, points=self._text(outline), width=width, height=height)

    def dot(
        self,
        point: FloatArray,
        style: str,
        label: str = "",
        beside: tuple[float, float] = (6.0, -6.0),
    ) -> None:
        """A point of shape (2,) with a word beside it.

        Args:
            point: [m].
            style: One of the page's.
            label: The word.
            beside: Where it stands; to the left of a negative number it ends; [px].
        """
        x, y = self._place(point)
        self._put("dot", style, x=f"{x:.1f}", y=f"{y:.1f}")
        if label:
            dx, dy = beside
            self._word(x + dx, y + dy, "start" if dx > 0.0 else "end", label)

    def svg(self, title: str) -> str:
        """The drawing; the title is read out where it cannot be seen."""
        width, height = (f"{size:.0f}" for size in self._size)
        size = {"width": width, "height": height, "margin": f"{MARGIN:g}"}
        return rendered("canvas.svg.j2", title=title, parts=self._parts, **size)

    def _put(self, kind: str, style: str, **values: str) -> None:
        self._parts.append({"kind": kind, "style": style, **values})

    def _word(
        self, x: float, y: float, anchor: str, text: str, style: str = ""
    ) -> None:
        places = {"x": f"{x:.1f}", "y": f"{y:.1f}"}
        self._put("word", style, anchor=anchor, text=text, **places)

    def _axes(self, low: FloatArray, high: FloatArray, names: tuple[str, str]) -> None:
        step = round_step(float(np.max(high - low)) / TICKS)
        for axis, name in enumerate(names):
            first, last = math.ceil(low[axis] / step), math.floor(high[axis] / step)
            for k in range(first, last + 1):
                ends = np.stack([low, high])
                ends[:, axis] = k * step
                self.line(ends, "grid", width=0.6)
                x, y = self._place(ends[0])
                at = (x, y + 14, "middle") if axis == 0 else (x - 6, y + 4, "end")
                tick = f"{k * step * MM_PER_M:.0f}".replace("-", "−")
                self._word(*at, tick, "tick")
            far = [[high[0], low[1]], [low[0], high[1]]][axis]
            x, y = self._place(np.array(far))
            shift, anchor = [(30.0, "end"), (-10.0, "start")][axis]
            self._word(x, y + shift, anchor, f"{name} [mm]")

    def _place(self, point: FloatArray) -> tuple[float, float]:
        x, y = self._scale * (point - self._low) + MARGIN
        return float(x), float(self._size[1] - y)

    def _text(self, points: FloatArray) -> str:
        return " ".join("{:.1f},{:.1f}".format(*self._place(p)) for p in points)


def round_step(step: float) -> float:
    """The next larger of 1, 2, 5 times a power of ten; [m]."""
    power = 10.0 ** math.floor(math.log10(step))
    return next(m * power for m in (1.0, 2.0, 5.0, 10.0) if m * power >= step)
