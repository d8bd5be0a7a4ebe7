"""Queries on which a clearance proof is easily wrong, with the truth built in.

A query is a link, an obstacle and a motion whose least clearance is known: a contact
point c on the link's axis, a unit normal n, and an obstacle whose least n.x is met at
p = c + (radius + clearance) n. The plane through p proves the clearance from below, the
points c and p from above. The motions keep n.x of the link from growing: none, along
the rail (n across it), round the base's z axis (n along it), or away from the contact.
The truth is exact up to the rounding of the numbers that describe the query, below
1e-13 m; `exact_bracket` recomputes it in ball arithmetic from those numbers.
"""

from dataclasses import dataclass
from itertools import product
from typing import Any, Final

import numpy as np
from flint import arb, ctx

from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull
from vdsm_pin.kinematics import joint_centres
from vdsm_pin.manipulator import CableLayout, Manipulator, paper_hole_angles
from vdsm_pin.problem import DesiredPath, PlanningProblem
from vdsm_pin.scene import Scene
from vdsm_pin.trajectory import Trajectory

MOTIONS: Final = ("none", "still", "rail", "away", "base_turn")
SHAPES: Final = (
    "sphere",
    "capsule_side",
    "capsule_parallel",
    "capsule_cap",
    "cylinder_side",
    "cylinder_parallel",
    "cylinder_cap",
    "cylinder_rim",
    "box_face",
    "box_edge",
    "box_corner",
    "mesh_box",
    "sliver_face",
    "sliver_edge",
    "sliver_corner",
    "plate",
    "half_space",
)
DECIDABLE: Final = 2e-11
"""Nearer to the limit than the verifier's padding nothing can be decided; [m]."""
CORNERS: Final = np.array(list(product((-1.0, 1.0), repeat=3)))
FACES: Final = np.array(
    [
        *[(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1)],
        *[(2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)],
    ]
)


@dataclass(frozen=True)
class Body:
    """An obstacle of stated pieces; stands in for those of the scene module."""

    name: str
    pieces: tuple[Any, ...]


@dataclass(frozen=True)
class Batch:
    """Queries about one motion, one obstacle each.

    Args:
        problem: All obstacles in one scene.
        trajectory: One row, or two.
        motion: One of MOTIONS.
        shape: One of SHAPES for each query.
        link: The link that is asked about, from 0, shape (n,).
        excess: True clearance less the required one, shape (n,); [m].
        time: When the least clearance is met, shape (n,).
        normal: n, shape (n, 3).
        station: Where on the link's axis, 0 to 1, shape (n,).
        contact: p, shape (n, 3); [m].
    """

    problem: PlanningProblem
    trajectory: Trajectory
    motion: str
    shape: list[str]
    link: Any
    excess: Any
    time: Any
    normal: Any
    station: Any
    contact: Any


def across(n: Any, rng: np.random.Generator) -> tuple[Any, Any]:
    """Two unit vectors that make a frame with each n, turned at random."""
    helper = np.eye(3)[np.argmin(np.abs(n), axis=1)]
    u = np.cross(n, helper)
    u /= np.linalg.norm(u, axis=1)[:, None]
    v = np.cross(n, u)
    angle = rng.uniform(-np.pi, np.pi, len(n))[:, None]
    return np.cos(angle) * u + np.sin(angle) * v, np.cos(angle) * v - np.sin(angle) * u


def small_angles(rng: np.random.Generator, size: int) -> Any:
    """Angles in [0, pi/2], often 0, pi/2 or within 1e-4 .. 1e-12 of them."""
    angle = rng.uniform(0.0, np.pi / 2, size)
    tiny = 10.0 ** rng.uniform(-12, -4, size)
    pick = rng.integers(0, 6, size)
    angle = np.where(pick == 0, 0.0, angle)
    angle = np.where(pick == 1, tiny, angle)
    return np.where(pick == 2, np.pi / 2 - tiny, angle)


