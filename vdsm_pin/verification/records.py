"""What a verification returns: verdicts, rows of evidence, closest approaches."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import inf, isfinite, nan
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.notebook import Summarised
from vdsm_pin.problem.any_problem import AnyMotion, AnyProblem
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import in_mm, percent, proved_mm
from vdsm_pin.verification.brackets import ClearanceProfile, CoalRows, LeastClearances


class Verdict(StrEnum):
    """Outcome of one check or of the whole; only certified counts as passed.

    Incomplete is a motion that draws less of the desired path than required and passes
    every other check.

    Example:
        >>> vp.Verdict.CERTIFIED.value
        'certified'
    """

    CERTIFIED = "certified"
    INCOMPLETE = "incomplete"
    REFUTED = "refuted"
    UNDECIDED = "undecided"


def combine(verdicts: tuple[Verdict, ...]) -> Verdict:
    """The worst of refuted, undecided, incomplete, certified; of none undecided."""
    for worst in (Verdict.REFUTED, Verdict.UNDECIDED, Verdict.INCOMPLETE):
        if worst in verdicts:
            return worst
    return Verdict.CERTIFIED if verdicts else Verdict.UNDECIDED


class CheckKind(StrEnum):
    """Rows of evidence that others look for; each value is the name of the row."""

    OBSTACLES = "clearance from obstacles"
    LINKS = "clearance between links"
    ARM_OUTSIDE = "arm outside the meshes"
    LINKS_OUTSIDE = "links outside the meshes"
    PLANNED = "joint centres by Pinocchio against the planned ones"


CLEARANCES: Final = frozenset({CheckKind.OBSTACLES, CheckKind.LINKS})
"""Of lengths that are proved from one side."""


@dataclass(frozen=True)
class Check:
    """One row of evidence.

    Args:
        name: What was checked, in field terms; a `CheckKind` where others look for it.
        verdict: Its outcome; a check with count 0 is never certified.
        count: Items checked.
        worst: The worst value found or bounded; NaN where there is none.
        limit: What it was held against; NaN where there is none.
        unit: SI unit of both ("m", "rad"), "share" of a whole, or "-".
        where: The place of the worst case in words, joints and links from 1.
        moment: When it happens, in waypoints: 12.25 is a quarter of the way from 12 to
            13; NaN where it has no time.
        deeper: Whether `worst` is a depth at which the link's axis meets the body: it
            may be deeper, since no depth beyond the link's radius is measured.
        first_moment: When the limit is first broken, where that was looked for; NaN
            else.
        last_moment: When it is last broken; NaN where that was not looked for.
        too_close_intervals: Of a clearance, the intervals it is lost in; 0 where not
            counted.
        too_close_stretches: How many runs of neighbours those make.
    """

    name: str
    verdict: Verdict
    count: int
    worst: float
    limit: float
    unit: str
    where: str = ""
    moment: float = nan
    deeper: bool = False
    first_moment: float = nan
    last_moment: float = nan
    too_close_intervals: int = 0
    too_close_stretches: int = 0


def is_deepest(clearance: float, link_radius: float) -> bool:
    """Whether a clearance is as deep as is measured: the link's axis meets the body.

    Args:
        clearance: An upper bound of it; [m].
        link_radius: Distances are measured from the axis, so no depth exceeds it; [m].
    """
    return -inf < clearance <= TOLERANCES.bracket_gap - link_radius


@dataclass(frozen=True, slots=True)
class Pair:
    """A body of an arm or robot and what it must stay clear of.

    The partner is an obstacle or another body. Every body of a robot of a URDF is a
    link, named as there.

    Args:
        link: The link that the body rides on, 1 to N, 0 for the feed; of a robot of a
            URDF its number among the links with solids, from 1.
        obstacle: Name; empty for a pair of bodies.
        other_link: The link of the other body, farther from the base; else 0.
        body: Name of the body; empty for the link itself.
        other_body: Name of the other body; empty for the link itself.
    """

    link: int
    obstacle: str = ""
    other_link: int = 0
    body: str = ""
    other_body: str = ""

    @property
    def own(self) -> str:
        """The body in words: its name or 'link k'."""
        return self.body or f"link {self.link}"

    @property
    def label(self) -> str:
        """The partner in words: the name of an obstacle or body, or 'link k'."""
        return self.obstacle or self.other_body or f"link {self.other_link}"

    def __str__(self) -> str:
        """Both in words."""
        return f"{self.own} and {self.label}"


def _place(check: Check) -> str:
    """Where its worst case is, in words."""
    when = f"at waypoint {check.moment:.6g}" if isfinite(check.moment) else ""
    return "".join(f", {words}" for words in (when, check.where) if words)


@dataclass(frozen=True, repr=False)
class ClosestApproach:
    """The clearance bracket of one pair over one interval, with its witness.

    Args:
        interval: Rows interval and interval + 1 bound it, counted from 0.
        share: Where in the interval the upper bound was found, 0 to 1.
        pair: The pair.
        lower: Proved lower bound of the clearance over the interval; [m].
        upper: Clearance at that time, proved from above; negative inside; [m].
        station: Arc length of the witness along the link's axis; [m].
        link_point: Witness on the link's surface, base frame, shape (3,); [m].
        other_point: Witness on the partner's surface, base frame, shape (3,); [m].
        deeper: Whether the link's axis meets the partner: what is measured of such a
            depth is the link's radius, and it may be deeper.
        coal: Coal's distance at that time; NaN where it was not asked, -inf where its
            answer is unusable; [m].
    """

    interval: int
    share: float
    pair: Pair
    lower: float
    upper: float
    station: float
    link_point: FloatArray
    other_point: FloatArray
    deeper: bool = False
    coal: float = nan

    @property
    def moment(self) -> float:
        """When the upper bound was found, in waypoints."""
        return self.interval + self.share

    def __repr__(self) -> str:
        """The pair, what it is proved to keep and where it is nearest, in one line."""
        clearance = f"{proved_mm(self.lower)} to {in_mm(self.upper)}"
        where = f"nearest at waypoint {self.moment:.6g}"
        return f"{type(self).__name__}({self.pair}: {clearance}, {where})"


@dataclass(frozen=True)
class Counterexample:
    """A motion within the error box that misses a required clearance.

    Args:
        interval: Rows interval and interval + 1 bound it, counted from 0.
        share: Where in the interval it happens, 0 to 1.
        pair: The pair that comes too near.
        joints: x0, alpha1, theta1, .. at that instant, shape (1 + 2N,); [m], [rad].
        offsets: What they differ by from the nominal ones: constant errors within the
            box, shape (1 + 2N,); [m], [rad].
        clearance: Proved upper bound with the obstacle's error and the base's
            displacement taken off; [m].
        required: What it falls short of; [m].
        link_point: Witness on the link's surface, base frame, shape (3,); [m].
        other_point: Witness on the partner's nominal surface, shape (3,); [m].
        deeper: Whether the link's axis meets the partner, see `ClosestApproach`.
    """

    interval: int
    share: float
    pair: Pair
    joints: FloatArray
    offsets: FloatArray
    clearance: float
    required: float
    link_point: FloatArray
    other_point: FloatArray
    deeper: bool = False

    @property
    def moment(self) -> float:
        """When it happens, in waypoints."""
        return self.interval + self.share


@dataclass(frozen=True, repr=False, kw_only=True)
class Verification(Summarised):
    """The judgement of one motion against one problem, of an arm or any other robot.

    Args:
        problem: Arm or robot, scene and required clearances.
        trajectory: The motion that was judged.
        pairs: Every pair judged, in the order that chunks number them.
        checks: One row per check, in a fixed order.
        approaches: The closest approaches over the whole motion, nearest first, one per
            pair at most, ten at most; the first is the minimum clearance.
        profile: Brackets along the motion.
        least: The least clearance of every pair.
        joint_error: Largest joint error still certified; 0 if none is; NaN if nobody
            looked for it or the time was over; [rad].
        refuted_joint_error: A joint error at which the clearance is lost, with a
            counterexample; NaN if none was looked for or found; [rad].
        counterexamples: Motions within the error box that miss a required clearance:
            one against obstacles, one between links, at most.
        nominal_clear: Whether the motion without errors is proved clear; False where
            there is no counterexample, since nobody asked then.
        not_done: What the time limit left out besides checks, which have their rows;
            in words, one thing each.
        time_limit: How long all of it was allowed to take; [s].
        coal: What Coal measured; None where it was not asked.
    """

    problem: AnyProblem
    trajectory: AnyMotion
    pairs: Sequence[Pair]
    checks: tuple[Check, ...]
    approaches: tuple[ClosestApproach, ...]
    profile: ClearanceProfile
    least: LeastClearances
    joint_error: float = nan
    refuted_joint_error: float = nan
    counterexamples: tuple[Counterexample, ...] = ()
    nominal_clear: bool = False
    not_done: tuple[str, ...] = ()
    time_limit: float = float("inf")
    coal: CoalRows | None = None

    @property
    def errors(self) -> ErrorBox:
        """The error box that the clearance proof covers."""
        return self.problem.errors

    @property
    def verdict(self) -> Verdict:
        """Certified only if every check is."""
        return combine(tuple(check.verdict for check in self.checks))

    @property
    def min_clearance(self) -> float:
        """Proved least clearance from any obstacle, infinite without obstacles; [m].

        Of every pair: under errors one may be proved to keep less than all that come
        nearest without them.
        """
        outer = np.array([bool(pair.obstacle) for pair in self.pairs], bool)
        return float(self.least.lower[outer].min(initial=inf))

    def time_at(self, moment: float) -> float | None:
        """When a moment in waypoints is, where the trajectory tells; [s]."""
        if not isfinite(moment):
            return None
        times = self.trajectory.times_at(np.array([moment]))
        return None if times is None else float(times[0])

    def closest(self, count: int) -> tuple[ClosestApproach, ...]:
        """The nearest approaches, obstacles first, `count` of them at most."""
        return self.approaches[: max(count, 0)]

    def summary(self) -> tuple[tuple[str, str], ...]:
        """Verdict, clearance, and the checks that did not pass."""
        bad = (c for c in self.checks if c.verdict is not Verdict.CERTIFIED)
        return (
            ("problem", self.problem.name),
            ("verdict", self.verdict.value),
            ("proved clearance", proved_mm(self.min_clearance)),
            ("waypoints", str(self.trajectory.n_samples)),
            *self._drawn(),
            *((c.name, f"{c.verdict.value}{_place(c)}") for c in bad),
        )

    def _drawn(self) -> tuple[tuple[str, str], ...]:
        """What is drawn of a desired path, where there is one."""
        return ()


@dataclass(frozen=True, repr=False, kw_only=True)
class ArmVerification(Verification):
    """The judgement of a snake arm's trajectory, which may draw a desired path.

    Args:
        problem: What was asked.
        trajectory: What was judged.
        coverage: Proved part of the desired path that is drawn, 0 to 1; NaN where there
            is none; [-].
        undrawn: Stretches not drawn, arc lengths from and to, shape (k, 2); [m].
    """

    problem: PlanningProblem
    trajectory: Trajectory
    coverage: float
    undrawn: FloatArray

    def _drawn(self) -> tuple[tuple[str, str], ...]:
        if self.problem.tip_path is None:
            return ()
        return (("drawn", percent(self.coverage)),)
