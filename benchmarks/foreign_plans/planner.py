"""RRTConnect of OMPL with its own check between states, by samples."""

import numpy as np
from ompl import base, geometric, util

from benchmarks.foreign_plans.sampled import Sampled
from vdsm_pin.geometry.arrays import FloatArray

SEED = 1
"""Of each plan's random numbers."""

SECONDS = 30.0
"""Most seconds for one plan."""

util.setLogLevel(util.LogLevel.LOG_NONE)


class Planner:
    """RRTConnect and OMPL's simplification, at a resolution.

    Args:
        sampled: Which states are valid.
        resolution: Of the check between states, as a part of the space's extent; [-].
    """

    def __init__(self, sampled: Sampled, resolution: float) -> None:
        util.RNG.setSeed(SEED)
        low, high = sampled.limits
        self.n = len(low)
        self.space = base.RealVectorStateSpace(self.n)
        bounds = base.RealVectorBounds(self.n)
        for k in range(self.n):
            bounds.setLow(k, float(low[k]))
            bounds.setHigh(k, float(high[k]))
        self.space.setBounds(bounds)
        self.setup = geometric.SimpleSetup(self.space)
        self.setup.setStateValidityChecker(
            lambda state: not sampled.collides(self._joints(state))
        )
        information = self.setup.getSpaceInformation()
        information.setStateValidityCheckingResolution(resolution)
        self.setup.setPlanner(geometric.RRTConnect(information))

    def plan(self, start: FloatArray, goal: FloatArray) -> FloatArray | None:
        """Waypoints, shape (n_rows, n), or None; [rad]."""
        self.setup.clear()
        self.setup.setStartAndGoalStates(self._state(start), self._state(goal))
        self.setup.solve(SECONDS)
        if not self.setup.haveExactSolutionPath():
            return None
        self.setup.simplifySolution()
        states = self.setup.getSolutionPath().getStates()
        return np.array([self._joints(state) for state in states])

    def _joints(self, state: object) -> FloatArray:
        return np.array([state[k] for k in range(self.n)])  # type: ignore[index]

    def _state(self, q: FloatArray) -> object:
        state = self.space.allocState()
        for k, value in enumerate(q):
            state[k] = float(value)
        return state
