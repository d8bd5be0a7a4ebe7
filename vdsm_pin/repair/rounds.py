"""What the repair of any motion shares: rounds of judging and pushing rows apart.

Where the proof finds bodies too near, rows are pushed up the slopes of the clearance
until they keep it with a margin; they become waypoints, and the whole is judged again.
How rows are pushed is told by who knows the robot.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import ceil, floor, isnan
from typing import Any, Final, Generic, Protocol, Self, TypeVar

import numpy as np

from vdsm_pin.errors import Infeasible, InvalidInput
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.notebook import Summarised
from vdsm_pin.problem.any_problem import AnyMotion
from vdsm_pin.proof.terms import CERTIFIED
from vdsm_pin.repair.causes import Place, cause
from vdsm_pin.time_limit import Deadline
from vdsm_pin.units import MM_PER_M, in_mm
from vdsm_pin.verification.brackets import LeastClearances
from vdsm_pin.verification.records import Verdict, Verification

R = TypeVar("R", bound=AnyMotion)
V = TypeVar("V", bound=Verification)

ROUNDS: Final = 12
"""Of pushing and judging."""

SOON: Final = 1e-6
"""A new waypoint is not so near another one, over the time of the motion; [-]."""

APART: Final = float(np.radians(1.0))
"""How far samples lie apart in the joint that moves most; [rad], [m]."""

MOST: Final = 300
"""New rows that a round may push: more are pushed to different sides and lead apart."""


@dataclass(frozen=True, repr=False)
class Repaired(Summarised, Generic[R, V]):
    """A motion that is certified, and how far it is from the one that was given.

    Args:
        trajectory: The motion, of the kind that was given.
        verification: Of the motion.
        given: Number of the given waypoint that each waypoint was, -1 for a new one,
            shape (n_rows,).
        moved: How far each waypoint lies off its place in the given motion, in the
            joint that differs most, shape (n_rows,); [rad], [m].
    """

    trajectory: R
    verification: V
    given: IntArray
    moved: FloatArray

    @property
    def most(self) -> str:
        """How far the waypoint is moved that is moved most, in words."""
        most = float(self.moved.max())
        turned = f"{np.degrees(most):.3f}°"
        if not self.verification.problem.slides:
            return turned
        return f"{turned} of a joint that turns or {in_mm(most)} of one that slides"

    def summary(self) -> tuple[tuple[str, str], ...]:
        """What became of the motion, then its verification."""
        new = int((self.given < 0).sum())
        return (
            ("new waypoints", str(new)),
            ("moved most", self.most),
            *self.verification.summary(),
        )


def parts_of(motion: AnyMotion, scale: FloatArray | float = 1.0) -> IntArray:
    """Into how many parts to sample each interval, shape (n_rows - 1,).

    Args:
        motion: Its rows and what joins them.
        scale: Makes its columns comparable, shape (n_columns,).
    """
    steps = scale * np.abs(np.diff(motion.path.controls, axis=1)).sum(axis=1)
    parts = np.ceil(steps.max(axis=1, initial=0.0) / APART)
    return np.asarray(np.maximum(1.0, parts), np.int64)


@dataclass(frozen=True)
class Places:
    """Rows of a motion and moments between them, in waypoints and rising.

    Args:
        moments: Shape (m,).
        n_rows: Of the motion.
    """

    moments: FloatArray
    n_rows: int

    @classmethod
    def within(
        cls, parts: IntArray, moments: FloatArray, times: FloatArray | None = None
    ) -> "Places":
        """Every interval in so many parts, shape (n_rows - 1,), and some moments.

        Args:
            parts: The numbers of parts.
            moments: In waypoints.
            times: Of the rows; moments of nearly one time are left out; [s].
        """
        first, last = np.cumsum(parts) - parts, float(len(parts))
        k = np.repeat(np.arange(len(parts)), parts)
        even = k + (np.arange(parts.sum()) - first[k]) / parts[k]
        inside = np.clip(moments, 0.0, last)
        found = cls(np.unique(np.concatenate([even, [last], inside])), len(parts) + 1)
        if times is None:
            return found
        apart = np.diff(found.through(times)) > SOON * (times[-1] - times[0])
        before_row = np.append(~apart & found.old[1:], False)
        alone = np.append(True, apart) & ~before_row
        return cls(found.moments[found.old | alone], found.n_rows)

    @property
    def row(self) -> IntArray:
        """The row at or before each."""
        return self.moments.astype(np.int64)

    @property
    def old(self) -> BoolArray:
        """Which of them are rows."""
        return np.asarray(self.moments == np.floor(self.moments))

    def through(self, rows: FloatArray) -> FloatArray:
        """Rows (n_rows, ..) and what lies evenly between, rows to the last bit."""
        k, after = self.row, np.minimum(self.row + 1, self.n_rows - 1)
        share = (self.moments - k).reshape(-1, *[1] * (rows.ndim - 1))
        between = (1.0 - share) * rows[k] + share * rows[after]
        return np.where(share == 0.0, rows[k], between)


@dataclass(frozen=True)
class Origins:
    """Where the rows of a motion were in the one that was given.

    Args:
        base: Joint values there, shape (n_rows, n_columns); [rad], [m].
        given: As in `Repaired`.
        fixed: Which rows stay, shape (n_rows,).
    """

    base: FloatArray
    given: IntArray
    fixed: BoolArray

    @classmethod
    def of(cls, q: FloatArray, ends: Sequence[int], pinned: Sequence[int]) -> "Origins":
        """Of the given motion.

        Raises:
            InvalidInput: If there is no such waypoint.
        """
        for k in pinned:
            if not 0 <= k < len(q):
                message = f"pinned waypoint is {k}, expected 0 to {len(q) - 1}"
                raise InvalidInput(message)
        numbers = np.arange(len(q))
        return cls(q, numbers, np.isin(numbers, [*ends, *pinned]))

    def at(self, places: Places) -> "Origins":
        """Of rows and moments between them; none of these is given."""
        given = np.where(places.old, self.given[places.row], -1)
        fixed = places.old & self.fixed[places.row]
        return Origins(places.through(self.base), given, fixed)

    def only(self, keep: BoolArray) -> "Origins":
        """Of some rows."""
        return Origins(self.base[keep], self.given[keep], self.fixed[keep])

    def too_near(
        self,
        room: FloatArray,
        margins: FloatArray,
        required: FloatArray,
        names: Sequence[str],
    ) -> BoolArray:
        """Which rows to push apart, shape (n_rows,).

        Args:
            room: Of pairs beyond what they are to get, shape (n_rows, n_pairs); [m].
            margins: What of that is more than required, shape (n_pairs,); [m].
            required: Of them, shape (n_pairs,); [m].
            names: Of the pairs.

        Raises:
            Infeasible: If a row that stays is nearer than required, or too many new
                ones are too near.
        """
        short = room + margins
        for k in np.flatnonzero(self.fixed & (short.min(axis=1) < 0.0)):
            pair, missing = int(np.argmin(short[k])), -float(short[k].min())
            nearer = f"are {MM_PER_M * missing:.3f} mm nearer than required"
            how = nearer if missing <= required[pair] else "meet"
            message = f"waypoint {self.given[k]} stays, and there {names[pair]} {how}"
            raise Infeasible(message)
        bad = (room.min(axis=1) < 0.0) & ~self.fixed
        if (new := int((bad & (self.given < 0)).sum())) > MOST:
            message = (
                f"{new} rows between waypoints are too near, "
                f"{names[int(np.argmin(room.min(axis=0)))]} most: small changes do not "
                "lead round; expected a new plan"
            )
            raise Infeasible(message)
        return np.asarray(bad)

    def kept(self, q: FloatArray, bad: BoolArray) -> BoolArray:
        """Rows that become waypoints: given, moved, and beside those to be pushed.

        Args:
            q: Before they are pushed, shape (n_rows, n_columns).
            bad: Which are pushed, shape (n_rows,).
        """
        beside = bad.copy()
        beside[1:] |= bad[:-1]
        beside[:-1] |= bad[1:]
        return np.asarray((self.given >= 0) | beside | (q != self.base).any(axis=1))


class Pushed(Protocol):
    """A motion on its way to be certified."""

    @property
    def rows(self) -> AnyMotion:
        """The motion now."""
        ...

    @property
    def origins(self) -> Origins:
        """Where its rows were."""
        ...

    def pushed(self, margins: dict[int, float], moments: FloatArray) -> Self:
        """The motion with pairs pushed apart by margins beyond what is required [m].

        Raises:
            Infeasible: If that cannot be.
        """
        ...

    def at(self, moment: float, margins: dict[int, float]) -> Place:
        """What pairs have of their margins at a moment in waypoints, and why; [m]."""
        ...


M = TypeVar("M", bound=Pushed)


def repaired(
    motion: M,
    judge: Callable[[M], V],
    margins: tuple[float, float],
    deadline: Deadline,
    under_errors: bool,
) -> Repaired[Any, V]:
    """A certified motion near a given one.

    Args:
        motion: The given one.
        judge: Verifies one.
        margins: Room beyond the required clearance that a pair gets first, and the most
            after it was doubled whenever the pair was still too near; [m].
        deadline: When to give up.
        under_errors: Whether what errors take of a clearance is kept in reserve.

    Raises:
        Infeasible: If none was found; the message says why and where.
        OutOfTime: If none was found in time.
    """
    first, widest = margins
    near, lost = dict[int, float](), dict[int, float]()
    found, settled = judge(motion), False
    for _ in range(ROUNDS):
        least = found.least
        bad = np.flatnonzero(least.verdict != CERTIFIED).tolist()
        if found.verdict is Verdict.CERTIFIED or deadline.passed:
            break
        if not bad and (settled or not near):
            break  # what is wrong is no clearance
        settled = not bad
        near |= {k: min(2.0 * near.get(k, 0.5 * first), widest) for k in bad}
        if under_errors:
            lost |= {k: _lost(least, k) for k in bad}
        wanted = {k: room + lost.get(k, 0.0) for k, room in near.items()}
        moments = least.interval[bad] + least.share[bad]
        motion = motion.pushed(wanted, moments[moments >= 0.0])
        found = judge(motion)
    if found.verdict is not Verdict.CERTIFIED:
        deadline.check()  # else what was not judged in time would be the reason
        raise Infeasible(_why(found) + _stopped(motion, found.least, near))
    moved = np.abs(motion.rows.joints - motion.origins.base).max(axis=1, initial=0.0)
    return Repaired(motion.rows, found, motion.origins.given, moved)


def _stopped(motion: Pushed, least: LeastClearances, near: dict[int, float]) -> str:
    """What stops the pair that is nearest in the last attempt; "" where none is."""
    bad = np.flatnonzero((least.verdict != CERTIFIED) & (least.interval >= 0))
    tried = [k for k in bad[np.argsort(least.upper[bad])].tolist() if k in near]
    if not tried:
        return ""
    moment = float(least.interval[tried[0]] + least.share[tried[0]])
    rows = {floor(moment), ceil(moment)}
    beside = [motion.at(float(row), near) for row in sorted(rows)]
    place, k = motion.at(moment, near), [*near].index(tried[0])
    return f": {place.names[k]} are too near, and {cause(place, k, beside)}"


def _lost(least: LeastClearances, pair: int) -> float:
    """What errors take of the clearance of a pair, about; [m]."""
    bracket = float(least.upper[pair] - least.lower[pair])
    return bracket if np.isfinite(bracket) else 0.0


def _why(found: Verification) -> str:
    """What is still wrong and where."""
    check = next(c for c in found.checks if c.verdict is not Verdict.CERTIFIED)
    where = f" ({check.where})" if check.where else ""
    when = "" if isnan(check.moment) else f" at waypoint {check.moment:.3f}"
    return (
        f"no certified motion was found: {check.name}{where} is {check.verdict.value}"
        f"{when} of the last attempt"
    )
