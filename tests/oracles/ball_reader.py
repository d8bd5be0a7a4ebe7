"""A second reader of problems, meshes and trajectories, in ball arithmetic.

Shares nothing with `vdsm_pin.io`, whose numbers it is held against: decimals become the
nearest double, units are converted in balls, and everything comes out in metres,
radians and the base frame.
"""

import hashlib
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise, product
from math import isfinite
from pathlib import Path
from typing import Any, Final, TypeAlias

import numpy as np
import yaml
from flint import arb, arb_mat

from vdsm_pin.certificate_checker.balls import column, dot, unit

NUMBER: Final = re.compile(r"[-+]?(\.[0-9]+|[0-9]+(\.[0-9]*)?)([eE][-+]?[0-9]+)?")
HRM8: Final = {
    "link_lengths": ["486"] * 5 + ["206", "206", "284"],
    "link_radius": "61.5",
    "max_link_angle_deg": "42.5",
    "max_joint_angle_deg": "42.5",
    "base_range": ["-5000", "5000"],
}
"""Table 1 of the paper; [mm]."""
ZERO: Final = ("0", "0", "0")


def require(holds: object, problem: str) -> None:
    """Refuse a file.

    Raises:
        ValueError: If the condition does not hold.
    """
    if not holds:
        raise ValueError(problem)


@dataclass(frozen=True)
class Hull:
    """Hull of points, rows of three, grown by a radius; [m]."""

    points: list[list[arb]]
    radius: arb


@dataclass(frozen=True)
class FlatCylinder:
    """Solid cylinder with flat ends; [m]."""

    centre: arb_mat
    axis: arb_mat
    half_length: arb
    radius: arb


@dataclass(frozen=True)
class HalfSpace:
    """Points with normal.p <= offset; [m]."""

    normal: arb_mat
    offset: arb


@dataclass(frozen=True)
class SweptPolygon:
    """A prism: section, exact in the file's unit, and its ends in space; [m]."""

    section: list[tuple[Fraction, Fraction]]
    ends: tuple[list[list[arb]], list[list[arb]]]


@dataclass(frozen=True)
class Triangles:
    """A mesh file's triangles, (m, 3, 3), with x_base = linear x_file + shift."""

    corners: Any
    linear: arb_mat
    shift: arb_mat


Shape: TypeAlias = Hull | FlatCylinder | HalfSpace | SweptPolygon | Triangles


@dataclass(frozen=True)
class Row:
    """One row of a trajectory; `joints` are x0, alpha1, theta1, ..; [m], [rad]."""

    on_path: bool
    path_m: arb
    joints: list[arb]


