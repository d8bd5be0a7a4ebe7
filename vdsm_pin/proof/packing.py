"""What is asked as compiled code reads it: bodies, pairs, what lies between them."""

from collections.abc import Sequence
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.convex import FlatCylinder, Hull, ends_of
from vdsm_pin.geometry.pieces import PackedPieces, pack_pieces
from vdsm_pin.proof.bodies import Body, PairTable
from vdsm_pin.proof.error_box import ErrorBox
from vdsm_pin.proof.packed_tree import PRISMATIC, PackedTree, pack_tree, strokes
from vdsm_pin.proof.terms import (
    LINKS,
    OBSTACLES,
    WORLD,
    Bodies,
    Pairs,
    Places,
    Rules,
    Task,
)
from vdsm_pin.proof.tree import Tree
from vdsm_pin.proof.ways import WayErrors, Ways, WayTable, way_errors


def _only_piece(body: Body) -> Hull | FlatCylinder:
    """The solid of a body that moves past another one."""
    if len(body.pieces) == 1:
        piece = body.pieces[0]
        if isinstance(piece, (Hull, FlatCylinder)):
            return piece
    message = f"body {body.name!r} moves in a pair: it must be one bounded convex piece"
    raise ValueError(message)


def _pack_bodies(every: Sequence[Body], numbers: IntArray, columns: IntArray) -> Bodies:
    """Some bodies, each convex, and where the profile has the bounds of all."""
    bodies = [every[k] for k in numbers.tolist()]
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
        number=numbers.astype(np.int64),
        frame=np.array([body.frame for body in bodies], dtype=np.int64),
        first=np.cumsum([0, *map(len, corners)], dtype=np.int64),
        corners=np.concatenate([np.zeros((0, 3)), *corners]),
        levers=np.concatenate([np.zeros(0), *levers]),
        radius=radius,
        discs=discs,
        inverse=np.array([_inverse(solid) for solid in solids]),
        column=columns[numbers].astype(np.int64),
    )


def _inverse(solid: Hull | FlatCylinder) -> float:
    """As `Bodies` has it."""
    if isinstance(solid, FlatCylinder) or len(solid.points) > 2:
        return -1.0
    way = solid.points[-1] - solid.points[0]
    squared = float(way @ way)
    return 1.0 / squared if squared > 0.0 else 0.0


FEW: Final = 8
"""Bodies of more corners are not looked through for corners that others have too."""


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


def _pack_pairs(
    tree: PackedTree, bodies: Bodies, rests: IntArray, pairs: Pairs
) -> tuple[Ways, Places, Pairs]:
    """Find what lies between the two sides of each pair, and where corners are seen.

    Args:
        tree: The joints.
        bodies: The bodies.
        rests: The frame in which each pair's partner rests, shape (n_pairs,).
        pairs: The pairs; their ways and places are not read.

    Returns:
        Ways and places, and the pairs with theirs.
    """
    table, n = _PlaceTable(tree), max(1, bodies.frame.size)
    each, first, number = np.unique(
        rests * n + pairs.body, return_index=True, return_inverse=True
    )
    way_of, slot_of = np.zeros((2, each.size), np.int64)
    found, count = [np.zeros(0, np.int64)], 0
    for k, pair in enumerate(first.tolist()):
        body, rest = int(pairs.body[pair]), int(rests[pair])
        frame = int(bodies.frame[body])
        way_of[k], slot_of[k] = table.ways.number(rest, frame), count
        found.append(table.places(bodies, body, rest))
        count += len(found[-1])
    places, slots = table.packed(), np.concatenate(found)
    packed = pairs._replace(
        way=way_of[number],
        slot=slot_of[number],
        slots=np.where(slots < 0, places.n_points - 1 - slots, slots),
    )
    return table.ways.packed(), places, packed


