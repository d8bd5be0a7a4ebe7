"""What every motion of a problem is asked: bodies on one tree, held apart in pairs."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import overload

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.geometry.solids import HalfSpace
from vdsm_pin.problem.error_boxes import NO_ERRORS, ErrorBox
from vdsm_pin.problem.scene import Obstacle, Scene, solid_of
from vdsm_pin.proof.bodies import Body, PairTable
from vdsm_pin.proof.bodies import ErrorBox as ProofBox
from vdsm_pin.proof.packed_tree import TreePoses
from vdsm_pin.proof.question import Question
from vdsm_pin.proof.tree import Tree
from vdsm_pin.verification.contacts import Placed
from vdsm_pin.verification.moving import joined_tree, obstacle_frames
from vdsm_pin.verification.records import Pair

BASE = 0
"""Number of the joint whose placement is where the base stands."""


@dataclass(frozen=True, eq=False)
class Assembly:
    """A snake arm or any other robot among obstacles, and what is held apart.

    Args:
        own_tree: Joints of the arm or robot.
        own: Bodies that ride on them.
        links: The link of each, from 1, 0 for the feed of an arm.
        names: The name of each; empty where that of its link says it.
        balls: Radius of the ball about the core of each: no depth beyond it is
            measured; [m].
        scene: The obstacles; their bodies are numbered after the others.
        table: The pairs: an obstacle and a body, or two bodies.
        column_errors: Of errors those of the columns of q, shape (n_columns,), to which
            the base adds its own; [rad], [m].
        packed: Pieces of the obstacles, then of the bodies, where they are packed.
        chain: How many of the first bodies hang together, links, tool and feed of a
            snake arm: off a mesh's triangles all are on that side of it on which the
            origin of the first one's frame is. 0 where each goes by itself.
    """

    own_tree: Tree
    own: Sequence[Body]
    links: Sequence[int]
    names: Sequence[str]
    balls: Sequence[float]
    scene: Scene
    table: PairTable
    column_errors: Callable[[ErrorBox], FloatArray]
    packed: PackedPieces | None = None
    chain: int = 0

    @cached_property
    def tree(self) -> Tree:
        """The joints of the arm or robot, then those that carry obstacles."""
        return joined_tree(self.own_tree, self.scene)

    @cached_property
    def poses(self) -> TreePoses:
        """T_base_frame of its frames, a function of rows of q."""
        return TreePoses(self.tree)

    @cached_property
    def bodies(self) -> list[Body]:
        """Those of the arm or robot, then the obstacles."""
        frames = obstacle_frames(self.own_tree, self.scene)
        both = zip(frames, self.scene.obstacles, strict=True)
        obstacles = (Body(frame, one.pieces, one.name) for frame, one in both)
        return [*self.own, *obstacles]

    @cached_property
    def outer(self) -> BoolArray:
        """Which pairs are with an obstacle, shape (n_pairs,)."""
        return np.asarray(self.table.one >= len(self.own))

    def among(self, pairs: IntArray) -> "Assembly":
        """The same with some of its pairs, whose numbers have shape (m,)."""
        table = self.table
        columns = table.one[pairs], table.other[pairs], table.required[pairs]
        return replace(self, table=PairTable(*columns))

    def sides(self, number: int) -> tuple[int, int]:
        """Both bodies of a pair in the order of its names, that of a link first."""
        one, other = int(self.table.one[number]), int(self.table.other[number])
        return (other, one) if one >= len(self.own) else (one, other)

    def ball(self, number: int) -> float:
        """Radius of the ball about the core of a pair's own body; [m]."""
        return self.balls[self.sides(number)[0]]

    def pair(self, number: int) -> Pair:
        """One pair as the reports name it, without naming all of a million."""
        return self.pair_of(*self.sides(number))

    def pair_of(self, one: int, other: int) -> Pair:
        """The pair of two bodies, that of a link first."""
        link, name = self.links[one], self.names[one]
        if other >= len(self.own):
            obstacle = self.scene.obstacles[other - len(self.own)].name
            return Pair(link, obstacle, body=name)
        return Pair(link, "", self.links[other], name, self.names[other])

    @property
    def pairs(self) -> "NamedPairs":
        """Every pair by name, in the order of the table."""
        return NamedPairs(self)

    def placed(self, number: int, poses: FloatArray) -> tuple[Placed, Placed]:
        """Both bodies of a pair where all frames stand, poses (n_frames, 4, 4); [m]."""
        both = (self.bodies[k] for k in self.sides(number))
        one, other = (Placed(body.pieces, poses[body.frame]) for body in both)
        return one, other

    @cached_property
    def question(self) -> Question:
        """All pairs, packed for any motion, without errors.

        Columns of the profile are the links, then the obstacles.
        """
        n = len(self.scene.obstacles)
        links = [max(0, link - 1) for link in self.links]
        columns = np.array([*links, *(max(self.links, default=0) + np.arange(n))], int)
        asked = self.tree, self.bodies, self.table, None, columns
        return Question.of(*asked, None if self.scene.moving else self.packed)

    def box(self, errors: ErrorBox) -> ProofBox:
        """Errors as the proof takes them.

        A joint that mimics another one errs by as much as its ratio makes of it.

        Raises:
            InvalidInput: If a half-space may be turned.
        """
        sizes = self.column_errors(errors)
        joints, shifts, tilts = np.zeros((3, len(self.tree.joints)))
        for k, joint in enumerate(self.own_tree.joints):
            if joint.column is not None:
                joints[k] = abs(joint.ratio) * sizes[joint.column]
        shifts[BASE], tilts[BASE] = errors.base, errors.base_turn
        grown = obstacle_growth(self.scene.obstacles, errors)
        return ProofBox(
            joints, shifts, tilts, np.array([*[0.0] * len(self.own), *grown])
        )


