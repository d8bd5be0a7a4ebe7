"""The paper's first obstacle, step by step: read, plan, look, prove, write."""

import numpy as np

import vdsm_pin as vp

problem = vp.read_problem("paper/obs1")
print(problem)

plan = vp.plan(problem, strategy="fewest")
print(plan)

# The plan is a table of joint values: the rail and two angles a joint.
motion = plan.trajectory
bends = np.degrees(np.hypot(motion.alpha, motion.theta)).max(axis=0)
print("largest bend of each joint [deg]:", np.round(bends, 2))
print("base travel [mm]:", np.round(1000.0 * np.ptp(motion.x0), 1))

# Each link hangs on three cables; their lengths follow from the angles (Eq. 16-21).
print(
    "cables of link 1, first row [mm]:", np.round(1000.0 * plan.cable_lengths[0, 0], 3)
)

# The verifier shares no code with the planner's search.
result = vp.verify(problem, motion, joint_error=True)
print(result)
print(f"every joint may be off by {np.degrees(result.joint_error):.3f} deg at once")
for one in result.closest(3):
    print(f"  {one.pair}: {1000.0 * one.lower:.3f} mm in interval {one.interval}")

vp.write_trajectory(motion, "paper_obs1.csv")
vp.write_certificate(result, "paper_obs1.certificate", "paper_obs1.csv")
vp.write_report(result, "paper_obs1.html")
