"""What verification.json says of a robot of a URDF: joints, links, notes."""

from functools import partial
from typing import Any

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.proof.paths import Path
from vdsm_pin.report.facts import counterexample_row, error_box, left_out_rows
from vdsm_pin.report.inputs import file_notes, longer_motions
from vdsm_pin.report.rows import ErringJointRow, JointRow, RobotFacts
from vdsm_pin.report.words import finite
from vdsm_pin.robots.cell import Cell
from vdsm_pin.robots.judgement import RobotVerification
from vdsm_pin.robots.model import Robot, RobotJoint
from vdsm_pin.verification.extremes import extremes
from vdsm_pin.verification.inside import mesh_notes


def robot_facts(verification: RobotVerification) -> dict[str, Any]:
    """The fields of verification.json that are a robot's own."""
    cell, motion = verification.problem, verification.trajectory
    return {
        "notes": (
            *cell.robot.notes,
            *file_notes(cell),
            *mesh_notes(cell),
            *longer_motions(cell, motion.times),
            *(f"trajectory: {note}" for note in motion.notes),
        ),
        "coverage": None,
        "path_length_m": None,
        "undrawn_m": (),
        "error_box": error_box(cell.errors),
        "left_out": left_out_rows(cell.robot.left_out),
        "motion": _motion(cell, motion),
        "counterexamples": tuple(
            counterexample_row(
                verification, one, joints=_erring(cell.robot, one.joints, one.offsets)
            )
            for one in verification.counterexamples
        ),
    }


def _motion(cell: Cell, motion: JointTrajectory) -> RobotFacts:
    robot = cell.robot
    rows = (
        _joint(joint, values)
        for joint, values in zip(robot.joints, reached(motion.path).T, strict=True)
    )
    return RobotFacts.model_validate(
        {
            "waypoints": motion.n_samples,
            "robot": robot.name,
            "interpolation": motion.interpolation,
            "bodies": robot.solids.words,
            "links": tuple(body.name for body in robot.bodies),
            "joints": tuple(rows),
        }
    )


def reached(path: Path) -> FloatArray:
    """Least and largest values of all columns over a motion, (2, n_columns)."""
    columns = range(path.knots.shape[1])
    signed = [partial(_signed, sign, k) for sign in (-1.0, 1.0) for k in columns]
    low, high = np.array(extremes(path, signed)).reshape(2, -1)
    return np.stack([-low, high])


def _signed(sign: float, column: int, q: FloatArray) -> FloatArray:
    """A column of rows of joint values or its negative, shape (m, 1)."""
    return sign * q[:, column : column + 1]


def _joint(joint: RobotJoint, values: FloatArray) -> JointRow:
    reached = float(values[0]), float(values[1])
    limits = finite(joint.lower), finite(joint.upper)
    if joint.turns:
        return JointRow(name=joint.name, range_rad=reached, limits_rad=limits)
    return JointRow(name=joint.name, range_m=reached, limits_m=limits)


def _erring(
    robot: Robot, values: FloatArray, errors: FloatArray
) -> tuple[ErringJointRow, ...]:
    """The joints of a counterexample and what they are off by; [rad], [m]."""
    return tuple(
        ErringJointRow(name=joint.name, value_rad=value, error_rad=error)
        if joint.turns
        else ErringJointRow(name=joint.name, value_m=value, error_m=error)
        for joint, value, error in zip(
            robot.joints, values.tolist(), errors.tolist(), strict=True
        )
    )
