"""Which links of a robot are held apart."""

from collections.abc import Mapping

import numpy as np

from vdsm_pin.proof.bodies import Body, LeftOut
from vdsm_pin.proof.tree import Tree


def held_pairs(
    tree: Tree,
    bodies: tuple[Body, ...],
    disabled: Mapping[frozenset[str], str],
    adjacent: bool,
) -> tuple[tuple[tuple[int, int], ...], tuple[LeftOut, ...]]:
    """Which links are held apart, and which are not.

    Args:
        tree: The joints.
        bodies: The links with solids.
        disabled: What the SRDF leaves out.
        adjacent: Whether neighbours are left out too, where there is no SRDF.
    """
    held, left_out = [], []
    for i, one in enumerate(bodies):
        for k in range(i + 1, len(bodies)):
            other = bodies[k]
            ways = tree.way(one.frame, other.frame)
            between = [
                int(j)
                for j in np.concatenate(ways)
                if tree.joints[j].column is not None
            ]
            reason = disabled.get(frozenset((one.name, other.name)), "")
            if not between:
                reason = "no joint between them moves"
            elif adjacent and len(between) == 1 and not reason:
                reason = "neighbours, joined by one joint"
            if reason:
                left_out.append(LeftOut(one.name, other.name, reason))
            else:
                held.append((i, k))
    return tuple(held), tuple(left_out)
