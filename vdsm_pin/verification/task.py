"""What of a snake arm is held apart, and how the proof has it."""

from functools import cached_property

import numpy as np

from vdsm_pin.arm.bodies import BY_FILE
from vdsm_pin.arm.tree import arm_tree, link_frame
from vdsm_pin.geometry.arrays import IntArray
from vdsm_pin.problem.held import held_pairs
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.proof.bodies import Body, LeftOut, PairTable
from vdsm_pin.verification.assembly import Assembly


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


def arm_assembly(problem: PlanningProblem) -> Assembly:
    """An arm among its obstacles, with the pairs in the order of the certificate."""
    arm, which = problem.manipulator, ArmPairs(problem)
    outer, between, n = which.outer, which.between.held, len(which.bodies)
    needed = problem.required_clearance, problem.required_self_clearance
    named = [""] * arm.n_links + [body.name for body in which.bodies[arm.n_links :]]
    own = [Body(link_frame(b.link), (b.piece,), b.name) for b in which.bodies]
    return Assembly(
        own_tree=arm_tree(arm),
        own=own,
        links=[body.link for body in which.bodies],
        names=named,
        balls=[body.ball for body in which.bodies],
        scene=problem.scene,
        table=PairTable(
            one=np.concatenate([n + outer[:, 1], between[:, 0]]),
            other=np.concatenate([outer[:, 0], between[:, 1]]),
            required=np.repeat(np.array(needed), (len(outer), len(between))),
        ),
        column_errors=lambda errors: np.append(0.0, errors.angles(arm.n_links)),
        packed=problem.packed,
        chain=sum(not body.carried for body in which.bodies),
    )
