"""Queries on which a clearance proof is easily wrong, with the truth built in.

A query is a link, what it must stay clear of, and a motion whose least clearance is
known. Against obstacles: a contact point c on the link's axis, a unit normal n, and an
obstacle whose least n.x is met at p = c + (radius + clearance) n. The plane through p
proves the clearance from below, the points c and p from above. The motions keep n.x of
the link from growing: none, along the rail (n across it), round the base's z axis (n
along it), or away from the contact. A link that pierces an obstacle on its way has its
axis on p at some time. Between links the motion comes first and the required clearance
is set to miss or exceed the distance: at rest, or while a link swings past another
(its end on a circle about its start, so its distance from the other is least where it
points at it).

The truth is exact up to the rounding of the numbers that describe the query;
`adversarial_truth` recomputes it in ball arithmetic from those numbers.
"""

from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from oracles.adversarial_bodies import (
    SHAPES,
    SHARES,
    Bodies,
    across,
    bodies,
    small_angles,
)

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import Manipulator

MOTIONS: Final = ("none", "still", "rail", "away", "base_turn", "pierce")
LINK_MOTIONS: Final = ("links_none", "links_still", "links_swing")
BASE: Final = -1
DECIDABLE: Final = 2e-11
"""Nearer to the limit than the verifier's padding nothing can be decided; [m]."""
KNOWN: Final = 1e-14
"""Links whose distance is bracketed less narrowly are not asked about; [m]."""


@dataclass(frozen=True)
class Batch:
    """Queries about one motion.

    Args:
        arm: The arm.
        rows: Joint values x0, alpha1, theta1, .. of one row, or two; [m], [rad].
        motion: One of MOTIONS or LINK_MOTIONS.
        shape: One of SHAPES, or "links", for each query.
        groups: The obstacles, query by query; none between links.
        link: The link that is asked about, from 0, shape (n,).
        frame: BASE, or the other link, from 0, shape (n,).
        required: Required clearances, shape (n,); [m].
        excess: True clearance less the required one, shape (n,); [m].
        time: When the least clearance is met, shape (n,).
        normal: n, in the frame of the other link between links, shape (n, 3).
        station: Where on the link's axis, 0 to 1, shape (n,).
        contact: p, in that frame, shape (n, 3); [m].
    """

    arm: Manipulator
    rows: Any
    motion: str
    shape: Any
    groups: list[Bodies]
    link: Any
    frame: Any
    required: Any
    excess: Any
    time: Any
    normal: Any
    station: Any
    contact: Any

    @property
    def size(self) -> int:
        """Number of queries."""
        return len(self.link)

    def pieces(self, k: int) -> tuple[Any, ...]:
        """The obstacle of one query."""
        for group in self.groups:
            if k < group.size:
                return group.pieces(k)
            k -= group.size
        return ()


def excesses(rng: np.random.Generator, size: int, least: float, radius: float) -> Any:
    """Both sides of the limit: by `least` .. 1e-3 m, sometimes deep inside."""
    low = np.log10(max(least, DECIDABLE))
    excess = 10.0 ** rng.uniform(low, -3.0, size)
    hopeless = 10.0 ** rng.uniform(np.log10(least), low, size)
    excess = np.where(rng.random(size) < 0.02, hopeless, excess)
    excess *= rng.choice([-1.0, 1.0], size)
    deep = rng.random(size) < 0.05
    return np.where(deep, -rng.uniform(0.0, radius, size), excess)


def random_arm(rng: np.random.Generator, counts: Any, radius: float) -> Manipulator:
    n = int(rng.choice(counts))
    cables = CableLayout(0.02, 0.01, paper_hole_angles(n))
    lengths = rng.uniform(0.15, 0.5, n)
    return Manipulator("random", lengths, radius, 1.3, 1.3, (-5.0, 5.0), cables)


def centres_of(arm: Manipulator, q: Any) -> Any:
    return joint_centres(arm, q[:, 0], q[:, 1::2], q[:, 2::2])


def normalized(v: Any) -> Any:
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


# ---- against obstacles ---------------------------------------------------------------


def motion_rows(motion: str, n_links: int, rng: np.random.Generator) -> Any:
    """Joint values at both ends, shape (2, 1 + 2N)."""
    q = rng.uniform(-0.7, 0.7, 1 + 2 * n_links) * rng.choice([0.0, 1.0], p=[0.3, 0.7])
    q[1:] *= rng.choice([0.0, 1.0], 2 * n_links, p=[0.2, 0.8])
    rows = np.stack([q, q])
    if motion in ("rail", "away"):
        rows[1, 0] += rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-9, -0.5)
    elif motion == "base_turn":
        rows[1, 1] += rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-3, -0.7)
    elif motion == "pierce":
        rows[1, :3] += rng.choice([-1.0, 1.0], 3) * rng.uniform(0.05, 0.4, 3)
    return rows


