"""The page of the benchmark."""

from collections.abc import Iterable, Sequence
from importlib.metadata import PackageNotFoundError, version
from itertools import groupby

import numpy as np

from benchmarks.common import described, surroundings
from benchmarks.foreign_plans.judges import DENSE, DENSITIES, Judged, Plan
from benchmarks.foreign_plans.problems import Problem
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.records import Verdict

DEFAULT = 0.01
"""OMPL's resolution where nobody states one; [-]."""

HEAD = (
    "robot",
    "resolution",
    "plans",
    "collide",
    "deeper than 1 mm",
    "deepest [mm]",
    *(f"missed at {name}" for name in DENSITIES),
    "undecided",
    "median [ms]",
    "p99 [ms]",
    "repaired within 1 s",
    "repair, median [s]",
)

PROOFS = (
    "robot",
    "resolution",
    "certificates",
    "accepted",
    "median [kB]",
    "largest [kB]",
    "checked in, median [s]",
    "longest [s]",
    "grazing, answered",
    "median [ms]",
    "longest [ms]",
)


def document(judged: Sequence[Judged], unplanned: Sequence[Problem]) -> str:
    """One table, and above it the sentence that it comes to."""
    groups = [list(group) for _, group in groupby(sorted(judged, key=_key), _key)]
    faults = [o for o in judged if o.fault]
    lines = [
        "# Plans of OMPL, judged",
        _sentence(judged),
        "RRTConnect with OMPL's simplification, fixed seed, on problems of "
        "MotionBenchMaker; links and obstacles as the convex bodies that the plan was "
        "made with: the hull of each mesh, and several where a problem's own start or "
        "goal collides with one hull. Missed: plans that collide and in which samples "
        "of that density (part of the space's extent, the fastest joint, the fastest "
        "frame) meet no collision. Deepest: by Coal. Times: processor time of a whole "
        "verification, Pinocchio and Coal included, the least of three, one thread; of "
        f"all plans with one hull a mesh {_all(judged)}. Repaired: of what collides. "
        "`python -m benchmarks.foreign_plans.run`.",
        _table(HEAD, map(_row, groups)),
        f"Verdicts that Coal contradicts: {len(faults)} (in {DENSE:,} states of each "
        "certified plan it looks for a contact). Problems and resolutions "
        f"without a plan: {len(unplanned)}"
        f"{_where(unplanned)}.",
        "Certificates of the plans that are certified, and how long the separate "
        "program checks them. Grazing: each of these plans once more with a required "
        "clearance 2 um below its least one and once 2 um above; answered where the "
        "one is certified and the other refuted. The longer of both times, each the "
        "least of three.",
        _table(PROOFS, filter(None, map(_proofs, groups))),
        described(surroundings()).rstrip(".") + f", {_ompl()}.",
    ]
    return "\n\n".join(lines) + "\n"


def _all(judged: Sequence[Judged]) -> str:
    """Median and 99th percentile of the times of all robots' plans."""
    spent = [one.milliseconds for one in judged if one.plan.parts == 1]
    if not spent:
        return "none"
    low, high = np.percentile(spent, [50, 99])
    return f"{low:.1f} ms in the median, {high:.1f} at the 99th percentile"


def _ompl() -> str:
    """The planner's version; plans from a file need none to be judged."""
    try:
        return f"ompl {version('ompl')}"
    except PackageNotFoundError:
        return "ompl not installed"


def _key(one: Judged) -> tuple[str, int, float]:
    return one.plan.robot, one.plan.parts, -one.plan.resolution


def _robot(plan: Plan) -> str:
    """The robot of a row, and what stands for its meshes where that is not a hull."""
    return plan.robot if plan.parts == 1 else f"{plan.robot}, {plan.parts} hulls a mesh"


def _sentence(judged: Sequence[Judged]) -> str:
    """What the proof finds in plans at OMPL's default resolution."""
    default = [one for one in judged if one.plan.resolution == DEFAULT]
    lost = [one for one in default if one.verdict == Verdict.REFUTED.value]
    hidden = sum(not one.caught[0] for one in lost)
    worst = MM_PER_M * max((one.depth for one in lost), default=0.0)
    return (
        f"**Of {len(default)} plans that OMPL's RRTConnect returns at its default "
        f"resolution, {len(lost)} collide, {hidden} of them in no state at that "
        f"resolution, the worst {worst:.1f} mm deep.**"
    )


def _row(judged: Sequence[Judged]) -> tuple[str, ...]:
    lost = [one for one in judged if one.verdict == Verdict.REFUTED.value]
    depth = [MM_PER_M * one.depth for one in lost]
    spent = [one.milliseconds for one in judged]
    repairs = [one.repair_s for one in lost]
    missed = [sum(not one.caught[k] for one in lost) for k in range(len(DENSITIES))]
    return (
        _robot(judged[0].plan),
        f"{judged[0].plan.resolution:g}",
        str(len(judged)),
        f"{len(lost)} ({100 * len(lost) / len(judged):.0f} %)",
        str(sum(value > 1.0 for value in depth)),
        f"{max(depth, default=0.0):.1f}",
        *map(str, missed),
        str(sum(one.verdict == Verdict.UNDECIDED.value for one in judged)),
        f"{np.median(spent):.1f}",
        f"{np.percentile(spent, 99):.1f}",
        f"{sum(second <= 1.0 for second in repairs)} of {len(repairs)}",
        f"{np.median(repairs) if repairs else np.nan:.2f}",
    )


def _proofs(judged: Sequence[Judged]) -> tuple[str, ...]:
    """What the certificates come to; nothing where there are none."""
    proofs = [one.proof for one in judged if one.proof]
    if not proofs:
        return ()
    sizes = [one.size / 1e3 for one in proofs]
    checked = [one.checked_s for one in proofs]
    grazing = [one.grazing_ms for one in proofs]
    return (
        _robot(judged[0].plan),
        f"{judged[0].plan.resolution:g}",
        str(len(proofs)),
        str(sum(one.accepted for one in proofs)),
        *(f"{value:.1f}" for value in (np.median(sizes), max(sizes))),
        *(f"{value:.2f}" for value in (np.median(checked), max(checked))),
        f"{sum(one.grazing for one in proofs)} of {len(proofs)}",
        *(f"{value:.0f}" for value in (np.median(grazing), max(grazing))),
    )


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)


def _where(unplanned: Sequence[Problem]) -> str:
    """In which sets, in brackets."""
    sets = sorted({f"{one.robot} {one.family}" for one in unplanned})
    return f" ({', '.join(sets)})" if sets else ""
