"""Rechecks a certificate in ball arithmetic, from the files alone.

A program of its own: it shares no code with planner, verifier and their readers, and
recomputes every claim of `docs/certificate.md`, whose symbols it uses. Every real
number is a flint ball, and comparisons of balls are true only where certain: rounding
can reject a certificate and never accept one. Links and joints count from 0 in here.

    python -m vdsm_pin.certificate_checker CERTIFICATE PROBLEM TRAJECTORY
"""

import hashlib
import sys
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from flint import arb, arb_mat, ctx

from vdsm_pin.certificate_checker.balls import (
    SLACK,
    Ball,
    Matrix,
    Rejected,
    claim,
    column,
    cross,
    dot,
    is_index,
    near,
    norm,
    number,
    require,
    turn,
    unit,
)
from vdsm_pin.certificate_checker.files import (
    Problem,
    Row,
    read_lines,
    read_rows,
    reading,
)
from vdsm_pin.certificate_checker.solids import Mesh, solid
from vdsm_pin.errors import InvalidFile

PRECISION: Final = 128  # bits of a ball: lengths are known to about 1e-35 m
TIP: Final = arb("1e-6")  # tip off the path at a row with on_path 1; [m]
AGREE: Final = arb("1e-12")  # two roundings of the same length; [m]
HEADER: Final = set(
    "vdsm_certificate problem_sha256 trajectory_sha256 urdf_sha256 versions errors "
    "required_clearance_m required_self_clearance_m n_rows n_intervals pairs sections "
    "piece_order limits tip_deviation_m coverage".split()
)


@dataclass(frozen=True)
class Outcome:
    """What a check found.

    Args:
        accepted: Whether every claim holds.
        reason: Empty, or the claim that fails with its interval and pair.
        n_intervals: Intervals found good.
        n_claims: Clearances recomputed and found good.
        surfaces: Meshes without an inside: only their surface is proved clear.
    """

    accepted: bool
    reason: str
    n_intervals: int
    n_claims: int
    surfaces: tuple[str, ...]


def _between(key: str, low: Ball, value: Ball, high: Ball) -> None:
    place = f"[{near(low)}, {near(high)}]"
    claim(low <= value <= high, f"{key} is {near(value)}, what is proved {place}")


class _Path:
    """The polyline the tip shall draw.

    Args:
        corners: Points in the base frame; [m].
        closed: Whether the last corner joins the first.
    """

    def __init__(self, corners: list[Matrix], closed: bool) -> None:
        self.closed = closed and len(corners) > 1
        self.corners = corners + corners[: int(self.closed)]
        self.stations = [arb(0)]
        for a, b in pairwise(self.corners):
            self.stations.append(self.stations[-1] + norm(b - a))
        self.doubles = [float(station) for station in self.stations]
        self.length = self.stations[-1]

    def laps(self, length: Ball) -> int:
        """Whole laps in a length; the nearest number where that is not certain."""
        laps = length / self.length if self.closed else arb(0)
        whole = laps.floor().unique_fmpz()
        return round(float(laps)) if whole is None else int(whole)

    def local(self, station: Ball) -> Ball:
        """The station within [0, length]."""
        if self.closed:
            return station - self.laps(station) * self.length
        return station.max(arb(0)).min(self.length)

    def at(self, station: Ball) -> Matrix:
        """The point of the path at a station."""
        s, last = self.local(station), len(self.corners) - 2
        if last < 0:
            return self.corners[0]
        i = max(min(bisect_right(self.doubles, float(s)) - 1, last), 0)
        while i < last and s > self.stations[i + 1]:
            i += 1
        while i > 0 and s < self.stations[i]:
            i -= 1
        a, b = self.corners[i : i + 2]
        return a + (b - a) * ((s - self.stations[i]) / norm(b - a))

    def deviation(self, start: Ball, stop: Ball, tips: Sequence[Matrix]) -> Ball:
        """Largest distance of a chord from the path between two stations."""
        low, high = start.min(stop), start.max(stop)
        worst = norm(tips[0] - self.at(start)).max(norm(tips[1] - self.at(stop)))
        for lap in range(self.laps(low), self.laps(high) + 1):
            shift = lap * self.length
            first = max(bisect_right(self.doubles, float(low - shift)) - 1, 0)
            for k in range(first, len(self.corners)):
                station = self.stations[k] + shift
                if station >= high:
                    break
                if station > low:
                    part = (station - start) / (stop - start)
                    chord = tips[0] + (tips[1] - tips[0]) * part
                    worst = worst.max(norm(chord - self.corners[k]))
        return worst

    def covered(self, stretches: list[tuple[Ball, Ball]]) -> Ball:
        """Part of the path in a union of stretches; never above the true one."""
        parts = []
        for low, high in stretches:
            start = self.local(low)
            stop = start + (high - low) if self.closed else self.local(high)
            parts += [(start, stop), (arb(0), stop - self.length)]
        total, reached = arb(0), arb(0)
        for start, stop in sorted(parts, key=lambda part: float(part[0])):
            # Only what lies beyond everything before it is added: none counts twice.
            total += (stop.min(self.length) - start.max(reached)).max(arb(0))
            reached = reached.max(stop)
        return total / self.length if self.length > 0 else arb(len(stretches) > 0)


