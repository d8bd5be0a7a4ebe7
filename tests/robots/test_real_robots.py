"""Robots of the wheel example-robot-data. Oracles: Pinocchio's own reader, Coal."""

from functools import cache
from itertools import product
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from vdsm_pin.errors import InvalidFile, VdsmError
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.problem.scene import Scene
from vdsm_pin.robots.cell import Cell
from vdsm_pin.robots.files import RobotFiles
from vdsm_pin.robots.judgement import verify_robot
from vdsm_pin.robots.model import Robot
from vdsm_pin.robots.trajectory_files import read_motion
from vdsm_pin.robots.urdf import read_robot
from vdsm_pin.verification.records import CLEARANCES, Verdict, combine

SHARE = Path(pin.__file__).parents[4] / "share"
FOLDER = SHARE / "example-robot-data" / "robots"
ALL = sorted(str(file.relative_to(FOLDER)) for file in FOLDER.rglob("*.urdf"))

REFUSED = {
    "alex_psyonic_hands.urdf": "mimics",
    "alexander_v1.lowerBodyOnly.urdf": "no link has a collision",
    "TwoDofs.urdf": "no link has a collision",
    "human.urdf": "no link has a collision",
    "simple_humanoid_classical.urdf": "no link has a collision",
    "ur3.urdf": "xacro",
}
"""Those that are no robots to judge, and what is said of them."""

SOME = (
    "ur_description/urdf/ur5_robot.urdf",
    "panda_description/urdf/panda.urdf",
    "solo_description/robots/solo12.urdf",
    "talos_data/robots/talos_left_arm.urdf",
    "kinova_description/robots/kinova.urdf",
    "so_arm_description/urdf/so101.urdf",
    "double_pendulum_description/urdf/double_pendulum_continuous.urdf",
    "alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf",
)
"""Judged in a second each."""

ROWS = 40
SHOWN = 30
"""Instants at which Coal looks for collisions."""

pytestmark = pytest.mark.skipif(not ALL, reason="needs the wheel example-robot-data")


@cache
def robot_of(name: str) -> Robot:
    urdf = FOLDER / name
    beside = sorted(urdf.parents[1].glob(f"srdf/{urdf.stem}.srdf"))
    return read_robot(RobotFiles(urdf, beside[0] if beside else None, (SHARE,)))


def limits_of(robot: Robot) -> np.ndarray:
    """Least and largest values of the joints that move, within 2, (2, n_joints)."""
    low = [max(joint.lower, -2.0) for joint in robot.joints]
    high = [min(joint.upper, 2.0) for joint in robot.joints]
    return np.array([low, high])


def as_pinocchio(model: pin.Model, robot: Robot, row: np.ndarray) -> np.ndarray:
    """Of a model that was read from the same file, of values of our joints."""
    values = robot.tree.values(row[None])[0].tolist()
    full = {j.name: x for j, x in zip(robot.tree.joints, values, strict=True)}
    q = pin.neutral(model)
    for k in range(1, model.njoints):
        value, at = full[model.names[k]], model.idx_qs[k]
        q[at : at + model.nqs[k]] = (
            value if model.nqs[k] == 1 else (np.cos(value), np.sin(value))
        )
    return q


