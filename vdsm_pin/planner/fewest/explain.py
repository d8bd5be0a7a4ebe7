"""What the user is told: why there is no plan, and what is proved about a plan."""

import itertools
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
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.feasibility import curled_reach, rail_distance
from vdsm_pin.planner.fewest.explore import Explored
from vdsm_pin.planner.fewest.motion import Corners, standing
from vdsm_pin.planner.fewest.narrow_passage import Passage, narrowest_passage
from vdsm_pin.planner.fewest.pose_kernels import bends_of
from vdsm_pin.planner.fewest.route import PathRows
from vdsm_pin.planner.fewest.stuck import (
    at_reach,
    following,
    no_way_in,
    on_the_path,
    passage,
    too_narrow,
    where_stuck,
)
from vdsm_pin.planner.impossible.bounds import least_changed
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.planner.time_limit import deadline_of
from vdsm_pin.planner.upper_clearance import (
    TIP_ONLY,
    culprit,
    held_from,
    named,
    nearest,
    upper_clearance,
)
from vdsm_pin.problem.desired_path import Blocked
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
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
    if outcome.found is None:
        return 0.0
    stations = outcome.found.route.stations
    skipped = outcome.found.skipped
    undrawn = sum(float(stations[k] - stations[k - 1]) for k in skipped)
    return problem.path.length - undrawn


def _proved(problem: PlanningProblem, outcome: Explored) -> Infeasible:
    rows, proof = outcome.rows, outcome.proof
    if proof.far.any():
        return _out_of_reach(problem, rows)
    if not proof.buried.any() and proof.hemmed_in.any():
        first = int(np.flatnonzero(proof.hemmed_in)[0])
        return HemmedIn(station=_station(problem, rows.stations[first]))
    if not proof.buried.any():
        first = int(np.flatnonzero(proof.cut_off)[0])
        tip, clearance = rows.tips[first], outcome.judge.clearance
        passed = narrowest_passage(problem, clearance, tip)
        words = "" if passed is None else passage(problem, passed.place)
        return CutOff(station=_station(problem, rows.stations[first]), narrowest=words)
    first = int(np.flatnonzero(proof.buried)[0])
    name, least = nearest(problem, rows.tips[first])
    least -= float(problem.manipulator.axis_radii[-1])
    station = _station(problem, rows.stations[first])
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
    station = _station(problem, rows.stations[worst])
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
    last = in_mm(_station(problem, corners.stations[1:][on].max()))
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
    words = (
        f"drew {in_mm(drawn)} of {in_mm(problem.path.length)}; the first stretch not "
        f"drawn begins at {in_mm(_station(problem, station))} along the path, tip "
        f"{problem.in_file(tip)}"
    )
    rows = outcome.rows.tips[(stations >= station) & (stations <= stop)]
    cause = _seen(problem, outcome, clearance, rows) or at_reach(problem, rows)
    if cause is None:
        passed = narrowest_passage(problem, clearance, tip)
        cause = _on_the_way(problem, passed, tip, deadline_of(clearance))
    told = f"{words}; {cause.words}" if cause.words else words
    return replace(cause, words=told, station=_station(problem, station))


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


def notes_of(
    problem: PlanningProblem,
    clearance: LinkClearance,
    outcome: Explored,
    trajectory: Trajectory,
    centres: FloatArray,
) -> tuple[str, ...]:
    """Notes of a plan: its order, how sparse it is, what is proved.

    Args:
        problem: What was asked.
        clearance: Clearance of links at given joint centres.
        outcome: What the search came to.
        trajectory: The plan's rows.
        centres: Joint centres of every row, shape (r, N + 1, 3); [m].

    Returns:
        One sentence each.
    """
    notes = _order(problem, outcome)
    on_path = trajectory.on_path
    if not on_path.any():
        return tuple(notes)
    angles = bends_of(centres[on_path])
    changed = (angles > TOLERANCES.changed_angle).sum(axis=1)
    tips = centres[on_path, -1]
    # No more than two are ever proved necessary.
    few, least = changed <= 2, np.zeros_like(changed)
    with suppress(OutOfTime):  # then nothing is said of it
        least[few] = least_changed(held_from(problem), clearance, tips[few])
    if (changed < least).any():
        worst = int(np.flatnonzero(changed < least)[0])
        message = (
            f"internal error: at tip {tips[worst].tolist()} the plan changes "
            f"{changed[worst]} link angles and {least[worst]} were proved necessary"
        )
        raise RuntimeError(message)
    notes += minimal(changed, least)
    connections = _connections(on_path)
    if len(connections) > 1:
        often = "once" if len(connections) == 2 else f"{len(connections) - 1} times"
        notes.append(f"the tip leaves the path {often} to let the arm change sides")
    retreat = problem.path.retreat
    back = _farthest_back(trajectory, centres[:, -1], connections)
    if back > retreat + TOLERANCES.tip_on_path:
        notes.append(
            f"off the path the tip steps back by up to {in_mm(back)}, more than the "
            f"retreat of {in_mm(retreat)}: no change of sides was found within it"
        )
    return tuple(notes)


