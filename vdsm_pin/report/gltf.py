"""A problem and its motion as binary glTF 2.0, for other programs' 3D views.

Links are nodes that an animation moves, obstacles are glass, the desired path is a
line. glTF has metres, y up, and quaternions (x, y, z, w).
"""

import json
import struct
from typing import Any, Final

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, IntArray, quaternions
from vdsm_pin.problem.scene import Moving, solid_of
from vdsm_pin.report.drawing import Drawing, told_moments
from vdsm_pin.report.palette import OBSTACLE_EDGE, PATH
from vdsm_pin.report.solids import Surface, detail, surface

_BINARY: Final = 0x4E4F534A, 0x004E4942  # the chunks JSON and BIN
_FLOATS, _NUMBERS = 5126, 5125
_POINTS, _INDICES = 34962, 34963
_LINE: Final = 3
_KINDS: Final = {1: "SCALAR", 3: "VEC3", 4: "VEC4"}
_Y_UP: Final = [-(0.5**0.5), 0.0, 0.0, 0.5**0.5]
_GLASS: Final = 0.42


SECONDS: Final = 10.0
"""Length of a motion that states no times; [s]."""


def glb(drawing: Drawing, seconds: float | None = None) -> bytes:
    """The bytes of a .glb file.

    Args:
        drawing: Arm or robot, motion, scene and desired path.
        seconds: How long it plays, see `play_times`; [s].
    """
    file, problem, moments = _File(), drawing.problem, _told(drawing)
    times = play_times(drawing, moments, seconds).astype("<f4")
    rising = np.append(True, np.diff(times) > 0.0)  # an arm may rest
    moments, clock = moments[rising], file.values(times[rising])
    nodes = []
    for part in drawing.parts(moments):
        mesh = file.mesh(part.name, part.skin, part.colour)
        nodes.append(file.node(name=part.name, mesh=mesh))
        file.move(nodes[-1], clock, part.places, part.turns)
    nodes += _scene(file, drawing, moments, clock)
    if len(drawing.path):
        nodes.append(file.line("desired path", drawing.path, PATH))
    matrix = problem.T_world_base.T.ravel().tolist()
    base = file.node(name="base", matrix=matrix, children=nodes)
    root = file.node(name=problem.name, rotation=_Y_UP, children=[base])
    return file.packed(root)


def play_times(
    drawing: Drawing, moments: FloatArray, seconds: float | None = None
) -> FloatArray:
    """When each moment is reached, from 0, shape (n,); [s].

    In proportion to the motion's own times, else so that the link that moves most moves
    evenly.

    Args:
        drawing: The motion.
        moments: In waypoints, rising, shape (n,).
        seconds: How long it plays; None: as its times say, without them `SECONDS`; [s].
    """
    times = drawing.trajectory.times_at(moments)
    if times is None:
        ways = np.diff(drawing.points(moments), axis=0)
        steps = np.linalg.norm(ways, axis=2).max(axis=1, initial=0.0)
        times = np.append(0.0, np.cumsum(steps + 1e-9))
        seconds = SECONDS if seconds is None else seconds
    way = times - times[0]
    if seconds is None or not way[-1]:
        return np.asarray(way)
    return np.asarray(way * (seconds / way[-1]))


def _told(drawing: Drawing) -> FloatArray:
    """Moments near enough to each other that straight lines between them will do."""
    motion, moving = drawing.trajectory, drawing.problem.scene.moving
    told = [told_moments(one, motion) for one in moving if motion.times is not None]
    return np.unique(np.concatenate([drawing.told_moments(), *told]))


def _scene(
    file: "_File", drawing: Drawing, moments: FloatArray, clock: int
) -> list[int]:
    """A node for each obstacle; what moves is moved."""
    obstacles, nodes = drawing.problem.scene.obstacles, []
    fine, times = detail(len(obstacles)), drawing.trajectory.times_at(moments)
    for one in obstacles:
        skin = surface(solid_of(one), drawing.extent, fine)
        mesh = file.mesh(one.name, skin, OBSTACLE_EDGE, _GLASS)
        nodes.append(file.node(name=one.name, mesh=mesh))
        if isinstance(one, Moving):
            own = one.carrier.path.own_times[:1].repeat(len(moments))
            poses = one.poses(own if times is None else times)
            file.move(nodes[-1], clock, poses[:, :3, 3], poses[:, :3, :3])
    return nodes


