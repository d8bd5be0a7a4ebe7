"""The paper's method from problem to plan: seven steps, one call each."""

from dataclasses import replace
from typing import Final

import numpy as np

from vdsm_pin.errors import Infeasible, NoPlanFound, PathBlocked
from vdsm_pin.planner.broad_phase import keeping
from vdsm_pin.planner.feasibility import check_feasibility
from vdsm_pin.planner.paper.avoidance import (
    Avoidance,
    Straight,
    WayRound,
    avoidances,
)
from vdsm_pin.planner.paper.lift import lift
from vdsm_pin.planner.paper.scale import references
from vdsm_pin.planner.paper.solve import solve
from vdsm_pin.planner.paper.steering import LIFTS, Steering
from vdsm_pin.planner.paper.steps import PaperSteps
from vdsm_pin.planner.paper.tip_path import Route, subdivided
from vdsm_pin.planner.records import (
    UNMEASURED,
    Adjustment,
    LinkClearance,
    Margin,
    Measure,
    Plan,
    margin_table,
)
from vdsm_pin.planner.spacing import row_steps
from vdsm_pin.planner.start import check_start
from vdsm_pin.problem.desired_path import Blocked
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import in_mm

SUBDIVISIONS: Final = 6
"""Rounds of inserting waypoints; a motion still too fast after them has a jump."""

GRAZE: Final = 0.016
"""A motion that misses the clearance by less than this part of the body's radius is
planned once more with as much on top; [-]."""


def plan_paper(
    problem: PlanningProblem,
    clearance: LinkClearance,
    margin: Margin,
    measure: Measure = UNMEASURED,
) -> Plan:
    """Plan by the paper's seven steps.

    Args:
        problem: What is asked.
        clearance: Clearance of every link at given joint centres.
        margin: Kept beyond the required clearance at every waypoint; [m].
        measure: Coal's, by which joints are moved on after each lift.

    Returns:
        The plan; every limit is kept at every waypoint.

    Raises:
        Infeasible: With the reason, where the paper's rule has no plan.
    """
    _check_straight(problem)
    check_feasibility(problem.manipulator, problem.path)
    check_start(problem, clearance)
    asked = Steering(problem, margin_table(problem, margin), measure)
    motion = _best_motion(asked, keeping(problem, clearance, asked.margins))
    return Plan(
        problem,
        "paper",
        motion.centres,
        motion.trajectory,
        tuple(
            f"from {in_mm(a)} to {in_mm(b)} along the path (left out by the paper's "
            f"rule on its way round {motion.avoidance.passed!r}; nothing is proved)"
            for a, b in motion.route.undrawn
        ),
        motion.route.notes,
        steps=motion,
        rounds=motion.rounds,
    )


def _check_straight(problem: PlanningProblem) -> None:
    """Refuse a start with a bend past joint 1: the paper's arm starts straight.

    Raises:
        NoPlanFound: If the arm starts bent.
    """
    joints = problem.path.start_joints
    if joints is None:
        return
    if np.abs(joints[3:]).max(initial=0.0) > TOLERANCES.start_joints:
        message = (
            "the arm starts bent; the paper's rule starts with a straight arm (the "
            "strategy 'fewest' takes any start)"
        )
        raise NoPlanFound(message)


def _best_motion(
    asked: Steering, clearance: LinkClearance, reserve: float = 0.0
) -> PaperSteps:
    """The first motion that draws the whole path, else the one that draws most.

    Args:
        asked: What is kept, and who measures it.
        clearance: Clearance of every link at given joint centres, less margins.
        reserve: Aimed at beyond the margins, for rows between judged ones; [m].
    """
    problem = asked.problem
    straight = Straight(problem, clearance)
    motion = _motion(problem, straight, straight.route(np.inf))
    kept = straight.clearance(motion.centres)
    if kept >= problem.required_clearance and not asked.misses(motion):
        return motion
    if problem.scaling is not None:
        _refuse_scaled(problem, kept)
    best: PaperSteps | None = None
    missing, reason, grazing = np.inf, None, np.inf
    # Those that a part of the arm may not touch.
    met = np.flatnonzero(np.any(np.isfinite(problem.held.radii), axis=0)).tolist()
    for way in avoidances(problem, met, asked.margins + reserve):
        try:
            motion = _steered(asked, way, missing)
            kept = motion.avoidance.clearance(motion.centres) + reserve
            # The rule may know some of the obstacles only, and holds every link off.
            if len(met) > 1 or not problem.held.whole:
                kept = straight.clearance(motion.centres)
            grazing = min(grazing, problem.required_clearance - kept)
            _refuse_touch(problem, kept, way.passed)
        except Infeasible as error:
            reason = reason or error
            continue
        best, missing = motion, motion.route.missing
        if missing == 0.0:
            break
    graze = GRAZE * problem.manipulator.most_radius
    if best is None and reserve == 0.0 and grazing <= graze:
        return _best_motion(asked, clearance, graze)
    if best is None:
        raise reason or NoPlanFound("the paper's rule offers no way round")
    _refuse_gaps(problem, best)
    return best


