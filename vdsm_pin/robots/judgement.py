"""The judgement of a robot's trajectory: every check, one row each."""

from dataclasses import dataclass, replace
from functools import cached_property
from math import inf, nan
from typing import Final

import numpy as np

from vdsm_pin.errors import InvalidInput, VdsmError
from vdsm_pin.geometry.arrays import FloatArray, frozen
from vdsm_pin.geometry.convex import Piece
from vdsm_pin.problem.scene import Scene, solid_of
from vdsm_pin.proof.bodies import Body, Pair
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.prover import Proof, prove
from vdsm_pin.proof.terms import CERTIFIED, REFUTED, WORLD
from vdsm_pin.proof.tree import Tree
from vdsm_pin.robots.contacts import common_ball, in_world
from vdsm_pin.robots.model import Robot
from vdsm_pin.robots.rates import rate_checks
from vdsm_pin.robots.second_opinion import link_shapes, placed, pose_difference
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.coal_bodies import (
    CoalBody,
    CoalObstacle,
    Measured,
    coal_bodies,
    distance_request,
    measure,
)
from vdsm_pin.verification.records import Check, Verdict, combine

POSES: Final = "link poses by Pinocchio against the tree's"
LIMITS: Final = "joint {name!r} in its limits"
OBSTACLES: Final = "clearance from obstacles"
LINKS: Final = "clearance between links"
COAL: Final = "distances by Coal against the proved brackets"
POSE_ERROR: Final = 1e-9
"""Where Pinocchio and the tree must agree; [m] or, of rotations, [-]."""

MEETING: Final = 2.0 * TOLERANCES.bracket_gap
"""Bodies that come so near may meet; [m]."""

BESIDE: Final = (0.0, 0.01, -0.01, 0.05, -0.05)
"""Where a ball in both is looked for, beside the moment at which bodies meet; [-]."""

COMPARED: Final = 1000
"""Most waypoints at which poses are compared, spread evenly."""


@dataclass(frozen=True)
class JudgedPair:
    """Two bodies over the whole motion.

    Args:
        link: Name of a link.
        other: Name of an obstacle, or of another link.
        is_obstacle: Which of the two.
        verdict: Of their required clearance.
        lower: Clearance proved at every time; [m].
        upper: Clearance at the witness; negative inside; [m].
        moment: When, in waypoints from 0.
        link_point: Witness on the link, shape (3,); [m].
        other_point: Witness on the other body, shape (3,); [m].
    """

    link: str
    other: str
    is_obstacle: bool
    verdict: Verdict
    lower: float
    upper: float
    moment: float
    link_point: FloatArray
    other_point: FloatArray


@dataclass(frozen=True)
class RobotVerification:
    """The judgement of one trajectory of a robot.

    Args:
        robot: The robot.
        scene: The obstacles.
        path: What was judged.
        checks: One row per check.
        pairs: Every pair that was judged.
    """

    robot: Robot
    scene: Scene
    path: Path
    checks: tuple[Check, ...]
    pairs: tuple[JudgedPair, ...]

    @property
    def verdict(self) -> Verdict:
        """Certified only if every check is."""
        return combine(tuple(check.verdict for check in self.checks))


@dataclass(frozen=True)
class Asked:
    """What motions of a robot are held to.

    Args:
        robot: The robot.
        scene: Obstacles in its base frame.
        required: Least clearance from obstacles; [m].
        required_self: Least clearance between links that are held apart; [m].

    Raises:
        InvalidInput: If a clearance is negative or not finite.
    """

    robot: Robot
    scene: Scene
    required: float = 0.0
    required_self: float = 0.0

    def __post_init__(self) -> None:
        """Check the clearances."""
        for value in (self.required, self.required_self):
            if not 0.0 <= value < inf:
                millimetres = value * MM_PER_M
                message = (
                    f"required clearance is {millimetres:g} mm, expected 0 or more"
                )
                raise InvalidInput(message)

    @cached_property
    def bodies(self) -> list[Body]:
        """Links first, then obstacles."""
        resting = (Body(WORLD, o.pieces, o.name) for o in self.scene.obstacles)
        return [*self.robot.bodies, *resting]

    @cached_property
    def pairs(self) -> list[Pair]:
        """All that are held apart; the obstacle first, which may have many pieces."""
        n = len(self.robot.bodies)
        outer = range(n, len(self.bodies))
        pairs = [Pair(k, b, self.required) for k in outer for b in range(n)]
        return pairs + [Pair(i, k, self.required_self) for i, k in self.robot.held]

    @cached_property
    def coal(self) -> "CoalPairs":
        """Coal's distances of them."""
        return CoalPairs(self.robot, self.scene)

    def names(self, pair: Pair) -> str:
        """Both bodies of a pair in words, a link first."""
        one, other = self.bodies[pair.one], self.bodies[pair.other]
        if one.frame == WORLD:
            one, other = other, one
        return f"{one.name} and {other.name}"

    def verified(self, path: Path, deadline: Deadline = NO_LIMIT) -> RobotVerification:
        """The judgement of a motion; what is not judged by then is undecided."""
        robot, n = self.robot, len(self.robot.bodies)
        budget = Budget(until=deadline.end)
        proof = prove(robot.tree, self.bodies, path, self.pairs, budget=budget)
        judged = tuple(
            _met(one, pair, (robot.tree, path), self.coal)
            for one, pair in zip(
                _judged(proof, self.pairs, self.bodies, n), self.pairs, strict=True
            )
        )
        checks = [
            _poses(robot, path),
            *_limits(robot, path),
            *rate_checks(robot.joints, path),
            *_clearances(judged, self.required, self.required_self),
            _coal(self.coal, robot.tree, path, proof, self.pairs),
        ]
        return RobotVerification(robot, self.scene, path, tuple(checks), judged)


