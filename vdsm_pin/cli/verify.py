"""`vdsm verify`: of an arm by a problem, of any other robot by its URDF."""

from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple, NoReturn

import typer

from vdsm_pin.cli.options import (
    NOT_PASSED,
    PASSED,
    AsJson,
    BaseError,
    BaseTurn,
    JointErrors,
    ObstacleErrors,
    ObstacleTurns,
    OutFolder,
    Quiet,
    TimeLimit,
    Trajectory,
    errors_of,
    examples,
    family,
)
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
    refuse_beside,
)
from vdsm_pin.errors import InvalidInput
from vdsm_pin.time_limit import Deadline, enforced

if TYPE_CHECKING:
    from vdsm_pin.app.workflow import VerifyOrder
    from vdsm_pin.robots.cell import Cell

commands = family()

Interpolation = Literal["auto", "linear", "cubic", "quintic"]


class Said(NamedTuple):
    """What goes to the terminal."""

    quiet: bool
    as_json: bool

    def progress(self) -> AbstractContextManager[None]:
        """A bar, where somebody looks at it."""
        from vdsm_pin.progress import shown

        return nullcontext() if self.quiet or self.as_json else shown(lines=False)


@commands.command(
    epilog=examples(
        "vdsm verify paper/obs1 --trajectory out/obs1/trajectory.csv --out out/obs1",
        "vdsm verify mine.yaml --trajectory mine.csv --out out/mine "
        "--certificate mine.certificate",
        "vdsm verify --urdf ur5.urdf --srdf ur5.srdf --scene scene.yaml "
        "--trajectory plan.csv --required-clearance-mm 5 --out out/ur5",
    )
)
def verify(
    context: typer.Context,
    trajectory: Trajectory,
    out: OutFolder,
    problem: Annotated[
        str | None,
        typer.Argument(
            metavar="PROBLEM",
            help="A built-in name or a problem file; none with --urdf.",
        ),
    ] = None,
    joint_error_deg: JointErrors = "0",
    base_error_mm: BaseError = 0.0,
    base_error_deg: BaseTurn = 0.0,
    obstacle_error_mm: ObstacleErrors = None,
    obstacle_error_deg: ObstacleTurns = None,
    certificate: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write the proof to this file.")
    ] = None,
    pdf: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Print the report to this file; needs Chromium or Chrome.",
        ),
    ] = None,
    time_limit: TimeLimit = None,
    all_pairs: Annotated[
        bool,
        typer.Option(
            "--all-pairs", help="List every pair at every interval in clearance.csv."
        ),
    ] = False,
    interpolation: Annotated[
        Interpolation,
        typer.Option(
            help="What joins waypoints: straight lines, or smooth pieces by the "
            "velocities (cubic) and accelerations (quintic) of the trajectory."
        ),
    ] = "auto",
    quiet: Quiet = False,
    as_json: AsJson = False,
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
) -> None:
    """Prove a trajectory clear, or say where it is not.

    The trajectory may be of any planner. Writes report.html, verification.json,
    clearance.csv, link_angles.csv, centres.csv and cables.csv; of a robot (problem with
    robot, or --urdf) verification.json alone.
    """
    of_robot = RobotOptions(
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
    of_arm: dict[str, object] = {
        "--joint-error-deg": joint_error_deg != "0",
        "--base-error-mm": base_error_mm,
        "--base-error-deg": base_error_deg,
        "--obstacle-error-mm": obstacle_error_mm,
        "--obstacle-error-deg": obstacle_error_deg,
        "--certificate": certificate,
        "--pdf": pdf,
        "--all-pairs": all_pairs,
        "--interpolation": interpolation != "auto",
    }
    said = Said(quiet, as_json)
    deadline = Deadline.after(time_limit)
    if urdf is not None:
        refuse_beside("--urdf", {"PROBLEM": problem, **of_arm})
        with enforced(deadline):
            cell = of_robot.cell(None)
        _end_robot(cell, trajectory, out, context.obj, said, deadline, topic)
    refuse_beside("a problem", of_robot.named())
    if problem is None:
        message = "expected a PROBLEM, or --urdf for any other robot"
        raise InvalidInput(message)
    from vdsm_pin.app.workflow import VerifyOrder
    from vdsm_pin.io.problem_file import RobotProblem, read_problem
    from vdsm_pin.report.run_record import now

    errors = errors_of(
        joint_error_deg,
        base_error_mm,
        base_error_deg,
        obstacle_error_mm,
        obstacle_error_deg,
    )
    try:
        with enforced(deadline):
            source = read_problem(problem)
    except RobotProblem as error:
        refuse_beside("a robot", of_arm)
        with enforced(deadline):
            cell = of_robot.cell(Path(error.file))
        _end_robot(cell, trajectory, out, context.obj, said, deadline, topic)
    refuse_beside("an arm", {"--topic": topic})
    with enforced(deadline):
        arm = VerifyOrder(
            source=source.under(errors),
            trajectory=trajectory,
            folder=out,
            command=context.obj,
            certificate=certificate,
            pdf=pdf,
            deadline=deadline,
            all_pairs=all_pairs,
            date=now(),
            interpolation=interpolation,
        )
    raise typer.Exit(PASSED if _arm_passes(arm, said) else NOT_PASSED)


def _arm_passes(order: "VerifyOrder", said: Said) -> bool:
    """Verify the motion of an arm, and say what was found."""
    from vdsm_pin.app.workflow import verify_to_folder
    from vdsm_pin.report.terminal import show_verification
    from vdsm_pin.report.words import outcome

    with enforced(order.deadline), said.progress():
        verified = verify_to_folder(order)
    written: list[tuple[str, str]] = []
    if order.certificate is not None:
        none = verified.no_certificate
        what = f"none: {none}" if none else str(order.certificate)
        written.append(("certificate", what))
    if order.pdf is not None:
        written.append(("report on paper", str(order.pdf)))
    if said.as_json:
        typer.echo(verified.file.text(), nl=False)
    elif not said.quiet:
        show_verification(verified.file, order.folder, *written)
    complete = order.certificate is None or not verified.no_certificate
    return outcome(verified.file.verdict).passed and complete


def _end_robot(
    cell: "Cell",
    trajectory: Path,
    out: Path,
    command: str,
    said: Said,
    deadline: Deadline,
    topic: str | None,
) -> NoReturn:
    """Verify the motion of a robot, say what was found, and end by the verdict."""
    from vdsm_pin.robots.folder import (
        FILE,
        RobotOrder,
        show_robot,
        verify_robot_to_folder,
    )

    with enforced(deadline), said.progress():
        order = RobotOrder(cell, trajectory, out, command, deadline, topic)
        found = verify_robot_to_folder(order)
    if said.as_json:
        typer.echo((out / FILE).read_text("utf-8"), nl=False)
    elif not said.quiet:
        show_robot(found, out)
    raise typer.Exit(PASSED if found.verdict == "certified" else NOT_PASSED) from None
