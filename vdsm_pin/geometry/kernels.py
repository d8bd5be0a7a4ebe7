"""Distance between a body and a convex piece, as a bracket.

The iteration (Gilbert, Johnson and Keerthi) only proposes. What it returns is proved by
itself: `lower` is the gap between the supports of a separating plane, `upper` the
distance of two points that lie in the two bodies.
"""

from math import sqrt
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import ALIGNED, Body, body_support
from vdsm_pin.geometry.pieces import CYLINDER, HALF_SPACE, PackedPieces
from vdsm_pin.geometry.simplex import nearest

LOWER: Final = 0
UPPER: Final = 1
NORMAL: Final = 2
NEAR: Final = 5
FAR: Final = 8
BRACKET: Final = 11
"""Layout of a bracket: lower, upper, n (3), point of the body (3), point of the piece
(3); n is a unit vector from the body to the piece."""

MAX_STEPS: Final = 60
"""Largest number of supports tried; 5 to 15 are usual."""

SCRATCH_ROWS: Final = 14
"""Rows of three numbers that `bracket` needs as working space."""


class Goal(NamedTuple):
    """How wide a bracket at which to stop.

    Args:
        width: So wide at least; [m].
        part: Or this part of the clearance, where that is more; [-].
        lost: What the clearance is less than the distance; [m].
        enough: A distance proved from which on no bracket is asked for; [m].
    """

    width: float
    part: float
    lost: float
    enough: float


@compiled
def piece_support(
    pieces: PackedPieces, p: int, nx: float, ny: float, nz: float, point: FloatArray
) -> float:
    """Least n.x over the core of a piece: a hull without its radius, a whole cylinder.

    Args:
        pieces: The scene.
        p: Number of the piece; not a half-space.
        nx: Direction n, any length.
        ny: The same.
        nz: The same.
        point: Where the least value is taken, written, shape (3,); [m].

    Returns:
        The least value.
    """
    if pieces.kind[p] == CYLINDER:
        a, c = pieces.axis[p], pieces.centre[p]
        along = nx * a[0] + ny * a[1] + nz * a[2]
        qx, qy, qz = nx - along * a[0], ny - along * a[1], nz - along * a[2]
        # Where n is nearly the axis q is mostly rounding, even along the axis: taken
        # across it again, or dropped, so that the point lies in the solid.
        rest = qx * a[0] + qy * a[1] + qz * a[2]
        qx, qy, qz = qx - rest * a[0], qy - rest * a[1], qz - rest * a[2]
        across = sqrt(qx * qx + qy * qy + qz * qz)
        shift = pieces.extent[p] if along < 0.0 else -pieces.extent[p]
        turn = pieces.radius[p] / across if across > ALIGNED * abs(along) else 0.0
        point[0] = c[0] + shift * a[0] - turn * qx
        point[1] = c[1] + shift * a[1] - turn * qy
        point[2] = c[2] + shift * a[2] - turn * qz
        middle = nx * c[0] + ny * c[1] + nz * c[2]
        return float(middle + shift * along - pieces.radius[p] * across)
    corners = pieces.points[pieces.first_point[p] : pieces.first_point[p + 1]]
    best, at = np.inf, 0
    for k in range(corners.shape[0]):
        value = nx * corners[k, 0] + ny * corners[k, 1] + nz * corners[k, 2]
        if value < best:
            best, at = value, k
    point[0], point[1], point[2] = corners[at, 0], corners[at, 1], corners[at, 2]
    return best


@compiled
def rounding_radius(pieces: PackedPieces, p: int) -> float:
    """By how much the core of a piece is grown; [m]."""
    if pieces.kind[p] == CYLINDER or pieces.kind[p] == HALF_SPACE:
        return 0.0
    return float(pieces.radius[p])


@compiled(inline=False)
def _half_space_bracket(
    pieces: PackedPieces, p: int, body: Body, out: FloatArray
) -> None:
    """The exact distance to a half-space."""
    n = pieces.axis[p]
    near = out[NEAR:FAR]
    high = body_support(body, -n[0], -n[1], -n[2], near)
    gap = -pieces.extent[p] - high
    out[LOWER] = out[UPPER] = gap
    for c in range(3):
        out[NORMAL + c] = -n[c]
        out[FAR + c] = near[c] - gap * n[c]


@compiled
def keep_least(trial: FloatArray, out: FloatArray) -> None:
    """Fold the bracket of one more piece into the least one of several.

    Args:
        trial: The bracket of the piece.
        out: The least bounds, n of the lower one, witnesses of the upper; updated.
    """
    if trial[UPPER] < out[UPPER]:
        out[UPPER] = trial[UPPER]
        out[NEAR:BRACKET] = trial[NEAR:BRACKET]
    if trial[LOWER] < out[LOWER]:
        out[LOWER] = trial[LOWER]
        out[NORMAL:NEAR] = trial[NORMAL:NEAR]


@compiled
def _compact(scratch: FloatArray, m: int, weights: FloatArray) -> int:
    """Drop the corners of weight 0; rows k, 4 + k and 8 + k belong together."""
    kept = 0
    for k in range(m):
        if weights[k] > 0.0:
            if kept != k:
                weights[kept] = weights[k]
                for c in range(3):
                    scratch[kept, c] = scratch[k, c]
                    scratch[4 + kept, c] = scratch[4 + k, c]
                    scratch[8 + kept, c] = scratch[8 + k, c]
            kept += 1
    return kept


