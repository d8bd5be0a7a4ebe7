"""What differs between a snake arm and any other robot that is judged.

Each kind reads, judges, repairs and writes its motions; nobody else asks which it is.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol, TypeAlias, TypeVar

from vdsm_pin.errors import InvalidFile, InvalidInput
from vdsm_pin.io.atomic import write_text
from vdsm_pin.io.problem_file import ProblemOfRobot, read_problem
from vdsm_pin.io.trajectory_file import (
    Interpolation,
    read_trajectory,
    write_trajectory,
)
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.tables import write_cables, write_centres, write_link_angles
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.brackets import ClearanceSink
from vdsm_pin.verification.coal_distances import coal_reach
from vdsm_pin.verification.moving import untimed
from vdsm_pin.verification.protocols import AnyProblem
from vdsm_pin.verification.records import ArmVerification, Verification
from vdsm_pin.verification.robot_model import load_robot
from vdsm_pin.verification.task import ArmPairs
from vdsm_pin.verification.verify import verify

if TYPE_CHECKING:  # whoever verifies an arm needs no robots, and few need repair
    from vdsm_pin.repair.rounds import Repaired
    from vdsm_pin.robots.cell import Cell
    from vdsm_pin.robots.judgement import RobotVerification
    from vdsm_pin.verification.certificate_lines import Hashes

LINK_ANGLES: Final = "link_angles.csv"
CABLES: Final = "cables.csv"
CENTRES: Final = "centres.csv"

GIVEN: Final = Path("trajectory")
"""What messages name in place of a file where a motion has none."""

T = TypeVar("T")

Asked: TypeAlias = "PlanningProblem | Cell"
"""A problem of an arm, or of any other robot."""


Motion: TypeAlias = Trajectory | JointTrajectory
"""Of an arm, or of any other robot."""


@dataclass(frozen=True)
class Terms:
    """What is said of motions besides the problem.

    Args:
        deadline: When to give up what is left.
        interpolation: What joins the rows of an arm's trajectory file.
        topic: Of the motion of another robot, in a bag.
    """

    deadline: Deadline = NO_LIMIT
    interpolation: Interpolation = "auto"
    topic: str | None = None


NO_TERMS: Final = Terms()
"""Nothing is said."""


class Subject(Protocol):
    """A problem, and how the motions of its robot are handled.

    A motion is a `Trajectory` of an arm, and a `JointTrajectory` of any other robot.
    """

    @property
    def problem(self) -> AnyProblem:
        """What is asked."""

    @property
    def urdf_sha256(self) -> str:
        """Of the URDF that Pinocchio reads."""

    @property
    def n_pairs(self) -> int:
        """How many pairs are judged."""

    @property
    def near(self) -> float:
        """Clearances below it are told of every interval as they are proved; [m]."""

    def read(self, file: Path) -> Any:
        """The motion of a file.

        Raises:
            InvalidFile: If the file breaks its contract, or lacks the times that a
                motion needs beside what moves.
        """

    def checked(self, motion: Any) -> Any:
        """A motion that was made in Python.

        Raises:
            InvalidInput: If it is none, or of another robot.
        """

    def judge(
        self,
        motion: Any,
        sinks: Sequence[ClearanceSink] = (),
        reach: float | None = None,
        *,
        joint_error: bool = False,
    ) -> Verification:
        """The verification of a motion; for arguments see `verification.verify`."""

    def is_of(self, verification: Any, motion: Any) -> bool:
        """Whether a verification is of a motion, to the last bit."""

    def certify(self, path: Path, verification: Any, hashes: "Hashes") -> None:
        """Write the certificate of a motion.

        Raises:
            OutOfTime: If the time is over.
            VerificationFailed: If there is nothing to write.
        """

    def repair(self, motion: Any, pinned: Sequence[int]) -> "Repaired[Any]":
        """A certified motion near a given one.

        Raises:
            Infeasible: If none was found.
        """

    def motion_of(self, verification: Any) -> Any:
        """The motion that was judged."""

    def write(self, file: Path, motion: Any) -> None:
        """Write a motion as CSV, with digits that read back as the same doubles."""

    def write_tables(self, folder: Path, verification: Any) -> None:
        """Write the tables that are of this kind of robot alone."""


@dataclass(frozen=True)
class ArmSubject:
    """A snake arm; see `Subject`."""

    problem: PlanningProblem
    terms: Terms = NO_TERMS

    @property
    def urdf_sha256(self) -> str:
        """Of the URDF that Pinocchio reads."""
        return load_robot(self.problem.manipulator).urdf_sha256

    @property
    def n_pairs(self) -> int:
        """How many pairs are judged."""
        return ArmPairs(self.problem).size

    @property
    def near(self) -> float:
        """As far as Coal looks; [m]."""
        return coal_reach(self.problem)

    def read(self, file: Path) -> Trajectory:
        """The motion of a file."""
        arm, joined = self.problem.manipulator, self.terms.interpolation
        motion = read_trajectory(file, arm, joined)
        _check_times(file, self.problem.scene, motion)
        return motion

    def checked(self, motion: object) -> Trajectory:
        """A motion that was made in Python; `verify` checks the rest."""
        return expect(motion, Trajectory, "plan(problem).trajectory")

    def judge(
        self,
        motion: Trajectory,
        sinks: Sequence[ClearanceSink] = (),
        reach: float | None = None,
        *,
        joint_error: bool = False,
    ) -> ArmVerification:
        """The verification of a motion."""
        return verify(
            self.problem,
            motion,
            load_robot(self.problem.manipulator),
            sinks=sinks,
            joint_error=joint_error,
            deadline=self.terms.deadline,
            reach=reach,
        )

    def is_of(self, verification: ArmVerification, motion: Trajectory) -> bool:
        """Whether a verification is of a motion, to the last bit."""
        return motion.same_as(verification.trajectory)

    def certify(
        self, path: Path, verification: ArmVerification, hashes: "Hashes"
    ) -> None:
        """Write the certificate of a motion."""
        # Imported by those who ask for one: its schema takes a while to build.
        from vdsm_pin.verification.certificate_writer import write_certificate

        write_certificate(path, verification, hashes, self.terms.deadline)

    def repair(
        self, motion: Trajectory, pinned: Sequence[int]
    ) -> "Repaired[ArmVerification]":
        """A certified motion near a given one."""
        from vdsm_pin.repair.arm import repair_arm

        return repair_arm(self.problem, motion, pinned, self.terms.deadline)

    def motion_of(self, verification: ArmVerification) -> Trajectory:
        """The motion that was judged."""
        return verification.trajectory

    def write(self, file: Path, motion: Trajectory) -> None:
        """Write a motion as CSV."""
        write_trajectory(file, motion)

    def write_tables(self, folder: Path, verification: ArmVerification) -> None:
        """Write link angles, joint centres and cable lengths."""
        motion = verification.trajectory
        write_link_angles(folder / LINK_ANGLES, verification)
        write_centres(folder / CENTRES, self.problem, motion)
        write_cables(folder / CABLES, self.problem, motion)


@dataclass(frozen=True)
class RobotSubject:
    """Any other robot; see `Subject`."""

    problem: "Cell"
    terms: Terms = NO_TERMS

    near = inf

    @property
    def urdf_sha256(self) -> str:
        """Of the URDF that Pinocchio reads."""
        return sha256(self.problem.robot.text.encode()).hexdigest()

    @property
    def n_pairs(self) -> int:
        """How many pairs are judged."""
        return len(self.problem.pairs)

    def read(self, file: Path) -> JointTrajectory:
        """The motion of a file."""
        from vdsm_pin.robots.trajectory_files import path_of, read_motion

        robot = self.problem.robot
        motion = read_motion(file, robot.joints, self.terms.topic, robot.values)
        path_of(file, motion)
        _check_times(file, self.problem.scene, motion)
        return motion

    def checked(self, motion: object) -> JointTrajectory:
        """A motion that was made in Python."""
        from vdsm_pin.robots.trajectory_files import moved, path_of

        robot = self.problem.robot
        given = expect(motion, JointTrajectory, "read_trajectory(path, problem)")
        found = moved(given, robot.joints, robot.values, GIVEN)
        path_of(GIVEN, found)
        return found

    def judge(
        self,
        motion: JointTrajectory,
        sinks: Sequence[ClearanceSink] = (),
        reach: float | None = None,
        *,
        joint_error: bool = False,
    ) -> "RobotVerification":
        """The verification of a motion; no sink hears of it."""
        from vdsm_pin.robots.judgement import verify_robot

        found = verify_robot(self.problem, motion.path, self.terms.deadline)
        return replace(found, motion=motion)

    def is_of(self, verification: "RobotVerification", motion: JointTrajectory) -> bool:
        """Whether a verification is of a motion, to the last bit."""
        return motion.path.same_as(verification.trajectory)

    def certify(
        self, path: Path, verification: "RobotVerification", hashes: "Hashes"
    ) -> None:
        """Write the certificate of a motion."""
        from vdsm_pin.robots.certificate import write_robot_certificate

        more = self.terms.topic, self.terms.deadline
        write_robot_certificate(path, verification, hashes, *more)

    def repair(
        self, motion: JointTrajectory, pinned: Sequence[int]
    ) -> "Repaired[RobotVerification]":
        """A certified motion near a given one."""
        from vdsm_pin.repair.robot import repair_robot

        found = repair_robot(self.problem, motion.path, pinned, self.terms.deadline)
        rows = self.motion_of(found.verification)
        return replace(found, verification=replace(found.verification, motion=rows))

    def motion_of(self, verification: "RobotVerification") -> JointTrajectory:
        """The motion that was judged."""
        if verification.motion is not None:
            return verification.motion
        names = tuple(joint.name for joint in self.problem.robot.joints)
        path = verification.trajectory
        return JointTrajectory(names, path.knots, path.times)

    def write(self, file: Path, motion: JointTrajectory) -> None:
        """Write a motion as CSV."""
        from vdsm_pin.robots.trajectory_csv import csv_text

        write_text(file, csv_text(motion, self.problem.robot))

    def write_tables(self, folder: Path, verification: "RobotVerification") -> None:
        """There are none."""


def expect(value: Any, kind: type[T], how: str) -> T:
    """The value, where it is of a kind.

    Args:
        value: What was given.
        kind: What is expected.
        how: Python that makes one, for the message.

    Raises:
        InvalidInput: If it is of another kind.
    """
    if not isinstance(value, kind):
        found = type(value).__name__
        message = f"expected {kind.__name__}, as of {how}; found {found}"
        raise InvalidInput(message)
    return value


def _check_times(file: Path, scene: Scene, motion: Motion) -> None:
    """Refuse rows without times beside what moves.

    Raises:
        InvalidFile: If they have none.
    """
    if why := untimed(scene, motion):
        raise InvalidFile(file=file, where="line 1", problem=why)


def read_asked(name_or_path: str | Path) -> Asked:
    """The problem of a built-in name or a file, of an arm or of any other robot.

    Raises:
        InvalidFile: If the file or one that it names breaks its contract.
    """
    try:
        return read_problem(name_or_path)
    except ProblemOfRobot as error:
        from vdsm_pin.robots.cell import read_cell

        return read_cell(error.file)


def subject_of(problem: Asked, terms: Terms = Terms()) -> Subject:
    """A problem of either kind, with how its motions are handled."""
    if isinstance(problem, PlanningProblem):
        return ArmSubject(problem, terms)
    return RobotSubject(problem, terms)