def excesses(rng: np.random.Generator, size: int, least: float, radius: float) -> Any:
    """Both sides of the limit: by `least` .. 1e-3 m, sometimes deep inside."""
    low = np.log10(max(least, DECIDABLE))
    excess = 10.0 ** rng.uniform(low, -3.0, size)
    hopeless = 10.0 ** rng.uniform(np.log10(least), low, size)
    excess = np.where(rng.random(size) < 0.02, hopeless, excess)
    excess *= rng.choice([-1.0, 1.0], size)
    deep = rng.random(size) < 0.05
    return np.where(deep, -rng.uniform(0.0, radius, size), excess)


def random_arm(rng: np.random.Generator) -> Manipulator:
    n = int(rng.choice([2, 3, 5]))
    cables = CableLayout(0.02, 0.01, paper_hole_angles(n))
    lengths = rng.uniform(0.15, 0.5, n)
    return Manipulator("random", lengths, 0.03, 1.3, 1.3, (-5.0, 5.0), cables)


def motion_rows(motion: str, n_links: int, rng: np.random.Generator) -> Any:
    """Joint values at both ends, shape (2, 1 + 2N)."""
    q = rng.uniform(-0.7, 0.7, 1 + 2 * n_links) * rng.choice([0.0, 1.0], p=[0.3, 0.7])
    q[1:] *= rng.choice([0.0, 1.0], 2 * n_links, p=[0.2, 0.8])
    rows = np.stack([q, q])
    if motion in ("rail", "away"):
        rows[1, 0] += rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-9, -0.5)
    elif motion == "base_turn":
        rows[1, 1] += rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-3, -0.7)
    return rows


def normals(motion: str, rows: Any, ends: Any, rng: np.random.Generator) -> Any:
    """N for each query, such that the motion brings no link nearer along it."""
    size = len(ends)
    u = ends[:, 1] - ends[:, 0]
    u /= np.linalg.norm(u, axis=1)[:, None]
    if motion == "base_turn":
        return np.array([0.0, 0.0, 1.0]) * rng.choice([-1.0, 1.0], size)[:, None]
    if motion == "rail":
        angle = rng.uniform(-np.pi, np.pi, size)
        return np.column_stack([np.zeros(size), np.cos(angle), np.sin(angle)])
    e = across(u, rng)[0]
    gamma = small_angles(rng, size)[:, None]
    way = rng.choice([-1.0, 0.0, 1.0], size)[:, None]
    n = np.where(way == 0.0, e, way * np.cos(gamma) * u + np.sin(gamma) * e)
    if motion == "away":
        retreat = np.sign(rows[1, 0] - rows[0, 0])
        n = np.where(n[:, :1] * retreat > 0.0, -n, n)
    return n


def contacts(motion: str, rows: Any, arm: Manipulator, size: int, rng: Any) -> Any:
    """Links, times, normals, stations and contact points on the axes of queries."""
    link = rng.integers(arm.n_links, size=size)
    moving = motion in ("rail", "base_turn")
    time = np.zeros(size)
    if moving:
        time = rng.choice([0.0, 1.0, 0.5, np.nan], size, p=[0.1, 0.1, 0.2, 0.6])
        time = np.where(np.isnan(time), rng.random(size), time)
    q = rows[0] + time[:, None] * (rows[1] - rows[0])
    centres = joint_centres(arm, q[:, 0], q[:, 1::2], q[:, 2::2])
    each = np.arange(size)
    ends = np.stack([centres[each, link], centres[each, link + 1]], axis=1)
    n = normals(motion, rows, ends, rng)
    slope = np.einsum("ij,ij->i", n, ends[:, 1] - ends[:, 0])
    level = np.abs(slope) < 1e-15
    station = np.where(level, rng.random(size), np.where(slope > 0.0, 1.0, 0.0))
    c = ends[:, 0] + station[:, None] * (ends[:, 1] - ends[:, 0])
    return link, time, n, station, c, ends


def sizes(rng: np.random.Generator, size: int) -> Any:
    """Radii and half lengths from 1e-6 to 1 m."""
    return 10.0 ** rng.uniform(-6.0, 0.0, (size, 1))