def _steered(asked: Steering, way: WayRound, missing: float) -> PaperSteps:
    """Steps 4 to 7; where Coal finds a lift too near, joints slide on for the next.

    Args:
        asked: What is kept, and who measures it.
        way: How Steps 4 and 5 are settled.
        missing: The route leaves less than this of the path undrawn; [m].
    """
    motion = _motion(asked.problem, way, way.route(missing))
    rounds: list[tuple[Adjustment, ...]] = []
    while len(rounds) < LIFTS:
        farther, moved = asked.moved_on(way, motion)
        if not moved:
            break
        try:
            # The tip's route depends on the last link alone.
            more = farther.growths[-1] > way.growths[-1]
            route = farther.route(missing) if more else motion.route
            motion = _motion(asked.problem, farther, route)
        except Infeasible:
            break  # whoever asked may ask for more room from the first
        way = farther
        rounds.append(moved)
    return replace(motion, rounds=tuple(rounds))


def _motion(problem: PlanningProblem, avoidance: Avoidance, route: Route) -> PaperSteps:
    """Steps 2 to 7 for one route; rows are inserted where joints move fast.

    They are also where the tip would stray from its path between two rows.
    """
    manipulator = problem.manipulator
    stray = TOLERANCES.planned_stray * manipulator.total_length
    for _ in range(SUBDIVISIONS):
        points = route.tip_path.points
        reference = references(problem, route.tip_path)  # Steps 2 and 3
        planar = avoidance.joints(route, reference)  # Step 5
        centres = lift(manipulator, planar, points[:, 0])  # Step 6
        trajectory = solve(manipulator, route, centres)  # Step 7
        steps, strays = row_steps(manipulator, trajectory.alpha, trajectory.theta)
        drawn = trajectory.on_path[1:] & trajectory.on_path[:-1]
        turns = steps / problem.planned_row_change
        # Halving an interval leaves a quarter of the way by which the tip strays. A
        # jump is not filled with rows for the tip's sake.
        bows = np.sqrt(np.where(drawn, strays, 0.0) / stray)
        needed = bows if (turns <= 1.0).all() else turns
        motion = PaperSteps(avoidance, route, reference, planar, centres, trajectory)
        if (needed <= 1.0).all():
            return motion
        pieces = np.ceil(needed).astype(np.int64)
        route = subdivided(problem.path, route, np.maximum(pieces, 1))
    if (turns <= 1.0).all():  # the tip strays a little more than was aimed at
        return motion
    message = (
        f"a joint turns by {np.rad2deg(steps.max()):.1f}° at once near waypoint "
        f"{int(np.argmax(steps))}: the paper's rule is not continuous there"
    )
    raise NoPlanFound(message)


def _refuse_scaled(problem: PlanningProblem, clearance: float) -> None:
    message = (
        f"with the ratios that are asked for {_too_near(problem, clearance)}; the "
        "paper's rule goes round obstacles with constant ratios about the rail only"
    )
    raise NoPlanFound(message)


def _refuse_touch(problem: PlanningProblem, clearance: float, passed: str) -> None:
    if not clearance >= problem.required_clearance:
        message = f"on the way round {passed!r} {_too_near(problem, clearance)}"
        raise NoPlanFound(message)


def _too_near(problem: PlanningProblem, clearance: float) -> str:
    """In words; of a clearance below 0 the sign alone is meant."""
    near = f"come within {in_mm(clearance)} of" if clearance > 0.0 else "meet"
    needed = in_mm(problem.required_clearance)
    return f"the links {near} an obstacle, {needed} are required"


def _refuse_gaps(problem: PlanningProblem, motion: PaperSteps) -> None:
    if problem.path.blocked is Blocked.FAIL and len(motion.route.undrawn):
        first, last = motion.route.undrawn[0]
        reason = (
            f"the desired path cannot be drawn from {in_mm(first)} to {in_mm(last)}, "
            "and the problem allows no detour (blocked: fail)"
        )
        raise PathBlocked(obstacle=motion.avoidance.passed, reason=reason)
