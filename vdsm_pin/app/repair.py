"""A trajectory repaired, in a folder."""

import json
from dataclasses import replace
from typing import Any, Final, NamedTuple

from vdsm_pin import __version__
from vdsm_pin.app.motions import MotionOptions
from vdsm_pin.app.workflow import (
    JUDGED,
    TRAJECTORY,
    VERIFICATION,
    VerifyOrder,
    naming_earlier,
    read_given,
    verify_into,
)
from vdsm_pin.errors import Infeasible
from vdsm_pin.io.source import check_unchanged, sha256_of_file
from vdsm_pin.repair.rounds import Repaired
from vdsm_pin.report.files import VerificationFile
from vdsm_pin.report.folder import check_outputs, staged
from vdsm_pin.verification.records import Verdict, Verification

REPAIR: Final = "repair.json"


class RepairedFiles(NamedTuple):
    """A repair, and what verification.json says of its trajectory as written."""

    found: Repaired[Any, Verification]
    file: VerificationFile


def repair_to_folder(order: VerifyOrder, pinned: tuple[int, ...] = ()) -> RepairedFiles:
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
    check_outputs(inputs, folder=order.folder, names=(TRAJECTORY, REPAIR, *JUDGED))
    motion, digest, subject = read_given(order)
    with naming_earlier(order.folder / VERIFICATION):
        found = subject.repair(motion, pinned)
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
    earlier = naming_earlier(order.folder / VERIFICATION)
    with earlier, staged(order.folder) as staging:
        subject.write(staging / TRAJECTORY, found.trajectory)
        (staging / REPAIR).write_text(json.dumps(content, indent=1) + "\n", "utf-8")
        options = MotionOptions(deadline=order.options.deadline)
        again = replace(order, trajectory=staging / TRAJECTORY, options=options)
        verified = verify_into(again, read_given(again), staging)
        if verified.records.verdict is not Verdict.CERTIFIED:
            message = f"the repaired motion, as written: {verified.content.reason}"
            raise Infeasible(message)
    return RepairedFiles(found, verified.content)
