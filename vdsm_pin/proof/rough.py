"""Rough versions of pairs: bodies of many corners by few of them.

What is proved of few corners, less what they miss, is proved of all; and no more than
what they come to can be proved of all. So most pairs never ask for all corners.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vdsm_pin.geometry.arrays import IntArray
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
