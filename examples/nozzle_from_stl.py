"""Inspect the inside of a nozzle that comes as STL: circles along its wall."""

from pathlib import Path

import numpy as np

import vdsm_pin as vp

# A nozzle as a CAD program would write it: a wall of revolution, in mm.
x = np.array([900.0, 1050.0, 1200.0, 1350.0, 1500.0])
inner = np.array([260.0, 200.0, 170.0, 210.0, 280.0])
profile = np.vstack([np.c_[x, inner], np.c_[x[::-1], inner[::-1] + 15.0]])
turns = np.linspace(0.0, 2.0 * np.pi, 49)[:-1]
rings = [
    np.c_[np.full(48, a), r * np.cos(turns), r * np.sin(turns)] for a, r in profile
]
lines = ["solid nozzle"]
for ring, after in zip(rings, [*rings[1:], rings[0]], strict=True):
    for i in range(48):
        a, b, c, d = ring[i], ring[i - 1], after[i - 1], after[i]
        for corners in ((a, c, b), (a, d, c)):
            vertices = [f"vertex {p[0]} {p[1]} {p[2]}" for p in corners]
            lines += [
                "facet normal 0 0 0",
                "outer loop",
                *vertices,
                "endloop",
                "endfacet",
            ]
Path("nozzle.stl").write_text("\n".join([*lines, "endsolid nozzle", ""]))

Path("nozzle.yaml").write_text("""\
vdsm_problem: 1
name: nozzle
length_unit: mm
manipulator:
  link_lengths: [150, 150, 150, 150, 150, 150, 150, 150]
  link_radius: 25
  max_link_angle_deg: 45
  max_joint_angle_deg: 45
  base_range: [-1500, 600]
obstacles:
  - {name: nozzle, shape: mesh, file: nozzle.stl, length_unit: mm, solid: true}
tip_path:
  start: [700, 0, 0]
  points:                        # 60 mm off the wall at the throat, once round
    - [1200, 0, 110]
    - {circle: {center: [1200, 0, 0], normal: [1, 0, 0]}}
required_clearance: 3
""")
problem = vp.read_problem("nozzle.yaml")
plan = vp.plan(problem, time_limit=300.0)
result = vp.verify(problem, plan.trajectory)
print(result)
assert result.verdict is vp.Verdict.CERTIFIED
vp.write_report(result, "nozzle_from_stl.html")
