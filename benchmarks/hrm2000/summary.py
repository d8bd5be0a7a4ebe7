"""Tables over the outcomes: by family and method, and who solves what others solve."""

from collections import Counter
from collections.abc import Iterable
from typing import Any, Final

import numpy as np

from benchmarks.hrm1000.families import FAMILIES as FIRST
from benchmarks.hrm2000.attempt import Outcome
from benchmarks.hrm2000.catalogue import FAMILIES, INFEASIBLE, has_witness
from vdsm_pin.planner.strategies import DEFAULT_STRATEGY as OURS
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import proved_mm

REFUSED: Final = ("infeasible", "not found", "out of time")


def whole(outcome: Outcome) -> bool:
    """Whether the verifier certified a motion that draws the whole path."""
    covered = outcome.coverage >= 1.0 - TOLERANCES.on_path_length
    return outcome.answer == "certified" and covered


def bad_plan(outcome: Outcome) -> bool:
    """Whether a certified plan is wrong: seen by sampling, or there can be none."""
    impossible = outcome.family in INFEASIBLE and whole(outcome)
    return bool(outcome.faults) or impossible


def false_proof(outcome: Outcome) -> bool:
    """Whether a problem that has a witness is said to have no solution."""
    return outcome.answer == "infeasible" and has_witness(outcome.family)


def solved(outcome: Outcome, limit: float) -> bool:
    """Certified, whole, without fault and in time; without a solution: refused."""
    if outcome.family in INFEASIBLE:
        return outcome.answer in REFUSED
    return whole(outcome) and not outcome.faults and outcome.plan_s <= limit


def _mean(values: Iterable[float | None], digits: int) -> str:
    known = [value for value in values if value is not None]
    return f"{np.mean(known):.{digits}f}" if known else "-"


def _row(own: list[Outcome], limit: float) -> str:
    family, done = own[0].family, [o for o in own if solved(o, limit)]
    times = [o.plan_s for o in done]
    most = [o.most_knees for o in done if o.most_knees is not None]
    room = [o.clearance_m for o in done if o.clearance_m is not None]
    proved = sum(o.answer == "infeasible" for o in own)
    cells = [
        family,
        own[0].method,
        f"{len(done)}/{len(own)} ({len(done) / len(own):.0%})",
        f"{np.median(times):.2f}" if times else "-",
        f"{np.percentile(times, 95):.2f}" if times else "-",
        _mean((o.knees for o in done), 2),
        max(most, default="-"),
        proved_mm(min(room)).removesuffix(" mm") if room else "-",
        proved,
        sum(map(bad_plan, own)),
        sum(map(false_proof, own)) if has_witness(family) else "-",
    ]
    return "| " + " | ".join(map(str, cells)) + " |"


def table(outcomes: list[Outcome], limit: float) -> str:
    """The results method by method and family by family as Markdown."""
    lines = [
        "| family | method | solved, or rightly refused | median [s] | p95 [s] "
        "| knees, mean | most | least clearance [mm] | proved to have no plan "
        "| bad plans | false proofs |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    order = {family: k for k, family in enumerate(FAMILIES)}
    groups = {(o.method, order[o.family], o.family) for o in outcomes}
    for method, _, family in sorted(groups):
        own = [o for o in outcomes if (o.method, o.family) == (method, family)]
        lines.append(_row(own, limit))
    return "\n".join(lines)


def comparison(outcomes: list[Outcome], limit: float) -> str:
    """Feasible problems that each method solves, and how many of them ours solves."""
    feasible = [o for o in outcomes if o.family not in INFEASIBLE]
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


def missed(outcomes: list[Outcome], limit: float) -> str:
    """What our strategy does not solve, by name."""
    lines = [
        f"* {o.problem}: {o.answer}, {o.coverage:.1%} drawn, {o.plan_s:.1f} s. "
        f"{o.reason[:200]} {o.faults}".rstrip()
        for o in outcomes
        if o.method == OURS and (not solved(o, limit) or bad_plan(o))
    ]
    return "\n".join(lines) or "None."


def not_run(outcomes: list[Outcome]) -> str:
    """Families that nothing was planned of, where not those of HRM-1000 are asked."""
    run = {o.family for o in outcomes}
    missing = [f for f in FAMILIES if f not in run]
    return f" Not run: {', '.join(missing)}." if missing and run != {*FIRST} else ""


def title(outcomes: list[Outcome], version: int) -> str:
    """Which benchmark it is: the families of HRM-1000 are a part of HRM-2000."""
    if {o.family for o in outcomes} == {*FIRST}:
        return f"HRM-1000, as planned in HRM-2000, version {version}"
    return f"HRM-2000, version {version}"


def document(outcomes: list[Outcome], settings: dict[str, Any]) -> str:
    """The whole page."""
    limit = settings["time_limit_s"]
    versions = ", ".join(f"{k} {v}" for k, v in settings["versions"].items())
    counts = Counter(o.method for o in outcomes)
    tried = ", ".join(f"{count} by {method}" for method, count in counts.items())
    return (
        f"# {title(outcomes, settings['benchmark'])}\n\n"
        f"Problems tried: {tried}.{not_run(outcomes)} Limit {limit:g} s of processor "
        f"time for planning, without the proof; times and knees are of what is solved. "
        f"{settings['processor']}, {settings['processes']} processes while the machine "
        f"had other work; Python {settings['python']}, {versions}, code "
        f"{settings['code']}.\n\n"
        f"{table(outcomes, limit)}\n\n"
        "A bad plan is one that the verifier certified and dense sampling refutes, or "
        "of a problem that has no solution. A false proof says of a problem with a "
        "witness that it has none.\n\n"
        f"## What others solve\n\n{comparison(outcomes, limit)}\n\n"
        f"## What `{OURS}` misses\n\n{missed(outcomes, limit)}\n"
    )
