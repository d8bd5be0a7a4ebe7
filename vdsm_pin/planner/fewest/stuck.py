"""Where a search came to an end, what stopped it, and what might help.

Who calls says at which station it was: here the words begin with what stopped it. The
narrowest passage of the best way in need not be wide enough: a way of the tip is looked
for that may come nearer to obstacles than the body does, and the opening where it comes
nearest is measured in its middle. Nothing is proved.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vdsm_pin.errors import OutOfTime, Reached
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.planner.broad_phase import BroadPhase
from vdsm_pin.planner.feasibility import rail_distance
from vdsm_pin.planner.fewest.elastic_band import resampled
from vdsm_pin.planner.fewest.offset_kernels import bends_of
from vdsm_pin.planner.fewest.tip_cells import TipRoom
from vdsm_pin.planner.fewest.tip_routes import TipSpace
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.planner.start import start_centres
from vdsm_pin.planner.time_limit import deadline_of
from vdsm_pin.planner.tip_curve import led_along
from vdsm_pin.planner.upper_clearance import (
    TIP_ONLY,
    Culprit,
    culprit,
    held_from,
    named,
    nearest,
    upper_distances,
)
from vdsm_pin.problem.held import TIP
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import at_most_mm, in_mm

NEARER: Final = 0.6
"""How much nearer than the body a way in may come, over the body's radius; [-]."""
CELLS: Final = 60_000
"""Cells at which the search for it ends."""
WAY_STEP: Final = 0.02
"""Distance of its points over the arm's length; [-]."""
WAY_PLACES: Final = 20
"""Places between two of them at which it is measured."""
OPENINGS: Final = 12
"""Narrow places of a way of which the middle is looked for."""
ACROSS: Final = 16
"""Directions across the way that are tried."""
FIRST_STEP: Final = 0.3
"""The first step to the middle of an opening, over the body's radius; [-]."""
SHORTER: Final = 0.9
"""How much shorter each of them is than the one before; [-]."""
AT_LIMIT: Final = 0.97
"""Part of the largest link angle from which on a joint counts as at its limit; [-]."""
AT_END: Final = 1e-3
"""Distance of the base from an end of its rail, over the arm's length, up to which it
counts as there; [-]."""
SNUG: Final = 1.15
"""An opening up to this many times what the body needs counts as the reason; [-]."""

ROW_PLACES: Final = 8
"""Places looked at for each row of the path."""
AT_REACH: Final = 0.9995
"""Part of the arm's length from which on a path is too far from the rail; [-]."""


LONGER_RAIL: Final = "a longer rail (`base_range`)"
"""What might help a base at an end of its rail."""


@dataclass(frozen=True)
class Stuck:
    """The insertion that came farthest.

    Args:
        route: Of the tip from the start to the path, widest first tried, shape (k, 3),
            k >= 1; [m].
        come: Its points that the tip has reached, 1 to k.
        centres: Joint centres of the arm there, or on the path, shape (N + 1, 3); [m].
    """

    route: FloatArray
    come: int
    centres: FloatArray

    @property
    def part(self) -> float:
        """Part of the way in that the arm has come; [-]."""
        return self.come / len(self.route)


def where_stuck(
    problem: PlanningProblem, stuck: Stuck, deadline: Deadline = NO_LIMIT
) -> Reached:
    """The narrowest passage, how far the arm came, what to try.

    Args:
        problem: Arm and scene.
        stuck: Where it ended.
        deadline: When to give up.

    Raises:
        OutOfTime: If the time is over.
    """
    parts, narrowest = list[str](), list[float]()
    narrow, width = _opening(problem, stuck, deadline)
    if width < np.inf:
        parts.append(passage(problem, stuck.route[narrow]))
        narrowest = stuck.route[narrow].tolist()
    found = culprit(problem, stuck.centres) if problem.scene.obstacles else None
    parts.append(_stop(problem, stuck, found))
    follower = following(problem, stuck.route, deadline)
    parts.append(follower.words)
    tight = width <= SNUG * _needed(problem)
    advice = _advice(problem, stuck, tight, follower.advice)
    parts.append(f"try {', or '.join(advice)}")
    link, obstacle = (found.link, found.obstacle) if found else (0, "")
    words, centres = "; ".join(parts), stuck.centres.tolist()
    return Reached(words, 0.0, link, obstacle, centres, narrowest)


