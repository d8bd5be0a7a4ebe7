"""A clearance function that leaves alone what is obviously far away.

Most links are far from most obstacles. Axis-parallel boxes round the obstacles and
round a few stretches of each link give a lower bound of the clearance at once, and the
distance from a mesh is known but for rounding. Where boxes leave a doubt, the function
passed in is asked; beside meshes, which it would look at again, the other obstacles
alone are measured.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from vdsm_pin.compiled import borrowed, compiled
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hulls, Piece
from vdsm_pin.geometry.links import link_clearances
from vdsm_pin.geometry.ordering import coherent_order
from vdsm_pin.geometry.pieces import HELD, PackedPieces, disc_extent, pack_pieces
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.planner.mesh_distance import Surfaces, surfaces_of
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.planner.time_limit import deadline_of
from vdsm_pin.problem.held import Axes, HeldApart, HeldGroup
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, covers_of
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES

FAR = 0.0256
"""A bound of the clearance above this is as good as the clearance itself, over the
arm's length; [-]."""
STEP = 3.19e-7
"""What is taken off distances from meshes for rounding, over the arm's length; [-]."""
STRETCHES = 6
"""Stretches into which a link is cut for its boxes."""
SLICES = 8
"""Boxes along a long hull or cylinder that lies askew."""
MOST_BOXES = 32
"""Boxes round an obstacle of many pieces."""


@dataclass(frozen=True)
class Cover:
    """What bounds the distance to obstacles that the same axes are held apart from.

    Args:
        boxes: Low and high corners of boxes that cover the obstacles, (b, 2, 3); [m].
        planes: Outward normals and offsets of the half-spaces, shape (p, 4).
        surfaces: The meshes, which have no boxes.
        others: All but the meshes.
        insides: What measuring them asks for, of meshes alone.
        group: Says which obstacles and axes they are.
    """

    boxes: FloatArray
    planes: FloatArray
    surfaces: Surfaces
    others: PackedPieces
    insides: IntArray
    group: HeldGroup

    @classmethod
    def of(
        cls, obstacles: tuple[Obstacle, ...], group: HeldGroup, step: float
    ) -> "Cover":
        """Of a group's obstacles, with steps of so much; [m]."""
        solid = tuple(one for one in obstacles if not isinstance(one, Mesh))
        covers = [_cover(obstacle) for obstacle in solid]
        flat = [
            [*piece.normal, piece.offset]
            for obstacle in solid
            for piece in obstacle.pieces
            if isinstance(piece, HalfSpacePiece)
        ]
        boxes = np.concatenate([np.zeros((0, 2, 3)), *covers])
        planes, surfaces = np.array(flat).reshape(-1, 4), surfaces_of(obstacles, step)
        others = pack_pieces([one.pieces for one in solid])
        return cls(boxes, planes, surfaces, others, covers_of(solid, others), group)

    def bounds(
        self,
        ends: FloatArray,
        radii: FloatArray,
        far: float,
        floor: float,
        deadline: Deadline,
    ) -> tuple[FloatArray, FloatArray]:
        """Bounds from boxes and from meshes, see `BroadPhase`, shape (n,) each; [m]."""
        enough = far + self.group.radius
        boxes = _box_bounds(ends, self.boxes, self.planes, STRETCHES, enough)
        # Who asks for what is below 0 asks for what is far, too.
        most = np.inf if floor == -np.inf else enough
        least = floor + radii.min(initial=self.group.radius)
        mesh = self.surfaces.least(ends, least, most, deadline)
        return boxes - radii, mesh - radii

    def beside_meshes(
        self, ends: FloatArray, number: IntArray | None
    ) -> tuple[IntArray, FloatArray]:
        """Clearance from all but meshes, up to two steps less: whose, and how much.

        Args:
            ends: Shape (n, 2, 3); [m].
            number: Which axis each is of, shape (n,); None where all are alike.
        """
        which, some, radii = self.group.held(ends, number)
        return which, self._others(some) - radii

    def least(
        self, ends: FloatArray, number: IntArray | None, asked: "BroadPhase"
    ) -> tuple[IntArray, FloatArray]:
        """Clearance from all, as a broad phase has it; as `beside_meshes`."""
        which, some, radii = self.group.held(ends, number)
        least, mesh = self.bounds(some, radii, asked.far, asked.floor, asked.deadline)
        near = np.flatnonzero(least < asked.far)
        least[near] = self._others(some[near]) - radii[near]
        return which, np.minimum(least, mesh)

    def _others(self, ends: FloatArray) -> FloatArray:
        """Distance from all but meshes, up to two steps less, shape (n,); [m]."""
        step = self.surfaces.step
        gaps = link_clearances(self.others, self.insides, ends, 0.0, step, step)
        return np.asarray(gaps[:, 0])


