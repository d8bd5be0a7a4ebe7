"""Queries about error boxes: clear for every motion within a box, or not.

Two kinds, each on top of the queries of `adversarial`. *Inside*: the motion whose truth
is known is one of the box, off the nominal one by errors in a corner. Where it misses
the required clearance the box must not be certified. *Plane*: the motion whose truth is
known is the nominal one. By the bound of docs/certificate.md, written here once more
in plain arrays, its plane proves the clearance for the whole box but for a known rest:
the required clearance is set to that less a little, and then the box must be certified,
since the best plane is no worse.

What is certified is attacked besides: configurations in corners of the box, among them
those that bring the link nearest along n, must keep the clearance.
"""

from dataclasses import dataclass, replace
from typing import Any, Final

import numpy as np
from oracles.adversarial import (
    BASE,
    LINK_MOTIONS,
    Batch,
    centres_of,
    link_frames,
    make_batch,
    make_link_batch,
)

from vdsm_pin.geometry.pieces import PackedPieces
from vdsm_pin.geometry.row_bounds import link_gaps, row_brackets
from vdsm_pin.problem.error_boxes import ErrorBox

INSIDE: Final = ("none", "still", "rail", "away", "pierce", *LINK_MOTIONS)
"""Motions of which one within the box is known."""

PLANE: Final = ("none", "still")
"""Motions of which the nominal one is known, with the plane that proves it."""

CORNERS: Final = 24
"""Corners of the box that every query is attacked from."""

UNSURE: Final = 1e-9
"""An attack counts from so far below the required clearance; [m]."""


@dataclass(frozen=True)
class Boxed:
    """Queries about one motion and one error box.

    Args:
        batch: What is known; its rows are those of the nominal motion.
        errors: The box.
        lost: Whether a motion within the box misses the required clearance, (n,).
        proved: By how much a plane proves the box, -inf where none is known, (n,); [m].
        kept: Whether the nominal motion is known to keep the clearance, (n,).
    """

    batch: Batch
    errors: ErrorBox
    lost: Any
    proved: Any
    kept: Any


def make_boxed(rng: np.random.Generator, size: int, least: float) -> Boxed:
    """Queries of one random kind.

    Args:
        rng: Source of randomness.
        size: Largest number of queries.
        least: Least distance from the limit; [m].
    """
    if rng.random() < 0.4:
        return _plane(rng, size, least)
    motion = str(rng.choice(INSIDE))
    make = make_link_batch if motion in LINK_MOTIONS else make_batch
    return _inside(rng, make(rng, motion, size, least))


def _sizes(rng: np.random.Generator, scale: float = 1.0) -> tuple[float, float]:
    """A joint error and a base error, not both 0; [rad], [m]."""
    joint = rng.choice([0.0, 1.0], p=[0.1, 0.9]) * 10.0 ** rng.uniform(-7.0, -1.5)
    base = rng.choice([0.0, 1.0]) * 10.0 ** rng.uniform(-6.0, -2.0)
    return scale * float(joint), scale * float(base if joint or base else 1e-3)


# ---- a known motion within the box ---------------------------------------------------


def _inside(rng: np.random.Generator, batch: Batch) -> Boxed:
    joint, base = _sizes(rng)
    sides = rng.choice([-1.0, 0.0, 1.0], batch.rows.shape[1], p=[0.45, 0.1, 0.45])
    offset = sides * np.append(base, np.full(len(sides) - 1, joint))
    nominal = batch.rows - offset
    # What rounding left of the offsets is what the box has to hold.
    off = np.abs(batch.rows - nominal).max(axis=0)
    box = ErrorBox(
        joint=float(np.nextafter(max(joint, off[1:].max()), np.inf)),
        base=float(np.nextafter(max(base, off[0]), np.inf)),
        obstacle=_obstacle_error(rng, batch),
    )
    clear = batch.excess > 0.0
    batch = replace(batch, rows=nominal, required=batch.required - _own(batch, box))
    nothing = np.full(batch.size, -np.inf)
    return Boxed(batch, box, ~clear, nothing, np.zeros(batch.size, bool))


def _obstacle_error(rng: np.random.Generator, batch: Batch) -> float:
    """A displacement of the surfaces that leaves the required clearance positive."""
    if not batch.size or batch.frame[0] != BASE:
        return 0.0
    return float(batch.required.min() * rng.choice([0.0, 0.5, 1.0]))


def _own(batch: Batch, box: ErrorBox) -> Any:
    """What the obstacle's error takes from the clearance of each query; [m]."""
    return np.where(batch.frame == BASE, box.obstacle, 0.0)


# ---- a known plane -------------------------------------------------------------------


