"""Every claim of a certificate, recomputed in ball arithmetic.

In the symbols of `docs/certificate.md`: the hashes and the pairs (`_header`), how time
and pieces are tiled (`_proof`), each clearance (`_clear`), the rows (`_rows`) and what
is said of the whole motion (`_close`). Links count from 0 in here.
"""

from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple

import numpy as np
from flint import arb

from vdsm_pin.certificate_checker.balls import Matrix, claim, column, norm, number, unit
from vdsm_pin.certificate_checker.motion import Interval
from vdsm_pin.certificate_checker.path import Drawing
from vdsm_pin.certificate_checker.solids import Mesh, Solid, solid
from vdsm_pin.problem import Order, PlanningProblem, Posture
from vdsm_pin.trajectory import Trajectory

VERSION: Final = 3
MM: Final = 1000  # messages tell lengths in millimetres
SLACK: Final = 1e-9  # claims may understate by this, limits be passed; [m], [rad], [-]
KEYS: Final = set(
    "vdsm_certificate problem_sha256 trajectory_sha256 urdf_sha256 versions n_rows "
    "required_clearance_m required_self_clearance_m errors pairs pieces joined limits "
    "tip_deviation_m coverage".split()
)
ERRORS: Final = "joint_rad", "base_m", "obstacle_m"
LIMITS: Final = "alpha_rad", "theta_rad", "psi_rad", "x0_min_m", "x0_max_m"


class Body(NamedTuple):
    """A link or the tool: what lies within a radius of [start, end] along a link."""

    name: str
    link: int
    start: float
    end: float
    radius: float


class Pair(NamedTuple):
    """A body and a solid that rests in the base frame, or in that of link first - 1."""

    body: Body
    solid: Solid
    first: int


def bodies_of(arm: Any) -> list[Body]:
    """The links, then the tool that is mounted on the last one."""
    ends, tool, radii = arm.link_lengths.tolist(), arm.tool, arm.radii
    last, tip = len(ends) - 1, ends[-1]
    ends[last] = tip - tool.length if tool else tip
    radii = [arm.link_radius] * len(ends) if radii is None else radii.tolist()
    rows = enumerate(zip(ends, radii, strict=True))
    found = [Body(f"link {i + 1}", i, 0.0, end, radius) for i, (end, radius) in rows]
    return [*found, Body("tool", last, ends[-1], tip, tool.radius)] if tool else found


