"""Small problem files for tests that run whole commands."""

from pathlib import Path

NEAR = """\
vdsm_problem: 1
name: near
length_unit: mm
manipulator: hrm8
obstacles:
  - {name: ball, shape: sphere, center: [2000, 900, 0], radius: 200}
tip_path:
  start: [3126, 0, 0]
  points: [[3126, 0, -200], [3126, 100, -200], [3126, 100, -100]]
  closed: true
  spacing: 40
  retreat: 100
required_clearance: 3.5
"""
"""A short square path and a ball beside it; planned within a blink."""

OUT_OF_REACH = NEAR.replace("[3126, 100, -200]", "[3126, 9000, -200]")
"""The same with a corner no arm of this length reaches."""

BEHIND_A_WALL = """\
vdsm_problem: 1
name: wall
length_unit: mm
manipulator: hrm8
obstacles:
  - {name: wall, shape: half_space, point: [0, 400, 0], normal: [0, -1, 0]}
tip_path:
  start: [3126, 0, 0]
  points: [[3126, 0, 0], [3126, 2500, 0]]
  spacing: 40
required_clearance: 3.5
"""
"""A straight path of which 400 - 61.5 - 3.5 mm lie before a wall, 13.4 %."""


def write_problem(path: Path, text: str) -> Path:
    """Write a problem file and give its path."""
    path.write_text(text, encoding="utf-8")
    return path
