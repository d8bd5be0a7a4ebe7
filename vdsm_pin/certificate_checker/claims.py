"""Every claim of a certificate, recomputed in ball arithmetic.

In the symbols of `docs/certificate.md`: the header and the pairs, then each line, then
what is said of the whole motion.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np

from vdsm_pin.certificate_checker.arm import Arm
from vdsm_pin.certificate_checker.balls import MM, SLACK, claim, column, number, unit
from vdsm_pin.certificate_checker.motion import Interval
from vdsm_pin.certificate_checker.rows import Rows
from vdsm_pin.certificate_checker.solids import Mesh, Pair
from vdsm_pin.certificate_checker.tree import Pose, Tree
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory

PER_METRE: Final = 10**10  # a clearance that is whole counts these parts of a metre
KEYS: Final = set(
    "vdsm_certificate problem_sha256 trajectory_sha256 urdf_sha256 versions n_rows "
    "interpolation required_clearance_m required_self_clearance_m errors pairs pieces "
    "joined limits tip_deviation_m coverage".split()
)


class Check:
    """One run of the checker.

    Args:
        problem: As it was read.
        trajectory: As it was read.
        hashes: SHA-256 of the two files, by the keys of the header.
    """

    def __init__(
        self,
        problem: PlanningProblem,
        trajectory: Trajectory,
        hashes: Mapping[str, str],
    ) -> None:
        self.problem, self.hashes = problem, hashes
        self.n_rows, self.place = trajectory.n_samples, "header"
        self.smooth = trajectory.interpolation
        self.arm = Arm(problem, trajectory)
        self.rows = Rows(self.arm, trajectory)
        self.meshes = {s.name: s for s in self.arm.solids if isinstance(s, Mesh)}
        self.motion: Interval  # the last one read
        self.first: Pose  # as the motion begins
        self.n_intervals = self.n_claims = 0

    def run(self, header: dict[str, Any], lines: Iterator[dict[str, Any]]) -> None:
        """Check everything, line by line.

        Raises:
            Rejected: At the first claim that does not hold; `place` says where.
        """
        self._header(header)
        self.place, expected = "after the header", self.arm.path.size
        for k, line in enumerate(lines):
            self.place = f"interval {k}"
            claim(k < expected, "lies beyond the last row")
            self._interval(k, line)
            self.n_intervals += 1
            self.place = f"after interval {k}"
        claim(self.n_intervals == expected, f"interval {self.n_intervals} is missing")
        self.place = "header"
        self._outside()
        self.rows.close(header)

    def _header(self, header: dict[str, Any]) -> None:
        claim(set(header) == KEYS, f"has other keys than {sorted(KEYS)}")
        for key, sha256 in self.hashes.items():
            kind = key.removesuffix("_sha256")
            claim(header[key] == sha256, f"the certificate is of another {kind} file")
        for key, value in (
            ("n_rows", self.n_rows),
            ("required_clearance_m", self.problem.required_clearance),
            ("required_self_clearance_m", self.problem.required_self_clearance),
        ):
            claim(header[key] == value, f"{key} is {header[key]}, not {value}")
        self.arm.take_errors(header["errors"])
        self.arm.pair_up(dict(header["pieces"]))
        for name, (corners, seams) in header["joined"].items():
            claim(name in self.meshes, f"{name} is no mesh: nothing is joined")
            self.meshes[name].surface.join(corners, seams)
        expected = [pair.names for pair in self.arm.pairs]
        claim(header["pairs"] == expected, "the pairs are not those of the problem")

    def _interval(self, k: int, line: dict[str, Any]) -> None:
        claim(set(line) == {"k", "proofs"} and line["k"] == k, "is missing")
        before = self.motion.pose(1.0) if k > 0 else None
        motion = Interval(self.arm.tree, self.arm.path.controls(k), before)
        self.motion = motion
        self.first = motion.pose(0.0) if k == 0 else self.first
        here, proofs, pairs = self.place, line["proofs"], self.arm.pairs
        claim(len(proofs) == len(pairs), f"{len(proofs)} of {len(pairs)} pairs")
        for pair, proof in zip(pairs, proofs, strict=True):
            self.place = f"{here}, {' and '.join(pair.names)}"
            self.n_claims += check_proof(pair, proof, motion)
        self.place, path = here, self.arm.path
        own, (begin, end) = path.branches[0], path.ends(k)
        row = int(np.searchsorted(own.times, end))
        last = max(0, row - 1)
        if own.times[row] == end:  # a row, and not a knot of what moves beside
            if own.times[last] != begin:
                tree = Tree(self.arm.tree.joints[: self.arm.n_own])
                motion = Interval(tree, own.controls(last))
            self.rows.take((last, row), motion)

    def _outside(self) -> None:
        """Check that the arm is clear of a mesh's hull, or begins outside.

        A body never meets the mesh's triangles, so one point of it decides; that at O_1
        for links, tool and feed where all of them are held off the mesh.
        """
        own = [body for body in self.arm.bodies if body.own]
        thinnest = min(float(body.solid.radius) for body in own)
        for mesh in self.meshes.values():
            if mesh.surface_only or mesh.whole:
                continue
            mine = [pair.body for pair in self.arm.pairs if pair.solid is mesh]
            points = []
            if all(body in mine for body in own):
                points = [(1, column(0, 0, 0), thinnest)]
                mine = [body for body in mine if not body.own]
            for body in mine:
                middle = column(*body.solid.points[0].mean(axis=0).tolist())
                kept = float(body.solid.radius) + self.problem.required_clearance
                points.append((body.frame, middle, kept))
            for frame, at, radius in points:
                point = self._at_first(frame, at, mesh)
                why = mesh.surface.not_outside(point, radius)
                claim(not why, f"the arm is not proved outside {mesh.name}: {why}")

    def _at_first(self, frame: int, at: Any, mesh: Mesh) -> list[float]:
        """A point of a frame in that of a mesh, as the motion begins."""
        rest = self.arm.frames[self.arm.solids.index(mesh)]
        (origin, turned), (zero, axes) = self.first[frame], self.first[rest]
        seen = axes.transpose() * (origin + turned * at - zero)
        return [float(x) for x in seen.entries()]


def check_proof(pair: Pair, proof: Any, motion: Interval) -> int:
    """Check one pair over one interval; its slices and pieces are tiled.

    Returns:
        Number of clearances found good.

    Raises:
        Rejected: At the first claim that does not hold.
    """
    time, size, count = 0.0, len(pair.solid.points), 0
    for start, stop, planes in proof:
        claim(start == time < stop, f"the slices do not tile at {time}")
        times, reached = (time, float(stop)), 0
        for first, last, *plane in planes:
            good = first == reached < last <= size
            claim(good, f"the pieces do not tile at {reached} of {size}")
            _check_plane(pair, times, (first, last), plane, motion)
            reached, count = last, count + 1
        claim(reached == size, f"the pieces end at {reached} of {size}")
        pair.solid.whole &= len(planes) == 1
        time = times[1]
    claim(time == 1.0, f"the slices end at {time}")
    return count


def _check_plane(
    pair: Pair, times: Any, pieces: Any, plane: Sequence[Any], motion: Interval
) -> None:
    """Check that a plane proves what it claims, not much more, and enough."""
    x, y, z, lower = map(number, plane)
    lower = lower / PER_METRE if type(plane[3]) is int else lower
    n = pair.solid.direction(unit(column(x, y, z)))
    reach = motion.reach(pair.body, pair.rest, times, n)
    proved = pair.solid.support(n, *pieces) - reach - pair.lost
    holds = pair.required <= lower <= proved <= lower + SLACK
    values = [MM * length for length in (lower, proved, pair.required)]
    claim(holds, "claims {} mm, proves {} mm, required are {} mm", *values)
