"""What an arm sweeps on its witness motion, and how much room obstacles leave it."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, TypeAlias

import numpy as np

from benchmarks.hrm2000.curves import TipCurve
from benchmarks.hrm2000.motions import ROW, DraftRejected, Witness
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.verification.link_clearance import link_clearance

Rng: TypeAlias = np.random.Generator

LENGTH: Final = 3.126
"""Length of the arm that lengths in this package are stated for; [m]."""


def scale(arm: Manipulator) -> float:
    """How much larger an arm is than the one lengths are stated for; [-]."""
    return arm.total_length / LENGTH


def required_clearance(arm: Manipulator) -> float:
    """3.5 mm for the paper's arm; [m]."""
    return 0.0035 * scale(arm)


@dataclass(frozen=True)
class Sweep:
    """The arm at every row of a witness.

    Args:
        arm: The arm.
        centres: Joint centres, shape (n, N + 1, 3); [m].
    """

    arm: Manipulator
    centres: FloatArray

    @property
    def reserve(self) -> float:
        """Kept beyond the clearance asked for; covers the way between rows; [m]."""
        return 0.0005 * scale(self.arm)

    @property
    def room(self) -> float:
        """From the links' axes to every obstacle, at least; [m]."""
        return self.arm.link_radius + required_clearance(self.arm) + self.reserve

    def between(self, low: float, high: float) -> FloatArray:
        """Where the links' axes pass a slab across X: y and z, shape (k, 2); [m]."""
        begins = self.centres[:, :-1].reshape(-1, 3)
        ends = self.centres[:, 1:].reshape(-1, 3)
        run = ends[:, 0] - begins[:, 0]
        safe = np.where(run == 0.0, 1.0, run)
        shares = (np.array([[low], [high]]) - begins[:, 0]) / safe
        inside = (begins[:, 0] >= low) & (begins[:, 0] <= high)
        steady = np.where(inside, np.array([[0.0], [1.0]]), np.array([[2.0], [2.0]]))
        shares = np.where(run == 0.0, steady, shares)
        first, last = shares.min(axis=0), shares.max(axis=0)
        crossing = (first <= 1.0) & (last >= 0.0)
        at = np.clip(np.stack([first, last])[:, crossing], 0.0, 1.0)[..., None]
        points = begins[crossing] + at * (ends - begins)[crossing]
        return np.asarray(points[..., 1:].reshape(-1, 2))

    def clearance(self, obstacle: Obstacle) -> float:
        """From the links' surfaces to an obstacle, over all rows; [m]."""
        scene = Scene((obstacle,))
        return float(link_clearance(replace(self._alone, scene=scene))(self._few).min())

    @cached_property
    def _alone(self) -> PlanningProblem:
        return PlanningProblem(self.arm, Scene(()), None, 0.0, name="sweep")

    @cached_property
    def _few(self) -> FloatArray:
        """Every second row and the last one."""
        return np.concatenate([self.centres[::2], self.centres[-1:]])

    def is_clear(self, obstacle: Obstacle) -> bool:
        """Whether an obstacle leaves the arm its room."""
        # Two rows apart no point of the arm moves by more than a few ROWs.
        slack = 0.25 * ROW * self.arm.total_length
        gap = self.clearance(obstacle)
        return gap >= self.room - self.arm.link_radius + slack

    def places(self, rng: Rng, count: int, low: float) -> FloatArray:
        """Places of the links' axes beyond x = low, shape (count, 3); [m]."""
        rows = rng.integers(len(self.centres), size=4 * count + 64)
        links = rng.integers(self.arm.n_links, size=rows.size)
        share = rng.uniform(0.0, 1.0, rows.size)[:, None]
        begins, ends = self.centres[rows, links], self.centres[rows, links + 1]
        points = begins + share * (ends - begins)
        beyond = points[points[:, 0] >= low]
        if len(beyond) == 0:
            raise DraftRejected
        return np.asarray(beyond[np.arange(count) % len(beyond)])


def sweep(witness: Witness) -> Sweep:
    """What a witness sweeps."""
    return Sweep(witness.arm, witness.centres)


def least_bore(swept: Sweep, curve: TipCurve, span: tuple[float, float]) -> float:
    """Radius of the narrowest tube about a curve that leaves the sweep its room; [m].

    Args:
        swept: What has to pass.
        curve: Middle of the tube.
        span: Arc lengths of its ends; [m].
    """
    middle = curve.at(np.linspace(*span, 400))
    share = np.linspace(0.0, 1.0, 7)[:-1, None, None, None]
    begins, ends = swept.centres[::3, :-1], swept.centres[::3, 1:]
    points = (begins + share * (ends - begins)).reshape(-1, 3)
    points = points[points[:, 0] > middle[:, 0].min() - swept.arm.link_radius]
    worst = 0.0
    for part in np.array_split(points, max(1, len(points) // 2000)):
        gap = np.linalg.norm(part[:, None] - middle[None], axis=2)
        nearest = gap.argmin(axis=1)
        # Points before its mouth or beyond its end are not inside.
        within = (nearest > 0) & (nearest < len(middle) - 1)
        worst = max(worst, float(np.where(within, gap.min(axis=1), 0.0).max()))
    return worst + swept.room
