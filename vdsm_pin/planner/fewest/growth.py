"""Growth: a population of arms follows the tip from layer to layer.

Each child keeps its parent's shape, and bends a joint a little, adds a knee or takes
one away (`charts`). Children that are clear and can be reached from their parent live
on, half of them the best, half by chance. Where few do, the population is mutated at
rest; where none does, it goes back some layers, is mutated there and tries again.

The layers are those of the desired path, from nodes of the roadmap on (`added_nodes`),
or those of a route of the tip from the start on (`insertion`). On a route one arm that
follows it exactly (`follow_the_leader`) is among them as far as it is clear, and where
the first tries fail a part of the children follow their parent's own curve.
"""

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.planner.fewest.charts import (
    Intervals,
    chart_of,
    standing,
    turned_towards,
)
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.tip_curve import followed, led_along
from vdsm_pin.problem.pointing import angles_between

OFFSPRING: Final = 8
"""Children tried for each parent."""
MUTATIONS: Final = 4
"""Times a population that dwindles is mutated at rest before it goes back."""
MOST_SCORED: Final = 0.5
"""Clearance beyond this part of the body's radius scores no better; [-]."""
UNCHANGED: Final = 0.3
"""Part of the children that follow the leader that are not mutated besides; [-]."""
AIMED: Final = 0.5
"""Part of the children that are turned to where the last link shall look; [-]."""
AIM_COST: Final = 4.0
"""What an arm is worse for if it looks a radian past where it shall soon; [-]."""


@dataclass(frozen=True)
class Layers:
    """Where the tip goes.

    Args:
        tips: Shape (l, 3); [m].
        tolerance: How far the tip may be from there, 0 on the path, shape (l,); [m].
        aims: Where the last link shall look, shape (l, 3); None for anywhere.
        aim_weight: How much that counts, 0 to 1: from 1 on it must, shape (l,); [-].
    """

    tips: FloatArray
    tolerance: FloatArray
    aims: FloatArray | None = None
    aim_weight: FloatArray | None = None

    def aim_weight_at(self, layer: int) -> float:
        """How much it counts at a layer where the last link looks; [-]."""
        return 0.0 if self.aim_weight is None else float(self.aim_weight[layer])

    def aims_at(self, layer: int, count: int) -> FloatArray:
        """Where so many last links shall look at a layer, shape (count, 3)."""
        assert self.aims is not None
        return np.broadcast_to(self.aims[layer], (count, 3))

    def asked(self, layer: IntArray) -> FloatArray | None:
        """Where last links must look at layers, NaN for anywhere, None for all so."""
        if self.aims is None or self.aim_weight is None:
            return None
        return np.where(self.aim_weight[layer, None] >= 1.0, self.aims[layer], np.nan)


class Grown(NamedTuple):
    """Arms, each reached from its parent, which stands before it."""

    layer: IntArray
    """Layer of each, shape (g,)."""

    tips: FloatArray
    """Shape (g, 3); [m]."""

    offsets: FloatArray
    """Shape coordinates, shape (g, N + 1, 2) or (g, N, 3)."""

    clearances: FloatArray
    """Shape (g,); [m]."""

    parent: IntArray
    """Number of the parent, -1 of a root, shape (g,)."""

    def with_ancestors(self, numbers: IntArray) -> "Grown":
        """Only these arms, all their ancestors and all roots, in order."""
        kept = self.parent < 0
        for start in numbers.tolist():
            at = start
            while not kept[at]:
                kept[at] = True
                at = int(self.parent[at])
        # The last entry is the parent's of a root.
        rank = np.append(np.cumsum(kept) - 1, -1)
        arms = Grown._make(values[kept] for values in self)
        return arms._replace(parent=rank[arms.parent])


