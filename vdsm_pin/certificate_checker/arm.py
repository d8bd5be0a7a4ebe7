"""A snake arm among obstacles as the checker takes it: tree, motion, bodies, pairs.

Joint 0 is the rail, 2 i - 1 and 2 i are yaw and pitch of link i; then come the joints
that carry obstacles.
"""

from collections.abc import Iterator, Mapping
from itertools import combinations
from typing import Any, Final

import numpy as np
from flint import arb

from vdsm_pin.certificate_checker.balls import Ball, claim, number
from vdsm_pin.certificate_checker.motion import Branch, Path
from vdsm_pin.certificate_checker.solids import Body, Pair, Solid, solid
from vdsm_pin.certificate_checker.tree import SLIDES, TURNS, Joint, Tree
from vdsm_pin.problem import scene
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory

ERRORS: Final = "joints_rad", "base_m", "base_rad", "obstacle_m", "obstacles"


def arm_joints(lengths: list[float]) -> Iterator[Joint]:
    """Rail, then yaw and pitch of every link."""
    yield Joint(0, SLIDES, (1, 0, 0), np.eye(4), column_of_q=0)
    for i, before in enumerate([0.0, *lengths[:-1]]):
        place = np.eye(4)
        place[0, 3] = before
        yield Joint(2 * i + 1, TURNS, (0, 0, 1), place, column_of_q=2 * i + 1)
        yield Joint(2 * i + 2, TURNS, (0, 1, 0), np.eye(4), column_of_q=2 * i + 2)


def hung(joints: Any, base: int, columns: int) -> Iterator[Joint]:
    """Joints of another tree behind so many, their columns of q behind so many."""
    for joint in joints:
        parent = joint.parent + base if joint.parent else 0
        moves = None if joint.column is None else joint.column + columns
        kind, axis, place = joint.kind.name, joint.axis, joint.placement
        yield Joint(parent, kind, axis, place, moves, joint.ratio, joint.offset)


def frame_of(link: int) -> int:
    """The frame of a link from 1, or of the feed (0), which never turns."""
    return 2 * link + 1


def own_bodies(arm: Any) -> Iterator[Body]:
    """The links, the tool that is mounted on the last one, and the feed."""
    ends, tool, radii = arm.link_lengths.tolist(), arm.tool, arm.radii
    last, tip = len(ends), ends[-1]
    ends[-1] = tip - tool.length if tool else tip
    radii = [arm.link_radius] * last if radii is None else radii.tolist()
    rows = [
        (f"link {i}", i, 0.0, ends[i - 1], radii[i - 1]) for i in range(1, last + 1)
    ]
    rows += [("tool", last, ends[-1], tip, tool.radius)] if tool else []
    rows += [("feed", 0, -arm.feed.length, 0.0, arm.feed.radius)] if arm.feed else []
    for name, link, start, end, radius in rows:
        axis = [[[start, 0.0, 0.0], [end, 0.0, 0.0]]]
        yield Body(frame_of(link), Solid(name, axis, radius=radius))


