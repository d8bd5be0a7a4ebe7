"""pink: a quadratic programme a step, obstacles and the cone of psi as barriers."""

import numpy as np
import pink
import pinocchio as pin
from pink.barriers import Barrier, SelfCollisionBarrier
from pink.tasks import FrameTask

from benchmarks.hrm2000.references.arm import Arm, Rows, placement, wanted
from vdsm_pin.errors import NoPlanFound
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.pinocchio_arm import PinocchioArm

CLOSE_ENOUGH = 2e-8  # m
MOST_STEPS = 30
GAIN = 0.5
DAMPING = 1e-10
MOST_PAIRS = 24
"""Closest pairs of link and obstacle that become barriers."""


class ConeBarrier(Barrier):
    """cos(alpha) cos(theta) - cos(psi_max) of every joint."""

    def __init__(self, arm: Arm) -> None:
        super().__init__(arm.n, gain=GAIN)
        self.arm = arm

    def compute_barrier(self, configuration: pink.Configuration) -> FloatArray:
        """Positive inside the cone, shape (N,)."""
        alpha, theta = configuration.q[1::2], configuration.q[2::2]
        return np.cos(alpha) * np.cos(theta) - np.cos(self.arm.cone)

    def compute_jacobian(self, configuration: pink.Configuration) -> FloatArray:
        """Its Jacobian, shape (N, 1 + 2N)."""
        alpha, theta = configuration.q[1::2], configuration.q[2::2]
        jacobian, joint = np.zeros((self.arm.n, self.arm.nq)), np.arange(self.arm.n)
        jacobian[joint, 1 + 2 * joint] = -np.sin(alpha) * np.cos(theta)
        jacobian[joint, 2 + 2 * joint] = -np.cos(alpha) * np.sin(theta)
        return jacobian


def bodies(arm: Arm) -> pin.GeometryModel:
    """Links and obstacles as Pinocchio's geometry, every pair of one and the other."""
    model, links = pin.GeometryModel(), []
    for i, body in enumerate(arm.links):
        place = placement(body)
        link = pin.GeometryObject(f"link{i}", 3 + 2 * i, place, body.geometry)
        links.append(model.addGeometryObject(link))
    for k, body in enumerate(arm.bodies):
        place = placement(body)
        obstacle = pin.GeometryObject(f"obstacle{k}", 0, place, body.geometry)
        number = model.addGeometryObject(obstacle)
        for link in links:
            model.addCollisionPair(pin.CollisionPair(link, number))
    return model


def follow(
    problem: PlanningProblem, robot: PinocchioArm, clearance: LinkClearance
) -> Trajectory:
    """Row after row, each by as many programmes as it takes.

    Raises:
        NoPlanFound: Where a row is not reached.
    """
    arm, goal = Arm(problem, robot, clearance), wanted(problem)
    model = robot.model.copy()
    tip_frame = model.addFrame(
        pin.Frame(
            "drawing_tip", model.njoints - 1, 0,
            pin.SE3(np.eye(3), arm.p_link_tip), pin.FrameType.OP_FRAME,
        )
    )  # fmt: skip
    geometry = bodies(arm)
    q = arm.start()
    configuration = pink.Configuration(
        model, model.createData(), q, collision_model=geometry,
        collision_data=pin.GeometryData(geometry),
    )  # fmt: skip
    task = FrameTask(model.frames[tip_frame].name, 1.0, 0.0)
    barriers: list[Barrier] = [ConeBarrier(arm)]
    pairs = len(geometry.collisionPairs)
    if pairs:
        # Twice what must be kept at the rows: a barrier holds to first order only.
        apart = arm.required + (arm.required - problem.required_clearance)
        barriers.append(
            SelfCollisionBarrier(min(pairs, MOST_PAIRS), gain=GAIN, d_min=apart)
        )
    rows = Rows(q, goal.stations[0])
    for tip, station, drawn in zip(goal.tips, goal.stations, goal.drawn, strict=True):
        task.set_target(pin.SE3(np.eye(3), tip))
        q = _reach(arm, configuration, task, barriers, tip)
        rows.add(q, station, bool(drawn))
    return rows.trajectory()


def _reach(
    arm: Arm,
    configuration: pink.Configuration,
    task: FrameTask,
    barriers: list[Barrier],
    tip: FloatArray,
) -> FloatArray:
    limits = [configuration.model.configuration_limit]
    for _ in range(MOST_STEPS):
        q = arm.bounded(configuration.q)
        error, _ = arm.tip(q, tip)
        if np.linalg.norm(error) < CLOSE_ENOUGH and arm.valid(q):
            return q
        try:
            move = pink.solve_ik(
                configuration, [task], 1.0, solver="daqp", damping=DAMPING,
                limits=limits, barriers=barriers, safety_break=False,
            )  # fmt: skip
        except pink.PinkError as failed:
            message = f"pink: {failed}"
            raise NoPlanFound(message) from failed
        configuration.integrate_inplace(move, 1.0)
    message = f"no valid row with the tip at {np.round(tip, 3).tolist()}"
    raise NoPlanFound(message)
