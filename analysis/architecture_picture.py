"""docs/architecture.svg: the package's folders and modules, and who imports whom.

    python analysis/architecture_picture.py

Boxes stand as low as their imports allow. Arrows that follow from others are left out,
and so are those to what nearly everything uses.
"""

import ast
from pathlib import Path
from typing import Final

import matplotlib as mpl
import matplotlib.pyplot as plt

PACKAGE: Final = Path(__file__).parents[1] / "vdsm_pin"
TARGET: Final = PACKAGE.parent / "docs" / "architecture.svg"
FOLDER, MODULE, ARROW, INK = "#d0e2f7", "#eef1f5", "#8791a0", "#1f2733"
COMMON: Final = 0.4
"""A module imported by more than this share of the boxes stands in the lowest line."""

Graph = dict[str, set[str]]


def imports() -> Graph:
    """What every folder or module at the top of the package imports of the others."""
    graph: Graph = {}
    for path in sorted(PACKAGE.rglob("*.py")):
        box = path.relative_to(PACKAGE).parts[0].removesuffix(".py")
        if box.startswith("__"):
            continue
        found = graph.setdefault(box, set())
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = []
            if isinstance(node, ast.ImportFrom) and node.module:
                names = [node.module, *(f"{node.module}.{x.name}" for x in node.names)]
            found |= {
                name.split(".")[1] for name in names if name.startswith("vdsm_pin.")
            }
    return {
        box: {x for x in found if x in graph} - {box} for box, found in graph.items()
    }


def split_common(graph: Graph) -> tuple[Graph, list[str]]:
    """The graph without what stands lowest, and that: what nearly everything uses."""
    used = {box: sum(box in found for found in graph.values()) for box in graph}
    often = {box for box in graph if used[box] > COMMON * len(graph)}
    common = {box for box in often if not (PACKAGE / box).is_dir()}
    alone = {box for box in graph if used[box] and not graph[box] - common}
    common |= {box for box in alone if not (PACKAGE / box).is_dir()}
    rest = {box: found - common for box, found in graph.items() if box not in common}
    return rest, sorted(common)


def levels(graph: Graph) -> dict[str, int]:
    """Height of each box: above all that it imports."""
    height: dict[str, int] = {}
    while len(height) < len(graph):
        for box, found in graph.items():
            if box not in height and found <= height.keys():
                height[box] = 1 + max((height[x] for x in found), default=-1)
    return height


def reduced(graph: Graph) -> Graph:
    """The arrows that do not follow from others."""

    def reached(box: str) -> set[str]:
        return graph[box] | {y for x in graph[box] for y in reached(x)}

    return {
        box: found - {y for x in found for y in reached(x)}
        for box, found in graph.items()
    }


def places(graph: Graph) -> dict[str, tuple[float, int]]:
    """Where boxes stand: above what they import, few crossings."""
    height = levels(graph)
    x: dict[str, float] = {}
    for level in range(max(height.values()) + 1):
        row = sorted(box for box in graph if height[box] == level)
        below = {box: [x[y] for y in graph[box]] for box in row}
        row.sort(key=lambda box: sum(below[box]) / max(1, len(below[box])))
        for i, box in enumerate(row):
            x[box] = (i + 0.5) / len(row)
    return {box: (x[box], height[box]) for box in graph}


def main() -> None:
    """Draw the picture."""
    graph, common = split_common(imports())
    place, arrows = places(graph), reduced(graph)
    top = max(level for _, level in place.values())
    mpl.rcParams.update({"svg.hashsalt": "architecture", "font.size": 9})
    figure = plt.figure(figsize=(9.0, 0.75 * (top + 2.2)))
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set(xlim=(0.0, 1.0), ylim=(-1.7, top + 0.6))
    axes.axis("off")
    for box, found in arrows.items():
        for other in sorted(found):
            style = {"arrowstyle": "-|>", "color": ARROW, "lw": 0.8, "shrinkB": 9}
            axes.annotate("", place[other], place[box], arrowprops=style)
    for box, (x, y) in place.items():
        folder = (PACKAGE / box).is_dir()
        frame = {
            "boxstyle": "round,pad=0.4",
            "fc": FOLDER if folder else MODULE,
            "ec": INK if folder else ARROW,
            "lw": 0.8,
        }
        text = f"{box}/" if folder else box
        axes.text(x, y, text, ha="center", va="center", color=INK, bbox=frame)
    words = "below all: " + ", ".join(common)
    axes.text(0.5, -1.1, words, ha="center", va="center", color=INK, wrap=True)
    figure.savefig(TARGET, metadata={"Date": None})


if __name__ == "__main__":
    main()
