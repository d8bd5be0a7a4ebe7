"""In through a port, to a seam behind the wall, with a certificate."""

from pathlib import Path

import numpy as np

import vdsm_pin as vp
from vdsm_pin.app.new_project import new_project

if not Path("vessel").exists():
    new_project(Path("vessel"), "port")  # as `vdsm new vessel --from port`
problem = vp.read_problem("vessel/problem.yaml")

plan = vp.plan(problem, time_limit=300.0)
motion = plan.trajectory
bent = (np.hypot(motion.alpha, motion.theta) > np.radians(0.05)).sum(axis=1)
print(plan)
print("changed link angles on the seam: at most", bent[motion.on_path].max())

# The vessel may stand 1 mm off in any direction.
result = vp.verify(problem, motion, errors=vp.ErrorBox(obstacle_mm=1.0))
print(result)
assert result.verdict is vp.Verdict.CERTIFIED
vp.write_trajectory(motion, "vessel.csv")
vp.write_certificate(result, "vessel.certificate", "vessel.csv")
vp.write_report(result, "port_and_vessel.html")
