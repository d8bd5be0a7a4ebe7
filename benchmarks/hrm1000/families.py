"""The families: each makes obstacles and a tip path from a random generator.

Lengths are metres in the frame of an arm 3.126 m long whose tip starts near
(3.126, 0, 0). A family that promises feasibility promises this much: the tip itself and
the straight arm at the start keep 8 mm to every obstacle, and where it says so the
straight arm does not pass. It does not promise that a plan exists. A problem of the
family `infeasible` has none: the reason is in its name.
"""

import itertools
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
import trimesh

Rng: TypeAlias = np.random.Generator
Obstacles: TypeAlias = list[dict[str, Any]]
Draft: TypeAlias = dict[str, Any]
"""Keys `obstacles` and `points`, and where they differ from the default `closed`,
`start`, `hard` (the straight arm is in the way), `answer`."""

TIP: Final = 3.126
CLEARANCE: Final = 0.0035
"""What every problem requires; [m]."""


def curve(rng: Rng, x: float = TIP) -> Draft:
    """A rectangle, circle, spiral or polyline about the rail's end."""
    kind = int(rng.integers(4))
    if kind == 0:
        centre, half = rng.uniform(-0.4, 0.4, 2), rng.uniform(0.2, 0.7, 2)
        corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half
        turn = rng.uniform(0.0, np.pi / 2.0)
        flat, closed = centre + corners @ _rotation(turn), True
    elif kind == 1:
        angle = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
        circle = np.stack([np.cos(angle), np.sin(angle)], axis=1)
        flat = rng.uniform(-0.4, 0.4, 2) + rng.uniform(0.2, 0.9) * circle
        closed = True
    elif kind == 2:
        angle = np.linspace(0.0, 4.0 * np.pi, 97)
        radius = np.linspace(0.1, rng.uniform(0.5, 1.2), 97)
        flat = radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        closed = False
    else:
        flat, closed = rng.uniform(-1.1, 1.1, (int(rng.integers(2, 6)), 2)), False
    depth = np.full(len(flat), x)
    if kind == 3:
        depth = depth + rng.uniform(-0.3, 0.3, len(flat))
    return {"points": np.column_stack([depth, flat]), "closed": closed}


def _rotation(angle: float) -> np.ndarray:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, s], [-s, c]])


def _polygon(rng: Rng, radius: float, centre: np.ndarray) -> list[list[float]]:
    count = int(rng.integers(3, 9))
    turns = (np.arange(count) + rng.uniform(0.0, 0.4, count)) * 2.0 * np.pi / count
    turns = turns + rng.uniform(0.0, 2.0 * np.pi)
    ring = radius * np.stack([np.cos(turns), np.sin(turns)], axis=1)
    return (centre + ring).tolist()


def prismatic_x(rng: Rng, folder: Path, radius: float) -> Draft:
    """One to six prisms along X."""
    obstacles: Obstacles = []
    for _ in range(int(rng.integers(1, 7))):
        angle, distance = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.3, 1.5)
        centre = distance * np.array([np.cos(angle), np.sin(angle)])
        low = -3.0 if rng.random() < 0.5 else float(rng.uniform(0.0, 2.0))
        high = 6.0 if rng.random() < 0.5 else float(rng.uniform(2.2, 4.0))
        polygon = _polygon(rng, rng.uniform(0.06, 0.3), centre)
        obstacles.append({"shape": "prism", "axis": "x", "polygon": polygon,
                          "from": low, "to": high})  # fmt: skip
    return {"obstacles": obstacles, **curve(rng), "hard": True}


def crossing(rng: Rng, folder: Path, radius: float) -> Draft:
    """One to four long cylinders across the arm at any angle."""
    obstacles: Obstacles = []
    for _ in range(int(rng.integers(1, 5))):
        centre = [rng.uniform(0.6, 3.0), *rng.uniform(-1.0, 1.0, 2)]
        obstacles.append({"shape": "cylinder", "axis": _direction(rng),
                          "center": centre, "radius": rng.uniform(0.03, 0.2),
                          "length": rng.uniform(1.0, 6.0)})  # fmt: skip
    return {"obstacles": obstacles, **curve(rng), "hard": True}


def _direction(rng: Rng) -> list[float]:
    axis = rng.normal(size=3)
    return (axis / np.linalg.norm(axis)).tolist()


def clutter(rng: Rng, folder: Path, radius: float) -> Draft:
    """Two to eight boxes and spheres."""
    obstacles: Obstacles = []
    for _ in range(int(rng.integers(2, 9))):
        centre = [rng.uniform(0.3, 3.4), *rng.uniform(-1.4, 1.4, 2)]
        if rng.random() < 0.5:
            obstacles.append({"shape": "sphere", "center": centre,
                              "radius": rng.uniform(0.05, 0.35)})  # fmt: skip
        else:
            size, turn = rng.uniform(0.1, 0.6, 3), rng.uniform(-180, 180, 3)
            obstacles.append({"shape": "box", "center": centre,
                              "size": size, "rpy_deg": turn})  # fmt: skip
    return {"obstacles": obstacles, **curve(rng), "hard": True}