class _Pose:
    """Link frames (the base's first), joint centres and cos psi of a configuration."""

    def __init__(self, lengths: list[Ball], joints: list[Ball]) -> None:
        self.frames, self.centres = [arb_mat(3, 3, 1)], [column(joints[0], 0, 0)]
        self.cosines: list[Ball] = []
        for i, length in enumerate(lengths):
            step = turn(2, joints[2 * i + 1]) * turn(1, joints[2 * i + 2])
            self.cosines.append(step[0, 0])
            self.frames.append(self.frames[i] * step)
            end = self.centres[i] + self.frames[i + 1] * column(length, 0, 0)
            self.centres.append(end)

    def gain(self, n: Matrix, first: int, j: int) -> Ball:
        """G_j: how fast n.O_j grows at most with the angles of joints first..j-1."""
        total = arb(0)
        for i in range(first, j):
            lever = cross(self.centres[j] - self.centres[i], n)
            for frame, axis in ((self.frames[i], 2), (self.frames[i + 1], 1)):
                total += abs(dot(column(*(frame[k, axis] for k in range(3))), lever))
        return total


class _Interval:
    """The motion between two rows, under joint errors up to E; [rad]."""

    def __init__(self, lengths: list[Ball], rows: tuple[Row, Row], error: Ball) -> None:
        self.lengths, self.rows, self.error = lengths, rows, error
        self.poses: dict[float, _Pose] = {}
        self._bends: dict[int, list[tuple[Ball, Ball, Ball]]] = {}

    def pose(self, time: float) -> _Pose:
        """The configuration at a time in [0, 1]."""
        if time not in self.poses:
            ends = zip(self.rows[0].joints, self.rows[1].joints, strict=True)
            joints = [b if time == 1.0 else a + (b - a) * time for a, b in ends]
            self.poses[time] = _Pose(self.lengths, joints)
        return self.poses[time]

    def bends(self, first: int) -> list[tuple[Ball, Ball, Ball]]:
        """M_j, D_j and the second order in E, by j, of a chain from joint first on."""
        if first not in self._bends:
            a, b = (row.joints for row in self.rows)
            rate = bend = drift = second = arb(0)
            found = [(bend, drift, second)] * (first + 1)
            for i in range(first, len(self.lengths)):
                length, angles = self.lengths[i], 2 * (i - first + 1)
                for q in (2 * i + 1, 2 * i + 2):
                    rate += abs(b[q] - a[q])
                bend += length * rate * rate
                drift += angles * length * rate
                second += length * (angles * self.error) ** 2 / 2
                found.append((bend, drift, second))
            self._bends[first] = found
        return self._bends[first]

    def top(self, j: int, first: int, times: Sequence[float], ns: list[Matrix]) -> Ball:
        """Largest n.O_j over a slice and all joint errors.

        Args:
            j: The joint centre.
            first: First joint that may move it; O_j counts from the joint before.
            times: Start and end of the slice.
            ns: n at both in the base frame.
        """
        bend, drift, second = self.bends(first)[j]
        size, heights, gain = arb(times[1]) - arb(times[0]), [], arb(0)
        for time, n in zip(times, ns, strict=True):
            pose = self.pose(time)
            origin = pose.centres[first - 1] if first else column(0, 0, 0)
            heights.append(dot(n, pose.centres[j] - origin))
            if self.error > 0:
                gain += pose.gain(n, first, j) / 2
        growth = self.error * (gain + size * drift / 2) + second
        return heights[0].max(heights[1]) + bend * size * size / 8 + growth


