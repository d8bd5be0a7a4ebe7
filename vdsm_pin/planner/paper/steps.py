"""What the paper's steps found, kept for whoever wants to follow them."""

from dataclasses import dataclass

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.paper.along_rail import AlongRail
from vdsm_pin.planner.paper.avoidance import Avoidance
from vdsm_pin.planner.paper.tip_path import Route
from vdsm_pin.planner.records import Adjustment
from vdsm_pin.problem.trajectory import Trajectory


@dataclass(frozen=True)
class PaperSteps:
    """What Steps 3 to 7 give for one way of avoiding the obstacle.

    Args:
        avoidance: How Steps 4 and 5 were settled.
        route: Step 4.
        reference: Step 3, the straight arm, shape (n_samples, N + 1, 2); [m].
        planar: Step 5, shape (n_samples, N + 1, 2); [m].
        centres: Step 6, shape (n_samples, N + 1, 3); [m].
        trajectory: Step 7.
        rounds: What Coal found too near after each lift before this one, and how the
            joints were moved on.
    """

    avoidance: Avoidance
    route: Route
    reference: FloatArray
    planar: FloatArray
    centres: FloatArray
    trajectory: Trajectory
    rounds: tuple[tuple[Adjustment, ...], ...] = ()

    @property
    def reads_approach(self) -> bool:
        """Whether Step 4 asked for the scheme of the approach (paper, 4.2.2)."""
        return isinstance(self.avoidance, AlongRail)