def wall_with_hole(
    x: float, thick: float, hole: float, round_hole: bool, half: float = 3.0
) -> Obstacles:
    """A wall across the rail with a hole about it, square or of 24 corners."""
    if not round_hole:
        bar = (half - hole) / 2.0
        out, wide = hole + bar, 2.0 * half
        sides = [
            (0, out, wide, 2 * bar),
            (0, -out, wide, 2 * bar),
            (out, 0, 2 * bar, 2 * hole),
            (-out, 0, 2 * bar, 2 * hole),
        ]
        return [{"shape": "box", "center": [x, y, z], "size": [thick, wide, high]}
                for y, z, wide, high in sides]  # fmt: skip
    obstacles: Obstacles = []
    for side in (1.0, -1.0):
        angle = np.linspace(0.0, np.pi, 13)
        # Corners outside the circle, its sides on it: the hole is no smaller.
        ring = hole / np.cos(np.pi / 24) * np.stack([np.cos(angle), np.sin(angle)], 1)
        outer = np.array([[-half, 0.0], [-half, half], [half, half], [half, 0.0]])
        polygon = np.vstack([ring, outer]) * np.array([1.0, side])
        obstacles.append({"shape": "prism", "axis": "x", "polygon": polygon.tolist(),
                          "from": x - thick / 2, "to": x + thick / 2})  # fmt: skip
    return obstacles


def wall(rng: Rng, folder: Path, radius: float) -> Draft:
    """A wall with a round or square hole that the arm reaches through."""
    x, hole = rng.uniform(1.2, 2.0), rng.uniform(0.15, 0.35)
    obstacles = wall_with_hole(x, rng.uniform(0.02, 0.3), hole, rng.random() < 0.5)
    reach = 0.5 * (TIP - x)
    return {"obstacles": obstacles, "points": _ring(rng, reach), "closed": True}


def _ring(rng: Rng, radius: float, x: float = TIP, centre: Any = (0.0, 0.0)) -> Any:
    angle = np.linspace(0.0, 2.0 * np.pi, 33)[:-1] + rng.uniform(0.0, 2.0 * np.pi)
    ring = radius * np.stack([np.cos(angle), np.sin(angle)], axis=1) + centre
    return np.column_stack([np.full(32, x), ring])


def pipe(rng: Rng, folder: Path, radius: float) -> Draft:
    """A pipe about the rail, eight-sided, that turns aside at a bend."""
    bore, bend = rng.uniform(0.2, 0.3), rng.uniform(0.1, 0.3)
    around = rng.uniform(0.0, 2.0 * np.pi)
    turn_x = rng.uniform(1.6, 2.0)
    obstacles = _tube(np.array([0.6, 0, 0]), np.array([turn_x, 0, 0]), bore)
    aside = np.array([0.0, np.cos(around), np.sin(around)])
    along = np.cos(bend) * np.array([1.0, 0, 0]) + np.sin(bend) * aside
    corner = np.array([turn_x + 0.25, 0.0, 0.0])
    obstacles += _tube(corner, corner + 0.6 * along, bore)
    tip = corner + rng.uniform(0.8, 1.0) * along
    points = _ring(rng, 0.6 * bore, float(tip[0]), tip[1:])
    return {"obstacles": obstacles, "points": points, "closed": True,
            "start": [turn_x - 0.2, 0.0, 0.0]}  # fmt: skip


def _tube(begin: np.ndarray, end: np.ndarray, bore: float) -> Obstacles:
    """Eight boards of 20 mm round a segment, `bore` from it to each."""
    x = (end - begin) / np.linalg.norm(end - begin)
    up = np.cross(x, [0.0, 1.0, 0.0])
    up = up / np.linalg.norm(up)
    obstacles: Obstacles = []
    for k in range(8):
        angle = k * np.pi / 4.0
        out = np.cos(angle) * up + np.sin(angle) * np.cross(x, up)
        axes = np.column_stack([x, np.cross(out, x), out])
        centre = (begin + end) / 2.0 + (bore + 0.01) * out
        size = [float(np.linalg.norm(end - begin)), 2 * bore * np.tan(np.pi / 8), 0.02]
        obstacles.append({"shape": "box", "center": centre.tolist(), "size": size,
                          "rpy_deg": _rpy_deg(axes)})  # fmt: skip
    return obstacles