@dataclass(frozen=True)
class BroadPhase:
    """Lower bounds of the clearance, exact where it is small but enough.

    Near meshes bounds may be up to two steps of `surfaces` below the clearance.

    Args:
        clearance: The clearance function.
        covers: Of the obstacles.
        held: Which axes are held apart from them.
        floor: Clearance below which -inf will do; where that is -inf, all bounds from
            meshes are exact; [m].
        far: A bound from boxes above this is left as it is; [m].
        step: Of `surfaces`; [m].
        deadline: When planning must have ended.
        keeping: Which links keep a margin from which obstacles, None for none: the
            clearance between these is less by the margin.
        margins: The obstacles that some keep a margin from.
    """

    clearance: LinkClearance
    covers: tuple[Cover, ...]
    held: HeldApart
    floor: float
    far: float
    step: float
    deadline: Deadline = NO_LIMIT
    keeping: HeldApart | None = None
    margins: tuple[Cover, ...] = ()

    def __call__(self, centres: FloatArray, axes: Axes = None, /) -> FloatArray:
        """Joint centres (n, m + 1, 3) to lower bounds (n, m); [m]."""
        self.deadline.check()
        shape = len(centres), centres.shape[1] - 1
        ends = np.stack([centres[:, :-1], centres[:, 1:]], axis=2).reshape(-1, 2, 3)
        number = None if self.held.alike else self.held.numbers(axes, shape)
        clearances, mesh = np.full((2, len(ends)), np.inf)
        for cover in self.covers:
            which, some, radii = cover.group.held(ends, number)
            boxes, surfaces = cover.bounds(
                some, radii, self.far, self.floor, self.deadline
            )
            np.minimum.at(clearances, which, boxes)
            np.minimum.at(mesh, which, surfaces)
        # A step below the distance will do, but not where it decides.
        near = clearances < self.far
        near |= mesh < min(self.far, self.floor + self.step)
        np.minimum(clearances, mesh, out=clearances)
        blocked = near & (mesh < self.floor - self.step)
        clearances[blocked] = -np.inf
        near &= ~blocked
        # Where no step of a mesh decides, what is beside meshes is measured alone.
        alone = near & (mesh >= self.floor + self.step) & (mesh < np.inf)
        asked = np.flatnonzero(near & ~alone)
        if asked.size:
            of = None if number is None else number[asked, None]
            clearances[asked] = self.clearance(ends[asked], of)[:, 0]
        asked = np.flatnonzero(alone)
        if asked.size:
            clearances[asked] = mesh[asked]
            of = None if number is None else number[asked]
            for cover in self.covers:
                which, gaps = cover.beside_meshes(ends[asked], of)
                np.minimum.at(clearances, asked[which], gaps)
        if self.keeping is not None:
            number = self.keeping.numbers(axes, shape)
            for cover in self.margins:
                which, gaps = cover.least(ends, number, self)
                np.minimum.at(clearances, which, gaps)
        return clearances.reshape(shape)

    def up_to(self, far: float) -> "BroadPhase":
        """The same, exact only below another bound; [m]."""
        return replace(self, far=far)

    def hurried(self, share: float) -> "BroadPhase":
        """The same, for a part of the time that is left; [-]."""
        return replace(self, deadline=self.deadline.share(share))

    @property
    def bare(self) -> "BroadPhase":
        """The same without margins."""
        return replace(self, keeping=None, margins=())


def broad_phase(
    problem: PlanningProblem,
    clearance: LinkClearance,
    margins: FloatArray | None = None,
) -> BroadPhase:
    """The clearance function of a problem with its boxes.

    Args:
        problem: Arm and scene.
        clearance: The clearance function.
        margins: What links keep from obstacles besides, by which the clearance is less,
            shape (N, n_obstacles); None for nothing; [m].
    """
    length = problem.manipulator.total_length
    quick = BroadPhase(
        clearance,
        _covers(problem, problem.held),
        problem.held,
        problem.required_clearance - TOLERANCES.planned_clearance,
        FAR * length,
        STEP * length,
        deadline=deadline_of(clearance),
    )
    if margins is None or not margins.any():
        return quick
    kept = problem.held.keeping(margins)
    return replace(quick, keeping=kept, margins=_covers(problem, kept))


def keeping(
    problem: PlanningProblem, clearance: LinkClearance, margins: FloatArray
) -> LinkClearance:
    """The clearance function, less by what links keep from obstacles besides.

    Arguments are those of `broad_phase`.
    """
    return broad_phase(problem, clearance, margins) if margins.any() else clearance


def cuts_of(problem: PlanningProblem, clearance: LinkClearance) -> BoolArray | None:
    """Joints at which pieces of an arm end for a clearance function, shape (N + 1,).

    None where a piece may be of any links.
    """
    kept = getattr(clearance, "keeping", None)
    if kept is None:
        return None if problem.held.alike else problem.held.cuts
    return np.asarray(problem.held.cuts | kept.cuts)