def round_bodies(shape: str, p: Any, n: Any, u: Any, rng: Any) -> list[tuple[Any, ...]]:
    """Spheres, capsules and cylinders that touch the plane n.x = n.p at p."""
    size = len(p)
    e, f = across(n, rng)
    radius, half = sizes(rng, size), sizes(rng, size)
    phi = small_angles(rng, size)[:, None]
    if shape.endswith("parallel"):  # as parallel to the link as rounding allows
        e = u - np.einsum("ij,ij->i", u, n)[:, None] * n
        length = np.linalg.norm(e, axis=1)[:, None]
        e = np.where(length > 1e-3, e / np.maximum(length, 1e-3), f)
    shift = rng.uniform(-1.0, 1.0, (size, 1)) * half
    tilted = np.cos(phi) * n + np.sin(phi) * e
    axis, centre = e, p + radius * n + shift * e
    if shape == "capsule_cap":
        axis, centre = tilted, p + radius * n + half * tilted
    elif shape == "cylinder_cap":
        offset = rng.choice([0.0, 1.0, 0.5], (size, 1)) * radius * f
        axis, centre = n, p + half * n + offset
    elif shape == "cylinder_rim":
        rim = np.sin(phi) * n - np.cos(phi) * e
        axis, centre = tilted, p + half * tilted + radius * rim
    if shape.startswith("cylinder"):
        return [
            (FlatCylinder(c, a, float(h), float(r)),)
            for c, a, h, r in zip(centre, axis, half[:, 0], radius[:, 0], strict=True)
        ]
    if shape == "sphere":
        points = (p + radius * n)[:, None]
    else:
        points = np.stack([centre - half * axis, centre + half * axis], axis=1)
    return [(Hull(x, float(r)),) for x, r in zip(points, radius[:, 0], strict=True)]


def boxes(shape: str, p: Any, n: Any, rng: Any) -> list[tuple[Any, ...]]:
    """Boxes, thin plates and meshes of boxes."""
    size = len(p)
    e, f = across(n, rng)
    half = 10.0 ** rng.uniform(-4.0, 0.0, (size, 3))
    phi = small_angles(rng, size)[:, None]
    if shape == "plate":
        half[:, 0] = 10.0 ** rng.uniform(-9.0, -3.0, size)
    frame = np.stack([n, e, f], axis=1)  # rows are the box's axes
    inside = rng.uniform(-1.0, 1.0, (size, 3))
    inside[:, 0] = -1.0
    if shape in ("box_edge", "mesh_box"):
        turned = np.cos(phi) * n + np.sin(phi) * e, np.cos(phi) * e - np.sin(phi) * n
        frame = np.stack([*turned, f], axis=1)
        inside[:, 1] = 1.0
    elif shape == "box_corner":
        chi = small_angles(rng, size)[:, None]
        a = np.cos(phi) * n + np.sin(phi) * e
        b = np.cos(phi) * e - np.sin(phi) * n
        frame = np.stack(
            [a, np.cos(chi) * b - np.sin(chi) * f, np.zeros_like(a)], axis=1
        )
        frame[:, 2] = np.cross(frame[:, 0], frame[:, 1])
        low = np.sign(np.einsum("ikj,ij->ik", frame, n))
        inside = -np.where(low == 0.0, 1.0, low)
    centre = p - np.einsum("ik,ikj->ij", inside * half, frame)
    corners = centre[:, None] + np.einsum(
        "ck,ikj->icj", CORNERS, half[..., None] * frame
    )
    if shape == "mesh_box":
        return [tuple(Hull(x[face]) for face in FACES) for x in corners]
    return [(Hull(x),) for x in corners]


def slivers(shape: str, p: Any, n: Any, rng: Any) -> list[tuple[Any, ...]]:
    """Triangles, some a billion times longer than wide."""
    size = len(p)
    e, f = across(n, rng)
    long, thin = sizes(rng, size), 10.0 ** rng.uniform(-10.0, -1.0, (size, 1))
    rise = 10.0 ** rng.uniform(-12.0, 0.0, (size, 1))
    if shape == "sliver_corner":
        rest = p + long * e + rise * n, p - long * thin * f + long * e + 2.0 * rise * n
        points = np.stack([p, *rest], axis=1)
    elif shape == "sliver_edge":
        points = np.stack([p - long * e, p + long * e, p + thin * f + rise * n], axis=1)
    else:
        points = np.stack([p - long * e, p + long * e - thin * f, p + thin * f], axis=1)
        points += (p - points.mean(axis=1))[:, None]
    return [(Hull(x),) for x in points]