def _rpy_deg(rotation: np.ndarray) -> list[float]:
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    pitch = np.arctan2(-rotation[2, 0], np.hypot(rotation[0, 0], rotation[1, 0]))
    roll = np.arctan2(rotation[2, 1], rotation[2, 2])
    return np.rad2deg([roll, pitch, yaw]).tolist()


def shelf(rng: Rng, folder: Path, radius: float) -> Draft:
    """Boards above one another; the tip draws in the bays between them."""
    pitch, boards = rng.uniform(0.4, 0.6), int(rng.integers(3, 6))
    depth = rng.uniform(0.4, 0.9)
    heights = (np.arange(boards) - (boards - 1) / 2.0) * pitch + pitch / 2.0
    obstacles: Obstacles = [
        {"shape": "box", "center": [TIP + 0.1 - depth / 2, 0.0, float(z)],
         "size": [depth, 2.4, 0.03]} for z in heights
    ]  # fmt: skip
    points = []
    for low, high in itertools.pairwise(heights):
        middle, wide = (low + high) / 2.0, rng.uniform(0.2, 0.7)
        points += [[TIP, -wide, middle], [TIP, wide, middle]]
        # Out of the bay before the next one.
        points += [[TIP - depth - 0.1, wide, middle], [TIP - depth - 0.1, -wide, high
                   + pitch / 2.0]]  # fmt: skip
    path = np.array(points[:-2])
    return {"obstacles": obstacles, "points": path, "closed": False,
            "start": [TIP - depth - 0.2, 0.0, 0.0]}  # fmt: skip


def mesh(rng: Rng, folder: Path, radius: float) -> Draft:
    """One or two watertight meshes: rings and lumpy balls."""
    obstacles: Obstacles = []
    for i in range(int(rng.integers(1, 3))):
        name = f"part{i}-{rng.integers(1 << 32):08x}.stl"
        if rng.random() < 0.5:
            solid = trimesh.creation.torus(rng.uniform(0.2, 0.5), 0.06, 24, 10)
        else:
            solid = trimesh.creation.icosphere(2, 0.25)
            lumps = rng.uniform(0.8, 1.2, (len(solid.vertices), 1))
            solid.vertices = solid.vertices * lumps
        solid.export(folder / name)
        centre = [rng.uniform(1.0, 2.8), *rng.uniform(-0.9, 0.9, 2)]
        obstacles.append({"shape": "mesh", "file": name, "center": centre,
                          "rpy_deg": rng.uniform(-180, 180, 3).tolist()})  # fmt: skip
    return {"obstacles": obstacles, **curve(rng), "hard": True}


def narrow(rng: Rng, folder: Path, radius: float) -> Draft:
    """A hole wider than the body and its clearance by 4 to 15 mm on each side."""
    x = rng.uniform(0.9, 1.5)
    hole = radius + CLEARANCE + rng.uniform(0.004, 0.015)
    obstacles = wall_with_hole(x, 0.02, hole, rng.random() < 0.5)
    points = _ring(rng, rng.uniform(0.1, 0.35) * (TIP - x))
    return {"obstacles": obstacles, "points": points, "closed": True}


def infeasible(rng: Rng, folder: Path, radius: float) -> Draft:
    """No arm can do it: out of reach, into a solid, behind a wall, hole too small."""
    kind = ("reach", "solid", "wall", "hole")[int(rng.integers(4))]
    draft: Draft = {"points": _ring(rng, 0.5), "closed": True, "answer": kind}
    if kind == "reach":
        far = rng.uniform(3.0, 3.6)
        draft["points"] = _ring(rng, 0.3, TIP, (far / np.sqrt(2), far / np.sqrt(2)))
        draft["obstacles"] = clutter(rng, folder, radius)["obstacles"]
    elif kind == "solid":
        at = draft["points"][int(rng.integers(32))]
        draft["obstacles"] = [{"shape": "sphere", "center": at.tolist(),
                               "radius": rng.uniform(0.05, 0.2)}]  # fmt: skip
    else:
        x = rng.uniform(1.5, 2.5)
        hole = 0.02 if kind == "wall" else radius + rng.uniform(-0.02, 0.003)
        # 8 m wide: its edge is beyond every reach, and the rail ends before it helps.
        draft["obstacles"] = wall_with_hole(x, 0.1, hole, False, 4.0)
        draft["start"] = [x - 0.4, 0.0, 0.0]
    return draft


FAMILIES: Final[Mapping[str, Callable[[Rng, Path, float], Draft]]] = {
    "prismatic_x": prismatic_x,
    "crossing": crossing,
    "clutter": clutter,
    "wall": wall,
    "pipe": pipe,
    "shelf": shelf,
    "mesh": mesh,
    "narrow": narrow,
    "infeasible": infeasible,
}
"""Every family by name; the last argument is the radius of the arm's body [m]."""
