"""Pieces of the path in another order or direction, where the problem allows it.

Where the arm must leave the path to change sides, the path falls into pieces, each
drawn in one go. In the order given the ways between them may be long; drawn in another
order, or from their other end, they may be short: a square round an obstacle that no
arm encircles is begun where it has to be left otherwise.
"""

import itertools
from typing import Final, TypeAlias

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.planner.fewest.sequence import Leg, Planner, Sequence

MOST_PIECES: Final = 9
"""Pieces up to which the best order is sought among all of them."""

Visit: TypeAlias = tuple[int, bool]
"""Number of a piece, and whether it is drawn backwards."""


def backwards(leg: Leg) -> Leg:
    """The same leg from its other end."""
    return Leg(leg.drawn, leg.nodes[::-1], leg.layers[::-1])


def reordered(planner: Planner, sequence: Sequence) -> Sequence:
    """The same pieces in the order and directions with the shortest ways between.

    Args:
        planner: Knows the ways.
        sequence: The path in the order given.

    Returns:
        The sequence itself where nothing is gained.
    """
    runs = [leg for leg in sequence.legs if leg.drawn]
    if not 1 <= len(runs) <= MOST_PIECES:
        return sequence
    entry = np.array([[run.nodes[0], run.nodes[-1]] for run in runs])
    first = planner.from_home[entry]
    between = np.stack(
        [[planner.ways(int(node))[0][entry] for node in pair] for pair in entry]
    )
    order = shortest_tour(first, between)
    given = tuple((number, False) for number in range(len(runs)))
    gain = tour_length(first, between, given) - tour_length(first, between, order)
    if not gain > 0.0:
        return sequence
    chosen = [backwards(runs[k]) if back else runs[k] for k, back in order]
    return planner.joined(chosen, sequence.skipped)


def tour_length(
    first: FloatArray, between: FloatArray, order: tuple[Visit, ...]
) -> float:
    """Length of the ways of a tour; see `shortest_tour`."""
    number, back = order[0]
    total = float(first[number, int(back)])
    for (a, a_back), (b, b_back) in itertools.pairwise(order):
        # A piece drawn forwards is left at its last node.
        total += float(between[a, int(not a_back), b, int(b_back)])
    return total


def shortest_tour(first: FloatArray, between: FloatArray) -> tuple[Visit, ...]:
    """Order and directions of pieces with the shortest ways, by subsets.

    Args:
        first: Way from the start to both ends of each piece, shape (n, 2).
        between: Way from end e of piece a to end f of piece b at [a, e, b, f], shape
            (n, 2, n, 2).
    """
    n = len(first)
    # best[set, k, f]: the pieces of the set drawn, k last and entered at its end f.
    best = np.full((1 << n, n, 2), np.inf)
    before: IntArray = np.full((1 << n, n, 2), -1)
    for k in range(n):
        best[1 << k, k] = first[k]
    for done in range(1, 1 << n):
        for a, b in itertools.permutations(range(n), 2):
            if not done & (1 << a) or done & (1 << b):
                continue
            more = done | (1 << b)
            for e, f in itertools.product((0, 1), repeat=2):
                value = best[done, a, e] + between[a, 1 - e, b, f]
                if value < best[more, b, f]:
                    best[more, b, f], before[more, b, f] = value, 2 * a + e
    done = (1 << n) - 1
    k, f = divmod(int(np.argmin(best[done])), 2)
    tour = [(k, bool(f))]
    while before[done, k, f] >= 0:
        last = int(before[done, k, f])
        done ^= 1 << k
        k, f = divmod(last, 2)
        tour.append((k, bool(f)))
    return tuple(reversed(tour))
