"""A trajectory repaired, in a folder."""

import json
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final, TypeAlias

from vdsm_pin import __version__
from vdsm_pin.app.workflow import JUDGED, TRAJECTORY, VerifyOrder, verify_to_folder
from vdsm_pin.errors import Infeasible
from vdsm_pin.io.source import (
    check_is_file_or_bag,
    check_unchanged,
    sha256_of_file,
)
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.repair.arm import repair_arm
from vdsm_pin.repair.rounds import Repaired
from vdsm_pin.report.folder import check_kept, check_output_folder, staged
from vdsm_pin.verification.records import Verdict

if TYPE_CHECKING:
    from collections.abc import Callable

    from vdsm_pin.robots.cell import Cell
    from vdsm_pin.robots.judgement import RobotVerification
    from vdsm_pin.verification.records import ArmVerification

REPAIR: Final = "repair.json"

Found: TypeAlias = "Repaired[ArmVerification] | Repaired[RobotVerification]"


def repair_to_folder(order: VerifyOrder, pinned: tuple[int, ...] = ()) -> Found:
    """Repair a trajectory; trajectory.csv, repair.json and its verification.

    The verification is of trajectory.csv as it was written.

    Args:
        order: What to repair and where to.
        pinned: Numbers of waypoints, from 0, that stay.

    Raises:
        InvalidInput: If a file is bad or the folder cannot be written.
        Infeasible: If no certified motion was found near the given one, or the one
            found is not certified as it was written, as where the time is over.
    """
    inputs = [*order.problem.files, order.trajectory]
    check_output_folder(order.folder)
    check_is_file_or_bag(order.trajectory)
    digest = sha256_of_file(order.trajectory)
    check_kept([order.folder / n for n in (TRAJECTORY, REPAIR, *JUDGED)], inputs)
    if isinstance(order.problem, PlanningProblem):
        found, write = _of_arm(order, order.problem, pinned)
    else:
        found, write = _of_robot(order, order.problem, pinned)
    check_unchanged(order.trajectory, digest)
    rows = zip(found.given.tolist(), found.moved.tolist(), strict=True)
    content = {
        "vdsm_repair": 1,
        "vdsm_pin": __version__,
        "command": order.command,
        "sha256": {str(file): sha256_of_file(file) for file in inputs},
        "waypoints": [
            {"given": given if given >= 0 else None, "moved": moved}
            for given, moved in rows
        ],
    }
    with staged(order.folder) as aside:
        write(aside / TRAJECTORY)
        (aside / REPAIR).write_text(json.dumps(content, indent=1) + "\n", "utf-8")
    written = order.folder / TRAJECTORY
    verified = verify_to_folder(
        replace(order, trajectory=written, topic=None, interpolation="auto")
    )
    if verified.records.verdict is not Verdict.CERTIFIED:
        message = f"{written}: the repaired motion, as written: {verified.file.reason}"
        raise Infeasible(message)
    return found


def _of_arm(
    order: VerifyOrder, problem: PlanningProblem, pinned: tuple[int, ...]
) -> "tuple[Found, Callable[[Path], None]]":
    """The repaired motion of a snake arm, and what writes it."""
    arm = problem.manipulator
    trajectory = read_trajectory(order.trajectory, arm, order.interpolation)
    found = repair_arm(problem, trajectory, pinned, order.deadline)
    motion = found.verification.trajectory
    return found, partial(write_trajectory, trajectory=motion)


def _of_robot(
    order: VerifyOrder, cell: "Cell", pinned: tuple[int, ...]
) -> "tuple[Found, Callable[[Path], None]]":
    """The same of any other robot."""
    from vdsm_pin.repair.robot import repair_robot
    from vdsm_pin.robots.trajectory_files import path_text, read_path

    path = read_path(order.trajectory, cell.robot, order.topic)
    found = repair_robot(cell, path, pinned, order.deadline)
    text = path_text(found.verification.trajectory, cell.robot)

    def write(file: Path) -> None:
        file.write_text(text, encoding="utf-8")

    return found, write
