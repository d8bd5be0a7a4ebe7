"""The problem file that the certificate of a robot given by options is about."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from vdsm_pin.app.subjects import ProblemOrCell
from vdsm_pin.io.atomic import write_text
from vdsm_pin.io.errors_field import stated_errors
from vdsm_pin.report.folder import CERTIFICATES, check_outputs, problem_beside
from vdsm_pin.robots.cell import Cell, read_cell
from vdsm_pin.robots.files import RobotFiles
from vdsm_pin.units import MM_PER_M


def problem_text(
    cell: Cell, files: RobotFiles, scene: Path | None, folder: Path
) -> str:
    """The text of a problem file in a folder; what is as by default is left out.

    Args:
        cell: What is asked.
        files: Of its robot.
        scene: The file of its obstacles; None for none.
        folder: Where the text will stand: files are named relative to it.
    """

    def named(file: Path | None) -> str | None:
        if file is None:
            return None
        return os.path.relpath(os.path.realpath(file), os.path.realpath(folder))

    robot = {
        "urdf": named(files.urdf),
        "srdf": named(files.srdf),
        "package_dirs": [named(one) for one in files.package_dirs],
        "lock": dict(files.lock),
        "group": files.group,
        "bodies": files.solids.cover,
        "parts": files.solids.parts if files.solids.cover == "parts" else None,
        "joint_limits": named(files.joint_limits),
        "xacro_args": dict(files.xacro_args),
    }
    whole = {
        "vdsm_problem": 1,
        "length_unit": "mm",
        "robot": _given(robot),
        "required_clearance": cell.required_clearance * MM_PER_M,
        "required_self_clearance": cell.required_self_clearance * MM_PER_M,
        "errors": stated_errors(cell.errors, MM_PER_M),
        "scene": named(scene),
    }
    return yaml.safe_dump(_given(whole), sort_keys=False, allow_unicode=True)


def _given(values: Mapping[str, Any]) -> dict[str, Any]:
    """Those that are not empty; a clearance of 0 is stated."""
    return {key: value for key, value in values.items() if value not in (None, [], {})}


def stated_cell(
    cell: ProblemOrCell,
    files: RobotFiles,
    scene: Path | None,
    certificate: Path,
    motion: Path,
) -> Cell:
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
    assert isinstance(cell, Cell)  # what has a URDF
    path = problem_beside(certificate)
    outputs = (certificate, CERTIFICATES), (path, (".yaml",))
    check_outputs((*cell.files, motion), files=outputs)
    write_text(path, problem_text(cell, files, scene, path.parent))
    return read_cell(path).under(cell.errors)
