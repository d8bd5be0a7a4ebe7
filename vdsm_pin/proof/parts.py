"""How pairs of bodies are asked: convex parts of one side move past the other.

Of the two sides the one at rest in the world is the partner, else the one of more
pieces, or of a branch of its own; the other one moves past it, part by part.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, IntArray
from vdsm_pin.proof.bodies import Body, PairTable
from vdsm_pin.proof.terms import WORLD
from vdsm_pin.proof.tree import Tree


@dataclass(frozen=True)
class PartPlan:
    """How pairs of bodies are asked: each as some of a convex part and a partner.

    Args:
        bodies: Those at rest in the world first, then the others, then parts of bodies
            with several.
        pairs: Of parts and partners.
        owner: The pair that each stands for, shape (n,).
        swapped: Whether its first body is the partner, shape (n,).
        number: Number of the body as it was given, of each body, (n_bodies,).
        n_obstacles: Number of those at rest in the world.
    """

    bodies: list[Body]
    pairs: PairTable
    owner: IntArray
    swapped: BoolArray
    number: IntArray
    n_obstacles: int


def _mover(one: Body, other: Body, apart: bool) -> bool:
    """Whether the second of two bounded bodies moves past the first, not reversed.

    Args:
        one: The first.
        other: The second.
        apart: Whether they are of two branches of the tree.
    """
    if WORLD in (one.frame, other.frame):
        return one.frame == WORLD
    return apart or len(other.pieces) < len(one.pieces)


def planned_parts(tree: Tree, bodies: Sequence[Body], pairs: PairTable) -> PartPlan:
    """Which side of each pair moves, and its convex parts.

    Raises:
        ValueError: If both have a half-space.
    """
    branches = tree.branches[[body.frame for body in bodies]].tolist()
    order = sorted(range(len(bodies)), key=lambda k: bodies[k].frame != WORLD)
    place = {number: k for k, number in enumerate(order)}
    all_bodies, number = [bodies[k] for k in order], list(order)
    parts: dict[int, range] = {}
    bounded = [body.is_bounded for body in bodies]
    rows: list[tuple[int, int, float, int, bool]] = []
    asked = zip(
        pairs.one.tolist(), pairs.other.tolist(), pairs.required.tolist(), strict=True
    )
    for row, (one, other, required) in enumerate(asked):
        if not (bounded[one] or bounded[other]):
            names = f"{bodies[one].name!r} and {bodies[other].name!r}"
            message = f"{names} are both unbounded: they always meet"
            raise ValueError(message)
        swapped = not bounded[one]
        if bounded[one] and bounded[other]:
            apart = branches[one] != branches[other]
            swapped = _mover(bodies[one], bodies[other], apart)
        mover, partner = (other, one) if swapped else (one, other)
        body, first = bodies[mover], len(all_bodies)
        if mover not in parts and len(body.pieces) == 1:
            parts[mover] = range(place[mover], place[mover] + 1)
        elif mover not in parts:
            parts[mover] = range(first, first + len(body.pieces))
            all_bodies += [Body(body.frame, (p,), body.name) for p in body.pieces]
            number += [mover] * len(body.pieces)
        partner = place[partner]
        rows += [(k, partner, required, row, swapped) for k in parts[mover]]
    table = PairTable(
        np.array([row[0] for row in rows], dtype=np.int64),
        np.array([row[1] for row in rows], dtype=np.int64),
        np.array([row[2] for row in rows], dtype=np.float64),
    )
    return PartPlan(
        bodies=all_bodies,
        pairs=table,
        owner=np.array([row[3] for row in rows], dtype=np.int64),
        swapped=np.array([row[4] for row in rows], dtype=np.bool_),
        number=np.array(number, dtype=np.int64),
        n_obstacles=sum(body.frame == WORLD for body in bodies),
    )