@compiled
def _witness(
    scratch: FloatArray, m: int, weights: FloatArray, out: FloatArray
) -> float:
    """Witness points from the weights, kept where they improve the upper bound.

    Returns:
        Distance between the two points; [m].
    """
    squared = 0.0
    for c in range(3):
        near = far = 0.0
        for k in range(m):
            near += weights[k] * scratch[4 + k, c]
            far += weights[k] * scratch[8 + k, c]
        scratch[12, c], scratch[13, c] = near, far
        squared += (far - near) * (far - near)
    gap = sqrt(squared)
    if gap < out[UPPER]:
        out[UPPER] = gap
        for c in range(3):
            out[NEAR + c], out[FAR + c] = scratch[12, c], scratch[13, c]
    return gap


@compiled
def _known(scratch: FloatArray, m: int) -> bool:
    """Whether corner m of the simplex is one of the others."""
    for k in range(m):
        if (
            scratch[k, 0] == scratch[m, 0]
            and scratch[k, 1] == scratch[m, 1]
            and scratch[k, 2] == scratch[m, 2]
        ):
            return True
    return False


@compiled(inline=False)
def _direction(
    scratch: FloatArray, m: int, distance: float
) -> tuple[float, float, float]:
    """The unit vector from the origin to the nearest point of a simplex.

    Near a large triangle the plane has it far better than a point in it has.
    """
    if m == 3:
        a, b, c = scratch[0], scratch[1], scratch[2]
        ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
        vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        length = sqrt(nx * nx + ny * ny + nz * nz)
        if nx * a[0] + ny * a[1] + nz * a[2] < 0.0:
            length = -length
        if length != 0.0:
            return nx / length, ny / length, nz / length
    near, far = scratch[12], scratch[13]
    return (
        (far[0] - near[0]) / distance,
        (far[1] - near[1]) / distance,
        (far[2] - near[2]) / distance,
    )


@compiled(inline=False)
def _iterate(
    pieces: PackedPieces,
    p: int,
    body: Body,
    goal: Goal,
    scratch: FloatArray,
    out: FloatArray,
) -> None:
    """Core distance, from the direction in `out`; a bracket is left in `out`."""
    weights = out[BRACKET : BRACKET + 4]
    nx, ny, nz = out[NORMAL], out[NORMAL + 1], out[NORMAL + 2]
    out[LOWER], out[UPPER] = -np.inf, np.inf
    m = 0
    for _ in range(MAX_STEPS):
        high = body_support(body, nx, ny, nz, scratch[4 + m])
        gap = piece_support(pieces, p, nx, ny, nz, scratch[8 + m]) - high
        raised = gap > out[LOWER]
        if raised:
            out[LOWER] = gap
            out[NORMAL], out[NORMAL + 1], out[NORMAL + 2] = nx, ny, nz
        width = max(goal.width, goal.part * (out[LOWER] - goal.lost))
        if out[UPPER] - out[LOWER] <= width or out[LOWER] >= goal.enough:
            break
        for c in range(3):
            scratch[m, c] = scratch[8 + m, c] - scratch[4 + m, c]
        if _known(scratch, m):
            break
        nearest(scratch, m + 1, weights)
        m = _compact(scratch, m + 1, weights)
        before = out[UPPER]
        distance = _witness(scratch, m, weights, out)
        # A direction may turn far while the distance stays within its rounding.
        if m == 4 or distance == 0.0 or not (distance < before or raised):
            break
        nx, ny, nz = _direction(scratch, m, distance)


@compiled
def bracket(
    pieces: PackedPieces,
    p: int,
    body: Body,
    goal: float,
    scratch: FloatArray,
    out: FloatArray,
) -> None:
    """`bracket_to` of a width alone; [m]."""
    bracket_to(pieces, p, body, Goal(goal, 0.0, 0.0, np.inf), scratch, out)


@compiled(inline=False)
def bracket_to(
    pieces: PackedPieces,
    p: int,
    body: Body,
    goal: Goal,
    scratch: FloatArray,
    out: FloatArray,
) -> None:
    """Distance between a body and a piece.

    Args:
        pieces: The scene.
        p: Number of the piece.
        body: The body.
        goal: Width of the bracket at which to stop.
        scratch: Working space, shape (SCRATCH_ROWS, 3).
        out: Shape (BRACKET + 4,). On entry out[NORMAL:NEAR] is a first guess of n, not
            zero; on return the bracket. Where the bodies meet both bounds are below or
            at 0 and only their sign is meant; `lower` may be far below `upper`.
    """
    if pieces.kind[p] == HALF_SPACE:
        _half_space_bracket(pieces, p, body, out)
        return
    length = sqrt(out[NORMAL] ** 2 + out[NORMAL + 1] ** 2 + out[NORMAL + 2] ** 2)
    if not length > 0.0:
        out[NORMAL], out[NORMAL + 1], out[NORMAL + 2] = 1.0, 0.0, 0.0
        length = 1.0
    for c in range(3):
        out[NORMAL + c] /= length
    radius = rounding_radius(pieces, p)
    lost, enough = goal.lost + radius, goal.enough + radius
    core = Goal(goal.width, goal.part, lost, enough)
    _iterate(pieces, p, body, core, scratch, out)
    if radius > 0.0:
        out[LOWER] -= radius
        out[UPPER] -= radius
        for c in range(3):
            out[FAR + c] -= radius * out[NORMAL + c]
