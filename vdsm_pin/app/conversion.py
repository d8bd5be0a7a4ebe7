"""Angles, joint centres and cables from one another (paper, section 5)."""

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from vdsm_pin.app.workflow import CABLES, CENTRES, TRAJECTORY
from vdsm_pin.errors import InvalidInput
from vdsm_pin.io.problem_file import ProblemFile
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.io.waypoint_tables import read_cables, read_centres
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.folder import check_kept, check_output_folder, staged
from vdsm_pin.report.tables import write_cables, write_centres

CONVERTED: Final = TRAJECTORY, CENTRES, CABLES
"""What a conversion writes to its folder."""


@dataclass(frozen=True)
class Given:
    """The one file that is converted; the others are None.

    Args:
        trajectory: Joint angles.
        centres: Joint centres.
        cables: Cable lengths.
    """

    trajectory: Path | None = None
    centres: Path | None = None
    cables: Path | None = None

    @property
    def file(self) -> Path:
        """The file.

        Raises:
            InvalidInput: If there is none or more than one.
        """
        files = [self.trajectory, self.centres, self.cables]
        given = [file for file in files if file is not None]
        if len(given) != 1:
            message = (
                f"{len(given)} files to convert, expected one: --trajectory, --centres "
                "or --cables"
            )
            raise InvalidInput(message)
        return given[0]

    def read(self, source: ProblemFile) -> Trajectory:
        """The motion it describes.

        Raises:
            InvalidFile: If it breaks its contract or no posture of the arm fits it.
        """
        if self.centres is not None:
            return read_centres(self.centres, source.problem)
        if self.cables is not None:
            return read_cables(self.cables, source.problem)
        return read_trajectory(self.file, source.problem.manipulator)


def convert_to_folder(source: ProblemFile, given: Given, folder: Path) -> Trajectory:
    """Write one motion as angles, as joint centres and as cable lengths.

    Args:
        source: The problem, for its arm and frame.
        given: The file to convert.
        folder: Where the three files go.

    Returns:
        The motion.

    Raises:
        InvalidInput: If the file is bad or the folder cannot be written.
    """
    file = given.file
    check_output_folder(folder)
    outputs = [folder / name for name in CONVERTED]
    check_kept(outputs, [*source.source.files, file])
    motion = given.read(source)
    with staged(folder) as aside:
        write_trajectory(aside / TRAJECTORY, motion)
        write_centres(aside / CENTRES, source.problem, motion)
        write_cables(aside / CABLES, source.problem, motion)
    return motion
