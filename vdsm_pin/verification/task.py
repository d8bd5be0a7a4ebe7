"""What of a snake arm is held apart, and how the proof has it."""

import numpy as np

from vdsm_pin.arm.bodies import BY_FILE
from vdsm_pin.arm.kinematics import arm_tree, link_frame
from vdsm_pin.problem.held import held_pairs
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.proof.bodies import Body, LeftOut, PairTable
from vdsm_pin.verification.assembly import Assembly


def ignored_pairs(problem: PlanningProblem) -> tuple[LeftOut, ...]:
    """Bodies and obstacles that the problem file leaves out."""
    arm = problem.manipulator
    owners = dict.fromkeys(body.owner for body in arm.convex_bodies)
    return tuple(
        LeftOut(body, name, BY_FILE)
        for name in (problem.scene.names if arm.ignore_pairs else ())
        for body in owners
        if arm.ignores(body, name)
    )


def arm_assembly(problem: PlanningProblem) -> Assembly:
    """An arm among its obstacles, with the pairs in the order of the certificate.

    First come the pairs of a body and an obstacle, obstacle by obstacle, then those of
    two bodies.
    """
    arm, bodies = problem.manipulator, problem.manipulator.convex_bodies
    obstacle, own = np.nonzero(held_pairs(arm, bodies, problem.scene.names).T)
    between, n = arm.self_pairs.held, len(bodies)
    needed = problem.required_clearance, problem.required_self_clearance
    return Assembly(
        own_tree=arm_tree(arm),
        own=[Body(link_frame(b.link), (b.piece,), b.name) for b in bodies],
        links=[body.link for body in bodies],
        names=[""] * arm.n_links + [body.name for body in bodies[arm.n_links :]],
        balls=[body.ball for body in bodies],
        scene=problem.scene,
        table=PairTable(
            one=np.concatenate([n + obstacle, between[:, 0]]),
            other=np.concatenate([own, between[:, 1]]),
            required=np.repeat(np.array(needed), (len(own), len(between))),
        ),
        column_errors=lambda errors: np.append(0.0, errors.angles(arm.n_links)),
        packed=problem.packed,
        chain=sum(not body.carried for body in bodies),
    )