def _opening(
    problem: PlanningProblem, stuck: Stuck, deadline: Deadline
) -> tuple[int, float]:
    """Number of the narrowest point of the way, and how wide it is there; [m]."""
    points = np.stack([stuck.route, stuck.route], axis=1)
    distances = upper_distances(held_from(problem, TIP_ONLY), points, deadline)
    distances = distances.min(axis=1, initial=np.inf)
    narrow = int(np.argmin(distances))
    return narrow, 2.0 * float(distances[narrow])


@dataclass(frozen=True)
class Following:
    """What keeps an arm from following its tip along a way, and what might help.

    Args:
        words: In a sentence.
        advice: What to try; empty where it can.
    """

    words: str
    advice: str


def following(
    problem: PlanningProblem, route: FloatArray, deadline: Deadline = NO_LIMIT
) -> Following:
    """Where an arm that follows its tip along a way first breaks what is asked.

    Args:
        problem: Arm and scene.
        route: Of the tip from its start on, shape (k, 3); [m].
        deadline: When to give up.

    Raises:
        OutOfTime: If the time is over.
    """
    who = "an arm that follows its tip along it"
    laid = led_along(route, start_centres(problem), problem.manipulator.link_lengths)
    for tip, centres in zip(route, laid, strict=True):
        deadline.check()
        for words, advice in _broken(problem, centres):
            place = problem.in_file(tip)
            return Following(f"{who} would {words} with the tip at {place}", advice)
    return Following(f"{who} is clear at each of its points", "")


def _broken(problem: PlanningProblem, centres: FloatArray) -> Iterator[tuple[str, str]]:
    """What one arm, NaN for none, breaks of what is asked, and what might help."""
    arm = problem.manipulator
    if not np.isfinite(centres).all():
        yield "not reach back to its rail", "longer links"
        return
    bends = bends_of(centres[None])[0]
    joint = int(np.argmax(bends))
    if bends[joint] > arm.max_link_angle:
        asked, limit = np.rad2deg([bends[joint], arm.max_link_angle])
        words = f"bend joint {joint + 1} by {asked:.1f}° of {limit:.1f}°"
        yield words, "a larger `max_link_angle_deg` or links shorter against the turn"
    base, (low, high) = float(centres[0, 0]), arm.base_range
    if not low <= base <= high:
        rail = f"from {in_mm(low)} to {in_mm(high)}"
        words = f"need its base at x0 = {in_mm(base)}, and the rail is {rail},"
        yield words, LONGER_RAIL
    found = culprit(problem, centres) if problem.scene.obstacles else None
    if found and found.clearance < problem.required_clearance:
        obstacle, link = repr(found.obstacle), named(arm, found.link)
        advice = f"links shorter against the turn there or more room at {obstacle}"
        yield f"leave {link} {found.words} to {obstacle}", advice


def _needed(problem: PlanningProblem) -> float:
    """Width of the tip with its clearance on both sides; [m]."""
    return 2.0 * (_tip_reach(problem) + problem.required_clearance)


def _tip_reach(problem: PlanningProblem) -> float:
    """How far the last link reaches from its axis at the tip, or its tool; [m]."""
    return float(problem.held.radii[TIP].max(initial=0.0))


def passage(problem: PlanningProblem, place: FloatArray) -> str:
    """The narrowest place of the best way, its width and that of the body."""
    name, distance = nearest(problem, place)
    radius = _tip_reach(problem)
    return (
        f"the best way in is narrowest at {problem.in_file(place)}, beside {name!r}: "
        f"{in_mm(max(0.0, 2.0 * distance))} wide, for a body of "
        f"{in_mm(2.0 * radius)} with {in_mm(problem.required_clearance)} on either side"
    )


