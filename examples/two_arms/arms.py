"""Two arms in turn: proved as planned in time, refuted where one of them is late."""

from dataclasses import replace
from pathlib import Path

import numpy as np

import vdsm_pin as vp

HERE = Path(__file__).parent
problem = vp.read_problem(HERE / "cell.yaml")

# Waypoints with velocities: cubic pieces join them, and the curve is what is proved.
motion = vp.read_trajectory(HERE / "own.csv", problem)
result = vp.verify(problem, motion)
print(result)
assert result.verdict is vp.Verdict.CERTIFIED
vp.write_report(result, "arms.html")
for near in result.closest(3):
    time = motion.times_at([near.moment])[0]
    print(f"{near.pair}: {1e3 * near.upper:.1f} mm at {time:.2f} s")

# How late may this arm be?
for delay in np.arange(0.5, 4.0, 0.5):
    late = replace(motion, times=motion.times + delay)
    found = vp.verify(problem, late)
    print(f"{delay:.1f} s late: {found.verdict}")
    if found.verdict is not vp.Verdict.CERTIFIED:
        break
assert found.verdict is vp.Verdict.REFUTED