class Population:
    """Grows arms along layers of tips.

    Args:
        judge: Says what is clear.
        layers: Where the tip goes.
        rng: Source of chance.
        size: Arms that live on at a layer.
        led: Part of the children whose joints move on along their parent's own curve;
            an arm that follows the tips exactly is then among them too. None for
            neither.
    """

    def __init__(
        self,
        judge: Judge,
        layers: Layers,
        rng: np.random.Generator,
        size: int,
        led: float | None = None,
    ) -> None:
        self.judge, self.layers, self.rng = judge, layers, rng
        self.size, self.led, self.arm = size, led, judge.problem.manipulator

    def grow(self, roots: FloatArray, most_backtracks: int = 0, kept: int = 1) -> Grown:
        """The arms that come farthest, with their ancestors and all roots.

        Args:
            roots: Shape coordinates of arms at the first layer; of one, if led.
            most_backtracks: Times the population may go back, each time twice as far.
            kept: How many of the farthest, the best of them.
        """
        tips = np.repeat(self.layers.tips[:1], len(roots), axis=0)
        none = np.full(len(roots), -1)
        clearances = self.judge.look(tips, roots).clearances
        self.room = Grown(1 + none, tips, roots, clearances, none)
        self.count = len(roots)
        farthest = np.arange(len(roots))
        generations, backtracks = [farthest], 0
        leader = farthest[:1] if self.led is None else self._leader()
        while len(generations) < len(self.layers.tips):
            layer = len(generations) - 1
            generation = np.append(
                self._next(layer, generations[-1]), leader[layer + 1 :][:1]
            )
            if len(generation):
                generations.append(generation)
                if layer >= self.grown.layer[farthest[0]]:
                    farthest = generation
                continue
            if backtracks == most_backtracks:
                break
            generations = generations[: len(generations) - min(layer, 2**backtracks)]
            for _ in range(2):
                generations[-1] = self._mutated_at_rest(
                    len(generations) - 1, generations[-1]
                )
            backtracks += 1
        return self.grown.with_ancestors(self._best(farthest, kept))

    @property
    def grown(self) -> Grown:
        """The arms on record."""
        return Grown._make(values[: self.count] for values in self.room)

    def _recorded(self, born: Grown) -> IntArray:
        """Numbers of arms after they are put on record."""
        first, self.count = self.count, self.count + len(born.layer)
        if self.count > len(self.room.layer):
            # Twice the room at once, so that arms are seldom copied.
            self.room = Grown._make(
                np.pad(values, [(0, self.count), *[(0, 0)] * (values.ndim - 1)])
                for values in self.room
            )
        for values, new in zip(self.room, born, strict=True):
            values[first : self.count] = new
        return first + np.arange(len(born.layer))

    def _leader(self) -> IntArray:
        """The arm that follows the tip's route, layer by layer as far as it is clear.

        Returns:
            Its number at each layer, from the root's on.
        """
        tips, judge, root = self.layers.tips, self.judge, self.grown
        centres = standing(self.arm, root.tips, root.offsets)[0]
        laid = led_along(tips, centres, self.arm.link_lengths)
        fits = np.isfinite(laid).all(axis=(1, 2))
        layer = np.arange(len(tips) if fits.all() else int(np.argmin(fits)))
        tips, chart = tips[layer], chart_of(root.offsets)
        offsets = chart.coordinates(self.arm, laid[layer])
        offsets[:1] = root.offsets
        aims = self.layers.asked(layer)
        clearances = judge.look(tips, offsets, aims).clearances
        clearances[0] = max(clearances[0], root.clearances[0])
        looking = None if aims is None else np.stack([aims[:-1], aims[1:]], axis=1)
        lines = Intervals(tips[:-1], tips[1:], offsets[:-1], offsets[1:], looking)
        need = judge.needed_from(clearances[:-1])
        good = (clearances[1:] >= judge.required) & judge.clear(lines, need)
        on = layer[1:][np.logical_and.accumulate(good)]
        # Nobody else is on record yet but the root.
        self._recorded(Grown(on, tips[on], offsets[on], clearances[on], on - 1))
        return np.append(0, on)

    def _next(self, layer: int, generation: IntArray) -> IntArray:
        """The arms of the next layer; none where it is not reached."""
        for _ in range(MUTATIONS):
            born = self._survivors(layer, layer + 1, generation)
            if len(born) >= self.size // 10:
                return born
            generation = self._mutated_at_rest(layer, generation)
        return self._survivors(layer, layer + 1, generation)

    def _mutated_at_rest(self, layer: int, generation: IntArray) -> IntArray:
        """Arms of a layer and others of the same that can be reached from them."""
        both = np.append(generation, self._survivors(layer, layer, generation))
        if len(both) <= 2 * self.size:
            return both
        return both[self.rng.permutation(len(both))[: 2 * self.size]]

    def _survivors(self, layer: int, to: int, generation: IntArray) -> IntArray:
        """Living children at a layer."""
        parents, tips, offsets = self._offspring(to, generation)
        required, ends = self.judge.required, np.array([layer, to])
        asked = self.layers.asked(ends)
        must = None if asked is None else np.broadcast_to(asked[1], tips.shape)
        clearances, changed, _ = self.judge.look(tips, offsets, must)
        alive = np.flatnonzero(clearances >= required)
        score = changed[alive] + 2.0 * self._clearance_cost(clearances[alive]) ** 2
        picked = alive[self._selected(score + self._aim_cost(to, offsets[alive]))]
        if not len(picked):
            return picked
        parents, tips, offsets = parents[picked], tips[picked], offsets[picked]
        looking = None if asked is None else np.tile(asked, (len(picked), 1, 1))
        before = self.grown.tips[parents], self.grown.offsets[parents]
        lines = Intervals(before[0], tips, before[1], offsets, looking)
        need = self.judge.needed_from(self.grown.clearances[parents])
        good = self.judge.clear(lines, need)
        layers, clearances = np.full(int(good.sum()), to), clearances[picked]
        return self._recorded(
            Grown(layers, tips[good], offsets[good], clearances[good], parents[good])
        )

    def _offspring(
        self, to: int, generation: IntArray
    ) -> tuple[IntArray, FloatArray, FloatArray]:
        """Children at a layer: number of the parent, tip, offsets."""
        count = OFFSPRING
        if self.led is not None and len(generation):
            # Openings leave few alive: these have more children.
            count = max(OFFSPRING, OFFSPRING * self.size // (2 * len(generation)))
        parents = np.repeat(generation, count)
        n, rng, tolerance = len(parents), self.rng, float(self.layers.tolerance[to])
        tips = np.repeat(self.layers.tips[to : to + 1], n, axis=0)
        if tolerance > 0.0:
            tips += rng.normal(size=(n, 3)) * tolerance / 2.0
        offsets = self.grown.offsets[parents]
        moved = tips[:, 1:] - self.grown.tips[parents, 1:]
        following = self._follow(offsets, parents, tips)
        moved[following] = 0.0
        chart = chart_of(offsets)
        born = chart.mutated(self.arm, offsets, moved, rng)
        kept = following[rng.random(len(following)) < UNCHANGED]
        born[kept] = offsets[kept]
        if self.layers.aim_weight_at(to) > 0.0:
            aims = self.layers.aims_at(to, n)
            born = turned_towards(born, aims, rng.random(n) < AIMED, rng)
        return parents, tips, chart.settled(self.arm, tips, born)

    def _follow(
        self, offsets: FloatArray, parents: IntArray, tips: FloatArray
    ) -> IntArray:
        """Let a part of children follow the leader, in place; numbers of these."""
        if not self.led:
            return np.zeros(0, np.int64)
        chosen = np.flatnonzero(self.rng.random(len(tips)) < self.led)
        before = standing(self.arm, self.grown.tips[parents[chosen]], offsets[chosen])
        laid = followed(before, tips[chosen], self.arm.link_lengths)
        fits = np.isfinite(laid).all(axis=(1, 2))
        chosen = chosen[fits]
        offsets[chosen] = chart_of(offsets).coordinates(self.arm, laid[fits])
        return chosen

    def _aim_cost(self, layer: int, offsets: FloatArray) -> FloatArray:
        """What arms are worse for that do not look to where they shall soon."""
        aim_weight = self.layers.aim_weight_at(layer)
        if not 0.0 < aim_weight < 1.0:
            return np.zeros(len(offsets))
        off = angles_between(offsets[:, -1], self.layers.aims_at(layer, len(offsets)))
        return np.asarray(AIM_COST * aim_weight * off**2)

    def _clearance_cost(self, clearances: FloatArray) -> FloatArray:
        """What clearances [m] lack of what is wanted, 0 for nothing, 1 for all."""
        wanted = MOST_SCORED * self.arm.most_radius
        return np.maximum(0.0, 1.0 - (clearances - self.judge.required) / wanted)

    def _selected(self, score: FloatArray) -> IntArray:
        """Half the best, half by chance."""
        if len(score) <= self.size:
            return np.arange(len(score))
        order = np.argsort(score + self.rng.random(len(score)), kind="stable")
        best, rest = order[: self.size // 2], order[self.size // 2 :]
        chosen = self.rng.permutation(rest)[: self.size - len(best)]
        return np.concatenate([best, chosen])

    def _best(self, generation: IntArray, count: int) -> IntArray:
        """The few best of a generation."""
        tips, offsets = self.grown.tips[generation], self.grown.offsets[generation]
        clearances, changed, _ = self.judge.look(tips, offsets)
        order = np.argsort(changed + self._clearance_cost(clearances), kind="stable")
        return generation[order[:count]]
