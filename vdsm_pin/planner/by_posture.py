"""Paths of arms that cannot be fed: in joint space to where the path begins.

Where the rail is short no arm follows its tip in by an opening. It is brought through
joint space to a posture with the tip at the path's first point, and draws from there.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import islice
from typing import Final, TypeAlias

import numpy as np

from vdsm_pin.arm.kinematics import row_centres
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import Infeasible, NoPlanFound, OutOfTime
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.largest_margin import drawn_length
from vdsm_pin.planner.postures import brought_to, random_postures, within_limits
from vdsm_pin.planner.records import LinkClearance, Plan
from vdsm_pin.planner.rrt_connect import connected
from vdsm_pin.planner.start import start_joints
from vdsm_pin.planner.time_limit import deadline_of, with_share
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory

SHORT_RAIL: Final = 0.25
"""Length of the rail up to which an arm cannot be fed far; lengths of the arm."""
FED_SHARE: Final = 0.15
"""Part of the time for a plan from the start; [-]."""
SHARE: Final = 0.3
"""Part of the time left in which a path is drawn from one posture; [-]."""
POSTURES: Final = 400
"""Postures at random that are brought to the path's first point."""
PARENTS: Final = 40
"""The clearest of them, of which others are changed copies."""
ENOUGH: Final = 100
"""Clear ones at which no more are looked for."""
GENERATIONS: Final = 12
"""Times that those which are not clear are changed at most."""
TRIED: Final = 24
"""Clear postures, unlike each other, to which the start is joined."""
DRAWN: Final = 3
"""Plans by way of a posture after which the best one is taken."""

Planner: TypeAlias = Callable[[PlanningProblem, LinkClearance], Plan]
"""A strategy, told all but the problem and its clearance."""


def is_short(arm: Manipulator) -> bool:
    """Whether the rail is too short to feed the arm far."""
    low, high = arm.base_range
    return high - low <= SHORT_RAIL * arm.total_length


def with_postures(
    problem: PlanningProblem, clearance: LinkClearance, need: float, plan: Planner
) -> Plan:
    """A plan from the start; where it draws less than all, one by way of a posture.

    Args:
        problem: With a path.
        clearance: Clearance of links at given joint centres.
        need: Clearance to keep; [m].
        plan: Plans from a start.

    Raises:
        Infeasible: If there is none either way.
        OutOfTime: If none was found in time.
    """
    best: Plan | None = None
    ended: NoPlanFound | OutOfTime | None = None
    try:
        best = plan(problem, with_share(clearance, FED_SHARE))
    except (NoPlanFound, OutOfTime) as error:
        ended = error
    if best is not None and not best.undrawn:
        return best
    with suppress(OutOfTime):
        for found in islice(_by_postures(problem, clearance, need, plan), DRAWN):
            if best is None or drawn_length(found) > drawn_length(best):
                best = found
            if not best.undrawn:
                break
    if best is not None:
        return best
    assert ended is not None
    if isinstance(ended, NoPlanFound) or deadline_of(clearance).passed:
        raise ended
    return plan(problem, clearance)


def _by_postures(
    problem: PlanningProblem, clearance: LinkClearance, need: float, plan: Planner
) -> Iterator[Plan]:
    """Plans by way of one posture each."""
    arm, path, start = problem.manipulator, problem.path, start_joints(problem)
    ends = _postures(problem, clearance, start, need)
    while True:
        rows = connected(problem, clearance, start, ends, need)
        if rows is None:
            return
        posture = rows[-1]
        ends = ends[(ends != posture).any(axis=1)]
        tip = row_centres(arm, posture[None])[0, -1]
        begun = replace(
            path, start=tip, start_joints=posture, insertion=np.zeros((0, 3))
        )
        with suppress(Infeasible, OutOfTime):
            found = plan(replace(problem, tip_path=begun), with_share(clearance, SHARE))
            yield _begun_by(problem, rows[:-1], found)


def _postures(
    problem: PlanningProblem,
    clearance: LinkClearance,
    start: FloatArray,
    need: float,
) -> FloatArray:
    """Clear postures with the tip at the path's first point, unlike each other.

    Each posture at random goes on to what is clearer, until enough of them are clear.
    """
    arm, tip = problem.manipulator, problem.path.points[0]
    rng = np.random.default_rng(0)
    seeds = random_postures(arm, POSTURES, rng)
    seeds[::2] = start + rng.random((len(seeds[::2]), 1)) * (seeds[::2] - start)
    rows, there = brought_to(arm, seeds, tip)
    spare = np.where(there, _spare(problem, clearance, rows, need), -np.inf)
    for _ in range(GENERATIONS):
        if np.count_nonzero(spare >= 0.0) >= ENOUGH:
            break
        change = rng.random((POSTURES, 1)) ** 2 * random_postures(arm, POSTURES, rng)
        best = np.argsort(-spare, kind="stable")[:PARENTS]
        own = (spare >= 0.0) | (rng.random(POSTURES) < 0.5)
        parents = np.where(own, np.arange(POSTURES), rng.choice(best, POSTURES))
        moved, there = brought_to(arm, within_limits(arm, rows[parents] + change), tip)
        gained = np.where(there, _spare(problem, clearance, moved, need), -np.inf)
        better = (gained > spare) & (spare < 0.0)
        rows[better], spare[better] = moved[better], gained[better]
    return _unlike(rows[spare >= 0.0], start)


def _unlike(rows: FloatArray, start: FloatArray) -> FloatArray:
    """The posture nearest to a start, then always the one least like those before."""
    chosen: list[FloatArray] = []
    away = -np.abs(rows - start)[:, 1:].max(axis=1)
    for _ in range(min(TRIED, len(rows))):
        chosen.append(rows[int(np.argmax(away))])
        gap = np.abs(rows - chosen[-1])[:, 1:].max(axis=1)
        away = gap if len(chosen) == 1 else np.minimum(away, gap)
    return np.reshape(chosen, (-1, start.size))


def _spare(
    problem: PlanningProblem, clearance: LinkClearance, rows: FloatArray, need: float
) -> FloatArray:
    """What is left of the clearance of postures, from own bodies too; [m]."""
    own = problem.own_pairs.spare(rows[:, 1::2], rows[:, 2::2])
    links = clearance(row_centres(problem.manipulator, rows))
    least = links.min(axis=1, initial=np.inf) - need
    return np.asarray(np.minimum(least, own.min(axis=1, initial=np.inf)))


def _begun_by(problem: PlanningProblem, rows: FloatArray, plan: Plan) -> Plan:
    """A plan and its rivals, with rows before them that draw nothing."""
    told, count = plan.trajectory, len(rows)
    on = np.append(np.zeros(count, np.bool_), told.on_path)
    stations = np.append(np.full(count, told.path_m[0]), told.path_m)
    whole = Trajectory.of_joints(np.concatenate([rows, told.joints]), on, stations)
    note = (
        f"the arm is brought to the path through joint space, in {count} rows; other "
        "notes call its posture there the start"
    )
    return replace(
        plan.with_rows(whole),
        problem=problem,
        notes=(note, *plan.notes),
        rivals=tuple(_begun_by(problem, rows, rival) for rival in plan.rivals),
    )
