"""How motions of any robot but a snake arm are read, judged, repaired and written."""

from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from vdsm_pin.app.motions import NO_OPTIONS, MotionOptions, check_times, expect
from vdsm_pin.io.atomic import write_text
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.report.tables import ClearanceCsv
from vdsm_pin.robots.cell import Cell
from vdsm_pin.robots.judgement import RobotVerification, verify_robot
from vdsm_pin.robots.trajectory_csv import csv_text
from vdsm_pin.robots.trajectory_files import joint_path, moved, read_motion

if TYPE_CHECKING:  # few need repair
    from vdsm_pin.repair.rounds import Repaired

NO_FILE: Final = Path("trajectory")
"""What messages name in place of a file where a motion has none."""


@dataclass(frozen=True)
class RobotSubject:
    """Any other robot; see `Subject`."""

    problem: Cell
    options: MotionOptions = NO_OPTIONS

    @property
    def urdf_sha256(self) -> str:
        """SHA-256 of the URDF that Pinocchio reads, in hexadecimal."""
        return sha256(self.problem.robot.text.encode()).hexdigest()

    def read(self, file: Path) -> JointTrajectory:
        """Read the motion of a file."""
        robot, how = self.problem.robot, self.options
        given = robot.joints, how.topic, robot.values, how.interpolation
        motion = read_motion(file, *given)
        joint_path(file, motion)
        check_times(file, self.problem.scene, motion)
        return motion

    def at_start(self) -> JointTrajectory:
        """The motion that stays with every joint at 0, or at its limit nearest to 0."""
        joints = self.problem.robot.joints
        q = [min(max(0.0, joint.lower), joint.upper) for joint in joints]
        return JointTrajectory(tuple(joint.name for joint in joints), np.array([q]))

    def checked(self, motion: object) -> JointTrajectory:
        """The motion with its columns in the robot's order, if it has its joints."""
        robot = self.problem.robot
        given = expect(motion, JointTrajectory, "read_trajectory(path, problem)")
        found = moved(given, robot.joints, robot.values, NO_FILE)
        joint_path(NO_FILE, found)
        return found

    def judge(
        self,
        motion: JointTrajectory,
        table: Path | None = None,
        *,
        all_pairs: bool = False,
        joint_error: bool = False,
    ) -> RobotVerification:
        """Verify a motion; `all_pairs` and `joint_error` are of arms."""
        found = verify_robot(self.problem, motion, self.options.deadline)
        if table is not None:
            n_pairs = len(found.pairs)
            with closing(ClearanceCsv(table, self.problem, n_pairs)) as clearance:
                clearance.write(found)
        return found

    def is_of(self, verification: RobotVerification, motion: JointTrajectory) -> bool:
        """Whether a verification judged this motion, equal to the last bit."""
        return motion.path.same_as(verification.trajectory.path)

    def repair(
        self, motion: JointTrajectory, pinned: Sequence[int]
    ) -> "Repaired[JointTrajectory, RobotVerification]":
        """Find a certified motion near a given one."""
        from vdsm_pin.repair.robot import repair_robot

        return repair_robot(self.problem, motion, pinned, self.options.deadline)

    def write(self, file: Path, motion: JointTrajectory) -> None:
        """Write a motion as CSV."""
        write_text(file, csv_text(motion, self.problem.robot))

    def write_tables(self, folder: Path, verification: RobotVerification) -> None:
        """Write nothing: these tables are of snake arms alone."""
