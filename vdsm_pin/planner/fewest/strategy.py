"""The strategies `fewest` and `clearest`."""

import logging
from dataclasses import dataclass

import numpy as np

from vdsm_pin.cables import cable_lengths
from vdsm_pin.errors import NoPlanFound
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.kinematics import joint_angles
from vdsm_pin.planner.fewest.clear import Judge
from vdsm_pin.planner.fewest.motion import Knots, Rows, dense_rows
from vdsm_pin.planner.fewest.roadmap import Taste, build_roadmap, link_limit
from vdsm_pin.planner.fewest.route import tip_route
from vdsm_pin.planner.fewest.growth import fill
from vdsm_pin.planner.fewest.sequence import Planner
from vdsm_pin.planner.fewest.search import Found, search
from vdsm_pin.planner.fewest.shapes import one_knee_shapes
from vdsm_pin.planner.fewest.smooth import smooth, straightened
from vdsm_pin.planner.records import LinkClearance, Plan, TipPath
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.trajectory import Trajectory

LOGGER = logging.getLogger(__name__)

SLACK = 5e-4
"""Clearance kept for what happens between two rows; [m]."""
FINEST = 2e-3
"""Way of the body between two looks at the clearance; [m]."""
TURN = float(np.deg2rad(4.5))
"""Largest change of a joint between two rows; the limit for users is 5 deg; [rad]."""


@dataclass(frozen=True)
class Level:
    """How finely to look.

    Args:
        step: Lattice step of the directions; [-].
        coarse: Distance of the tips over the arm's length; [-].
        joints: Largest number of knee joints.
        rounds: Sequences to try.
        back: How far tips are tried behind the path, over the arm's length; [-].
        grow: Rounds of growing shapes into what is not drawn.
    """

    step: float
    coarse: float
    joints: int
    rounds: int
    back: float = 0.0
    grow: int = 0


SEED = 0
"""Seed of the growth of shapes; the same problem gives the same plan."""

LEVELS = (
    Level(0.08, 0.026, 8, 40),
    Level(0.08, 0.026, 8, 40, 1.0, 3),
    Level(0.05, 0.016, 10, 60, 1.0, 3),
)


def plan_fewest(
    problem: PlanningProblem, clearance: LinkClearance, margin: float
) -> Plan:
    """A plan with as few changed link angles as the graph has."""
    taste = Taste()
    required = problem.required_clearance + margin + SLACK
    judge = Judge(problem, clearance, required, FINEST)
    best: Found | None = None
    for level in LEVELS:
        found = _look(judge, level, taste)
        LOGGER.debug(
            "%s: undrawn %s", level, None if found is None else found.undrawn_m
        )
        if found is None:
            continue
        if best is None or found.undrawn_m < best.undrawn_m:
            best = found
        if not best.sequence.skipped:
            break
    if best is None:
        msg = "nothing of the path can be drawn"
        raise NoPlanFound(msg)
    knots = straightened(smooth(judge, best.knots, taste))
    return _plan(problem, knots, taste)


def _look(judge: Judge, level: Level, taste: Taste) -> Found | None:
    problem = judge.problem
    arm = problem.manipulator
    shapes = one_knee_shapes(arm, link_limit(problem), level.step, level.joints)
    length = arm.total_length
    route = tip_route(problem, level.coarse * length, level.back * length)
    roadmap = build_roadmap(
        problem, judge.clearance, judge.required, route, shapes, taste
    )
    home = int(roadmap.index[0])
    if home < 0:
        message = "the straight arm at the start is not clear"
        raise NoPlanFound(message)
    found = search(judge, roadmap, home, level.rounds)
    for _ in range(level.grow):
        if found is None or not found.sequence.skipped:
            break
        rng = np.random.default_rng(SEED)
        before = found.undrawn_m
        lengths, _ = Planner(found.roadmap, home).ways(home)
        more = fill(judge, found.roadmap, lengths, found.sequence.skipped, rng, taste)
        if more is None:
            break
        again = search(judge, more, int(more.index[0]), level.rounds)
        LOGGER.debug(
            "grown: %d nodes, undrawn %.3f -> %s",
            len(more.node) - len(found.roadmap.node),
            before,
            None if again is None else again.undrawn_m,
        )
        if again is None or not again.undrawn_m < before:
            break
        found = again
        home = int(more.index[0])
    return found


def _plan(problem: PlanningProblem, knots: Knots, taste: Taste) -> Plan:
    arm, path = problem.manipulator, problem.path
    rows = dense_rows(arm, knots, path.spacing, TURN)
    alpha, theta = joint_angles(arm, rows.centres)
    stations, on_path = _stations(knots, rows)
    trajectory = Trajectory(on_path, stations, rows.centres[:, 0, 0], alpha, theta)
    return Plan(
        problem,
        "fewest",
        TipPath(rows.centres[:, -1], on_path, stations),
        rows.centres,
        trajectory,
        cable_lengths(arm, alpha, theta),
        (),
    )


def _stations(knots: Knots, rows: Rows) -> tuple[FloatArray, BoolArray]:
    a, t = rows.interval, rows.share
    stations = (1.0 - t) * knots.stations[a] + t * knots.stations[a + 1]
    on = knots.drawn[a].copy()
    begins = t == 0.0
    on[begins] |= knots.drawn[np.maximum(a[begins] - 1, 0)]
    stations = np.where(knots.drawn[a], stations, knots.stations[a])
    return stations, on
