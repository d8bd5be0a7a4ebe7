"""What the plots of a report show: series against the row number, with their limits."""

import base64
from collections.abc import Sequence
from typing import Any

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.report.facts import min_clearance
from vdsm_pin.report.palette import link_colours, obstacle_colours
from vdsm_pin.report.thinning import MOST_PLOTTED, Thinned, nearest_obstacles
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.records import Verification


def packed(values: Any, dtype: str = "<f4") -> str:
    """An array as base64 of its little-endian bytes, as the page reads it.

    What single precision cannot hold becomes infinite, which the page calls missing.
    """
    with np.errstate(over="ignore"):
        return base64.b64encode(np.ascontiguousarray(values, dtype).tobytes()).decode()


def series(name: str, colour: str, values: FloatArray, **more: Any) -> dict[str, Any]:
    """One line of a plot; `values` against the row number."""
    return {"name": name, "colour": colour, "values": packed(values), **more}


def chart(
    title: str,
    axis: str,
    lines: list[dict[str, Any]],
    note: str,
    limits: Sequence[tuple[str, float]] = (),
    **more: Any,
) -> dict[str, Any]:
    """One plot, as `plots.js` draws it.

    Args:
        title: What stands above it, and names it where `more` has no `id`.
        axis: What its values are, with their unit in brackets.
        lines: See `series`.
        note: What is to be said of it, a sentence.
        limits: Labels and values of lines across it.
        more: `id`, `floor`, `whole`, `scale` and `far_limits`.
    """
    unit = axis.partition("[")[2].rstrip("]")
    return {
        "id": title,
        "title": title,
        "note": note,
        "unit": unit if unit in ("", "°") else f" {unit}",
        "axis": axis,
        "limits": [{"label": label, "value": value} for label, value in limits],
        "series": lines,
        **more,
    }


def clearance_charts(
    verification: Verification, shown: Thinned, links: list[str]
) -> list[dict[str, Any]]:
    """Brackets of each link and of the nearest obstacles over the motion; in mm."""
    profile, scene = verification.profile, verification.problem.scene
    required = verification.problem.required_clearance * MM_PER_M
    if not scene.names:
        return []
    note = "Solid: proved lower bound, rough below 0. Dashed: proved upper bound."
    # What is proved for the whole motion holds in every interval of it.
    least = min_clearance(verification)
    proved = -np.inf if least is None or least.lower_m is None else least.lower_m
    link_lower = np.maximum(profile.link_lower, proved)
    near = nearest_obstacles(verification, MOST_PLOTTED)
    obstacle_lower = np.maximum(profile.obstacle_lower[:, near], proved)
    whole = near.size == len(scene.names)
    which = "Of" if whole else f"Of the {near.size} nearest obstacles,"
    of_links = _brackets(
        links,
        link_colours(len(links)),
        shown.least(link_lower, profile.first_interval),
        shown.least(profile.link_upper, profile.first_interval),
    )
    of_obstacles = _brackets(
        [scene.names[k] for k in near],
        obstacle_colours(near.size),
        shown.least(obstacle_lower, profile.first_interval),
        shown.least(profile.obstacle_upper[:, near], profile.first_interval),
    )
    axis, asked = "clearance [mm]", [(f"required {required:g} mm", required)]
    return [
        chart("Clearance of each link", axis, of_links,
              f"To the nearest obstacle. {note}", asked,
              id="clearance-link", scale="asinh"),
        chart("Clearance from each obstacle", axis, of_obstacles,
              f"{which} the nearest link. {note}", asked,
              id="clearance-obstacle", scale="asinh"),
    ]  # fmt: skip


def _brackets(
    names: list[str], colours: tuple[str, ...], lower: FloatArray, upper: FloatArray
) -> list[dict[str, Any]]:
    return [
        series(
            name,
            colours[i],
            lower[:, i] * MM_PER_M,
            upper=packed(upper[:, i] * MM_PER_M),
            step=True,
        )
        for i, name in enumerate(names)
    ]