def parts(one: Body, other: Body, length: float) -> bool:
    """Whether a body farther out can part from another, on a link of that length."""
    if other.link == one.link + 1:
        return (length - one.end) + other.start > one.radius + other.radius
    return other.link > one.link


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
        self.problem, self.rows, self.hashes = problem, trajectory, hashes
        self.joints, self.arm = trajectory.joints, problem.manipulator
        self.lengths = [arb(length) for length in self.arm.link_lengths.tolist()]
        self.solids = [solid(obstacle) for obstacle in problem.scene.obstacles]
        self.meshes = {s.name: s for s in self.solids if isinstance(s, Mesh)}
        bodies = bodies_of(self.arm)
        self.thinnest = min(body.radius for body in bodies)
        self.pairs = [Pair(body, one, 0) for one in self.solids for body in bodies]
        for i, body in enumerate(bodies):
            axis = [[[body.start, 0.0, 0.0], [body.end, 0.0, 0.0]]]
            rest = Solid(body.name, axis, radius=body.radius)
            length, link = float(self.arm.link_lengths[body.link]), body.link
            later = (other for other in bodies[i + 1 :] if parts(body, other, length))
            self.pairs += [Pair(other, rest, link + 1) for other in later]
        path = problem.tip_path
        self.drawing = None if path is None else Drawing(path)
        self.ordered = path is not None and path.order is Order.AS_GIVEN
        self.psi = arb(0)
        self.motion: Interval  # the last one read
        self.n_intervals, self.n_claims, self.place = 0, 0, "header"

    def run(self, lines: Iterator[dict[str, Any]]) -> None:
        """Check everything, line by line.

        Raises:
            Rejected: At the first claim that does not hold; `place` says where.
        """
        self._header(next(lines, {}))
        self.place, expected = "after the header", max(1, self.rows.n_samples - 1)
        for k, line in enumerate(lines):
            self.place = f"interval {k}"
            claim(k < expected, "lies beyond the last row")
            self._interval(k, line)
            self.n_intervals += 1
            self.place = f"after interval {k}"
        claim(self.n_intervals == expected, f"interval {self.n_intervals} is missing")
        self.place = "header"
        self._close()

    def _header(self, header: dict[str, Any]) -> None:
        claim(header.get("vdsm_certificate") == VERSION, f"is not of version {VERSION}")
        claim(set(header) == KEYS, f"has other keys than {sorted(KEYS)}")
        self.header, problem = header, self.problem
        for key, sha256 in self.hashes.items():
            kind = key.removesuffix("_sha256")
            claim(header[key] == sha256, f"the certificate is of another {kind} file")
        for key, value in (
            ("n_rows", self.rows.n_samples),
            ("required_clearance_m", problem.required_clearance),
            ("required_self_clearance_m", problem.required_self_clearance),
        ):
            claim(header[key] == value, f"{key} is {header[key]}, not {value}")
        claim(set(header["errors"]) == set(ERRORS), f"errors: expected {ERRORS}")
        errors = [number(header["errors"][key]) for key in ERRORS]
        claim(all(error >= 0 for error in errors), "errors: one is negative")
        self.joint, self.base, self.obstacle = errors
        named = {one.name: one for one in self.solids}
        for name in header["pieces"]:
            named[name].cut(header["pieces"][name])
        for name, (corners, seams) in header["joined"].items():
            claim(name in self.meshes, f"{name} is no mesh: nothing is joined")
            self.meshes[name].surface.join(corners, seams)
        expected = [[pair.body.name, pair.solid.name] for pair in self.pairs]
        claim(header["pairs"] == expected, "the pairs are not those of the problem")

    def _interval(self, k: int, line: dict[str, Any]) -> None:
        claim(set(line) == {"k", "proofs"} and line["k"] == k, "is missing")
        rows = k, min(k + 1, self.rows.n_samples - 1)  # a single row stands still
        ends = [[arb(q) for q in self.joints[row].tolist()] for row in rows]
        motion = Interval(self.lengths, ends, self.joint)
        if k > 0:
            motion.poses[0.0] = self.motion.pose(1.0)
        self.motion = motion
        here, proofs, n_pairs = self.place, line["proofs"], len(self.pairs)
        claim(len(proofs) == n_pairs, f"{len(proofs)} of {n_pairs} pairs")
        for pair, proof in zip(self.pairs, proofs, strict=True):
            self.place = f"{here}, {pair.body.name} and {pair.solid.name}"
            self._proof(pair, proof)
        self.place = here
        self._rows(rows)

    def _proof(self, pair: Pair, proof: Any) -> None:
        time, size = 0.0, len(pair.solid.points)
        for start, stop, planes in proof:
            claim(start == time < stop, f"the slices do not tile at {time}")
            times, reached = (time, float(stop)), 0
            for first, last, *plane in planes:
                good = first == reached < last <= size
                claim(good, f"the pieces do not tile at {reached} of {size}")
                self._clear(pair, times, (first, last), plane)
                reached = last
            claim(reached == size, f"the pieces end at {reached} of {size}")
            pair.solid.whole &= len(planes) == 1
            time = times[1]
        claim(time == 1.0, f"the slices end at {time}")

    def _clear(self, pair: Pair, times: Any, pieces: Any, plane: Any) -> None:
        """Check that a plane proves what it claims, not much more, and enough."""
        x, y, z, lower = map(number, plane)
        n = pair.solid.direction(unit(column(x, y, z)))
        lost, required = arb(pair.body.radius), self.problem.required_self_clearance
        if pair.first == 0:
            lost += self.base + self.obstacle
            required = self.problem.required_clearance
        reach = self.motion.reach(pair.body, pair.first, times, n)
        proved = pair.solid.support(n, *pieces) - reach - lost
        holds = required <= lower <= proved <= lower + SLACK
        values = [MM * length for length in (lower, proved, required)]
        claim(holds, "claims {} mm, proves {} mm, required are {} mm", *values)
        self.n_claims += 1

    def _rows(self, rows: tuple[int, int]) -> None:
        """Take both rows into what is said of the whole motion."""
        problem, poses = self.problem, [self.motion.pose(t) for t in (0.0, 1.0)]
        self.psi = self.psi.max(poses[0].psi).max(poses[1].psi)
        tips = [pose.centres[-1] for pose in poses]
        if rows[0] == 0:
            self._end("start", problem.begin, 0, tips[0])
        if rows[1] == self.rows.n_samples - 1:
            self._end("goal", problem.goal, rows[1], tips[1])
        if problem.max_row_change is not None:
            turn = abs(self.joints[rows[1]] - self.joints[rows[0]])[1:].max()
            limit = problem.max_row_change + SLACK
            claim(turn <= limit, "a joint turns by {} deg", np.rad2deg(turn))
        if self.drawing is not None:
            self._draw(self.drawing, rows, tips)

    def _end(self, name: str, end: Posture | None, row: int, tip: Matrix) -> None:
        """Check a row at the start or goal: its tip, and joints that are stated."""
        if end is None:
            return
        away, most = norm(tip - column(*end.tip.tolist())), self.problem.tip_tolerance
        claim(away <= most, f"the tip is {{}} mm off its {name}", MM * away)
        if end.joints is not None:
            pairs = zip(self.joints[row].tolist(), end.joints.tolist(), strict=True)
            off = [abs(arb(found) - stated) for found, stated in pairs]
            lever = sum(self.lengths, arb(0))  # how far an angle moves the tip at most
            for way in (off[0], *(lever * angle for angle in off[1:])):
                claim(way <= most, f"the joints are {{}} mm off their {name}", MM * way)

    def _draw(
        self, drawing: Drawing, rows: tuple[int, int], tips: list[Matrix]
    ) -> None:
        """Take what the tip does at both rows and in between into the drawing."""
        stations = [arb(float(self.rows.path_m[row])) for row in rows]
        on, same = self.rows.on_path[list(rows)], arb(self.problem.tip_tolerance)
        for i in (0, 1):
            if not on[i]:
                continue
            away = norm(tips[i] - drawing.point(stations[i]))
            claim(away <= same, "the tip is {} mm off the path", MM * away)
            if i == 1 or rows[0] == 0:  # else it was taken in with the interval before
                ahead = drawing.visit(stations[i], bool(on[0]), same)
                forwards = ahead >= -same - SLACK or not self.ordered
                claim(forwards, "the path is drawn {} mm backwards", -MM * ahead)
        if on.all():
            end = len(self.lengths) - 1, 0, float(self.arm.link_lengths[-1])
            drawing.draw(stations, tips, self.motion.bounds(*end)[0] / 8)
        else:
            drawing.last = None

    def _close(self) -> None:
        """Check what is said of the whole motion, and its limits; -x bounds x below."""
        base = [float(self.joints[0, 0]), 0.0, 0.0]
        for mesh in self.meshes.values():  # clear of its hull, or begun outside
            if not (mesh.surface_only or mesh.whole):
                why = mesh.surface.not_outside(base, self.thinnest)
                claim(not why, f"the arm is not proved outside {mesh.name}: {why}")
        arm, header, q = self.arm, self.header, self.joints
        claim(set(header["limits"]) == set(LIMITS), f"limits: expected {LIMITS}")
        alpha, theta, psi, low, high = (header["limits"][key] for key in LIMITS)
        claims = [
            ("alpha_rad", alpha, abs(q[:, 1::2]).max(), arm.max_joint_angle),
            ("theta_rad", theta, abs(q[:, 2::2]).max(), arm.max_joint_angle),
            ("psi_rad", psi, self.psi, arm.max_link_angle),
            ("-x0_min_m", -low, -q[:, 0].min(), -arm.base_range[0]),
            ("x0_max_m", high, q[:, 0].max(), arm.base_range[1]),
        ]
        tip, share = header["tip_deviation_m"], header["coverage"]
        drawing = self.drawing
        if drawing is None:
            claim(tip is share is None, "claims a desired path, the problem has none")
        else:
            path, drawn = self.problem.path, drawing.coverage()
            past = drawing.advanced - drawing.length - self.problem.tip_tolerance
            again = self.ordered and drawing.left and drawing.closed
            once = past <= SLACK or not again
            claim(once, "the path is begun again, {} mm past its end", MM * past)
            claims += [
                ("tip_deviation_m", tip, drawing.deviation, path.spacing),
                ("-coverage", -share, -drawn, -path.required_coverage),
            ]
        for name, claimed, proved, limit in claims:
            bound, value = arb(proved), number(claimed)
            holds = bound <= value <= bound + SLACK
            claim(holds, name + " is {}, proved is {}", value, bound)
            claim(bound <= limit + SLACK, name + " is {}, the limit {}", bound, limit)