class _Check:
    """One run of the checker: header, intervals in order, closing claims."""

    def __init__(self, problem: Problem) -> None:
        self.problem, self.n_intervals, self.n_claims = problem, 0, 0
        self.solids = [solid(*item) for item in problem.shapes.items()]
        self.path = _Path(problem.path, problem.closed)
        self.pose: _Pose | None = None  # of the last row
        self.alpha = self.theta = self.tip = arb(0)
        self.cosine, self.low, self.high = arb(1), arb("inf"), arb("-inf")
        self.station: Ball = None  # of the last row while the tip is on the path
        self.stretches: list[tuple[Ball, Ball]] = []

    def run(self, certificate: Path, trajectory: Path) -> None:
        """Check everything, line by line and row by row."""
        with reading(trajectory), trajectory.open("rb") as file:
            sha256 = hashlib.file_digest(file, "sha256").hexdigest()
        lines = read_lines(certificate)
        with reading(certificate, "line 1"):
            self._header(next(lines, {}), sha256)
        rows = read_rows(trajectory, len(self.problem.lengths))
        start, n_rows = next(rows, None), 1
        if start is None:
            raise InvalidFile(file=trajectory, problem="has no row")
        stop: Row | None = next(rows, start)  # a single row stands still
        for k, line in enumerate(lines):
            if stop is None:
                message = f"interval {k} lies beyond the last row"
                raise Rejected(message)
            with reading(certificate, f"line {k + 2}"):
                self._interval(k, line, (start, stop))
            self.n_intervals += 1
            n_rows += stop is not start
            start, stop = stop, next(rows, None)
        claim(stop is None, f"interval {self.n_intervals} is missing")
        counts = {"n_rows": n_rows, "n_intervals": self.n_intervals}
        stated = {key: self.header[key] for key in counts}
        claim(stated == counts, f"the header counts {stated}, the files {counts}")
        with reading(certificate, "line 1"):
            self._close()

    def _header(self, header: dict[str, Any], trajectory_sha256: str) -> None:
        require(set(header) == HEADER, f"expected the keys {sorted(HEADER)}")
        self.header, self.errors = header, {}
        claim(header["vdsm_certificate"] == 1, "unknown version")
        same = header["trajectory_sha256"] == trajectory_sha256
        claim(same, "the certificate is of another trajectory file")
        same = header["problem_sha256"] == self.problem.sha256
        claim(same, "the certificate is of another problem file")
        for key in ("required_clearance_m", "required_self_clearance_m"):
            wanted = getattr(self.problem, key.removeprefix("required_")[:-2])
            claim(abs(number(header[key]) - wanted) <= AGREE, f"{key} is another")
        for key in ("joint_rad", "base_m", "obstacle_m"):
            self.errors[key] = number(header["errors"][key])
            claim(self.errors[key] >= 0, f"{key} is negative")
        require(len(header["errors"]) == 3, "errors: expected three keys")
        known = {solid.name: solid for solid in self.solids}
        for name, loops in header["sections"].items():
            known[name].cut(loops)
        for name, order in header["piece_order"].items():
            numbers = range(known[name].count)
            good = all(is_index(k, numbers) for k in order)
            claim(good and sorted(order) == [*numbers], f"piece_order of {name}")
            known[name].reorder(order)
        self._pairs(header["pairs"])

    def _pairs(self, stated: list[dict[str, Any]]) -> None:
        links, expected = range(len(self.problem.lengths)), []
        self.pairs: list[tuple[int, Any]] = []
        self.pairs += [(i, solid) for solid in self.solids for i in links]
        self.pairs += [(i, k) for i in links for k in links[i + 2 :]]
        for i, other in self.pairs:
            if isinstance(other, int):
                expected.append({"link": i + 1, "other_link": other + 1})
            else:
                name, count = other.name, other.count
                expected.append({"link": i + 1, "obstacle": name, "pieces": count})
        claim(stated == expected, "the pairs are not those of the problem, in order")

    def _interval(self, k: int, line: dict[str, Any], rows: tuple[Row, Row]) -> None:
        require(set(line) == {"k", "proofs"}, "expected the keys k and proofs")
        claim(is_index(line["k"], [k]), f"interval {k} is missing")
        n_pairs, proofs = len(self.pairs), line["proofs"]
        claim(len(proofs) == n_pairs, f"interval {k}: {len(proofs)} of {n_pairs} pairs")
        motion = _Interval(self.problem.lengths, rows, self.errors["joint_rad"])
        if self.pose:
            motion.poses[0.0] = self.pose
        place = ""
        try:
            for pair, proof in zip(self.pairs, proofs, strict=True):
                other = pair[1] + 1 if isinstance(pair[1], int) else pair[1].name
                place = f"interval {k}, link {pair[0] + 1} and {other}"
                self._proof(motion, pair, proof)
            place = f"interval {k}"
            self._rows(motion)
        except Rejected as error:
            raise error.at(place) from None

    def _proof(self, motion: _Interval, pair: tuple[int, Any], proof: Any) -> None:
        time, size = 0.0, 1 if isinstance(pair[1], int) else pair[1].count
        for start, stop, planes in proof:
            times, reached = (float(number(start)), float(number(stop))), 0
            claim(times[0] == time < times[1], f"the slices do not tile at {time}")
            for first, last, x, y, z, lower in planes:
                claim(is_index(first, [reached]), f"no plane for piece {reached}")
                claim(is_index(last, range(first + 1, size + 1)), "an empty range")
                n = unit(column(number(x), number(y), number(z)))
                self._clear(motion, pair, (times, first, last), n, number(lower))
                reached = last
            claim(reached == size, f"the ranges end at {reached} of {size}")
            time = times[1]
        claim(time == 1.0, f"the slices end at {time}")

    def _clear(
        self, motion: _Interval, pair: Any, slab: Any, n: Matrix, lower: Ball
    ) -> None:
        """Check that one plane proves its clearance, no less and not much more."""
        (i, other), (times, *pieces), radius = pair, slab, self.problem.radius
        if isinstance(other, int):
            required, first, link = self.problem.self_clearance, i + 1, other
            ns = [motion.pose(time).frames[i + 1] * -n for time in times]
            proved = -(self.problem.lengths[i] * n[0, 0]).max(arb(0)) - 2 * radius
        else:
            required, first, link = self.problem.clearance, 0, i
            n = other.direction(n)
            ns = [n, n]
            proved = other.support(n, *pieces) - radius - self.errors["obstacle_m"]
            proved -= self.errors["base_m"] * abs(n[0, 0])
        tops = [motion.top(j, first, times, ns) for j in (link, link + 1)]
        proved -= tops[0].max(tops[1])
        claim(lower <= proved, f"claims {near(lower)} m, proves {near(proved)} m")
        claim(proved - lower <= SLACK, f"claims less than it proves, {near(proved)} m")
        claim(lower >= required, f"{near(lower)} m is below the required clearance")
        self.n_claims += 1

    def _rows(self, motion: _Interval) -> None:
        """Take the rows' joint values and tips into the closing claims."""
        ends = [(motion.rows[k], motion.pose(float(k))) for k in (0, 1)]
        for row, pose in ends if self.pose is None else ends[1:]:
            self.alpha = reduce(arb.max, map(abs, row.joints[1::2]), self.alpha)
            self.theta = reduce(arb.max, map(abs, row.joints[2::2]), self.theta)
            self.cosine = reduce(arb.min, pose.cosines, self.cosine)
            self.low = self.low.min(row.joints[0])
            self.high = self.high.max(row.joints[0])
            away = norm(pose.centres[-1] - self.path.at(row.path_m))
            claim(not row.on_path or away <= TIP, f"tip {near(away)} m off the path")
        for mesh in self.solids if self.pose is None else ():
            outside = not isinstance(mesh, Mesh) or mesh.excludes(ends[0][1].centres[0])
            claim(outside, f"the arm is not proved outside {mesh.name}")
        self.pose = ends[1][1]
        if all(row.on_path for row in motion.rows):
            self._draw(motion, [pose.centres[-1] for _, pose in ends])
        else:
            self.station = None

    def _draw(self, motion: _Interval, tips: list[Matrix]) -> None:
        """Take an interval on the path into tip deviation and coverage."""
        path, rows = self.path, motion.rows
        stations = [r.path_m if path.closed else path.local(r.path_m) for r in rows]
        if self.station is None:
            self.station = stations[0]
            self.stretches.append((self.station, self.station))
        start, step = self.station, stations[1] - stations[0]
        self.station = start + step - path.laps(step + path.length / 2) * path.length
        chord = path.deviation(start, self.station, tips)
        self.tip = self.tip.max(chord + motion.bends(0)[-1][0] / 8)
        low, high = self.stretches[-1]
        self.stretches[-1] = low.min(self.station), high.max(self.station)

    def _close(self) -> None:
        """Check the claims about the whole motion."""
        problem, stated = self.problem, self.header["limits"]
        psi, tip = number(stated["psi_rad"]), number(self.header["tip_deviation_m"])
        require(len(stated) == 5, "limits: expected five keys")
        for key, bound, limit, way in (
            ("alpha_rad", self.alpha, problem.box, 1),
            ("theta_rad", self.theta, problem.box, 1),
            ("x0_max_m", self.high, problem.rail[1], 1),
            ("x0_min_m", -self.low, -problem.rail[0], -1),
        ):
            _between(key, bound, number(stated[key]) * way, bound + SLACK)
            claim(bound <= limit + SLACK, f"{key}: {near(bound)} passes {near(limit)}")
        high = 0 <= psi < arb.pi() and psi.cos() <= self.cosine
        tight = psi <= SLACK or (psi - SLACK).cos() >= self.cosine
        claim(high and tight, f"psi_rad is {near(psi)}, cos {near(self.cosine)} proved")
        claim((problem.cone + SLACK).cos() <= self.cosine, "psi_rad passes its limit")
        _between("tip_deviation_m", self.tip, tip, self.tip + SLACK)
        covered, part = (
            self.path.covered(self.stretches),
            number(self.header["coverage"]),
        )
        _between("coverage", covered - SLACK, part, covered)
        claim(part >= problem.coverage - SLACK, "less than the required coverage")


