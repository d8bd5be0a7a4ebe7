"""Judge another planner: damped least squares that knows nothing of obstacles."""

import numpy as np

import vdsm_pin as vp
from vdsm_pin.arm.kinematics import joint_centres

problem = vp.read_problem("paper/obs1")
arm, path = problem.manipulator, problem.tip_path


def tip(q: np.ndarray) -> np.ndarray:
    """Tip of q = (x0, alpha, theta), in the base frame; [m]."""
    n = arm.n_links
    return joint_centres(arm, q[:1], q[None, 1 : n + 1], q[None, n + 1 :])[0, -1]


def follow(target: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Least-squares steps until the tip is there."""
    for _ in range(60):
        miss = target - tip(q)
        if np.linalg.norm(miss) < 1e-7:
            break
        eye = 1e-6 * np.eye(q.size)
        J = np.array([(tip(q + d) - tip(q - d)) / 2e-6 for d in eye]).T
        q = q + J.T @ np.linalg.solve(J @ J.T + 1e-6 * np.eye(3), miss)
    return q


q, rows, stations = np.zeros(1 + 2 * arm.n_links), [], []
for a, b, s in zip(path.corners, path.corners[1:], path.corner_stations, strict=False):
    for t in np.arange(0.0, 1.0, 0.02):
        q = follow(a + t * (b - a), q)
        rows.append(q)
        stations.append(s + t * np.linalg.norm(b - a))
table, n = np.array(rows), arm.n_links
motion = vp.Trajectory(
    np.zeros(len(table), dtype=bool),
    np.zeros(len(table)),
    table[:, 0],
    table[:, 1 : n + 1],
    table[:, n + 1 :],
)
free = vp.Problem(arm, problem.scene, None, problem.required_clearance, name="dls")
theirs, ours = vp.verify(free, motion), vp.verify(problem, vp.plan(problem).trajectory)
print(
    f"damped least squares: {theirs.verdict.value}, {1e3 * theirs.min_clearance:.1f} mm"
)
print(f"fewest:               {ours.verdict.value}, {1e3 * ours.min_clearance:.1f} mm")
vp.write_report(theirs, "foreign_trajectory.html")
