"""Obstacles round the sweep of a witness: walls with openings, tubes, what lies about.

Everything keeps `room` to the arm: the clearance asked for and a reserve.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, TypeAlias

import numpy as np
import trimesh

from benchmarks.hrm2000.curves import TipCurve
from benchmarks.hrm2000.motions import ROW, DraftRejected, Witness
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.manipulator import Manipulator
from vdsm_pin.problem import DesiredPath, PlanningProblem
from vdsm_pin.scene import Box, Capsule, Cylinder, Mesh, Obstacle, Scene, Sphere
from vdsm_pin.verification.link_clearance import link_clearance

Rng: TypeAlias = np.random.Generator

LENGTH: Final = 3.126
"""Length of the arm that lengths in this package are stated for; [m]."""


def scale(arm: Manipulator) -> float:
    """How much larger an arm is than the one lengths are stated for; [-]."""
    return arm.total_length / LENGTH


def required_clearance(arm: Manipulator) -> float:
    """3.5 mm for the paper's arm; [m]."""
    return 0.0035 * scale(arm)


@dataclass(frozen=True)
class Sweep:
    """The arm at every row of a witness.

    Args:
        arm: The arm.
        centres: Joint centres, shape (n, N + 1, 3); [m].
    """

    arm: Manipulator
    centres: FloatArray

    @property
    def reserve(self) -> float:
        """Kept beyond the clearance asked for; covers the way between rows; [m]."""
        return 0.0005 * scale(self.arm)

    @property
    def room(self) -> float:
        """From the links' axes to every obstacle, at least; [m]."""
        return self.arm.link_radius + required_clearance(self.arm) + self.reserve

    def between(self, low: float, high: float) -> FloatArray:
        """Where the links' axes pass a slab across X: y and z, shape (k, 2); [m]."""
        begins = self.centres[:, :-1].reshape(-1, 3)
        ends = self.centres[:, 1:].reshape(-1, 3)
        run = ends[:, 0] - begins[:, 0]
        safe = np.where(run == 0.0, 1.0, run)
        shares = (np.array([[low], [high]]) - begins[:, 0]) / safe
        inside = (begins[:, 0] >= low) & (begins[:, 0] <= high)
        steady = np.where(inside, np.array([[0.0], [1.0]]), np.array([[2.0], [2.0]]))
        shares = np.where(run == 0.0, steady, shares)
        first, last = shares.min(axis=0), shares.max(axis=0)
        crossing = (first <= 1.0) & (last >= 0.0)
        at = np.clip(np.stack([first, last])[:, crossing], 0.0, 1.0)[..., None]
        points = begins[crossing] + at * (ends - begins)[crossing]
        return np.asarray(points[..., 1:].reshape(-1, 2))

    def clearance(self, obstacle: Obstacle) -> float:
        """From the links' surfaces to an obstacle, over all rows; [m]."""
        scene = Scene((obstacle,))
        return float(link_clearance(replace(self._alone, scene=scene))(self._few).min())

    @cached_property
    def _alone(self) -> PlanningProblem:
        path = DesiredPath(start=np.zeros(3), points=np.zeros((1, 3)))
        return PlanningProblem("sweep", self.arm, Scene(()), path, 0.0, np.eye(4))

    @cached_property
    def _few(self) -> FloatArray:
        """Every second row and the last one."""
        return np.concatenate([self.centres[::2], self.centres[-1:]])

    def is_clear(self, obstacle: Obstacle) -> bool:
        """Whether an obstacle leaves the arm its room."""
        # Two rows apart no point of the arm moves by more than a few ROWs.
        slack = 0.25 * ROW * self.arm.total_length
        gap = self.clearance(obstacle)
        return gap >= self.room - self.arm.link_radius + slack

    def places(self, rng: Rng, count: int, low: float) -> FloatArray:
        """Places of the links' axes beyond x = low, shape (count, 3); [m]."""
        rows = rng.integers(len(self.centres), size=4 * count + 64)
        links = rng.integers(self.arm.n_links, size=rows.size)
        share = rng.uniform(0.0, 1.0, rows.size)[:, None]
        begins, ends = self.centres[rows, links], self.centres[rows, links + 1]
        points = begins + share * (ends - begins)
        beyond = points[points[:, 0] >= low]
        if len(beyond) == 0:
            raise DraftRejected
        return np.asarray(beyond[np.arange(count) % len(beyond)])


def sweep(witness: Witness) -> Sweep:
    """What a witness sweeps."""
    return Sweep(witness.arm, witness.centres)


