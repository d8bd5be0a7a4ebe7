"""Walls with openings, plates, tubes and blades; every mesh is a closed solid."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from benchmarks.hrm2000.curves import TipCurve
from benchmarks.hrm2000.sweeps import Sweep
from vdsm_pin.geometry.arrays import FloatArray, IntArray
from vdsm_pin.geometry.solids import Box, Mesh
from vdsm_pin.problem.scene import Obstacle


@dataclass(frozen=True)
class Opening:
    """A rectangle in a wall across X, or the square about a round hole.

    Args:
        x: Middle of the wall; [m].
        thick: Its thickness; [m].
        centre: y and z, shape (2,); [m].
        half: Half the width and half the height, shape (2,); [m].
    """

    x: float
    thick: float
    centre: FloatArray
    half: FloatArray


def least_opening(swept: Sweep, x: float, thick: float) -> Opening | None:
    """The smallest rectangle that the sweep leaves in a wall; None if it misses it."""
    reach = thick / 2.0 + swept.room
    points = swept.between(x - reach, x + reach)
    if not len(points):
        return None
    low, high = points.min(axis=0) - swept.room, points.max(axis=0) + swept.room
    return Opening(x, thick, (low + high) / 2.0, (high - low) / 2.0)


def least_hole(swept: Sweep, x: float, thick: float) -> Opening | None:
    """A round hole about the middle of the smallest rectangle; None if it misses it."""
    least = least_opening(swept, x, thick)
    if least is None:
        return None
    reach = thick / 2.0 + swept.room
    off = np.linalg.norm(swept.between(x - reach, x + reach) - least.centre, axis=1)
    return Opening(x, thick, least.centre, np.full(2, off.max() + swept.room))


def wall(name: str, opening: Opening, reach: float) -> list[Obstacle]:
    """Four boxes round an opening; `reach` from the rail to the wall's edges."""
    (y, z), (wide, high) = opening.centre, opening.half
    spans = {
        "a": ((-reach, y - wide), (-reach, reach)),
        "b": ((y + wide, reach), (-reach, reach)),
        "c": ((y - wide, y + wide), (-reach, z - high)),
        "d": ((y - wide, y + wide), (z + high, reach)),
    }
    boxes: list[Obstacle] = []
    for letter, sides in spans.items():
        low, up = np.array(sides).T
        middle = np.array([opening.x, *(low + up) / 2.0])
        half = np.array([opening.thick, *(up - low)]) / 2.0
        boxes.append(Box(f"{name}{letter}", middle, np.eye(3), half))
    return boxes


def plate_with_hole(name: str, at: Opening, corners: int, reach: float) -> Mesh:
    """A square plate across X; its round hole has an inner radius of `at.half[0]`."""
    turn = 2.0 * np.pi * np.arange(corners) / corners + np.pi / 4.0
    radius = at.half[0] / np.cos(np.pi / corners)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    outer = reach * ring / np.abs(ring).max(axis=1)[:, None]
    loops = [
        np.column_stack([np.full(corners, at.x + side * at.thick / 2.0), flat])
        for side, flat in (
            (-1, at.centre + radius * ring), (-1, outer),
            (1, outer), (1, at.centre + radius * ring),
        )
    ]  # fmt: skip
    grid = np.arange(4 * corners).reshape(4, corners)
    triangles = _strips(np.concatenate([grid, grid[:1]]))
    return _solid(name, np.concatenate(loops), triangles)


