"""Random trees with two bodies on them, and how near they come by closed forms.

One body is a ball, a capsule or a solid whose distance from a point is known; the
other a ball or a capsule. The distance of a point on a segment from a convex solid is
convex along it, so golden sections find the least one. Whatever they find is the
distance of two points of the bodies: an upper bound, however it was found.
"""

from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull
from vdsm_pin.proof.bodies import Body, ErrorBox
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.tree import Joint, Kind, Tree

SHAPES = ("ball", "capsule", "box", "cylinder", "triangle", "half-space", "pieces")
GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0
SECTIONS = 40

AXES = np.concatenate([np.eye(3), -np.eye(3)])
Random: TypeAlias = np.random.Generator


def random_placement(rng: Random, size: float = 0.3) -> FloatArray:
    """A rigid motion, every third one without rotation; [m]."""
    placement = np.eye(4)
    placement[:3, 3] = rng.uniform(-size, size, 3) * rng.integers(0, 2, 3)
    if rng.integers(3):
        placement[:3, :3] = rotation_from_rpy(rng.uniform(-np.pi, np.pi, 3))
    return placement


def random_tree(rng: Random, n_joints: int) -> Tree:
    """A tree or forest with every kind of joint, some of which mimic others."""
    joints, columns = [], 0
    for number in range(n_joints):
        kind = Kind(rng.choice(3, p=[0.15, 0.65, 0.2]))
        axis = AXES[rng.integers(6)]
        if rng.integers(2):
            axis = rng.normal(size=3)
            axis /= np.linalg.norm(axis)
        column, ratio = None, 1.0
        if kind is not Kind.FIXED and rng.uniform() < 0.95:
            column = columns
            if columns and rng.uniform() < 0.1:
                column, ratio = int(rng.integers(columns)), rng.uniform(-2.0, 2.0)
            columns = max(columns, column + 1)
        parent = number if rng.uniform() < 0.7 else int(rng.integers(number + 1))
        offset = float(rng.choice([0.0, rng.uniform(-1.0, 1.0)]))
        placement, name = random_placement(rng), f"j{number}"
        joints.append(Joint(parent, kind, axis, placement, column, ratio, offset, name))
    return Tree(tuple(joints))


def random_path(rng: Random, tree: Tree, n_rows: int, degree: int) -> Path:
    """Knots some of whose columns rest, and pieces of a degree between them."""
    shape = (n_rows, tree.n_columns)
    size = rng.choice([1e-3, 0.1, 0.5], tree.n_columns)
    q = rng.uniform(-1.5, 1.5, tree.n_columns) + size * rng.uniform(-1.0, 1.0, shape)
    times = np.cumsum(rng.uniform(0.2, 1.5, n_rows))
    rates, changes = size * rng.normal(size=(2, *shape))
    if degree == 1:
        return Path(q, times=times)
    if degree == 3:
        return Path.through(q, times, rates)
    return Path.through(q, times, rates, changes)


def random_box(rng: Random, tree: Tree) -> ErrorBox:
    """Errors of joints and of placements, or none; [rad], [m]."""
    n = len(tree.joints)
    joints = rng.choice([0.0, 1e-3, 0.02], n) * rng.choice([0.0, 1.0])
    tilts = rng.choice([0.0, 0.0, 0.01], n) * rng.choice([0.0, 1.0])
    shifts = rng.choice([0.0, 1e-3], n) * rng.choice([0.0, 1.0])
    return ErrorBox(joints, shifts, tilts)


def wrong_poses(
    tree: Tree, q: FloatArray, box: ErrorBox, rng: Random, shifting: bool = True
) -> FloatArray:
    """Poses at one row with errors in corners of the box, shape (n_frames, 4, 4).

    Args:
        tree: The tree.
        q: Shape (n_columns,).
        box: The errors.
        rng: Chooses corners.
        shifting: Whether origins are shifted too, by placements and prismatic joints.
    """
    poses, values = np.tile(np.eye(4), (tree.n_frames, 1, 1)), tree.values(q[None])[0]
    for number, joint in enumerate(tree.joints):
        off = box.joints[number] * rng.choice([-1.0, 1.0])
        if joint.kind is Kind.FIXED or (joint.kind is Kind.PRISMATIC and not shifting):
            off = 0.0
        tilt = turn_about(unit(rng), box.tilts[number])
        placed = np.array(joint.placement)
        placed[:3, 3] += shifting * box.shifts[number] * unit(rng)
        placed = placed @ tilt @ moved(joint, values[number] + off)
        poses[number + 1] = poses[joint.parent] @ placed
    return poses


