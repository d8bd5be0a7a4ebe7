"""OMPL samples a UR5's and a Panda's meshes; the proof judges hulls of their parts."""

from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
from ompl import base, geometric, util

import vdsm_pin as vp

SHARE = Path(pin.__file__).parents[4] / "share"
UR5 = ("ur", "ur5_robot", "ur5", [-1.2, -1.0, 1.4, -0.4, 0, 0])
PANDA = ("panda", "panda", "panda", [-0.9, 0.4, 0, -1.8, 0, 2.2, 0.8])
POST = vp.Box("post", np.array([0.5, 0, 0.4]), np.eye(3), np.array([0.015, 0.015, 0.4]))
util.setLogLevel(util.LogLevel.LOG_NONE)
util.RNG.setSeed(1)


def planned(model: pin.Model, urdf: str, srdf: str, start: list[float]) -> np.ndarray:
    """Waypoints of RRTConnect at its default resolution, to the mirrored start."""
    solids = pin.buildGeomFromUrdf(model, urdf, pin.COLLISION, package_dirs=str(SHARE))
    there = pin.SE3(np.eye(3), np.array([0.5, 0.0, 0.4])), coal.Box(0.03, 0.03, 0.8)
    solids.addGeometryObject(pin.GeometryObject("post", 0, 0, *there))
    solids.addAllCollisionPairs()
    pin.removeCollisionPairs(model, solids, srdf)
    data, seen, n = model.createData(), pin.GeometryData(solids), len(start)

    def clear(state: base.State) -> bool:
        q = np.array([*(state[k] for k in range(n)), *[0.0] * (model.nq - n)])
        return not pin.computeCollisions(model, data, solids, seen, q, True)

    space, bounds = base.RealVectorStateSpace(n), base.RealVectorBounds(n)
    begin, end = space.allocState(), space.allocState()
    for k in range(n):
        bounds.setLow(k, float(model.lowerPositionLimit[k]))
        bounds.setHigh(k, float(model.upperPositionLimit[k]))
        begin[k], end[k] = float(start[k]), float(start[k] if k else -start[0])
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(clear)
    setup.setStartAndGoalStates(begin, end)
    assert setup.solve(20.0)
    setup.simplifySolution()
    states = setup.getSolutionPath().getStates()
    return np.array([[state[k] for k in range(n)] for state in states])


for family, urdf, name, start in (UR5, PANDA):
    folder = SHARE / "example-robot-data" / "robots" / f"{family}_description"
    files = f"{folder}/urdf/{urdf}.urdf", f"{folder}/srdf/{name}.srdf"
    model = pin.buildModelFromUrdf(files[0])
    rows = planned(model, *files, start)
    lock = {"panda_finger_joint1": 0.0} if name == "panda" else {}
    robot = vp.RobotFiles(*files, (SHARE,), lock, solids=vp.MeshCover("parts"))
    cell = vp.cell_of(robot, vp.Scene((POST,)))
    joints = tuple(model.names)[1 : len(start) + 1]
    result = vp.verify(cell, vp.JointTrajectory(joints, rows))
    print(result)
    vp.write_report(result, f"{name}.html")
