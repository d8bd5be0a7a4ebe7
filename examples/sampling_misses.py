"""A motion that a check every half degree passes, and that goes through a wire."""

import numpy as np

import vdsm_pin as vp

# One joint sweeps a thin rod past a wire of 0.2 mm across.
arm = vp.Manipulator(
    "rod",
    np.array([0.5, 0.5, 0.5]),
    0.002,
    np.radians(60.0),
    np.radians(60.0),
    (0.0, 0.0),
    vp.CableLayout(0.0016, 0.02, np.radians(np.arange(9.0).reshape(3, 3) * 40.0)),
)
wire = vp.Capsule("wire", np.array([1.2, 0.0, -0.419]), np.eye(3)[1], 0.1, 1e-4)
problem = vp.Problem(arm, vp.Scene((wire,)), None, 0.0, name="wire")


def sweep(rows: int) -> vp.Trajectory:
    """The first joint pitches by 40 degrees."""
    theta = np.zeros((rows, 3))
    theta[:, 0] = np.radians(np.linspace(0.0, 40.0, rows))
    off = np.zeros(rows, dtype=bool)
    return vp.Trajectory(off, np.zeros(rows), np.zeros(rows), 0.0 * theta, theta)


def clear_at_samples(motion: vp.Trajectory) -> bool:
    """What a planner asks: is each configuration clear, by itself?"""
    for k in range(len(motion.x0)):
        pitch = motion.theta[k, 0]
        along = np.array([np.cos(pitch), 0.0, -np.sin(pitch)])
        station = np.clip(wire.centre @ along, 0.0, 1.5)  # nearest on the rod's axis
        apart = np.linalg.norm(wire.centre - station * along)
        if apart < arm.link_radius + wire.radius:
            return False
    return True


for step_deg in (5.0, 2.0, 1.0, 0.5, 0.1):
    motion = sweep(round(40.0 / step_deg) + 1)
    verdict = "clear" if clear_at_samples(motion) else "collides"
    print(f"sampled every {step_deg:3} deg: {verdict}")
result = vp.verify(problem, sweep(2))
print("proved over all of it, two rows:", result.verdict.value)
assert result.verdict is vp.Verdict.REFUTED
vp.write_report(result, "sampling_misses.html")
