"""An arm, a scene and a path made in Python: an endoscope of 300 mm in a tube."""

import numpy as np

import vdsm_pin as vp

lengths = np.full(10, 0.03)
arm = vp.Manipulator(
    name="endoscope",
    link_lengths=lengths,
    link_radius=0.003,
    max_link_angle=np.radians(40.0),
    max_joint_angle=np.radians(40.0),
    base_range=(-0.3, 0.3),
    cables=vp.CableLayout(
        0.0024, 0.003, np.radians(12.0 * np.arange(30).reshape(10, 3))
    ),
)
x, z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
scene = vp.Scene(
    (
        vp.Cylinder("vein", np.array([0.25, 0.04, 0.0]), z, 0.1, 0.015),
        vp.Sphere("stone", np.array([0.27, -0.03, 0.03]), 0.01),
        vp.HalfSpace("bone", np.array([0.0, 0.0, -0.06]), z),
    )
)
tip = arm.total_length * x
corners = tip + np.array([[0, 0, 0.03], [0, -0.06, 0.0], [0, 0, -0.03], [0, 0.03, 0]])
path = vp.DesiredPath(tip, corners, closed=True, spacing=0.001)
problem = vp.Problem(arm, scene, path, 0.0005, name="endoscope")
problem = vp.write_problem(problem, "endoscope.yaml")  # certificates need a file

plan = vp.plan(problem)
result = vp.verify(problem, plan.trajectory)
print(plan)
print(result)
assert result.verdict is vp.Verdict.CERTIFIED
vp.write_report(result, "arm_in_python.html")
vp.write_certificate(result, "endoscope.certificate")