def minimal(changed: IntArray, least: IntArray) -> list[str]:
    """At how many waypoints as few link angles change as must; nothing if nowhere."""
    proved = int((changed == least).sum())
    if not proved:
        return []
    return [
        f"the number of changed link angles is proved minimal at {proved} of "
        f"{len(changed)} waypoints on the path: fewer, counting up to "
        f"{np.rad2deg(TOLERANCES.changed_angle):.2g}° as unchanged, would break a "
        "limit or the clearance there"
    ]


def _connections(on_path: BoolArray) -> list[tuple[int, int]]:
    """Runs of rows off the path: their first row and the row past their last."""
    marks = np.flatnonzero(np.diff(on_path.astype(np.int64))) + 1
    edges = [0, *marks.tolist(), len(on_path)]
    return [(a, b) for a, b in itertools.pairwise(edges) if not on_path[a]]


def _farthest_back(
    trajectory: Trajectory, tips: FloatArray, connections: list[tuple[int, int]]
) -> float:
    """How far the tip goes behind both ends of a way; [m]."""
    worst = 0.0
    for a, b in connections:
        ends = min(tips[max(a - 1, 0), 0], tips[min(b, len(tips) - 1), 0])
        worst = max(worst, float(ends - tips[a:b, 0].min()))
    return worst


def _order(problem: PlanningProblem, outcome: Explored) -> list[str]:
    """In which order and directions the pieces are drawn, where it is not as given."""
    assert outcome.found is not None
    ends = _pieces(outcome.found.corners)
    if all(np.diff(np.array(ends).ravel()) >= 0.0):
        return []
    pieces = ", then ".join(_stretch(problem, a, b) for a, b in ends)
    return [f"drawn in another order than given, as the problem allows: {pieces}"]


def _pieces(corners: Corners) -> list[tuple[float, float]]:
    """Stations between which the path is drawn in one direction, piece by piece."""
    pieces: list[tuple[float, float]] = []
    going, way = False, 0.0
    for k, drawn in enumerate(corners.drawn.tolist()):
        a, b = float(corners.stations[k]), float(corners.stations[k + 1])
        if drawn and going and (b - a) * way >= 0.0:
            pieces[-1] = (pieces[-1][0], b)
            way = way or b - a
        elif drawn:
            pieces.append((a, b))
            way = b - a
        going = drawn
    return pieces


def undrawn(problem: PlanningProblem, outcome: Explored) -> tuple[str, ...]:
    """Each stretch that is not drawn, and why."""
    assert outcome.found is not None
    route = outcome.found.route
    stretches = []
    stretch: list[int] = []
    skipped = outcome.found.skipped
    for k, after in itertools.zip_longest(skipped, skipped[1:]):
        stretch.append(k)
        if after == k + 1 and route.undrawable[after] == route.undrawable[k]:
            continue
        a, b = float(route.stations[stretch[0] - 1]), float(route.stations[k])
        why = "no way was found, which proves nothing"
        if route.undrawable[k]:
            why = f"proved: {_why_undrawable(problem, outcome, a, b)}"
        stretches.append(f"{_stretch(problem, a, b)} along the path ({why})")
        stretch = []
    return tuple(stretches)


def _stretch(problem: PlanningProblem, a: float, b: float) -> str:
    """Where a stretch of the path begins and ends, in words."""
    a, b = (_station(problem, station) for station in (a, b))
    return f"from {in_mm(a)} to {in_mm(b)}"


def _station(problem: PlanningProblem, station: float) -> float:
    """A station within the path, as problems count it; [m]."""
    return float(problem.path.wrapped(np.array(station)))


def _why_undrawable(
    problem: PlanningProblem, outcome: Explored, start: float, stop: float
) -> str:
    """Why nobody can draw some of the path between two stations, in words."""
    rows, proof = outcome.rows, outcome.proof
    here = (rows.stations >= start) & (rows.stations <= stop)
    reasons = []
    if (proof.far & here).any():
        reasons.append("beyond the reach of the arm")
    tips = rows.tips[proof.buried & here]
    if len(tips):
        problem = held_from(problem, TIP_ONLY)
        bounds = upper_clearance(problem, np.stack([tips, tips], axis=1))
        near = np.flatnonzero(bounds.min(axis=0) < problem.required_clearance)
        names = [repr(problem.scene.obstacles[int(o)].name) for o in near]
        reasons.append(f"within the margin of {', '.join(names)}")
    if (proof.hemmed_in & here).any():
        reasons.append("the last link has no room there")
    if (proof.cut_off & here).any():
        reasons.append("no way wide enough leads there")
    return " and ".join(reasons)
