"""Run a plan on simulated cables and motors, then prove what was really executed."""

import json
import subprocess
import sys
from pathlib import Path

import vdsm_pin as vp

VDSM = [sys.executable, "-m", "vdsm_pin"]

problem = vp.read_problem("paper/obs3")
plan = vp.plan(problem)
vp.write_trajectory(plan.trajectory, "obs3.csv")

# A kick of 10 Nm at joint 5, in the middle of the motion; all else as documented.
Path("loop.yaml").write_text("""\
kicks:
  - {axis: alpha, joint: 5, share: 0.5, torque_nm: 10}
""")
for name, more in (("quiet", []), ("kicked", ["--settings", "loop.yaml"])):
    asked = ["paper/obs3", "--trajectory", "obs3.csv", "--out", name, *more]
    subprocess.run([*VDSM, "simulate", *asked], check=False, stdout=subprocess.DEVNULL)
    found = json.loads(Path(name, "simulation.json").read_text())
    print(name, "executed:", found["executed"]["verdict"])

executed = vp.read_trajectory("quiet/executed.csv", problem)
result = vp.verify(problem, executed)
print(f"proved clearance of what was executed: {1000.0 * result.min_clearance:.2f} mm")
assert result.min_clearance > problem.required_clearance
vp.write_report(result, "closed_loop_cables.html")
