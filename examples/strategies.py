"""One problem, four strategies: bends, clearance and joint error side by side."""

import time

import numpy as np

import vdsm_pin as vp

problem = vp.read_problem("paper/obs3")
print("strategy    time [s]  changed angles, mean  clearance [mm]  joint error [deg]")
for strategy in ("fewest", "clearest", "sturdiest", "paper"):
    begin = time.process_time()
    motion = vp.plan(problem, strategy=strategy).trajectory
    spent = time.process_time() - begin
    result = vp.verify(problem, motion, joint_error=True)
    bent = np.hypot(motion.alpha, motion.theta) > np.radians(0.05)
    mean = bent[motion.on_path].sum(axis=1).mean()
    clear, error = 1000.0 * result.min_clearance, np.degrees(result.joint_error)
    print(f"{strategy:10} {spent:9.2f} {mean:21.2f} {clear:15.2f} {error:18.3f}")
    assert result.verdict is vp.Verdict.CERTIFIED
    vp.write_report(result, f"strategies_{strategy}.html")
