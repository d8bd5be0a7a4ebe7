"""`vdsm repair`."""

from pathlib import Path
from typing import Annotated

import typer

from vdsm_pin.cli.options import OutFolder, TimeLimit, Trajectory, examples, family
from vdsm_pin.cli.robot import (
    Bodies,
    Group,
    JointLimits,
    Locks,
    PackageDirs,
    Parts,
    RequiredClearance,
    RequiredSelfClearance,
    RobotOptions,
    SceneFile,
    Srdf,
    Topic,
    Urdf,
)
from vdsm_pin.errors import InvalidInput
from vdsm_pin.time_limit import Deadline, enforced

commands = family()


@commands.command(
    epilog=examples(
        "vdsm repair cell.yaml --trajectory plan.csv --out out/cell",
        "vdsm repair --urdf ur5.urdf --srdf ur5.srdf --scene scene.yaml "
        "--trajectory plan.csv --out out/ur5",
    )
)
def repair(
    context: typer.Context,
    trajectory: Trajectory,
    out: OutFolder,
    problem: Annotated[
        str | None,
        typer.Argument(
            metavar="PROBLEM", help="A problem file with robot; none with --urdf."
        ),
    ] = None,
    urdf: Urdf = None,
    srdf: Srdf = None,
    scene: SceneFile = None,
    package_dir: PackageDirs = None,
    lock: Locks = None,
    required_clearance_mm: RequiredClearance = None,
    required_self_clearance_mm: RequiredSelfClearance = None,
    group: Group = None,
    bodies: Bodies = None,
    parts: Parts = None,
    joint_limits: JointLimits = None,
    topic: Topic = None,
    pin: Annotated[
        list[int] | None,
        typer.Option(metavar="ROW", help="A waypoint, from 0, that stays."),
    ] = None,
    time_limit: TimeLimit = None,
) -> None:
    """Move a robot's waypoints until they are certified.

    Writes trajectory.csv, repair.json (how far each waypoint moved) and
    verification.json; where no such trajectory is found, nothing, and says why.
    """
    from vdsm_pin.app.repair import repair_to_folder
    from vdsm_pin.app.workflow import VerifyOrder

    deadline = Deadline.after(time_limit)
    options = RobotOptions(
        urdf,
        srdf,
        scene,
        tuple(package_dir or ()),
        tuple(lock or ()),
        required_clearance_mm,
        required_self_clearance_mm,
        group,
        bodies,
        parts,
        joint_limits,
    )
    with enforced(deadline):
        cell = options.cell(None if problem is None else _of_robot(problem))
        order = VerifyOrder(
            cell, trajectory, out, context.obj, deadline=deadline, topic=topic
        )
        found = repair_to_folder(order, cell, tuple(pin or ()))
    new = int((found.given < 0).sum())
    typer.echo(
        f"certified with {len(found.moved)} waypoints, {new} of them new; moved by "
        f"{found.moved.max():.6f} rad (m) at most; wrote {out}"
    )


def _of_robot(problem: str) -> Path:
    """The problem file of a robot.

    Raises:
        InvalidInput: If the problem is about a snake arm.
    """
    from vdsm_pin.io.problem_file import ProblemOfRobot, read_problem

    try:
        read_problem(problem)
    except ProblemOfRobot as error:
        return Path(error.file)
    message = (
        f"{problem} is about a snake arm, whose motions are not repaired; "
        "vdsm plan makes a certified one"
    )
    raise InvalidInput(message)
