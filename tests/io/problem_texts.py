"""Problem files for the tests: one that uses everything, and how to change it."""

from pathlib import Path
from typing import Any

import numpy as np
import yaml

TETRAHEDRON = np.array(
    [
        [[0, 0, 0], [0, 1, 0], [1, 0, 0]],
        [[0, 0, 0], [1, 0, 0], [0, 0, 1]],
        [[0, 0, 0], [0, 0, 1], [0, 1, 0]],
        [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    ],
    dtype=float,
)
"""Corners of a closed solid, shape (4, 3, 3)."""

EVERYTHING = """\
vdsm_problem: 1
name: everything
length_unit: mm
manipulator:
  name: five
  link_lengths: [400, 400, 300, 300, 200]
  link_radius: 50
  max_link_angle_deg: 40
  max_joint_angle_deg: 35.5
  base_range: [-2000, 3000]
  cables: {hole_radius: 40, half_gap: 20}
base: {position: [100, -50, 25], rpy_deg: [10, -20, 30]}
obstacles:
  - {name: pillar, shape: cylinder, axis: x, center: [1563, 700, 600],
     radius: 200, length: 900}
  - {name: bar, shape: prism, axis: y, polygon: [[0, 900], [100, 900], [100, 1e3]],
     from: -1000, to: 500}
  - {name: ball, shape: sphere, center: [900, 900, 900], radius: 1.5e1}
  - {name: rod, shape: capsule, axis: [0, 1, 1], center: [0, 0, 900],
     radius: 10, length: 50}
  - {name: crate, shape: box, center: [0, 0, -900], size: [10, 20, 30],
     rpy_deg: [0, 0, 45]}
  - {name: wall, shape: half_space, point: [0, 0, -2000], normal: [0, 0, 2]}
  - {name: part, shape: mesh, file: part.stl, scale: 500, center: [0, 900, 0],
     rpy_deg: [0, 90, 0]}
tip_path:
  start:
    joints:
      x0: 12.5
      alpha_deg: [0, 5, -5, 1, 2]
      theta_deg: [1, 2, 3, 4, 5]
  points:
    - [1500, 0, 0]
    - [1500, 100, 0]
    - [1500, 100, 100]
  closed: true
  spacing: 5
  approach: equidistant
  retreat: 100
  blocked: fail
  required_coverage: 0.75
  order: free
required_clearance: 3.5
required_self_clearance: 2
tip_tolerance: 0.01
max_change_per_row_deg: 3
"""


def binary_stl(corners: np.ndarray) -> bytes:
    """Triangles, shape (m, 3, 3), as a binary STL file."""
    records = np.zeros(
        len(corners), dtype=[("n", "<f4", 3), ("c", "<f4", (3, 3)), ("a", "<u2")]
    )
    records["c"] = corners
    return b"\0" * 80 + len(corners).to_bytes(4, "little") + records.tobytes()


def write_everything(folder: Path) -> Path:
    """The file and its mesh; returns the file."""
    (folder / "part.stl").write_bytes(binary_stl(TETRAHEDRON))
    path = folder / "everything.yaml"
    path.write_text(EVERYTHING, encoding="utf-8")
    return path


def edited(text: str, location: tuple[Any, ...], value: Any = ...) -> str:
    """The text with one value replaced, or removed where none is given."""
    data = yaml.load(text, Loader=yaml.CSafeLoader)
    holder = data
    for step in location[:-1]:
        holder = holder[step]
    if value is ...:
        del holder[location[-1]]
    else:
        holder[location[-1]] = value
    return str(yaml.dump(data, Dumper=yaml.CSafeDumper, sort_keys=False))
