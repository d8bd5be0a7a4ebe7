"""What is asked of every motion of a tree: bodies and pairs, packed once.

`Question.of(tree, bodies, pairs, errors).about(path, budget).prove()` is the
whole proof.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import IntArray
from vdsm_pin.geometry.pieces import PackedPieces, joined_pieces, pack_pieces
from vdsm_pin.proof.bodies import Body, ErrorBox, PairTable
from vdsm_pin.proof.budget import Budget, rounding_pad
from vdsm_pin.proof.packing import for_motion, pack_task
from vdsm_pin.proof.parts import PartPlan, planned_parts, with_rough
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.proving import Proving, new_proving
from vdsm_pin.proof.terms import Task
from vdsm_pin.proof.tree import Tree, added_up

KEPT: Final = 2
"""Robots whose packed pieces are kept."""


@dataclass(frozen=True)
class Question:
    """Pairs of bodies on a tree under errors, ready to be asked about motions.

    Args:
        tree: The joints.
        plan: How the pairs are asked.
        task: The same as compiled code reads it, of no motion: without errors and
            rounding, so that nothing may be proved of it.
        number: The body as it was given that each packed one is or is a part of.
        errors: Of joints, placements and of the packed bodies' surfaces.
        n_columns: Columns of a profile.
        extent: Bound of all lengths and coordinates where q is 0; [m].
    """

    tree: Tree
    plan: PartPlan
    task: Task
    number: IntArray
    errors: ErrorBox
    n_columns: int
    extent: float

    @classmethod
    def of(
        cls,
        tree: Tree,
        bodies: Sequence[Body],
        pairs: PairTable,
        errors: ErrorBox | None = None,
        columns: IntArray | None = None,
        packed: PackedPieces | None = None,
    ) -> "Question":
        """Pack it.

        Args:
            tree: The joints; what moves by itself is a branch of its own.
            bodies: The bodies, on its frames.
            pairs: Which bodies are held apart, and how far.
            errors: The proof covers every motion within them; None for the path itself.
            columns: Column of each body in the profile, shape (n_bodies,); the profile
                is of moving bodies against those at rest. None for no profile.
            packed: Pieces of the bodies, those at rest first, where they are packed
                already; of bodies with rough versions or parts it is of no use.

        Raises:
            ValueError: If bodies, pairs and tree do not fit together.
        """
        _check(tree, bodies)
        plan = planned_parts(tree, bodies, pairs)
        rough = with_rough(plan.bodies, plan.pairs)
        number, every = plan.number[rough.original], rough.bodies
        if packed is None or len(every) > len(bodies):
            n = plan.n_obstacles
            resting = pack_pieces([body.pieces for body in every[:n]])
            packed = joined_pieces(resting, _moving_pieces(tuple(every[n:])))
        count = 1 if columns is None else int(columns.max(initial=0)) + 1
        columns = None if columns is None else columns[number]
        extent, rules = _extent(tree, packed), Budget().rules(0.0)
        task = pack_task(tree, every, rough.pairs, rules, None, columns, packed)
        none = ErrorBox(*np.zeros((3, len(tree.joints))))
        asked = cls(tree, plan, task, number, none, count, extent)
        return asked if errors is None else asked.under(errors)

    def under(self, errors: ErrorBox) -> "Question":
        """The same under other errors, of surfaces of bodies as they were given."""
        if errors.surfaces is not None:
            surfaces = np.asarray(errors.surfaces, dtype=np.float64)[self.number]
            errors = replace(errors, surfaces=surfaces)
        return replace(self, errors=errors)

    @property
    def places(self) -> list[int]:
        """Where each body as it was given stands among the packed ones."""
        n_bodies = int(self.number.max(initial=-1)) + 1
        order = np.argsort(self.number[:n_bodies], kind="stable")
        return [int(k) for k in order]

    def about(self, path: Path, budget: Budget | None = None) -> Proving:
        """The question about a motion, nothing judged.

        Args:
            path: How the joints move.
            budget: How long it may take.

        Raises:
            ValueError: If the path has other columns than the tree.
        """
        tree, budget = self.tree, budget or Budget()
        if path.knots.shape[1] != tree.n_columns:
            message = (
                f"the path has {path.knots.shape[1]} columns, the tree {tree.n_columns}"
            )
            raise ValueError(message)
        reach = path.reach
        rules = budget.rules(rounding_pad(self.extent + added_up(tree.joints, reach)))
        task = for_motion(self.task, tree, reach, rules, self.errors)
        return new_proving(self.plan, task, path.packed(), self.n_columns, budget)


@lru_cache(maxsize=KEPT)
def _moving_pieces(bodies: tuple[Body, ...]) -> PackedPieces:
    """Packed pieces of a robot's bodies, for its next scene."""
    return pack_pieces([body.pieces for body in bodies])


def _extent(tree: Tree, pieces: PackedPieces) -> float:
    """Bound of all lengths and coordinates where q is 0; [m]."""
    values = (pieces.points, pieces.centre, pieces.extent, pieces.radius)
    return _stretched(tree) + max(float(np.abs(x).max(initial=0.0)) for x in values)


@lru_cache(maxsize=KEPT)
def _stretched(tree: Tree) -> float:
    """The way along all joints where q is 0; [m]."""
    far = 0.0
    for joint in tree.joints:
        far += float(np.linalg.norm(np.asarray(joint.placement)[:3, 3]))
        far += abs(joint.offset)
    return far


def _check(tree: Tree, bodies: Sequence[Body]) -> None:
    """Refuse what does not fit together.

    Raises:
        ValueError: If a body rides on no frame of the tree or has no piece.
    """
    for body in bodies:
        if not 0 <= body.frame < tree.n_frames or not len(body.pieces):
            message = (
                f"body {body.name!r} has {len(body.pieces)} pieces on frame "
                f"{body.frame}, expected at least one and a frame below {tree.n_frames}"
            )
            raise ValueError(message)
