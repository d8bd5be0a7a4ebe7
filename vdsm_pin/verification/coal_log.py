"""What Coal is asked besides its rows, and all that it answers."""

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from vdsm_pin.arm.manipulator import TOOL
from vdsm_pin.geometry.arrays import FloatArray, IntArray, frozen
from vdsm_pin.verification.coal_rows import CoalRows
from vdsm_pin.verification.records import ClosestApproach, Pair

BETWEEN_LINKS: Final = frozenset({""})
"""The partners of pairs without an obstacle."""


class CoalLog:
    """What Coal is asked besides, and all that it answers.

    Args:
        pairs: Every pair that is judged.
        approaches: The closest approaches, measured at their moments.
        enclosing: Names of the meshes that the arm is inside of; Coal measures to
            their surface alone, which is no clearance, so no distance is kept.
    """

    def __init__(
        self,
        pairs: Sequence[Pair],
        approaches: Sequence[ClosestApproach],
        enclosing: Sequence[str],
    ) -> None:
        self.pairs, self.approaches = tuple(pairs), tuple(approaches)
        self.enclosing = tuple(enclosing)
        # An array of names would be as wide as the longest, for every pair.
        of_surface = (
            k for k, pair in enumerate(pairs) if pair.obstacle in self.enclosing
        )
        self._surfaces = np.fromiter(of_surface, np.int64)
        self._parts: list[tuple[IntArray, IntArray, FloatArray]] = []

    def keep(self, waypoint: IntArray, pair: IntArray, distance: FloatArray) -> None:
        """Receive distances of pairs, by their numbers, at waypoints."""
        usable = np.where(np.isfinite(distance), distance, np.nan)
        wanted = ~np.isin(pair, self._surfaces)
        self._parts.append((waypoint[wanted], pair[wanted], usable[wanted]))

    def asked(self, partners: Collection[str]) -> IntArray:
        """Numbers of the approaches to some obstacles, or to none: between links."""
        return np.array(
            [
                k
                for k, near in enumerate(self.approaches)
                if near.pair.obstacle in partners
                and near.pair.obstacle not in self.enclosing
                and {near.pair.body, near.pair.other_body} <= {"", TOOL}
            ],
            dtype=np.int64,
        )

    def keep_approaches(self, numbers: IntArray, distance: FloatArray) -> None:
        """Receive the distances at some approaches."""
        changed = list(self.approaches)
        for k, value in zip(numbers.tolist(), distance.tolist(), strict=True):
            changed[k] = replace(changed[k], coal=value)
        self.approaches = tuple(changed)

    def rows(self) -> CoalRows:
        """All distances at waypoints, in the order in which they came."""
        none = np.zeros(0, np.int64)
        parts = [*self._parts, (none, none, np.zeros(0))]
        waypoint, pair, distance = (
            np.concatenate(one) for one in zip(*parts, strict=True)
        )
        return CoalRows(
            frozen(waypoint, np.int64), frozen(pair, np.int64), frozen(distance)
        )