def check_certificate(certificate: Path, problem: Path, trajectory: Path) -> Outcome:
    """Recompute every claim of a certificate.

    Args:
        certificate: The certificate.
        problem: The problem file it is about.
        trajectory: The trajectory file it is about.

    Returns:
        Whether it is accepted, else why not.

    Raises:
        InvalidFile: If one of the files is not what its format says.
    """
    with ctx.workprec(PRECISION):
        with reading(problem):
            check, reason = _Check(Problem(problem)), ""
        try:
            check.run(certificate, trajectory)
        except Rejected as error:
            reason = str(error)
        meshes = [mesh for mesh in check.solids if isinstance(mesh, Mesh)]
        surfaces = tuple(mesh.name for mesh in meshes if not mesh.has_inside)
        counts = check.n_intervals, check.n_claims
        return Outcome(not reason, reason, *counts, surfaces)


def main(arguments: Sequence[str]) -> int:
    """Check one certificate and say the outcome in one line.

    Returns:
        0 accepted, 1 rejected, 2 unreadable or wrong usage.
    """
    if len(arguments) != 3:
        sys.stderr.write("usage: check-certificate CERTIFICATE PROBLEM TRAJECTORY\n")
        return 2
    try:
        outcome = check_certificate(*map(Path, arguments))
    except InvalidFile as error:
        sys.stderr.write(f"{error}\n")
        return 2
    found = f"{outcome.n_intervals} intervals, {outcome.n_claims} clearances"
    verdict = "accepted" if outcome.accepted else f"rejected: {outcome.reason}"
    notes = "".join(f"; {name} is a surface only" for name in outcome.surfaces)
    sys.stdout.write(f"{verdict} ({found} recomputed{notes})\n")
    return 0 if outcome.accepted else 1
