"""How finely to look: what each search of the exploration may use up."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final


@dataclass(frozen=True, kw_only=True)
class Level:
    """How finely to look.

    Args:
        ease: Part of the largest link angle that may be used; [-].
        fine: Whether tips and rows come closer together, with hardly any slack.
    """

    ease: float = 1.0
    fine: bool = False

    @property
    def slack(self) -> float:
        """Clearance kept for what happens between two rows, over the arm's length."""
        return 9.6e-6 if self.fine else 9.6e-5

    @property
    def finest(self) -> float:
        """Way of the body between two looks at the clearance, over the arm's length."""
        return 1.6e-4 if self.fine else 6.4e-4


@dataclass(frozen=True, kw_only=True)
class Search(Level):
    """How thoroughly to look for a motion in a roadmap of sparse shapes.

    Args:
        rounds: Sequences to try.
        back: How far tips are tried behind the path, over the arm's length; [-].
        grow: Rounds of growing shapes into what is not drawn.
        around: Bent arms are tried up to this many tips from where the straight arm
            does not do; None for everywhere.
    """

    rounds: int
    back: float
    grow: int
    around: int | None = None

    @property
    def coarse(self) -> float:
        """Distance of the tips over the arm's length; [-]."""
        return 0.013 if self.fine else 0.026


@dataclass(frozen=True, kw_only=True)
class Insert(Level):
    """How thoroughly to look for a motion in through the openings.

    Args:
        population: Arms that live on at a tip.
        routes: Largest number of ways of the tip tried from the start to one place.
        backtracks: Times a population that is stuck goes back, each time twice as far.
        seed: Of the source of chance.
        led: Part of the children that follow the leader. They bend more joints, and
            come through where nobody else does; [-].
        cells: Most cells that a search for a way of the tip makes.
        directed: Whether arms are described by the directions of their links, which may
            lean backwards then, and not by their projections.
    """

    population: int
    routes: int
    backtracks: int
    seed: int
    led: float = 0.0
    cells: int = 300_000
    directed: bool = False

    @property
    def step(self) -> float:
        """Distance of the tips over the arm's length; [-]."""
        return 0.01 if self.fine else 0.02


SEED: Final = 0
"""Seed of the growth of shapes; the same problem gives the same plan."""

MANY: Final = 60
"""Arms beyond which tips and rows come closer together too."""

LED: Final = 0.4
"""Part of the children that follow the leader where the first tries fail; [-]."""


def _both(population: int, routes: int, backtracks: int, seed: int) -> list[Insert]:
    """Insertions in both charts, with children that follow the leader."""
    fine = population > MANY
    one = Insert(
        population=population, routes=routes, backtracks=backtracks, seed=seed, led=LED,
        fine=fine,
    )  # fmt: skip
    return [one, replace(one, directed=True)]


BESIDE: Final = Search(rounds=20, back=1.0, grow=2)
"""The first search with tips behind and beside the path."""

FIRST: Final = (
    Insert(population=10, routes=3, backtracks=2, seed=0),
    Insert(population=10, routes=3, backtracks=3, seed=0, directed=True),
)
"""The first insertions."""

THOROUGH: Final[tuple[Level, ...]] = (
    Search(rounds=20, back=0.0, grow=1, ease=0.79, around=4),
    Search(rounds=40, back=0.0, grow=2, around=4),
    BESIDE,
    *FIRST,
    *_both(population=30, routes=3, backtracks=4, seed=1),
    Search(rounds=60, back=1.0, grow=3, fine=True),
    *_both(population=60, routes=4, backtracks=5, seed=2),
    *_both(population=120, routes=6, backtracks=6, seed=3),
)
"""Each is for what the ones before leave undrawn.

The first keeps link angles to a part of the limit, 33.6 of the 42.5 deg of hrm8, since
who bends less has more in hand; the second allows all of it; then there are tips behind
and beside the path too. Where the path is confined, the arm is inserted: with as many
knees as it takes, and with more and more arms tried. The last ones of both kinds are
fine. The numbers were found by trial on the paper's problems and HRM-2000.
"""


LATER: Final = (30, 60, 120)
"""Populations of the insertions that go on until the time is over."""


def later_levels(levels: tuple[Level, ...]) -> Iterator[Level]:
    """Insertions for as long as there is time, each of other chance.

    Args:
        levels: What is tried before; without insertions none is tried later.
    """
    inserts = [one for one in levels if isinstance(one, Insert)]
    if not inserts:
        return
    seed = max(one.seed for one in inserts)
    for number in itertools.count(1):
        population = LATER[number % len(LATER)]
        both = _both(population, routes=6, backtracks=6, seed=seed + number)
        for one in both:
            if one.directed or not all(each.directed for each in inserts):
                yield one


def confined_first(levels: tuple[Level, ...]) -> tuple[Level, ...]:
    """Levels to come where arms are confined: the first insertions before `BESIDE`."""
    if levels[:3] == (BESIDE, *FIRST):
        return (*FIRST, BESIDE, *levels[3:])
    return levels


@dataclass(frozen=True)
class Effort:
    """How much is done for a plan.

    Args:
        levels: How finely to look, in this order.
        proves: Whether what levels leave is looked at for a proof that it
            cannot be done.
    """

    levels: tuple[Level, ...]
    proves: bool


FULL: Final = Effort(THOROUGH, proves=True)
QUICK: Final = Effort(THOROUGH[:2], proves=False)
"""For plans that are only better than one there is already."""


def pointed(effort: Effort) -> Effort:
    """An effort for a last link that shall look somewhere.

    Directions say where it looks. Roadmaps are tried first; shapes are not grown.
    """
    roadmaps = [one for one in effort.levels[:2] if isinstance(one, Search)]
    return replace(
        effort, levels=(*(replace(one, grow=0) for one in roadmaps), *_directed(effort))
    )


def leaning(effort: Effort) -> Effort:
    """An effort for starts that only directions describe."""
    return replace(effort, levels=_directed(effort) or FIRST[1:])


def _directed(effort: Effort) -> tuple[Insert, ...]:
    inserts = [one for one in effort.levels if isinstance(one, Insert)]
    return tuple(one for one in inserts if one.directed)
