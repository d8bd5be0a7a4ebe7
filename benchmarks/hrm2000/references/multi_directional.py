"""A tree of tip positions with bounded turns, and the arm following (MDA + RRT).

The tip's way to the desired path is a rapidly exploring random tree whose branches have
the length of a step and turn by no more than a link angle allows a link; the arm lies
on that way and then on the desired path.
"""

import numpy as np

from benchmarks.hrm2000.references.arm import Arm, Wanted, wanted
from benchmarks.hrm2000.references.follow_the_leader import lie_on
from vdsm_pin.errors import NoPlanFound
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.pinocchio_arm import PinocchioArm

STEP = 0.05  # m
ROWS = 10
"""Rows for each step of the tip, so that no joint turns too far in one."""
NODES = 4_000
GREED = 0.2
"""Share of branches grown towards the goal."""


def tree_way(arm: Arm, goal: FloatArray, rng: np.random.Generator) -> FloatArray:
    """A way of the tip from the start to a goal, shape (k, 3); [m].

    Raises:
        NoPlanFound: If the tree does not get there.
    """
    start, lengths = arm.problem.path.start, arm.problem.manipulator.link_lengths
    turn = 2.0 * np.tan(arm.cone / 2.0) * STEP / float(lengths.min())
    places, ways, parents = [start], [np.array([1.0, 0.0, 0.0])], [-1]
    low, high = np.minimum(start, goal) - 0.5, np.maximum(start, goal) + 0.5
    for _ in range(NODES):
        aim = goal if rng.random() < GREED else rng.uniform(low, high)
        near = int(np.argmin(np.linalg.norm(np.array(places) - aim, axis=1)))
        way = _turned(ways[near], aim - places[near], turn)
        place = places[near] + STEP * way
        ends = np.stack([places[near], place])[None]
        if not arm.clearance(ends).min() >= arm.required:
            continue
        places.append(place)
        ways.append(way)
        parents.append(near)
        if np.linalg.norm(place - goal) <= STEP:
            found = [goal]
            k = len(places) - 1
            while k >= 0:
                found.append(places[k])
                k = parents[k]
            return np.array(found[::-1])
    message = f"no way of the tip to the path among {NODES} branches"
    raise NoPlanFound(message)


def _turned(old: FloatArray, wish: FloatArray, most: float) -> FloatArray:
    """The direction wished for, turned from the old one by no more than allowed."""
    new = wish / max(float(np.linalg.norm(wish)), 1e-12)
    angle = float(np.arccos(np.clip(old @ new, -1.0, 1.0)))
    if angle <= most:
        return np.asarray(new)
    side = new - (old @ new) * old
    size = float(np.linalg.norm(side))
    if size < 1e-9:
        side, size = np.cross(old, [0.0, 0.6, 0.8]), 1.0
    return np.asarray(np.cos(most) * old + np.sin(most) * side / size)


def follow(
    problem: PlanningProblem, robot: PinocchioArm, clearance: LinkClearance
) -> Trajectory:
    """To the path on a branch of the tree, then along it, the arm on the trail.

    Raises:
        NoPlanFound: If there is no such way, or a posture breaks a limit.
    """
    arm, goal = Arm(problem, robot, clearance), wanted(problem)
    first = int(np.argmax(goal.drawn))
    way = tree_way(arm, goal.tips[first], np.random.default_rng(0))
    places = np.arange(ROWS * (len(way) - 1) + 1) / ROWS
    steps = range(len(way))
    way = np.column_stack([np.interp(places, steps, column) for column in way.T])
    off = np.full(len(way) - 1, goal.stations[first])
    whole = Wanted(
        np.vstack([way[:-1], goal.tips[first:]]),
        np.concatenate([off, goal.stations[first:]]),
        np.concatenate([np.zeros(len(off), np.bool_), goal.drawn[first:]]),
    )
    return lie_on(arm, whole)
