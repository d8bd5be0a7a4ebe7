"""Motions of a tree: knots, joined by straight lines or by smooth pieces.

What moves by itself has knots of its own in time: `together` joins such paths at the
union of their knots.
"""

from dataclasses import dataclass, field

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, freeze, frozen, same_arrays
from vdsm_pin.geometry.bernstein import hermite, part, raised, value
from vdsm_pin.proof.motions import Motion


@dataclass(frozen=True)
class Path:
    """Knots q, and control points between them (polynomials in Bernstein form).

    Args:
        knots: Shape (n_rows, n_columns), at least one row; [rad], [m].
        inner: Control points between two knots, shape (n_rows - 1, degree - 1,
            n_columns); none for straight lines.
        times: Of the knots, rising, shape (n_rows,); [s]. None where not known.

    Raises:
        ValueError: If shapes disagree, a value is not finite, times do not rise, or the
            degree is not 1, 3 or 5.
    """

    knots: FloatArray
    inner: FloatArray = field(default_factory=lambda: np.zeros((0, 0, 0)))
    times: FloatArray | None = None

    def __post_init__(self) -> None:
        """Freeze the arrays and check their shapes."""
        freeze(self, "knots", "inner", "times")
        knots, inner = self.knots, self.inner
        if knots.ndim != 2 or not len(knots):
            message = f"knots have shape {knots.shape}, expected (n_rows, n_columns)"
            raise ValueError(message)
        if inner.size == 0:
            inner = frozen(np.zeros((0, 0, knots.shape[1])))
        elif inner.shape not in [(len(knots) - 1, d, knots.shape[1]) for d in (2, 4)]:
            message = (
                f"control points have shape {inner.shape}, "
                f"expected ({len(knots) - 1}, 2 or 4, {knots.shape[1]})"
            )
            raise ValueError(message)
        if not (np.isfinite(knots).all() and np.isfinite(inner).all()):
            message = "a path has a value that is not finite"
            raise ValueError(message)
        if self.times is not None:
            _check_rising(self.times, len(knots))
        object.__setattr__(self, "inner", inner)

    @classmethod
    def through(
        cls,
        knots: FloatArray,
        times: FloatArray | None,
        rates: FloatArray | None = None,
        changes: FloatArray | None = None,
    ) -> "Path":
        """Straight lines, or Hermite pieces as trajectory controllers run them.

        Args:
            knots: Shape (n_rows, n_columns); [rad], [m].
            times: Of the knots, rising, shape (n_rows,); [s]. None where not known.
            rates: Of the knots, which makes pieces cubic where times are known; the
                same shape; per [s].
            changes: Of the rates, which makes them quintic; the same shape; per [s^2].

        Raises:
            ValueError: If shapes disagree or times do not rise.
        """
        if times is None or rates is None:
            return cls(knots, times=times)
        knots, times = frozen(knots), frozen(times)
        given = {"rates": rates, "accelerations": changes}
        more = {k: frozen(v) for k, v in given.items() if v is not None}
        for name, values in more.items():
            if values.shape != knots.shape:
                message = f"{name} have shape {values.shape}, expected {knots.shape}"
                raise ValueError(message)
        _check_rising(times, len(knots))
        inner = hermite(knots, more["rates"], more.get("accelerations"), times)
        return cls(knots, inner, times)

    @property
    def degree(self) -> int:
        """Of the pieces: 1, 3 or 5."""
        return int(self.inner.shape[1]) + 1

    @property
    def controls(self) -> FloatArray:
        """All control points, shape (n_rows - 1, degree + 1, n_columns)."""
        return self.pieces(np.arange(len(self.knots) - 1))

    def pieces(self, k: IntArray) -> FloatArray:
        """The same of some pieces (m,), shape (m, degree + 1, n_columns)."""
        ends = self.knots[k, None], self.knots[k + 1, None]
        inner = self.inner[k] if self.inner.size else ends[0][:, :0]
        return np.concatenate([ends[0], inner, ends[1]], axis=1)

    @property
    def n_intervals(self) -> int:
        """Number of pieces; a single row counts as one at rest."""
        return max(1, len(self.knots) - 1)

    @property
    def n_samples(self) -> int:
        """Number of knots."""
        return len(self.knots)

    def times_at(self, moments: FloatArray) -> FloatArray | None:
        """Times of moments in knots, shape (m,); [s]. None where not known."""
        if self.times is None:
            return None
        return np.interp(moments, np.arange(self.n_samples), self.times)

    @property
    def reach(self) -> FloatArray:
        """How large each column gets at most, shape (n_columns,)."""
        most = np.maximum(self.knots.max(axis=0), -self.knots.min(axis=0))
        if self.inner.size:
            most = np.maximum(most, np.abs(self.inner).max(axis=(0, 1)))
        return np.asarray(most)

    @property
    def own_times(self) -> FloatArray:
        """Times of the knots, shape (n_rows,); [s].

        Raises:
            ValueError: If it has none.
        """
        if self.times is None:
            message = "paths that move at once need times"
            raise ValueError(message)
        return self.times

    def at(self, times: FloatArray) -> FloatArray:
        """Rows of q at some times (m,), at rest outside of its own, (m, n_columns)."""
        own, times = self.own_times, np.asarray(times, dtype=np.float64)
        if len(own) == 1:
            return self.within(np.zeros(len(times), np.int64), times)
        inside = np.clip(times, own[0], own[-1])
        k = np.clip(np.searchsorted(own, inside, side="right") - 1, 0, len(own) - 2)
        share = (inside - own[k]) / (own[k + 1] - own[k])
        return self.within(k, share)

    def within(self, intervals: IntArray, shares: FloatArray) -> FloatArray:
        """Rows of q at shares, 0 to 1, of intervals, both (m,): (m, n_columns)."""
        if len(self.knots) == 1:
            return np.repeat(self.knots, len(intervals), axis=0)
        found = value(self.pieces(intervals), shares)
        at_end = shares == 1.0
        found[at_end] = self.knots[intervals[at_end] + 1]
        return found

    def split(self, moments: FloatArray) -> tuple[IntArray, FloatArray]:
        """Intervals of moments in knots, (m,), and their shares of them, 0 to 1."""
        intervals = np.minimum(moments.astype(np.int64), self.n_intervals - 1)
        return intervals, moments - intervals

    def at_moments(self, moments: FloatArray) -> FloatArray:
        """Rows of q at moments in knots, shape (m,): (m, n_columns)."""
        return self.within(*self.split(moments))

    def cut(self, counts: IntArray) -> "Path":
        """The same motion with each interval in equal parts; new knots are rounded.

        Args:
            counts: Of the parts of each, shape (n_rows - 1,).
        """
        k = np.repeat(np.arange(len(counts)), counts)
        place = np.arange(len(k)) - (np.cumsum(counts) - counts)[k]
        low, high = place / counts[k], (place + 1) / counts[k]
        controls = part(self.pieces(k), low, high)
        knots = np.concatenate([controls[:, 0], self.knots[-1:]])
        knots[:-1][place == 0] = self.knots[:-1]
        moments = np.append(k + low, float(len(counts)))
        return Path(knots, controls[:, 1:-1], self.times_at(moments))

    def same_as(self, other: "Path") -> bool:
        """Whether all numbers are the same."""
        return same_arrays(self, other, ("knots", "inner", "times"))

    def packed(self) -> Motion:
        """The same for compiled code."""
        return Motion(self.knots, self.inner)