def normals(motion: str, rows: Any, u: Any, rng: np.random.Generator) -> Any:
    """N for each query, such that the motion brings no link nearer along it."""
    size = len(u)
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


def times(motion: str, size: int, rng: np.random.Generator) -> Any:
    """Times of contact: the ends, the middle, anywhere; strictly between to pierce."""
    if motion == "pierce":
        return rng.uniform(0.1, 0.9, size)
    if motion not in ("rail", "base_turn"):
        return np.zeros(size)
    time = rng.choice([0.0, 1.0, 0.5, np.nan], size, p=[0.1, 0.1, 0.2, 0.6])
    return np.where(np.isnan(time), rng.random(size), time)


def make_batch(rng: np.random.Generator, motion: str, size: int, least: float) -> Batch:
    """Queries about one random motion, one obstacle each.

    Args:
        rng: Source of randomness.
        motion: One of MOTIONS.
        size: Number of queries, shared out over the shapes.
        least: Least distance from the limit; [m].
    """
    counts = [2, 3, 5, 8, 24] if motion == "base_turn" else [2, 3, 5]
    arm = random_arm(rng, counts, 0.03)
    rows = motion_rows(motion, arm.n_links, rng)
    link, each = rng.integers(arm.n_links, size=size), np.arange(size)
    time = times(motion, size, rng)
    centres = centres_of(arm, rows[0] + time[:, None] * (rows[1] - rows[0]))
    start, axis = centres[each, link], centres[each, link + 1] - centres[each, link]
    u = normalized(axis)
    n = normals(motion, rows, u, rng)
    slope = np.einsum("ij,ij->i", n, axis)
    level = np.abs(slope) < 1e-15
    station = np.where(level, rng.random(size), np.where(slope > 0.0, 1.0, 0.0))
    required = np.full(size, float(rng.choice([0.0, 0.0035, 0.02])))
    gap = arm.link_radius + required
    excess = excesses(rng, size, least, float(arm.link_radius))
    if motion == "pierce":
        station, excess = rng.random(size), -gap
    p = start + station[:, None] * axis + (gap + excess)[:, None] * n
    shape = np.sort(rng.choice(len(SHAPES), size, p=SHARES / SHARES.sum()))
    groups = []
    for k in np.unique(shape):
        of = shape == k
        groups.append(bodies(SHAPES[k], p[of], n[of], u[of], rng))
    return Batch(
        arm=arm,
        rows=rows[:1] if motion == "none" else rows,
        motion=motion,
        shape=np.array(SHAPES)[shape],
        groups=groups,
        link=link,
        frame=np.full(size, BASE),
        required=required,
        excess=excess,
        time=time,
        normal=n,
        station=station,
        contact=p,
    )


# ---- between links -------------------------------------------------------------------


def link_frames(arm: Manipulator, q: Any) -> Any:
    """Frames of all links of one configuration, columns x, y, z, shape (N, 3, 3)."""
    frames, frame = [], np.eye(3)
    for a, t in zip(q[1::2], q[2::2], strict=True):
        ca, sa, ct, st = np.cos(a), np.sin(a), np.cos(t), np.sin(t)
        turn = [[ca * ct, -sa, ca * st], [sa * ct, ca, sa * st], [-st, 0.0, ct]]
        frame = frame @ np.array(turn)
        frames.append(frame)
    return np.array(frames)


def nearest_on(a: Any, b: Any, p: Any) -> Any:
    """Parameters in [0, 1] of the points of segments a b nearest to p."""
    d = b - a
    t = np.einsum("ij,ij->i", p - a, d) / np.einsum("ij,ij->i", d, d)
    return np.minimum(np.maximum(t, 0.0), 1.0)


def nearest_between(a: Any, b: Any, c: Any, d: Any) -> tuple[Any, Any]:
    """Parameters of the nearest points of segments a b and c d, shape (n,) each."""
    zero, one = np.zeros(len(a)), np.ones(len(a))
    u, v, w = b - a, d - c, a - c
    uu, vv, uv = (np.einsum("ij,ij->i", x, y) for x, y in ((u, u), (v, v), (u, v)))
    uw, vw = np.einsum("ij,ij->i", u, w), np.einsum("ij,ij->i", v, w)
    scale = np.maximum(uu * vv - uv * uv, 1e-300)
    inner = np.minimum(np.maximum((uv * vw - vv * uw) / scale, 0.0), 1.0)
    tried = [(s, nearest_on(c, d, a + s[:, None] * u)) for s in (inner, zero, one)]
    tried += [(nearest_on(a, b, c + t[:, None] * v), t) for t in (zero, one)]
    s, t = (np.array([found[k] for found in tried]) for k in (0, 1))
    gaps = np.linalg.norm(a + s[..., None] * u - c - t[..., None] * v, axis=2)
    best = np.argmin(gaps, axis=0)
    return s[best, np.arange(len(a))], t[best, np.arange(len(a))]


