"""The numbers that the page of figures quotes, from certified plans."""

import json
from pathlib import Path
from typing import Any, Final

import numpy as np
import paper_table
from result_files import at_least

from paper_figures.distances import AXES, axis_distance
from paper_figures.marks import marks
from paper_figures.runs import SCENES, STRATEGIES, Run, Runs, degrees
from paper_figures.style import subscript
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.report.motion_facts import motion_facts
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import MM_PER_M

DIGITS: Final = 4
"""Decimals kept, so that rounding of the last bits changes no page."""


def numbers(runs: Runs) -> dict[str, Any]:
    """Facts by scene and strategy, and the rows of the comparison table."""
    facts = {
        scene: {strategy: run_facts(runs(scene, strategy)) for strategy in STRATEGIES}
        for scene in SCENES
    }
    return {"facts": facts, "table": comparison(runs)}


def run_facts(run: Run) -> dict[str, Any]:
    """What the page says about one plan; millimetres and degrees."""
    rows, psi = run.trajectory, run.psi
    motion = motion_facts(run.problem, rows)
    to_obstacles = [
        near.lower for near in run.verification.approaches if near.pair.obstacle
    ]
    facts: dict[str, Any] = {
        "verdict": run.verification.verdict.value,
        "waypoints": rows.n_samples,
        "psi_max": [_round(v) for v in degrees(psi.max(axis=0))],
        "psi_largest": _round(float(degrees(psi.max()))),
        "changed": named(psi.max(axis=0)),
        "changed_mean": _round(motion.changed_angles_mean_on_path or 0.0),
        "changed_most": motion.changed_angles_max,
        "x0_min": _round(rows.x0.min() * MM_PER_M),
        "x0_max": _round(rows.x0.max() * MM_PER_M),
        "drawn": _round(100.0 * run.verification.coverage),
        "moments": {mark.name: named(psi[mark.row]) for mark in marks(run)},
    }
    if to_obstacles:
        facts["clearance"] = _rounded_down(min(to_obstacles) * MM_PER_M)
    if run.scene in AXES:
        facts["axis_distance"] = _round(float(axis_distance(run).min()) * MM_PER_M)
    return facts


def comparison(runs: Runs) -> list[dict[str, str]]:
    """The rows of the table 'paper says, we get', with a column per strategy."""
    merged: dict[tuple[str, str], dict[str, str]] = {}
    for scene in SCENES:
        for strategy in STRATEGIES:
            for row in paper_table.rows_of(scene, runs(scene, strategy).refinement):
                key = (row.scene, row.quantity)
                start = {"scene": scene, "quantity": row.quantity, "says": row.paper}
                merged.setdefault(key, start)[strategy] = row.ours
    return list(merged.values())


def named(psi: FloatArray) -> str:
    """The link angles that differ from zero, runs of them joined: 'ψ₁, ψ₄–ψ₈'."""
    joints = np.flatnonzero(psi > TOLERANCES.changed_angle) + 1
    if not len(joints):
        return "none"
    parts = np.split(joints, np.flatnonzero(np.diff(joints) > 1) + 1)
    words = []
    for part in parts:
        first, last = (f"ψ{subscript(int(part[k]))}" for k in (0, -1))
        joined = {1: first, 2: f"{first}, {last}"}
        words.append(joined.get(len(part), f"{first}–{last}"))
    return ", ".join(words)


def write(found: dict[str, Any], file: Path) -> None:
    """Keep the numbers beside the page."""
    text = json.dumps(found, indent=1, ensure_ascii=False) + "\n"
    file.write_text(text, encoding="utf-8")


def read(file: Path) -> dict[str, Any]:
    """The numbers that were kept."""
    found: dict[str, Any] = json.loads(file.read_text(encoding="utf-8"))
    return found


def _rounded_down(value: float) -> float:
    """To 0.001: the last bits of a proved bound are those of the search for it."""
    return float(at_least(value, 3))


def _round(value: float) -> float:
    return round(float(value), DIGITS) + 0.0
