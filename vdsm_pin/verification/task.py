"""What a clearance proof is asked: its pairs, the packed scene, the rules."""

from typing import Final

import numpy as np

from vdsm_pin.geometry.convex import Hull
from vdsm_pin.geometry.pieces import PackedPieces, pack_pieces
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.proof.terms import BASE, Pairs, Rules, Task
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.link_clearance import arithmetic_pad
from vdsm_pin.verification.records import ErrorBox, Pair

SLACK: Final = 0.02
"""How wide a bracket may be, as a part of the clearance."""


def all_pairs(problem: PlanningProblem) -> tuple[Pair, ...]:
    """Every pair that is judged, in the order of the certificate."""
    links = range(1, problem.manipulator.n_links + 1)
    names = problem.scene.names
    pairs = [Pair(link, obstacle=name) for name in names for link in links]
    pairs += [Pair(i, other_link=k) for i in links for k in links if k >= i + 2]
    return tuple(pairs)


def _packed_pairs(problem: PlanningProblem) -> Pairs:
    """The same for the kernels: the axis of link i is obstacle n_obstacles + i."""
    n_links, n_obstacles = problem.manipulator.n_links, len(problem.scene.obstacles)
    first, second = np.triu_indices(n_links, k=2)
    n_outer = n_links * n_obstacles
    return Pairs(
        link=np.concatenate([np.tile(np.arange(n_links), n_obstacles), second]),
        obstacle=np.concatenate(
            [np.repeat(np.arange(n_obstacles), n_links), n_obstacles + first]
        ),
        frame=np.concatenate([np.full(n_outer, BASE), first]),
        required=np.concatenate(
            [
                np.full(n_outer, problem.required_clearance),
                np.full(len(first), problem.required_self_clearance),
            ]
        ),
    )


def pack_scene(problem: PlanningProblem) -> PackedPieces:
    """The obstacles, then the axes of the links along x, grown by their radius."""
    arm = problem.manipulator
    axes = [
        Hull(np.array([[0.0, 0.0, 0.0], [length, 0.0, 0.0]]), arm.link_radius)
        for length in arm.link_lengths
    ]
    groups = [obstacle.pieces for obstacle in problem.scene.obstacles]
    return pack_pieces([*groups, *([axis] for axis in axes)])


def make_task(
    problem: PlanningProblem,
    errors: ErrorBox,
    pieces: PackedPieces | None = None,
    deadline: Deadline = NO_LIMIT,
) -> Task:
    """What the kernels need to know of a problem."""
    arm, packed = problem.manipulator, pieces or pack_scene(problem)
    rules = Rules(
        lengths=np.array(arm.link_lengths),
        radius=float(arm.link_radius),
        joint_error=0.0,
        base_error=0.0,
        obstacle_error=0.0,
        pad=arithmetic_pad(problem, packed),
        goal=TOLERANCES.bracket_gap,
        gap=TOLERANCES.least_bracket,
        slack=SLACK,
        until=deadline.end,
    )
    return with_errors(Task(packed, _packed_pairs(problem), rules), errors)


def with_errors(task: Task, errors: ErrorBox) -> Task:
    """The same asked about another error box."""
    rules = task.rules._replace(
        joint_error=float(errors.joint),
        base_error=float(errors.base),
        obstacle_error=float(errors.obstacle),
    )
    return task._replace(rules=rules)