def turn_about(axis: FloatArray, angle: float) -> FloatArray:
    """A turn about a unit vector as a rigid motion, by the exponential (Rodrigues)."""
    x, y, z = axis
    cross, pose = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]), np.eye(4)
    pose[:3, :3] += np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross
    return pose


def moved(joint: Joint, value: float) -> FloatArray:
    """What a joint does at a value [rad] or [m]."""
    if joint.kind is Kind.REVOLUTE:
        return turn_about(joint.axis, value)
    pose = np.eye(4)
    if joint.kind is Kind.PRISMATIC:
        pose[:3, 3] = value * np.asarray(joint.axis)
    return pose


# ---- solids and their distance from points -------------------------------------------


def unit(rng: Random) -> FloatArray:
    v = rng.normal(size=3)
    return np.asarray(v / np.linalg.norm(v))


def random_pieces(rng: Random, shape: str) -> tuple[Any, ...]:
    """The pieces of a body of a shape."""
    centre, size = rng.uniform(-0.3, 0.3, 3), rng.uniform(0.01, 0.15)
    if shape == "ball":
        return (Hull(centre[None], size),)
    if shape == "capsule":
        return (Hull(np.stack([centre, centre + 0.3 * unit(rng)]), size),)
    if shape == "box":
        half = rng.uniform(0.02, 0.2, 3)
        signs = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
        return (_Box(centre, rotation_from_rpy(rng.normal(size=3)), half).hull(signs),)
    if shape == "cylinder":
        return (FlatCylinder(centre, unit(rng), rng.uniform(0.02, 0.2), size),)
    if shape == "triangle":
        return (Hull(centre + 0.2 * rng.normal(size=(3, 3))),)
    if shape == "half-space":
        return (HalfSpacePiece(unit(rng), -rng.uniform(0.2, 1.0)),)
    kinds = [str(rng.choice(SHAPES[:5])) for _ in range(int(rng.integers(2, 5)))]
    return tuple(piece for kind in kinds for piece in random_pieces(rng, kind))


@dataclass(frozen=True)
class _Box:
    centre: FloatArray
    turn: FloatArray
    half: FloatArray

    def hull(self, signs: FloatArray) -> Hull:
        return Hull(self.centre + (signs * self.half) @ self.turn.T)


