"""Insertion: a population of arms follows the tip through openings, along the path.

From layer to layer of tips each arm has children. Some follow the leader: their joints
move on along the arm's own curve. The others keep their shape, and bend a joint a
little, add a knee or take one away (`growth.vary`). Children that are clear and can be
reached from their parent live on, half of them the best, half by chance. With them
lives one arm that follows the tip's whole route exactly, as far as that is clear. Where
none is left, the population of some layers before is varied and tries again.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.fewest.charts import coordinates, settled, turned_towards, varied
from vdsm_pin.planner.fewest.follow_the_leader import followed, led_along
from vdsm_pin.planner.fewest.growth import FAMILY, lacking
from vdsm_pin.planner.fewest.judge import Judge
from vdsm_pin.planner.fewest.motion import Intervals, is_directed, standing
from vdsm_pin.problem.pointing import angles_between

LED: Final = 0.4
"""Part of the children that follow the leader; [-]."""
UNCHANGED: Final = 0.3
"""Part of these that are not varied besides; [-]."""
AIMED: Final = 0.5
"""Part of the children that are turned to where the last link shall look; [-]."""
PULL: Final = 4.0
"""What an arm is worse for if it looks a radian past where it shall soon; [-]."""
RESTS: Final = 4
"""Rounds of change at rest before a population that dwindles goes back."""


@dataclass(frozen=True)
class Layers:
    """Where the tip goes.

    Args:
        tips: Shape (l, 3); [m].
        play: How far the tip may be from there, 0 on the desired path, shape (l,); [m].
        aims: Where the last link shall look, shape (l, 3); None for anywhere.
        pull: How much that counts, 0 to 1: from 1 on it must, shape (l,); [-].
    """

    tips: FloatArray
    play: FloatArray
    aims: FloatArray | None = None
    pull: FloatArray | None = None

    def must(self, layer: int) -> bool:
        """Whether the last link must look somewhere at a layer."""
        return self.pull is not None and bool(self.pull[layer] >= 1.0)


@dataclass(frozen=True)
class Chain:
    """A motion through layers, every interval clear.

    Args:
        layer: Layer of each configuration, shape (c,).
        tips: Shape (c, 3); [m].
        offsets: Shape coordinates, shape (c, N + 1, 2) or (c, N, 3).
    """

    layer: IntArray
    tips: FloatArray
    offsets: FloatArray


@dataclass(frozen=True)
class _Crowd:
    """Arms of one layer and the number of each in the family's records."""

    number: IntArray
    tips: FloatArray
    offsets: FloatArray

    def take(self, rows: IntArray) -> "_Crowd":
        return _Crowd(self.number[rows], self.tips[rows], self.offsets[rows])

    def joined(self, other: "_Crowd") -> "_Crowd":
        return _Crowd(
            np.append(self.number, other.number),
            np.concatenate([self.tips, other.tips]),
            np.concatenate([self.offsets, other.offsets]),
        )


