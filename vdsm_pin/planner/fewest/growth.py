"""Shapes with as many knees as it takes, grown along the path where sparse ones end.

A population of configurations follows the tip from layer to layer. Each child bends one
joint of its parent a little, adds a knee or takes one away; children that are clear and
can be reached from their parent live on. Only the ancestors of the few best that came
farthest enter the graph.

Nearly every child can be reached from its parent. So the ways from parents to children
are first taken for clear and looked at only among those ancestors; where none of the
best comes through, it is grown again with every way looked at.
"""

from dataclasses import dataclass

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.motion import Intervals
from vdsm_pin.planner.fewest.vary import SCALES, vary

FAMILY = 8
"""Children tried for each parent."""
POPULATION = 150
"""Configurations that live on at a layer."""
RETRIES = 4
"""Rounds of change at rest before a population that cannot go on is given up."""
KEPT = 6
"""Configurations at the farthest layer whose ancestors are kept."""
WIDE = 0.5
"""Room beyond this part of the body's radius is worth nothing more; [-]."""


@dataclass(frozen=True)
class Grown:
    """A tree of configurations, parents before their children.

    Args:
        layer: Layer of each, shape (g,).
        offsets: D_1..D_{N+1} of each, shape (g, N + 1, 2); [m].
        parent: Number of the parent, or -1 - (root number), shape (g,).
    """

    layer: IntArray
    offsets: FloatArray
    parent: IntArray

    def with_more(self, layer: int, offsets: FloatArray, parent: IntArray) -> "Grown":
        """The tree with another generation at its end."""
        return Grown(
            np.append(self.layer, np.full(len(offsets), layer)),
            np.concatenate([self.offsets, offsets]),
            np.append(self.parent, parent),
        )

    def take(self, kept: IntArray) -> "Grown":
        """Some configurations, in order, whose parents are among them."""
        rank = np.full(len(self.layer), -1)
        rank[kept] = np.arange(len(kept))
        up = self.parent[kept]
        up = np.where(up < 0, up, rank[np.maximum(up, 0)])
        return Grown(self.layer[kept], self.offsets[kept], up)

    def with_ancestors(self, numbers: IntArray) -> "Grown":
        """Only these configurations and all their ancestors."""
        kept: set[int] = set()
        for start in numbers.tolist():
            at = start
            while at >= 0 and at not in kept:
                kept.add(at)
                at = int(self.parent[at])
        return self.take(np.array(sorted(kept), dtype=np.int64))


def lacking(judge: Judge, clearances: FloatArray) -> FloatArray:
    """What clearances [m] lack of what is wanted, 0 for nothing, 1 for all; [-]."""
    wanted = WIDE * judge.problem.manipulator.most_radius
    return np.asarray(np.maximum(0.0, 1.0 - (clearances - judge.required) / wanted))


