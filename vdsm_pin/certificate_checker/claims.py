"""Every clearance of a certificate, recomputed (docs/certificate.md)."""

from collections import defaultdict
from collections.abc import Iterator, Sequence
from typing import Any, Final, NamedTuple

import numpy as np

from vdsm_pin.certificate_checker.balls import MM, claim, number
from vdsm_pin.certificate_checker.motion import Interval, Path, Slice, Slices
from vdsm_pin.certificate_checker.solids import Pair
from vdsm_pin.certificate_checker.tree import Pose, Tree

PER_METRE: Final = 10**10  # a clearance that is whole counts these parts of a metre
AT_ONCE: Final = 4_096  # planes
FALSE: Final = "claims {} mm, proves {} mm, required are {} mm"
ROOM: Final = 2**20  # heights worked out at once


class Plane(NamedTuple):
    """A plane of a line: where, over what, for which pieces, normal and clearance."""

    place: str
    slice: Slice
    first: int
    last: int
    n: tuple[float, float, float]
    lower: float


class Clearances:
    """The lines of a certificate against what the files ask about.

    Args:
        tree: The joints, with their errors.
        path: How they move.
        pairs: What is held apart, in order.
    """

    def __init__(self, tree: Tree, path: Path, pairs: Sequence[Pair]) -> None:
        self.tree, self.path, self.pairs = tree, path, pairs
        self.place, self.n_intervals = "after the header", 0
        self.n_claims = self.n_settled = 0
        self.waiting = defaultdict[Pair, list[Plane]](list)

    def check(self, lines: Iterator[dict[str, Any]]) -> tuple[Pose, set[Pair]]:
        """Check them; planes in good order are looked at many at a time.

        Returns:
            The pose as the motion begins, and the pairs that planes for single pieces
            hold apart: only their bodies may begin inside of a mesh.

        Raises:
            Rejected: At the first claim that does not hold; `place` says where.
        """
        first = before = Interval(self.tree, self.path.controls(0)).pose(0.0)
        by_pieces = set[Pair]()
        for k, line in enumerate(lines):
            self.place = f"interval {k}"
            claim(k < self.path.size, "lies beyond the last row")
            claim(set(line) == {"k", "proofs"} and line["k"] == k, "is missing")
            motion = Interval(self.tree, self.path.controls(k), before)
            found, expected = len(line["proofs"]), len(self.pairs)
            claim(found == expected, f"{found} of {expected} pairs")
            for pair, proof in zip(self.pairs, line["proofs"], strict=True):
                self.place = f"interval {k}, {' and '.join(pair.names)}"
                planes = [*tiled(pair, proof, self.place, motion)]
                if any(x.last < len(pair.partner.solid.points) for x in planes):
                    by_pieces.add(pair)
                self.waiting[pair] += planes
                self.n_claims += len(planes)
            if self.n_claims - self.n_settled > AT_ONCE:
                self._settle()
            self.n_intervals, self.place = k + 1, f"after interval {k}"
            before = motion.pose(1.0)
        last = self.n_intervals == self.path.size
        claim(last, f"interval {self.n_intervals} is missing")
        self._settle()
        return first, by_pieces

    def _settle(self) -> None:
        """Check the planes that wait."""
        every = dict.fromkeys(x.slice for some in self.waiting.values() for x in some)
        slices = Slices(self.tree, [*every])
        for pair, planes in self.waiting.items():
            few = max(1, ROOM // len(pair.body.solid.levers))
            for i in range(0, len(planes), few):
                some = planes[i : i + few]
                proved = clearances(pair, some, slices).tolist()
                for plane, found in zip(some, proved, strict=True):
                    self.place, least = plane.place, pair.required
                    told = [MM * x for x in (plane.lower, found, least)]
                    claim(least <= plane.lower <= found, FALSE, *told)
        self.waiting, self.n_settled = defaultdict(list), self.n_claims


def tiled(pair: Pair, proof: Any, place: str, motion: Interval) -> Iterator[Plane]:
    """The planes of one pair over one interval; its slices and pieces are tiled.

    Raises:
        Rejected: If they are not.
    """
    time, size = 0.0, len(pair.partner.solid.points)
    for start, stop, planes in proof:
        claim(start == time < stop, f"the slices do not tile at {time}")
        slice_, reached = (motion, time, float(stop)), 0
        for first, last, *plane in planes:
            good = first == reached < last <= size
            claim(good, f"the pieces do not tile at {reached} of {size}")
            x, y, z, lower = map(number, plane)
            lower = lower / PER_METRE if type(plane[3]) is int else lower
            yield Plane(place, slice_, reached, last, (x, y, z), lower)
            reached = last
        claim(reached == size, f"the pieces end at {reached} of {size}")
        time = slice_[2]
    claim(time == 1.0, f"the slices end at {time}")


def clearances(pair: Pair, planes: Sequence[Plane], slices: Slices) -> Any:
    """What planes of a pair prove, shape (m,); [m].

    Doubles are off by 2^-53 a step, and no height takes more steps than are counted.
    """
    n, body = np.array([plane.n for plane in planes]), pair.body
    rest, solid, off = pair.partner
    lengths = np.linalg.norm(n, axis=1)[:, None]
    claim(((lengths > 1e-100) & (lengths < 1e100)).all(), "a direction has no length")
    n /= lengths
    if solid.normal is not None:  # a half-space has only one
        near = (np.abs(n + solid.normal) <= 1e-9).all()
        claim(near, "n is not the half-space's -normal")
        n[:] = -solid.normal
    at = [slices.numbers[plane.slice] for plane in planes]
    reached, size = slices.reach(body, rest, at, n)
    begins = [solid.support(d, x.first, x.last) for d, x in zip(n, planes, strict=True)]
    lost = body.solid.radius + off + slices.tree.slip(rest, body.frame)
    steps = 64 + 8 * len(slices.tree.joints)
    rounding = steps * 2.0**-53 * (size + solid.extent + lost)
    return np.array(begins) - reached - lost - rounding