def _unique(pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    require(len(dict(pairs)) == len(pairs), "a key is doubled")
    return dict(pairs)


def _read_yaml(text: str) -> Any:
    """One document as dicts, lists and text: no tag, no alias, no doubled key."""
    stack: list[list[Any]] = [[]]
    for event in yaml.parse(text, Loader=getattr(yaml, "CBaseLoader", yaml.BaseLoader)):
        plain = not isinstance(event, yaml.AliasEvent)
        require(plain and getattr(event, "tag", None) is None, "not plain data")
        if isinstance(event, yaml.CollectionStartEvent):
            stack.append([])
        elif isinstance(event, yaml.ScalarEvent):
            stack[-1].append(event.value)
        elif isinstance(event, yaml.CollectionEndEvent):
            value: Any = stack.pop()
            if isinstance(event, yaml.MappingEndEvent):
                value = _unique(list(zip(value[::2], value[1::2], strict=True)))
            stack[-1].append(value)
    require(len(stack[0]) == 1, "not one document")
    return stack[0][0]


def _read_mesh(content: bytes, is_obj: bool) -> Any:
    """Triangles of an OBJ or STL file in file order, shape (m, 3, 3)."""
    size = 84 + 50 * int.from_bytes(content[80:84], "little")
    if not is_obj and len(content) == size:
        kind = np.dtype([("normal", "<3f4"), ("corners", "<(3,3)f4"), ("rest", "<u2")])
        return np.frombuffer(content[84:], kind)["corners"].astype(float)
    corners: list[list[float]] = []
    faces: list[list[int]] = []
    for line in content.decode().splitlines():
        word, *rest = line.split("#")[0].split() or [""]
        if word.lower() == ("v" if is_obj else "vertex"):
            corners.append([float(text) for text in rest[:3]])
        elif is_obj and word == "f":
            face = [int(text.split("/")[0]) for text in rest]
            face = [k - 1 if k > 0 else len(corners) + k for k in face]
            require(min(face) >= 0, f"face {rest} names no corner above it")
            faces += [[face[0], *side] for side in pairwise(face[1:])]
    order = faces if is_obj else range(len(corners))
    return np.array(corners)[np.array(order, dtype=int).reshape(-1, 3)]


def _real(text: str) -> arb:
    good = isinstance(text, str) and NUMBER.fullmatch(text) and isfinite(float(text))
    require(good, f"{text!r} is not a finite number")
    return arb(float(text))


def _reals(texts: Any, count: int) -> list[arb]:
    good = isinstance(texts, list | tuple) and len(texts) == count
    require(good, f"{texts!r} is not a list of {count} numbers")
    return [_real(text) for text in texts]


def turn(axis: int, angle: arb) -> arb_mat:
    """Rotation about x, y or z (0, 1, 2)."""
    matrix, i, j = arb_mat(3, 3, 1), (axis + 1) % 3, (axis + 2) % 3
    sine, cosine = angle.sin_cos()
    matrix[i, i], matrix[i, j], matrix[j, i], matrix[j, j] = cosine, -sine, sine, cosine
    return matrix


def _rotation(rpy_deg: Any) -> arb_mat:
    x, y, z = (angle * arb.pi() / 180 for angle in _reals(rpy_deg, 3))
    return turn(2, z) * turn(1, y) * turn(0, x)


def _without_repeats(points: list[Any], *, cyclic: bool) -> list[Any]:
    """Corners without those equal to the one before; of a closed line, the last too."""
    before = [None, *points[:-1]]
    kept = [a for a, b in zip(points, before, strict=True) if a != b]
    return kept[:-1] if cyclic and len(kept) > 1 and kept[-1] == kept[0] else kept


FREE = ("tip_tolerance", "max_change_per_row_deg", "start", "goal")
"""Keys of a problem that need no working out."""


def _use_up(data: dict[str, Any], kind: str, *ignored: str) -> None:
    unknown = sorted(set(data) - set(ignored))
    require(not unknown, f"{kind} has unknown keys {unknown}")


class Problem:
    """What a certificate is about; raises the errors of `DAMAGE` for other files.

    Args:
        path: The problem file; meshes are found from its folder.
    """

    def __init__(self, path: Path) -> None:
        content = path.read_bytes()
        self._folder, self._hash = path.parent, hashlib.sha256(content)
        data, millimetre = _read_yaml(content.decode()), arb(1) / 1000
        self._unit = {"mm": millimetre, "m": arb(1)}[data.pop("length_unit")]
        base = data.pop("base", {})
        self._turn = _rotation(base.pop("rpy_deg", ZERO))
        self._origin = self._lengths(base.pop("position", ZERO))
        _use_up(base, "base")
        if (arm := data.pop("manipulator")) == "hrm8":
            self._read_arm(dict(HRM8), millimetre)
        else:
            self._read_arm(arm, self._unit)
        self.shapes: dict[str, Shape] = {}
        for obstacle in data.pop("obstacles", []):
            name = obstacle.pop("name")
            require(name not in self.shapes, f"two obstacles are named {name!r}")
            self.shapes[name] = self._shape(obstacle.pop("shape"), obstacle)
            _use_up(obstacle, f"obstacle {name!r}", "check_size")
        if "tip_path" in data:
            self._read_path(data.pop("tip_path"))
        self.clearance = self._length(data.pop("required_clearance"))
        self.self_clearance = self._length(data.pop("required_self_clearance", "0"))
        _use_up(data, "the problem", "vdsm_problem", "name", *FREE)
        self.sha256 = self._hash.hexdigest()

    def _length(self, text: Any) -> arb:
        return _real(text) * self._unit

    def _size(self, text: Any) -> arb:
        require(_real(text) > 0, f"{text} is not above 0")
        return self._length(text)

    def _lengths(self, texts: Any) -> arb_mat:
        return column(*_reals(texts, 3)) * self._unit

    def _inward(self, vector: arb_mat) -> arb_mat:
        """A direction of the file in the base frame."""
        return self._turn.transpose() * vector

    def _point(self, texts: Any) -> arb_mat:
        return self._inward(self._lengths(texts) - self._origin)

    def _read_arm(self, arm: dict[str, Any], length_unit: arb) -> None:
        texts = arm.pop("link_lengths")
        self.lengths = [x * length_unit for x in _reals(texts, len(texts))]
        self.radius = _real(arm.pop("link_radius")) * length_unit
        degree = arb.pi() / 180
        self.cone = _real(arm.pop("max_link_angle_deg")) * degree
        self.box = _real(arm.pop("max_joint_angle_deg")) * degree
        acute = self.cone < arb.pi() / 2 and self.box < arb.pi() / 2
        require(acute and len(texts) > 1, "fewer than 2 links or limits of 90 deg")
        stroke = sum(self.lengths, arb(0)) * 2
        self.rail = [-stroke, stroke]
        if "base_range" in arm:
            self.rail = [x * length_unit for x in _reals(arm.pop("base_range"), 2)]
        _use_up(arm, "manipulator", "name", "cables")

    def _read_path(self, path: dict[str, Any]) -> None:
        self.closed = path.pop("closed", "false").lower() == "true"
        corners = [tuple(map(float, _reals(p, 3))) for p in path.pop("points")]
        corners = _without_repeats(corners, cyclic=self.closed)
        points = [column(*corner) * self._unit for corner in corners]
        self.path = [self._inward(point - self._origin) for point in points]
        self.coverage = _real(path.pop("required_coverage", "1"))
        free = ("start", "spacing", "approach", "retreat", "blocked", "order")
        _use_up(path, "tip_path", *free)

    def _shape(self, kind: str, data: dict[str, Any]) -> Shape:
        """One obstacle in the base frame; takes what it reads out of the data."""
        match kind:
            case "sphere":
                centre = self._point(data.pop("center"))
                return Hull([centre.entries()], self._size(data.pop("radius")))
            case "cylinder" | "capsule":
                return self._round(kind, data)
            case "box":
                centre = self._point(data.pop("center"))
                rotation = self._inward(_rotation(data.pop("rpy_deg", ZERO)))
                half = (self._lengths(data.pop("size")) / 2).entries()
                signs = product((-1, 1), repeat=3)
                corners = [[s * h for s, h in zip(c, half, strict=True)] for c in signs]
                points = [centre + rotation * column(*corner) for corner in corners]
                return Hull([point.entries() for point in points], arb(0))
            case "prism":
                return self._prism(data)
            case "half_space":
                point = self._point(data.pop("point"))
                normal = self._inward(unit(column(*_reals(data.pop("normal"), 3))))
                return HalfSpace(normal, dot(normal, point))
            case "mesh":
                return self._mesh(data)
        message = f"unknown shape {kind!r}"
        raise ValueError(message)

    def _round(self, kind: str, data: dict[str, Any]) -> Shape:
        axis = data.pop("axis")
        if isinstance(axis, str):
            axis = {"x": ["1", "0", "0"], "y": ["0", "1", "0"], "z": ["0", "0", "1"]}[
                axis
            ]
        direction = self._inward(unit(column(*_reals(axis, 3))))
        centre = self._point(data.pop("center"))
        half, radius = (
            self._size(data.pop("length")) / 2,
            self._size(data.pop("radius")),
        )
        if kind == "cylinder":
            return FlatCylinder(centre, direction, half, radius)
        ends = (centre - direction * half, centre + direction * half)
        return Hull([end.entries() for end in ends], radius)

    def _prism(self, data: dict[str, Any]) -> SweptPolygon:
        sweep = "xyz".index(data.pop("axis"))
        corners = [_reals(pair, 2) for pair in data.pop("polygon")]
        exact = [(Fraction(float(u)), Fraction(float(v))) for u, v in corners]
        exact = _without_repeats(exact, cyclic=True)
        require(len(exact) > 2, "a polygon has fewer than 3 corners")
        ends = []
        for text in (data.pop("from"), data.pop("to")):
            places = [[_real(text), arb(float(u)), arb(float(v))] for u, v in exact]
            # (sweep, u, v) turned round until the sweep stands at its own axis.
            turned = [xyz[3 - sweep :] + xyz[: 3 - sweep] for xyz in places]
            points = [column(*xyz) * self._unit - self._origin for xyz in turned]
            ends.append([self._inward(point).entries() for point in points])
        return SweptPolygon(exact, (ends[0], ends[1]))

    def _mesh(self, data: dict[str, Any]) -> Triangles:
        path = self._folder / data.pop("file")
        content = path.read_bytes()
        self._hash.update(content)
        corners = _read_mesh(content, is_obj=path.suffix.lower() == ".obj")
        good = corners.size and np.isfinite(corners).all()
        require(good, f"{path.name} has no triangles or a number that is not finite")
        units = {"mm": arb(1) / 1000, "m": arb(1), None: self._unit}
        scale = _real(data.pop("scale", "1")) * units[data.pop("length_unit", None)]
        rotation = self._inward(_rotation(data.pop("rpy_deg", ZERO)))
        return Triangles(
            corners, rotation * scale, self._point(data.pop("center", ZERO))
        )


def read_rows(path: Path, n_links: int) -> Iterator[Row]:
    """The rows of a trajectory, one by one.

    Raises:
        ValueError: If it is not a trajectory of that many links.
    """
    angles = [f"{x}{i + 1}_rad" for i in range(n_links) for x in ("alpha", "theta")]
    names = ["waypoint", "on_path", "path_m", "x0_m", *angles]
    with path.open("rb") as lines:
        first = lines.readline().decode().rstrip("\r\n").split(",")
        require(first == names, f"line 1: columns are not {','.join(names)}")
        for number, line in enumerate(lines, 2):
            cells = line.decode().rstrip("\r\n").split(",")
            good = len(cells) == len(names) and cells[1] in ("0", "1")
            require(good, f"line {number}: not {len(names)} values with on_path 0 or 1")
            values = [_real(cell) for cell in cells[2:]]
            yield Row(cells[1] == "1", values[0], values[1:])
