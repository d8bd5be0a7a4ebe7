"""Every claim of a certificate, recomputed in ball arithmetic.

In the symbols of `docs/certificate.md`: the hashes and the pairs (`_header`), how time
and pieces are tiled (`_proof`), each clearance (`_clear`), the rows (`_rows`) and what
is said of the whole motion (`_close`). Links count from 0 in here.
"""

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Any, Final, NamedTuple

import numpy as np
from flint import arb

from vdsm_pin.certificate_checker.balls import Matrix, claim, column, norm, number, unit
from vdsm_pin.certificate_checker.motion import Interval, Pose
from vdsm_pin.certificate_checker.path import Drawing
from vdsm_pin.certificate_checker.solids import Mesh, Solid, solid
from vdsm_pin.problem import Order, PlanningProblem, Posture
from vdsm_pin.trajectory import Trajectory

VERSION: Final = 4
PER_METRE: Final = 10**10  # a clearance that is whole counts these parts of a metre
MM: Final = 1000  # messages tell lengths in millimetres
SLACK: Final = 1e-9  # claims may understate by this, limits be passed; [m], [rad], [-]
KEYS: Final = set(
    "vdsm_certificate problem_sha256 trajectory_sha256 urdf_sha256 versions n_rows "
    "required_clearance_m required_self_clearance_m errors pairs pieces joined limits "
    "tip_deviation_m coverage".split()
)
ERRORS: Final = "joints_rad", "base_m", "base_rad", "obstacle_m", "obstacles"
LIMITS: Final = "alpha_rad", "theta_rad", "psi_rad", "x0_min_m", "x0_max_m"


class Body(NamedTuple):
    """A convex solid that rides on a link, or on the feed (-1).

    Args:
        link: From 0.
        solid: Of one piece, in the link's frame.
        own: Whether it is a link, the tool or the feed: a capsule about the arm's axis.
    """

    link: int
    solid: Solid
    own: bool = True


class Pair(NamedTuple):
    """A body and a solid that rests in a frame, as `Pose` counts them."""

    body: Body
    solid: Solid
    frame: int


