"""Curves against the waypoint number: link angles, base, moments, limits."""

from collections.abc import Iterable
from typing import Final

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from paper_figures import style
from paper_figures.marks import Mark, marks
from paper_figures.runs import Run, degrees
from paper_figures.views import thin
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.units import MM_PER_M

MM_PER_DEG: Final = 15.0
"""The paper's scale of x0 against psi in Fig. 14; [mm/deg]."""

TOP_DEG: Final = 57.0
"""Least upper end of the axis of psi: above the cone, and 855 mm for x0; [deg]."""

ROOM_DEG: Final = 3.0
"""What the axis has above the largest value at least; [deg]."""

LETTER: Final = 0.0075
"""Width of a letter of a moment's name over its size; [inch/pt]."""

LOW_DEG: Final = -9.0
"""Lower end, below x0 = -98 mm; [deg]."""


def draw_link_angles(axes: Axes, run: Run, rows: slice = slice(None)) -> None:
    """psi_1..psi_N and x0 on the paper's common scale, with the cone.

    Args:
        axes: Where to draw.
        run: The plan.
        rows: Which waypoints.
    """
    arm = run.problem.manipulator
    colours = style.key_colours(arm)
    numbers = np.arange(run.trajectory.n_samples)[rows]
    psi = degrees(run.psi)[rows]
    x0 = run.trajectory.x0[rows] * MM_PER_M / MM_PER_DEG
    _line(axes, numbers, x0, color=style.TIP, linewidth=0.9, dashes=(5, 1.6), zorder=3)
    for i in range(arm.n_links):
        _line(axes, numbers, psi[:, i], color=colours[i], zorder=4 - 0.1 * i)
    cone = float(np.rad2deg(arm.max_link_angle))
    draw_limit(axes, cone)
    axes.set_ylim(LOW_DEG, TOP_DEG)
    axes.set_yticks([0, 10, 20, 30, 40])
    axes.set_xlim(numbers[0], numbers[-1])
    axes.grid(visible=True, axis="y")


def top_of(runs: Iterable[Run]) -> float:
    """Upper end of an axis that holds psi and x0 of some plans; [deg]."""
    highest = max(float(run.trajectory.x0.max()) for run in runs)
    return max(TOP_DEG, highest * MM_PER_M / MM_PER_DEG + ROOM_DEG)


def base_axis(axes: Axes, labelled: bool = True) -> None:
    """The right-hand axis of x0, 15 mm to a degree."""
    reach = axes.get_ylim()[1] * MM_PER_DEG
    second = axes.secondary_yaxis(
        "right", functions=(lambda v: v * MM_PER_DEG, lambda v: v / MM_PER_DEG)
    )
    second.set_yticks([tick for tick in (0, 300, 600, 900) if tick <= reach])
    second.spines["right"].set_visible(True)
    if labelled:
        second.set_ylabel("x₀ [mm]")
    else:
        second.tick_params(labelright=False)


def draw_limit(axes: Axes, value: float) -> None:
    """A limit as a dashed red line."""
    axes.axhline(value, color=style.LIMIT, linewidth=0.8, dashes=(4, 2), zorder=2)


def draw_moments(axes: Axes, run: Run, size: float = 6.0) -> None:
    """The named moments as thin vertical lines with their names above the axes."""
    first, last = axes.get_xlim()
    figure = axes.get_figure()
    assert figure is not None
    width = axes.get_position().width * figure.get_size_inches()[0]
    letter = LETTER * size * (last - first) / width
    # Left to right; a label that would touch the one before is joined to it.
    groups: list[list[Mark]] = []
    for mark in marks(run):
        if not first <= mark.row <= last:
            continue
        axes.axvline(mark.row, color=style.FAINT, linewidth=0.5, zorder=1)
        group = [mark]
        while groups:
            before, _ = _span(groups[-1], letter, first, last)
            here, _ = _span(group, letter, first, last)
            reach = 0.5 * letter * (_letters(groups[-1]) + _letters(group) + 1)
            if here - before >= reach:
                break
            group = groups.pop() + group
        groups.append(group)
    for group in groups:
        middle, name = _span(group, letter, first, last)
        axes.annotate(
            name, (middle, 1.0), (0.0, 1.5), xycoords=("data", "axes fraction"),
            textcoords="offset points", ha="center", va="bottom", size=size,
        )  # fmt: skip


def _letters(group: list[Mark]) -> int:
    return sum(len(mark.name) + 1 for mark in group) - 1


def _span(
    group: list[Mark], letter: float, first: float, last: float
) -> tuple[float, str]:
    """Middle of a label, kept within the axes, and its text."""
    middle = 0.5 * (group[0].row + group[-1].row)
    half = 0.5 * letter * _letters(group)
    middle = min(max(middle, first + half), last - half)
    return middle, " ".join(mark.name for mark in group)


def shade_detours(axes: Axes, run: Run) -> None:
    """The stretches where the tip is off the desired path, shaded."""
    off = np.concatenate([[False], ~run.trajectory.on_path, [False]])
    edges = np.flatnonzero(np.diff(off.astype(int)))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        axes.axvspan(begin - 0.5, end - 0.5, color="#f4f5f7", zorder=0, linewidth=0)


def angle_legend(run: Run) -> tuple[list[Line2D], list[str]]:
    """Handles and names of psi_i, x0, the cone."""
    colours = style.key_colours(run.problem.manipulator)[:-1]
    lines = [Line2D([], [], color=colour, linewidth=1.6) for colour in colours]
    names = [f"ψ{style.subscript(i)}" for i in range(1, len(colours) + 1)]
    lines.append(Line2D([], [], color=style.TIP, linewidth=0.9, dashes=(5, 1.6)))
    names.append("x₀")
    lines.append(Line2D([], [], color=style.LIMIT, linewidth=0.8, dashes=(4, 2)))
    cone = float(np.rad2deg(run.problem.manipulator.max_link_angle))
    names.append(f"limit of ψ, {cone:g}°")
    return lines, names


def _line(axes: Axes, numbers: FloatArray, values: FloatArray, **look: object) -> None:
    """A curve without the corners nobody can see: 0.4 units is `views.FINE`."""
    # Scaled so that both directions are of the order of a millimetre on paper.
    flat = thin(np.column_stack([numbers, 12.0 * values]))
    axes.plot(flat[:, 0], flat[:, 1] / 12.0, **look)  # type: ignore[arg-type]
