"""`vdsm convert`."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from vdsm_pin.cli.options import (
    Answer,
    OutFolder,
    ProblemArgument,
    examples,
    family,
    grouped,
)
from vdsm_pin.cli.robot import refuse_beside
from vdsm_pin.text import printable

commands = family()


class Format(StrEnum):
    """Of a JointTrajectory."""

    yaml = "yaml"
    json = "json"
    mcap = "mcap"
    bag = "bag"


@commands.command(
    epilog=examples(
        "vdsm convert paper/obs1 --trajectory out/obs1/trajectory.csv --out out/all",
        "vdsm convert paper/obs1 --trajectory out/obs1/trajectory.csv --also mcap "
        "--out out/ros",
        "vdsm convert mine.yaml --cables cables.csv --out out/mine",
    )
)
@grouped
def convert(
    problem: ProblemArgument,
    out: OutFolder,
    trajectory: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Joint angles, as trajectory.csv."),
    ] = None,
    centres: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Joint centres, as centres.csv.")
    ] = None,
    cables: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Cable lengths, as cables.csv.")
    ] = None,
    also: Annotated[
        list[Format] | None,
        typer.Option(help="Write a JointTrajectory too; mcap is ROS 2, bag ROS 1."),
    ] = None,
    *,
    answer: Answer,
) -> None:
    """Convert angles, centres and cable lengths.

    Takes joint angles, joint centres or cable lengths, and writes all of them:
    trajectory.csv, centres.csv and cables.csv. Of a robot (problem with robot) it
    takes a trajectory of any format and writes trajectory.csv. Nothing is judged.
    """
    from vdsm_pin.app.conversion import Given, convert_robot, convert_to_folder
    from vdsm_pin.app.subjects import read_problem_or_cell
    from vdsm_pin.problem.planning_problem import PlanningProblem

    given, more = Given(trajectory, centres, cables), [one.value for one in also or ()]
    notes: tuple[str, ...] = ()
    asked = read_problem_or_cell(problem)
    if isinstance(asked, PlanningProblem):
        motion = convert_to_folder(asked, given, out, more)
        count, notes = motion.n_samples, motion.notes
    else:
        refuse_beside("a robot", {"--centres": centres, "--cables": cables})
        count = convert_robot(asked, given.file, out, more)
    lines = [printable(f"note: {note}") for note in notes]
    lines.append(f"wrote {count} waypoints to {out}")
    answer.tell("\n".join(lines), waypoints=count, folder=out, notes=notes)
