"""What differs between a snake arm and any other robot whose motions are judged.

A `Subject` is a problem with the functions that read, judge, repair and write its
motions. Callers use it without asking whether it is of an arm or of another robot.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

from vdsm_pin.app.arm_subject import ArmSubject
from vdsm_pin.app.motions import NO_OPTIONS, MotionOptions
from vdsm_pin.app.problems import read_robot
from vdsm_pin.io.problem_file import arm_problem, find_problem, read_document
from vdsm_pin.problem.any_problem import AnyProblem
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.verification.records import Verification

if TYPE_CHECKING:  # whoever verifies an arm needs no robots, and few need repair
    from vdsm_pin.repair.rounds import Repaired
    from vdsm_pin.robots.cell import Cell

ProblemOrCell: TypeAlias = "PlanningProblem | Cell"
"""A problem of a snake arm, or of any other robot in its cell."""


class Subject(Protocol):
    """A problem, and the functions that handle motions of its arm or robot.

    A motion is a `Trajectory` of an arm, and a `JointTrajectory` of any other robot; a
    verification is an `ArmVerification` or a `RobotVerification`.
    """

    @property
    def problem(self) -> AnyProblem:
        """The arm or robot, its scene and what its motions are held to."""

    @property
    def urdf_sha256(self) -> str:
        """SHA-256 of the URDF that Pinocchio reads, in hexadecimal."""

    def read(self, file: Path) -> Any:
        """Read the motion of a file.

        Raises:
            InvalidFile: If the file breaks its contract, or has no times although
                obstacles move.
        """

    def at_start(self) -> Any:
        """The motion that stays where the arm or robot begins."""

    def checked(self, motion: Any) -> Any:
        """A motion that was made in Python, with its columns in the robot's order.

        Raises:
            InvalidInput: If it is no motion, or one of another robot.
        """

    def judge(
        self,
        motion: Any,
        table: Path | None = None,
        *,
        all_pairs: bool = False,
        joint_error: bool = False,
    ) -> Verification:
        """Verify a motion.

        Args:
            motion: As `read` or `checked` returned it.
            table: Where clearance.csv goes; None for none. It has the least clearance
                of each pair, of an arm the near pairs at every interval too.
            all_pairs: Whether it has every pair of an arm at every interval.
            joint_error: Whether to look for the largest joint error of an arm that is
                still certified.
        """

    def is_of(self, verification: Any, motion: Any) -> bool:
        """Whether a verification judged this motion, equal to the last bit."""

    def repair(self, motion: Any, pinned: Sequence[int]) -> "Repaired[Any, Any]":
        """Find a certified motion near a given one.

        Args:
            motion: The given one.
            pinned: Numbers of rows, from 0, that stay besides the first and the last.

        Raises:
            Infeasible: If none was found.
        """

    def write(self, file: Path, motion: Any) -> None:
        """Write a motion as CSV, with digits that read back as the same doubles."""

    def write_tables(self, folder: Path, verification: Any) -> None:
        """Write the tables that only snake arms have, or only other robots."""


def read_problem_or_cell(name_or_path: str | Path) -> ProblemOrCell:
    """The problem of a built-in name or a file, of an arm or of any other robot.

    Raises:
        InvalidFile: If the file or one that it names breaks its contract.
    """
    file = read_document(find_problem(name_or_path))
    if not file.is_of_robot:
        return arm_problem(file, read_robot)
    from vdsm_pin.robots.cell import cell_of_file
    from vdsm_pin.robots.files import cell_file

    return cell_of_file(cell_file(file))


def subject_of(problem: ProblemOrCell, options: MotionOptions = NO_OPTIONS) -> Subject:
    """The subject of a problem: of an arm, or of any other robot."""
    if isinstance(problem, PlanningProblem):
        return ArmSubject(problem, options)
    from vdsm_pin.app.robot_subject import RobotSubject

    return RobotSubject(problem, options)
