"""The judgement of a robot's trajectory on a terminal and in a folder."""

import json
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final

import numpy as np
import typer

from vdsm_pin import __version__
from vdsm_pin.io.source import sha256_of_file
from vdsm_pin.report.facts import check_row
from vdsm_pin.report.folder import check_kept, check_output_folder, staged
from vdsm_pin.report.terminal import plain_checks, show_facts
from vdsm_pin.report.words import outcome
from vdsm_pin.robots.cell import Cell
from vdsm_pin.robots.judgement import JudgedPair, RobotVerification
from vdsm_pin.robots.repair import Repaired, repair_robot
from vdsm_pin.robots.trajectory_files import path_text, read_path
from vdsm_pin.text import printable
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.units import MM_PER_M

FILE: Final = "verification.json"
TRAJECTORY: Final = "trajectory.csv"
REPAIR: Final = "repair.json"
NEAREST: Final = 5
"""Pairs that the terminal tells."""


@dataclass(frozen=True)
class RobotOrder:
    """What to verify.

    Args:
        cell: The robot, its obstacles, the clearances asked for.
        trajectory: Its motion.
        folder: Where the result goes.
        command: The exact command line.
        deadline: When to stop.
        topic: Of the trajectory, in a bag.
    """

    cell: Cell
    trajectory: Path
    folder: Path
    command: str
    deadline: Deadline = NO_LIMIT
    topic: str | None = None

    @property
    def inputs(self) -> list[Path]:
        """The files that it is made from."""
        return [self.cell.files[0], self.trajectory, *self.cell.files[1:]]


def verify_robot_to_folder(order: RobotOrder) -> RobotVerification:
    """Verify a robot's trajectory and write verification.json.

    Raises:
        InvalidInput: If a file is bad or the folder cannot be written.
    """
    check_output_folder(order.folder)
    check_kept([order.folder / FILE], order.inputs)
    asked = order.cell.asked
    path = read_path(order.trajectory, asked.robot, order.topic)
    found = asked.verified(path, order.deadline)
    content = {
        "vdsm_robot_verification": 1,
        "vdsm_pin": __version__,
        "command": order.command,
        "sha256": {str(file): sha256_of_file(file) for file in order.inputs},
        **_facts(found, order),
    }
    text = json.dumps(content, indent=1, ensure_ascii=False, allow_nan=False)
    with staged(order.folder) as aside:
        (aside / FILE).write_text(text + "\n", encoding="utf-8")
    return found


def repair_to_folder(order: RobotOrder, pinned: tuple[int, ...] = ()) -> Repaired:
    """Repair a robot's trajectory; trajectory.csv, repair.json, verification.json.

    The verification is of trajectory.csv as it was written.

    Raises:
        InvalidInput: If a file is bad or the folder cannot be written.
        Infeasible: If no certified motion was found near the given one.
    """
    names = (FILE, TRAJECTORY, REPAIR)
    check_output_folder(order.folder)
    check_kept([order.folder / name for name in names], order.inputs)
    asked = order.cell.asked
    path = read_path(order.trajectory, asked.robot, order.topic)
    found = repair_robot(asked, path, pinned, order.deadline)
    rows = zip(found.given.tolist(), found.moved.tolist(), strict=True)
    content = {
        "vdsm_repair": 1,
        "vdsm_pin": __version__,
        "command": order.command,
        "sha256": {str(file): sha256_of_file(file) for file in order.inputs},
        "waypoints": [
            {"given": given if given >= 0 else None, "moved": moved}
            for given, moved in rows
        ],
    }
    with staged(order.folder) as aside:
        text = path_text(found.verification.path, asked.robot)
        (aside / TRAJECTORY).write_text(text, encoding="utf-8")
        (aside / REPAIR).write_text(json.dumps(content, indent=1) + "\n", "utf-8")
    written = order.folder / TRAJECTORY
    verify_robot_to_folder(replace(order, trajectory=written, topic=None))
    return found


def _facts(found: RobotVerification, order: RobotOrder) -> dict[str, Any]:
    robot, path = found.robot, found.path
    return {
        "verdict": found.verdict.value,
        "robot": robot.name,
        "joints": [joint.name for joint in robot.joints],
        "waypoints": len(path.knots),
        "interpolation": {1: "linear", 3: "cubic", 5: "quintic"}[path.degree],
        "bodies": robot.solids.words,
        "notes": list(robot.notes),
        "required_clearance_m": order.cell.asked.required,
        "required_self_clearance_m": order.cell.asked.required_self,
        "checks": [check_row(check).model_dump(mode="json") for check in found.checks],
        "pairs": [_pair(pair) for pair in _nearest_first(found)],
        "left_out": [[one.one, one.other, one.reason] for one in robot.left_out],
    }


def _nearest_first(found: RobotVerification) -> list[JudgedPair]:
    return sorted(found.pairs, key=lambda pair: (pair.upper, pair.lower))


def _pair(pair: JudgedPair) -> dict[str, Any]:
    seen = bool(np.isfinite(pair.upper))
    return {
        "link": pair.link,
        "other": pair.other,
        "obstacle": pair.is_obstacle,
        "verdict": pair.verdict.value,
        "lower_m": pair.lower if np.isfinite(pair.lower) else None,
        "upper_m": pair.upper if seen else None,
        "waypoint": pair.moment if seen else None,
        "link_point_m": pair.link_point.tolist() if seen else None,
        "other_point_m": pair.other_point.tolist() if seen else None,
    }


def show_robot(found: RobotVerification, folder: Path) -> None:
    """Print verdict, checks and the nearest pairs."""
    known = outcome(found.verdict)
    typer.echo(f"{known.mark} {known.word}  {printable(found.robot.name)}")
    plain_checks(tuple(check_row(check) for check in found.checks))
    near = [
        (
            f"{pair.link} and {pair.other}",
            f"proved {pair.lower * MM_PER_M:.3f} to {pair.upper * MM_PER_M:.3f} mm "
            f"at waypoint {pair.moment:.4f}, {pair.verdict.value}",
        )
        for pair in _nearest_first(found)[:NEAREST]
        if np.isfinite(pair.upper)
    ]
    left = f"{len(found.robot.left_out)} pairs of links, listed with reasons"
    show_facts(*near, ("not held apart", left), ("file", str(folder / FILE)))