class NamedPairs(Sequence[Pair]):
    """The pairs of an assembly by name, each named when it is asked for.

    Args:
        asked: Whose they are.
    """

    def __init__(self, asked: Assembly) -> None:
        self._asked = asked

    def __len__(self) -> int:
        """Their number."""
        return self._asked.table.size

    @overload
    def __getitem__(self, number: int) -> Pair: ...
    @overload
    def __getitem__(self, number: slice) -> tuple[Pair, ...]: ...
    def __getitem__(self, number: int | slice) -> Pair | tuple[Pair, ...]:
        """One by its number in the table, or some."""
        if isinstance(number, slice):
            return tuple(self)[number]
        return self._asked.pair(range(len(self))[number])

    def __iter__(self) -> Iterator[Pair]:
        """Each of them, in the order of the table."""
        asked = self._asked
        sides = asked.table.one, asked.table.other
        own, others = np.where(asked.outer, sides[::-1], sides)
        return map(asked.pair_of, own.tolist(), others.tolist())


def obstacle_growth(obstacles: Sequence[Obstacle], errors: ErrorBox) -> list[float]:
    """How far the surface of each obstacle may be off; [m].

    A turn moves a point by its angle times the distance from the obstacle's middle at
    most, which is that of the box around its corners along the axes of the base.

    Raises:
        InvalidInput: If a half-space may be turned.
    """
    if errors == NO_ERRORS:
        return [0.0] * len(obstacles)
    found = []
    for obstacle in obstacles:
        error, reach = errors.of_obstacle(obstacle.name), 0.0
        if error.turn > 0.0:
            solid = solid_of(obstacle)
            if isinstance(solid, HalfSpace):
                message = f"obstacle {error.name!r}: a half-space cannot be turned"
                raise InvalidInput(message)
            points, grown = solid.corners, solid.grown
            middle = (points.min(axis=0) + points.max(axis=0)) / 2.0
            reach = float(np.linalg.norm(points - middle, axis=1).max()) + grown
        found.append(error.shift + error.turn * reach)
    return found
