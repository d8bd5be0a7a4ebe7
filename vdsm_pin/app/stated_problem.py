"""The problem file that the certificate of a robot given by options is about."""

from pathlib import Path
from typing import TYPE_CHECKING

from vdsm_pin.io.atomic import atomic_path
from vdsm_pin.report.folder import check_kept, check_output_file

if TYPE_CHECKING:  # an arm's certificate needs nothing of robots
    from vdsm_pin.robots.cell import Cell
    from vdsm_pin.robots.files import RobotFiles


def problem_beside(certificate: Path) -> Path:
    """Where it stands."""
    return certificate.parent / f"{certificate.name}.yaml"


def stated_cell(
    cell: "Cell",
    files: "RobotFiles",
    scene: Path | None,
    certificate: Path,
    motion: Path,
) -> "Cell":
    """The same cell, read from a problem file that is written for it.

    Args:
        cell: What the options ask, errors included.
        files: Of its robot.
        scene: The file of its obstacles; None for none.
        certificate: Beside which the problem file is written.
        motion: The trajectory that is verified.

    Raises:
        InvalidInput: If the file cannot be written, or is one that is read.
    """
    from vdsm_pin.robots.cell import read_cell
    from vdsm_pin.robots.problem_text import problem_text

    path = problem_beside(certificate)
    for output in (certificate, path):
        check_output_file(output)
    check_kept([certificate, path], [*cell.files, motion])
    text = problem_text(cell, files, scene, path.parent)
    with atomic_path(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    return read_cell(path).under(cell.errors)