@dataclass(frozen=True)
class Opening:
    """A rectangle in a wall across X.

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
        (low, up) = np.array(sides).T
        middle = np.array([opening.x, *(low + up) / 2.0])
        half = np.array([opening.thick, *(up - low)]) / 2.0
        boxes.append(Box(f"{name}{letter}", middle, np.eye(3), half))
    return boxes


def plate_with_hole(name: str, at: Opening, corners: int, reach: float) -> Mesh:
    """A square plate across X; its round hole has a radius of `at.half[0]` at least."""
    turn = 2.0 * np.pi * np.arange(corners) / corners + np.pi / 4.0
    radius = at.half[0] / np.cos(np.pi / corners)
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    outer = reach * ring / np.abs(ring).max(axis=1)[:, None]
    flat = np.concatenate([at.centre + radius * ring, outer])
    ends = [at.x - at.thick / 2.0, at.x + at.thick / 2.0]
    loops = [np.column_stack([np.full(len(flat), x), flat]) for x in ends]
    grid = np.arange(4 * corners).reshape(4, corners)[[0, 1, 3, 2]]
    return _closed_mesh(name, np.concatenate(loops), _torus(grid))


def tube(
    name: str,
    curve: TipCurve,
    span: tuple[float, float],
    radii: tuple[float, float],
    density: tuple[int, int],
    capped: bool = False,
) -> Mesh:
    """A tube along a curve.

    Args:
        name: Name of the mesh.
        curve: Its middle.
        span: Arc lengths of its ends; [m].
        radii: Of its bore, at the least, and of its outside; [m].
        density: Corners round it and rings along it.
        capped: Whether the far end is closed.
    """
    corners, rings = density
    stations = np.linspace(*span, rings)
    turn = 2.0 * np.pi * np.arange(corners) / corners
    flat = np.stack([np.zeros(corners), np.cos(turn), np.sin(turn)], axis=1)
    frames, middle = curve.frames(stations), curve.at(stations)
    around = np.einsum("nij,kj->nki", frames, flat)
    inner, outer = (
        middle[:, None] + r / np.cos(np.pi / corners) * around for r in radii
    )
    layers = np.concatenate([inner, outer[::-1]])
    vertices = layers.reshape(-1, 3)
    grid = np.arange(len(vertices)).reshape(len(layers), corners)
    if not capped:
        return _closed_mesh(name, vertices, _torus(grid))
    # A lid inside and one outside, fans about their middles.
    bottom = (radii[1] - radii[0]) * frames[-1, :, 0]
    layers[rings:][0] += bottom
    vertices = np.concatenate(
        [layers.reshape(-1, 3), middle[-1:], middle[-1:] + bottom]
    )
    first, count = grid[rings - 1], len(vertices)
    second, after = grid[rings], np.roll(np.arange(corners), -1)
    lids = [
        np.column_stack([first[after], first, np.full(corners, count - 2)]),
        np.column_stack([second, second[after], np.full(corners, count - 1)]),
    ]
    wall_in, wall_out = _strips(grid[:rings]), _strips(grid[rings:])
    mouth = _strips(np.stack([grid[-1], grid[0]]))
    return _closed_mesh(
        name, vertices, np.concatenate([wall_in, wall_out, mouth, *lids])
    )


def _strips(grid: np.ndarray) -> np.ndarray:
    """Two triangles per cell between each ring of corners and the next one."""
    here, there = grid[:-1], grid[1:]
    side, far = np.roll(here, -1, axis=1), np.roll(there, -1, axis=1)
    one = np.stack([here, there, side], axis=-1).reshape(-1, 3)
    two = np.stack([there, far, side], axis=-1).reshape(-1, 3)
    return np.concatenate([one, two])


def _torus(grid: np.ndarray) -> np.ndarray:
    return _strips(np.concatenate([grid, grid[:1]]))


def _closed_mesh(name: str, vertices: FloatArray, triangles: np.ndarray) -> Mesh:
    solid = trimesh.Trimesh(vertices, triangles, process=False)
    if solid.volume < 0.0:
        triangles = triangles[:, ::-1]
    if not solid.is_watertight:
        message = f"{name} is not watertight"
        raise RuntimeError(message)
    return Mesh(name, vertices, triangles, watertight=True)


def _rotation(rng: Rng) -> FloatArray:
    matrix, upper = np.linalg.qr(rng.normal(size=(3, 3)))
    matrix = matrix * np.sign(np.diag(upper))
    return np.asarray(matrix if np.linalg.det(matrix) > 0.0 else -matrix)


def _axis(rng: Rng) -> FloatArray:
    if rng.random() < 0.4:
        return np.eye(3)[1 + int(rng.integers(2))]
    return _rotation(rng)[:, 0]


def ball(rng: Rng, name: str, centre: FloatArray, size: float) -> Obstacle:
    """A sphere of about that size."""
    return Sphere(name, centre, size * rng.uniform(0.2, 0.5))


def crate(rng: Rng, name: str, centre: FloatArray, size: float) -> Obstacle:
    """A box of about that size, turned."""
    return Box(name, centre, _rotation(rng), size * rng.uniform(0.15, 0.6, 3))


def rod(rng: Rng, name: str, centre: FloatArray, size: float) -> Obstacle:
    """A capsule some times as long as thick."""
    half, radius = size * rng.uniform(0.3, 1.0), size * rng.uniform(0.12, 0.25)
    return Capsule(name, centre, _axis(rng), half, radius)


def pipe(rng: Rng, name: str, centre: FloatArray, size: float) -> Obstacle:
    """A long cylinder."""
    half, radius = size * rng.uniform(1.0, 4.0), size * rng.uniform(0.12, 0.3)
    return Cylinder(name, centre, _axis(rng), half, radius)


Maker: TypeAlias = Callable[[Rng, str, FloatArray, float], Obstacle]


@dataclass(frozen=True)
class Litter:
    """What shall lie about.

    Args:
        count: How many.
        makers: Of what.
        size: About how large, from and to; [m].
        away: How far their middles lie from the arm's axis, from and to; [m].
        beyond: Least x of the places about which they lie; [m].
    """

    count: int
    makers: tuple[Maker, ...]
    size: tuple[float, float]
    away: tuple[float, float]
    beyond: float


def scattered(rng: Rng, swept: Sweep, litter: Litter) -> list[Obstacle]:
    """Things about the sweep, each clear of it.

    Raises:
        DraftRejected: If there is no place for so many.
    """
    kept: list[Obstacle] = []
    for centre in swept.places(rng, 12 * litter.count, litter.beyond):
        make = litter.makers[int(rng.integers(len(litter.makers)))]
        aside = rng.normal(size=3)
        aside *= rng.uniform(*litter.away) / np.linalg.norm(aside)
        thing = make(rng, f"i{len(kept)}", centre + aside, rng.uniform(*litter.size))
        if swept.is_clear(thing):
            kept.append(thing)
        if len(kept) == litter.count:
            return kept
    raise DraftRejected
