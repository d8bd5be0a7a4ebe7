"""Infeasible problems: a feasible one made too tight by a known margin.

Why none has a solution: a link's axis that passes a window stays no farther from its
nearer edge than half the width; one in a round hole or tube, than the inner radius; and
round a wall of half the side `walls.REACH` no arm is long enough. A tip that is nearer
to a solid than its own radius touches it, and none is farther from the rail's end than
the arm is long.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from benchmarks.hrm2000.drafts import Draft, fed, fed_and_drawn, random_curve
from benchmarks.hrm2000.litter import Litter, ball, crate, rod, scattered
from benchmarks.hrm2000.motions import DraftRejected, Witness
from benchmarks.hrm2000.solids import Tube, least_hole, plate_with_hole
from benchmarks.hrm2000.sweeps import LENGTH, Rng, required_clearance, scale, sweep
from benchmarks.hrm2000.walls import REACH, openings, walls
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.solids import Sphere

MARGINS_MM: Final = (0.05, 0.1, 0.2, 0.5, 1.0)
"""By how much each is too tight, for an arm of 3.126 m; [mm]."""


REACHED: Final = 2.0
"""How far from the rail the path of a twin behind a wall lies at most; [m]."""


def twin(rng: Rng, arm: Manipulator) -> Draft:
    """A problem without a solution; its note says what is too tight and by how much."""
    name, make = list(TWINS.items())[int(rng.integers(len(TWINS)))]
    margin_mm = float(rng.choice(MARGINS_MM))
    draft = make(rng, arm, 1e-3 * margin_mm * scale(arm))
    note = f"{name}-{1e3 * margin_mm:.0f}um"
    return replace(draft, note=note, feasible=False)


def too_narrow(arm: Manipulator, margin: float) -> float:
    """Half a passage that is too narrow by the margin; [m]."""
    return arm.link_radius + required_clearance(arm) - margin


def _behind_a_wall(rng: Rng, arm: Manipulator) -> Witness:
    """A way in, bent a little, and a closed path.

    Raises:
        DraftRejected: If the path is so far aside that there is a way round a wall.
    """
    curve = random_curve(rng, arm, 2, (6.0, 20.0), (0.04, 0.15))
    witness = fed_and_drawn(rng, arm, curve, rng.uniform(0.5, 0.65), (0.015, 0.04))
    aside = np.linalg.norm(witness.points[:, 1:], axis=1).max() / scale(arm)
    if not (aside <= REACHED and 2.0 * REACH - REACHED > LENGTH):
        raise DraftRejected
    return witness


def window(rng: Rng, arm: Manipulator, margin: float) -> Draft:
    """A wall whose window is too low or not wide enough."""
    witness = _behind_a_wall(rng, arm)
    span = (0.1 * arm.total_length, witness.points[:, 0].min() - 0.1 * arm.total_length)
    opening = openings(rng, sweep(witness), span, 1, (1.2, 2.1))[0]
    half = opening.half.copy()
    half[int(rng.integers(2))] = too_narrow(arm, margin)
    return Draft(witness, walls(arm, [replace(opening, half=half)]))


def hole(rng: Rng, arm: Manipulator, margin: float) -> Draft:
    """A plate whose round hole is too small."""
    witness = _behind_a_wall(rng, arm)
    x = rng.uniform(0.05, 0.25) * arm.total_length
    opening = least_hole(sweep(witness), x, 0.03 * scale(arm))
    if opening is None:
        raise DraftRejected
    small = replace(opening, half=np.full(2, too_narrow(arm, margin)))
    return Draft(witness, (plate_with_hole("wall", small, 48, REACH * scale(arm)),))


def bore(rng: Rng, arm: Manipulator, margin: float) -> Draft:
    """A tube too narrow for the tip, the path inside."""
    length = arm.total_length
    curve = random_curve(rng, arm, 2, (6.0, 25.0), (0.03, 0.1))
    end = rng.uniform(0.4, 0.6) * length
    witness = fed(rng, arm, curve, end, (0.1, 0.18))
    span = (rng.uniform(0.02, 0.06) * length, end + 0.5 * arm.link_radius)
    small = too_narrow(arm, margin)
    tube = Tube(curve, span, small, 0.15 * arm.link_radius, 32, 60)
    return Draft(witness, (tube.mesh("pipe"),))


def solid(rng: Rng, arm: Manipulator, margin: float) -> Draft:
    """A ball too near to a corner of the path."""
    witness = _behind_a_wall(rng, arm)
    # Across the plane of the path, so that no other place of it is nearer.
    off = witness.points - witness.points.mean(axis=0)
    towards = rng.choice([-1.0, 1.0]) * np.linalg.svd(off)[2][-1]
    radius = rng.uniform(0.5, 3.0) * arm.link_radius
    corner = witness.points[int(rng.integers(len(witness.points)))]
    centre = corner + (radius + too_narrow(arm, margin)) * towards
    return Draft(witness, (Sphere("ball", centre, radius),))


def reach(rng: Rng, arm: Manipulator, margin: float) -> Draft:
    """A rail that ends too early for the farthest corner of the path."""
    witness, length = _behind_a_wall(rng, arm), arm.total_length
    aside = np.linalg.norm(witness.points[:, 1:], axis=1)
    ends = witness.points[:, 0] - np.sqrt((length + margin) ** 2 - aside**2)
    low = float(witness.motion.x0[0]) - 0.01 * length
    short = replace(arm, name=f"{arm.name}-short", base_range=(low, float(ends.max())))
    litter = Litter(
        count=int(rng.integers(3, 9)),
        makers=(ball, crate, rod),
        size=(0.03 * length, 0.1 * length),
        away=(2.0 * arm.link_radius, 0.2 * length),
        beyond=0.0,
    )
    things = scattered(rng, sweep(witness), litter)
    return Draft(replace(witness, arm=short), tuple(things))


TWINS: Final[Mapping[str, Callable[[Rng, Manipulator, float], Draft]]] = {
    "window": window,
    "hole": hole,
    "bore": bore,
    "solid": solid,
    "reach": reach,
}
"""What is too tight; the last argument is by how much [m]."""
