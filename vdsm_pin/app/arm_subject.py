"""How motions of a snake arm are read, judged, repaired and written."""

import math
from collections.abc import Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from vdsm_pin.app.motions import NO_OPTIONS, MotionOptions, check_times, expect
from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.bags import is_bag
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.io.trajectory_messages import ENDINGS
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.impasse import at_start
from vdsm_pin.report.tables import (
    ClearanceCsv,
    write_cables,
    write_centres,
    write_link_angles,
)
from vdsm_pin.verification.coal_arm import coal_reach
from vdsm_pin.verification.pinocchio_arm import load_arm
from vdsm_pin.verification.records import ArmVerification
from vdsm_pin.verification.task import arm_assembly
from vdsm_pin.verification.verify import verify

if TYPE_CHECKING:  # few need repair
    from vdsm_pin.repair.rounds import Repaired

LINK_ANGLES: Final = "link_angles.csv"
CABLES: Final = "cables.csv"
CENTRES: Final = "centres.csv"


@dataclass(frozen=True)
class ArmSubject:
    """A snake arm; see `Subject`."""

    problem: PlanningProblem
    options: MotionOptions = NO_OPTIONS

    @property
    def urdf_sha256(self) -> str:
        """SHA-256 of the URDF that Pinocchio reads, in hexadecimal."""
        return load_arm(self.problem.manipulator).urdf_sha256

    def read(self, file: Path) -> Trajectory:
        """Read the motion of a CSV file."""
        if is_bag(file) or file.suffix.lower() in ENDINGS:
            fault = "is no CSV; `vdsm convert PROBLEM --trajectory FILE --out FOLDER` "
            raise InvalidFile(file=file, fault=f"{fault}makes one of it")
        arm, joined = self.problem.manipulator, self.options.interpolation
        asked = self.problem.tip_path is not None
        motion = read_trajectory(file, arm, joined, places=asked)
        check_times(file, self.problem.scene, motion)
        return motion

    def at_start(self) -> Trajectory:
        """The motion that stays where the arm begins."""
        return at_start(self.problem)

    def checked(self, motion: object) -> Trajectory:
        """The motion itself, if it is a `Trajectory`; `verify` checks that it fits."""
        return expect(motion, Trajectory, "plan(problem).trajectory")

    def judge(
        self,
        motion: Trajectory,
        table: Path | None = None,
        *,
        all_pairs: bool = False,
        joint_error: bool = False,
    ) -> ArmVerification:
        """Verify a motion; see `verification.verify`."""
        deadline, asked = self.options.deadline, self.problem
        judged = partial(
            verify, asked, motion, joint_error=joint_error, deadline=deadline
        )
        if table is None:
            return judged()
        reach = math.inf if all_pairs else coal_reach(asked)
        n_pairs = arm_assembly(asked).table.size
        with closing(ClearanceCsv(table, asked, n_pairs, reach)) as clearance:
            found = judged(sinks=(clearance,), reach=reach)
            clearance.write(found)
        return found

    def is_of(self, verification: ArmVerification, motion: Trajectory) -> bool:
        """Whether a verification judged this motion, equal to the last bit."""
        return motion.same_as(verification.trajectory)

    def repair(
        self, motion: Trajectory, pinned: Sequence[int]
    ) -> "Repaired[Trajectory, ArmVerification]":
        """Find a certified motion near a given one."""
        from vdsm_pin.repair.arm import repair_arm

        return repair_arm(self.problem, motion, pinned, self.options.deadline)

    def write(self, file: Path, motion: Trajectory) -> None:
        """Write a motion as CSV."""
        write_trajectory(motion, file)

    def write_tables(self, folder: Path, verification: ArmVerification) -> None:
        """Write link angles, joint centres and cable lengths."""
        motion = verification.trajectory
        write_link_angles(folder / LINK_ANGLES, verification)
        write_centres(folder / CENTRES, self.problem, motion)
        write_cables(folder / CABLES, self.problem, motion)
