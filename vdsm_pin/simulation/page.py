"""simulation.html: a run in closed loop on one page that works offline."""

from typing import Any

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.schema_types import FileModel
from vdsm_pin.report.charts import chart, packed, series
from vdsm_pin.report.html import rendered
from vdsm_pin.report.page_data import embedded
from vdsm_pin.report.palette import AXES, link_colours
from vdsm_pin.report.thinning import MOST_ROWS
from vdsm_pin.simulation.closed_loop import SLACK, Simulation
from vdsm_pin.simulation.settings import Settings

BAND_DEG = 0.3
"""The paper's main range of joint errors (Fig. 21); [deg]."""

ACCENT = "var(--accent)"
FOLLOWED = "Solid: executed. Dashed: planned (Fig. 20)."


def page(file: Any, found: Simulation, settings: Settings, required: float) -> str:
    """The page.

    Args:
        file: What simulation.json says.
        found: The run.
        settings: What was assumed.
        required: Clearance that the problem asks for; [m].
    """
    shown = thinned_run(found)
    plots = charts(shown, settings)
    clock = {
        "rows": packed(np.arange(shown.times.size), "<i4"),
        "times": packed(shown.times, "<f8"),
        "nSamples": shown.times.size,
    }
    return rendered(
        "simulation.html.j2",
        file=file,
        charts=plots,
        data=embedded({"clock": clock, "charts": plots}),
        assumed=assumptions(settings),
        band=BAND_DEG,
        required=required,
    )


def thinned_run(found: Simulation) -> Simulation:
    """The run at few enough times to plot, those of every extreme among them."""
    n, stiffness = found.times.size, found.least_stiffness
    curves = np.hstack([found.executed, found.errors, found.tensions])
    even = np.linspace(0, n - 1, min(n, MOST_ROWS)).astype(np.int64)
    rows = np.concatenate([even, curves.argmin(axis=0), curves.argmax(axis=0)])
    times = np.union1d(found.times[rows], stiffness[:, 0])

    def at(values: FloatArray, own: FloatArray = found.times) -> FloatArray:
        return np.column_stack([np.interp(times, own, column) for column in values.T])

    return Simulation(
        times,
        at(found.planned),
        at(found.executed),
        at(found.tensions),
        np.interp(times, found.times, found.path_m),
        at(stiffness, stiffness[:, 0]),
        at(found.tension_margin, found.tension_margin[:, 0]),
        found.largest_errors,
        found.largest_tension,
    )


def charts(found: Simulation, settings: Settings) -> list[dict[str, Any]]:
    """Every plot of the page, in order, as `plots.js` draws it."""
    cables, slack = settings.cables, 100.0 * (found.tensions < SLACK).mean(axis=1)
    stiffness, margin = found.least_stiffness[:, 1], found.tension_margin[:, 1]
    band = (f"+{BAND_DEG}°", BAND_DEG), (f"−{BAND_DEG}°", -BAND_DEG)
    most, least = cables.largest_tension_n, cables.least_tension_n
    held, buckles = (("largest allowed", most), ("least held", least)), ("buckles", 0.0)
    tensions = [
        series("largest", AXES["x"], found.tensions.max(axis=1)),
        series("mean", ACCENT, found.tensions.mean(axis=1)),
        series("least", AXES["y"], found.tensions.min(axis=1)),
    ]
    return [
        chart("Joint errors", "error [°]", _errors(found),
              "Executed less planned; the band is the paper's main range (Fig. 21).",
              band),
        chart("Yaw angles α", "α [°]", _angles(found, "α"), FOLLOWED),
        chart("Pitch angles θ", "θ [°]", _angles(found, "θ"), FOLLOWED),
        chart("Tensions of the cables", "tension [N]", tensions, "Of all cables.",
              held),
        chart("Slack cables", "cables [%]", [series("slack", ACCENT, slack)],
              f"Cables with less than {SLACK:g} N, of all."),
        chart("Least joint stiffness", "stiffness [Nm/rad]",
              [series("least", ACCENT, stiffness)],
              "Of the arm held by its cables at the planned tensions.", [buckles]),
        chart("Tension that may be added to every cable", "tension [N]",
              [series("margin", ACCENT, margin)],
              "Before the arm buckles, or a cable has its largest tension.",
              [buckles]),
    ]  # fmt: skip


def _errors(found: Simulation) -> list[dict[str, Any]]:
    """Errors of all joint angles, as Fig. 21."""
    errors = np.rad2deg(found.errors)
    colours = link_colours(errors.shape[1] // 2)
    return [
        series(f"{'αθ'[k % 2]}{k // 2 + 1}", colours[k // 2], column)
        for k, column in enumerate(errors.T)
    ]


def _angles(found: Simulation, letter: str) -> list[dict[str, Any]]:
    """Executed angles beside the planned ones, as Fig. 20."""
    both = np.rad2deg([found.executed, found.planned])
    executed, planned = both[:, :, 1 + "αθ".index(letter) :: 2].transpose(0, 2, 1)
    colours = link_colours(len(planned))
    return [
        series(f"{letter}{k + 1}", colours[k], executed[k], upper=packed(planned[k]))
        for k in range(len(planned))
    ]


def _told(value: object) -> str:
    """A setting as people write it: 350000, not 350000.0."""
    short = f"{value:.6g}" if isinstance(value, float) and value < 1e4 else f"{value}"
    return short.removesuffix(".0")


def assumptions(settings: Settings) -> tuple[tuple[str, str, str], ...]:
    """Name, value and reason of everything that was assumed."""
    rows = []
    for name, field in type(settings).model_fields.items():
        part = getattr(settings, name)
        if not isinstance(part, FileModel):
            rows.append((name, str(part or 0), field.description or ""))
            continue
        rows += [
            (f"{name}.{key}", _told(getattr(part, key)), inner.description or "")
            for key, inner in type(part).model_fields.items()
        ]
    return tuple(rows)
