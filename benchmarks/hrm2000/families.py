"""The families: each makes a witness motion first, then obstacles round its sweep."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from benchmarks.hrm2000.arms import LARGE, NINE, SMALL, USUAL
from benchmarks.hrm2000.drafts import (
    Draft,
    fed_and_drawn,
    random_curve,
    swung_and_drawn,
)
from benchmarks.hrm2000.litter import Litter, ball, crate, pipe, rod, scattered
from benchmarks.hrm2000.looks import looking
from benchmarks.hrm2000.passages import Hook, duct, pocket
from benchmarks.hrm2000.sweeps import Rng, sweep
from benchmarks.hrm2000.twins import twin
from benchmarks.hrm2000.walls import Windows, blades, port
from vdsm_pin.arm.manipulator import Manipulator


def dense_clutter(rng: Rng, arm: Manipulator) -> Draft:
    """Thirty to three hundred small things about the arm."""
    curve = random_curve(rng, arm, int(rng.integers(1, 4)), (10.0, 30.0), (0.04, 0.16))
    witness = fed_and_drawn(rng, arm, curve, rng.uniform(0.4, 0.6), (0.015, 0.05))
    count = round(float(np.exp(rng.uniform(np.log(30), np.log(300)))))
    length = arm.total_length
    litter = Litter(
        count=count,
        makers=(ball, crate, rod),
        size=(0.03 * length, 0.07 * length),
        away=(1.5 * arm.link_radius, 0.25 * length),
        beyond=0.0,
    )
    return Draft(witness, tuple(scattered(rng, sweep(witness), litter)), f"n{count}")


def short_rail(rng: Rng, arm: Manipulator) -> Draft:
    """A rail no longer than the motion takes, things about."""
    witness, length = swung_and_drawn(rng, arm, (0.02, 0.1)), arm.total_length
    low, high = witness.motion.x0.min(), witness.motion.x0.max()
    spare = rng.uniform(0.0005, 0.01, 2) * length
    ends = (float(low - spare[0]), float(high + spare[1]))
    litter = Litter(
        count=int(rng.integers(5, 13)),
        makers=(ball, crate, rod, pipe),
        size=(0.03 * length, 0.1 * length),
        away=(1.5 * arm.link_radius, 0.25 * length),
        beyond=0.2 * length,
    )
    things = scattered(rng, sweep(witness), litter)
    short = replace(arm, name=f"{arm.name}-short", base_range=ends)
    return Draft(replace(witness, arm=short), tuple(things))


one_window = Windows((1, 1), (1.2, 2.1))
two_wide_windows = Windows((2, 2), (2.5, 6.0))
windows = Windows((2, 3), (1.2, 2.1))
nine_arms = Windows((2, 2), (1.3, 3.0), (6.0, 22.0))


def inside(rng: Rng, arm: Manipulator) -> Draft:
    """A start at the path or half-way in, bent as the arm is there."""
    make = (port, windows, duct, one_window)[int(rng.integers(4))]
    draft = make(rng, arm)
    witness = draft.witness
    if rng.random() < 0.5:
        at_path = witness.begun_at(witness.n_before)
        return replace(draft, witness=at_path, note="at-path")
    row = round(rng.uniform(0.4, 0.9) * witness.n_before)
    return replace(draft, witness=witness.begun_at(row), note="half-way")


def any_size(rng: Rng, arm: Manipulator) -> Draft:
    """What other families ask, of an arm of another size."""
    makers = (port, one_window, windows, two_wide_windows, duct, dense_clutter)
    return makers[int(rng.integers(len(makers)))](rng, arm)


def pointing(rng: Rng, arm: Manipulator) -> Draft:
    """What other families ask, and where the last link looks besides."""
    makers = (port, one_window, windows, duct, dense_clutter)
    return looking(rng, makers[int(rng.integers(len(makers)))](rng, arm))


@dataclass(frozen=True)
class Family:
    """How problems of a family are made.

    Args:
        draft: Makes a draft, or raises `DraftRejected`.
        arms: Problem n is for arm n modulo their number.
    """

    draft: Callable[[Rng, Manipulator], Draft]
    arms: tuple[Manipulator, ...] = USUAL


FAMILIES: Final[Mapping[str, Family]] = {
    "port": Family(port),
    "windows": Family(windows),
    "one_window": Family(one_window),
    "two_wide_windows": Family(two_wide_windows),
    "duct": Family(duct),
    "hook75": Family(Hook(75.0)),
    "hook105": Family(Hook(105.0)),
    "pocket": Family(pocket),
    "inside": Family(inside),
    "blades": Family(blades),
    "dense_clutter": Family(dense_clutter),
    "short_rail": Family(short_rail, (*USUAL, *NINE)),
    "nine_arms": Family(nine_arms, NINE),
    "pointing": Family(pointing),
    "small_arms": Family(any_size, SMALL),
    "large_arms": Family(any_size, LARGE),
    "twins": Family(twin),
}
"""Every family by name."""
