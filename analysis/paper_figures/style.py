"""One look for all figures: typography, colours, files that stay small.

Joint O_i, its link i and its link angle psi_i share a colour, that of the link in
reports and in 3D; the tip is black.
"""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import matplotlib as mpl
import numpy as np

mpl.use("Agg")

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from PIL import Image
from result_files import REPORTS
from scipy.spatial import KDTree

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.report.palette import (
    AXES,
    link_colours,
)

WIDTH: Final = 7.2
"""Width of a printed figure; [inch]."""

DPI: Final = 150
"""Resolution of the PNG pictures; [dots per inch]."""

PNG_COLOURS: Final = 128
"""Palette size of the PNG pictures, enough for line drawings; [-]."""

INK: Final = "#1d2129"
FAINT: Final = "#9aa1ab"
GRID: Final = "#e4e7eb"
DANGER: Final = "#dff3e2"
DANGER_EDGE: Final = "#3f9a52"
AUXILIARY: Final = AXES["x"]
LIMIT: Final = AXES["x"]
TIP: Final = "#111111"
STRATEGY_COLOURS: Final = {"paper": "#6a6f7a", "fewest": AXES["z"]}

_SETTINGS: Final[dict[str, Any]] = {
    "font.family": "sans-serif",
    # Verdana has the same widths, for viewers of the SVG without DejaVu.
    "font.sans-serif": ["DejaVu Sans", "Verdana"],
    "font.size": 7.0,
    "axes.titlesize": 7.5,
    "axes.titlelocation": "left",
    "axes.titleweight": "bold",
    "axes.titlepad": 5.0,
    "axes.labelsize": 7.0,
    "axes.labelpad": 2.0,
    "axes.labelcolor": INK,
    "axes.edgecolor": FAINT,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.axisbelow": True,
    "grid.color": GRID,
    "grid.linewidth": 0.5,
    "xtick.labelsize": 6.5,
    "ytick.labelsize": 6.5,
    "xtick.color": INK,
    "ytick.color": INK,
    "xtick.major.size": 2.5,
    "ytick.major.size": 2.5,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "text.color": INK,
    "lines.linewidth": 1.1,
    "lines.solid_capstyle": "round",
    "legend.fontsize": 6.5,
    "legend.frameon": False,
    "legend.handlelength": 1.6,
    "legend.borderaxespad": 0.0,
    "svg.fonttype": "none",
    "svg.hashsalt": "vdsm-pin",
    "path.simplify": True,
    "path.simplify_threshold": 0.3,  # points; the default is a third of it
    "figure.dpi": DPI,
}


def sheet(height: float, width: float = WIDTH) -> Figure:
    """An empty figure in the house style.

    Args:
        height: [inch].
        width: [inch].
    """
    mpl.rcParams.update(_SETTINGS)
    return Figure(figsize=(width, height))


def place(
    figure: Figure, left: float, bottom: float, width: float, height: float
) -> Axes:
    """Axes at a place of the sheet given in inches from its lower left corner."""
    across, up = figure.get_size_inches()
    return figure.add_axes((left / across, bottom / up, width / across, height / up))


def key_colours(manipulator: Manipulator) -> tuple[str, ...]:
    """Colours of O_1..O_{N+1}: those of the links, and black for the tip."""
    return (*link_colours(manipulator.n_links), TIP)


def subscript(number: int) -> str:
    """A number in subscript digits."""
    return str(number).translate(str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉"))


def panel_title(axes: Axes, letter: str, text: str) -> None:
    """The panel's letter and what it shows."""
    axes.set_title(f"({letter}) {text}")


_PATH: Final = re.compile(r' d="[^"]*"')
_LONG: Final = re.compile(r"-?\d+\.\d{3,}")


def save_all(figures: Mapping[str, Figure], folder: Path = REPORTS) -> None:
    """Write every figure under its name."""
    for name, figure in figures.items():
        save(figure, name, folder)


def save(figure: Figure, name: str, folder: Path = REPORTS) -> None:
    """Write name.svg and name.png, the same bytes for the same drawing.

    Args:
        figure: What to write.
        name: File name without its ending.
        folder: Where to.
    """
    folder.mkdir(parents=True, exist_ok=True)
    vectors = folder / f"{name}.svg"
    figure.savefig(vectors, metadata={"Date": None, "Creator": None})
    vectors.write_text(shortened(vectors.read_text("utf-8")), encoding="utf-8")
    save_png(figure, folder / f"{name}.png")


def shortened(svg: str) -> str:
    """The same picture with paths to a hundredth of a point, a seventh shorter."""
    return _PATH.sub(lambda path: _LONG.sub(_hundredths, path[0]), svg)


def _hundredths(number: re.Match[str]) -> str:
    return f"{float(number[0]):.2f}".rstrip("0").rstrip(".")


def save_png(figure: Figure, file: Path) -> None:
    """Write a PNG picture with a palette of its commonest colours, at print resolution.

    So areas keep their exact tint, the same in all figures.
    """
    figure.savefig(file, dpi=DPI, metadata={"Software": None})
    with Image.open(file) as picture:
        pixels = np.asarray(picture.convert("RGB"))
    colours, which, counts = np.unique(
        pixels.reshape(-1, 3) @ [1 << 16, 1 << 8, 1],
        return_inverse=True,
        return_counts=True,
    )
    channels = colours[:, None] >> np.array([16, 8, 0]) & 255
    palette = channels[np.argsort(-counts, kind="stable")[:PNG_COLOURS]]
    nearest = KDTree(palette).query(channels)[1].astype(np.uint8)
    few = Image.fromarray(nearest[which].reshape(pixels.shape[:2]), "P")
    few.putpalette(palette.astype(np.uint8).ravel().tolist())
    few.save(file, optimize=True)