def _covers(problem: PlanningProblem, held: HeldApart) -> tuple[Cover, ...]:
    obstacles, step = problem.scene.obstacles, STEP * problem.manipulator.total_length
    return tuple(
        Cover.of(tuple(obstacles[o] for o in group.obstacles), group, step)
        for group in held.groups
    )


def _cover(obstacle: Obstacle) -> FloatArray:
    """Boxes that cover an obstacle but for its half-spaces, shape (n, 2, 3); [m]."""
    boxes = _all_boxes(obstacle.pieces)
    if len(boxes) <= MOST_BOXES:
        return boxes
    order = coherent_order(boxes.mean(axis=1))
    groups = [boxes[part] for part in np.array_split(order, MOST_BOXES)]
    pairs = [[part[:, 0].min(axis=0), part[:, 1].max(axis=0)] for part in groups]
    return np.array(pairs)


def _all_boxes(pieces: Sequence[Piece]) -> FloatArray:
    """The boxes of all pieces, shape (n, 2, 3); [m]."""
    if isinstance(pieces, Hulls):
        low = pieces.corners.min(axis=1) - pieces.radius
        high = pieces.corners.max(axis=1) + pieces.radius
        return np.stack([low, high], axis=1)
    return np.concatenate([_boxes(piece) for piece in pieces])


def _boxes(piece: Piece) -> FloatArray:
    """Boxes that cover a piece, none for a half-space, shape (n, 2, 3); [m]."""
    if isinstance(piece, FlatCylinder):
        half = piece.half_length * piece.axis
        grow = piece.radius * HELD * disc_extent(piece.axis)
        return _cut(piece.centre - half, piece.centre + half, grow)
    if isinstance(piece, HalfSpacePiece):
        return np.zeros((0, 2, 3))
    if len(piece.points) == 2:
        return _cut(piece.points[0], piece.points[1], np.full(3, piece.radius))
    low = piece.points.min(axis=0) - piece.radius
    high = piece.points.max(axis=0) + piece.radius
    return np.stack([low, high])[None]


def _cut(start: FloatArray, end: FloatArray, grow: FloatArray) -> FloatArray:
    """Boxes round a swept line, in slices where it lies askew, shape (n, 2, 3)."""
    askew = (np.abs(end - start) > TOLERANCES.bracket_gap).sum() > 1
    marks = np.linspace(0.0, 1.0, 1 + (SLICES if askew else 1))[:, None]
    points = start + marks * (end - start)
    low = np.minimum(points[:-1], points[1:]) - grow
    high = np.maximum(points[:-1], points[1:]) + grow
    return np.stack([low, high], axis=1)


@compiled
def _box_gap(
    a: FloatArray, b: FloatArray, t0: float, t1: float, box: FloatArray
) -> float:
    """Squared distance of a box from the box round a stretch of a segment; [m^2]."""
    gap = 0.0
    for c in range(3):
        one, two = a[c] + t0 * (b[c] - a[c]), a[c] + t1 * (b[c] - a[c])
        out = max(box[0, c] - max(one, two), min(one, two) - box[1, c])
        if out > 0.0:
            gap += out * out
    return gap


@compiled
def _box_bounds(
    ends: FloatArray,
    boxes: FloatArray,
    planes: FloatArray,
    stretches: int,
    enough: float,
) -> FloatArray:
    """Lower bounds of the distance from segments to boxes and half-spaces.

    Args:
        ends: Shape (n, 2, 3); [m].
        boxes: Low and high corners, shape (b, 2, 3); [m].
        planes: Outward normals and offsets, shape (p, 4).
        stretches: Number of stretches of each segment.
        enough: A distance from which on the box of the whole segment will do; [m].
    """
    ends, boxes = borrowed(ends), borrowed(boxes)
    result = np.full(ends.shape[0], np.inf)
    for n in range(ends.shape[0]):
        a, z = ends[n]
        best = np.inf
        for p in range(planes.shape[0]):
            for e in range(2):
                height = -planes[p, 3]
                for c in range(3):
                    height += planes[p, c] * ends[n, e, c]
                best = min(best, height)
        square = np.inf
        for b in range(boxes.shape[0]):
            gap = _box_gap(a, z, 0.0, 1.0, boxes[b])
            if gap >= square:
                continue
            if gap < enough * enough:
                gap = np.inf
                for s in range(stretches):
                    t0, t1 = s / stretches, (s + 1) / stretches
                    gap = min(gap, _box_gap(a, z, t0, t1, boxes[b]))
            square = min(square, gap)
        result[n] = min(best, np.sqrt(square))
    return result