def _plane(rng: np.random.Generator, size: int, least: float) -> Boxed:
    batch = make_batch(rng, str(rng.choice(PLANE)), size, least)
    # Small ones, so that most planes prove some clearance nevertheless.
    joint, base = _sizes(rng, 0.1)
    box = ErrorBox(joint, base, float(rng.choice([0.0, 1e-5, 1e-3])))
    proved = batch.required + batch.excess - plane_loss(batch, box)
    room = 10.0 ** rng.uniform(np.log10(least), -3.0, batch.size)
    kept = batch.excess > 0.0
    known = kept & (proved - room >= 0.0)
    required = np.where(known, proved - room, 0.0)
    nominal = batch.required + batch.excess
    batch = replace(batch, required=required, excess=nominal - required)
    none = np.zeros(batch.size, bool)
    room = np.where(known, room, -np.inf)
    return Boxed(batch, box, none, room, nominal > required)


def _slopes(batch: Batch) -> Any:
    """Derivatives of n.O of both ends of the links by every angle, (n, 2, 2N)."""
    q = batch.rows[0]
    centres, frames = centres_of(batch.arm, q[None])[0], link_frames(batch.arm, q)
    before = np.concatenate([np.eye(3)[None], frames[:-1]])
    axes = np.stack([before[:, :, 2], frames[:, :, 1]], axis=1)  # yaw, pitch of each
    ends = centres[np.stack([batch.link, batch.link + 1], axis=1)]
    arms = ends[:, :, None] - centres[:-1]
    turned = np.cross(axes[None, None], arms[:, :, :, None])
    slopes = np.einsum("nekac,nc->neka", turned, batch.normal)
    ahead = (
        np.arange(batch.arm.n_links)
        < np.stack([batch.link, batch.link + 1], axis=1)[..., None]
    )
    return (slopes * ahead[..., None]).reshape(batch.size, 2, -1)


def plane_loss(batch: Batch, box: ErrorBox) -> Any:
    """How much less than without errors the known planes prove at rest, (n,); [m]."""
    growth = box.joint * np.abs(_slopes(batch)).sum(axis=2)
    order = np.arange(1, batch.arm.n_links + 1)
    second = 0.5 * np.array(batch.arm.link_lengths) * (2.0 * order * box.joint) ** 2
    total = np.concatenate([[0.0], np.cumsum(second)])
    growth += total[np.stack([batch.link, batch.link + 1], axis=1)]
    centres = centres_of(batch.arm, batch.rows[:1])[0]
    ends = centres[np.stack([batch.link, batch.link + 1], axis=1)]
    height = np.einsum("nec,nc->ne", ends, batch.normal)
    loss = (height + growth).max(axis=1) - height.max(axis=1)
    return loss + box.base + box.obstacle


# ---- attacks -------------------------------------------------------------------------


def _towards(batch: Batch, rng: np.random.Generator) -> Any:
    """Corners that bring the links of some queries nearest along n, (m, 1 + 2N)."""
    if batch.frame[0] != BASE:
        return np.zeros((0, batch.rows.shape[1]))
    some = rng.choice(batch.size, min(batch.size, CORNERS), replace=False)
    end = rng.integers(0, 2, len(some))
    angles = _slopes(batch)[some, end]
    return np.sign(np.column_stack([batch.normal[some, 0], angles]))


def attacked(
    boxed: Boxed, pieces: PackedPieces, found: Any, rng: np.random.Generator
) -> Any:
    """Queries of those found whose clearance some configuration of the box misses.

    Args:
        boxed: The queries.
        pieces: Their obstacles, one a query; the axes of the links between links.
        found: Numbers of the queries to attack.
        rng: Source of randomness.

    Returns:
        Whether each of them is lost, shape (len(found),).
    """
    batch, box = boxed.batch, boxed.errors
    lost = np.zeros(len(found), bool)
    if not len(found):
        return lost
    share = rng.choice([0.0, 1.0, rng.random()], CORNERS)
    rows = batch.rows[0] + share[:, None] * (batch.rows[-1] - batch.rows[0])
    scale = np.append(box.base, np.full(rows.shape[1] - 1, box.joint))
    rows = rows + scale * rng.choice([-1.0, 1.0], rows.shape)
    rows = np.concatenate([rows, batch.rows[:1] + scale * _towards(batch, rng)])
    centres = np.ascontiguousarray(centres_of(batch.arm, rows))
    radius, limit = float(batch.arm.link_radius), batch.required[found] - UNSURE
    link, frame = batch.link[found], batch.frame[found]
    if frame[0] != BASE:
        gaps = link_gaps(centres, np.full(centres.shape[1] - 1, radius))[:, frame, link]
        return (gaps < limit).any(axis=0)
    for corner in centres:
        ends = np.stack([corner[link], corner[link + 1]], axis=1)
        above = row_brackets(pieces, ends, found.astype(np.int64), UNSURE)[:, 1]
        lost |= above - radius - box.obstacle < limit
    return lost
