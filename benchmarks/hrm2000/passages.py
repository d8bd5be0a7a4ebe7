"""Families with passages along the tip's curve: a duct, a pocket, round a core."""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from benchmarks.hrm2000.curves import Bend, TipCurve, tightest_radius, tip_curve
from benchmarks.hrm2000.drafts import Draft, fed, random_curve
from benchmarks.hrm2000.litter import Litter, ball, rod, scattered
from benchmarks.hrm2000.motions import DraftRejected, Witness
from benchmarks.hrm2000.solids import Tube
from benchmarks.hrm2000.sweeps import Rng, Sweep, least_bore, sweep
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Cylinder, HalfSpace
from vdsm_pin.problem.scene import Obstacle

WIDEST: Final = 2.2
"""Bore of a tube at most; body radii."""


def narrow_tube(
    rng: Rng, witness: Witness, curve: TipCurve, span: tuple[float, float]
) -> Tube:
    """A tube that leaves the sweep of a witness little more than its room.

    Raises:
        DraftRejected: If it would be wide all the same.
    """
    radius, corners = witness.arm.link_radius, int(rng.choice([16, 24, 32, 48]))
    rings = int(rng.integers(24, 100))
    # Between two rings its wall is straight, where the curve is not.
    cut = ((span[1] - span[0]) / (rings - 1)) ** 2 * curve.curvatures.max() / 8.0
    bore = least_bore(sweep(witness), curve, span) + float(cut)
    bore += rng.uniform(0.01, 0.25) * radius
    if bore > WIDEST * radius:
        raise DraftRejected
    return Tube(curve, span, bore, 0.15 * radius, corners, rings)


def duct(rng: Rng, arm: Manipulator) -> Draft:
    """A bent pipe of two to four bends, to be entered; the path is inside."""
    bends, length = int(rng.integers(2, 5)), arm.total_length
    curve = random_curve(rng, arm, bends, (10.0, 32.0), (0.03, 0.1))
    end = rng.uniform(0.45, 0.7) * length
    if curve.starts[2 * bends - 1] > end:
        raise DraftRejected
    witness = fed(rng, arm, curve, end, (0.1, 0.18))
    span = (rng.uniform(0.02, 0.06) * length, end + 0.5 * arm.link_radius)
    return Draft(witness, (narrow_tube(rng, witness, curve, span).mesh("pipe"),))


def pocket(rng: Rng, arm: Manipulator) -> Draft:
    """A tube that turns aside, closed at its end; the path is at the bottom."""
    length, around = arm.total_length, rng.uniform(0.0, 2.0 * np.pi)
    radius = tightest_radius(arm) * rng.uniform(1.06, 1.3)
    first, second = np.deg2rad(rng.uniform((20.0, 35.0), (45.0, 60.0)))
    bends = [
        Bend(rng.uniform(0.04, 0.12) * length, first, radius, around),
        Bend(rng.uniform(0.0, 0.05) * length, second, radius, rng.uniform(-0.8, 0.8)),
    ]
    curve = tip_curve(bends)
    end = float(curve.starts[-1]) + rng.uniform(0.03, 0.1) * length
    witness = fed(rng, arm, curve, end, (0.05, 0.1))
    mouth = float(curve.starts[2]) + rng.uniform(0.0, 0.3) * second * radius
    room = sweep(witness).room
    span = (mouth, end + room + rng.uniform(0.05, 0.5) * arm.link_radius)
    tube = replace(narrow_tube(rng, witness, curve, span), capped=True)
    return Draft(witness, (tube.mesh("pocket"),))


@dataclass(frozen=True)
class Hook:
    """Round a core, between a front and a ceiling.

    Args:
        turn_deg: By how much the way in turns; beyond 90 a link leans back; [deg].
    """

    turn_deg: float

    def __call__(self, rng: Rng, arm: Manipulator) -> Draft:
        """A draft."""
        length, around = arm.total_length, rng.uniform(0.0, 2.0 * np.pi)
        radius = tightest_radius(arm) * rng.uniform(1.06, 1.25)
        lead, turn = length * rng.uniform(0.04, 0.12), np.deg2rad(self.turn_deg)
        curve = tip_curve([Bend(lead, turn, radius, around)])
        end = float(curve.starts[-1]) + rng.uniform(0.08, 0.13) * length
        witness = fed(rng, arm, curve, end, (0.04, 0.075))
        aside = np.array([0.0, np.cos(around), np.sin(around)])
        return Draft(witness, _round_a_core(rng, sweep(witness), curve, aside))


def _round_a_core(
    rng: Rng, swept: Sweep, curve: TipCurve, aside: FloatArray
) -> tuple[Obstacle, ...]:
    """The thickest core in the bend, planes before and above, some things about."""
    arm, ahead = swept.arm, np.array([1.0, 0.0, 0.0])
    middle = curve.origins[1] + aside / curve.curvatures[1]
    axis, half = np.cross(ahead, aside), 0.5 * arm.total_length
    low, high = 0.0, float(1.0 / curve.curvatures[1])
    for _ in range(14):
        size = (low + high) / 2.0
        fits = swept.is_clear(Cylinder("core", middle, axis, half, size))
        low, high = (size, high) if fits else (low, size)
    planes: list[Obstacle] = []
    for name, normal in (("front", ahead), ("ceiling", aside)):
        far = float((swept.centres @ normal).max()) + swept.room
        gap = far + rng.uniform(0.1, 1.0) * arm.link_radius
        planes.append(HalfSpace(name, gap * normal, -normal))
    litter = Litter(
        count=int(rng.integers(1, 4)),
        makers=(ball, rod),
        size=(0.03 * arm.total_length, 0.12 * arm.total_length),
        away=(2.0 * arm.link_radius, 6.0 * arm.link_radius),
        beyond=0.0,
    )
    core = Cylinder("core", middle, axis, half, low)
    return (core, *planes, *scattered(rng, swept, litter))
