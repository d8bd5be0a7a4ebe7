"""Plan inside a scan: 2,000 measured points of a pipe with a valve in it."""

from pathlib import Path

import numpy as np

import vdsm_pin as vp

rng = np.random.default_rng(1)
turn, along = rng.uniform(0.0, 2.0 * np.pi, 1_600), rng.uniform(1200.0, 4200.0, 1_600)
ring = np.column_stack([np.cos(turn), np.sin(turn)])
wall = np.column_stack([along, 260.0 * ring])
wall = wall[wall[:, 2] < 220.0]  # the scanner did not see the top
up = rng.uniform(-250.0, 60.0, 400)
valve = np.column_stack([2700.0 + 45.0 * ring[:400, 0], 45.0 * ring[:400, 1], up])
points = np.vstack([wall, valve]) + rng.normal(0.0, 1.0, (len(wall) + len(valve), 3))
np.savetxt("scan.xyz", points, fmt="%.2f")

Path("scan.yaml").write_text(
    """\
vdsm_problem: 1
name: scan
length_unit: mm
manipulator: hrm8
obstacles:  # each point is a ball of the scan's error
  - {name: scan, shape: points, file: scan.xyz, length_unit: mm, radius: 4}
tip_path:
  start: [1000, 0, 0]
  points: [[3300, 0, -120], [3300, 120, -60], [3300, 0, 120]]
required_clearance: 10
"""
)
problem = vp.read_problem("scan.yaml")
plan = vp.plan(problem)
print(plan)
result = vp.verify(problem, plan.trajectory)
print(result)
vp.write_report(result, "laser_scan.html")
