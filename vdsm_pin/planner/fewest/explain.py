"""What is told where there is no plan: a proof, or how far a search came and why."""

from contextlib import suppress
from dataclasses import replace

import numpy as np

from vdsm_pin.errors import (
    CutOff,
    HemmedIn,
    Infeasible,
    NoPlanFound,
    OutOfReach,
    OutOfTime,
    PathBlocked,
    Reached,
)
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.feasibility import curled_reach, rail_distance
from vdsm_pin.planner.fewest.charts import standing
from vdsm_pin.planner.fewest.explore import Explored
from vdsm_pin.planner.fewest.stuck import (
    Passage,
    at_reach,
    following,
    narrowest_passage,
    no_way_in,
    on_the_path,
    passage,
    too_narrow,
    where_stuck,
)
from vdsm_pin.planner.path_rows import PathRows
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.planner.time_limit import deadline_of
from vdsm_pin.planner.upper_clearance import (
    culprit,
    named,
    nearest,
)
from vdsm_pin.problem.desired_path import Blocked
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.progress import say
from vdsm_pin.time_limit import Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import at_most_mm, in_mm


def refuse_proved(problem: PlanningProblem, outcome: Explored) -> None:
    """Raise where it is proved that nothing of the path can be drawn.

    Where the problem allows no detour, something that cannot be drawn is enough. A
    single row is no proof: the tip may pass it between two waypoints. But no plan is
    looked for that has no waypoint there.

    Raises:
        NoPlanFound: Where there is no waypoint at a single row.
        OutOfReach: Beyond the reach of the curled arm.
        PathBlocked: Too much of the path lies within an obstacle's margin.
        HemmedIn: The last link has no room at too much of the path.
        CutOff: No way leads to too much of the path.
    """
    rows, proof = outcome.rows, outcome.proof
    # Both ends of an undrawable stretch are undrawable rows.
    both = proof.undrawable[:-1] & proof.undrawable[1:]
    lost = float(np.diff(rows.stations)[both].sum())
    whole = problem.path.blocked is Blocked.FAIL
    if proof.undrawable.all() or (whole and lost > 0.0):
        raise _proved(problem, outcome)
    if whole and proof.undrawable.any():
        message = f"{_proved(problem, outcome)}; plans have a waypoint there"
        raise NoPlanFound(message)


def refuse(problem: PlanningProblem, outcome: Explored) -> None:
    """Raise where no motion was found, or none that draws the whole path; no proof.

    Less will do where the problem allows detours.

    Raises:
        NoPlanFound: The search did not get that far.
    """
    missing = problem.path.length - _drawn(problem, outcome)
    allowed = TOLERANCES.coverage * problem.path.length
    whole = problem.path.blocked is Blocked.FAIL
    if outcome.found is None or (whole and missing > allowed):
        reached = how_far(problem, outcome, outcome.judge.clearance)
        raise NoPlanFound(str(reached), reached)


def _drawn(problem: PlanningProblem, outcome: Explored) -> float:
    """Length of the path that the motion found draws; [m]."""
    found = outcome.found
    return 0.0 if found is None else problem.path.length - found.not_drawn


def _proved(problem: PlanningProblem, outcome: Explored) -> Infeasible:
    rows, proof = outcome.rows, outcome.proof
    if proof.far.any():
        return _out_of_reach(problem, rows)
    if not proof.buried.any() and proof.hemmed_in.any():
        first = int(np.flatnonzero(proof.hemmed_in)[0])
        return HemmedIn(station=problem.path.within(rows.stations[first]))
    if not proof.buried.any():
        first = int(np.flatnonzero(proof.cut_off)[0])
        tip, clearance = rows.tips[first], outcome.judge.clearance
        passed = narrowest_passage(problem, clearance, tip)
        words = "" if passed is None else passage(problem, passed.place)
        return CutOff(
            station=problem.path.within(rows.stations[first]), narrowest=words
        )
    first = int(np.flatnonzero(proof.buried)[0])
    name, least = nearest(problem, rows.tips[first])
    least -= float(problem.manipulator.axis_radii[-1])
    station = problem.path.within(rows.stations[first])
    return PathBlocked(
        obstacle=name,
        station=station,
        reason=(
            f"at {in_mm(station)} along the path the tip itself would "
            f"have at most {at_most_mm(least)} to it, required are "
            f"{in_mm(problem.required_clearance)}"
        ),
    )


def _out_of_reach(problem: PlanningProblem, rows: PathRows) -> OutOfReach:
    """The tip that lies farthest off, whatever the base does or from where it ends."""
    arm, tips = problem.manipulator, rows.tips
    distance, reach = np.hypot(tips[:, 1], tips[:, 2]), curled_reach(arm)
    reason = "every joint at its limit, Eq. 4"
    if not distance.max() > reach:
        distance, reach = rail_distance(arm, tips), arm.total_length
        reason = "the straight arm, the base at the end of its rail"
    worst = int(np.argmax(distance))
    station = problem.path.within(rows.stations[worst])
    return OutOfReach(
        place=f"the tip at {in_mm(station)} along the path",
        distance=float(distance[worst]),
        reach=reach,
        reason=reason,
    )


