"""Colours of pages, plots, 3D and printed figures: one place for all.

Those of links and of obstacles in plots are legible on white and on the dark page.
"""

import math
from typing import Final

_CHROMA: Final = 0.135
_LIGHTNESS: Final = (0.55, 0.64)  # alternating, so that neighbours differ without hue
_OBSTACLES: Final = (0.62, 0.57)
OBSTACLE: Final = "#c9d0da"
OBSTACLE_EDGE: Final = "#8791a0"
PATH: Final = "#d9480f"
"""The desired path, and what is pointed out."""
AXES: Final = {"x": "#c92a2a", "y": "#2b8a3e", "z": "#1864ab"}
"""Of frames; those of `templates/overlay.js`."""

_FIRST_HUE, _LAST_HUE = 262.0, -20.0  # blue at the base, over green, to magenta


def link_colours(count: int) -> tuple[str, ...]:
    """Colours from the base to the tip as #rrggbb."""
    step = (_LAST_HUE - _FIRST_HUE) / max(count - 1, 1)
    return tuple(
        oklch(_LIGHTNESS[i % 2], _CHROMA, _FIRST_HUE + step * i) for i in range(count)
    )


def obstacle_colours(count: int) -> tuple[str, ...]:
    """Colours for the plots, in the order of the obstacles, as #rrggbb."""
    hues = (30.0 + 360.0 * i / max(count, 1) for i in range(count))
    return tuple(oklch(_OBSTACLES[i % 2], _CHROMA, hue) for i, hue in enumerate(hues))


def oklch(lightness: float, chroma: float, hue_deg: float) -> str:
    """A colour of the OKLCH space, where equal steps look equal, as #rrggbb."""
    hue = math.radians(hue_deg)
    a, b = chroma * math.cos(hue), chroma * math.sin(hue)
    long = (lightness + 0.3963377774 * a + 0.2158037573 * b) ** 3
    medium = (lightness - 0.1055613458 * a - 0.0638541728 * b) ** 3
    short = (lightness - 0.0894841775 * a - 1.2914855480 * b) ** 3
    linear = (
        4.0767416621 * long - 3.3077115913 * medium + 0.2309699292 * short,
        -1.2684380046 * long + 2.6097574011 * medium - 0.3413193965 * short,
        -0.0041960863 * long - 0.7034186147 * medium + 1.7076147010 * short,
    )
    return "#" + "".join(f"{_srgb(channel):02x}" for channel in linear)


def _srgb(channel: float) -> int:
    inside = min(max(channel, 0.0), 1.0)
    if inside <= 0.0031308:
        return round(255.0 * 12.92 * inside)
    return round(255.0 * (1.055 * math.pow(inside, 1.0 / 2.4) - 0.055))
