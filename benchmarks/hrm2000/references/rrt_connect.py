"""OMPL's RRTConnect between configurations that damped least squares draws with.

The path is drawn row after row; where that ends, another configuration at the same tip
is drawn by chance and RRTConnect brings the arm there off the path.
"""

import numpy as np
from ompl import base, geometric, util

from benchmarks.hrm2000.references.arm import Arm, Rows, wanted
from benchmarks.hrm2000.references.jacobian import damped_least_squares
from vdsm_pin.errors import NoPlanFound
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.pinocchio_arm import PinocchioArm

SEED = 1
util.RNG.setSeed(SEED)
util.setLogLevel(util.LogLevel.LOG_NONE)
TRIES = 40
"""Configurations by chance at one tip."""
STEP = 0.02
"""Distance at which RRTConnect asks whether a configuration is valid; [rad], [m]."""
SOLVE = 3.0
"""Most seconds for one connection."""
SPREAD = 0.35
"""Standard deviation of the angles tried; [rad]."""


class Connector:
    """RRTConnect in joint space, with the validity check that all references ask."""

    def __init__(self, arm: Arm) -> None:
        self.arm = arm
        self.space = base.RealVectorStateSpace(arm.nq)
        bounds = base.RealVectorBounds(arm.nq)
        for i in range(arm.nq):
            bounds.setLow(i, float(arm.low[i]))
            bounds.setHigh(i, float(arm.high[i]))
        self.space.setBounds(bounds)
        self.setup = geometric.SimpleSetup(self.space)
        self.setup.setStateValidityChecker(lambda state: arm.valid(self.joints(state)))
        information = self.setup.getSpaceInformation()
        part = STEP / self.space.getMaximumExtent()
        information.setStateValidityCheckingResolution(part)
        self.setup.setPlanner(geometric.RRTConnect(information))

    def joints(self, state: object) -> FloatArray:
        """Joint values of a state."""
        return np.array([state[i] for i in range(self.arm.nq)])  # type: ignore[index]

    def _state(self, q: FloatArray) -> object:
        state = self.space.allocState()
        for i, value in enumerate(q):
            state[i] = float(value)
        return state

    def connect(self, begin: FloatArray, end: FloatArray) -> FloatArray | None:
        """Joint values on the way, or None."""
        self.setup.clear()
        self.setup.setStartAndGoalStates(self._state(begin), self._state(end))
        self.setup.solve(SOLVE)
        if not self.setup.haveExactSolutionPath():
            return None
        self.setup.simplifySolution(0.5)
        states = self.setup.getSolutionPath().getStates()
        return np.array([self.joints(state) for state in states])


def _another(
    arm: Arm, q: FloatArray, tip: FloatArray, rng: np.random.Generator
) -> FloatArray | None:
    """A valid configuration with that tip, from joint values drawn by chance."""
    guess = q + rng.normal(0.0, SPREAD, arm.nq)
    return damped_least_squares(arm, arm.bounded(guess), tip)


def follow(
    problem: PlanningProblem, robot: PinocchioArm, clearance: LinkClearance
) -> Trajectory:
    """Draw, and where that ends connect and go on.

    Raises:
        NoPlanFound: Where no other configuration can be connected.
    """
    rng = np.random.default_rng(SEED)
    arm, goal = Arm(problem, robot, clearance), wanted(problem)
    connector = Connector(arm)
    first = int(np.flatnonzero(goal.drawn)[0])
    rows = Rows(arm.start(), goal.stations[first])
    k, fresh, at = first, True, 0
    while k < len(goal.tips):
        q = None if fresh else damped_least_squares(arm, rows.joints[-1], goal.tips[k])
        if q is not None and np.abs(q - rows.joints[-1])[1:].max() < 0.08:
            rows.add(q, goal.stations[k], True)
            k += 1
            continue
        at = first if fresh else k - 1
        way = _change(arm, connector, rows.joints[-1], goal.tips[at], rng)
        if way is None:
            message = f"no other configuration at {goal.stations[at]:.3f} m"
            raise NoPlanFound(message)
        for joints in way[1:]:
            rows.go(joints, goal.stations[at])
        rows.drawn[-1] = True
        k, fresh = at + 1, False
    return rows.trajectory()


def _change(
    arm: Arm,
    connector: Connector,
    q: FloatArray,
    tip: FloatArray,
    rng: np.random.Generator,
) -> FloatArray | None:
    for _ in range(TRIES):
        other = _another(arm, q, tip, rng)
        if other is not None:
            way = connector.connect(q, other)
            if way is not None:
                return way
    return None
