"""What a clearance proof is asked: bodies and pairs, the packed scene, the rules."""

from functools import cached_property
from typing import Final

import numpy as np

from vdsm_pin.arm_bodies import ArmBody, SelfPairs, arm_bodies, self_pairs
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.pieces import PackedPieces, pack_pieces
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.proof.terms import BASE, Bodies, Pairs, Rules, Task
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.link_clearance import arithmetic_pad
from vdsm_pin.verification.records import ErrorBox, Pair

SLACK: Final = 0.02
"""How wide a bracket may be, as a part of the clearance."""


class PairTable:
    """Which pairs of a problem are judged, in the order of the certificate.

    With every obstacle every body, then the bodies among themselves.

    Args:
        problem: Arm, scene, required clearances.
    """

    def __init__(self, problem: PlanningProblem) -> None:
        self.problem, arm = problem, problem.manipulator
        self.bodies: tuple[ArmBody, ...] = arm_bodies(arm)
        self.between: SelfPairs = self_pairs(arm, self.bodies)
        names = problem.scene.names
        self.outer = [
            (b, o)
            for o, name in enumerate(names)
            for b, body in enumerate(self.bodies)
            if not arm.ignores(body.name, name)
        ]

    @property
    def size(self) -> int:
        """Number of pairs."""
        return len(self.outer) + len(self.between.held)

    @cached_property
    def pairs(self) -> tuple[Pair, ...]:
        """Every pair as the reports name it."""
        names = self.problem.scene.names
        rows = [
            Pair(self.bodies[b].link, names[o], body=self._named(b))
            for b, o in self.outer
        ]
        rows += [
            Pair(
                self.bodies[i].link,
                other_link=self.bodies[k].link,
                body=self._named(i),
                other_body=self._named(k),
            )
            for i, k in self.between.held.tolist()
        ]
        return tuple(rows)

    def _named(self, body: int) -> str:
        return "" if body < self.problem.manipulator.n_links else self.bodies[body].name

    def packed(self) -> Pairs:
        """The same for the kernels: body b at rest is obstacle n_obstacles + b."""
        problem, between = self.problem, self.between.held
        outer = np.array(self.outer, dtype=np.int64).reshape(-1, 2)
        link = np.array([body.link - 1 for body in self.bodies], dtype=np.int64)
        body = np.concatenate([outer[:, 0], between[:, 1]])
        n_obstacles = len(problem.scene.obstacles)
        needed = problem.required_clearance, problem.required_self_clearance
        sizes = len(outer), len(between)
        return Pairs(
            body=body,
            link=link[body],
            obstacle=np.concatenate([outer[:, 1], n_obstacles + between[:, 0]]),
            frame=np.concatenate([np.full(len(outer), BASE), link[between[:, 0]]]),
            required=np.repeat(needed, sizes),
            lost=np.zeros(sum(sizes)),
            rise=np.zeros(sum(sizes)),
        )


def all_pairs(problem: PlanningProblem) -> tuple[Pair, ...]:
    """Every pair that is judged, in the order of the certificate."""
    return PairTable(problem).pairs


def pack_scene(problem: PlanningProblem) -> PackedPieces:
    """The obstacles, then the bodies of the arm in the frames of their links."""
    bodies = [[body.piece] for body in arm_bodies(problem.manipulator)]
    obstacles = [obstacle.pieces for obstacle in problem.scene.obstacles]
    return pack_pieces([*obstacles, *bodies])


def pack_bodies(bodies: tuple[ArmBody, ...]) -> Bodies:
    """The bodies as the kernels read them."""
    corners = [body.corners for body in bodies]
    discs = np.zeros((len(bodies), 4))
    for row, body in zip(discs, bodies, strict=True):
        if body.disc > 0.0:
            row[:3], row[3] = body.piece.axis, body.disc  # type: ignore[union-attr]
    levers = [_levers(body) for body in bodies]
    return Bodies(
        link=np.array([body.link - 1 for body in bodies], dtype=np.int64),
        first=np.cumsum([0, *map(len, corners)], dtype=np.int64),
        corners=np.concatenate(corners),
        levers=np.concatenate(levers),
        radius=np.array([body.ball for body in bodies]),
        discs=discs,
        axial=np.array([body.axial for body in bodies], dtype=np.bool_),
    )


def _levers(body: ArmBody) -> FloatArray:
    """Distances of the corners, with their disc, from the link's origin; [m]."""
    if body.axial:
        return np.array([0.0, body.corners[1, 0]])
    return np.asarray(np.linalg.norm(body.corners, axis=1) + body.disc)


def make_task(
    problem: PlanningProblem,
    errors: ErrorBox,
    pieces: PackedPieces | None = None,
    deadline: Deadline = NO_LIMIT,
) -> Task:
    """What the kernels need to know of a problem."""
    packed, table = pieces or pack_scene(problem), PairTable(problem)
    n_links = problem.manipulator.n_links
    rules = Rules(
        lengths=np.array(problem.manipulator.link_lengths),
        joint_errors=np.zeros((n_links, 2)),
        base_turn=0.0,
        joints_err=False,
        steady=True,
        nominal=True,
        pad=arithmetic_pad(problem, packed),
        goal=TOLERANCES.bracket_gap,
        gap=TOLERANCES.least_bracket,
        slack=SLACK,
        until=deadline.end,
    )
    task = Task(packed, pack_bodies(table.bodies), table.packed(), rules)
    return with_errors(task, errors)


def with_errors(task: Task, errors: ErrorBox) -> Task:
    """The same asked about another error box."""
    pairs, pad = task.pairs, task.rules.pad
    joints = np.full_like(task.rules.joint_errors, errors.joint)
    shift = np.where(pairs.frame == BASE, errors.obstacle + errors.base, 0.0)
    radius = task.bodies.radius[pairs.body]
    steady = not (joints.any() or errors.base_turn > 0.0)
    rules = task.rules._replace(
        joint_errors=joints,
        base_turn=float(errors.base_turn),
        joints_err=bool(joints.any()),
        steady=steady,
        nominal=steady and not shift.any(),
    )
    pairs = pairs._replace(lost=radius + pad + shift, rise=pad - radius)
    return task._replace(pairs=pairs, rules=rules)
