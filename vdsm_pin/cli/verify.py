"""`vdsm verify`: of an arm by a problem, of any other robot by its URDF."""

from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, NamedTuple

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
from vdsm_pin.errors import InvalidInput
from vdsm_pin.time_limit import Deadline, enforced

if TYPE_CHECKING:
    from vdsm_pin.app.workflow import VerifyOrder
    from vdsm_pin.robots.folder import RobotOrder

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
            metavar="[PROBLEM]",
            help="A built-in name or a problem file; none with --urdf.",
        ),
    ] = None,
    joint_error_deg: JointErrors = "0",
    base_error_mm: BaseError = 0.0,
    base_error_deg: BaseTurn = 0.0,
    obstacle_error_mm: ObstacleErrors = None,
    obstacle_error_deg: ObstacleTurns = None,
    certificate: Annotated[
        Path | None, typer.Option(help="Write the proof to this file.")
    ] = None,
    pdf: Annotated[
        Path | None,
        typer.Option(help="Print the report to this file; needs Chromium or Chrome."),
    ] = None,
    time_limit: TimeLimit = None,
    all_pairs: Annotated[
        bool,
        typer.Option(
            "--all-pairs", help="Every pair at every interval in clearance.csv."
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
    urdf: Annotated[
        Path | None, typer.Option(help="Any robot, in place of a problem.")
    ] = None,
    srdf: Annotated[
        Path | None, typer.Option(help="Its links that need not be held apart.")
    ] = None,
    scene: Annotated[
        Path | None, typer.Option(help="Its obstacles: ours or a PlanningScene.")
    ] = None,
    package_dir: Annotated[
        list[Path] | None, typer.Option(help="Where package:// is looked for.")
    ] = None,
    lock: Annotated[
        list[str] | None,
        typer.Option(metavar="JOINT=VALUE", help="A joint that stands still [rad, m]."),
    ] = None,
    required_clearance_mm: Annotated[
        float | None,
        typer.Option(min=0.0, help="With --urdf: from obstacles [mm]; 0 by default."),
    ] = None,
    required_self_clearance_mm: Annotated[
        float | None,
        typer.Option(min=0.0, help="With --urdf: between links [mm]; 0 by default."),
    ] = None,
) -> None:
    """Verify a trajectory of any planner.

    Writes report.html, verification.json, clearance.csv, link_angles.csv, centres.csv
    and cables.csv; of a robot by --urdf verification.json alone.
    """
    of_robot = {
        "--srdf": srdf,
        "--scene": scene,
        "--package-dir": package_dir,
        "--lock": lock,
        "--required-clearance-mm": required_clearance_mm,
        "--required-self-clearance-mm": required_self_clearance_mm,
    }
    of_arm = {
        "PROBLEM": problem,
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
        _refuse_beside("--urdf", of_arm)
        from vdsm_pin.robots.folder import RobotOrder
        from vdsm_pin.units import MM_PER_M

        robot = RobotOrder(
            urdf=urdf,
            trajectory=trajectory,
            folder=out,
            command=context.obj,
            srdf=srdf,
            scene=scene,
            package_dirs=tuple(package_dir or ()),
            lock=tuple(lock or ()),
            required=(required_clearance_mm or 0.0) / MM_PER_M,
            required_self=(required_self_clearance_mm or 0.0) / MM_PER_M,
            deadline=deadline,
        )
        raise typer.Exit(PASSED if _robot_passes(robot, said) else NOT_PASSED)
    _refuse_beside("a problem", of_robot)
    if problem is None:
        message = "expected a PROBLEM, or --urdf for any other robot"
        raise InvalidInput(message)
    from vdsm_pin.app.workflow import VerifyOrder
    from vdsm_pin.io.problem_file import read_problem
    from vdsm_pin.report.run_record import now

    errors = errors_of(
        joint_error_deg,
        base_error_mm,
        base_error_deg,
        obstacle_error_mm,
        obstacle_error_deg,
    )
    with enforced(deadline):
        arm = VerifyOrder(
            source=read_problem(problem).under(errors),
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


def _refuse_beside(what: str, options: Mapping[str, object]) -> None:
    """Refuse options that mean nothing beside another one.

    Raises:
        InvalidInput: If one is given.
    """
    for name, value in options.items():
        if value:
            message = f"{name} has no meaning with {what}"
            raise InvalidInput(message)


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


def _robot_passes(order: "RobotOrder", said: Said) -> bool:
    """Verify the motion of a robot, and say what was found."""
    from vdsm_pin.robots.folder import FILE, show_robot, verify_robot_to_folder

    with enforced(order.deadline), said.progress():
        found = verify_robot_to_folder(order)
    if said.as_json:
        typer.echo((order.folder / FILE).read_text("utf-8"), nl=False)
    elif not said.quiet:
        show_robot(found, order.folder)
    return found.verdict == "certified"
