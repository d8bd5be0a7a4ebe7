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

from vdsm_pin.geometry.arrays import FloatArray, IntArray, frozen
from vdsm_pin.problem.error_boxes import NO_ERRORS, ErrorBox
from vdsm_pin.proof.bodies import Pair as ProofPair
from vdsm_pin.proof.bodies import PairTable
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.question import Question
from vdsm_pin.proof.terms import REFUTED, UNDECIDED
from vdsm_pin.time_limit import Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.brackets import LeastClearances
from vdsm_pin.verification.contacts import common_ball
from vdsm_pin.verification.moving import Knots
from vdsm_pin.verification.pair_slopes import pair_slopes
from vdsm_pin.verification.records import Counterexample, Pair, is_deepest

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


def grown_by(errors: ErrorBox, pair: Pair) -> float:
    """By how much errors that do not turn bring a partner nearer; [m]."""
    if not pair.obstacle:
        return 0.0
    return errors.of_obstacle(pair.obstacle).shift + errors.base


class Search:
    """Looks for errors under which two bodies come too near.

    Args:
        motion: What is asked.
        number: Of the pair.
    """

    def __init__(self, motion: AskedMotion, number: int) -> None:
        asked, self.motion, self.number = motion.asked, motion, number
        self.required = float(asked.table.required[number])
        # Turns of base or obstacle are left out: what is found holds without them.
        self.grown = grown_by(motion.errors, asked.pair(number))
        self.limit = self.required + self.grown
        own = asked.column_errors(motion.errors)
        self.n_joints, self.sizes = own.size, np.zeros(asked.tree.n_columns)
        self.sizes[: own.size] = own  # others are of what moves beside
        bodies = [asked.bodies[k] for k in asked.sides(number)]
        table = PairTable.of([ProofPair(0, 1, self.limit)])
        self.question = Question.of(asked.tree, bodies, table)
        self.task = self.question.about(Path(motion.rows(np.zeros(1)))).task

    def find(self, moments: tuple[Moment, ...]) -> Counterexample | None:
        """A configuration within the box that misses the required clearance.

        Args:
            moments: Where to start.

        Returns:
            One whose witness points prove it; None where none was found.
        """
        return self._judged(*self._nearest(moments))

    def smallest(self, moments: tuple[Moment, ...]) -> Counterexample | None:
        """The same with offsets as small as the required clearance allows."""
        moment, offset = self._nearest(moments)
        nominal, low, high = self._joints(moment), 0.0, 1.0
        for _ in range(2):
            parts = np.linspace(low, high, PARTS)
            gaps = self._gaps(nominal + parts[:, None] * offset)
            near = np.flatnonzero(gaps < self.limit)
            if not near.size:
                return None
            low, high = parts[max(near[0] - 1, 0)], parts[near[0]]
        return self._judged(moment, high * offset)

    def _nearest(self, moments: tuple[Moment, ...]) -> tuple[Moment, FloatArray]:
        """The nearest configuration found within the box: moment and offsets."""
        corners, scale = self._first_corners(), INSIDE * self.sizes
        at = [(moment, corner) for moment in moments for corner in corners]
        q = np.array([self._joints(moment) for moment, _ in at])
        moved = self._walk(q, np.array([corner for _, corner in at]) * scale, scale)
        best = int(np.argmin(self._gaps(q + moved)))
        moment, offset = self._settle(at[best][0], moved[best])
        return moment, self._walk(self._joints(moment)[None], offset[None], scale)[0]

    def _joints(self, moment: Moment) -> FloatArray:
        """Nominal values of all columns, shape (n_columns,)."""
        at = np.array([moment.interval + moment.share])
        return np.asarray(self.motion.rows(at)[0])

    def _first_corners(self) -> FloatArray:
        """Corners to start from: none, and every second joint to one side."""
        odd = np.arange(len(self.sizes)) % 2
        return np.array([0.0 * odd, odd, -odd, 1 - odd, odd - 1])

    def _gaps(self, q: FloatArray) -> FloatArray:
        """Clearance of the pair at rows (m, n_columns) of q, shape (m,); [m]."""
        return self._slopes(q)[0]

    def _slopes(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The same, and how it changes with every joint, shape (m, n_columns)."""
        q, parts = np.ascontiguousarray(q), range(len(self.task.pairs.rough))
        found = (pair_slopes(self.task, part, q) for part in parts)
        gaps, slopes = map(np.stack, zip(*found, strict=True))
        nearest = np.argmin(gaps, axis=0), np.arange(len(q))
        return gaps[nearest], slopes[nearest]

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
            gaps = self._gaps(self.motion.rows(moment.interval + shares) + offset)
            share, step = float(shares[np.argmin(gaps)]), step / GRID
        return Moment(moment.interval, share), offset

    def _judged(self, moment: Moment, offset: FloatArray) -> Counterexample | None:
        """What the clearance proof says of one configuration."""
        asked, q = self.motion.asked, self._joints(moment) + offset
        proof = self.question.about(Path(q[None])).prove()
        upper, points = float(proof.upper[0]), proof.points[0]
        refuted = proof.verdict[0] == REFUTED
        if not refuted and upper <= self.limit:
            (poses,) = asked.tree.poses(q[None])
            both = asked.placed(self.number, poses)
            radius, centre = common_ball(*both, points.mean(axis=0))
            upper, points, refuted = -radius, np.array([centre, centre]), radius > 0.0
        if not refuted:
            return None
        return Counterexample(
            interval=moment.interval,
            share=moment.share,
            pair=asked.pair(self.number),
            joints=frozen(q[: self.n_joints]),
            offsets=frozen(offset[: self.n_joints] + 0.0),  # no -0
            clearance=upper - self.grown,
            required=self.required,
            link_point=frozen(points[0]),
            other_point=frozen(points[1]),
            deeper=is_deepest(upper, asked.ball(self.number)),
        )


def starts(least: LeastClearances, weakest: IntArray, k: int) -> tuple[Moment, ...]:
    """Where the search of a pair starts: nearest so far, and where least is proved.

    Args:
        least: What is proved.
        weakest: Of each pair the interval of its least lower bound, shape (n_pairs,).
        k: The pair.
    """
    nearest = Moment(int(least.interval[k]), float(least.share[k]))
    return (nearest, *(Moment(int(weakest[k]), float(share)) for share in SHARES))


def find_counterexamples(
    motion: AskedMotion, least: LeastClearances, weakest: IntArray, deadline: Deadline
) -> tuple[Counterexample, ...]:
    """Motions within the errors that miss what the proof left undecided.

    Args:
        motion: What is asked.
        least: What is proved of it, in intervals of its path.
        weakest: Of each pair the interval of its least lower bound, shape (n_pairs,).
        deadline: When to give up.

    Returns:
        One against obstacles and one between links, at most, in intervals of the
        trajectory; none where the nominal motion itself is refuted.

    Raises:
        OutOfTime: If the time is over.
    """
    outer, verdict, found = motion.asked.outer, least.verdict, list[Counterexample]()
    for mine in () if motion.errors == NO_ERRORS else (outer, ~outer):
        if (verdict[mine] == REFUTED).any():
            continue
        among = np.flatnonzero(mine & (verdict == UNDECIDED))
        order = np.argsort(least.lower[among], kind="stable")
        for k in among[order][:PAIRS].tolist():
            deadline.check()
            if one := Search(motion.in_itself, k).find(starts(least, weakest, k)):
                found.append(one)
                break
    return in_rows(tuple(found), motion.knots)


def in_rows(
    found: tuple[Counterexample, ...], knots: Knots
) -> tuple[Counterexample, ...]:
    """The same, their moments in intervals of the trajectory."""
    if knots.are_rows:
        return found
    inner = np.array([one.interval for one in found], np.int64)
    shares = knots.share(inner, np.array([one.share for one in found]))
    rows = zip(found, knots.interval(inner).tolist(), shares.tolist(), strict=True)
    return tuple(replace(one, interval=k, share=share) for one, k, share in rows)
