"""Fig. 3: the flow of the seven steps, each with the module that carries it out."""

from typing import Final

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyBboxPatch
from paper_figures import style
from paper_figures.runs import Runs
from paper_figures.style import save_all

NAME: Final = "fig03"
STEPS: Final = (
    ("Step 1: can the path be reached?", "Eq. 4", "planner/feasibility.py"),
    ("Step 2: 3D → 2D", "", "planner/paper/project.py"),
    ("Step 3: scale the path to the joints", "Eq. 5, 6", "planner/paper/scale.py"),
    ("Step 4: the path of the tip", "", "planner/paper/tip_path.py, detours.py"),
    ("Step 5: the paths of the joints", "Eq. 8-10",
     "planner/paper/joint_paths.py, across_rail.py"),
    ("Step 6: 2D → 3D", "Eq. 7", "planner/paper/lift.py"),
    ("Step 7: angles and cable lengths", "Eq. 2, 3, 11-21",
     "planner/paper/solve.py, cables.py"),
)  # fmt: skip
WIDE, HIGH, PITCH = 3.1, 0.34, 0.52
AFTER: Final = (
    ("Coal measures every waypoint", "", "planner/paper/steering.py"),
    ("the proof covers what lies between", "Eq. 22-24", "verification/verify.py"),
)


def draw(runs: Runs) -> dict[str, Figure]:
    """Boxes from top to bottom; what is too near goes back to Step 5."""
    del runs  # nothing is planned
    boxes = (*STEPS, *AFTER)
    height = PITCH * (len(boxes) + 1) + 0.25
    figure = style.sheet(height)
    axes = style.place(figure, 0.0, 0.0, style.WIDTH, height)
    axes.set_xlim(0.0, style.WIDTH)
    axes.set_ylim(0.0, height)
    axes.set_axis_off()
    middle = 3.0
    for k, (words, equations, module) in enumerate(boxes):
        y = height - 0.35 - PITCH * k
        ours = k >= len(STEPS)
        _box(axes, middle, y, words, "#eef3f9" if ours else "#eef7ef")
        axes.text(middle + WIDE / 2 + 0.12, y + 0.06, module, size=6.2,
                  family="monospace", va="center")  # fmt: skip
        axes.text(middle + WIDE / 2 + 0.12, y - 0.09, equations, size=6.2,
                  color=style.FAINT, va="center")  # fmt: skip
        _arrow(axes, (middle, y - HIGH / 2), (middle, y - PITCH + HIGH / 2))
    last = height - 0.35 - PITCH * len(boxes)
    _box(axes, middle, last, "certified plan", "#dff3e2")
    left = middle - WIDE / 2
    first, fifth = height - 0.35, height - 0.35 - 4 * PITCH
    slide = "joints slide on\nby what Coal\nsays is missing"
    margin = "a margin for that\nlink and obstacle"
    for k, over, words in ((7, 1.5, slide), (8, 0.5, margin)):
        y = height - 0.35 - PITCH * k
        axes.plot([left, left - 0.42, left - 0.42], [y, y, fifth], color=style.INK,
                  linewidth=0.7)  # fmt: skip
        axes.text(left - 0.5, y + over * PITCH, words, size=6.2, ha="right",
                  va="center")  # fmt: skip
    _arrow(axes, (left - 0.42, fifth), (left, fifth))
    _arrow(axes, (left, first), (left - 0.42, first))
    axes.text(left - 0.5, first, "no: out of reach", size=6.2, ha="right", va="center")
    return {NAME: figure}


def _box(axes: Axes, x: float, y: float, words: str, colour: str) -> None:
    axes.add_patch(
        FancyBboxPatch(
            (x - WIDE / 2, y - HIGH / 2),
            WIDE,
            HIGH,
            facecolor=colour,
            boxstyle="round,pad=0,rounding_size=0.06",
            edgecolor=style.INK,
            linewidth=0.7,
        )
    )
    axes.text(x, y, words, size=7.0, ha="center", va="center")


def _arrow(axes: Axes, start: tuple[float, float], end: tuple[float, float]) -> None:
    axes.annotate("", end, start, arrowprops={
        "arrowstyle": "-|>", "color": style.INK, "linewidth": 0.7,
        "shrinkA": 0, "shrinkB": 0, "mutation_scale": 7,
    })  # fmt: skip


if __name__ == "__main__":
    save_all(draw(Runs()))
