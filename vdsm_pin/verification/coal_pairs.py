"""An arm and its scene as Coal has them, and the pairs of it that are judged."""

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Moving, Obstacle
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.coal_bodies import CoalObstacle, coal_obstacle
from vdsm_pin.verification.coal_hulls import placed
from vdsm_pin.verification.coal_shapes import CoalShapes
from vdsm_pin.verification.pinocchio_arm import load_arm
from vdsm_pin.verification.proved_lowers import ProvedLowers
from vdsm_pin.verification.records import Pair
from vdsm_pin.verification.task import ArmPairs


class CoalPairs:
    """The pairs that are judged; those of the parts of one body are one pair here.

    Args:
        problem: Arm and scene.

    Attributes:
        names: Of links, tool, feed and carried bodies, then of the obstacles.
        n_own: How many of them are the arm's.
        one: Number of the first body of each pair, one of the arm's, shape (n_pairs,).
        other: Of the second, farther from the base or an obstacle, shape (n_pairs,).
        judged: Number of each pair as it is judged; -1 for a body of several parts,
            shape (n_pairs,).
        covered: Whether hulls around a body, nearer than itself, are judged in its
            place, shape (n_pairs,).
    """

    def __init__(self, problem: PlanningProblem) -> None:
        arm, table = problem.manipulator, ArmPairs(problem)
        carried = [solid for _, solid in arm.carried]
        own = [*arm.axis_names, *(solid.name for solid in carried)]
        self.n_own, self.names = len(own), [*own, *problem.scene.names]
        self._own = {name: k for k, name in enumerate(own)}
        self._arm = arm
        owner = np.array([self._own[body.owner] for body in table.bodies])
        near, far = owner[table.between.held].T
        one = np.concatenate([owner[table.outer[:, 0]], near])
        other = np.concatenate([self.n_own + table.outer[:, 1], far])
        self._keys, pair = np.unique(one * len(self.names) + other, return_inverse=True)
        self.one, self.other = np.divmod(self._keys, len(self.names))
        # Numbers of the parts of each pair, one pair after the other.
        self._parts = np.argsort(pair, kind="stable")
        self._count = np.bincount(pair, minlength=self._keys.size)
        self._first = np.cumsum(self._count) - self._count
        self.judged = np.where(self._count == 1, self._parts[self._first], -1)
        meshes = [solid.name for solid in carried if isinstance(solid, Mesh)]
        hulls = [self._own[name] for name in meshes]
        self.covered = np.isin(self.one, hulls) | np.isin(self.other, hulls)

    def named(self, pair: int) -> tuple[str, str]:
        """The names of both bodies of a pair."""
        return self.names[self.one[pair]], self.names[self.other[pair]]

    def number(self, pair: Pair) -> int:
        """Number of the pair that one which is judged is, or is a part of."""
        one = self._own[self._arm.owner_of(pair.own)]
        if pair.obstacle:
            other = self.names.index(pair.obstacle, self.n_own)
        else:
            other = self._own[self._arm.owner_of(pair.label)]
        return int(np.searchsorted(self._keys, one * len(self.names) + other))

    def lowers(
        self, proved: ProvedLowers, waypoint: IntArray, pair: IntArray
    ) -> FloatArray:
        """The least proved bound of any part of pairs at waypoints, shape (m,); [m]."""
        count = self._count[pair]
        begin = np.cumsum(count) - count
        within = np.arange(count.sum()) - np.repeat(begin, count)
        parts = self._parts[np.repeat(self._first[pair], count) + within]
        found = proved.at(np.repeat(waypoint, count), parts)
        return np.asarray(np.minimum.reduceat(found, begin))


def arm_shapes(problem: PlanningProblem, deadline: Deadline) -> CoalShapes:
    """Coal's shapes in the order of `CoalPairs.names`.

    The base is frame 0 and link k frame k; then come the feed's, which does not turn,
    and those of what moves.
    """

    def shape(solid: Obstacle) -> CoalObstacle | None:
        deadline.check()
        return coal_obstacle(solid)

    n, carried = problem.manipulator.n_links, problem.manipulator.carried
    model = load_arm(problem.manipulator)
    shapes: list[CoalObstacle | None] = [
        (placed(rod, local[:3, 3], local[:3, :3]),)
        for rod, local in zip(model.capsules, model.T_link_capsule, strict=True)
    ]
    frames = [min(k + 1, n) for k in range(len(shapes))]  # the tool is on the last link
    frames += [link or n + 1 for link, _ in carried]
    next_frame = n + 2
    for one in problem.scene.obstacles:
        moves = isinstance(one, Moving)
        frames.append(next_frame if moves else 0)
        next_frame += moves
    shapes += [shape(solid) for _, solid in carried]
    shapes += map(shape, problem.scene.obstacles)
    return CoalShapes(frames, shapes)
