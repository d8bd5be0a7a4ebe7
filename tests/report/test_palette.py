"""Oracle: the contrast ratio of WCAG 2, from its definition."""

import itertools

import pytest

from vdsm_pin.report.palette import link_colours


def luminance(colour: str) -> float:
    channels = [int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5)]
    linear = [
        c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in channels
    ]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


def contrast(a: str, b: str) -> float:
    low, high = sorted((luminance(a), luminance(b)))
    return (high + 0.05) / (low + 0.05)


@pytest.mark.parametrize("count", [2, 8, 20, 40])
def test_links_stand_out_on_light_and_on_dark_pages(count: int) -> None:
    colours = link_colours(count)
    assert len(set(colours)) == count
    for colour in colours:
        assert contrast(colour, "#ffffff") >= 3.0
        assert contrast(colour, "#1b1f27") >= 3.0


def test_neighbours_differ() -> None:
    for a, b in itertools.pairwise(link_colours(8)):
        gap = [abs(int(a[i : i + 2], 16) - int(b[i : i + 2], 16)) for i in (1, 3, 5)]
        assert sum(gap) > 60
