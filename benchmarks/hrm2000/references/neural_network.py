"""A neural network from tip to joint values, learnt from the arm's own kinematics.

Two hidden layers, trained by Adam on postures drawn by chance: joint angles within a
few degrees of each other, the base anywhere. What it answers is taken as it comes.
"""

from itertools import pairwise

import numpy as np

from benchmarks.hrm2000.references.arm import Arm, along
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.pinocchio_arm import PinocchioArm

POSTURES, BATCH, STEPS, WIDTH = 40_000, 256, 6_000, 64
BEND, SCATTER = np.deg2rad(12.0), np.deg2rad(1.0)
"""Largest bend that all joints share, and standard deviation of each from it."""
RATE, FIRST, SECOND = 3e-3, 0.9, 0.999
"""Step size of Adam, and its two rates of forgetting."""


class Network:
    """Weights of three layers with tanh between them."""

    def __init__(self, inputs: int, outputs: int, rng: np.random.Generator) -> None:
        sizes = [inputs, WIDTH, WIDTH, outputs]
        self.weights = [
            rng.normal(size=(a + 1, b)) / np.sqrt(a + 1) for a, b in pairwise(sizes)
        ]

    def layers(self, inputs: FloatArray) -> list[FloatArray]:
        """What every layer is given, a column of ones added, then the answer."""
        found = [np.column_stack([inputs, np.ones(len(inputs))])]
        for weights in self.weights[:-1]:
            hidden = np.tanh(found[-1] @ weights)
            found.append(np.column_stack([hidden, np.ones(len(hidden))]))
        return [*found, found[-1] @ self.weights[-1]]

    def gradients(self, inputs: FloatArray, wanted: FloatArray) -> list[FloatArray]:
        """Of the mean square error, by the weights of each layer."""
        *given, answer = self.layers(inputs)
        back, found = (answer - wanted) / len(inputs), []
        for values, weights in zip(given[::-1], self.weights[::-1], strict=True):
            found.append(values.T @ back)
            back = (back @ weights.T * (1.0 - values**2))[:, :-1]
        return found[::-1]

    def train(
        self, inputs: FloatArray, wanted: FloatArray, rng: np.random.Generator
    ) -> None:
        """Adam on batches drawn by chance, its step falling to 0."""
        means = [np.zeros_like(w) for w in self.weights]
        squares = [np.zeros_like(w) for w in self.weights]
        for step in range(1, STEPS + 1):
            rows = rng.integers(len(inputs), size=BATCH)
            rate = RATE * (1.0 - step / STEPS)
            for k, slope in enumerate(self.gradients(inputs[rows], wanted[rows])):
                means[k] += (1.0 - FIRST) * (slope - means[k])
                squares[k] += (1.0 - SECOND) * (slope**2 - squares[k])
                mean = means[k] / (1.0 - FIRST**step)
                size = np.sqrt(squares[k] / (1.0 - SECOND**step)) + 1e-8
                self.weights[k] -= rate * mean / size


def postures(arm: Arm, rng: np.random.Generator) -> FloatArray:
    """Joint values within the limits, shape (POSTURES, 1 + 2 N)."""
    shared = rng.uniform(-BEND, BEND, (POSTURES, 1, 2))
    angles = shared + SCATTER * rng.normal(size=(POSTURES, arm.n, 2))
    x0 = rng.uniform(-1.0, 1.0, (POSTURES, 1)) * 0.3 * arm.problem.path.start[0]
    return np.hstack([x0, angles.reshape(POSTURES, -1)])


class Learnt:
    """A network trained for one arm, with what its inputs and answers are scaled by."""

    def __init__(self, arm: Arm) -> None:
        rng = np.random.default_rng(0)
        joints = postures(arm, rng)
        tips = arm.centres(joints)[:, -1]
        self.middle, self.spread = tips.mean(axis=0), tips.std(axis=0)
        self.centre, self.scale = joints.mean(axis=0), joints.std(axis=0)
        self.network = Network(3, arm.nq, rng)
        inputs, wanted = self.scaled(tips), (joints - self.centre) / self.scale
        self.network.train(inputs, wanted, rng)

    def scaled(self, tips: FloatArray) -> FloatArray:
        """Tips as the network is given them, shape (r, 3)."""
        return np.asarray((tips - self.middle) / self.spread)

    def reach(self, arm: Arm, q: FloatArray, tip: FloatArray) -> FloatArray:
        """Joint values for a tip; those before are not looked at."""
        answer = self.network.layers(self.scaled(tip)[None])[-1][0]
        return arm.bounded(self.centre + self.scale * answer)


_LEARNT: dict[tuple[bytes, float], Learnt] = {}
"""By the lengths of the links and the x of the start: training sees no more."""


def follow(
    problem: PlanningProblem, robot: PinocchioArm, clearance: LinkClearance
) -> Trajectory:
    """Trained once for an arm, then asked row after row; the judge has the rest to say.

    Raises:
        NoPlanFound: If two rows are too far apart.
    """
    arm = Arm(problem, robot, clearance)
    key = problem.manipulator.link_lengths.tobytes(), float(problem.path.start[0])
    if key not in _LEARNT:
        _LEARNT[key] = Learnt(arm)
    return along(arm, _LEARNT[key].reach)
