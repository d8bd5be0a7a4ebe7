"""simulation.html: a run in closed loop on one page that works offline."""

from typing import Any

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.report.html import rendered
from vdsm_pin.report.palette import AXES, link_colours
from vdsm_pin.simulation.closed_loop import SLACK, Simulation
from vdsm_pin.simulation.plots import Curve, Plot
from vdsm_pin.simulation.settings import Part, Settings

BAND_DEG = 0.3
"""The paper's main range of joint errors (Fig. 21); [deg]."""


def page(file: Any, found: Simulation, settings: Settings, required: float) -> str:
    """The page.

    Args:
        file: What simulation.json says.
        found: The run.
        settings: What was assumed.
        required: Clearance that the problem asks for; [m].
    """
    return rendered(
        "simulation.html.j2",
        file=file,
        plots=plots(found, settings),
        assumed=assumptions(settings),
        band=BAND_DEG,
        required=required,
    )


def plots(found: Simulation, settings: Settings) -> tuple[Plot, ...]:
    """Every plot of the page, in order."""
    cables = settings.cables
    margin, stiffness = found.tension_margin, found.least_stiffness
    return (
        _errors(found),
        _angles(found, "alpha", 0),
        _angles(found, "theta", 1),
        _tensions(found, cables.least_tension_n, cables.largest_tension_n),
        Plot(
            "Slack cables", "share",
            (_one(found.times, (found.tensions < SLACK).mean(axis=1)),),
            note=f"Cables with less than {SLACK:g} N, of all.",
        ),
        Plot(
            "Least joint stiffness", "Nm/rad", (_one(*stiffness.T),),
            (("buckles", 0.0),),
            "Of the arm held by its cables at the planned tensions.",
        ),
        Plot(
            "Tension that may be added to every cable", "N", (_one(*margin.T),),
            (("buckles", 0.0),),
            "Before the arm buckles, or a cable has its largest tension.",
        ),
    )  # fmt: skip


def _one(times: FloatArray, values: FloatArray) -> Curve:
    return Curve("", times, values, "var(--accent)")


def _names(found: Simulation) -> list[str]:
    count = found.errors.shape[1] // 2
    return [f"{letter}{i + 1}" for i in range(count) for letter in ("α", "θ")]


def _errors(found: Simulation) -> Plot:
    """Errors of all joint angles, as Fig. 21."""
    errors, names = np.rad2deg(found.errors), _names(found)
    colours = np.repeat(link_colours(errors.shape[1] // 2), 2).tolist()
    curves = (
        Curve(name, found.times, column, colour)
        for name, column, colour in zip(names, errors.T, colours, strict=True)
    )
    limits = (f"+{BAND_DEG}°", BAND_DEG), (f"−{BAND_DEG}°", -BAND_DEG)
    note = "Executed less planned; the band is the paper's main range (Fig. 21)."
    return Plot("Joint errors", "°", tuple(curves), limits, note)


def _angles(found: Simulation, kind: str, offset: int) -> Plot:
    """Executed angles over the planned ones, as Fig. 20."""
    letter = {"alpha": "α", "theta": "θ"}[kind]
    planned = np.rad2deg(found.planned[:, 1 + offset :: 2])
    executed = np.rad2deg(found.executed[:, 1 + offset :: 2])
    colours = link_colours(planned.shape[1])
    curves = [Curve("", found.times, column, "var(--rule)") for column in planned.T] + [
        Curve(f"{letter}{i + 1}", found.times, column, colours[i])
        for i, column in enumerate(executed.T)
    ]
    title = {"alpha": "Yaw angles α", "theta": "Pitch angles θ"}[kind]
    return Plot(title, "°", tuple(curves), (), "Executed; grey: planned (Fig. 20).")


def _tensions(found: Simulation, least: float, largest: float) -> Plot:
    """Largest and least tension of any cable."""
    curves = (
        Curve("largest", found.times, found.tensions.max(axis=1), AXES["x"]),
        Curve("mean", found.times, found.tensions.mean(axis=1), "var(--accent)"),
        Curve("least", found.times, found.tensions.min(axis=1), AXES["y"]),
    )
    limits = ("largest allowed", largest), ("least held", least)
    return Plot("Tensions of the cables", "N", curves, limits)


def assumptions(settings: Settings) -> tuple[tuple[str, str, str], ...]:
    """Name, value and reason of everything that was assumed."""
    rows = []
    for name, field in type(settings).model_fields.items():
        part = getattr(settings, name)
        if not isinstance(part, Part):
            rows.append((name, str(part), field.description or ""))
            continue
        rows += [
            (f"{name}.{key}", str(getattr(part, key)), inner.description or "")
            for key, inner in type(part).model_fields.items()
        ]
    return tuple(rows)
