"""A camera on the last link looks at a flange while the tip goes round it."""

from pathlib import Path

import vdsm_pin as vp

problem = vp.read_problem(Path(__file__).parent / "flange.yaml")
plan = vp.plan(problem)
print(plan)
result = vp.verify(problem, plan.trajectory)
print(result)
for check in result.checks:
    if "axis" in check.name or "look" in check.name:
        print(f"{check.name}: {check.verdict.value}")
assert result.verdict is vp.Verdict.CERTIFIED
vp.write_report(result, "camera.html")