class Population:
    """Grows configurations along given tips.

    Args:
        judge: Says what is clear.
        tips: Tip of each layer, shape (l, 3); [m].
        rng: Source of chance.
    """

    def __init__(
        self, judge: Judge, tips: FloatArray, rng: np.random.Generator
    ) -> None:
        self.judge, self.tips, self.rng = judge, tips, rng

    def _children(
        self, offsets: FloatArray, layer: int, to: int, every_connection: bool
    ) -> tuple[FloatArray, IntArray]:
        """Living children at layer `to` and the row of each one's parent."""
        arm = self.judge.problem.manipulator
        rows = np.repeat(np.arange(len(offsets)), FAMILY)
        moved = self.tips[to, 1:] - self.tips[layer, 1:]
        n = len(rows)
        scale = self.rng.choice(np.array(SCALES), n) * arm.total_length
        shift = self.rng.normal(size=(n, 2)) * scale[:, None]
        born = vary(
            offsets[rows], arm.stations, np.broadcast_to(moved, (n, 2)).copy(),
            self.rng.random(n), self.rng.random(n), shift,
        )  # fmt: skip
        tips = np.broadcast_to(self.tips[to], (n, 3))
        clearances, changed, _ = self.judge.look(tips, born)
        alive = np.flatnonzero(clearances >= self.judge.required)
        order = self._choice(clearances[alive], changed[alive])
        picked = alive[order]
        if not every_connection:
            return born[picked], rows[picked]
        lines = Intervals(
            np.broadcast_to(self.tips[layer], (len(picked), 3)),
            tips[picked],
            offsets[rows[picked]],
            born[picked],
        )
        good = self.judge.clear(lines) if len(picked) else np.zeros(0, bool)
        return born[picked[good]], rows[picked[good]]

    def _choice(self, clearances: FloatArray, changed: IntArray) -> IntArray:
        """Half the best, half by chance."""
        if len(clearances) <= POPULATION:
            return np.arange(len(clearances))
        lack = lacking(self.judge, clearances)
        score = changed + 2.0 * lack**2 + self.rng.random(len(clearances))
        order = np.argsort(score, kind="stable")
        best, rest = order[: POPULATION // 2], order[POPULATION // 2 :]
        return np.concatenate(
            [best, self.rng.permutation(rest)[: POPULATION - len(best)]]
        )

    def grow(self, offsets: FloatArray, first: int, last: int) -> Grown:
        """Grow from configurations at layer `first` towards layer `last`.

        Args:
            offsets: Roots at layer `first`, shape (n, N + 1, 2); [m].
            first: Layer of the roots.
            last: Layer to reach, before or after.

        Returns:
            The few best of those that came farthest, with their ancestors.
        """
        tree = self._best(*self._grown(offsets, first, last, every_connection=False))
        reached = self._reached(tree, offsets, first)
        # Those that came farthest stand last.
        if np.array_equal(reached.layer[-1:], tree.layer[-1:]):
            return reached
        return self._best(*self._grown(offsets, first, last, every_connection=True))

    def _grown(
        self, offsets: FloatArray, first: int, last: int, every_connection: bool
    ) -> tuple[Grown, IntArray]:
        """All that grew, and the numbers of those that came farthest."""
        none = np.zeros(0, dtype=np.int64)
        tree, front = Grown(none, offsets[:0], none), none
        step = 1 if last > first else -1
        at, layer, retries = offsets, first, 0
        numbers = -1 - np.arange(len(offsets))
        while layer != last and len(at):
            born, rows = self._children(at, layer, layer + step, every_connection)
            if len(born) < POPULATION // 10 and retries < RETRIES:
                retries += 1
                side, side_rows = self._children(at, layer, layer, every_connection)
                ids = len(tree.layer) + np.arange(len(side))
                tree = tree.with_more(layer, side, numbers[side_rows])
                at = np.concatenate([at, side])
                numbers = np.concatenate([numbers, ids])
                if len(at) > 2 * POPULATION:
                    pick = self.rng.permutation(len(at))[: 2 * POPULATION]
                    at, numbers = at[pick], numbers[pick]
                continue
            if not len(born):
                break
            retries = 0
            layer += step
            front = len(tree.layer) + np.arange(len(born))
            tree = tree.with_more(layer, born, numbers[rows])
            at, numbers = born, front
        return tree, front

    def _best(self, tree: Grown, front: IntArray) -> Grown:
        """The few best of the front with all their ancestors."""
        if not len(front):
            return tree.take(front)
        tips = self.tips[tree.layer[front]]
        clearances, changed, _ = self.judge.look(tips, tree.offsets[front])
        lack = lacking(self.judge, clearances)
        best = np.argsort(changed + lack, kind="stable")[:KEPT]
        return tree.with_ancestors(front[best])

    def _reached(self, tree: Grown, roots: FloatArray, first: int) -> Grown:
        """What of a tree can be reached from its roots, which are at layer `first`."""
        if not len(tree.layer):
            return tree
        # Roots stand at the end, the first one last, where their numbers -1, -2, ...
        # find them.
        offsets = np.concatenate([tree.offsets, roots[::-1]])
        layer = np.append(tree.layer, np.full(len(roots), first))
        lines = Intervals(
            self.tips[layer[tree.parent]], self.tips[tree.layer],
            offsets[tree.parent], tree.offsets,
        )  # fmt: skip
        reached = self.judge.clear(lines)
        for number, parent in enumerate(tree.parent.tolist()):
            reached[number] &= parent < 0 or reached[parent]
        return tree.take(np.flatnonzero(reached))
