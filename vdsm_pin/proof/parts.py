"""How pairs of bodies are asked: convex parts of one side move past the other.

Of the two sides the one at rest in the world is the partner, else the one of more
pieces, or of a branch of its own, or the first one, which is mostly nearer to the base;
the other one moves past it, part by part.

Bodies of many corners have rough versions of few: what is proved of few corners, less
what they miss, is proved of all; and no more than what they come to can be proved of
all. So most pairs never ask for all corners.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, IntArray
from vdsm_pin.proof.bodies import Body, PairTable
from vdsm_pin.proof.terms import WORLD
from vdsm_pin.proof.tree import Tree


@dataclass(frozen=True)
class Rough:
    """Pairs and rough versions of some.

    Args:
        bodies: All bodies, those of few corners last.
        original: The body that each stands for, shape (n_bodies,).
        pairs: Of both.
    """

    bodies: list[Body]
    original: IntArray
    pairs: PairTable


def with_rough(bodies: Sequence[Body], pairs: PairTable) -> Rough:
    """Pairs and, where bodies have many corners, their rough versions."""
    n_levels = max((len(body.few) for body in bodies), default=0)
    every, original = list(bodies), list(range(len(bodies)))
    one, other, needed = [pairs.one], [pairs.other], [pairs.required]
    loose, n = [np.zeros(pairs.size)], pairs.size
    rough = np.full((n, n_levels), -1)
    for level in range(n_levels):
        number, missed = np.arange(len(bodies)), np.zeros(len(bodies))
        for k, body in enumerate(bodies):
            if level < len(body.few):
                number[k], missed[k] = len(every), body.few[level].missed
                every.append(body.few[level].body)
                original.append(k)
        both = missed[pairs.one] + missed[pairs.other]
        has = np.flatnonzero(both > 0.0)
        rough[has, level] = n + np.arange(has.size)
        n += has.size
        one.append(number[pairs.one[has]])
        other.append(number[pairs.other[has]])
        needed.append(pairs.required[has])
        loose.append(both[has])
    table = PairTable(
        np.concatenate(one),
        np.concatenate(other),
        np.concatenate(needed),
        rough,
        np.concatenate(loose),
    )
    return Rough(every, np.array(original, dtype=np.int64), table)


@dataclass(frozen=True)
class PartPlan:
    """How pairs of bodies are asked: each as some of a convex part and a partner.

    Args:
        bodies: Those at rest in the world first, then the others, then parts of bodies
            with several.
        pairs: Of parts and partners.
        owner: The pair that each stands for, none missing, rising, shape (n,).
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

    @property
    def n_pairs(self) -> int:
        """Number of pairs as they were given."""
        return int(self.owner.max(initial=-1)) + 1


def planned_parts(tree: Tree, bodies: Sequence[Body], pairs: PairTable) -> PartPlan:
    """Which side of each pair moves, and its convex parts.

    Raises:
        ValueError: If both have a half-space.
    """
    swapped = _swapped(tree, bodies, pairs)
    mover = np.where(swapped, pairs.other, pairs.one)
    partner = np.where(swapped, pairs.one, pairs.other)
    order = sorted(range(len(bodies)), key=lambda k: bodies[k].frame != WORLD)
    all_bodies, number = [bodies[k] for k in order], list(order)
    place = np.argsort(order, kind="stable")
    first, n_parts = place.copy(), np.ones(len(bodies), np.int64)
    for k in dict.fromkeys(mover.tolist()):
        parts = bodies[k].parts
        if len(parts) > 1:
            first[k], n_parts[k] = len(all_bodies), len(parts)
            all_bodies += parts
            number += [k] * len(parts)
    counts = n_parts[mover]
    owner = np.repeat(np.arange(pairs.size), counts)
    within = np.arange(owner.size) - np.repeat(np.cumsum(counts) - counts, counts)
    table = PairTable(
        first[mover][owner] + within, place[partner][owner], pairs.required[owner]
    )
    return PartPlan(
        bodies=all_bodies,
        pairs=table,
        owner=owner,
        swapped=swapped[owner],
        number=np.array(number, dtype=np.int64),
        n_obstacles=sum(body.frame == WORLD for body in bodies),
    )


def _swapped(tree: Tree, bodies: Sequence[Body], pairs: PairTable) -> BoolArray:
    """Of which pairs the second body moves past the first one, shape (n_pairs,).

    Raises:
        ValueError: If both have a half-space.
    """
    bounded = np.array([body.is_bounded for body in bodies], bool)
    frames = np.array([body.frame for body in bodies], np.int64)
    n_pieces, branches = np.array([len(b.pieces) for b in bodies]), tree.branches
    one, other = pairs.one, pairs.other
    for k in np.flatnonzero(~(bounded[one] | bounded[other]))[:1]:
        names = f"{bodies[one[k]].name!r} and {bodies[other[k]].name!r}"
        message = f"{names} are both unbounded: they always meet"
        raise ValueError(message)
    rests, apart = (
        frames[one] == WORLD,
        branches[frames[one]] != branches[frames[other]],
    )
    later = np.where(
        rests | (frames[other] == WORLD),
        rests,
        apart | (n_pieces[other] <= n_pieces[one]),
    )
    return np.where(bounded[one] & bounded[other], later, ~bounded[one])