def too_narrow(problem: PlanningProblem, place: FloatArray) -> bool:
    """Whether the body does not pass a place, shape (3,), with its clearance; [m]."""
    return 2.0 * nearest(problem, place)[1] < _needed(problem)


def no_way_in(problem: PlanningProblem, place: FloatArray) -> Reached:
    """No way for the tip was found: where the widest is too narrow, what to try.

    Args:
        problem: Arm and scene.
        place: There, shape (3,); [m].
    """
    name, _ = nearest(problem, place)
    told = (
        f"no way for the tip was found: {passage(problem, place)}; try a smaller "
        "`required_clearance` or a wider opening"
    )
    return Reached(told, 0.0, problem.manipulator.n_links, name, (), place.tolist())


def at_reach(problem: PlanningProblem, tips: FloatArray) -> Reached | None:
    """Where tips of the path, (r, 3), are at the end of the arm's reach; else None."""
    length = problem.manipulator.total_length
    away = rail_distance(problem.manipulator, tips)
    far = int(np.argmax(away))
    if not away[far] > AT_REACH * length:
        return None
    return Reached(
        f"at {problem.in_file(tips[far])} the path is {in_mm(away[far])} from where "
        f"the base can be, and the straight arm is {in_mm(length)} long; try a longer "
        "rail (`base_range`) or another path"
    )


def on_the_path(
    problem: PlanningProblem, clearance: LinkClearance, tips: FloatArray, kept: float
) -> Reached | None:
    """What keeps every arm from a stretch of the path; None where nothing is seen to.

    Args:
        problem: Arm and scene.
        clearance: Lower bounds, which tell where to measure.
        tips: Along the stretch, at most a row apart, shape (r, 3); [m].
        kept: Clearance that plans keep; [m].

    Raises:
        OutOfTime: If the time of the clearance function is over.
    """
    problem = held_from(problem, TIP_ONLY)
    arm, share = problem.manipulator, np.arange(ROW_PLACES)[:, None, None] / ROW_PLACES
    between = (1.0 - share) * tips[:-1] + share * tips[1:]
    places = np.concatenate([between.reshape(-1, 3), tips[-1:]])
    ends = np.stack([places, places], axis=1)
    doubtful = clearance(ends, TIP)[:, 0] < kept
    places, ends = places[doubtful], ends[doubtful]
    distances = upper_distances(problem, ends, deadline_of(clearance))
    clearances = distances - arm.axis_radii[-1]
    least = clearances.min(axis=1, initial=np.inf)
    if not least.min(initial=np.inf) < kept:
        return None
    near = int(np.argmin(least))
    name = problem.scene.obstacles[int(np.argmin(clearances[near]))].name
    told = (
        f"at {problem.in_file(places[near])} the path leaves the tip itself "
        f"{at_most_mm(least[near])} to {name!r}, required are "
        f"{in_mm(problem.required_clearance)}, and the search keeps {in_mm(kept)}; try "
        f"a smaller `required_clearance`, a path farther from {name!r}, or "
        "`blocked: detour` to draw the rest"
    )
    return Reached(told, 0.0, arm.n_links, name, (), places[near].tolist())


def _stop(problem: PlanningProblem, stuck: Stuck, found: Culprit | None) -> str:
    """How far the arm came, and what it is nearest to there."""
    gaps = np.linalg.norm(np.diff(stuck.route, axis=0), axis=1)
    whole, come = float(gaps.sum()), float(gaps[: stuck.come - 1].sum())
    words = f"the arm came {in_mm(come)} of {in_mm(whole)} along it"
    if stuck.come == len(stuck.route):
        tip = problem.in_file(stuck.centres[-1])
        words = f"the arm came all the way in and along the path to {tip}"
    if found and found.clearance < np.inf:
        called = named(problem.manipulator, found.link)
        words += f", where {called} has {found.words} to {found.obstacle!r}"
    return words