def say_drawn(problem: PlanningProblem, outcome: Explored) -> None:
    """Say how much of the path can be drawn by now, and how far the tip comes on it."""
    if outcome.found is None:
        return
    drawn, length = _drawn(problem, outcome), problem.path.length
    corners = outcome.found.corners
    on = np.flatnonzero(corners.drawn)
    bends = outcome.judge.bends(corners.tips[on], corners.offsets[on])
    most = int((bends > TOLERANCES.changed_angle).sum(axis=1).max())
    if length == 0.0:
        say("reaches the goal, bending at most %d joints", most)
        return
    last = in_mm(problem.path.within(corners.stations[1:][on].max()))
    say(
        "draws %s of %s of the path, up to %s along it, bending at most %d joints",
        in_mm(drawn), in_mm(length), last, most,
    )  # fmt: skip


def how_far(
    problem: PlanningProblem, outcome: Explored, clearance: LinkClearance
) -> Reached:
    """Where the search came to an end, what stopped it, what to try; not a proof.

    Args:
        problem: What was asked.
        outcome: What the search came to.
        clearance: The planner's own, as long as the cause may be looked for.
    """
    drawn = _drawn(problem, outcome)
    route = None if outcome.found is None else outcome.found.route
    if outcome.found is not None and drawn >= problem.path.length:
        whole = "a motion that draws the whole path was found, but not finished"
        return Reached(whole, problem.path.length)
    stations = outcome.rows.stations
    station, stop, tip = float(stations[0]), float(stations[-1]), outcome.rows.tips[0]
    if outcome.found is not None and route is not None:
        skipped = [k for k in outcome.found.skipped if not route.undrawable[k]]
        if skipped:
            station, stop = route.stations[skipped[0] - 1 : skipped[0] + 1].tolist()
            tip = route.tips[route.layers[skipped[0]]]
    length, place = problem.path.length, problem.in_file(tip)
    words = (
        f"drew {in_mm(drawn)} of {in_mm(length)}; the first stretch not drawn begins "
        f"at {in_mm(problem.path.within(station))} along the path, tip {place}"
        if length > 0.0
        else f"the tip did not reach {place}"
    )
    rows = outcome.rows.tips[(stations >= station) & (stations <= stop)]
    cause = _seen(problem, outcome, clearance, rows) or at_reach(problem, rows)
    if cause is None:
        passed = narrowest_passage(problem, clearance, tip)
        cause = _on_the_way(problem, passed, tip, deadline_of(clearance))
    told = f"{words}; {cause.words}" if cause.words else words
    return replace(cause, words=told, station=problem.path.within(station))


def _seen(
    problem: PlanningProblem,
    outcome: Explored,
    clearance: LinkClearance,
    tips: FloatArray,
) -> Reached | None:
    """What is seen on a stretch of the path, (r, 3), or where an arm got stuck."""
    kept, stuck = outcome.judge.required, outcome.stuck
    with suppress(OutOfTime):
        cause = on_the_path(problem, clearance, tips, kept)
        if cause is None and stuck is not None:
            cause = where_stuck(problem, stuck, deadline_of(clearance))
        return cause
    return None


def _on_the_way(
    problem: PlanningProblem,
    passed: Passage | None,
    tip: FloatArray,
    deadline: Deadline,
) -> Reached:
    """What is in the way to a tip: the passage, the follower, the straight arm.

    Args:
        problem: Arm and scene.
        passed: The best way in, None where none is known.
        tip: Shape (3,); [m].
        deadline: Until when to look at the follower.
    """
    advice, parts = "another start or a longer time limit", list[str]()
    if passed is not None:
        if too_narrow(problem, passed.place):
            return no_way_in(problem, passed.place)
        parts.append(passage(problem, passed.place))
        with suppress(OutOfTime):
            follower = following(problem, passed.route, deadline)
            parts.append(follower.words)
            advice = f"{follower.advice} or {advice}" if follower.advice else advice
    zero = np.zeros((1, problem.manipulator.n_links + 1, 2))
    centres = standing(problem.manipulator, tip[None], zero)[0]
    if not problem.scene.obstacles or not np.isfinite(centres).all():
        return Reached("; ".join(parts))
    found = culprit(problem, centres)
    if found.clearance == np.inf:
        return Reached("; ".join(parts))
    called = named(problem.manipulator, found.link)
    words = f"{called} of the straight arm there has {found.words} to"
    parts += [f"{words} {found.obstacle!r}", f"try {advice}"]
    return Reached("; ".join(parts), 0.0, found.link, found.obstacle)
