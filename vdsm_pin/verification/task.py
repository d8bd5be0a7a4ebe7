"""What a clearance proof is asked: bodies and pairs, the packed scene, the rules."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from vdsm_pin.arm.bodies import BY_FILE
from vdsm_pin.arm.tree import RAIL, arm_tree, link_frame
from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.solids import HalfSpace
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.held import held_pairs
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, solid_of
from vdsm_pin.proof.bodies import Body, LeftOut, PairTable
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.error_box import ErrorBox as ProofBox
from vdsm_pin.proof.packing import pack_task
from vdsm_pin.proof.packing import with_errors as with_box
from vdsm_pin.proof.terms import Task
from vdsm_pin.proof.tree import added_up
from vdsm_pin.verification.link_clearance import arithmetic_pad
from vdsm_pin.verification.moving import joined_tree, obstacle_frames
from vdsm_pin.verification.records import Pair


class ArmPairs:
    """Which pairs of a problem are judged, in the order of the certificate.

    First come the pairs of a body and an obstacle, obstacle by obstacle, then those of
    two bodies.

    Args:
        problem: Arm, scene, required clearances.
    """

    def __init__(self, problem: PlanningProblem) -> None:
        self.problem, arm = problem, problem.manipulator
        self.bodies, self.between = arm.convex_bodies, arm.self_pairs
        names = problem.scene.names
        held = held_pairs(arm, self.bodies, names).T
        ignored = np.argwhere(~held).tolist()
        # Numbers of the body and the obstacle of each pair, obstacle by obstacle.
        self.outer: IntArray = np.argwhere(held)[:, ::-1]
        self.ignored = tuple(
            LeftOut(body, names[o], BY_FILE)
            for o, body in dict.fromkeys((o, self.bodies[b].owner) for o, b in ignored)
            if arm.ignores(body, names[o])
        )

    @property
    def left_out(self) -> tuple[LeftOut, ...]:
        """Pairs that are not judged, each with the reason."""
        return (*self.between.left_out, *self.ignored)

    @cached_property
    def number(self) -> IntArray:
        """The pair of each body and obstacle, -1 for none, (n_bodies, n_obstacles)."""
        shape = len(self.bodies), len(self.problem.scene.obstacles)
        found = np.full(shape, -1)
        found[tuple(self.outer.T)] = np.arange(len(self.outer))
        return found

    @property
    def size(self) -> int:
        """Number of pairs."""
        return len(self.outer) + len(self.between.held)

    @cached_property
    def pairs(self) -> tuple[Pair, ...]:
        """Every pair as the reports name it."""
        names = self.problem.scene.names
        own = [(body.link, self._named(b)) for b, body in enumerate(self.bodies)]
        rows = [
            Pair(own[b][0], names[o], body=own[b][1])
            for b, o in zip(*self.outer.T.tolist(), strict=True)
        ]
        rows += [self.pair(k) for k in range(len(rows), self.size)]
        return tuple(rows)

    def pair(self, number: int) -> Pair:
        """One pair by its number, without making all, which may be a million."""
        if number < len(self.outer):
            b, o = self.outer[number].tolist()
            obstacle = self.problem.scene.obstacles[o]
            return Pair(self.bodies[b].link, obstacle.name, body=self._named(b))
        i, k = self.between.held[number - len(self.outer)].tolist()
        return Pair(
            self.bodies[i].link,
            other_link=self.bodies[k].link,
            body=self._named(i),
            other_body=self._named(k),
        )

    def _named(self, body: int) -> str:
        return "" if body < self.problem.manipulator.n_links else self.bodies[body].name

    def numbers(self) -> PairTable:
        """The pairs as the proof takes them, by numbers of bodies.

        Obstacles come first in scene order, then the bodies of the arm.
        """
        problem, between = self.problem, self.between.held
        outer, n = self.outer, len(problem.scene.obstacles)
        needed = problem.required_clearance, problem.required_self_clearance
        return PairTable(
            one=n + np.concatenate([outer[:, 0], between[:, 1]]),
            other=np.concatenate([outer[:, 1], n + between[:, 0]]),
            required=np.repeat(np.array(needed), (len(outer), len(between))),
        )


def ball_of(problem: PlanningProblem, pair: Pair) -> float:
    """Radius of the ball that grows the core of a pair's own body; [m].

    No depth beyond it is measured.
    """
    bodies = problem.manipulator.convex_bodies
    return next(body.ball for body in bodies if body.name == pair.own)


def all_pairs(problem: PlanningProblem) -> tuple[Pair, ...]:
    """Every pair that is judged, in the order of the certificate."""
    return ArmPairs(problem).pairs


def obstacle_growth(obstacles: Sequence[Obstacle], errors: ErrorBox) -> list[float]:
    """How far the surface of each obstacle may be off; [m].

    A turn moves a point by its angle times the distance from the obstacle's middle at
    most, which is that of the box around its corners along the axes of the base.

    Raises:
        InvalidInput: If a half-space may be turned.
    """
    found = []
    for obstacle in obstacles:
        error, reach = errors.of_obstacle(obstacle.name), 0.0
        if error.turn > 0.0:
            solid = solid_of(obstacle)
            if isinstance(solid, HalfSpace):
                message = f"obstacle {error.name!r}: a half-space cannot be turned"
                raise InvalidInput(message)
            points, grown = solid.corners, solid.grown
            middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
            reach = float(np.linalg.norm(points - middle, axis=1).max()) + grown
        found.append(error.shift + error.turn * reach)
    return found


def make_task(
    problem: PlanningProblem,
    errors: ErrorBox,
    budget: Budget | None = None,
    reach: FloatArray | None = None,
) -> Task:
    """What the kernels need to know of a problem.

    Args:
        problem: Arm, scene, required clearances.
        errors: What the proof covers.
        budget: Sizes and when to stop.
        reach: How large each column of the whole tree gets, shape (n_columns,); where
            the base may turn, nothing is proved of a motion of which that is not known.
    """
    table, arm = ArmPairs(problem), problem.manipulator
    obstacles = problem.scene.obstacles
    pieces = problem.packed
    own = arm_tree(arm)
    frames = zip(obstacles, obstacle_frames(own, problem.scene), strict=True)
    bodies = [Body(frame, one.pieces, one.name) for one, frame in frames]
    bodies += [Body(link_frame(b.link), (b.piece,), b.name) for b in table.bodies]
    columns = arm.n_links + np.arange(len(bodies))
    # The feed counts as what link 1 is mounted on.
    columns[len(obstacles) :] = [max(0, body.link - 1) for body in table.bodies]
    tree, numbers = joined_tree(own, problem.scene), table.numbers()
    beside = 0.0 if reach is None else added_up(tree.joints[len(own.joints) :], reach)
    rules = (budget or Budget()).rules(arithmetic_pad(problem, pieces, beside))
    task = pack_task(tree, bodies, numbers, rules, reach, columns, pieces)
    return with_errors(task, problem, errors)


def with_errors(task: Task, problem: PlanningProblem, errors: ErrorBox) -> Task:
    """A task with its error box replaced.

    Args:
        task: `make_task` of this problem, with any errors.
        problem: Arm and scene.
        errors: The new box.
    """
    return with_growth(
        task,
        errors,
        problem.manipulator.n_links,
        obstacle_growth(problem.scene.obstacles, errors),
    )


def with_growth(
    task: Task, errors: ErrorBox, n_links: int, grown: Sequence[float]
) -> Task:
    """A task with its error box replaced, for obstacles whose growth is known.

    Args:
        task: Any task of an arm.
        errors: The new box; its errors of obstacles are not read.
        n_links: Number of links of the arm.
        grown: How far each obstacle's surface may be off, in scene order; [m].
    """
    shifts, tilts = np.zeros((2, task.tree.parent.size))
    shifts[RAIL], tilts[RAIL] = errors.base, errors.base_turn
    asked = task.bodies.number.max(initial=0), task.pairs.obstacle.max(initial=0)
    surfaces = np.zeros(max(1 + max(asked), len(grown)))
    surfaces[: len(grown)] = grown
    joints = np.zeros(task.tree.parent.size)
    joints[1 : 1 + 2 * n_links] = errors.angles(n_links).reshape(-1)
    return with_box(task, ProofBox(joints, shifts, tilts, surfaces))
