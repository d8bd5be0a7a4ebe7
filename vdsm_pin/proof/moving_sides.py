"""The moving sides of pairs as compiled code reads them: corners and their places.

They are those of a robot, whatever stands around it: they are kept for its next scene.
"""

from collections.abc import Sequence
from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.convex import FlatCylinder, Hull, ends_of
from vdsm_pin.proof.bodies import Body
from vdsm_pin.proof.packed_tree import PRISMATIC, PackedTree, pack_tree
from vdsm_pin.proof.terms import WORLD, Bodies, Places
from vdsm_pin.proof.tree import Tree
from vdsm_pin.proof.ways import WayErrors, Ways, WayTable, way_errors

KEPT: Final = 2
"""Robots of which they are kept: those of a humanoid's hulls take 0.1 GB."""

FEW: Final = 8
"""Bodies of more corners are not looked through for corners that others have too."""


class MovingSides(NamedTuple):
    """Bodies, each seen from one or several frames.

    Args:
        bodies: The bodies; their numbers and columns are not theirs yet.
        ways: What lies between the frames.
        places: Where corners are seen.
        exact: What comes of no errors at all.
        way: Of each side that is asked for, shape (n_sides,).
        slot: Where the numbers of its corners' places start, shape (n_sides,).
        slots: Numbers of places.
    """

    bodies: Bodies
    ways: Ways
    places: Places
    exact: WayErrors
    way: IntArray
    slot: IntArray
    slots: IntArray


@lru_cache(maxsize=KEPT)
def moving_sides(
    tree: Tree, bodies: tuple[Body, ...], asked: tuple[tuple[int, int], ...]
) -> MovingSides:
    """What lies between both sides of pairs, and where corners are seen.

    Args:
        tree: The joints.
        bodies: Those that move in pairs, each one bounded convex piece.
        asked: The frame in which a partner rests, and the number of the body.

    Raises:
        ValueError: If a body is of another kind.
    """
    packed, joints = _pack_bodies(bodies), pack_tree(tree)
    table = _PlaceTable(joints)
    way, slot = np.zeros((2, len(asked)), np.int64)
    found, count = [np.zeros(0, np.int64)], 0
    for k, (rest, body) in enumerate(asked):
        way[k], slot[k] = table.ways.number(rest, bodies[body].frame), count
        found.append(table.places(packed, body, rest))
        count += len(found[-1])
    places, slots = table.packed(), np.concatenate(found)
    slots = np.where(slots < 0, places.n_points - 1 - slots, slots)
    ways, none = table.ways.packed(), np.zeros(joints.parent.size)
    exact = way_errors(joints, ways, none, none, none)
    return MovingSides(packed, ways, places, exact, way, slot, slots)


def _only_piece(body: Body) -> Hull | FlatCylinder:
    """The solid of a body that moves past another one."""
    if len(body.pieces) == 1:
        piece = body.pieces[0]
        if isinstance(piece, (Hull, FlatCylinder)):
            return piece
    message = f"body {body.name!r} moves in a pair: it must be one bounded convex piece"
    raise ValueError(message)


def _pack_bodies(bodies: Sequence[Body]) -> Bodies:
    """Some bodies, each convex."""
    solids = [_only_piece(body) for body in bodies]
    corners = [ends_of(solid) for solid in solids]
    discs, radius = np.zeros((len(solids), 4)), np.zeros(len(solids))
    for k, solid in enumerate(solids):
        if isinstance(solid, FlatCylinder):
            discs[k, :3], discs[k, 3] = solid.axis, solid.radius
        else:
            radius[k] = solid.radius
    levers = [
        np.linalg.norm(points, axis=1) + disc
        for points, disc in zip(corners, discs[:, 3], strict=True)
    ]
    return Bodies(
        number=np.arange(len(solids)),
        frame=np.array([body.frame for body in bodies], dtype=np.int64),
        first=np.cumsum([0, *map(len, corners)], dtype=np.int64),
        corners=np.concatenate([np.zeros((0, 3)), *corners]),
        levers=np.concatenate([np.zeros(0), *levers]),
        radius=radius,
        discs=discs,
        inverse=np.array([_inverse(solid) for solid in solids]),
        column=np.full(len(solids), -1),
    )