def bodies(shape: str, p: Any, n: Any, u: Any, rng: Any) -> list[tuple[Any, ...]]:
    """Pieces of one obstacle for each contact."""
    if shape == "half_space":
        offsets = np.einsum("ij,ij->i", -n, p)
        return [
            (HalfSpacePiece(-a, float(b)),) for a, b in zip(n, offsets, strict=True)
        ]
    if shape.startswith("sliver"):
        return slivers(shape, p, n, rng)
    if shape.startswith(("box", "mesh", "plate")):
        return boxes(shape, p, n, rng)
    return round_bodies(shape, p, n, u, rng)


def make_batch(rng: np.random.Generator, motion: str, size: int, least: float) -> Batch:
    """Queries about one random motion.

    Args:
        rng: Source of randomness.
        motion: One of MOTIONS.
        size: Number of queries, shared out over the shapes.
        least: Least distance from the limit; [m].
    """
    arm = random_arm(rng)
    rows = motion_rows(motion, arm.n_links, rng)
    required = float(rng.choice([0.0, 0.0035, 0.02]))
    link, time, n, station, c, ends = contacts(motion, rows, arm, size, rng)
    excess = excesses(rng, size, least, float(arm.link_radius))
    p = c + (arm.link_radius + required + excess)[:, None] * n
    u = (ends[:, 1] - ends[:, 0]) / np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)[
        :, None
    ]
    shape = [SHAPES[k] for k in np.sort(rng.integers(len(SHAPES), size=size))]
    made: list[Body] = []
    for name in SHAPES:
        of = np.flatnonzero([s == name for s in shape])
        if of.size:
            pieces = bodies(name, p[of], n[of], u[of], rng)
            made += [Body(f"b{k}", x) for k, x in zip(of, pieces, strict=True)]
    problem = _problem(arm, made, required)
    trajectory = _trajectory(rows[:1] if motion == "none" else rows)
    return Batch(problem, trajectory, motion, shape, link, excess, time, n, station, p)


def _problem(arm: Manipulator, made: list[Body], required: float) -> PlanningProblem:
    scene: Any = object.__new__(Scene)  # thousands of names need no search for doubles
    object.__setattr__(scene, "obstacles", tuple(made))
    tip = np.array([arm.total_length, 0.0, 0.0])
    path = DesiredPath(tip, tip[None])
    return PlanningProblem("queries", arm, scene, path, required, np.eye(4))


def _trajectory(rows: Any) -> Trajectory:
    blank = np.zeros(len(rows))
    return Trajectory(blank > 0.0, blank, rows[:, 0], rows[:, 1::2], rows[:, 2::2])


# ---- the truth in ball arithmetic ----------------------------------------------------


def exact_bracket(batch: Batch, k: int) -> tuple[Any, Any]:
    """Lower and upper bound of a query's least clearance less the required one.

    The lower one is that of the plane with normal n at the time of contact, the upper
    one that of two points proved to lie in the solids; in 256-bit balls.
    """
    with ctx.workprec(256):
        arm, rows = batch.problem.manipulator, batch.trajectory.joints
        time = arb(float(batch.time[k]))
        q = [
            arb(float(a)) + (arb(float(b)) - arb(float(a))) * time
            for a, b in zip(rows[0], rows[-1], strict=True)
        ]
        a, b = _axis(arm, q, int(batch.link[k]))
        n = _unit([arb(float(x)) for x in batch.normal[k]])
        pieces = batch.problem.scene.obstacles[k].pieces
        required = arb(float(arm.link_radius)) + arb(
            float(batch.problem.required_clearance)
        )
        top = _dot(n, a).max(_dot(n, b))
        lower = arb("inf")
        for piece in pieces:
            lower = lower.min(_support(piece, n))
        s = arb(float(batch.station[k]))
        c = [x + (y - x) * s for x, y in zip(a, b, strict=True)]
        p = [arb(float(x)) for x in batch.contact[k]]
        upper = arb("inf")
        for piece in pieces:
            found = [x - y for x, y in zip(_project(piece, p), c, strict=True)]
            upper = upper.min(_dot(found, found).nonnegative_part().sqrt())
        return lower - top - required, upper - required


