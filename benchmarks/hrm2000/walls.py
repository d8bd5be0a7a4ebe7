"""Families with walls across the rail: windows, a port, a stator's blades."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from benchmarks.hrm2000.drafts import Draft, Range, fed_and_drawn, random_curve
from benchmarks.hrm2000.litter import Litter, crate, pipe, rod, scattered
from benchmarks.hrm2000.motions import DraftRejected
from benchmarks.hrm2000.solids import (
    Opening,
    Ring,
    least_hole,
    least_opening,
    plate_with_hole,
    wall,
)
from benchmarks.hrm2000.sweeps import Rng, Sweep, scale, sweep
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Cylinder, Mesh
from vdsm_pin.problem.scene import Obstacle

REACH: Final = 2.6
"""From the rail to the edges of a wall: round them the arm is too short; [m]."""


def openings(
    rng: Rng, swept: Sweep, span: Range, count: int, ratio: Range
) -> list[Opening]:
    """Places for walls where the sweep is narrow enough, and their windows.

    Args:
        rng: Randomness.
        swept: What has to pass.
        span: Between which x; [m].
        count: How many walls.
        ratio: Half the width and height of the windows; body radii.

    Raises:
        DraftRejected: If there are not so many, or they are about the rail.
    """
    radius, apart = swept.arm.link_radius, 0.1 * swept.arm.total_length
    thick = float(rng.choice([0.02, 0.03, 0.06])) * scale(swept.arm)
    places = [least_opening(swept, float(x), thick) for x in rng.uniform(*span, 60)]
    found = [place for place in places if place is not None]
    if rng.random() < 0.6:
        found.sort(key=lambda place: float(place.half.max()))
    chosen: list[Opening] = []
    for least in found:
        low = np.maximum(least.half, ratio[0] * radius)
        near = any(abs(least.x - other.x) < apart for other in chosen)
        if len(chosen) < count and not near and (low <= ratio[1] * radius).all():
            # More narrow ones than wide ones.
            half = low + rng.uniform(0.0, 1.0, 2) ** 2 * (ratio[1] * radius - low)
            aside = rng.uniform(-1.0, 1.0, 2) * (half - least.half)
            chosen.append(Opening(least.x, thick, least.centre + aside, half))
    off = [bool((np.abs(o.centre) + radius > o.half).any()) for o in chosen]
    if len(chosen) < count or sum(off) < max(1, count - 1):
        raise DraftRejected
    return sorted(chosen, key=lambda o: o.x)


def walls(arm: Manipulator, windows: list[Opening]) -> tuple[Obstacle, ...]:
    """A wall round each window."""
    reach = REACH * scale(arm)
    if len(windows) == 1:
        return tuple(wall("w", windows[0], reach))
    named = [(f"w{i}", window) for i, window in enumerate(windows)]
    return tuple(box for name, window in named for box in wall(name, window, reach))


@dataclass(frozen=True)
class Windows:
    """Walls with windows, a closed path behind the last one.

    Args:
        walls: How many, from and to.
        ratio: Half the width and height of the windows; body radii.
        turn_deg: Of each bend of the way in; [deg].
    """

    walls: tuple[int, int]
    ratio: Range
    turn_deg: Range = (8.0, 26.0)

    def __call__(self, rng: Rng, arm: Manipulator) -> Draft:
        """A draft."""
        count = int(rng.integers(self.walls[0], self.walls[1] + 1))
        curve = random_curve(rng, arm, count + 1, self.turn_deg, (0.02, 0.15))
        end = rng.uniform(0.42, 0.6) + 0.05 * count
        witness = fed_and_drawn(rng, arm, curve, end, (0.015, 0.04))
        swept, length = sweep(witness), arm.total_length
        span = (0.1 * length, witness.points[:, 0].min() - 0.1 * length)
        windows = openings(rng, swept, span, count, self.ratio)
        return Draft(witness, walls(arm, windows))


def port(rng: Rng, arm: Manipulator) -> Draft:
    """A plate with a round hole; behind it pipes, crates and rods about the way."""
    curve = random_curve(rng, arm, int(rng.integers(2, 4)), (12.0, 35.0), (0.04, 0.14))
    witness = fed_and_drawn(rng, arm, curve, rng.uniform(0.45, 0.65), (0.012, 0.03))
    swept, radius, length = sweep(witness), arm.link_radius, arm.total_length
    least = least_hole(swept, rng.uniform(0.03, 0.14) * length, 0.03 * scale(arm))
    if least is None or not least.half[0] <= 2.0 * radius:
        raise DraftRejected
    low = max(1.3 * radius, float(least.half[0]))
    half = np.full(2, rng.uniform(low, 2.0 * radius))
    hole = Opening(least.x, least.thick, least.centre, half)
    corners = int(rng.choice([32, 48, 64]))
    plate = plate_with_hole("wall", hole, corners, REACH * scale(arm))
    litter = Litter(
        count=int(rng.integers(4, 11)),
        makers=(pipe, crate, rod),
        size=(0.05 * length, 0.12 * length),
        away=(2.0 * radius, 6.0 * radius),
        beyond=hole.x + 0.08 * length,
    )
    return Draft(witness, (plate, *scattered(rng, swept, litter)))


def blades(rng: Rng, arm: Manipulator) -> Draft:
    """Through a ring of blades, each a mesh, between a hub and a casing."""
    curve = random_curve(rng, arm, 2, (8.0, 24.0), (0.06, 0.2))
    witness = fed_and_drawn(rng, arm, curve, rng.uniform(0.45, 0.6), (0.012, 0.03))
    swept, length = sweep(witness), arm.total_length
    chord = rng.uniform(0.03, 0.07) * length
    least = least_hole(swept, rng.uniform(0.15, 0.35) * length, 1.2 * chord)
    if least is None or not least.half[0] <= 2.5 * arm.link_radius:
        raise DraftRejected
    return Draft(witness, _stator(rng, swept, least, chord))


def _stator(
    rng: Rng, swept: Sweep, passage: Opening, chord: float
) -> tuple[Obstacle, ...]:
    """As many blades as leave the arm its room, a hub, a casing."""
    arm, angle = swept.arm, rng.uniform(0.0, 2.0 * np.pi)
    middle = rng.uniform(5.0, 9.0) * arm.link_radius
    half = passage.half[0] + rng.uniform(0.3, 1.5) * arm.link_radius
    out = np.array([np.cos(angle), np.sin(angle)])
    centre = np.array([passage.x, *(passage.centre - middle * out)])
    stagger = np.deg2rad(rng.uniform(-20.0, 20.0, 2))
    ring = Ring(
        centre,
        (middle - half, middle + half),
        chord,
        0.4 * arm.link_radius,
        (float(stagger[0]), float(stagger[1])),
    )
    x = np.array([1.0, 0.0, 0.0])
    hub = Cylinder("hub", centre, x, 0.6 * chord, middle - half)
    bore = Opening(passage.x, 1.2 * chord, centre[1:], np.full(2, middle + half))
    casing = plate_with_hole("casing", bore, 64, REACH * scale(arm))
    return (*_most_blades(rng, swept, ring, angle), hub, casing)


def _most_blades(
    rng: Rng, swept: Sweep, ring: Ring, angle: FloatArray | float
) -> list[Mesh]:
    """Blades at equal angles, the arm between two of them.

    Raises:
        DraftRejected: If not even six leave it its room.
    """
    sections, corners = int(rng.integers(4, 9)), int(rng.choice([10, 16, 24]))
    for count in range(20, 5, -1):
        turns = angle + 2.0 * np.pi * (np.arange(count) + 0.5) / count
        # The nearest two first.
        near = [ring.blade("blade", turns[k], sections, corners) for k in (0, -1)]
        if all(swept.is_clear(blade) for blade in near):
            return [
                ring.blade(f"blade{k}", turn, sections, corners)
                for k, turn in enumerate(turns)
            ]
    raise DraftRejected