def _inverse(solid: Hull | FlatCylinder) -> float:
    """As `Bodies` has it."""
    if isinstance(solid, FlatCylinder) or len(solid.points) > 2:
        return -1.0
    way = solid.points[-1] - solid.points[0]
    squared = float(way @ way)
    return 1.0 / squared if squared > 0.0 else 0.0


class _PlaceTable:
    """Collects the places of corners, those of small bodies each once."""

    def __init__(self, tree: PackedTree) -> None:
        self.ways = WayTable(tree.parent)
        self._tree = tree
        self._known: dict[tuple[int, bytes, float], int] = {}
        self._blocks: dict[int, IntArray] = {}
        self._local: dict[tuple[int, int], int] = {}
        self._frames: list[IntArray] = [np.zeros(0, np.int64)]
        self._at: list[FloatArray] = [np.zeros((0, 3))]
        self._lever: list[FloatArray] = [np.zeros(0)]
        self._points: list[IntArray] = [np.zeros(0, np.int64)]
        self._seen_on: list[IntArray] = [np.zeros(0, np.int64)]
        self._n_points = self._n_seen = 0

    def places(self, bodies: Bodies, body: int, rest: int) -> IntArray:
        """Where the corners of a body are seen from a frame.

        Returns:
            Numbers of points in the world; of other places -1 - their number.
        """
        corners = slice(bodies.first[body], bodies.first[body + 1])
        at, lever = bodies.corners[corners], bodies.levers[corners]
        frame = int(bodies.frame[body])
        if len(at) > FEW:
            if body not in self._blocks:
                self._blocks[body] = self._add(frame, at, lever)
            points = self._blocks[body]
            if rest == WORLD:
                return points
            return self._see(points, self.ways.number(rest, frame))
        found = [
            self._place(rest, *self._corner(rest, frame, *corner))
            for corner in zip(at, lever.tolist(), strict=True)
        ]
        return np.array(found, dtype=np.int64)

    def _corner(
        self, rest: int, frame: int, at: FloatArray, lever: float
    ) -> tuple[int, int]:
        """The point of a corner and the way on which it is seen.

        The origin of a joint that turns also rides on the frame that it hangs on, where
        fewer joints move it.
        """
        tree = self._tree
        while frame != rest and lever == 0.0 and self.ways.goes_down(rest, frame):
            joint = frame - 1
            if tree.kind[joint] == PRISMATIC:
                break
            frame, at = int(tree.parent[joint]), tree.shift[joint]
            lever = float(tree.lever[joint])
        key = (frame, at.tobytes(), lever)
        if key not in self._known:
            self._known[key] = int(self._add(frame, at[None], np.array([lever]))[0])
        return self._known[key], self.ways.number(rest, frame)

    def _place(self, rest: int, point: int, way: int) -> int:
        if rest == WORLD:
            return point
        if (point, way) not in self._local:
            self._local[point, way] = int(self._see(np.array([point]), way)[0])
        return self._local[point, way]

    def _see(self, points: IntArray, way: int) -> IntArray:
        """Numbers of new places, of points as seen from the start of a way."""
        first = self._n_seen
        self._points.append(points)
        self._seen_on.append(np.full(len(points), way))
        self._n_seen += len(points)
        return -1 - np.arange(first, self._n_seen)

    def _add(self, frame: int, at: FloatArray, lever: FloatArray) -> IntArray:
        """Numbers of new points of a frame."""
        first = self._n_points
        self._frames.append(np.full(len(at), frame))
        self._at.append(at)
        self._lever.append(lever)
        self._n_points += len(at)
        return np.arange(first, self._n_points)

    def packed(self) -> Places:
        """All places, those in the world first."""
        n = self._n_points
        frames, which = np.unique(np.concatenate(self._frames), return_inverse=True)
        ways = [self.ways.number(WORLD, frame) for frame in frames.tolist()]
        ways_of = np.array(ways, dtype=np.int64)[which]
        points = np.concatenate([np.arange(n), *self._points])
        return Places(
            n_points=n,
            point=points,
            way=np.concatenate([ways_of, *self._seen_on]),
            at=np.concatenate(self._at)[points],
            lever=np.concatenate(self._lever)[points],
            every=np.arange(len(points)),
        )
