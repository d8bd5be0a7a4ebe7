"""Intelligent algorithms, waypoint by waypoint: each minimises the same penalties.

Penalties for the tip's place, limits and clearance; the best of each waypoint is
brought onto the path by the pseudo-inverse, as chance does not get there exactly. All
have as many members and at most as many generations; a search ends where the row that
is brought there is valid, which is looked at after each tenth generation. A search is
given the penalty of rows (m, n), the bounds, the row before, and where chance comes
from; it yields the best row of each generation, (n,).
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import wraps
from itertools import islice
from math import inf
from typing import TypeAlias

import numpy as np

from benchmarks.hrm2000.references.arm import Arm, Reach
from benchmarks.hrm2000.references.jacobian import pseudo_inverse
from vdsm_pin.geometry.arrays import BoolArray, FloatArray
from vdsm_pin.tolerances import TOLERANCES

GENERATIONS = 120
LOOK = 10  # generations
MEMBERS = 6  # times 17 unknowns
STRETCH = 0.05  # m, of the base
MISS, TOUCH, CHANGE = 10.0, 10.0, 0.01
"""Weights of a metre off the path, a metre of missing clearance, a radian of change."""


@dataclass(frozen=True)
class Task:
    """One waypoint: joint values near those before whose tip is in its place."""

    arm: Arm
    before: FloatArray
    tip: FloatArray
    low: FloatArray
    high: FloatArray
    rng: np.random.Generator

    def cost(self, rows: FloatArray, below: FloatArray | float = inf) -> FloatArray:
        """Penalty of joint values, shape (m, n) to (m,).

        Clearance takes three quarters of the time. It is left out for rows that are not
        below a bound, shape (m,), without it: they cannot be with it.
        """
        arm, rows = self.arm, np.ascontiguousarray(rows)
        centres = arm.centres(rows)
        off = np.linalg.norm(centres[:, -1] - self.tip, axis=1)
        cosine = np.cos(rows[:, 1::2]) * np.cos(rows[:, 2::2])
        over = np.maximum(0.0, np.cos(arm.cone) - cosine).sum(axis=1)
        change = np.abs(rows - self.before)[:, 1:].sum(axis=1)
        found = np.asarray(MISS * off + over + CHANGE * change)
        near = found < below
        if near.any():
            room = arm.clearance(centres[near]).min(axis=1)
            found[near] += TOUCH * np.maximum(0.0, arm.required - room)
        return found

    def first(self) -> FloatArray:
        """Members by chance, one of them the row before."""
        members = self.rng.uniform(
            self.low, self.high, (MEMBERS * self.arm.nq, self.arm.nq)
        )
        members[0] = self.before
        return members

    def inside(self, rows: FloatArray) -> FloatArray:
        """Rows brought within the bounds."""
        return np.asarray(np.clip(rows, self.low, self.high))

    def chance(self, rows: FloatArray) -> BoolArray:
        """A coin for every entry."""
        return np.asarray(self.rng.random(rows.shape) < 0.5)

    def noise(self, rows: FloatArray, share: float) -> FloatArray:
        """Normal, of a share of the bounds."""
        return np.asarray(
            share * (self.high - self.low) * self.rng.normal(size=rows.shape)
        )

    def others(self, rows: FloatArray) -> FloatArray:
        """The members in another order."""
        return rows[self.rng.permutation(len(rows))]


Search: TypeAlias = Callable[[Task], Iterator[FloatArray]]


def by(search: Search) -> Reach:
    """A search as what reaches one waypoint from the one before."""

    @wraps(search)
    def reach(arm: Arm, q: FloatArray, tip: FloatArray) -> FloatArray | None:
        near = np.full(arm.nq, 0.8 * TOLERANCES.row_change)
        near[0] = STRETCH
        low, high = np.maximum(arm.low, q - near), np.minimum(arm.high, q + near)
        task = Task(arm, q, tip, low, high, np.random.default_rng(0))
        for found in islice(search(task), LOOK - 1, GENERATIONS, LOOK):
            best = pseudo_inverse(arm, found, tip)
            if best is not None and arm.valid(best):
                return best
        return None

    return reach


def least(rows: FloatArray, values: FloatArray) -> FloatArray:
    """The row of the smallest value."""
    return np.array(rows[values.argmin()])


@by
def differential_evolution(task: Task) -> Iterator[FloatArray]:
    """[11,12], best/1/bin: the best, a difference of two others, entries crossed."""
    rows = task.first()
    values = task.cost(rows)
    while True:
        way = task.others(rows) - task.others(rows)
        mutant = least(rows, values) + task.rng.uniform(0.5, 1.0) * way
        crossed = task.rng.random(rows.shape) < 0.7
        at_least = task.rng.integers(task.arm.nq, size=len(rows))
        crossed[np.arange(len(rows)), at_least] = True
        child = task.inside(np.where(crossed, mutant, rows))
        found = task.cost(child, values)
        better = found < values
        rows[better], values[better] = child[better], found[better]
        yield least(rows, values)


@by
def variable_length_evolution(task: Task) -> Iterator[FloatArray]:
    """[25], VLV-DE: a member has as many link angles as it says, from the base on.

    The links behind them keep their angles of the row before. A child is one link
    longer or shorter than a parent, or as long; a new link's angles come by chance.
    """
    rows = task.first()
    links = np.arange(task.arm.nq) // 2 + np.arange(task.arm.nq) % 2  # 0 is the rail
    lengths = task.rng.integers(1, task.arm.n + 1, len(rows))
    rows = np.where(links <= lengths[:, None], rows, task.before)
    values = task.cost(rows)
    while True:
        order = task.rng.permutation(len(rows))
        nearby = task.before + task.noise(rows, 0.1)
        parents = np.where(links <= lengths[:, None], rows, nearby)
        step = 0.7 * (task.others(parents) - task.others(parents))
        child = np.where(task.chance(rows), parents[order] + step, parents)
        length = lengths + task.rng.integers(-1, 2, len(rows))
        length = np.clip(length, 1, task.arm.n)
        child = np.where(links <= length[:, None], task.inside(child), task.before)
        found = task.cost(child, values)
        better = found < values
        rows[better], values[better] = child[better], found[better]
        lengths[better] = length[better]
        yield least(rows, values)


@by
def particle_swarm(task: Task) -> Iterator[FloatArray]:
    """[9,10]: members fly towards their own best place and that of all."""
    rows = task.first()
    speed, best, values = np.zeros_like(rows), rows.copy(), task.cost(rows)
    while True:
        own, all_ = task.rng.random((2, *rows.shape))
        speed = 0.7 * speed + 1.5 * own * (best - rows)
        speed += 1.5 * all_ * (least(best, values) - rows)
        rows = task.inside(rows + speed)
        found = task.cost(rows, values)
        better = found < values
        best[better], values[better] = rows[better], found[better]
        yield least(best, values)


@by
def genetic(task: Task) -> Iterator[FloatArray]:
    """[13]: the better of two become parents, children are mixed and mutate."""
    rows = task.first()
    values = task.cost(rows)
    for k in range(GENERATIONS):
        one, two = task.rng.integers(len(rows), size=(2, len(rows)))
        parents = rows[np.where(values[one] < values[two], one, two)]
        child = np.where(task.chance(rows), parents, task.others(parents))
        mutates = task.rng.random(rows.shape) < 0.1
        child = child + mutates * task.noise(rows, 0.2 * (1.0 - k / GENERATIONS))
        child = task.inside(child)
        child[0] = least(rows, values)  # the best one lives on
        rows, values = child, task.cost(child)
        yield least(rows, values)


@by
def simulated_annealing(task: Task) -> Iterator[FloatArray]:
    """[14]: every member a walk of its own, uphill less and less."""
    rows = task.first()
    values = task.cost(rows)
    best, lowest = least(rows, values), values.min()
    for k in range(GENERATIONS):
        heat = (1.0 - k / GENERATIONS) ** 2
        child = task.inside(rows + task.noise(rows, 0.2 * heat))
        uphill = values - 0.05 * heat * np.log(task.rng.random(len(rows)))
        found = task.cost(child, uphill)
        taken = found < uphill
        rows[taken], values[taken] = child[taken], found[taken]
        if values.min() < lowest:
            best, lowest = least(rows, values), values.min()
        yield best


@by
def fireflies(task: Task) -> Iterator[FloatArray]:
    """[15-17]: each is drawn to a brighter one, the more the nearer it is."""
    rows = task.first()
    values = task.cost(rows)
    size = np.linalg.norm(task.high - task.low)
    for k in range(GENERATIONS):
        order = task.rng.permutation(len(rows))
        brighter = (values[order] < values)[:, None]
        way = rows[order] - rows
        far = np.linalg.norm(way, axis=1, keepdims=True) / size
        drawn = rows + brighter * np.exp(-(far**2)) * way
        drawn = task.inside(drawn + task.noise(rows, 0.05 * 0.95**k))
        drawn[values.argmin()] = least(rows, values)
        rows, values = drawn, task.cost(drawn)
        yield least(rows, values)


@by
def bee_colony(task: Task) -> Iterator[FloatArray]:
    """[18]: bees look beside a food source; one that is used up is left."""
    rows = task.first()
    values, tired = task.cost(rows), np.zeros(len(rows))
    while True:
        chosen = np.argsort(values + task.rng.exponential(values.std(), len(rows)))
        chosen[len(rows) // 2 :] = np.arange(len(rows))[len(rows) // 2 :]
        beside = rows[chosen]
        way = task.rng.uniform(-1.0, 1.0, rows.shape) * (beside - task.others(rows))
        beside = task.inside(beside + way * (task.rng.random(rows.shape) < 0.2))
        found = task.cost(beside, values[chosen])
        for k in np.flatnonzero(found < values[chosen]):
            if found[k] < values[chosen[k]]:
                rows[chosen[k]], values[chosen[k]] = beside[k], found[k]
                tired[chosen[k]] = -1
        tired += 1
        left = (tired > MEMBERS * 4) & (values > values.min())
        rows[left] = task.first()[left]
        values[left], tired[left] = task.cost(rows[left]), 0
        yield least(rows, values)
