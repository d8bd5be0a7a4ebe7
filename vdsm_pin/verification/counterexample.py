"""A motion within the error box that misses its required clearance.

Where the proof for an error box does not go through, the box may ask too much or the
proof too little. A configuration within the box that comes too near settles it. The
search only proposes: it walks from corner to corner of the box along the slopes of the
distance. What it finds is judged like any motion of one row, so that nothing is refuted
without two witness points.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, frozen
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.proof.bodies import Body, PairTable
from vdsm_pin.proof.bodies import Pair as ProofPair
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.prover import answer
from vdsm_pin.proof.question import Question
from vdsm_pin.proof.terms import REFUTED, UNDECIDED
from vdsm_pin.proof.tree import Tree
from vdsm_pin.time_limit import Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.contacts import Placed, common_ball
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


@dataclass(frozen=True)
class ErringPair:
    """Whether two bodies of a tree come too near within an error box.

    Args:
        pair: Their names.
        tree: The joints.
        bodies: Those two, in the order of their names.
        required: Their least clearance; [m].
        rows: Rows of all columns at moments in waypoints, (m,) to (m, n_columns).
        sizes: Largest errors of the columns, shape (n_columns,); [m], [rad].
        grown: By how much the partner may come nearer besides; turns of base or
            obstacle are left out: what is found holds without them; [m].
        n_joints: Columns that are told; others are of what moves beside.
        ball: Radius of what the first body is grown by, as deep as is measured; [m].
    """

    pair: Pair
    tree: Tree
    bodies: tuple[Body, Body]
    required: float
    rows: Callable[[FloatArray], FloatArray]
    sizes: FloatArray
    grown: float
    n_joints: int
    ball: float = 0.0

    def common_ball(
        self, q: FloatArray, middle: FloatArray
    ) -> tuple[float, FloatArray]:
        """A ball in both bodies at a row of q, looked for about a point, as proved."""
        (poses,) = self.tree.poses(q[None])
        one, other = (Placed(x.pieces, poses[x.frame]) for x in self.bodies)
        return common_ball(one, other, middle)


def grown_by(errors: ErrorBox, pair: Pair) -> float:
    """By how much errors that do not turn bring a partner nearer; [m]."""
    if not pair.obstacle:
        return 0.0
    return errors.of_obstacle(pair.obstacle).shift + errors.base


class Search:
    """Looks for counterexamples of one pair.

    Args:
        asked: The pair and the errors.
    """

    def __init__(self, asked: ErringPair) -> None:
        self.asked, self.limit = asked, asked.required + asked.grown
        table = PairTable.of([ProofPair(0, 1, self.limit)])
        self.question = Question.of(asked.tree, asked.bodies, table)
        self.task = self.question.about(Path(asked.rows(np.zeros(1)))).task

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
        corners, scale = self._first_corners(), INSIDE * self.asked.sizes
        at = [(moment, corner) for moment in moments for corner in corners]
        q = np.array([self._joints(moment) for moment, _ in at])
        moved = self._walk(q, np.array([corner for _, corner in at]) * scale, scale)
        best = int(np.argmin(self._gaps(q + moved)))
        moment, offset = self._settle(at[best][0], moved[best])
        return moment, self._walk(self._joints(moment)[None], offset[None], scale)[0]

    def _joints(self, moment: Moment) -> FloatArray:
        """Nominal values of all columns, shape (n_columns,)."""
        return np.asarray(
            self.asked.rows(np.array([moment.interval + moment.share]))[0]
        )

    def _first_corners(self) -> FloatArray:
        """Corners to start from: none, and every second joint to one side."""
        odd = np.arange(len(self.asked.sizes)) % 2
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
            gaps = self._gaps(self.asked.rows(moment.interval + shares) + offset)
            share, step = float(shares[np.argmin(gaps)]), step / GRID
        return Moment(moment.interval, share), offset

    def _judged(self, moment: Moment, offset: FloatArray) -> Counterexample | None:
        """What the clearance proof says of one configuration."""
        asked, q = self.asked, self._joints(moment) + offset
        proof = answer(self.question, Path(q[None]))
        upper, points = float(proof.upper[0]), proof.points[0]
        refuted = proof.verdict[0] == REFUTED
        if not refuted and upper <= self.limit:
            radius, centre = asked.common_ball(q, points.mean(axis=0))
            upper, points, refuted = -radius, np.array([centre, centre]), radius > 0.0
        if not refuted:
            return None
        return Counterexample(
            interval=moment.interval,
            share=moment.share,
            pair=asked.pair,
            joints=frozen(q[: asked.n_joints]),
            offsets=frozen(offset[: asked.n_joints] + 0.0),  # no -0
            clearance=upper - asked.grown,
            required=asked.required,
            link_point=frozen(points[0]),
            other_point=frozen(points[1]),
            deeper=is_deepest(upper, asked.ball),
        )


def moments_of(nearest: Moment, weakest: int) -> tuple[Moment, ...]:
    """Where a search starts: the least upper bound, and along an interval.

    Args:
        nearest: When the pair comes nearest, as far as is known.
        weakest: Its interval of the least lower bound.
    """
    return (nearest, *(Moment(weakest, float(share)) for share in SHARES))


def counterexamples(
    pairs: Sequence[Pair],
    verdict: IntArray,
    lower: FloatArray,
    question: Callable[[int], ErringPair],
    moments: Callable[[int], tuple[Moment, ...]],
    deadline: Deadline,
) -> tuple[Counterexample, ...]:
    """Motions within an error box that miss what its proof left undecided.

    Args:
        pairs: Every pair of the motion.
        verdict: CERTIFIED, REFUTED or UNDECIDED, shape (n_pairs,).
        lower: Least proved clearances, shape (n_pairs,); [m].
        question: Of the pair of a number.
        moments: Where to start with it.
        deadline: When to give up.

    Returns:
        One against obstacles and one between links, at most; none where the nominal
        motion itself is refuted.

    Raises:
        OutOfTime: If the time is over.
    """
    outer = np.array([bool(pair.obstacle) for pair in pairs], dtype=bool)
    found = []
    for mine in (outer, ~outer):
        if (verdict[mine] == REFUTED).any():
            continue
        among = np.flatnonzero(mine & (verdict == UNDECIDED))
        for k in among[np.argsort(lower[among], kind="stable")][:PAIRS]:
            deadline.check()
            if one := Search(question(k)).find(moments(k)):
                found.append(one)
                break
    return tuple(found)