def verify_robot(
    robot: Robot,
    scene: Scene,
    path: Path,
    required: float,
    required_self: float = 0.0,
    deadline: Deadline = NO_LIMIT,
) -> RobotVerification:
    """Judge a trajectory of a robot in a scene; arguments as of `Asked`.

    Args:
        robot: The robot.
        scene: Obstacles in its base frame.
        path: The motion.
        required: Least clearance from obstacles; [m].
        required_self: Least clearance between links that are held apart; [m].
        deadline: What is not judged by then is undecided.

    Raises:
        InvalidInput: If a clearance is negative or not finite.
    """
    return Asked(robot, scene, required, required_self).verified(path, deadline)


def _judged(
    proof: Proof, pairs: list[Pair], bodies: list[Body], n: int
) -> tuple[JudgedPair, ...]:
    words = {CERTIFIED: Verdict.CERTIFIED, REFUTED: Verdict.REFUTED}
    rows = []
    for k, pair in enumerate(pairs):
        outer = pair.one >= n
        link, other = (pair.other, pair.one) if outer else (pair.one, pair.other)
        points = proof.points[k][::-1] if outer else proof.points[k]
        rows.append(
            JudgedPair(
                link=bodies[link].name,
                other=bodies[other].name,
                is_obstacle=outer,
                verdict=words.get(int(proof.verdict[k]), Verdict.UNDECIDED),
                lower=float(proof.lower[k]),
                upper=float(proof.upper[k]),
                moment=float(proof.interval[k] + proof.share[k]),
                link_point=points[0],
                other_point=points[1],
            )
        )
    return tuple(rows)


def _met(
    one: JudgedPair, pair: Pair, motion: tuple[Tree, Path], coal: "CoalPairs"
) -> JudgedPair:
    """The same, refuted where a ball is proved to lie in both bodies."""
    if one.verdict is not Verdict.UNDECIDED or not one.upper <= MEETING:
        return one
    tree, path = motion
    moments = one.moment + np.array(BESIDE)
    intervals = np.clip(np.floor(moments).astype(np.int64), 0, path.n_intervals - 1)
    rows = path.within(intervals, np.clip(moments - intervals, 0.0, 1.0))
    for moment, poses in zip(moments, tree.poses(rows), strict=True):
        bodies = coal.pieces(pair, poses)
        radius, centre = common_ball(*bodies, 0.5 * (one.link_point + one.other_point))
        if radius > 0.0:
            return replace(
                one,
                verdict=Verdict.REFUTED,
                upper=-radius,
                moment=float(np.clip(moment, 0.0, path.n_intervals)),
                link_point=frozen(centre),
                other_point=frozen(centre),
            )
    return one


