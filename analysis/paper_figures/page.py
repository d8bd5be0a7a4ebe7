"""reports/paper/README.md: each figure with what the paper says and what we get.

The words are in `page.md`, every number comes from `numbers.py`.
"""

from pathlib import Path
from typing import Any, Final

import table1_parameters
from result_files import at_least

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.units import MM_PER_M, proved_mm

TEMPLATE: Final = Path(__file__).with_name("page.md")
"""The words, with the places of the numbers."""


def page(numbers: dict[str, Any]) -> str:
    """The whole page.

    Args:
        numbers: From `numbers.numbers`, or read back from the file.
    """
    facts = numbers["facts"]
    arm = built_in("hrm8")
    names = [f"fig{k:02d}" for k in (1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 14, 15, 16, 18)]
    names += ["fig17-axis", "fig17-surface"]
    pairs = ("fig11", "fig12", "fig12-small", "fig13")
    names += [f"{name}-{s}" for name in pairs for s in ("paper", "fewest")]
    return TEMPLATE.read_text(encoding="utf-8").format(
        f=facts,
        comparison=_comparison(numbers["table"]),
        table1=table1_parameters.markdown(arm),
        traditional=table1_parameters.traditional_markdown(arm),
        changed_table=_changed_table(facts),
        distance_table=_distance_table(facts),
        r=arm.cables.hole_radius * 1e3,
        d=arm.cables.half_gap * 1e3,
        **{name: _picture(name) for name in names},
    )


def _picture(name: str) -> str:
    return f'<img src="{name}.png" width="800" alt="{name}"> [SVG]({name}.svg)\n'


def _comparison(rows: list[dict[str, str]]) -> str:
    lines = [
        f"| {r['scene']} | {r['quantity']} | {r['says']} | {r.get('paper', '-')} | "
        f"{r.get('fewest', '-')} |"
        for r in rows
    ]
    return "\n".join(lines)


def _changed_table(facts: dict[str, Any]) -> str:
    lines = []
    for scene, by in facts.items():
        paper, fewest = by["paper"], by["fewest"]
        lines.append(
            f"| {scene} | {paper['changed']} | {fewest['changed']} | "
            f"{paper['changed_mean']:.2f} and {fewest['changed_mean']:.2f} | "
            f"{paper['changed_most']} and {fewest['changed_most']} |"
        )
    return "\n".join(lines)


def _distance_table(facts: dict[str, Any]) -> str:
    lines = []
    for scene, by in facts.items():
        if "axis_distance" not in by["paper"]:
            continue
        both = by["paper"], by["fewest"]
        cells = [f"{at_least(one['axis_distance'], 1)} mm" for one in both]
        cells += [proved_mm(one["clearance"] / MM_PER_M) for one in both]
        lines.append(f"| {scene} | {' | '.join(cells)} |")
    return "\n".join(lines)
