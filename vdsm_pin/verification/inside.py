"""Whether a point lies inside a closed mesh, decided in exact arithmetic.

The arm is connected and the clearance proof keeps its axis off the surface, so one
point of one row decides for the whole motion.
"""

from fractions import Fraction
from typing import Final, TypeAlias

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.scene import Mesh
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.verification.records import Check, Verdict

Exact: TypeAlias = tuple[Fraction, Fraction, Fraction]


def _side(a: Exact, b: Exact, x: Fraction, y: Fraction) -> int:
    """On which side of the directed edge a b, seen along z, (x, y) lies: -1, 0, 1."""
    area = (b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])
    return (area > 0) - (area < 0)


def _crosses(corners: list[Exact], point: Exact) -> bool:
    """Whether the ray from a point along +z passes through a triangle.

    Raises:
        ValueError: If it meets the triangle's border or runs in its plane.
    """
    x, y, z = point
    sides = [_side(corners[i], corners[(i + 1) % 3], x, y) for i in range(3)]
    if 1 in sides and -1 in sides:
        return False
    if 0 in sides:
        message = "the ray meets an edge"
        raise ValueError(message)
    a, b, c = corners
    u = [b[i] - a[i] for i in range(3)]
    v = [c[i] - a[i] for i in range(3)]
    n = (
        u[1] * v[2] - u[2] * v[1],
        u[2] * v[0] - u[0] * v[2],
        u[0] * v[1] - u[1] * v[0],
    )
    height = n[0] * (a[0] - x) + n[1] * (a[1] - y) + n[2] * (a[2] - z)
    return height * n[2] > 0


def inside(mesh: Mesh, point: FloatArray) -> bool:
    """Whether a point lies inside a closed mesh.

    The ray is turned away from edges by a shear, so that the count is exact and never
    touches a border; which shear is used makes no difference to the answer.

    Args:
        mesh: Watertight.
        point: Shape (3,), not on the surface; [m].

    Returns:
        Whether the ray crosses the surface an odd number of times.
    """
    corners = mesh.vertices[mesh.triangles]
    low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
    if not ((low <= point) & (point <= high)).all():
        return False
    for attempt in range(1, 100):
        # A slant of small odd fractions: no mesh drawn by people has such edges.
        slant = Fraction(attempt, 1009), Fraction(7 * attempt, 2003)
        try:
            return _count(corners, point, slant) % 2 == 1
        except ValueError:
            continue
    message = f"no ray from {point.tolist()} misses the edges of {mesh.name!r}"
    raise ArithmeticError(message)


def _count(
    corners: FloatArray, point: FloatArray, slant: tuple[Fraction, Fraction]
) -> int:
    """Crossings of the ray from a point along (slant, 1)."""
    shear = np.array([float(slant[0]), float(slant[1])])
    flat = corners[..., :2] - corners[..., 2:] * shear
    at = point[:2] - point[2] * shear
    # A triangle whose sheared box misses the ray by this much cannot be crossed.
    room = 1e-9 * (1.0 + float(np.abs(corners).max()) + float(np.abs(point).max()))
    near = ((flat.min(axis=1) - room <= at) & (at <= flat.max(axis=1) + room)).all(
        axis=1
    )

    def exact(values: FloatArray) -> Exact:
        x, y, z = (Fraction(float(value)) for value in values)
        return x - slant[0] * z, y - slant[1] * z, z

    origin = exact(point)
    return sum(
        _crosses([exact(corner) for corner in triangle], origin)
        for triangle in corners[near]
    )


NAME: Final = "arm outside the closed meshes"
"""Name of the row."""


def check_inside(problem: PlanningProblem, trajectory: Trajectory) -> tuple[Check, ...]:
    """The arm is not inside a closed mesh.

    Args:
        problem: The scene.
        trajectory: Its first row decides: the arm is connected, and where the clearance
            is proved it never passes a surface.

    Returns:
        One row for all closed meshes, none without.
    """
    meshes = [o for o in problem.scene.obstacles if isinstance(o, Mesh)]
    closed = [mesh for mesh in meshes if mesh.watertight]
    if not closed:
        return ()
    base = np.array([trajectory.x0[0], 0.0, 0.0])
    swallowed = [mesh.name for mesh in closed if inside(mesh, base)]
    return (
        Check(
            name=NAME,
            verdict=Verdict.REFUTED if swallowed else Verdict.CERTIFIED,
            count=len(closed),
            worst=float(len(swallowed)),
            limit=0.0,
            unit="-",
            where=f"base inside {swallowed[0]}" if swallowed else "",
            moment=0.0 if swallowed else float("nan"),
        ),
    )
