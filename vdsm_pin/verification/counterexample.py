"""A motion within the error box that misses its required clearance.

Where the proof for an error box does not go through, the box may ask too much or the
proof too little. A configuration within the box that comes too near settles it. The
search only proposes: it walks from corner to corner of the box along the slopes of the
distance. What it finds is judged like any motion of one row, so that nothing is refuted
without two witness points.
"""

from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, frozen
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.layouts import AT_LOWER, AT_UPPER, LOW, TIME
from vdsm_pin.proof.terms import REFUTED, UNDECIDED
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.clearance import ClearanceProof, prove_clearance
from vdsm_pin.verification.moving import whole_rows
from vdsm_pin.verification.pair_slopes import pair_slopes
from vdsm_pin.verification.records import (
    ClearanceChunk,
    Counterexample,
    Pair,
    is_deepest,
)
from vdsm_pin.verification.task import all_pairs, ball_of, make_task

PAIRS: Final = 8
"""Pairs looked at, those of the least lower bounds first."""

SHARES: Final = np.linspace(0.0, 1.0, 9)
"""Where in the interval of the least lower bound the search starts."""

STEPS: Final = 8
"""Most walks from corner to corner; two or three are usual."""

GRIDS: Final = 4
"""How often moments around the nearest one found are tried."""

GRID: Final = 16
"""So many on either side, each time so much closer together."""

AROUND: Final = np.array(sorted(range(-GRID, GRID + 1), key=abs))
"""Their numbers, the nearest first: of equally near moments it is kept."""

PARTS: Final = 129
"""Shares of the offsets tried at once for the smallest that suffices."""

INSIDE: Final = 1.0 - 1e-9
"""Offsets stay so little inside the box that adding them to angles cannot leave it."""


@dataclass(frozen=True)
class Moment:
    """An instant of a motion: an interval and the share of it passed, 0 to 1; [-]."""

    interval: int
    share: float


