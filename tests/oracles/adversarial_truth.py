"""The truth of adversarial queries in ball arithmetic, and a sample of them on disk."""

from itertools import combinations
from typing import Any

import numpy as np
from flint import arb, ctx
from oracles.adversarial import (
    BASE,
    LINK_MOTIONS,
    MOTIONS,
    Batch,
    make_batch,
    make_link_batch,
)
from oracles.adversarial_bodies import SHAPES, Bodies

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.convex import HalfSpacePiece, Hull


def exact_bracket(batch: Batch, k: int) -> tuple[Any, Any]:
    """Lower and upper bound of a query's least clearance less the required one.

    The lower one is that of the plane with normal n at the time of contact (of a swing,
    that of the circle), the upper one that of two points proved to lie in the solids;
    in 256-bit balls. Where an obstacle is pierced only the upper one is worth anything.
    """
    with ctx.workprec(256):
        time, rows = arb(float(batch.time[k])), batch.rows
        q = [
            arb(float(a)) + (arb(float(b)) - arb(float(a))) * time
            for a, b in zip(rows[0], rows[-1], strict=True)
        ]
        required = arb(float(batch.arm.link_radius)) + arb(float(batch.required[k]))
        if batch.frame[k] != BASE:
            lower, upper = _between_links(batch, k, q)
            required += arb(float(batch.arm.link_radius))
        else:
            lower, upper = _from_obstacle(batch, k, q)
        return lower - required, upper - required


def _from_obstacle(batch: Batch, k: int, q: Any) -> tuple[Any, Any]:
    """Bounds of the distance between an axis and an obstacle."""
    a, b, _ = _axis(batch.arm, q, int(batch.link[k]))
    n = _unit([arb(float(x)) for x in batch.normal[k]])
    lower = upper = arb("inf")
    c = _between(a, b, arb(float(batch.station[k])))
    p = [arb(float(x)) for x in batch.contact[k]]
    for piece in batch.pieces(k):
        lower = lower.min(_support(piece, n))
        upper = upper.min(_length(_minus(_project(piece, p), c)))
    return lower - _dot(n, a).max(_dot(n, b)), upper


def _between_links(batch: Batch, k: int, q: Any) -> tuple[Any, Any]:
    """Bounds of the distance between two axes."""
    a, b, _ = _axis(batch.arm, q, int(batch.link[k]))
    c, d, frame = _axis(batch.arm, q, int(batch.frame[k]))
    n, p = (
        [_dot([arb(float(v)) for v in local], row) for row in zip(*frame, strict=True)]
        for local in (batch.normal[k], batch.contact[k])
    )
    n, near = _unit(n), [x + y for x, y in zip(c, p, strict=True)]
    far = _between(a, b, arb(float(batch.station[k])))
    lower = _dot(n, a).min(_dot(n, b)) - _dot(n, c).max(_dot(n, d))
    if batch.motion == "links_swing":
        side = _minus(d, c)
        t = (_dot(_minus(a, c), side) / _dot(side, side)).max(arb(0)).min(arb(1))
        lower = _length(_minus(a, _between(c, d, t))) - _length(_minus(b, a))
    return lower, _length(_minus(far, near))


def _minus(a: Any, b: Any) -> Any:
    return [x - y for x, y in zip(a, b, strict=True)]


def _between(a: Any, b: Any, s: Any) -> Any:
    return [x + (y - x) * s for x, y in zip(a, b, strict=True)]


def _length(a: Any) -> Any:
    return _dot(a, a).nonnegative_part().sqrt()


def _dot(a: Any, b: Any) -> Any:
    return sum((x * y for x, y in zip(a, b, strict=True)), arb(0))


def _unit(a: Any) -> Any:
    size = _dot(a, a).sqrt()
    return [x / size for x in a]


def _axis(arm: Manipulator, q: Any, link: int) -> tuple[Any, Any, Any]:
    """Ends of a link's axis and its x, y, z, by rotations about its own axes."""
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
    return start, end, frame


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
    arm = batch.arm
    group, at = None, k
    for group in batch.groups:
        if at < group.size:
            break
        at -= group.size
    arrays = ("points", "radius", "centre", "axis", "extent")
    body = group and {
        "kind": group.kind,
        "faces": [list(face) for face in group.faces],
        **{name: getattr(group, name)[at].tolist() for name in arrays},
    }
    return {
        "motion": batch.motion,
        "shape": str(batch.shape[k]),
        "link_lengths": arm.link_lengths.tolist(),
        "link_radius": arm.link_radius,
        "rows": batch.rows.tolist(),
        "body": body,
        **{name: getattr(batch, name)[k].tolist() for name in QUERY},
    }


QUERY = (
    "link",
    "frame",
    "required",
    "excess",
    "time",
    "normal",
    "station",
    "contact",
)


def from_data(data: dict[str, Any]) -> Batch:
    """The query that `as_data` wrote, alone in its scene."""
    groups, body = [], data["body"]
    if body:
        arrays = ("points", "radius", "centre", "axis", "extent")
        values = {name: np.array([body[name]]) for name in arrays}
        values["points"] = values["points"].reshape(1, -1, 3)
        faces = tuple(tuple(face) for face in body["faces"])
        groups = [Bodies(kind=body["kind"], faces=faces, **values)]
    n = len(data["link_lengths"])
    cables = CableLayout(0.02, 0.01, paper_hole_angles(n))
    lengths, radius = np.array(data["link_lengths"]), data["link_radius"]
    return Batch(
        arm=Manipulator("sample", lengths, radius, 1.3, 1.3, (-5.0, 5.0), cables),
        rows=np.array(data["rows"]),
        motion=data["motion"],
        shape=np.array([data["shape"]]),
        groups=groups,
        **{name: np.array([data[name]]) for name in QUERY},
    )


def sample() -> list[dict[str, Any]]:
    """One query of every shape under every motion, on either side of the limit."""
    rng, found = np.random.default_rng(2022), []
    for motion in MOTIONS:
        batch = make_batch(rng, motion, 500, 1e-12)
        for shape in SHAPES:
            for side in (-1.0,) if motion == "pierce" else (-1.0, 1.0):
                of = (batch.shape == shape) & (batch.excess * side > 0.0)
                found.append(as_data(batch, int(np.flatnonzero(of)[0])))
    for motion in LINK_MOTIONS:
        for side in (-1.0, 1.0):
            of = np.zeros(0, bool)
            while not of.any():
                batch = make_link_batch(rng, motion, 50, 1e-12)
                of = batch.excess * side > 0.0
            found.append(as_data(batch, int(np.flatnonzero(of)[0])))
    return found
