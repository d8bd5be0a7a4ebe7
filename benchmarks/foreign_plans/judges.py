"""Verdicts on one plan: by samples of several densities, and by the proof."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from math import inf, nan
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np

from benchmarks.foreign_plans.sampled import Sampled
from vdsm_pin.api import write_certificate
from vdsm_pin.certificate_checker import check_certificate
from vdsm_pin.errors import Infeasible
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.repair.robot import repair_robot
from vdsm_pin.robots.cell import Cell
from vdsm_pin.robots.judgement import RobotVerification, verify_robot
from vdsm_pin.verification.records import CLEARANCES, Verdict, combine

DENSITIES: Final = ("0.01", "0.005", "1 deg", "1 mm")
"""Of samples: parts of the space's extent, the fastest joint, the fastest frame."""

DENSE: Final = 100_000
"""Samples that look for what is wrong in a certified plan."""

RUNS: Final = 3
"""Of a verification, the quickest of which counts."""

AGREED: Final = 1e-6
"""Contact within which no verdict is asked; [m]."""

BOTH: Final = ("required_clearance", "required_self_clearance")

GRAZE: Final = 2e-6
"""A clearance that is asked for is so near to the least one, to either side; [m]."""


@dataclass(frozen=True)
class Plan:
    """A plan of OMPL.

    Args:
        robot: Name of the robot.
        family: The problem's set.
        number: The problem.
        resolution: At which it was planned; [-].
        waypoints: Rows of joint values; [rad].
        parts: Hulls that stand for the mesh of a link in it.
    """

    robot: str
    family: str
    number: int
    resolution: float
    waypoints: list[list[float]]
    parts: int = 1


@dataclass(frozen=True)
class Judged:
    """One plan and what each judge says.

    Args:
        plan: The plan.
        verdict: By the proof, of all clearances.
        milliseconds: Processor time of the whole verification, the least of some; [ms].
        caught: Which densities of samples meet a collision.
        depth: The deepest that samples each 1 mm and the witness find; [m].
        fault: Where judges contradict each other; empty where not.
        repair_s: Processor time of its repair; inf where there is none, NaN where none
            is asked for; [s].
        proof: Of a certified plan, what its certificate is; None of others.
    """

    plan: Plan
    verdict: str
    milliseconds: float
    caught: list[bool]
    depth: float
    fault: str
    repair_s: float
    proof: "Proof | None" = None


@dataclass(frozen=True)
class Proof:
    """The certificate of a plan, and the same plan where it just grazes.

    Args:
        size: Of the certificate; [bytes].
        checked_s: Processor time of its checking; [s].
        accepted: Whether the checker accepts it.
        grazing_ms: Processor time of judging the plan against clearances that are
            `GRAZE` below and above its least one, the longer one, each the least of
            several runs; [ms].
        grazing: Whether the one is certified and the other refuted.
    """

    size: int
    checked_s: float
    accepted: bool
    grazing_ms: float
    grazing: bool


def judge(plan: Plan, sampled: Sampled, asked: Cell) -> Judged:
    """Judge a plan.

    Args:
        plan: The plan.
        sampled: The oracle.
        asked: As the proof reads it, from a problem file.
    """
    rows = np.array(plan.waypoints)
    joints = tuple(joint.name for joint in asked.robot.joints)
    motion = JointTrajectory(joints, rows)
    first = JointTrajectory(joints, rows[:1])
    verify_robot(Cell(asked.robot, asked.scene), first)  # compiled, nothing kept
    spent = inf
    for _ in range(RUNS):
        begin = time.process_time()
        cell = Cell(asked.robot, asked.scene)
        found = verify_robot(cell, motion, contacts=False)
        spent = min(spent, 1e3 * (time.process_time() - begin))
    about = [one.verdict for one in found.checks if one.name in CLEARANCES]
    verdict = combine(tuple(about))
    extent = np.linalg.norm(np.ptp(sampled.limits, axis=0))
    states = [_samples(rows, count) for count in _counts(sampled, float(extent))]
    hits = [[q for q in some if sampled.collides(q)] for some in states]
    least = min((sampled.clearance(q) for q in hits[-1]), default=0.0)
    near = sampled.clearance(_witness(found))
    seconds, fault = nan, _fault(sampled, rows, verdict, bool(hits[-1]), near)
    if verdict is Verdict.REFUTED:
        seconds, repaired = _repair(cell, motion)
        fault += _fault(sampled, repaired, Verdict.CERTIFIED, hit=False, near=0.0)
    proof = _proof(asked, motion) if verdict is Verdict.CERTIFIED else None
    return Judged(
        plan=plan,
        verdict=verdict.value,
        milliseconds=spent,
        caught=[bool(some) for some in hits],
        depth=-min(least, near, 0.0),
        fault=fault,
        repair_s=seconds,
        proof=proof,
    )


