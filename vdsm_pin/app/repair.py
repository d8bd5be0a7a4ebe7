"""A trajectory repaired, in a folder."""

import json
from dataclasses import replace
from typing import Final

from vdsm_pin import __version__
from vdsm_pin.app.motions import MotionOptions
from vdsm_pin.app.subjects import subject_of
from vdsm_pin.app.workflow import JUDGED, TRAJECTORY, VerifyOrder, verify_to_folder
from vdsm_pin.errors import Infeasible
from vdsm_pin.io.source import (
    check_is_file_or_bag,
    check_unchanged,
    sha256_of_file,
)
from vdsm_pin.repair.rounds import Repaired
from vdsm_pin.report.folder import check_kept, check_output_folder, staged
from vdsm_pin.verification.records import Verdict, Verification

REPAIR: Final = "repair.json"


def repair_to_folder(
    order: VerifyOrder, pinned: tuple[int, ...] = ()
) -> Repaired[Verification]:
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
    subject = subject_of(order.problem, order.options)
    found = subject.repair(subject.read(order.trajectory), pinned)
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
        subject.write(aside / TRAJECTORY, subject.motion_of(found.verification))
        (aside / REPAIR).write_text(json.dumps(content, indent=1) + "\n", "utf-8")
    options = MotionOptions(deadline=order.options.deadline)
    written = order.folder / TRAJECTORY
    verified = verify_to_folder(replace(order, trajectory=written, options=options))
    if verified.records.verdict is not Verdict.CERTIFIED:
        message = f"{written}: the repaired motion, as written: {verified.file.reason}"
        raise Infeasible(message)
    return found