@pytest.mark.parametrize(
    "name",
    [
        *SOME,
        *(pytest.param(o, marks=pytest.mark.slow) for o in ALL if o not in SOME),
    ],
)
def test_a_real_robot_is_judged_as_its_libraries_see_it(name: str) -> None:
    refused = REFUSED.get(Path(name).name)
    if refused:
        with pytest.raises(VdsmError, match=refused):
            robot_of(name)
        return
    robot, rng = robot_of(name), np.random.default_rng(1)
    model = pin.buildModelFromUrdf(str(FOLDER / name))
    data = model.createData()
    low, high = limits_of(robot)
    for row in rng.uniform(low, high, (ROWS, len(low))):
        q = as_pinocchio(model, robot, row)
        pin.framesForwardKinematics(model, data, q)
        poses = robot.tree.poses(row[None])[0]
        # Where a SRDF has the root link move Pinocchio's stands: seen from there.
        base = np.linalg.inv(poses[robot.frames[model.frames[1].name]])
        for link, frame in robot.frames.items():
            expected = data.oMf[model.getFrameId(link, pin.BODY)].homogeneous
            found = base @ poses[frame]
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    first = 0.5 * (low + high) + 0.2 * rng.uniform(low - high, high - low)
    motion = np.stack([first, first + 0.03 * rng.uniform(low - high, high - low)])
    names = tuple(joint.name for joint in robot.joints)
    judged = verify_robot(Cell(robot, Scene()), JointTrajectory(names, motion))
    clear = combine(tuple(o.verdict for o in judged.checks if o.name in CLEARANCES))
    if clear is Verdict.CERTIFIED:
        assert not collides(name, robot, motion)


UNITS = {"rad": 1.0, "deg": np.pi / 180.0, "m": 1.0, "mm": 1e-3}
FULL = (  # revolute, continuous, prismatic and mimic joints, and limits beyond a turn
    "ur_description/urdf/ur5_robot.urdf",
    "panda_description/urdf/panda.urdf",
    "kinova_description/robots/kinova.urdf",
    "tiago_description/robots/tiago.urdf",
    "anymal_b_simple_description/robots/anymal.urdf",
)


@pytest.mark.parametrize("name", [one for one in FULL if one in ALL])
@pytest.mark.parametrize("share", [0.1, 1.0])
def test_units_that_were_mixed_up_are_told(
    tmp_path: Path, name: str, share: float
) -> None:
    """Motions within limits, in SI units and others, under either name."""
    robot, rng, file = robot_of(name), np.random.default_rng(3), tmp_path / "t.csv"
    low = np.array([max(joint.lower, -6.0) for joint in robot.joints])
    high = np.array([min(joint.upper, 6.0) for joint in robot.joints])
    middle = (low + high) / 2
    for _ in range(5):
        q = middle + share * (rng.uniform(low, high, (6, len(low))) - middle)
        for wanted, stated in product((0, 1), repeat=2):
            pairs = [(one.unit, one.other_unit) for one in robot.joints]
            heads = zip(robot.joints, pairs, strict=True)
            text = ",".join(f"{one.name}_{units[stated]}" for one, units in heads)
            for row in q / [UNITS[units[wanted]] for units in pairs]:
                text += "\n" + ",".join(map(repr, row.tolist()))
            file.write_text(text + "\n")
            if wanted == stated:
                found = read_motion(file, robot.joints, None, robot.values).q
                np.testing.assert_allclose(found, q, rtol=1e-14, atol=0)
                continue
            told = "is it in degrees" if wanted else "look like"
            with pytest.raises(InvalidFile, match=told):
                read_motion(file, robot.joints, None, robot.values)


def collides(name: str, robot: Robot, motion: np.ndarray) -> bool:
    """Whether two links that are held apart meet in a sample, by Coal."""
    urdf = str(FOLDER / name)
    model = pin.buildModelFromUrdf(urdf)
    solids = pin.buildGeomFromUrdf(model, urdf, pin.COLLISION, package_dirs=str(SHARE))
    of_link: dict[str, list[int]] = {}
    for number, solid in enumerate(solids.geometryObjects):
        link = model.frames[solid.parentFrame].name
        of_link.setdefault(link, []).append(number)
    for one, other in robot.held:
        for a in of_link[robot.bodies[one].name]:
            for b in of_link[robot.bodies[other].name]:
                solids.addCollisionPair(pin.CollisionPair(min(a, b), max(a, b)))
    data, seen = model.createData(), solids.createData()
    for share in np.linspace(0.0, 1.0, SHOWN):
        q = as_pinocchio(model, robot, (1.0 - share) * motion[0] + share * motion[1])
        if pin.computeCollisions(model, data, solids, seen, q, True):
            return True
    return False