class Search:
    """Looks for counterexamples of one pair.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The motion.
        pair: The pair.
    """

    def __init__(
        self, problem: PlanningProblem, trajectory: Trajectory, pair: Pair
    ) -> None:
        mine = [o for o in problem.scene.obstacles if o.name == pair.obstacle]
        self.problem = replace(problem, scene=Scene(tuple(mine)))
        self.pair, self.trajectory = pair, trajectory
        self.required = problem.required_self_clearance
        if pair.obstacle:
            self.required = problem.required_clearance
        self.task = make_task(self.problem, ErrorBox())
        self.number = all_pairs(self.problem).index(pair)

    def find(
        self, errors: ErrorBox, moments: tuple[Moment, ...]
    ) -> Counterexample | None:
        """A configuration within the box that misses the required clearance.

        Args:
            errors: The box.
            moments: Where to start.

        Returns:
            One whose witness points prove it; None where none was found.
        """
        return self._judged(errors, *self._nearest(errors, moments))

    def smallest(
        self, errors: ErrorBox, moments: tuple[Moment, ...]
    ) -> Counterexample | None:
        """The same with joint offsets as small as the required clearance allows."""
        moment, offset = self._nearest(errors, moments)
        nominal, joints = self._joints(moment), np.arange(offset.size) > 0
        low, high, limit = 0.0, 1.0, self.required + self._grown(errors)
        for _ in range(2):
            parts = np.linspace(low, high, PARTS)
            tried = np.where(joints, parts[:, None] * offset, offset)
            near = np.flatnonzero(self._gaps(nominal + tried) < limit)
            if not near.size:
                return None
            low, high = parts[max(near[0] - 1, 0)], parts[near[0]]
        return self._judged(errors, moment, np.where(joints, high * offset, offset))

    def _grown(self, errors: ErrorBox) -> float:
        """By how much the partner may come nearer: surface and base shift; [m]."""
        if not self.pair.obstacle:
            return 0.0
        # A turn of base or obstacle is left out: what is found holds without it.
        still = errors.of_obstacle(self.pair.obstacle).shift
        return still + errors.base

    def _nearest(
        self, errors: ErrorBox, moments: tuple[Moment, ...]
    ) -> tuple[Moment, FloatArray]:
        """The nearest configuration found within the box: moment and offsets."""
        angles = errors.angles(self.problem.manipulator.n_links)
        corners = self._first_corners()
        scale = np.zeros(corners.shape[1])  # 0 of what carries obstacles
        scale[1 : 1 + angles.size] = INSIDE * angles.reshape(-1)
        at = [(moment, corner) for moment in moments for corner in corners]
        q = np.array([self._joints(moment) for moment, _ in at])
        moved = self._walk(q, np.array([corner for _, corner in at]) * scale, scale)
        best = int(np.argmin(self._gaps(q + moved)))
        moment, offset = self._settle(at[best][0], moved[best])
        return moment, self._walk(self._joints(moment)[None], offset[None], scale)[0]

    def _joints(self, moment: Moment) -> FloatArray:
        """Nominal values of all columns, shape (n_columns,)."""
        return np.asarray(self._between(moment.interval, np.array([moment.share]))[0])

    def _between(self, interval: int, shares: FloatArray) -> FloatArray:
        """The same at shares (m,) of an interval, shape (m, n_columns)."""
        # The last row begins no interval.
        last = max(0, self.trajectory.n_samples - 2)
        moments = np.minimum(interval, last) + shares
        return whole_rows(self.problem, self.trajectory, moments)

    def _first_corners(self) -> FloatArray:
        """Corners to start from: none, and every alpha or theta to one side."""
        corners = np.zeros((5, self.task.tree.column.max() + 1))
        corners[1, 1::2], corners[2, 1::2] = 1.0, -1.0
        corners[3, 2::2], corners[4, 2::2] = 1.0, -1.0
        return corners

    def _gaps(self, q: FloatArray) -> FloatArray:
        """Clearance of the pair at rows (m, n_columns) of q, shape (m,); [m]."""
        return self._slopes(q)[0]

    def _slopes(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The same, and how it changes with every joint, shape (m, n_columns)."""
        return pair_slopes(self.task, self.number, np.ascontiguousarray(q))

    def _walk(
        self, q: FloatArray, offsets: FloatArray, scale: FloatArray
    ) -> FloatArray:
        """Offsets (m, n_columns) from which slopes lead nowhere else within the box."""
        flat = TOLERANCES.flat_slope
        least, slopes = self._slopes(q + offsets)
        for _ in range(STEPS):
            tried = np.where(np.abs(slopes) <= flat, offsets, -np.sign(slopes) * scale)
            found, after = self._slopes(q + tried)
            nearer = found < least
            if not nearer.any():
                break
            least = np.where(nearer, found, least)
            slopes = np.where(nearer[:, None], after, slopes)
            offsets = np.where(nearer[:, None], tried, offsets)
        return offsets

    def _settle(self, moment: Moment, offset: FloatArray) -> tuple[Moment, FloatArray]:
        """The nearest moment around one, the offsets kept."""
        step, share = float(SHARES[1]) / GRID, moment.share
        for _ in range(GRIDS):
            shares = (share + step * AROUND).clip(0.0, 1.0)
            gaps = self._gaps(self._between(moment.interval, shares) + offset)
            share, step = float(shares[np.argmin(gaps)]), step / GRID
        return Moment(moment.interval, share), offset

    def _judged(
        self, errors: ErrorBox, moment: Moment, offset: FloatArray
    ) -> Counterexample | None:
        """What the clearance proof says of one configuration."""
        nominal, grown = self._joints(moment), self._grown(errors)
        width = 1 + 2 * self.problem.manipulator.n_links
        q, offset = (nominal + offset)[:width], offset[:width]
        problem = replace(
            self.problem,
            required_clearance=self.problem.required_clearance + grown,
        )
        when = np.array([moment.interval + moment.share])
        row = Trajectory(
            np.zeros(1, bool),
            np.zeros(1),
            q[:1],
            q[None, 1::2],
            q[None, 2::2],
            times=self.trajectory.times_at(when),
        )
        chunks: list[ClearanceChunk] = []
        proof = prove_clearance(problem, row, ErrorBox(), [chunks.append])
        column = proof.pairs.index(self.pair)
        if chunks[0].verdict[0, column] != REFUTED:
            return None
        upper = float(chunks[0].upper[0, column])
        return Counterexample(
            interval=moment.interval,
            share=moment.share,
            pair=self.pair,
            joints=frozen(q),
            offsets=frozen(offset),
            clearance=upper - grown,
            required=self.required,
            link_point=frozen(chunks[0].link_point[0, column]),
            other_point=frozen(chunks[0].other_point[0, column]),
            deeper=is_deepest(
                upper,
                ball_of(self.problem, self.pair),
            ),
        )


def moments_of(row: FloatArray) -> tuple[Moment, ...]:
    """Where a pair comes nearest: along the interval of its least lower bound.

    Args:
        row: The pair's, as `proof.layouts` lays out a best one.
    """
    spread = tuple(Moment(int(row[AT_LOWER]), float(share)) for share in SHARES)
    return (Moment(int(row[AT_UPPER]), float(row[TIME])), *spread)


def find_counterexamples(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    proof: ClearanceProof,
    deadline: Deadline = NO_LIMIT,
) -> tuple[Counterexample, ...]:
    """Motions within the error box that miss what the proof left undecided.

    Args:
        problem: Arm, scene, required clearances.
        trajectory: The nominal motion.
        errors: The box.
        proof: The proof for it.
        deadline: When to give up.

    Returns:
        One against obstacles and one between links, at most; none where the nominal
        motion itself is refuted.

    Raises:
        OutOfTime: If the time is over.
    """
    if errors == ErrorBox():
        return ()
    groups = [bool(pair.obstacle) for pair in proof.pairs]
    found = []
    for group in (True, False):
        mine = np.array(groups, dtype=bool) == group
        if proof.counts[mine, REFUTED].any():
            continue
        among = np.flatnonzero(mine & (proof.counts[:, UNDECIDED] > 0))
        for k in among[np.argsort(proof.best[among, LOW], kind="stable")][:PAIRS]:
            deadline.check()
            search = Search(problem, trajectory, proof.pairs[k])
            one = search.find(errors, moments_of(proof.best[k]))
            if one:
                found.append(one)
                break
    return tuple(found)