def _dot(a: Any, b: Any) -> Any:
    return sum((x * y for x, y in zip(a, b, strict=True)), arb(0))


def _unit(a: Any) -> Any:
    size = _dot(a, a).sqrt()
    return [x / size for x in a]


def _axis(arm: Manipulator, q: Any, link: int) -> tuple[Any, Any]:
    """Ends of a link's axis by the rotation of each link about its own axes."""
    frame = [[arb(int(i == j)) for j in range(3)] for i in range(3)]  # columns x, y, z
    end = [q[0], arb(0), arb(0)]
    start = end
    for i in range(link + 1):
        yaw, pitch, start = q[1 + 2 * i], q[2 + 2 * i], end
        x, y, z = frame
        x, y = _spun(x, y, yaw)
        z, x = _spun(z, x, pitch)
        frame = [x, y, z]
        length = arb(float(arm.link_lengths[i]))
        end = [e + length * d for e, d in zip(start, x, strict=True)]
    return start, end


def _spun(a: Any, b: Any, angle: Any) -> tuple[Any, Any]:
    """Two axes turned towards each other's direction, a to b."""
    s, c = angle.sin_cos()
    turned = [c * x + s * y for x, y in zip(a, b, strict=True)]
    return turned, [c * y - s * x for x, y in zip(a, b, strict=True)]


def _balls(points: Any) -> list[list[Any]]:
    return [[arb(float(x)) for x in point] for point in points]


def _support(piece: Any, n: Any) -> Any:
    if isinstance(piece, HalfSpacePiece):
        return -arb(piece.offset) / _dot(*_balls([piece.normal] * 2)).sqrt()
    if isinstance(piece, Hull):
        heights = [_dot(n, point) for point in _balls(piece.points)]
        low = heights[0]
        for height in heights[1:]:
            low = low.min(height)
        return low - arb(piece.radius)
    centre, axis = _balls([piece.centre, piece.axis])
    axis = _unit(axis)
    along = _dot(n, axis)
    perp = [x - along * y for x, y in zip(n, axis, strict=True)]
    reach = _dot(perp, perp).nonnegative_part().sqrt() * arb(piece.radius)
    return _dot(n, centre) - abs(along) * arb(piece.half_length) - reach


def _project(piece: Any, p: Any) -> Any:
    """A point of a solid near p, by construction inside it."""
    if isinstance(piece, HalfSpacePiece):
        normal = _unit(_balls([piece.normal])[0])
        over = _dot(normal, p) + _support(piece, None)
        return [x - over * y for x, y in zip(p, normal, strict=True)]
    if isinstance(piece, Hull) and len(piece.points) > 2:
        return _combination(piece.points, p)
    if isinstance(piece, Hull):
        points = _balls(piece.points)
        ends = points[0], points[-1]
        centre = [(x + y) / 2 for x, y in zip(*ends, strict=True)]
        half = [(y - x) / 2 for x, y in zip(*ends, strict=True)]
        size = _dot(half, half)
        off = [x - y for x, y in zip(p, centre, strict=True)]
        t = _dot(off, half) / size if size > 0 else arb(0)
        t = t.max(arb(-1)).min(arb(1))
        core = [x + t * y for x, y in zip(centre, half, strict=True)]
        return _shrunk(core, p, arb(piece.radius))
    centre, axis = _balls([piece.centre, piece.axis])
    axis, half = _unit(axis), arb(piece.half_length)
    off = [x - y for x, y in zip(p, centre, strict=True)]
    t, along = _dot(off, axis).max(-half).min(half), _dot(off, axis)
    core = [x + t * y for x, y in zip(centre, axis, strict=True)]
    level = [x + (t - along) * y for x, y in zip(p, axis, strict=True)]
    return _shrunk(core, level, arb(piece.radius))


def _shrunk(core: Any, p: Any, radius: Any) -> Any:
    """p, or where it is farther than the radius from the core, the point there."""
    off = [x - y for x, y in zip(p, core, strict=True)]
    size = _dot(off, off).nonnegative_part().sqrt()
    part = (radius / size).min(arb(1)) if size > 0 else arb(0)
    return [x + part * y for x, y in zip(core, off, strict=True)]


