"""Oracles: the contrast ratio of WCAG 2, and a published model of colour blindness.

The first is computed from its definition, the second is the matrix for full
deuteranopia (Machado, Oliveira, Fernandes 2009) with distances in OKLab.
"""

import itertools
import re
from pathlib import Path
from typing import Final

import numpy as np
import pytest

from vdsm_pin.report import palette
from vdsm_pin.report.palette import link_colours, oklch

STYLE = Path(palette.__file__).parent / "templates" / "style.css"
TEXT: Final = 4.5  # AA: text
GRAPHIC: Final = 3.0  # AA: lines, marks, borders that tell something
DEUTERANOPIA: Final = np.array(
    [
        [0.367322, 0.860646, -0.227968],
        [0.280085, 0.672501, 0.047413],
        [-0.011820, 0.042940, 0.968881],
    ]
)
TO_CONES: Final = np.array(
    [
        [0.4122214708, 0.5363325363, 0.0514459929],
        [0.2119034982, 0.6806995451, 0.1073969566],
        [0.0883024619, 0.2817188376, 0.6299787005],
    ]
)
TO_LAB: Final = np.array(
    [
        [0.2104542553, 0.7936177850, -0.0040720468],
        [1.9779984951, -2.4285922050, 0.4505937099],
        [0.0259040371, 0.7827717662, -0.8086757660],
    ]
)
VERDICTS: Final = ("certified", "refuted", "undecided")
TEXTS: Final = (
    *itertools.product(("ink", "soft", "accent", *VERDICTS), ("card", "page")),
    ("card", "accent"),  # the play button
    ("card", "ink"),  # the value under the pointer
    *((verdict, f"{verdict}-back") for verdict in VERDICTS),
    *(("ink", f"{verdict}-back") for verdict in VERDICTS),
)
GRAPHICS: Final = (
    *itertools.product(("accent", *VERDICTS, "soft", "ink"), ("card", "page")),
    *((verdict, f"{verdict}-back") for verdict in VERDICTS),
)


def themes() -> dict[str, dict[str, str]]:
    """The colours of each theme of the pages, by name, as #rrggbb."""
    text = STYLE.read_text(encoding="utf-8")
    blocks = re.findall(r":root \{(.*?)\}", text, re.DOTALL)
    found = [dict(re.findall(r"--([\w-]+): (#[0-9a-f]+)\b", block)) for block in blocks]
    light, dark, paper = (
        {name: long(colour) for name, colour in block.items()} for block in found
    )
    return {"light": light, "dark": light | dark, "paper": light | paper}


def long(colour: str) -> str:
    """#rgb as #rrggbb."""
    if len(colour) == 4:
        return "#" + "".join(2 * digit for digit in colour[1:])
    return colour


def linear(colour: str) -> np.ndarray:
    channels = np.array([int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)])
    curved = ((channels + 0.055) / 1.055) ** 2.4
    return np.where(channels <= 0.04045, channels / 12.92, curved)


def contrast(a: str, b: str) -> float:
    low, high = sorted(linear(x) @ [0.2126, 0.7152, 0.0722] for x in (a, b))
    return float((high + 0.05) / (low + 0.05))


def difference(a: str, b: str, sight: np.ndarray) -> float:
    """Distance in OKLab of two colours as somebody sees them."""
    seen = [np.clip(sight @ linear(colour), 0.0, 1.0) for colour in (a, b)]
    first, second = (TO_LAB @ np.cbrt(TO_CONES @ one) for one in seen)
    return float(np.linalg.norm(first - second))


def test_the_oracle_knows_black_from_white_and_red_from_green() -> None:
    assert contrast("#000000", "#ffffff") == pytest.approx(21.0)
    assert contrast("#777777", "#ffffff") == pytest.approx(4.48, abs=0.01)
    red, green = oklch(0.6, 0.12, 30.0), oklch(0.6, 0.12, 140.0)
    seen = difference(red, green, DEUTERANOPIA)
    assert seen < 0.5 * difference(red, green, np.eye(3))


@pytest.mark.parametrize("theme", ["light", "dark", "paper"])
def test_text_and_marks_keep_their_contrast(theme: str) -> None:
    colours = themes()[theme]
    for front, back in TEXTS:
        assert contrast(colours[front], colours[back]) >= TEXT, (front, back)
    for front, back in GRAPHICS:
        assert contrast(colours[front], colours[back]) >= GRAPHIC, (front, back)


@pytest.mark.parametrize("theme", ["light", "dark", "paper"])
def test_certified_looks_like_nothing_else_to_any_eye(theme: str) -> None:
    colours = themes()[theme]
    for other in VERDICTS[1:]:
        for sight in (np.eye(3), DEUTERANOPIA):
            assert difference(colours["certified"], colours[other], sight) > 0.05


@pytest.mark.parametrize("count", [2, 8, 20, 40])
def test_links_stand_out_on_light_and_on_dark_pages(count: int) -> None:
    colours = link_colours(count)
    assert len(set(colours)) == count
    for colour in colours:
        for theme in themes().values():
            assert contrast(colour, theme["card"]) >= GRAPHIC


@pytest.mark.parametrize("count", [1, 7, 20])
def test_obstacles_stand_out_in_the_plots(count: int) -> None:
    for colour in palette.obstacle_colours(count):
        for theme in themes().values():
            assert contrast(colour, theme["card"]) >= GRAPHIC


def test_neighbouring_links_differ_to_any_eye() -> None:
    for a, b in itertools.pairwise(link_colours(8)):
        assert difference(a, b, np.eye(3)) > 0.1
        assert difference(a, b, DEUTERANOPIA) > 0.08
    for a, b in itertools.combinations(link_colours(8), 2):
        assert difference(a, b, DEUTERANOPIA) > 0.04