def _proof(asked: Cell, motion: JointTrajectory) -> Proof:
    """The certificate of a plan, checked, and the plan where it grazes."""
    found = verify_robot(asked, motion, contacts=False)
    least = float(found.least.lower.min())
    said, spent = [], 0.0
    for clearance in (least - GRAZE, least + GRAZE):
        just, least_ms = max(clearance, 0.0), inf
        for _ in range(RUNS):
            begin = time.process_time()
            near = verify_robot(replace(asked, **{name: just for name in BOTH}), motion)
            least_ms = min(least_ms, 1e3 * (time.process_time() - begin))
        spent = max(spent, least_ms)
        said.append(
            combine(tuple(o.verdict for o in near.checks if o.name in CLEARANCES))
        )
    with TemporaryDirectory() as folder:
        file, rows = Path(folder) / "c.certificate", Path(folder) / "c.csv"
        write_certificate(found, file)
        begin, problem = time.process_time(), asked.files[0]
        accepted = check_certificate(file, problem, rows).accepted
        seconds, size = time.process_time() - begin, file.stat().st_size
    grazing = said == [Verdict.CERTIFIED, Verdict.REFUTED]
    return Proof(size, seconds, accepted, spent, grazing)


def _repair(cell: Cell, motion: JointTrajectory) -> tuple[float, FloatArray]:
    """Processor time of a repair, inf where there is none, and its waypoints."""
    begin = time.process_time()
    try:
        repaired = repair_robot(cell, motion).trajectory.q
    except Infeasible:
        return inf, np.zeros((0, motion.q.shape[1]))
    return time.process_time() - begin, repaired


def _counts(
    sampled: Sampled, extent: float
) -> list[Callable[[FloatArray, FloatArray], float]]:
    """How many steps each density asks for between two waypoints."""
    return [
        lambda a, b: float(np.linalg.norm(b - a)) / (0.01 * extent),
        lambda a, b: float(np.linalg.norm(b - a)) / (0.005 * extent),
        lambda a, b: float(np.degrees(np.abs(b - a).max())),
        lambda a, b: sampled.travel(a, b) / 1e-3,
    ]


def _samples(
    plan: FloatArray, count: Callable[[FloatArray, FloatArray], float]
) -> FloatArray:
    """States along a plan, waypoints among them, shape (n_states, n); [rad]."""
    rows = [plan[:1]]
    for a, b in pairwise(plan):
        shares = np.linspace(0.0, 1.0, int(np.ceil(max(count(a, b), 1.0))) + 1)[1:]
        rows.append(a + shares[:, None] * (b - a))
    return np.concatenate(rows)


def _witness(found: RobotVerification) -> FloatArray:
    """The configuration at which the proof finds two bodies nearest; [rad]."""
    worst = [int(np.argmin(found.least.upper))]
    least, path = found.least, found.trajectory.path
    return path.within(least.interval[worst], least.share[worst])[0]


def _fault(
    sampled: Sampled, plan: FloatArray, verdict: Verdict, hit: bool, near: float
) -> str:
    """How the oracle contradicts the proof; empty where it does not."""
    if verdict is Verdict.REFUTED and near > AGREED:
        return f"refuted, and Coal finds {1e3 * near:.4f} mm at the witness"
    if verdict is not Verdict.CERTIFIED:
        return ""
    dense = -(-DENSE // max(len(plan) - 1, 1))
    if hit or any(sampled.meets(a, b, dense) for a, b in pairwise(plan)):
        return "certified, and a sample collides"
    return ""