def _check_rising(times: FloatArray, n_rows: int) -> None:
    """Check the times of so many rows.

    Raises:
        ValueError: If they do not rise, or there are more or fewer.
    """
    if times.shape != (n_rows,) or not np.isfinite(times).all():
        message = f"times have shape {times.shape}, expected ({n_rows},), all finite"
        raise ValueError(message)
    if not (np.diff(times) > 0.0).all():
        message = "times must rise from knot to knot"
        raise ValueError(message)


def _resampled(path: Path, times: FloatArray, degree: int) -> FloatArray:
    """Control points of a path between given times, at rest outside of its own."""
    own, pieces = path.own_times, raised(path.controls, degree)
    at = np.searchsorted(own, times[:-1], side="right") - 1
    inside = (at >= 0) & (at < len(own) - 1)
    rest = path.knots[np.clip(at, 0, len(own) - 1)]
    found = np.repeat(rest[:, None], degree + 1, axis=1)
    if not inside.any():
        return found
    k, start, end = at[inside], times[:-1][inside], times[1:][inside]
    found[inside] = pieces[k]
    cut = (own[k] != start) | (own[k + 1] != end)
    step = own[k + 1] - own[k]
    low, high = (start - own[k]) / step, np.minimum(1.0, (end - own[k]) / step)
    found[np.flatnonzero(inside)[cut]] = part(pieces[k[cut]], low[cut], high[cut])
    return found


def together(*paths: Path, within: tuple[float, float] | None = None) -> Path:
    """One path of several that move at once: their columns side by side.

    It has the knots of all. Each rests before its first knot and after its last. Knots
    that are put in are off the path by a rounding.

    Args:
        paths: Each with times.
        within: When the whole begins and ends; where not given, with the first knot and
            the last; [s].

    Raises:
        ValueError: If one has no times.
    """
    times = np.unique(np.concatenate([path.own_times for path in paths]))
    if within is not None:
        inside = times[(times > within[0]) & (times < within[1])]
        times = np.unique(np.concatenate([within[:1], inside, within[1:]]))
    if len(times) == 1:
        return Path(np.hstack([path.at(times) for path in paths]), times=times)
    degree = max(path.degree for path in paths)
    controls = np.concatenate([_resampled(p, times, degree) for p in paths], axis=2)
    knots = np.concatenate([controls[:, 0], controls[-1:, -1]])
    return Path(knots, controls[:, 1:-1], times)
