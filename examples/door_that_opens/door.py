"""Through a door that opens: in time it is proved, too early it is refuted."""

from dataclasses import replace
from pathlib import Path

import vdsm_pin as vp

problem = vp.read_problem(Path(__file__).parent / "cell.yaml")

# The plan waits at its start until nothing moves any more; from then on it is clear.
plan = vp.plan(problem)
motion = plan.trajectory
print(plan)
result = vp.verify(problem, motion)
print(result)
assert result.verdict is vp.Verdict.CERTIFIED
vp.write_report(result, "door.html")

# The same motion without its wait is at the door before the door is open.
going = motion.part(1, motion.n_samples)


def after(wait: float) -> vp.Verdict:
    """The motion that sets out so long after the door begins to open, judged."""
    timed = replace(going, times=going.times - going.times[0] + motion.times[0] + wait)
    found = vp.verify(problem, timed)
    if found.verdict is vp.Verdict.REFUTED:
        near = found.closest(1)[0]
        print(f"{wait:.2f} s: {near.pair} at {timed.times_at([near.moment])[0]:.2f} s")
    return found.verdict


# How late must it be at least? Bisection over the wait, each time proved or refuted.
planned = float(motion.times[1] - motion.times[0])
low, high = 0.0, planned
assert after(low) is vp.Verdict.REFUTED
while high - low > 0.01:
    wait = 0.5 * (low + high)
    low, high = (low, wait) if after(wait) is vp.Verdict.CERTIFIED else (wait, high)
print(f"proved from a wait of {high:.2f} s on; the plan waits {planned:g} s")