def _from_triangle(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Distances of points (n, 3) from a triangle, by its plane and its edges."""
    a, b, c = corners
    edges = [_from_segment(points, *ends) for ends in ((a, b), (b, c), (c, a))]
    least = np.minimum.reduce(edges)
    normal = np.cross(b - a, c - a)
    normal /= np.linalg.norm(normal)
    inside = np.ones(len(points), bool)
    for start, end in ((a, b), (b, c), (c, a)):
        inside &= (points - start) @ np.cross(normal, end - start) >= 0.0
    return np.where(inside, np.abs((points - a) @ normal), least)


def _from_segment(points: FloatArray, a: FloatArray, b: FloatArray) -> FloatArray:
    d = b - a
    t = np.clip((points - a) @ d / (d @ d), 0.0, 1.0)
    return np.asarray(np.linalg.norm(points - a - t[:, None] * d, axis=1))


def from_piece(points: FloatArray, piece: Any) -> FloatArray:
    """Distances of points (n, 3) from a piece, 0 inside but for a half-space; [m]."""
    if isinstance(piece, HalfSpacePiece):
        return np.asarray(points @ piece.normal - piece.offset)
    if isinstance(piece, FlatCylinder):
        away = points - piece.centre
        along = away @ piece.axis
        across = np.linalg.norm(away - along[:, None] * piece.axis, axis=1)
        beyond = np.maximum(np.abs(along) - piece.half_length, 0.0)
        return np.hypot(beyond, np.maximum(across - piece.radius, 0.0))
    n = len(piece.points)
    if n == 1:
        return np.linalg.norm(points - piece.points[0], axis=1) - piece.radius
    if n == 2:
        return _from_segment(points, *piece.points) - piece.radius
    if n == 3:
        return _from_triangle(points, piece.points) - piece.radius
    x, y, z = piece.points[[4, 2, 1]] - piece.points[0]  # edges of a box
    edges = np.stack([x, y, z])
    size = np.linalg.norm(edges, axis=1)
    local = (points - piece.points[0]) @ (edges / size[:, None]).T
    beyond = np.maximum(np.maximum(-local, local - size), 0.0)
    return np.asarray(np.linalg.norm(beyond, axis=1))


def distances(start: FloatArray, end: FloatArray, piece: Any) -> FloatArray:
    """Distances of segments, ends (n, 3) each, from a piece, shape (n,); [m]."""
    best = np.minimum(from_piece(start, piece), from_piece(end, piece))
    low, high = np.zeros((len(start), 1)), np.ones((len(start), 1))
    for _ in range(SECTIONS if (start != end).any() else 0):
        one, other = high - GOLDEN * (high - low), low + GOLDEN * (high - low)
        a = from_piece(start + one * (end - start), piece)
        b = from_piece(start + other * (end - start), piece)
        best, left = np.minimum(best, np.minimum(a, b)), (a < b)[:, None]
        low, high = np.where(left, low, one), np.where(left, other, high)
    return best


# ---- queries -------------------------------------------------------------------------


@dataclass(frozen=True)
class TreeQuery:
    """Two bodies of a tree on a path, and how near they are known to come.

    Args:
        tree: The tree.
        bodies: A ball or capsule, and a body of any shape.
        path: The path; one interval.
        shape: Of the second body.
        nearest: An upper bound of their least clearance on the path; [m].
        share: When that is met, 0 to 1.
    """

    tree: Tree
    bodies: tuple[Body, Body]
    path: Path
    shape: str
    nearest: float
    share: float


def at(path: Path, t: FloatArray) -> FloatArray:
    """Rows of the first piece of a path at times (n,), 0 to 1, (n, n_columns)."""
    points = np.repeat(path.controls[:1], len(t), axis=0)
    while points.shape[1] > 1:
        points = points[:, :-1] + t[:, None, None] * np.diff(points, axis=1)
    return np.asarray(points[:, 0])


def clearances(tree: Tree, bodies: tuple[Body, Body], poses: FloatArray) -> FloatArray:
    """Of two bodies at given poses of all frames, shape (n,); [m]."""
    seen = np.linalg.inv(poses[:, bodies[1].frame]) @ poses[:, bodies[0].frame]
    core = bodies[0].pieces[0]
    start, end = (
        np.einsum("nij,j->ni", seen[:, :3, :3], core.points[k]) + seen[:, :3, 3]
        for k in (0, -1)
    )
    found = [distances(start, end, piece) for piece in bodies[1].pieces]
    return np.asarray(np.minimum.reduce(found) - core.radius)


def make_query(rng: Random, degree: int, n_joints: int) -> TreeQuery:
    """A query whose least clearance is looked for by samples, ever closer."""
    tree = random_tree(rng, n_joints)
    frame, rest = rng.choice(tree.n_frames, 2, replace=False).tolist()
    shape = str(rng.choice(SHAPES))
    ball = random_pieces(rng, str(rng.choice(SHAPES[:2])))
    bodies = (Body(frame, ball, "ball"), Body(rest, random_pieces(rng, shape), shape))
    path = random_path(rng, tree, 2, degree)
    low, high, best, share = 0.0, 1.0, np.inf, 0.0
    for n in (33, 9, 9, 9, 9, 9):
        t = np.linspace(low, high, n)
        found = clearances(tree, bodies, tree.poses(at(path, t)))
        k = int(np.argmin(found))
        if found[k] < best:
            best, share = float(found[k]), float(t[k])
        step = (high - low) / (n - 1)
        low, high = max(0.0, share - step), min(1.0, share + step)
    return TreeQuery(tree, bodies, path, shape, best, share)
