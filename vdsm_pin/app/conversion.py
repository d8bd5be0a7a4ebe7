"""Angles, joint centres and cables from one another (paper, section 5)."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from vdsm_pin.app.arm_subject import CABLES, CENTRES
from vdsm_pin.app.motions import Motion
from vdsm_pin.app.subjects import ProblemOrCell, subject_of
from vdsm_pin.app.workflow import TRAJECTORY
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import InvalidFile, InvalidInput
from vdsm_pin.io.bags import check_topic, is_bag, read_bag, write_bag
from vdsm_pin.io.source import files_in
from vdsm_pin.io.trajectory_file import read_trajectory
from vdsm_pin.io.trajectory_messages import ENDINGS, read_joint_trajectory, text_of
from vdsm_pin.io.waypoint_tables import read_cables, read_centres
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory, joint_names
from vdsm_pin.report.folder import check_outputs, staged
from vdsm_pin.report.tables import write_cables, write_centres
from vdsm_pin.robots.trajectory_files import read_motion

CONVERTED: Final = TRAJECTORY, CENTRES, CABLES
"""What a conversion of a snake arm's motion writes to its folder."""

FORMATS: Final = {
    "yaml": ("trajectory.yaml",),
    "json": ("trajectory.json",),
    "robot-yaml": ("robot_trajectory.yaml",),
    "robot-json": ("robot_trajectory.json",),
    "mcap": ("trajectory.mcap",),
    "db3": ("trajectory/trajectory.db3", "trajectory/metadata.yaml"),
    "bag": ("trajectory.bag",),
}
"""Formats of ROS and their files: a JointTrajectory or RobotTrajectory as text, or a
JointTrajectory in an MCAP file, a ROS 2 bag or a ROS 1 bag."""


@dataclass(frozen=True)
class MotionFile:
    """The one file that is converted; the others are None.

    Args:
        trajectory: Joint angles.
        centres: Joint centres.
        cables: Cable lengths.
        topic: Of the trajectory, where it is a bag; None for the only one.
    """

    trajectory: Path | None = None
    centres: Path | None = None
    cables: Path | None = None
    topic: str | None = None

    @property
    def file(self) -> Path:
        """The file.

        Raises:
            InvalidInput: If there is none or more than one.
        """
        files = [self.trajectory, self.centres, self.cables]
        given = [file for file in files if file is not None]
        if len(given) != 1:
            few = "none of them is" if not given else f"{len(given)} of them are"
            message = f"expected one of --trajectory, --centres, --cables; {few} given"
            raise InvalidInput(message)
        return given[0]

    def read(self, problem: ProblemOrCell) -> Motion:
        """The motion it describes.

        Raises:
            InvalidFile: If it breaks its contract or no posture fits it.
        """
        if not isinstance(problem, PlanningProblem):
            robot = problem.robot
            return read_motion(self.file, robot.joints, self.topic, robot.values)
        check_topic(self.file, self.topic)
        if self.centres is not None:
            return read_centres(self.centres, problem)
        if self.cables is not None:
            return read_cables(self.cables, problem)
        if is_bag(self.file) or self.file.suffix.lower() in ENDINGS:
            return read_arm_message(self.file, problem.manipulator, self.topic)
        asked = problem.tip_path is not None
        return read_trajectory(self.file, problem.manipulator, places=asked)


def convert_to_folder(
    problem: ProblemOrCell, given: MotionFile, folder: Path, also: Sequence[str] = ()
) -> Motion:
    """Write one motion as angles; of a snake arm as joint centres and cables too.

    Args:
        problem: For its arm and frame, or its robot.
        given: The file to convert; of any other robot a trajectory.
        folder: Where the files go.
        also: Formats of `FORMATS` that the angles are written in too.

    Returns:
        The motion.

    Raises:
        InvalidInput: If the file is bad or the folder cannot be written.
    """
    of_arm = isinstance(problem, PlanningProblem)
    names = CONVERTED if of_arm else (TRAJECTORY,)
    files = [
        (folder / file, ()) for one in dict.fromkeys(also) for file in FORMATS[one]
    ]
    inputs = *problem.files, *files_in(given.file)
    check_outputs(inputs, folder=folder, names=names, files=files)
    motion = given.read(problem)
    with staged(folder) as staging:
        subject_of(problem).write(staging / TRAJECTORY, motion)
        if isinstance(problem, PlanningProblem) and isinstance(motion, Trajectory):
            write_centres(staging / CENTRES, problem, motion)
            write_cables(staging / CABLES, problem, motion)
        named = motion.named if isinstance(motion, Trajectory) else motion
        write_messages(staging, named, also)
    return motion


def write_messages(folder: Path, motion: JointTrajectory, also: Sequence[str]) -> None:
    """Write a motion in formats of ROS.

    Raises:
        InvalidInput: If rosbags is needed and not installed.
    """
    for one in dict.fromkeys(also):
        file = folder / FORMATS[one][0]
        if one == "db3":
            write_bag(motion, file.parent)
        elif file.suffix in ENDINGS:
            of_robot = one.startswith("robot")
            text = text_of(motion, file.suffix, of_robot=of_robot)
            file.write_text(text, encoding="utf-8")
        else:
            write_bag(motion, file)


def read_arm_message(
    file: Path, arm: Manipulator, topic: str | None = None
) -> Trajectory:
    """A motion of the arm by the joints of its URDF: x0, alpha1, theta1, ..

    Raises:
        InvalidFile: If a joint is missing, or a value so large that its unit is wrong.
    """
    found = read_bag(file, topic) if is_bag(file) else read_joint_trajectory(file)
    names = joint_names(arm.n_links)
    missing = [name for name in names if name not in found.names]
    if missing:
        fault = f"has no joint {missing[0]!r}"
        raise InvalidFile(file=file, where="joint_names", fault=fault)
    found = found.of(names)
    if not (np.abs(found.q[:, 1:]) <= np.pi).all():
        fault = "has an angle beyond pi; is it in degrees? expected radians"
        raise InvalidFile(file=file, fault=fault)
    try:
        return Trajectory.of_joints(
            found.q, times=found.times, rates=found.rates, changes=found.changes
        )
    except InvalidInput as error:
        raise InvalidFile(file=file, fault=str(error)) from None
