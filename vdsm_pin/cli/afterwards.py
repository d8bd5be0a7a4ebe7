"""What follows a motion: check-certificate, simulate, explain, convert and diff."""

from dataclasses import asdict
from enum import StrEnum
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from vdsm_pin.cli import options
from vdsm_pin.cli.robot import refuse_beside
from vdsm_pin.text import printable

commands = options.Family()


@commands.add("vdsm check-certificate mine.certificate mine.yaml mine.csv")
def check_certificate(
    certificate: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="Written by vdsm verify --certificate."),
    ],
    problem: options.ProblemArgument,
    trajectory: Annotated[
        Path, typer.Argument(metavar="TRAJECTORY", help="The motion that it is about.")
    ],
    *,
    answer: options.Answer,
) -> None:
    """Recheck a certificate.

    The checker is a second program that shares only the reading of files with the
    verifier.
    """
    from vdsm_pin.certificate_checker import check_certificate as check
    from vdsm_pin.certificate_checker import main
    from vdsm_pin.progress import shown, step

    if answer.wordless:
        found = check(certificate, Path(problem), trajectory)
        answer.tell_facts(accepted=found.accepted, **found._asdict())
        options.end(passed=found.accepted)
    with shown(lines=False):
        step("recomputing every claim")
        status = main([str(certificate), problem, str(trajectory)])
    raise typer.Exit(status)


@commands.add(
    "vdsm simulate paper/obs3 --trajectory out/obs3/trajectory.csv --out out/loop"
)
def simulate(
    problem: options.ProblemArgument,
    trajectory: options.Trajectory,
    out: options.OutFolder,
    settings: Annotated[
        Path | None,
        options.option("FILE", "Masses, cables, motors, gains and kicks (YAML)."),
    ] = None,
    *,
    answer: options.Answer,
) -> None:
    """Run a plan in closed loop.

    Simulates elastic cables, motors, encoders and PID. Needs MuJoCo (extra
    `simulation`). Writes executed.csv, simulation.csv, simulation.json and
    simulation.html. Status 1 where the executed motion is not proved clear.
    """
    from vdsm_pin.app.problems import read_problem
    from vdsm_pin.simulation.folder import (
        show_simulation,
        simulate_to_folder,
    )
    from vdsm_pin.simulation.settings import Settings, read_settings

    assumed = Settings() if settings is None else read_settings(settings)
    asked = read_problem(problem)
    file = simulate_to_folder(asked, trajectory, out, assumed, settings)
    answer.tell_facts(**file.model_dump(mode="json"))
    if not answer.wordless:
        show_simulation(file, out)
    passed = file.executed.verdict == "certified"
    options.end(passed=passed)


@commands.add(
    "vdsm explain paper/obs1 --out out/explain",
    "vdsm explain paper/obs3 --waypoint 300 --out out/explain",
)
def explain(
    problem: options.ProblemArgument,
    out: options.OutFolder,
    waypoint: Annotated[
        int | None,
        options.option(
            "NUMBER", "From 0; the one with the largest link angle if none.", min=0
        ),
    ] = None,
    *,
    answer: options.Answer,
) -> None:
    """Follow the paper's seven steps at one waypoint.

    Plans by the strategy `paper` and writes explain.html: numbers and a picture of
    every step.
    """
    from vdsm_pin.app.explanation.folder import explain_to_folder
    from vdsm_pin.app.problems import read_problem

    page, row = explain_to_folder(read_problem(problem), waypoint, out)
    answer.tell(f"waypoint {row}: wrote {page}", waypoint=int(row), page=page)


class Format(StrEnum):
    """Of ROS; see `conversion.FORMATS`."""

    yaml = "yaml"
    json = "json"
    robot_yaml = "robot-yaml"
    robot_json = "robot-json"
    mcap = "mcap"
    db3 = "db3"
    bag = "bag"


class Taken(NamedTuple):
    """One motion in whatever form, see `options.grouped`."""

    trajectory: Annotated[
        Path | None, options.option("FILE", "Joint angles, CSV, YAML, JSON or bag.")
    ] = None
    centres: Annotated[
        Path | None, options.option("FILE", "Joint centres, as centres.csv.")
    ] = None
    cables: Annotated[
        Path | None, options.option("FILE", "Cable lengths, as cables.csv.")
    ] = None
    topic: options.Topic = None


@commands.add(
    "vdsm convert paper/obs1 --trajectory out/obs1/trajectory.csv --out out/all",
    "vdsm convert paper/obs1 --trajectory out/obs1/trajectory.csv --also mcap "
    "--out out/ros",
    "vdsm convert mine.yaml --cables cables.csv --out out/mine",
)
def convert(
    problem: options.ProblemArgument,
    out: options.OutFolder,
    motion: Taken,
    also: Annotated[
        list[Format] | None,
        options.option(
            None,
            "Write a JointTrajectory too, or a RobotTrajectory (robot-); mcap and db3 "
            "are ROS 2, bag ROS 1.",
        ),
    ] = None,
    *,
    answer: options.Answer,
) -> None:
    """Convert angles, centres and cable lengths.

    Takes joint angles, joint centres or cable lengths, and writes all of them:
    trajectory.csv, centres.csv and cables.csv. Of a robot (problem with robot) it
    takes a trajectory of any format and writes trajectory.csv. Nothing is judged.
    """
    from vdsm_pin.app.conversion import MotionFile, convert_to_folder
    from vdsm_pin.app.subjects import read_problem_or_cell
    from vdsm_pin.problem.planning_problem import PlanningProblem

    more = [one.value for one in also or ()]
    asked = read_problem_or_cell(problem)
    if not isinstance(asked, PlanningProblem):
        refuse_beside(
            "a robot", {"--centres": motion.centres, "--cables": motion.cables}
        )
    found = convert_to_folder(asked, MotionFile(*motion), out, more)
    count, notes = found.n_samples, found.notes
    lines = [printable(f"note: {note}") for note in notes]
    lines.append(f"wrote {count} waypoints to {out}")
    answer.tell("\n".join(lines), waypoints=count, folder=out, notes=notes)


@commands.add("vdsm diff out/monday out/tuesday")
def diff(
    old: Annotated[
        Path,
        typer.Argument(metavar="OLD", help="A result folder of vdsm batch or verify."),
    ],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="A newer one.")],
    *,
    answer: options.Answer,
) -> None:
    """Compare two result folders.

    Exit status 1 if anything got worse.
    """
    from vdsm_pin.report.diff import compare_folders, diff_lines

    changes = compare_folders(old, new)
    worse = any(one.worse for one in changes)
    told = [asdict(one) for one in changes]
    answer.tell("\n".join(diff_lines(changes)), worse=worse, changes=told)
    options.end(passed=not worse)
