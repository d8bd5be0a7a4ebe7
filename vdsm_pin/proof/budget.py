"""How long a proof may take, and how narrow its brackets are to be."""

from dataclasses import dataclass
from math import inf

from vdsm_pin.proof.terms import Rules
from vdsm_pin.tolerances import TOLERANCES


@dataclass(frozen=True)
class Budget:
    """Bounds of effort and width.

    Args:
        slices: Most slices of one interval and pair.
        candidates: Most blocks, and then intervals, kept for refining the least
            bracket.
        profile: Most values of a profile; beyond it intervals share a bin.
        slack: Brackets wider than this part of the clearance are asked of a new plane;
            [-].
        until: When to stop, by the monotonic clock; [s].
        far: Brackets of clearances beyond it, and beyond the least one met, may be half
            as wide as the clearance; [m].
    """

    slices: int = 20_000
    candidates: int = 65_536
    profile: int = 4_000_000
    slack: float = 0.02
    until: float = inf
    far: float = inf

    def rules(self, pad: float) -> Rules:
        """The same for compiled code.

        Args:
            pad: Bound of all rounding in one evaluation; [m].
        """
        return Rules(
            steady=True,
            nominal=True,
            pad=pad,
            goal=TOLERANCES.bracket_gap,
            gap=TOLERANCES.least_bracket,
            slack=self.slack,
            until=self.until,
            far=self.far,
        )


def rounding_pad(largest: float) -> float:
    """Bound of all rounding in one evaluation; [m].

    `TOLERANCES.arithmetic` holds within `TOLERANCES.scene_extent`; rounding grows in
    proportion beyond it.

    Args:
        largest: Bound of all lengths and coordinates; [m].
    """
    return TOLERANCES.arithmetic * max(1.0, largest / TOLERANCES.scene_extent)