class Arm:
    """What the two files ask about.

    Args:
        problem: As it was read.
        rows: As they were read.
    """

    def __init__(self, problem: PlanningProblem, rows: Trajectory) -> None:
        self.problem, self.arm = problem, problem.manipulator
        self.lengths = self.arm.link_lengths.tolist()
        joints = [*arm_joints(self.lengths)]
        self.n_own = columns = len(joints)
        others, first = list[Branch](), dict[Any, int]()
        self.frames: list[int] = []
        for carrier in problem.scene.carriers:
            path, first[carrier] = carrier.path, len(joints)
            joints += hung(carrier.tree.joints, len(joints), columns)
            columns += path.knots.shape[1]
            inner = path.inner if path.inner.size else None
            others.append(Branch(path.knots, path.times, inner, []))
        for one in problem.scene.obstacles:
            rides = isinstance(one, scene.Moving) and first[one.carrier] + one.frame
            self.frames.append(int(rides))
        self.solids = [solid(one) for one in problem.scene.obstacles]
        timed = not others or rows.times is not None
        claim(timed, "rows beside what moves have no times")
        rates = [x for x in (rows.rates, rows.changes) if x is not None]
        own = Branch(rows.joints, rows.times, None, rates)
        self.path, self.tree = Path(own, others), Tree(joints)
        self.bodies: list[Body] = []
        self.pairs: list[Pair] = []

    def take_errors(self, errors: dict[str, Any]) -> None:
        """Take the errors, which cover those that the problem asks for."""
        claim(set(errors) == set(ERRORS), f"errors: expected {ERRORS}")
        asked, count = self.problem.errors, 2 * len(self.lengths)
        joints = [number(e) for both in errors["joints_rad"] for e in both]
        claim(len(joints) == count, f"errors: expected {count // 2} joints")
        each = [e for pair in asked.joints for e in pair]
        each += [0.0] * (count - len(each))
        base, turn = number(errors["base_m"]), number(errors["base_rad"])
        known, single = number(errors["obstacle_m"]), errors["obstacles"]
        names = {one.name: one for one in self.solids}
        claim(set(single) <= set(names), "errors: an obstacle is unknown")
        grown = {name: (known, arb(0)) for name in names}
        grown |= {k: (known.max(number(s)), number(t)) for k, (s, t) in single.items()}
        pairs = [(base, asked.base), (turn, asked.base_turn)]
        pairs += zip(joints, [max(asked.joint, e) for e in each], strict=True)
        pairs += [(shift, asked.obstacle) for shift, _ in grown.values()]
        for one in asked.obstacles:
            pairs += zip(grown[one.name], (one.shift, one.turn), strict=True)
        pairs += [(turn, 0.0) for _, turn in grown.values()]
        covered = all(e >= least and e >= 0 for e, least in pairs)
        claim(covered, "errors: less than the problem asks for")
        for name, (_, angle) in grown.items():
            flat = angle > 0 and names[name].normal is not None
            claim(not flat, f"errors: {name} has no end and is turned")
        for joint, error in zip(self.tree.joints[1:], joints, strict=False):
            joint.err(error, arb(0), arb(0))
        self.tree.joints[0].err(arb(0), base, turn)
        self._grow({k: s + t * names[k].size() for k, (s, t) in grown.items()})

    def _grow(self, grown: Mapping[str, Ball]) -> None:
        """Take how far obstacles may be off, and how far slides reach."""
        self.grown = grown
        reach = self.path.reach()
        for joint in self.tree.joints:
            if joint.kind == SLIDES and joint.column is not None:
                joint.stroke = abs(joint.ratio) * reach[joint.column] + abs(
                    joint.offset
                )

    def pair_up(self, pieces: dict[str, Any]) -> None:
        """Find the bodies and the pairs that the problem asks about, in order."""
        self.bodies, problem = [*own_bodies(self.arm)], self.problem
        for carried in self.arm.bodies:
            parts = solid(carried.solid).parts(pieces.pop(carried.solid.name, None))
            frame = frame_of(carried.link)
            self.bodies += [Body(frame, part, own=False) for part in parts]
        named = {one.name: one for one in self.solids}
        for name in pieces:
            named[name].cut(pieces[name])
        required = arb(problem.required_clearance)
        for one, rest in zip(self.solids, self.frames, strict=True):
            for body in self.bodies:
                if not self._ignored(body.solid.name, one.name):
                    lost = body.solid.radius + self.grown[one.name]
                    self._add(Pair(body, one, rest, required, lost))
        required = arb(problem.required_self_clearance)
        for both in combinations(self.bodies, 2):
            near, far = sorted(both, key=lambda body: body.frame)
            if self._parts(near, far):
                lost = far.solid.radius
                self._add(Pair(far, near.solid, near.frame, required, lost))

    def _add(self, pair: Pair) -> None:
        slip = self.tree.slip(pair.rest, pair.body.frame)
        self.pairs.append(pair._replace(lost=pair.lost + slip))

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
        if far.frame == near.frame + 2 and near.own and far.own:
            length = [0.0, *self.lengths][near.frame // 2]
            start, end = far.solid.points[0, 0, 0], near.solid.points[0, 1, 0]
            if (length - end) + start <= float(near.solid.radius + far.solid.radius):
                return False  # they meet at the joint in every pose
        names = near.solid.name, far.solid.name
        return near.frame < far.frame and not self._ignored(*names)