def _poses(robot: Robot, path: Path) -> Check:
    step = -(-len(path.knots) // COMPARED)
    rows = np.arange(0, len(path.knots), step)
    try:
        off = pose_difference(robot, path.knots[rows])
    except VdsmError as error:
        where = f"not done: {error}"
        return Check(POSES, Verdict.UNDECIDED, 0, nan, POSE_ERROR, "-", where)
    k = int(np.argmax(off))
    good = bool((off <= POSE_ERROR).all())
    verdict = Verdict.CERTIFIED if good else Verdict.REFUTED
    where = f"{len(robot.frames)} links at {len(rows)} of {len(path.knots)} waypoints"
    count = len(rows) * len(robot.frames)
    return Check(
        POSES, verdict, count, float(off[k]), POSE_ERROR, "-", where, float(rows[k])
    )


def _limits(robot: Robot, path: Path) -> list[Check]:
    """A row for each joint with limits; the control points hold what lies between."""
    checks = []
    slack = TOLERANCES.arithmetic
    for k, joint in enumerate(robot.joints):
        if not np.isfinite([joint.lower, joint.upper]).all():
            continue
        past = np.maximum(
            path.knots[:, k] - joint.upper, joint.lower - path.knots[:, k]
        )
        between = path.controls[..., k]
        all_past = np.maximum(between - joint.upper, joint.lower - between)
        row = int(np.argmax(past))
        verdict = Verdict.CERTIFIED
        if not (past <= slack).all():
            verdict = Verdict.REFUTED
        elif not (all_past <= slack).all():
            verdict = Verdict.UNDECIDED
        upper = path.knots[row, k] - joint.upper >= joint.lower - path.knots[row, k]
        checks.append(
            Check(
                LIMITS.format(name=joint.name),
                verdict,
                len(past),
                float(path.knots[row, k]),
                joint.upper if upper else joint.lower,
                "rad" if joint.turns else "m",
                moment=float(row),
            )
        )
    return checks


def _clearances(
    judged: tuple[JudgedPair, ...], required: float, required_self: float
) -> list[Check]:
    rows = []
    for name, outer, needed in (
        (OBSTACLES, True, required),
        (LINKS, False, required_self),
    ):
        mine = [pair for pair in judged if pair.is_obstacle is outer]
        if not mine:
            continue
        verdict = combine(tuple(pair.verdict for pair in mine))
        # A refuted motion is as bad as its witness, another one as good as its proof.
        if verdict is Verdict.REFUTED:
            lost = [pair for pair in mine if pair.verdict is Verdict.REFUTED]
            worst = min(lost, key=lambda pair: pair.upper)
            value = worst.upper
        else:
            worst = min(mine, key=lambda pair: pair.lower)
            value = worst.lower
        where = f"{worst.link} and {worst.other}"
        left = sum(pair.verdict is Verdict.UNDECIDED for pair in mine)
        where += f"; {left} of {len(mine)} pairs undecided" if left else ""
        rows.append(
            Check(name, verdict, len(mine), value, needed, "m", where, worst.moment)
        )
    return rows


class CoalPairs:
    """Coal's distances of the pairs of a robot and a scene.

    Poses are those of all frames at one configuration, shape (n_frames, 4, 4).
    """

    def __init__(self, robot: Robot, scene: Scene) -> None:
        self._robot, self._scene, self._n = robot, scene, len(robot.bodies)
        self._links = link_shapes(robot)
        self._things = [coal_bodies(solid_of(one)) for one in scene.obstacles]

    def pieces(self, pair: Pair, poses: FloatArray) -> tuple[list[Piece], list[Piece]]:
        """Of both bodies where the links stand, in the world's frame."""
        found = []
        for body in (pair.one, pair.other):
            if body >= self._n:
                found.append(list(self._scene.obstacles[body - self._n].pieces))
            else:
                link = self._robot.bodies[body]
                found.append(list(in_world(link.pieces, poses[link.frame])))
        return found[0], found[1]

    def measured(self, pair: Pair, poses: FloatArray) -> Measured:
        """Where the links stand; NaN where Coal cannot take a shape."""
        outer = pair.one >= self._n
        mine = self._placed(pair.other if outer else pair.one, poses)
        if outer:
            theirs: CoalObstacle | None = self._things[pair.one - self._n]
        else:
            theirs = self._placed(pair.other, poses)
        if mine is None or theirs is None:
            return Measured(nan, np.full(3, nan), np.full(3, nan))
        request = distance_request()
        found = (measure(request, b.geometry, b.pose, theirs) for b in mine)
        return min(found, key=lambda one: one.distance)

    def _placed(self, body: int, poses: FloatArray) -> tuple[CoalBody, ...] | None:
        parts = self._links[body]
        if parts is None:
            return None
        return tuple(placed(poses[self._robot.bodies[body].frame], p) for p in parts)


def _coal(
    coal: "CoalPairs", tree: Tree, path: Path, proof: Proof, pairs: list[Pair]
) -> Check:
    """Coal's distance of each pair at its witness, which the bracket must hold."""
    off = np.full(len(pairs), nan)
    seen = np.flatnonzero(np.isfinite(proof.upper))
    poses = tree.poses(path.within(proof.interval[seen], proof.share[seen]))
    for row, k in enumerate(seen.tolist()):
        value = coal.measured(pairs[k], poses[row]).distance
        if np.isnan(value):
            continue
        # Where bodies meet only the sign counts, on both sides.
        low, high = max(proof.lower[k], 0.0), max(proof.upper[k], 0.0)
        off[k] = max(low - max(value, 0.0), max(value, 0.0) - high)
        if not np.isfinite(value):
            off[k] = inf
    count = int((~np.isnan(off)).sum())
    k = int(np.nanargmax(off)) if count else 0
    agreed = count > 0 and off[k] <= TOLERANCES.coal_agreement
    return Check(
        COAL,
        Verdict.CERTIFIED if agreed else Verdict.UNDECIDED,
        count,
        float(off[k]) if count else nan,
        TOLERANCES.coal_agreement,
        "m",
        f"{count} of {len(pairs)} pairs measured, each where it was found nearest",
        float(proof.interval[k] + proof.share[k]) if count else nan,
    )