def make_link_batch(
    rng: np.random.Generator, motion: str, size: int, least: float
) -> Batch:
    """Queries about pairs of links of one coiled arm.

    Args:
        rng: Source of randomness.
        motion: One of LINK_MOTIONS.
        size: Largest number of queries; fewer where pairs are not known well enough.
        least: Least distance from the limit; [m].
    """
    arm = random_arm(rng, [4, 8, 16, 24], 0.004)
    q = rng.uniform(-1.8, 1.8, 1 + 2 * arm.n_links)
    # Flat coils have links that are parallel, or cross at right angles.
    q[2::2] *= rng.choice([0.0, 1.0, 1e-9])
    square = rng.random(len(q)) < rng.choice([0.0, 0.7])
    q = np.where(square, rng.choice([-0.5, 0.0, 0.5], len(q)) * np.pi, q)
    if motion == "links_swing":
        return _swing(rng, arm, q, size, least)
    i, k = np.triu_indices(arm.n_links, 2)
    pick = rng.choice(len(i), size=min(size, len(i)), replace=False)
    i, k = i[pick], k[pick]
    centres, frames = centres_of(arm, q[None])[0], link_frames(arm, q)
    s, t = nearest_between(centres[i], centres[i + 1], centres[k], centres[k + 1])
    lengths = np.array(arm.link_lengths)[i]

    def local(points: Any) -> Any:
        return np.einsum("nji,nj->ni", frames[i], points - centres[i])

    near = np.column_stack([s * lengths, 0.0 * s, 0.0 * s])
    ends = local(centres[k]), local(centres[k + 1])
    far = ends[0] + t[:, None] * (ends[1] - ends[0])
    gap = np.linalg.norm(far - near, axis=1)
    n = (far - near) / np.maximum(gap, 1e-300)[:, None]
    low = np.minimum(*(np.einsum("ij,ij->i", n, end) for end in ends))
    low -= np.maximum(0.0, n[:, 0] * lengths)
    rows = q[None] if motion == "links_none" else np.stack([q, q])
    of = np.flatnonzero((gap > 1e-3) & (gap - low < KNOWN))
    found = Contact(k[of], i[of], gap[of], 0.0 * gap[of], n[of], t[of], near[of])
    return _about(rng, arm, rows, motion, found, least)


@dataclass(frozen=True)
class Contact:
    """Nearest points of pairs of links: what `Batch` says of them, and the distance."""

    link: Any
    frame: Any
    gap: Any
    time: Any
    normal: Any
    station: Any
    contact: Any


def _swing(
    rng: np.random.Generator, arm: Manipulator, q: Any, size: int, least: float
) -> Batch:
    """Link k turns about its start; its end passes link i, asked about many times."""
    k = int(rng.integers(2, arm.n_links))
    i = int(rng.integers(0, k - 1))
    centres, frames = centres_of(arm, q[None])[0], link_frames(arm, q)
    foot = nearest_on(*centres[[i, i + 1, k], None])[0]
    down = centres[i] + foot * (centres[i + 1] - centres[i]) - centres[k]
    height = float(np.linalg.norm(down))
    gap = height - float(arm.link_lengths[k])
    if not gap > 1e-3:
        size, height = 0, 1.0
    d = frames[k - 1].T @ down / height
    aim = np.array([np.arctan2(d[1], d[0]), -np.arctan2(d[2], np.hypot(d[0], d[1]))])
    time = float(rng.choice([0.0, 0.5, 1.0, rng.random()]))
    step = rng.choice([-1.0, 1.0], 2) * 10.0 ** rng.uniform(-4.0, -0.3, 2)
    rows = np.stack([q, q])
    rows[:, 1 + 2 * k : 3 + 2 * k] = aim + (np.array([[0.0], [1.0]]) - time) * step
    n = -(frames[i].T @ down) / height
    near = np.array([foot * arm.link_lengths[i], 0.0, 0.0])
    one, three = np.ones(size), np.ones((size, 3))
    ints = np.ones(size, np.int64)
    found = Contact(
        k * ints, i * ints, gap * one, time * one, n * three, one, near * three
    )
    return _about(rng, arm, rows, "links_swing", found, least)


def _about(
    rng: np.random.Generator,
    arm: Manipulator,
    rows: Any,
    motion: str,
    found: Contact,
    least: float,
) -> Batch:
    """Queries with required clearances that make the excesses true."""
    excess = excesses(rng, len(found.gap), least, 1e-3)
    required = found.gap - 2.0 * float(arm.link_radius) - excess
    of = np.flatnonzero(required >= 0.0)
    fields = ("link", "frame", "time", "normal", "station", "contact")
    return Batch(
        arm=arm,
        rows=rows,
        motion=motion,
        shape=np.full(len(of), "links"),
        groups=[],
        required=required[of],
        excess=excess[of],
        **{field: getattr(found, field)[of] for field in fields},
    )
