"""`vdsm verify`, `vdsm repair`: of an arm by a problem, of a robot by its URDF too."""

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from vdsm_pin.cli import options
from vdsm_pin.cli.robot import ProblemOrNone, RobotOptions, Topic, refuse_beside
from vdsm_pin.errors import InvalidInput
from vdsm_pin.time_limit import Deadline, enforced

if TYPE_CHECKING:
    from vdsm_pin.app.workflow import VerifyOrder
    from vdsm_pin.problem.error_boxes import ErrorBox
    from vdsm_pin.problem.planning_problem import PlanningProblem
    from vdsm_pin.robots.cell import Cell

commands = options.Family()


@commands.add(
    "vdsm verify paper/obs1 --trajectory out/obs1/trajectory.csv --out out/obs1",
    "vdsm verify mine.yaml --trajectory mine.csv --out out/mine "
    "--certificate mine.certificate",
    "vdsm verify --urdf ur5.urdf --srdf ur5.srdf --scene scene.yaml "
    "--trajectory plan.csv --required-clearance-mm 5 --out out/ur5",
)
def verify(
    context: typer.Context,
    trajectory: options.Trajectory,
    out: options.OutFolder,
    *,
    problem: ProblemOrNone = None,
    errors: options.ErrorOptions,
    slide_error_mm: options.SlideErrors = "0",
    certificate: Annotated[
        Path | None, options.option("FILE", "Write the proof to this file.")
    ] = None,
    pdf: Annotated[
        Path | None,
        options.option(
            "FILE", "Print the report to this file; needs Chromium or Chrome."
        ),
    ] = None,
    time_limit: options.TimeLimit = None,
    all_pairs: Annotated[
        bool,
        typer.Option(
            "--all-pairs", help="List every pair at every interval in clearance.csv."
        ),
    ] = False,
    interpolation: options.Interpolation = "auto",
    answer: options.Answer,
    robot: RobotOptions,
    topic: Topic = None,
) -> None:
    """Prove a trajectory clear, or say where it is not.

    The trajectory may be of any planner. Writes report.html, verification.json,
    clearance.csv, link_angles.csv, centres.csv and cables.csv; of a robot (problem with
    robot, or --urdf) the first three.
    """
    of_arm: dict[str, object] = {
        "--pdf": pdf,
        "--all-pairs": all_pairs,
    }
    deadline = Deadline.after(time_limit)
    box = errors.box(slide_error_mm)
    from vdsm_pin.app.motions import MotionOptions
    from vdsm_pin.app.workflow import VerifyOrder
    from vdsm_pin.report.run_record import now

    with enforced(deadline, grace=0.0):
        asked = asked_problem(problem, box, robot, of_arm, topic)
        if certificate is not None and robot.urdf is not None:
            from vdsm_pin.app.stated_problem import stated_cell

            files = robot.files(), robot.scene, certificate, trajectory
            asked = stated_cell(asked, *files)
        order = VerifyOrder(
            problem=asked,
            trajectory=trajectory,
            folder=out,
            command=context.obj,
            certificate=certificate,
            pdf=pdf,
            options=MotionOptions(deadline, interpolation, topic),
            all_pairs=all_pairs,
            date=now(),
        )
    options.end(passed=_verify_and_tell(order, answer))


def asked_problem(
    problem: str | None,
    errors: "ErrorBox",
    of_robot: RobotOptions,
    of_arm: dict[str, object],
    topic: str | None,
) -> "PlanningProblem | Cell":
    """The problem of an arm or a robot, from a file or from options.

    Raises:
        InvalidInput: If a file is bad, or an option has no meaning for it.
    """
    if of_robot.urdf is not None:
        refuse_beside("--urdf", {"PROBLEM": problem, **of_arm})
        return of_robot.cell().under(errors)
    refuse_beside("a problem", of_robot.named())
    if problem is None:
        message = "expected a PROBLEM, or --urdf for any other robot"
        raise InvalidInput(message)
    from vdsm_pin.app.subjects import read_problem_or_cell
    from vdsm_pin.problem.planning_problem import PlanningProblem

    asked = read_problem_or_cell(problem)
    if isinstance(asked, PlanningProblem):
        refuse_beside("an arm", {"--topic": topic})
    else:
        refuse_beside("a robot", of_arm)
    return asked.under(errors)


def _verify_and_tell(order: "VerifyOrder", answer: options.Answer) -> bool:
    """Verify a motion, say what was found, and return whether it is as asked."""
    from vdsm_pin.app.workflow import verify_to_folder
    from vdsm_pin.progress import shown
    from vdsm_pin.report.terminal import show_verification
    from vdsm_pin.report.words import outcome

    bar = nullcontext() if answer.wordless else shown(lines=False)
    with enforced(order.options.deadline), bar:
        verified = verify_to_folder(order)
    written: list[tuple[str, str]] = []
    if order.certificate is not None:
        from vdsm_pin.report.folder import problem_beside

        none = verified.no_certificate
        what = f"none: {none}" if none else str(order.certificate)
        written.append(("certificate", what))
        beside = problem_beside(order.certificate)
        if beside in order.problem.files:
            written.append(("its problem file", str(beside)))
    if order.pdf is not None:
        written.append(("report on paper", str(order.pdf)))
    if answer.as_json:
        typer.echo(verified.content.text(), nl=False)
    elif not answer.quiet:
        show_verification(verified.content, order.folder, *written)
    return outcome(verified.content.verdict).passed and not verified.no_certificate


@commands.add(
    "vdsm repair paper/obs1 --trajectory mine.csv --out out/mine",
    "vdsm repair cell.yaml --trajectory plan.csv --out out/cell",
    "vdsm repair --urdf ur5.urdf --srdf ur5.srdf --scene scene.yaml "
    "--trajectory plan.csv --out out/ur5",
)
def repair(
    context: typer.Context,
    trajectory: options.Trajectory,
    out: options.OutFolder,
    *,
    problem: ProblemOrNone = None,
    errors: options.ErrorOptions,
    slide_error_mm: options.SlideErrors = "0",
    robot: RobotOptions,
    topic: Topic = None,
    pin: Annotated[
        list[int] | None, options.option("ROW", "A waypoint, from 0, that stays.")
    ] = None,
    time_limit: options.TimeLimit = None,
    answer: options.Answer,
) -> None:
    """Mend a trajectory until it is certified.

    Moves its waypoints; of a snake arm the tip stays on its path. Writes
    trajectory.csv, repair.json (how far each waypoint moved) and what verify writes;
    where no such trajectory is found, nothing, and says why.
    """
    from vdsm_pin.app.motions import MotionOptions
    from vdsm_pin.app.repair import repair_to_folder
    from vdsm_pin.app.workflow import VerifyOrder
    from vdsm_pin.report.terminal import show_verification

    deadline, box = Deadline.after(time_limit), errors.box(slide_error_mm)
    with enforced(deadline, grace=0.0):
        asked = asked_problem(problem, box, robot, {}, topic)
    with enforced(deadline):
        options = MotionOptions(deadline, topic=topic)
        order = VerifyOrder(asked, trajectory, out, context.obj, options=options)
        found, file = repair_to_folder(order, tuple(pin or ()))
    count, new, most = len(found.moved), int((found.given < 0).sum()), found.moved.max()
    facts = {"waypoints": count, "new": new, "moved_at_most": float(most)}
    answer.tell_facts(verdict="certified", **facts, folder=out)
    if answer.wordless:
        return
    show_verification(
        file,
        out,
        ("waypoints", f"{count}, {new} of them new"),
        (
            "largest change",
            found.most if new or most else "none: it was clear as given",
        ),
    )
