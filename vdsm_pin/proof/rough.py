"""Rough versions of pairs: bodies of many corners by few of them.

What is proved of few corners, less what they miss, is proved of all; and no more than
what they come to can be proved of all. So most pairs never ask for all corners.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vdsm_pin.geometry.arrays import IntArray
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.proof.bodies import Body, PairTable


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
    """Pairs and, where a body has many corners, their rough versions."""
    every, few_of, missed = list(bodies), np.arange(len(bodies)), np.zeros(len(bodies))
    original = list(range(len(bodies)))
    for k in np.unique(np.concatenate([pairs.one, pairs.other])).tolist():
        body = bodies[k]
        piece = body.pieces[0] if len(body.pieces) == 1 else None
        if isinstance(piece, Hull) and piece.few is not None:
            few_of[k], missed[k] = len(every), piece.few.missed
            few = Hull(piece.few.points, piece.radius)
            every.append(replace(body, pieces=(few,)))
            original.append(k)
    loose = missed[pairs.one] + missed[pairs.other]
    has, rough = np.flatnonzero(loose > 0.0), np.full(pairs.size, -1)
    rough[has] = pairs.size + np.arange(has.size)
    table = PairTable(
        np.concatenate([pairs.one, few_of[pairs.one[has]]]),
        np.concatenate([pairs.other, few_of[pairs.other[has]]]),
        np.concatenate([pairs.required, pairs.required[has]]),
        rough,
        np.concatenate([np.zeros(pairs.size), loose[has]]),
    )
    return Rough(every, np.array(original, dtype=np.int64), table)