def own_bodies(arm: Any) -> Iterator[Body]:
    """The links, the tool that is mounted on the last one, and the feed."""
    ends, tool, radii = arm.link_lengths.tolist(), arm.tool, arm.radii
    last, tip = len(ends) - 1, ends[-1]
    ends[last] = tip - tool.length if tool else tip
    radii = [arm.link_radius] * len(ends) if radii is None else radii.tolist()
    rows = [(f"link {i + 1}", i, 0.0, end, radii[i]) for i, end in enumerate(ends)]
    rows += [("tool", last, ends[-1], tip, tool.radius)] if tool else []
    rows += [("feed", -1, -arm.feed.length, 0.0, arm.feed.radius)] if arm.feed else []
    for name, link, start, end, radius in rows:
        axis = [[[start, 0.0, 0.0], [end, 0.0, 0.0]]]
        yield Body(link, Solid(name, axis, radius=radius))


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
        path = problem.tip_path
        self.drawing = None if path is None else Drawing(path)
        self.ordered = path is not None and path.order is Order.AS_GIVEN
        self.psi = arb(0)
        self.motion: Interval  # the last one read
        self.first: Pose  # of the first row
        self.grown: dict[str, Any] = {}  # how far the obstacles may be off
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
        self._outside()
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
        self._errors(header["errors"])
        self._pair_up(dict(header["pieces"]))
        for name, (corners, seams) in header["joined"].items():
            claim(name in self.meshes, f"{name} is no mesh: nothing is joined")
            self.meshes[name].surface.join(corners, seams)
        expected = [[pair.body.solid.name, pair.solid.name] for pair in self.pairs]
        claim(header["pairs"] == expected, "the pairs are not those of the problem")

    def _errors(self, errors: dict[str, Any]) -> None:
        """Take the errors, which cover those that the problem asks for."""
        claim(set(errors) == set(ERRORS), f"errors: expected {ERRORS}")
        asked, count = self.problem.errors, len(self.lengths)
        joints = [number(e) for both in errors["joints_rad"] for e in both]
        claim(len(joints) == 2 * count, f"errors: expected {count} joints")
        each = [e for pair in asked.joints for e in pair] or [0.0] * (2 * count)
        self.base, turn = number(errors["base_m"]), number(errors["base_rad"])
        self.base_turn = turn, arb(float(abs(self.joints[:, 0]).max()))
        known, single = number(errors["obstacle_m"]), errors["obstacles"]
        names = {one.name: one for one in self.solids}
        claim(set(single) <= set(names), "errors: an obstacle is unknown")
        grown = {name: (known, arb(0)) for name in names}
        grown |= {k: (known.max(number(s)), number(t)) for k, (s, t) in single.items()}
        pairs = [(self.base, asked.base), (turn, asked.base_turn)]
        pairs += zip(joints, [max(asked.joint, e) for e in each], strict=True)
        pairs += [(shift, asked.obstacle) for shift, _ in grown.values()]
        for one in asked.obstacles:
            pairs += zip(grown[one.name], (one.shift, one.turn), strict=True)
        covered = all(e >= least and e >= 0 for e, least in pairs)
        claim(covered, "errors: less than the problem asks for")
        for name, (shift, turn) in grown.items():
            claim(turn >= 0, "errors: one is negative")
            flat = turn > 0 and names[name].normal is not None
            claim(not flat, f"errors: {name} has no end and is turned")
            self.grown[name] = shift + turn * names[name].size() if turn > 0 else shift
        self.joint = joints

    def _pair_up(self, pieces: dict[str, Any]) -> None:
        """Find the bodies and the pairs that the problem asks about, in order."""
        arm = self.arm
        self.bodies = [*own_bodies(arm)]
        for one in arm.bodies:
            found = solid(one.solid).parts(pieces.pop(one.solid.name, None))
            self.bodies += [Body(one.link - 1, part, own=False) for part in found]
        named = {one.name: one for one in self.solids}
        for name in pieces:
            named[name].cut(pieces[name])
        self.pairs = [
            Pair(body, one, 0)
            for one in self.solids
            for body in self.bodies
            if not self._ignored(body.solid.name, one.name)
        ]
        for both in combinations(self.bodies, 2):
            near, far = sorted(both, key=lambda body: body.link)
            if self._parts(near, far):
                self.pairs.append(Pair(far, near.solid, near.link + 2))

    def _ignored(self, one: str, other: str) -> bool:
        """Whether the problem leaves two names, or parts of what they name, out."""
        own = {body.name for body in self.arm.bodies}
        mine, theirs = ({n, *({n.rpartition(" part ")[0]} & own)} for n in (one, other))
        return any(
            (a in mine and b in theirs) or (b in mine and a in theirs)
            for a, b in self.arm.ignore_pairs
        )

    def _parts(self, near: Body, far: Body) -> bool:
        """Whether a body can part from one nearer to the base and has to."""
        if far.link == near.link + 1 and near.own and far.own:
            length = 0.0 if near.link < 0 else float(self.arm.link_lengths[near.link])
            start, end = far.solid.points[0, 0, 0], near.solid.points[0, 1, 0]
            if (length - end) + start <= float(near.solid.radius + far.solid.radius):
                return False  # they meet at the joint in every pose
        names = near.solid.name, far.solid.name
        return near.link < far.link and not self._ignored(*names)

    def _interval(self, k: int, line: dict[str, Any]) -> None:
        claim(set(line) == {"k", "proofs"} and line["k"] == k, "is missing")
        rows = k, min(k + 1, self.rows.n_samples - 1)  # a single row stands still
        ends = [[arb(q) for q in self.joints[row].tolist()] for row in rows]
        motion = Interval(self.lengths, ends, self.joint, self.base_turn)
        if k > 0:
            motion.poses[0.0] = self.motion.pose(1.0)
        self.motion = motion
        here, proofs, n_pairs = self.place, line["proofs"], len(self.pairs)
        claim(len(proofs) == n_pairs, f"{len(proofs)} of {n_pairs} pairs")
        for pair, proof in zip(self.pairs, proofs, strict=True):
            self.place = f"{here}, {pair.body.solid.name} and {pair.solid.name}"
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
        lower = lower / PER_METRE if type(plane[3]) is int else lower
        n = pair.solid.direction(unit(column(x, y, z)))
        lost, required = pair.body.solid.radius, self.problem.required_self_clearance
        if pair.frame == 0:
            lost = lost + self.base + self.grown[pair.solid.name]
            required = self.problem.required_clearance
        reach = self.motion.reach(pair.body, pair.frame, times, n)
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
            self.first = poses[0]
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
            last = len(self.lengths) - 1
            bend = self.motion.bounds(last, 0, self.lengths[-1]).bend
            drawing.draw(stations, tips, bend / 8)
        else:
            drawing.last = None

    def _outside(self) -> None:
        """Check that the arm is clear of a mesh's hull, or begins outside.

        A body never meets the mesh's triangles, so one point of it decides; that at O_1
        for links, tool and feed where all of them are held off the mesh.
        """
        own = [body for body in self.bodies if body.own]
        thinnest = min(float(body.solid.radius) for body in own)
        for mesh in self.meshes.values():
            if mesh.surface_only or mesh.whole:
                continue
            mine = [pair.body for pair in self.pairs if pair.solid is mesh]
            points = [(self.first.centres[0], thinnest)]
            if all(body in mine for body in own):
                mine = [body for body in mine if not body.own]
            else:
                points = []
            for body in mine:
                middle = column(*body.solid.points[0].mean(axis=0).tolist())
                at, kept = self.first.point(body.link, middle), body.solid.radius
                points.append((at, float(kept) + self.problem.required_clearance))
            for at, radius in points:
                point = [float(x) for x in at.entries()]
                why = mesh.surface.not_outside(point, radius)
                claim(not why, f"the arm is not proved outside {mesh.name}: {why}")

    def _close(self) -> None:
        """Check what is said of the whole motion, and its limits; -x bounds x below."""
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