def _advice(
    problem: PlanningProblem, stuck: Stuck, tight: bool, follower: str
) -> list[str]:
    """What might help, most likely first.

    Args:
        problem: Arm and scene.
        stuck: Where the arm ended.
        tight: Whether the way's narrowest opening leaves the body little.
        follower: What would help an arm that follows its tip.
    """
    arm, tried = problem.manipulator, []
    base, (low, high) = float(stuck.centres[0, 0]), arm.base_range
    if min(base - low, high - base) <= AT_END * arm.total_length:
        tried.append(f"{LONGER_RAIL}, since the base is at its end")
    bends = bends_of(stuck.centres[None])[0]
    if bends.max() >= AT_LIMIT * arm.max_link_angle:
        joint = int(np.argmax(bends)) + 1
        tried.append(f"larger joint limits, since joint {joint} is at its own")
    if tight:
        tried.append("a smaller `required_clearance` or a wider opening")
    if follower and not any(one.startswith(follower) for one in tried):
        tried.append(follower)
    return [*tried, "another start", "a longer time limit"]


@dataclass(frozen=True)
class Passage:
    """The best way in, and where it is narrowest.

    Args:
        place: The middle of its narrowest opening, shape (3,); [m].
        route: Of the tip, shape (k, 3); [m].
    """

    place: FloatArray
    route: FloatArray


def narrowest_passage(
    problem: PlanningProblem, clearance: LinkClearance, tip: FloatArray
) -> Passage | None:
    """The best way in to a tip and the middle of its narrowest opening.

    Args:
        problem: Arm and scene.
        clearance: The planner's own, as long as to look.
        tip: Where the way ends, shape (3,); [m].

    Returns:
        None without obstacles, where there is no way, or the time is over.
    """
    if not problem.scene.obstacles:
        return None
    assert isinstance(clearance, BroadPhase)
    exact = replace(clearance, floor=-np.inf)
    arm = problem.manipulator
    required = problem.required_clearance - NEARER * arm.most_radius
    step = WAY_STEP * arm.total_length
    space = TipSpace(problem, exact, required, step, CELLS)
    try:
        for route in space.routes(tip, 1):
            points = resampled(route, step / WAY_PLACES)
            places = np.stack(
                [
                    _middle(space.room, points[k], _along(points, k))
                    for k in _least(space.room.spare(points))
                ]
            )
            worst = int(np.argmin(space.room.spare(places)))
            return Passage(places[worst], route)
    except OutOfTime:
        pass
    return None


def _along(points: FloatArray, k: int) -> FloatArray:
    """Which way a way leads at one of its points, shape (3,); [m]."""
    return np.asarray(points[min(k + 1, len(points) - 1)] - points[max(k - 1, 0)])


def _least(spare: FloatArray) -> IntArray:
    """The places where there is less than beside them, the worst first.

    A way passes wide openings by their edge: which one is narrowest shows in their
    middles alone.
    """
    beside = np.concatenate([[np.inf], spare, [np.inf]])
    least = np.flatnonzero((spare <= beside[:-2]) & (spare <= beside[2:]))
    return np.asarray(least[np.argsort(spare[least], kind="stable")][:OPENINGS])


def _middle(room: TipRoom, place: FloatArray, along: FloatArray) -> FloatArray:
    """The narrowest place of an opening, in its middle, shape (3,); [m].

    Steps along the way go where it is narrower, steps across where it is wider.

    Args:
        room: Measures.
        place: In the opening, shape (3,); [m].
        along: Which way it leads, shape (3,); [m].
    """
    if not along.any():
        return place
    step = FIRST_STEP * room.arm.most_radius
    turn = np.arange(ACROSS) * 2.0 * np.pi / ACROSS
    _, _, axes = np.linalg.svd(along[None])
    across = np.column_stack([np.cos(turn), np.sin(turn)]) @ axes[1:]
    ahead = np.stack([axes[0], -axes[0]])
    while step > TOLERANCES.planned_clearance:
        for sign, ways in ((-1.0, across), (1.0, ahead)):
            tried = np.vstack([place, place + step * ways])
            place = tried[int(np.argmin(sign * room.spare(tried)))]
        step *= SHORTER
    return place
