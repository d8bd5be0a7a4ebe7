"""How finely to look: what each search of the exploration may use up."""

from dataclasses import dataclass, replace
from typing import Final


@dataclass(frozen=True)
class Level:
    """How finely to look.

    Args:
        step: Lattice step of the directions; [-].
        coarse: Distance of the tips over the arm's length; [-].
        places: Largest number of joints at which a knee is tried.
        rounds: Sequences to try.
        back: How far tips are tried behind the path, over the arm's length; [-].
        grow: Rounds of growing shapes into what is not drawn.
        slack: Clearance kept for what happens between two rows, over the arm's
            length; [-].
        finest: Way of the body between two looks at the clearance, over the arm's
            length; [-].
        ease: Part of the largest link angle that may be used; [-].
        around: Bent arms are tried up to this many tips from where the straight arm
            does not do; None for everywhere.
    """

    step: float
    coarse: float
    places: int
    rounds: int
    back: float
    grow: int
    slack: float = 9.6e-5
    finest: float = 6.4e-4
    ease: float = 1.0
    around: int | None = None


@dataclass(frozen=True)
class Insert:
    """How thoroughly to look for a motion in through the openings.

    Args:
        step: Distance of the tips over the arm's length; [-].
        population: Arms that live on at a tip.
        routes: Largest number of ways of the tip tried from the start to one place.
        returns: Times a population that is stuck goes back, each time twice as far.
        seed: Of the source of chance.
        cells: Cells at which the search for a way of the tip ends.
        directed: Whether arms are described by the directions of their links, which may
            lean backwards then, and not by their projections.
        slack: Clearance kept for what happens between two rows, over the arm's
            length; [-].
        finest: Way of the body between two looks at the clearance, over the arm's
            length; [-].
        ease: Part of the largest link angle that may be used; [-].
    """

    step: float
    population: int
    routes: int
    returns: int
    seed: int
    cells: int = 300_000
    directed: bool = False
    slack: float = 9.6e-5
    finest: float = 6.4e-4
    ease: float = 1.0


SEED: Final = 0
"""Seed of the growth of shapes; the same problem gives the same plan."""

THOROUGH: Final[tuple[Level | Insert, ...]] = (
    Level(
        step=0.08, coarse=0.026, places=8, rounds=20, back=0.0, grow=1,
        ease=0.79, around=4,
    ),
    Level(step=0.08, coarse=0.026, places=8, rounds=40, back=0.0, grow=2, around=4),
    Level(step=0.08, coarse=0.013, places=8, rounds=40, back=0.0, grow=3, around=4),
    Level(step=0.08, coarse=0.0065, places=8, rounds=40, back=0.0, grow=4, around=8),
    Level(step=0.08, coarse=0.026, places=8, rounds=40, back=1.0, grow=2),
    Insert(step=0.02, population=10, routes=1, returns=2, seed=0, cells=60_000),
    Insert(
        step=0.02, population=10, routes=2, returns=3, seed=0, cells=60_000,
        directed=True,
    ),
    Insert(step=0.02, population=30, routes=2, returns=4, seed=1),
    Insert(step=0.02, population=30, routes=3, returns=4, seed=1, directed=True),
    Level(step=0.08, coarse=0.013, places=8, rounds=40, back=1.0, grow=3),
    Level(
        step=0.05, coarse=0.013, places=10, rounds=60, back=1.0, grow=3,
        slack=9.6e-6, finest=1.6e-4,
    ),
    Insert(step=0.02, population=60, routes=4, returns=5, seed=2),
    Insert(step=0.02, population=60, routes=4, returns=5, seed=2, directed=True),
    Insert(
        step=0.01, population=120, routes=6, returns=6, seed=3,
        slack=9.6e-6, finest=1.6e-4,
    ),
    Insert(
        step=0.01, population=120, routes=6, returns=6, seed=3,
        slack=9.6e-6, finest=1.6e-4,
        directed=True,
    ),
)  # fmt: skip


"""Each is for what the ones before leave undrawn.

The first keeps link angles to a part of the limit, 33.6 of the 42.5 deg of hrm8, since
who bends less has more in hand; the second allows all of it. Then the tips come closer
together, twice and four times; then there are tips behind and beside the path too.
Where the path is confined, the arm is inserted: with as many knees as it takes. Then
tips come closer together once more, and the last roadmap has finer directions and rows,
and hardly any slack. At the end the arm is inserted with more and more arms tried. The
numbers were found by trial on the paper's problems and HRM-1000.
"""


@dataclass(frozen=True)
class Effort:
    """How much is done for a plan.

    Args:
        levels: How finely to look, in this order.
        proves: Whether what the first level leaves is looked at for a proof that it
            cannot be done.
    """

    levels: tuple[Level | Insert, ...]
    proves: bool


FULL: Final = Effort(THOROUGH, proves=True)
QUICK: Final = Effort(THOROUGH[:2], proves=False)
"""For plans that are only better than one there is already."""


def pointed(effort: Effort) -> Effort:
    """An effort for a last link that shall look somewhere.

    Directions say where it looks. Roadmaps are tried first; shapes are not grown.
    """
    roadmaps = [replace(one, grow=0) for one in THOROUGH[:2] if isinstance(one, Level)]
    inserts = [one for one in THOROUGH if isinstance(one, Insert) and one.directed]
    return replace(effort, levels=(*roadmaps, *inserts))


LEANING: Final = Effort(
    tuple(one for one in THOROUGH if isinstance(one, Insert) and one.directed),
    proves=True,
)
"""For starts that only directions describe."""
