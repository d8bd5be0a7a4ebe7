"""What every strategy returns, and what it is given to measure with."""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Final, Literal, NamedTuple, Protocol, TypeAlias

import numpy as np

from vdsm_pin.arm.cables import cable_lengths
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, freeze
from vdsm_pin.notebook import Summarised
from vdsm_pin.problem.held import Axes
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory

if TYPE_CHECKING:
    from vdsm_pin.planner.paper.steps import PaperSteps


@dataclass(frozen=True)
class Prepared:
    """A problem as it is planned.

    Args:
        problem: With what stands for something that was asked.
        notes: One sentence for each such thing.
    """

    problem: PlanningProblem
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class TipPath:
    """The route of the tip, waypoint by waypoint (step 4 of the paper).

    Args:
        points: Tip positions O_{N+1}, shape (n_samples, 3); [m].
        on_path: Whether the tip is on the desired path, shape (n_samples,).
        path_m: Arc length along the desired path, shape (n_samples,); [m].
    """

    points: FloatArray
    on_path: BoolArray
    path_m: FloatArray

    def __post_init__(self) -> None:
        """Freeze the arrays."""
        freeze(self, "points", "path_m")
        freeze(self, "on_path", dtype=bool)


class Miss(NamedTuple):
    """A link that Coal measures nearer to an obstacle than asked, where it is nearest.

    Args:
        row: Of the trajectory, from 0.
        link: 1 to N; a tool counts as part of the last one.
        obstacle: Number of the obstacle in the scene, from 0.
        distance: What Coal measures, below 0 where they meet; [m].
        on_link: Coal's witness on the link or on what it carries, shape (3,); [m].
        on_obstacle: Coal's witness on the obstacle, shape (3,); [m].
        normal: Unit vector from the obstacle to the link, shape (3,); [-].
    """

    row: int
    link: int
    obstacle: int
    distance: float
    on_link: FloatArray
    on_obstacle: FloatArray
    normal: FloatArray


@dataclass(frozen=True)
class Adjustment:
    """What a link missed after a round, and what was done about it.

    Args:
        moment: Where the clearance was missed, in waypoints of that round's motion.
        link: 1 to N.
        obstacle: Its name.
        measured_by: "Coal" at a waypoint, or "proof" over an interval.
        distance: What it found; [m].
        margin: What the link keeps from the obstacle beyond the required clearance
            from now on; where joints were moved, how far the danger region is grown
            for both; [m].
        miss: Coal's whole answer, None of the proof.
        joints: Numbers of the joints that were moved on, 2 to N.
        moved: How far along their auxiliary line; [m].
    """

    moment: float
    link: int
    obstacle: str
    measured_by: Literal["Coal", "proof"]
    distance: float
    margin: float
    miss: Miss | None = None
    joints: tuple[int, ...] = ()
    moved: float = 0.0


@dataclass(frozen=True, repr=False)
class Plan(Summarised):
    """A planned motion with what each step found.

    Args:
        problem: What was asked.
        strategy: Name of the strategy.
        centres: Joint centres O_1..O_{N+1}, shape (n_samples, N + 1, 3); [m].
        trajectory: Joint values, the plan proper.
        undrawn: Stretches of the desired path that are not drawn, each with the reason:
            "from 0.5000 m to 1.0000 m along the path (why)".
        notes: What else the user should know, one sentence each: rounds of refinement
            and their reasons, lower bounds proved.
        rivals: Further plans of the same, none where the strategy has decided: the
            largest joint error that is proved to be survived decides between them and
            this one, which wins a draw, as the first of them does.
        steps: What each of the paper's steps found, by the strategy `paper`.
        rounds: What Coal found too near after each lift of the strategy `paper`, and
            how the joints were moved on for the next one.
    """

    problem: PlanningProblem
    strategy: str
    centres: FloatArray
    trajectory: Trajectory
    undrawn: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    rivals: tuple["Plan", ...] = ()
    steps: "PaperSteps | None" = None
    rounds: tuple[tuple[Adjustment, ...], ...] = ()

    def with_rows(self, rows: Trajectory) -> "Plan":
        """The same plan with other rows, which the paper's steps do not tell of."""
        arm = self.problem.manipulator
        centres = joint_centres(arm, rows.x0, rows.alpha, rows.theta)
        return replace(self, centres=centres, trajectory=rows, steps=None)

    @cached_property
    def tip_path(self) -> TipPath:
        """The route of the tip."""
        rows = self.trajectory
        return TipPath(self.centres[:, -1], rows.on_path, rows.path_m)

    @cached_property
    def cable_lengths(self) -> FloatArray:
        """l_ja, l_jb, l_jc, shape (n_samples, N, 3); [m]."""
        rows = self.trajectory
        return cable_lengths(self.problem.manipulator, rows.alpha, rows.theta)

    def summary(self) -> tuple[tuple[str, str], ...]:
        """How it was planned, its size, and the notes."""
        drawn = int(self.trajectory.on_path.sum())
        return (
            ("problem", self.problem.name),
            ("strategy", self.strategy),
            ("waypoints", f"{self.trajectory.n_samples}, {drawn} on the path"),
            *(("not drawn", stretch) for stretch in self.undrawn),
            *(("note", note) for note in self.notes),
        )


Margin: TypeAlias = float | FloatArray
"""What a plan keeps beyond the required clearance: one number, or one for each link and
obstacle, shape (N, n_obstacles); [m]."""


def margin_table(problem: PlanningProblem, margin: Margin) -> FloatArray:
    """A margin for each link and obstacle, shape (N, n_obstacles); [m].

    Raises:
        ValueError: If it is neither one number nor such a table.
    """
    table = np.asarray(margin, dtype=np.float64)
    shape = problem.manipulator.n_links, len(problem.scene.obstacles)
    if table.shape not in ((), shape):
        message = f"margins of shape {table.shape}, expected one number or {shape}"
        raise ValueError(message)
    return np.broadcast_to(table, shape)


class Measure(Protocol):
    """Coal's measure of a motion, passed in as `LinkClearance` is."""

    def __call__(
        self, trajectory: Trajectory, margin: Margin = 0.0, /
    ) -> tuple[Miss, ...]:
        """What comes nearer than the required clearance and a margin at a row.

        Returns:
            One entry for each link and obstacle, at their worst row.
        """
        ...


def _unmeasured(trajectory: Trajectory, margin: Margin = 0.0, /) -> tuple[Miss, ...]:
    """Nothing is missed."""
    del trajectory, margin
    return ()


UNMEASURED: Final[Measure] = _unmeasured
"""For plans whose rows nobody measures."""


class LinkClearance(Protocol):
    """Clearance of straight pieces of an arm from what they are held apart from.

    Passed in, so that the planner does not import what will judge it.
    """

    def __call__(self, centres: FloatArray, axes: Axes = None, /) -> FloatArray:
        """Proved lower bounds of the distance between surfaces.

        Args:
            centres: Ends of m pieces in a row, shape (n, m + 1, 3); pieces may have any
                length, also none; [m].
            axes: Which axis each piece is of, of a shape that goes with (n, m).

        Returns:
            Shape (n, m), infinite without obstacles; [m].
        """
        ...
