"""The families: each makes a witness motion first, then obstacles round its sweep."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import numpy as np

from benchmarks.hrm2000.arms import USUAL
from benchmarks.hrm2000.carving import (
    Litter,
    Maker,
    Opening,
    Rng,
    Sweep,
    ball,
    crate,
    least_opening,
    pipe,
    plate_with_hole,
    rod,
    scale,
    scattered,
    sweep,
    tube,
    wall,
)
from benchmarks.hrm2000.curves import Bend, TipCurve, tightest_radius, tip_curve
from benchmarks.hrm2000.motions import (
    DraftRejected,
    Witness,
    drawing,
    drawn_by_feeding,
    insertion,
    joined,
)
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.manipulator import Manipulator
from vdsm_pin.scene import Cylinder, HalfSpace, Obstacle

WALL: Final = 2.6
"""From the rail to the edges of a wall: less than the arm needs to go round it; [m]."""


@dataclass(frozen=True)
class Draft:
    """A problem in the making.

    Args:
        witness: The motion that solves it, or None of a problem that has no solution.
        obstacles: What is in the way.
        note: A few words for its name.
    """

    witness: Witness
    obstacles: tuple[Obstacle, ...]
    note: str = ""


Range = tuple[float, float]


def random_curve(
    rng: Rng, arm: Manipulator, count: int, turn_deg: Range, straight: Range
) -> TipCurve:
    """A curve of bends in planes at random, gentle enough for the arm.

    Args:
        rng: Randomness.
        arm: Who shall follow it.
        count: How many bends.
        turn_deg: By how much each turns; [deg].
        straight: Length of the lines before each; lengths of the arm.
    """
    bends, around = [], rng.uniform(0.0, 2.0 * np.pi)
    for _ in range(count):
        radius = tightest_radius(arm) * rng.uniform(1.1, 1.5)
        before = arm.total_length * rng.uniform(*straight)
        bends.append(Bend(before, np.deg2rad(rng.uniform(*turn_deg)), radius, around))
        around += rng.uniform(0.5, 1.5) * np.pi
    return tip_curve(bends)


def ring(rng: Rng, middle: FloatArray, along: FloatArray, radius: float) -> FloatArray:
    """A closed path through a point, across a direction: a polygon or a circle."""
    across = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    across /= np.linalg.norm(across)
    other = np.cross(along, across)
    if rng.random() < 0.5:
        turn = np.linspace(0.0, 2.0 * np.pi, 33)[:-1]
        radii = np.full(32, radius)
    else:
        count = int(rng.integers(3, 7))
        turn = (
            2.0 * np.pi * (np.arange(count) + rng.uniform(-0.25, 0.25, count)) / count
        )
        radii = radius * rng.uniform(0.6, 1.3, count)
    turn = turn + rng.uniform(0.0, 2.0 * np.pi)
    flat = (radii * np.stack([np.cos(turn), np.sin(turn)])).T
    return np.asarray(middle + (flat - flat[0]) @ np.stack([across, other]))


def fed_and_drawn(
    rng: Rng, arm: Manipulator, curve: TipCurve, end: float, size: Range
) -> Witness:
    """In along the curve, then a closed path by the last links or by all of them.

    Args:
        rng: Randomness.
        arm: The arm.
        curve: The way in.
        end: Arc length at which the tip comes to the path; lengths of the arm.
        size: Radius of the path; lengths of the arm.
    """
    length = arm.total_length
    before = insertion(arm, curve, -rng.uniform(0.06, 0.15) * length, end * length)
    tip = curve.at(np.array([end * length]))[0]
    tangent = curve.frames(np.array([end * length]))[0][:, 0]
    normal = tangent if rng.random() < 0.5 else np.array([1.0, 0.0, 0.0])
    points = ring(rng, tip, normal, length * rng.uniform(*size))
    share = rng.uniform(0.25, 0.45) if rng.random() < 0.6 else 1.0
    tail = np.cumsum(arm.link_lengths[::-1])
    free = min(arm.n_links, max(2, int(np.searchsorted(tail, share * length)) + 1))
    drawn = drawing(arm, before.joints[-1], (points, True), free)
    return Witness(arm, joined(before, drawn), points, closed=True)


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
        DraftRejected: If there are not so many, or all of them are about the rail.
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


def _walls(swept: Sweep, windows: list[Opening]) -> tuple[Obstacle, ...]:
    reach = WALL * scale(swept.arm)
    if len(windows) == 1:
        return tuple(wall("w", windows[0], reach))
    return tuple(
        box for i, window in enumerate(windows) for box in wall(f"w{i}", window, reach)
    )


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
        swept, last = sweep(witness), witness.points[:, 0].min()
        length = arm.total_length
        span = (0.1 * length, last - 0.1 * length)
        windows = openings(rng, swept, span, count, self.ratio)
        return Draft(witness, _walls(swept, windows))


def port(rng: Rng, arm: Manipulator) -> Draft:
    """A plate with a round hole; behind it pipes, crates and rods about the way."""
    curve = random_curve(rng, arm, int(rng.integers(2, 4)), (12.0, 35.0), (0.04, 0.14))
    witness = fed_and_drawn(rng, arm, curve, rng.uniform(0.45, 0.65), (0.012, 0.03))
    swept, radius, length = sweep(witness), arm.link_radius, arm.total_length
    x, thick = rng.uniform(0.03, 0.14) * length, 0.03 * scale(arm)
    least = least_opening(swept, x, thick)
    if least is None:
        raise DraftRejected
    reach = thick / 2.0 + swept.room
    off = np.linalg.norm(swept.between(x - reach, x + reach) - least.centre, axis=1)
    low = max(1.3 * radius, float(off.max()) + swept.room)
    if low > 2.0 * radius:
        raise DraftRejected
    hole = Opening(x, thick, least.centre, np.full(2, rng.uniform(low, 2.0 * radius)))
    plate = plate_with_hole(
        "wall", hole, int(rng.choice([32, 48, 64])), WALL * scale(arm)
    )
    litter = Litter(
        int(rng.integers(4, 11)),
        (pipe, crate, rod),
        (0.05 * length, 0.12 * length),
        (2.0 * radius, 6.0 * radius),
        x + 0.08 * length,
    )
    return Draft(witness, (plate, *scattered(rng, swept, litter)))


def clutter(rng: Rng, arm: Manipulator) -> Draft:
    """Thirty to three hundred small things about the arm."""
    curve = random_curve(rng, arm, int(rng.integers(1, 4)), (10.0, 30.0), (0.04, 0.16))
    witness = fed_and_drawn(rng, arm, curve, rng.uniform(0.4, 0.6), (0.015, 0.05))
    count = round(float(np.exp(rng.uniform(np.log(30), np.log(300)))))
    length = arm.total_length
    makers: tuple[Maker, ...] = (ball, crate, rod)
    litter = Litter(
        count,
        makers,
        (0.03 * length, 0.07 * length),
        (1.5 * arm.link_radius, 0.25 * length),
        0.0,
    )
    return Draft(witness, tuple(scattered(rng, sweep(witness), litter)), f"n{count}")


def least_bore(swept: Sweep, curve: TipCurve, span: Range, most: float) -> float:
    """Radius of the narrowest tube about a curve that leaves the sweep its room; [m].

    Raises:
        DraftRejected: If it would be wider than `most` body radii.
    """
    stations = np.linspace(*span, 400)
    middle = curve.at(stations)
    share = np.linspace(0.0, 1.0, 7)[:-1, None, None, None]
    begins, ends = swept.centres[::3, :-1], swept.centres[::3, 1:]
    points = (begins + share * (ends - begins)).reshape(-1, 3)
    points = points[points[:, 0] > middle[0, 0] - swept.arm.link_radius]
    worst = 0.0
    for part in np.array_split(points, max(1, len(points) // 2000)):
        gap = np.linalg.norm(part[:, None] - middle[None], axis=2)
        nearest = gap.argmin(axis=1)
        # Points before its mouth or beyond its end are not inside.
        within = (nearest > 0) & (nearest < len(middle) - 1)
        worst = max(worst, float(np.where(within, gap.min(axis=1), 0.0).max()))
    least = worst + swept.room
    if least > most * swept.arm.link_radius:
        raise DraftRejected
    return least


def duct(rng: Rng, arm: Manipulator) -> Draft:
    """A bent pipe of two to four bends, to be entered; the path is inside."""
    bends = int(rng.integers(2, 5))
    curve = random_curve(rng, arm, bends, (10.0, 32.0), (0.03, 0.1))
    length = arm.total_length
    end = rng.uniform(0.45, 0.7) * length
    first = end - rng.uniform(0.1, 0.18) * length
    step = 0.0099 * scale(arm)
    start = -rng.uniform(0.06, 0.12) * length
    witness = drawn_by_feeding(arm, curve, (start, first, end), step)
    if curve.starts[2 * bends - 1] > end:
        raise DraftRejected
    span = (rng.uniform(0.02, 0.06) * length, end + 0.5 * arm.link_radius)
    least = least_bore(sweep(witness), curve, span, 2.2)
    bore = least + rng.uniform(0.02, 0.2) * arm.link_radius
    density = (int(rng.choice([16, 24, 32, 48])), int(rng.integers(16, 80)))
    radii = (bore, bore + 0.15 * arm.link_radius)
    return Draft(witness, (tube("pipe", curve, span, radii, density),))


@dataclass(frozen=True)
class Hook:
    """Round a core between a front and a ceiling.

    Args:
        turn_deg: By how much the way in turns; beyond 90 a link leans back; [deg].
    """

    turn_deg: float

    def __call__(self, rng: Rng, arm: Manipulator) -> Draft:
        """A draft."""
        length, around = arm.total_length, rng.uniform(0.0, 2.0 * np.pi)
        radius = tightest_radius(arm) * rng.uniform(1.06, 1.25)
        lead = length * rng.uniform(0.04, 0.12)
        turn = np.deg2rad(self.turn_deg)
        curve = tip_curve([Bend(lead, turn, radius, around)])
        first = lead + turn * radius + rng.uniform(0.02, 0.06) * length
        last = first + rng.uniform(0.04, 0.08) * length
        step = 0.0099 * scale(arm)
        start = -rng.uniform(0.06, 0.12) * length
        witness = drawn_by_feeding(arm, curve, (start, first, last), step)
        aside = np.array([0.0, np.cos(around), np.sin(around)])
        return Draft(witness, self._obstacles(rng, sweep(witness), curve, aside))

    def _obstacles(
        self, rng: Rng, swept: Sweep, curve: TipCurve, aside: FloatArray
    ) -> tuple[Obstacle, ...]:
        arm, ahead = swept.arm, np.array([1.0, 0.0, 0.0])
        middle = curve.origins[1] + aside / curve.curvatures[1]
        axis, half = np.cross(ahead, aside), 0.5 * arm.total_length
        low, high = 0.0, float(1.0 / curve.curvatures[1])
        for _ in range(14):
            size = (low + high) / 2.0
            fits = swept.is_clear(Cylinder("core", middle, axis, half, size))
            low, high = (size, high) if fits else (low, size)
        core = Cylinder("core", middle, axis, half, low)
        planes: list[Obstacle] = []
        for name, normal in (("front", ahead), ("ceiling", aside)):
            far = float((swept.centres @ normal).max()) + swept.room
            gap = far + rng.uniform(0.1, 1.0) * arm.link_radius
            planes.append(HalfSpace(name, gap * normal, -normal))
        litter = Litter(
            int(rng.integers(1, 4)),
            (ball, rod),
            (0.03 * arm.total_length, 0.12 * arm.total_length),
            (2.0 * arm.link_radius, 6.0 * arm.link_radius),
            0.0,
        )
        return (core, *planes, *scattered(rng, swept, litter))


one_window = Windows((1, 1), (1.2, 2.1))
two_wide_windows = Windows((2, 2), (2.5, 6.0))
windows = Windows((2, 3), (1.2, 2.1))


def inside(rng: Rng, arm: Manipulator) -> Draft:
    """A start at the path or half-way in, bent as the arm is there."""
    make = (port, windows, duct, one_window)[int(rng.integers(4))]
    draft = make(rng, arm)
    witness = draft.witness
    if rng.random() < 0.5:
        return Draft(witness.begun_at(witness.n_before), draft.obstacles, "at-path")
    row = round(rng.uniform(0.4, 0.9) * witness.n_before)
    return Draft(witness.begun_at(row), draft.obstacles, "half-way")


FAMILIES: Final[Mapping[str, Callable[[Rng, Manipulator], Draft]]] = {
    "port": port,
    "windows": windows,
    "duct": duct,
    "hook75": Hook(75.0),
    "inside": inside,
    "one_window": one_window,
    "two_wide_windows": two_wide_windows,
    "clutter": clutter,
}
"""Every family by name."""

ARMS: Final[Mapping[str, tuple[Manipulator, ...]]] = {}
"""Arms of a family by its number, where they are not the usual ones."""


def arm_of(family: str, number: int) -> Manipulator:
    """The arm that a problem is for."""
    arms = ARMS.get(family, USUAL)
    return arms[number % len(arms)]