def _combination(points: Any, p: Any) -> Any:
    """A convex combination of the points near p: least squares, weights cut at 0."""
    target = np.array([float(x) for x in p])
    scale = max(float(np.abs(points - target).max()), 1e-300)
    rows = np.vstack([(points - target).T / scale, 1e3 * np.ones(len(points))])
    weights = _nonnegative(rows, np.array([0.0, 0.0, 0.0, 1e3]))
    exact = [arb(float(w)) for w in weights]
    total = sum(exact, arb(0))
    return [
        sum((w * x[i] for w, x in zip(exact, _balls(points), strict=True)), arb(0))
        / total
        for i in range(3)
    ]


def _nonnegative(matrix: Any, right: Any) -> Any:
    """Nonnegative least squares by trying the small supports (faces of a simplex)."""
    from itertools import combinations

    best, found = np.inf, np.zeros(matrix.shape[1])
    for count in (1, 2, 3, 4):
        for chosen in combinations(range(matrix.shape[1]), count):
            part = matrix[:, chosen]
            w = np.linalg.lstsq(part, right, rcond=None)[0]
            if (w < 0.0).any():
                continue
            rest = float(np.linalg.norm(part @ w - right))
            if rest < 0.5 * best:
                best, found = rest, np.zeros(matrix.shape[1])
                found[list(chosen)] = w
    return found


# ---- a sample on disk ----------------------------------------------------------------


def as_data(batch: Batch, k: int) -> dict[str, Any]:
    """One query as plain numbers that read back exactly."""
    arm = batch.problem.manipulator
    return {
        "motion": batch.motion,
        "shape": batch.shape[k],
        "link_lengths": arm.link_lengths.tolist(),
        "link_radius": arm.link_radius,
        "required_clearance": batch.problem.required_clearance,
        "rows": batch.trajectory.joints.tolist(),
        "link": int(batch.link[k]),
        "pieces": [
            {"kind": type(piece).__name__}
            | {key: np.asarray(value).tolist() for key, value in vars(piece).items()}
            for piece in batch.problem.scene.obstacles[k].pieces
        ],
        "excess": float(batch.excess[k]),
        "time": float(batch.time[k]),
        "normal": batch.normal[k].tolist(),
        "station": float(batch.station[k]),
        "contact": batch.contact[k].tolist(),
    }


def from_data(data: dict[str, Any]) -> Batch:
    """The query that `as_data` wrote, alone in its scene."""
    kinds = {kind.__name__: kind for kind in (Hull, FlatCylinder, HalfSpacePiece)}
    pieces = []
    for entry in data["pieces"]:
        values = {key: value for key, value in entry.items() if key != "kind"}
        arrays = {
            k: np.array(v) if isinstance(v, list) else v for k, v in values.items()
        }
        pieces.append(kinds[entry["kind"]](**arrays))
    n = len(data["link_lengths"])
    cables = CableLayout(0.02, 0.01, paper_hole_angles(n))
    lengths, radius = np.array(data["link_lengths"]), data["link_radius"]
    arm = Manipulator("sample", lengths, radius, 1.3, 1.3, (-5.0, 5.0), cables)
    return Batch(
        _problem(arm, [Body("b0", tuple(pieces))], data["required_clearance"]),
        _trajectory(np.array(data["rows"])),
        data["motion"],
        [data["shape"]],
        *(np.array([data[key]]) for key in ("link", "excess", "time", "normal")),
        *(np.array([data[key]]) for key in ("station", "contact")),
    )


def sample() -> list[dict[str, Any]]:
    """One query of every shape under every motion, on either side of the limit."""
    rng, found = np.random.default_rng(2022), []
    for motion in MOTIONS:
        batch = make_batch(rng, motion, 400, 1e-12)
        for shape in SHAPES:
            for side in (-1.0, 1.0):
                of = [
                    k
                    for k in range(400)
                    if batch.shape[k] == shape and batch.excess[k] * side > 0.0
                ]
                found.append(as_data(batch, of[0]))
    return found