class _File:
    """A glTF file while it is made."""

    def __init__(self) -> None:
        self.bytes = bytearray()
        self.views: list[dict[str, Any]] = []
        self.accessors: list[dict[str, Any]] = []
        self.nodes: list[dict[str, Any]] = []
        self.meshes: list[dict[str, Any]] = []
        self.materials: list[dict[str, Any]] = []
        self.channels: list[dict[str, Any]] = []
        self.samplers: list[dict[str, Any]] = []

    def values(self, values: FloatArray | IntArray, target: int | None = None) -> int:
        """Put an array into the file; number of its accessor."""
        kind = np.dtype("<f4" if values.dtype.kind == "f" else "<u4")
        flat = np.ascontiguousarray(values, kind)
        view = {"buffer": 0, "byteOffset": len(self.bytes), "byteLength": flat.nbytes}
        self.views.append(view | ({} if target is None else {"target": target}))
        self.bytes += flat.tobytes()
        table = flat.reshape(len(flat), -1)
        self.accessors.append(
            {
                "bufferView": len(self.views) - 1,
                "componentType": _FLOATS if kind.kind == "f" else _NUMBERS,
                "count": len(table),
                "type": _KINDS[table.shape[1]],
                "min": table.min(axis=0).tolist(),
                "max": table.max(axis=0).tolist(),
            }
        )
        return len(self.accessors) - 1

    def node(self, **fields: Any) -> int:
        """A node with these properties."""
        self.nodes.append(fields)
        return len(self.nodes) - 1

    def mesh(self, name: str, skin: Surface, colour: str, opacity: float = 1.0) -> int:
        """A mesh of triangles; without normals viewers shade its faces flat."""
        attributes = {"POSITION": self.values(skin.vertices, _POINTS)}
        if skin.round:
            attributes["NORMAL"] = self.values(_normals(skin), _POINTS)
        part = {
            "attributes": attributes,
            "indices": self.values(skin.triangles.ravel(), _INDICES),
            "material": self.material(colour, opacity),
        }
        self.meshes.append({"name": name, "primitives": [part]})
        return len(self.meshes) - 1

    def line(self, name: str, points: FloatArray, colour: str) -> int:
        """A node with a polyline, shape (n, 3); [m]."""
        part = {
            "attributes": {"POSITION": self.values(points, _POINTS)},
            "mode": _LINE,
            "material": self.material(colour, 1.0),
        }
        self.meshes.append({"name": name, "primitives": [part]})
        return self.node(name=name, mesh=len(self.meshes) - 1)

    def material(self, colour: str, opacity: float) -> int:
        """A dull colour #rrggbb."""
        channels = np.array([int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5)])
        linear = np.where(
            channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4
        )
        surface_look = {
            "baseColorFactor": [*linear.tolist(), opacity],
            "metallicFactor": 0.0,
            "roughnessFactor": 0.6,
        }
        look = {"pbrMetallicRoughness": surface_look, "doubleSided": True}
        look |= {"alphaMode": "BLEND"} if opacity < 1.0 else {}
        if look not in self.materials:
            self.materials.append(look)
        return self.materials.index(look)

    def move(
        self, node: int, clock: int, places: FloatArray, turns: FloatArray
    ) -> None:
        """Animate a node: places (n, 3) [m] and rotations (n, 3, 3) [-]."""
        around = quaternions(turns)
        for k in range(1, len(around)):  # either sign is right; the nearer one is short
            if around[k] @ around[k - 1] < 0.0:
                around[k] = -around[k]
        for path, values in (("translation", places), ("rotation", around)):
            self.nodes[node][path] = values[0].tolist()
            sampler = {"input": clock, "output": self.values(values)}
            self.samplers.append(sampler)
            target = {"node": node, "path": path}
            self.channels.append({"sampler": len(self.samplers) - 1, "target": target})

    def packed(self, root: int) -> bytes:
        """The whole file."""
        motion = {"channels": self.channels, "samplers": self.samplers}
        content = {
            "asset": {"version": "2.0", "generator": "vdsm-pin"},
            "scene": 0,
            "scenes": [{"nodes": [root]}],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": self.materials,
            "animations": [{"name": "motion", **motion}],
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": len(self.bytes)}],
        }
        text = json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
        chunks = (text + b" " * (-len(text) % 4), bytes(self.bytes))
        body = b"".join(
            struct.pack("<II", len(chunk), kind) + chunk
            for kind, chunk in zip(_BINARY, chunks, strict=True)
        )
        return struct.pack("<4sII", b"glTF", 2, 12 + len(body)) + body


def _normals(skin: Surface) -> FloatArray:
    """Directions out of a smooth surface at its corners, shape (n, 3); [-]."""
    corners = skin.vertices[skin.triangles]
    across = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    found = np.zeros_like(skin.vertices)
    for k in range(3):
        np.add.at(found, skin.triangles[:, k], across)
    size = np.linalg.norm(found, axis=1, keepdims=True)
    return np.where(size > 0.0, found / np.where(size > 0.0, size, 1.0), [0, 0, 1.0])
