"""A snake arm among obstacles as the checker takes it: tree, motion, bodies, pairs.

Joint 0 is the rail, 2 i - 1 and 2 i are yaw and pitch of link i; then come the joints
that carry obstacles.
"""

from collections.abc import Iterator, Mapping, Set
from itertools import combinations, product
from pathlib import Path as File
from typing import Any

import numpy as np

from vdsm_pin.certificate_checker import solids
from vdsm_pin.certificate_checker.balls import belongs, claim
from vdsm_pin.certificate_checker.errors import grown
from vdsm_pin.certificate_checker.motion import Branch, Path, beside
from vdsm_pin.certificate_checker.rows import Rows
from vdsm_pin.certificate_checker.solids import Body, Pair, Solid, cover, solid
from vdsm_pin.certificate_checker.tree import SLIDES, TURNS, Joint, Tree, frame_of
from vdsm_pin.io.source import sha256_of_file
from vdsm_pin.io.trajectory_file import read_trajectory
from vdsm_pin.problem.planning_problem import PlanningProblem


def arm_joints(lengths: list[float], angles: list[float], base: Any) -> list[Joint]:
    """Rail, then yaw and pitch of every link; the base is off by a shift and a turn."""
    rail = Joint(0, SLIDES, (1, 0, 0), np.eye(4), (0, 1.0, 0.0), (0.0, *base))
    joints = [rail]
    for k, error in enumerate(angles, start=1):
        place = np.eye(4)
        place[0, 3] = lengths[k // 2 - 1] if k % 2 and k > 1 else 0.0
        axis = (0, 0, 1) if k % 2 else (0, 1, 0)
        joints.append(Joint(k, TURNS, axis, place, (k, 1.0, 0.0), (error, 0.0, 0.0)))
    return joints


def along_axis(arm: Any) -> Iterator[Body]:
    """The links, the tool that is mounted on the last one, and the feed."""
    ends, tool, radii = arm.link_lengths.tolist(), arm.tool, arm.radii
    last, tip = len(ends), ends[-1]
    ends[-1] = tip - tool.length if tool else tip
    radii = [arm.link_radius] * last if radii is None else radii.tolist()
    spans = enumerate(zip(ends, radii, strict=True), start=1)
    rows = [(f"link {i}", i, 0.0, *both) for i, both in spans]
    rows += [("tool", last, ends[-1], tip, tool.radius)] if tool else []
    rows += [("feed", 0, -arm.feed.length, 0.0, arm.feed.radius)] if arm.feed else []
    for name, link, start, end, radius in rows:
        axis = [[[start, 0.0, 0.0], [end, 0.0, 0.0]]]
        yield Body(frame_of(link), Solid(name, axis, radius=radius))


class Arm:
    """What the two files ask about, under the errors that a certificate states.

    Args:
        problem: As it was read.
        header: Of the certificate.
        trajectory: The file.
    """

    judged = (
        "clearance, and pointing where it is asked, hold under the errors stated; "
        "limits, start, goal and path without them; cables are not judged"
    )

    def __init__(
        self, problem: PlanningProblem, header: Mapping[str, Any], trajectory: File
    ) -> None:
        self.problem, self.arm = problem, problem.manipulator
        belongs(header, "errors", problem.sha256, sha256_of_file(trajectory))
        joined, known = header["interpolation"], ("linear", "cubic", "quintic")
        claim(joined in known, f"interpolation is {joined}, expected one of {known}")
        rows = read_trajectory(trajectory, self.arm, joined, bool(problem.tip_path))
        self.lengths = self.arm.link_lengths.tolist()
        self.solids = [solid(x, header["links"]) for x in problem.scene.obstacles]
        stated, least = header["errors"], {"joints_rad": self._asked()}
        lost = grown(stated, problem.errors, least, self.solids)
        joints = arm_joints(self.lengths, stated["joints_rad"], stated["base"])
        rates = [x for x in (rows.rates, rows.changes) if x is not None]
        own = Branch(rows.joints, rows.times, rates=rates)
        self.own = Tree(joints), Path(own)
        self.tree, self.path, at = beside(own, joints, problem.scene.obstacles)
        self.obstacles = [Body(*x) for x in zip(at, self.solids, lost, strict=True)]
        self._cover(header)
        self.pairs = [*self._pairs()]
        self.rows = Rows(self, rows)
        self.notes = solids.sizes([*problem.scene.obstacles, *self.arm.bodies])
        self.notes += [note for one in self.solids for note in one.notes()]
        self.notes += [f"{a} and {b} left out" for a, b in self.arm.ignore_pairs]
        self.notes.append(f"{joined} pieces join the rows")

    def _asked(self) -> list[float]:
        """Errors of yaw and pitch of each joint that the problem asks for."""
        asked = self.problem.errors
        each = [e for pair in asked.joints for e in pair]
        each += [0.0] * (2 * len(self.lengths) - len(each))
        return [max(asked.joint, e) for e in each]

    def _cover(self, header: Any) -> None:
        """Take the bodies, and the pieces that cover them and the obstacles."""
        self.axis, pieces = [*along_axis(self.arm)], {**header["pieces"]}
        self.bodies = [*self.axis]
        for carried in self.arm.bodies:
            parts = solid(carried.solid).convex(pieces.pop(carried.solid.name, None))
            frame = frame_of(carried.link)
            self.bodies += [Body(frame, part) for part in parts]
        cover(self.solids, {**header, "pieces": pieces})

    def _pairs(self) -> Iterator[Pair]:
        """What the problem holds apart, in order."""
        required = self.problem.required_clearance
        for obstacle, body in product(self.obstacles, self.bodies):
            if not self._ignored(body.solid.name, obstacle.solid.name):
                yield Pair(body, obstacle, required)
        required = self.problem.required_self_clearance
        for both in combinations(self.bodies, 2):
            near, far = sorted(both, key=lambda body: body.frame)
            if self._parts(near, far):
                yield Pair(far, near, required)

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
        if far.frame == near.frame + 2 and {near, far} <= {*self.axis}:
            length = [0.0, *self.lengths][near.frame // 2]
            start, end = far.solid.points[0, 0, 0], near.solid.points[0, 1, 0]
            if (length - end) + start <= near.solid.radius + far.solid.radius:
                return False  # they meet at the joint in every pose
        names = near.solid.name, far.solid.name
        return near.frame < far.frame and not self._ignored(*names)

    def check_outside(self, first: Any, by_pieces: Set[Pair]) -> None:
        """Check that what is not clear of a mesh's hull begins outside.

        A body never meets the mesh's triangles, so one point of it decides; that at O_1
        for links, tool and feed where all of them are held off the mesh.

        Args:
            first: The pose as the motion begins.
            by_pieces: The pairs that planes for single pieces hold apart.
        """
        axis, thinnest = {*self.axis}, min(body.solid.radius for body in self.axis)
        for obstacle in self.obstacles:
            held = [pair for pair in self.pairs if pair.partner == obstacle]
            pairs, points = [pair for pair in held if pair in by_pieces], []
            if axis <= {x.body for x in held} and axis & {x.body for x in pairs}:
                points = [(first[1], (0, 0, 0), thinnest)]
                pairs = [pair for pair in pairs if pair.body not in axis]
            points += [pair.inner(first) for pair in pairs]
            obstacle.solid.check_outside(first[obstacle.frame], points)
