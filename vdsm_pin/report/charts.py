"""What the plots of a report show: series against the row number, with their limits."""

import base64
import math
from typing import Any, Final

import numpy as np

from vdsm_pin.arm.cables import cable_lengths
from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.report.facts import min_clearance
from vdsm_pin.report.motion_facts import changed_angles
from vdsm_pin.report.palette import link_colours, obstacle_colours
from vdsm_pin.report.thinning import MOST_PLOTTED, Thinned, nearest_obstacles
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.records import ArmVerification, Verification

_DASHES: Final = ("", "7 3", "2 3")
_INK: Final = "currentColor"


def packed(values: Any, dtype: str = "<f4") -> str:
    """An array as base64 of its little-endian bytes, as the page reads it.

    What single precision cannot hold becomes infinite, which the page calls missing.
    """
    with np.errstate(over="ignore"):
        return base64.b64encode(np.ascontiguousarray(values, dtype).tobytes()).decode()


def charts(verification: Verification, shown: Thinned) -> list[dict[str, Any]]:
    """Every plot of the report, in order; angles in degrees, lengths in mm."""
    if not isinstance(verification, ArmVerification):
        from vdsm_pin.report.robot_page import joint_charts
        from vdsm_pin.robots.judgement import RobotVerification

        assert isinstance(verification, RobotVerification)
        names = [body.name for body in verification.problem.robot.bodies]
        clearances = _clearance_charts(verification, shown, names)
        return [*clearances, *joint_charts(verification, shown)]
    names = [f"link {i + 1}" for i in range(verification.problem.manipulator.n_links)]
    rows = verification.trajectory
    psi = link_angles(rows.alpha[shown.rows], rows.theta[shown.rows])
    return [
        _link_angle_chart(verification, psi),
        _base_chart(verification, shown),
        *_clearance_charts(verification, shown, names),
        _changed_chart(psi),
        *_joint_charts(verification, shown),
        _cable_chart(verification, shown),
    ]


def series(name: str, colour: str, values: FloatArray, **more: Any) -> dict[str, Any]:
    """One line of a plot; `values` against the row number."""
    return {"name": name, "colour": colour, "values": packed(values), **more}


def _per_joint(symbol: str, values: FloatArray) -> list[dict[str, Any]]:
    colours = link_colours(values.shape[1])
    return [
        series(f"{symbol}{i + 1}", colours[i], np.degrees(values[:, i]))
        for i in range(values.shape[1])
    ]


def limit(label: str, value: float) -> dict[str, Any]:
    """A line across a plot."""
    return {"label": label, "value": value}


def _link_angle_chart(verification: ArmVerification, psi: FloatArray) -> dict[str, Any]:
    cone = math.degrees(verification.problem.manipulator.max_link_angle)
    return {
        "id": "psi",
        "title": "Link angles ψ",
        "note": "Angle between neighbouring links at each joint.",
        "unit": "°",
        "axis": "ψ [°]",
        "floor": 0.0,
        "limits": [limit(f"cone {cone:g}°", cone)],
        "series": _per_joint("ψ", psi),
    }


def _base_chart(verification: ArmVerification, shown: Thinned) -> dict[str, Any]:
    x0 = verification.trajectory.x0[shown.rows] * MM_PER_M
    low, high = (v * MM_PER_M for v in verification.problem.manipulator.base_range)
    return {
        "id": "x0",
        "title": "Base position x₀",
        "note": f"Along the rail, from {low:g} to {high:g} mm.".replace("-", "−"),
        "unit": " mm",
        "axis": "x₀ [mm]",
        "limits": [limit("rail end", low), limit("rail end", high)],
        "far_limits": True,
        "series": [series("x₀", _INK, x0)],
    }


def _clearance_charts(
    verification: Verification, shown: Thinned, links: list[str]
) -> list[dict[str, Any]]:
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
    note = "Solid: proved lower bound. Dashed: proved upper bound."
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


def _changed_chart(psi: FloatArray) -> dict[str, Any]:
    return {
        "id": "changed",
        "title": "Changed link angles",
        "note": "Number of link angles above 0.05°; fewer are easier to drive.",
        "unit": "",
        "axis": "count",
        "floor": 0.0,
        "whole": True,
        "limits": [],
        "series": [
            series("changed", _INK, changed_angles(psi).astype(np.float64), step=True)
        ],
    }


def _joint_charts(
    verification: ArmVerification, shown: Thinned
) -> list[dict[str, Any]]:
    rows = verification.trajectory
    box = math.degrees(verification.problem.manipulator.max_joint_angle)
    limits = [limit(f"+{box:g}°", box), limit(f"−{box:g}°", -box)]
    pairs = (("theta", "θ", "pitch", rows.theta), ("alpha", "α", "yaw", rows.alpha))
    return [
        {
            "id": name,
            "title": f"{kind.capitalize()} angles {symbol}",
            "note": f"The {kind} of each universal joint.",
            "unit": "°",
            "axis": f"{symbol} [°]",
            "limits": limits,
            "far_limits": True,
            "series": _per_joint(symbol, values[shown.rows]),
        }
        for name, symbol, kind, values in pairs
    ]


def _cable_chart(verification: ArmVerification, shown: Thinned) -> dict[str, Any]:
    arm, rows = verification.problem.manipulator, verification.trajectory
    zero = np.zeros((1, arm.n_links))
    lengths = cable_lengths(arm, rows.alpha[shown.rows], rows.theta[shown.rows])
    change = (lengths - cable_lengths(arm, zero, zero)) * MM_PER_M
    colours = link_colours(change.shape[1])
    return {
        "id": "cables",
        "title": "Cable lengths",
        "note": "Change against the straight arm; cables a, b, c of each link.",
        "unit": " mm",
        "axis": "change [mm]",
        "limits": [],
        "series": [
            series(f"l{i + 1}{hole}", colours[i], change[:, i, j], dash=_DASHES[j])
            for i in range(change.shape[1])
            for j, hole in enumerate("abc")
        ],
    }
