"""A robot's trajectory repaired, in a folder."""

import json
from dataclasses import replace
from typing import Final

from vdsm_pin import __version__
from vdsm_pin.app.workflow import JUDGED, TRAJECTORY, VerifyOrder, verify_to_folder
from vdsm_pin.io.source import sha256_of_file
from vdsm_pin.report.folder import check_kept, check_output_folder, staged
from vdsm_pin.robots.cell import Cell
from vdsm_pin.robots.repair import Repaired, repair_robot
from vdsm_pin.robots.trajectory_files import path_text, read_path

REPAIR: Final = "repair.json"


def repair_to_folder(
    order: VerifyOrder, cell: Cell, pinned: tuple[int, ...] = ()
) -> Repaired:
    """Repair a robot's trajectory; trajectory.csv, repair.json and its verification.

    The verification is of trajectory.csv as it was written.

    Raises:
        InvalidInput: If a file is bad or the folder cannot be written.
        Infeasible: If no certified motion was found near the given one.
    """
    inputs = [*order.read.files, order.trajectory]
    check_output_folder(order.folder)
    check_kept([order.folder / n for n in (TRAJECTORY, REPAIR, *JUDGED)], inputs)
    path = read_path(order.trajectory, cell.robot, order.topic)
    found = repair_robot(cell, path, pinned, order.deadline)
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
        text = path_text(found.verification.trajectory, cell.robot)
        (aside / TRAJECTORY).write_text(text, encoding="utf-8")
        (aside / REPAIR).write_text(json.dumps(content, indent=1) + "\n", "utf-8")
    written = order.folder / TRAJECTORY
    verify_to_folder(replace(order, trajectory=written, topic=None))
    return found
