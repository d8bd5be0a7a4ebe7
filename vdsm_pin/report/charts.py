"""What the plots of a report show: series against the row number, with their limits."""

import base64
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


def limit(label: str, value: float) -> dict[str, Any]:
    """A line across a plot."""
    return {"label": label, "value": value}


def clearance_charts(
    verification: Verification, shown: Thinned, links: list[str]
) -> list[dict[str, Any]]:
    """Brackets of each link and of the nearest obstacles over the motion; in mm."""
    profile, scene = verification.profile, verification.problem.scene
    required = verification.problem.required_clearance * MM_PER_M
    if not scene.names:
        return []
    common = {
        "unit": " mm",
        "axis": "clearance [mm]",
        "scale": "asinh",
        "limits": [limit(f"required {required:g} mm", required)],
    }
    note = "Solid: proved lower bound, rough below 0. Dashed: proved upper bound."
    # What is proved for the whole motion holds in every interval of it.
    least = min_clearance(verification)
    proved = -np.inf if least is None or least.lower_m is None else least.lower_m
    link_lower = np.maximum(profile.link_lower, proved)
    near = nearest_obstacles(verification, MOST_PLOTTED)
    obstacle_lower = np.maximum(profile.obstacle_lower[:, near], proved)
    whole = near.size == len(scene.names)
    which = "Of" if whole else f"Of the {near.size} nearest obstacles,"
    return [
        common
        | {
            "id": "clearance-link",
            "title": "Clearance of each link",
            "note": f"To the nearest obstacle. {note}",
            "series": _brackets(
                links,
                link_colours(len(links)),
                shown.least(link_lower, profile.first_interval),
                shown.least(profile.link_upper, profile.first_interval),
            ),
        },
        common
        | {
            "id": "clearance-obstacle",
            "title": "Clearance from each obstacle",
            "note": f"{which} the nearest link. {note}",
            "series": _brackets(
                [scene.names[k] for k in near],
                obstacle_colours(near.size),
                shown.least(obstacle_lower, profile.first_interval),
                shown.least(profile.obstacle_upper[:, near], profile.first_interval),
            ),
        },
    ]


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
