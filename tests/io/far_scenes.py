"""Random problem files whose coordinates are large and cancel beside the base."""

from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml
from problem_texts import TETRAHEDRON

from vdsm_pin.geometry.arrays import rotation_from_rpy

SHAPES: Final = (
    "sphere",
    "capsule",
    "cylinder",
    "box",
    "prism",
    "half_space",
    "mesh",
    "far mesh",
)


class FarScene:
    """One problem around a base far away.

    Args:
        rng: Where its numbers come from.
        far: About how far the base stands from the file's origin; [unit].
    """

    def __init__(self, rng: np.random.Generator, far: float) -> None:
        self.rng, self.far = rng, far
        self.unit = str(rng.choice(["mm", "m"]))
        self.size = {"mm": 1e3, "m": 1.0}[self.unit] * 10.0 ** rng.uniform(-0.5, 1.0)
        self.base = rng.uniform(-far, far, 3)
        self.meshes: dict[str, str] = {}

    def near(self) -> Any:
        """A point beside the base, in the file's frame; [unit]."""
        return self.base + self.rng.uniform(-self.size, self.size, 3)

    def angles(self) -> list[float]:
        """Roll, pitch, yaw: plain, of whole quarters or of many turns; [deg]."""
        turns = 10.0 ** self.rng.uniform(0, 12) * self.rng.choice([-1.0, 1.0], 3)
        quarters = 90.0 * self.rng.integers(-8, 8, 3)
        found = [self.rng.uniform(-180, 180, 3), quarters, turns]
        return [float(x) for x in found[self.rng.integers(3)]]

    def obstacle(self, shape: str) -> dict[str, Any]:
        """One obstacle beside the base."""
        rng, size = self.rng, self.size
        centre, length, radius = self.near().tolist(), *rng.uniform(0, size, 2).tolist()
        match shape:
            case "sphere":
                return {"center": centre, "radius": radius}
            case "capsule" | "cylinder":
                axis = (rng.normal(size=3) * 10.0 ** rng.uniform(-12, 11)).tolist()
                axis = axis if rng.uniform() < 0.7 else str(rng.choice([*"xyz"]))
                round_ = {"axis": axis, "length": length, "radius": radius}
                return {"center": centre} | round_
            case "box":
                edges = rng.uniform(0, size, 3).tolist()
                return {"center": centre, "size": edges, "rpy_deg": self.angles()}
            case "prism":
                return self._prism()
            case "half_space":
                return self._half_space()
        return self._mesh(far=shape == "far mesh")

    def _prism(self) -> dict[str, Any]:
        axis = int(self.rng.integers(3))
        order = [(axis + 1) % 3, (axis + 2) % 3, axis]
        corner = self.near()[order]
        outline = np.array([[0, 0], [1, 0], [1, 1], [0.4, 0.3], [0, 1]]) * self.size
        polygon = (corner[:2] + outline).tolist()
        low, high = float(corner[2]), float(corner[2] + self.size)
        return {"axis": "xyz"[axis], "polygon": polygon, "from": low, "to": high}

    def _half_space(self) -> dict[str, Any]:
        """A plane beside the base, by a point of it that is far from both."""
        normal = self.rng.normal(size=3)
        along = np.cross(normal, self.rng.normal(size=3))
        point = self.near() + along / np.linalg.norm(along) * self.far
        length = 10.0 ** self.rng.uniform(-12, 11)
        return {"point": point.tolist(), "normal": (normal * length).tolist()}

    def _mesh(self, *, far: bool) -> dict[str, Any]:
        """A tetrahedron; far from the mesh's own origin where its rounding allows."""
        scale = max(10.0 ** self.rng.uniform(-3, 3), self.far / 1e11)
        away = self.rng.uniform(-1, 1, 3) * (self.far if far else self.size) / scale
        corners = TETRAHEDRON.reshape(-1, 3) * self.size / scale + away
        rpy = self.angles() if self.rng.uniform() < 0.8 else [0.0, 0.0, 0.0]
        reduced = np.deg2rad(np.fmod(rpy, 360.0))
        moved = rotation_from_rpy(reduced) @ (away * scale)
        name = f"part{len(self.meshes)}.obj"
        lines = [f"v {x!r} {y!r} {z!r}\n" for x, y, z in corners.tolist()]
        faces = [f"f {k + 1} {k + 2} {k + 3}\n" for k in range(0, len(lines), 3)]
        self.meshes[name] = "".join(lines + faces)
        place = {"scale": scale, "rpy_deg": rpy, "center": (self.near() - moved)}
        place["center"] = place["center"].tolist()
        return {"file": name, "check_size": False} | place

    def write(self, folder: Path, shapes: tuple[str, ...] = SHAPES) -> Path:
        """The problem with one obstacle of each shape, and its meshes."""
        obstacles = [
            {"name": shape, "shape": shape.split()[-1]} | self.obstacle(shape)
            for shape in shapes
        ]
        metre = {"mm": 1e3, "m": 1.0}[self.unit]
        joints = {"x0": 0.0, "alpha_deg": [0.0] * 8, "theta_deg": [0.0] * 8}
        data = {
            "vdsm_problem": 1,
            "length_unit": self.unit,
            "manipulator": "hrm8",
            "base": {"position": self.base.tolist(), "rpy_deg": self.angles()},
            "obstacles": obstacles,
            "tip_path": {
                "start": {"joints": joints},
                "points": [self.near().tolist() for _ in range(4)],
                "closed": bool(self.rng.uniform() < 0.5),
                "spacing": metre,
            },
            "required_clearance": 0.0,
        }
        for name, text in self.meshes.items():
            (folder / name).write_text(text)
        path = folder / "far.yaml"
        path.write_text(yaml.dump(data, Dumper=yaml.CSafeDumper, sort_keys=False))
        return path
