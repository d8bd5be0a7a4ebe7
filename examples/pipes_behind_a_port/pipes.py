"""Through a port in a wall and between pipes: the README's moving picture."""

from pathlib import Path

import vdsm_pin as vp

problem = vp.read_problem(Path(__file__).parent / "pipes.yaml")
plan = vp.plan(problem)
print(plan)
result = vp.verify(problem, plan.trajectory, joint_error=True)
print(result)
for near in result.closest(3):
    print(f"{1e3 * near.lower:6.1f} mm  {near.pair}")
vp.write_report(result, "pipes.html")