class Insertion:
    """Grows a motion along layers of tips.

    Args:
        judge: Says what is clear.
        layers: Where the tip goes.
        rng: Source of chance.
        population: Arms that live on at a layer.
    """

    def __init__(
        self,
        judge: Judge,
        layers: Layers,
        rng: np.random.Generator,
        population: int,
    ) -> None:
        self.judge, self.layers, self.rng = judge, layers, rng
        self.population, self.arm = population, judge.problem.manipulator

    def _forget(self, root: FloatArray) -> None:
        """Begin with empty records; `root` tells how arms are described."""
        self.layer, self.parent = np.zeros(0, np.int64), np.zeros(0, np.int64)
        self.tips, self.offsets = np.zeros((0, 3)), np.zeros((0, *root.shape))
        self.clearances = np.zeros(0)

    def _recorded(
        self,
        layer: int,
        tips: FloatArray,
        offsets: FloatArray,
        clearances: FloatArray,
        parent: IntArray,
    ) -> _Crowd:
        """Arms with their numbers, after they are put on record."""
        number = len(self.layer) + np.arange(len(tips))
        self.layer = np.append(self.layer, np.full(len(tips), layer))
        self.parent = np.append(self.parent, parent)
        self.tips = np.concatenate([self.tips, tips])
        self.offsets = np.concatenate([self.offsets, offsets])
        self.clearances = np.append(self.clearances, clearances)
        return _Crowd(number, tips, offsets)

    def grow(self, root: FloatArray, most_returns: int) -> Chain:
        """The motion from a configuration at the first layer that comes farthest.

        Args:
            root: Its shape coordinates.
            most_returns: Times the population may go back, each time twice as far.
        """
        self._forget(root)
        tip, none = self.layers.tips[:1], np.full(1, -1)
        clearances, _, _ = self.judge.look(tip, root[None])
        crowd = self._recorded(0, tip, root[None], clearances, none)
        crowds, last = [crowd], len(self.layers.tips) - 1
        leader = self._leader(root, crowd)
        returns = 0
        best, farthest = 0, 0
        while len(crowds) - 1 < last:
            crowd = self._next(len(crowds) - 1, crowds[-1])
            if len(crowds) < len(leader.number):
                crowd = crowd.joined(leader.take(np.array([len(crowds)])))
            if len(crowd.number):
                crowds.append(crowd)
                if len(crowds) - 1 > farthest:
                    farthest = len(crowds) - 1
                    best = int(crowd.number[0])
                continue
            if returns == most_returns:
                break
            back = min(len(crowds) - 1, 2**returns)
            crowds = crowds[: len(crowds) - back]
            layer = len(crowds) - 1
            for _ in range(2):
                crowds[-1] = self._varied(layer, crowds[-1])
            returns += 1
        return self._chain(best)

    def _leader(self, root: FloatArray, start: _Crowd) -> _Crowd:
        """The arm that follows the tip's route, layer by layer as far as it is clear.

        Args:
            root: Shape coordinates at the first layer.
            start: The same arm, on record.
        """
        tips, judge = self.layers.tips, self.judge
        centres = standing(self.arm, tips[:1], root[None])[0]
        laid = led_along(np.ascontiguousarray(tips), centres, self.arm.link_lengths)
        fits = np.isfinite(laid).all(axis=(1, 2))
        count = len(tips) if fits.all() else int(np.argmin(fits))
        tips, offsets = tips[:count], self._coordinates(laid[:count])
        offsets[:1] = root
        aims = self._asked(count)
        clearances, _, _ = judge.look(tips, offsets, aims)
        clearances[0] = max(clearances[0], self.clearances[0])
        looking = None if aims is None else np.stack([aims[:-1], aims[1:]], axis=1)
        lines = Intervals(tips[:-1], tips[1:], offsets[:-1], offsets[1:], looking)
        need = np.minimum(judge.required, clearances[:-1])
        good = (clearances[1:] >= judge.required) & judge.clear(lines, need)
        count = 1 + (len(good) if good.all() else int(np.argmin(good)))
        first = len(self.layer)
        number = np.append(start.number, first + np.arange(count - 1))
        for k in range(1, count):
            one = slice(k, k + 1)
            parent = number[k - 1 : k]
            self._recorded(k, tips[one], offsets[one], clearances[one], parent)
        return _Crowd(number, tips[:count], offsets[:count])

    def _coordinates(self, centres: FloatArray) -> FloatArray:
        """Shape coordinates as those on record, from (n, N + 1, 3); [m]."""
        return coordinates(self.arm, centres, is_directed(self.offsets))

    def _asked(self, count: int) -> FloatArray | None:
        """Where last links must look at the first layers, NaN for anywhere."""
        aims, pull = self.layers.aims, self.layers.pull
        if aims is None or pull is None:
            return None
        return np.where(pull[:count, None] >= 1.0, aims[:count], np.nan)

    def _chain(self, number: int) -> Chain:
        """The ancestors of an arm and itself."""
        line = [number]
        while self.parent[line[-1]] >= 0:
            line.append(int(self.parent[line[-1]]))
        kept = np.array(line[::-1])
        return Chain(self.layer[kept], self.tips[kept], self.offsets[kept])

    def _next(self, layer: int, crowd: _Crowd) -> _Crowd:
        """The arms of the next layer, the best first; none where it is not reached."""
        for rest in range(RESTS):
            born = self._children(layer, layer + 1, crowd)
            if len(born.number) >= self.population // 10 or rest == RESTS - 1:
                return born
            crowd = self._varied(layer, crowd)
        return crowd

    def _varied(self, layer: int, crowd: _Crowd) -> _Crowd:
        """Arms of a layer and others of the same that can be reached from them."""
        both = crowd.joined(self._children(layer, layer, crowd))
        if len(both.number) <= 2 * self.population:
            return both
        return both.take(self.rng.permutation(len(both.number))[: 2 * self.population])

    def _children(self, layer: int, to: int, crowd: _Crowd) -> _Crowd:
        """Living children at a layer, the best first."""
        rows, tips, offsets = self._born(to, crowd)
        aims = self._aims(to, tips)
        must = aims if self.layers.must(to) else None
        clearances, changed, bend = self.judge.look(tips, offsets, must)
        alive = np.flatnonzero(clearances >= self.judge.required)
        score = self._score(clearances[alive], changed[alive], bend[alive])
        if aims is not None and must is None:
            score += self._pull(to, offsets[alive], aims[alive])
        picked = alive[self._choice(score)]
        parents = crowd.take(rows[picked])
        lines = Intervals(
            parents.tips, tips[picked], parents.offsets, offsets[picked],
            self._looking(layer, parents.tips, must, picked),
        )  # fmt: skip
        # The start may be closer than the margin asks for.
        need = np.minimum(self.judge.required, self.clearances[parents.number])
        good = self.judge.clear(lines, need) if len(picked) else np.zeros(0, bool)
        picked, number = picked[good], parents.number[good]
        return self._recorded(
            to, tips[picked], offsets[picked], clearances[picked], number
        )

    def _aims(self, layer: int, tips: FloatArray) -> FloatArray | None:
        """Where last links shall look with tips at a layer, shape (n, 3)."""
        aims, pull = self.layers.aims, self.layers.pull
        if aims is None or pull is None or not pull[layer] > 0.0:
            return None
        return np.broadcast_to(aims[layer], tips.shape)

    def _looking(
        self, layer: int, tips: FloatArray, must: FloatArray | None, picked: IntArray
    ) -> FloatArray | None:
        """Aims at both ends of ways from a layer to one where there are such."""
        before = self._aims(layer, tips)
        if must is None or before is None or not self.layers.must(layer):
            return None
        return np.stack([before, must[picked]], axis=1)

    def _pull(self, layer: int, offsets: FloatArray, aims: FloatArray) -> FloatArray:
        """What arms are worse for that do not look to where they shall soon."""
        pull = self.layers.pull
        assert pull is not None
        off = angles_between(offsets[:, -1], aims)
        return np.asarray(PULL * pull[layer] * off**2)

    def _born(self, to: int, crowd: _Crowd) -> tuple[IntArray, FloatArray, FloatArray]:
        """Children at a layer: row of the parent, tip, offsets."""
        rows = np.repeat(np.arange(len(crowd.number)), self._family(crowd))
        n, rng = len(rows), self.rng
        shift = rng.normal(size=(n, 3)) * self.layers.play[to] / 2.0
        tips = self.layers.tips[to] + shift
        offsets = crowd.offsets[rows]
        moved = tips[:, 1:] - crowd.tips[rows, 1:]
        led = np.flatnonzero(rng.random(n) < LED)
        offsets[led], fits = self._led(crowd, rows[led], tips[led])
        led = led[fits]
        moved[led] = 0.0
        kept = np.zeros(n, dtype=np.bool_)
        kept[led[rng.random(len(led)) < UNCHANGED]] = True
        born = varied(self.arm, offsets, moved, kept, rng)
        aims = self._aims(to, tips)
        if aims is not None:
            born = turned_towards(born, aims, rng.random(n) < AIMED, rng)
        return rows, tips, settled(self.arm, tips, born)

    def _family(self, crowd: _Crowd) -> int:
        """Children of each arm: a small population has more."""
        return max(FAMILY, FAMILY * self.population // (2 * len(crowd.number)))

    def _led(
        self, crowd: _Crowd, rows: IntArray, tips: FloatArray
    ) -> tuple[FloatArray, BoolArray]:
        """Shapes of arms that follow the leader, and which of them can."""
        centres = standing(self.arm, crowd.tips, crowd.offsets)
        after = followed(
            centres[rows], np.ascontiguousarray(tips), self.arm.link_lengths
        )
        offsets = self._coordinates(after)
        fits = np.asarray(np.isfinite(after).all(axis=(1, 2)))
        return np.where(fits[:, None, None], offsets, crowd.offsets[rows]), fits

    def _score(
        self, clearances: FloatArray, changed: IntArray, bend: FloatArray
    ) -> FloatArray:
        """How bad arms are."""
        lack = lacking(self.judge, clearances)
        steep = (bend / self.judge.limit) ** 4
        return np.asarray(0.5 * changed + 2.0 * lack**2 + 2.0 * steep)

    def _choice(self, score: FloatArray) -> IntArray:
        """Half the best, half by chance, the best first."""
        order = np.argsort(score + self.rng.random(len(score)), kind="stable")
        if len(order) <= self.population:
            return order
        best, rest = order[: self.population // 2], order[self.population // 2 :]
        chosen = self.rng.permutation(rest)[: self.population - len(best)]
        return np.concatenate([best, chosen])
