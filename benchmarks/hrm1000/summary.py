"""Tables over the outcomes: by family and method, and who solves what others solve."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from vdsm_pin.tolerances import TOLERANCES

OURS: Final = "fewest"
"""The strategy that is held against every other method."""


@dataclass(frozen=True)
class Outcome:
    """One problem, one method; None where there is no motion to measure."""

    problem: str
    family: str
    number: int
    method: str
    answer: str
    reason: str
    plan_s: float
    total_s: float
    coverage: float = 0.0
    changed: float | None = None
    psi_deg: float | None = None
    clearance_m: float | None = None


def solved(outcome: Outcome, limit: float) -> bool:
    """Certified, whole and in time; for the family `infeasible`, refused in time."""
    if outcome.family == "infeasible":
        return outcome.answer in ("infeasible", "not found")
    whole = outcome.coverage >= 1.0 - TOLERANCES.on_path_length
    return outcome.answer == "certified" and whole and outcome.plan_s <= limit


def _mean(values: Iterable[float | None], digits: int, scale: float = 1.0) -> str:
    known = [value for value in values if value is not None]
    return f"{scale * np.mean(known):.{digits}f}" if known else "-"


def _row(family: str, own: list[Outcome], limit: float) -> str:
    done = [o for o in own if solved(o, limit)]
    times = [o.plan_s for o in own]
    cells = [
        family, own[0].method, len(own), f"{len(done)} ({len(done) / len(own):.0%})",
    ]  # fmt: skip
    if family == "infeasible":
        answers = Counter(o.answer for o in own)
        wrong = sum(o.answer == "certified" and o.coverage >= 1.0 for o in own)
        cells += [f"{answers['infeasible']} proved, {wrong} wrong", "-", "-", "-"]
    else:
        psi = [o.psi_deg for o in done if o.psi_deg is not None]
        room = [o.clearance_m for o in done if o.clearance_m is not None]
        cells += [
            f"{100 * np.mean([o.coverage for o in own]):.1f} %",
            _mean((o.changed for o in done), 2),
            f"{max(psi):.1f}" if psi else "-",
            f"{1e3 * min(room):.2f}" if room else "-",
        ]
    cells += [f"{np.median(times):.2f}", f"{np.percentile(times, 95):.2f}"]
    return "| " + " | ".join(map(str, cells)) + " |"


def table(outcomes: list[Outcome], limit: float) -> str:
    """The results method by method and family by family as Markdown."""
    lines = [
        "| family | method | problems | solved, or rightly refused | mean coverage "
        "| changed angles | largest psi [deg] | least clearance [mm] | median [s] "
        "| p95 [s] |",
        "|---|---|---|---|---|---|---|---|---|---|",
    ]
    for method, family in sorted({(o.method, o.family) for o in outcomes}):
        own = [o for o in outcomes if (o.method, o.family) == (method, family)]
        lines.append(_row(family, own, limit))
    return "\n".join(lines)


def comparison(outcomes: list[Outcome], limit: float) -> str:
    """Feasible problems that each method solves, and how many of them ours solves."""
    feasible = [o for o in outcomes if o.family != "infeasible"]
    won = {
        method: {o.problem for o in feasible if o.method == method and solved(o, limit)}
        for method in sorted({o.method for o in feasible})
    }
    tried = {m: sum(o.method == m for o in feasible) for m in won}
    ours = {o.problem for o in feasible if o.method == OURS}
    lines = [
        f"| method | tried | solved | tried by `{OURS}` too | of those it solves |",
        "|---|---|---|---|---|",
    ]
    for method, names in won.items():
        both = names & ours
        share = len(both & won.get(OURS, set()))
        cells = [method, tried[method], len(names), len(both), share]
        lines.append("| " + " | ".join(map(str, cells)) + " |")
    return "\n".join(lines)


def misses(outcomes: list[Outcome], limit: float, *, proved: bool) -> str:
    """What our strategy does not solve, by name.

    Args:
        outcomes: Of every method.
        limit: Processor time for planning; [s].
        proved: Of these whether what is proved to have no plan, or the others.
    """
    lines = [
        f"* {o.problem}: {o.answer}, {o.coverage:.1%} drawn, {o.plan_s:.1f} s. "
        f"{o.reason}"
        for o in outcomes
        if o.method == OURS
        and not solved(o, limit)
        and (o.answer == "infeasible") == proved
    ]
    return "\n".join(lines) or "None."


def document(outcomes: list[Outcome], settings: dict[str, Any]) -> str:
    """The whole page."""
    limit = settings["time_limit_s"]
    versions = ", ".join(f"{k} {v}" for k, v in settings["versions"].items())
    counts = Counter(o.method for o in outcomes)
    tried = ", ".join(f"{count} by {method}" for method, count in counts.items())
    return (
        f"# HRM-1000, version {settings['benchmark']}\n\n"
        f"Problems tried: {tried}. Limit {limit:g} s of processor time for planning, "
        f"without the proof. {settings['processor']}, {settings['processes']} "
        f"processes while the machine had other work; Python {settings['python']}, "
        f"{versions}.\n\n"
        f"{table(outcomes, limit)}\n\n"
        f"## What others solve\n\n{comparison(outcomes, limit)}\n\n"
        f"## What `{OURS}` misses\n\n{misses(outcomes, limit, proved=False)}\n\n"
        "## What it proves to have no plan though it was meant to have one\n\n"
        f"{misses(outcomes, limit, proved=True)}\n"
    )