def pack_task(
    tree: Tree,
    bodies: Sequence[Body],
    pairs: PairTable,
    rules: Rules,
    reach: FloatArray | None = None,
    columns: IntArray | None = None,
    pieces: PackedPieces | None = None,
) -> Task:
    """What is asked, without errors.

    Args:
        tree: The joints.
        bodies: The bodies; they are the packed scene's obstacles, in their order.
        pairs: The first body of each is one bounded convex piece and moves past the
            second.
        rules: What may be assumed.
        reach: How large each column of q gets, where that is known, (n_columns,); where
            placements may turn and it is not, nothing is proved.
        columns: Where a profile has each body's bounds, -1 for nowhere, (n_bodies,).
        pieces: Those of the bodies packed already, at least of the second ones.

    Raises:
        ValueError: If a first body is not of that kind, or both ride on one frame.
    """
    joints, frames = pack_tree(tree, reach), np.array([body.frame for body in bodies])
    if columns is None:
        columns = np.full(len(bodies), -1)
    each, mover = np.unique(pairs.one, return_inverse=True)
    same = np.flatnonzero(frames[pairs.one] == frames[pairs.other])
    if same.size:
        one, other = pairs.one[same[0]], pairs.other[same[0]]
        message = f"bodies {one} and {other} ride on one frame: they cannot part"
        raise ValueError(message)
    branch, n = tree.branches, pairs.one.size
    apart = branch[frames[pairs.one]] != branch[frames[pairs.other]]
    group = np.where(apart, OBSTACLES, LINKS)
    column, none = np.where(apart, columns[pairs.other], -1), np.zeros(n, np.int64)
    packed = Pairs(
        rough=np.zeros((n, 0), np.int64) if pairs.rough is None else pairs.rough,
        body=mover.astype(np.int64),
        obstacle=pairs.other.astype(np.int64),
        way=none,
        slot=none,
        slots=none,
        group=group,
        column=column.astype(np.int64),
        required=pairs.required.astype(np.float64),
        loose=np.zeros(n) if pairs.loose is None else pairs.loose,
        lost=np.zeros(n),
        rise=np.zeros(n),
    )
    moving = _pack_bodies(bodies, each, columns)
    ways, places, packed = _pack_pairs(joints, moving, frames[pairs.other], packed)
    if pieces is None:
        pieces = pack_pieces([body.pieces for body in bodies])
    blank = np.zeros(joints.parent.size)
    exact = way_errors(joints, ways, blank, blank, blank)
    task = Task(pieces, joints, ways, exact, places, moving, packed, rules)
    return _erring(task, exact, np.zeros(n))


def for_motion(task: Task, tree: Tree, reach: FloatArray, rules: Rules) -> Task:
    """The same about a motion, of which errors are to be told by `with_errors`.

    Args:
        task: What is asked.
        tree: Its joints.
        reach: How large each column of q gets, shape (n_columns,).
        rules: What may be assumed.
    """
    joints = task.tree._replace(stroke=strokes(tree, reach))
    return task._replace(tree=joints, rules=rules)


def with_errors(task: Task, box: ErrorBox) -> Task:
    """The same asked about another error box."""
    pairs = task.pairs
    arrays = (np.ascontiguousarray(x) for x in (box.joints, box.shifts, box.tilts))
    erring = way_errors(task.tree, task.ways, *arrays)
    shift = erring.shifted[pairs.way]
    if box.surfaces is not None:
        moving = task.bodies.number[pairs.body]
        shift = shift + box.surfaces[pairs.obstacle] + box.surfaces[moving]
    return _erring(task, erring, shift)


def _erring(task: Task, errors: WayErrors, shift: FloatArray) -> Task:
    """The same with what errors come to, and by how much each pair is shifted.

    Where errors turn, what bodies sweep is told corner by corner: no pair is rough.
    """
    pairs, pad, steady = task.pairs, task.rules.pad, not errors.any_turn
    rules = task.rules._replace(steady=steady, nominal=steady and not shift.any())
    radius = task.bodies.radius[pairs.body]
    rough = pairs.rough if steady else np.full_like(pairs.rough, -1)
    lost = radius + pad + shift + pairs.loose
    pairs = pairs._replace(rough=rough, lost=lost, rise=pad - radius)
    return task._replace(pairs=pairs, rules=rules, errors=errors)