@dataclass(frozen=True)
class Tube:
    """A tube along a curve.

    Args:
        curve: Its middle.
        span: Arc lengths of its ends; [m].
        bore: Inner radius; [m].
        thick: Thickness of its wall; [m].
        corners: Corners round it.
        rings: Corners along it.
        capped: Whether the far end is closed.
    """

    curve: TipCurve
    span: tuple[float, float]
    bore: float
    thick: float
    corners: int
    rings: int
    capped: bool = False

    def mesh(self, name: str) -> Mesh:
        """The solid."""
        stations = np.linspace(*self.span, self.rings)
        turn = 2.0 * np.pi * np.arange(self.corners) / self.corners
        flat = np.stack([np.zeros(self.corners), np.cos(turn), np.sin(turn)], axis=1)
        frames, middle = self.curve.frames(stations), self.curve.at(stations)
        around = np.einsum("nij,kj->nki", frames, flat) / np.cos(np.pi / self.corners)
        inner = middle[:, None] + self.bore * around
        outer = middle[:, None] + (self.bore + self.thick) * around
        if not self.capped:
            loops = np.concatenate([inner, outer[::-1]])
            grid = np.arange(len(loops) * self.corners).reshape(len(loops), -1)
            triangles = _strips(np.concatenate([grid, grid[:1]]))
            return _solid(name, loops.reshape(-1, 3), triangles)
        bottom = self.thick * frames[-1, :, 0]
        loops = np.concatenate([inner[::-1], outer, outer[-1:] + bottom])
        return lofted(name, loops, [middle[-1], middle[-1] + bottom])


def lofted(name: str, loops: FloatArray, ends: Sequence[FloatArray]) -> Mesh:
    """Loops of corners joined one after the other, fans about two points at the ends.

    Args:
        name: Name of the mesh.
        loops: Shape (m, k, 3); [m].
        ends: The middle of the first loop's fan and of the last one's; [m].
    """
    count, corners = loops.shape[:2]
    grid = np.arange(count * corners).reshape(count, corners)
    first, last = grid[0], grid[-1]
    middle = np.full(corners, count * corners)
    fans = [
        np.column_stack([np.roll(first, -1), middle, first]),
        np.column_stack([last, middle + 1, np.roll(last, -1)]),
    ]
    vertices = np.concatenate([loops.reshape(-1, 3), np.array(ends)])
    return _solid(name, vertices, np.concatenate([_strips(grid), *fans]))


def _strips(grid: IntArray) -> IntArray:
    """Two triangles per cell between each ring of corners and the next one."""
    here, there = grid[:-1], grid[1:]
    side, far = np.roll(here, -1, axis=1), np.roll(there, -1, axis=1)
    one = np.stack([here, there, side], axis=-1).reshape(-1, 3)
    two = np.stack([there, far, side], axis=-1).reshape(-1, 3)
    return np.concatenate([one, two])


def _solid(name: str, vertices: FloatArray, triangles: IntArray) -> Mesh:
    """A mesh with its triangles facing outwards."""
    solid = trimesh.Trimesh(vertices, triangles, process=False)
    if (
        not solid.is_volume
        and not trimesh.Trimesh(vertices, triangles[:, ::-1], process=False).is_volume
    ):
        message = f"{name} is not a solid"
        raise RuntimeError(message)
    outwards = triangles if solid.volume > 0.0 else triangles[:, ::-1]
    return Mesh(name, vertices, outwards)


@dataclass(frozen=True)
class Ring:
    """Where the blades of a stator stand; its axis is along X.

    Args:
        centre: A point of the axis in the middle of the blades, shape (3,); [m].
        radii: Of the hub and of the casing; [m].
        chord: Length of a blade along X; [m].
        thick: Its thickness; [m].
        stagger: Its turn against X at the hub and at the casing; [rad].
    """

    centre: FloatArray
    radii: tuple[float, float]
    chord: float
    thick: float
    stagger: tuple[float, float]

    def blade(self, name: str, angle: float, sections: int, corners: int) -> Mesh:
        """The blade at an angle about the axis."""
        turn = 2.0 * np.pi * np.arange(corners) / corners
        flat = np.stack([self.chord * np.cos(turn), self.thick * np.sin(turn)]) / 2.0
        out = np.array([0.0, np.cos(angle), np.sin(angle)])
        aside = np.array([0.0, -np.sin(angle), np.cos(angle)])
        loops = []
        for share in np.linspace(0.0, 1.0, sections):
            radius, twist = np.array([self.radii, self.stagger]) @ [1.0 - share, share]
            c, s = np.cos(twist), np.sin(twist)
            x, t = c * flat[0] - s * flat[1], s * flat[0] + c * flat[1]
            middle = self.centre + radius * out
            loops.append(middle + np.outer(x, [1.0, 0.0, 0.0]) + np.outer(t, aside))
        ends = [self.centre + radius * out for radius in self.radii]
        return lofted(name, np.array(loops), ends)
