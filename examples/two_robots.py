"""A UR5 and a Panda sweep one space: one after the other they may, at once not."""

from pathlib import Path

import numpy as np
import pinocchio as pin

import vdsm_pin as vp

SHARE = Path(pin.__file__).parents[4] / "share"  # of example-robot-data
OUT = Path("two_robots_out")
CELL = """
vdsm_problem: 1
length_unit: mm
robot:
  urdf: {share}/example-robot-data/robots/ur_description/urdf/ur5_robot.urdf
  srdf: {share}/example-robot-data/robots/ur_description/srdf/ur5.srdf
  package_dirs: [{share}]
required_clearance: 20
others:
  - name: panda
    robot:
      urdf: {share}/example-robot-data/robots/panda_description/urdf/panda.urdf
      srdf: {share}/example-robot-data/robots/panda_description/srdf/panda.srdf
      package_dirs: [{share}]
      lock: {{panda_finger_joint1: 0}}
    base: {{position: [1000, 0, 0], rpy_deg: [0, 0, 180]}}
    trajectory: {trajectory}
"""
UR5 = {
    "shoulder_pan_joint": 0.0,
    "shoulder_lift_joint": -1.0,
    "elbow_joint": 1.4,
    "wrist_1_joint": -0.4,
    "wrist_2_joint": 0.0,
    "wrist_3_joint": 0.0,
}
AT = [0.0, 0.4, 0.0, -1.8, 0.0, 2.2, 0.8]
PANDA = {f"panda_joint{k}": value for k, value in enumerate(AT, start=1)}


def swept(name: str, joints: dict[str, float], start: float) -> Path:
    """A file of 2 s in which the first joint turns from one side to the other."""
    rows = np.tile([0.0, *joints.values()], (9, 1))
    rows[:, 0] = start + np.linspace(0.0, 2.0, 9)
    rows[:, 1] = np.linspace(-1.3, 1.3, 9)
    head = ",".join(["time_s", *(f"{joint}_rad" for joint in joints)])
    np.savetxt(OUT / name, rows, delimiter=",", header=head, comments="")
    return (OUT / name).resolve()


OUT.mkdir(exist_ok=True)
swept("ur5.csv", UR5, start=0.0)
for words, start in (("the Panda 1.5 s before", -1.5), ("at once", 0.0)):
    file, panda = OUT / "cell.yaml", swept("panda.csv", PANDA, start)
    file.write_text(CELL.format(share=SHARE, trajectory=panda))
    cell = vp.read_cell(file)
    result = vp.verify(cell, vp.read_trajectory(OUT / "ur5.csv", cell))
    print(f"{words}: {result}")
    vp.write_report(result, "two_robots.html")
