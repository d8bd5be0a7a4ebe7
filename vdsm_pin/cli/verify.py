"""`vdsm verify`, `vdsm repair`: of an arm by a problem, of a robot by its URDF too."""

from contextlib import nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from vdsm_pin.cli import options
from vdsm_pin.cli.robot import Asked
from vdsm_pin.time_limit import enforced

if TYPE_CHECKING:
    from vdsm_pin.app.workflow import VerifyOrder

commands = options.Family()


class Results(NamedTuple):
    """What is written, see `options.grouped`."""

    out: options.OutFolder
    certificate: Annotated[
        Path | None, options.option("FILE", "Write the proof to this file.")
    ] = None
    pdf: Annotated[
        Path | None,
        options.option(
            "FILE", "Print the report to this file; needs Chromium or Chrome."
        ),
    ] = None
    all_pairs: Annotated[
        bool,
        typer.Option(
            "--all-pairs", help="List every pair at every interval in clearance.csv."
        ),
    ] = False


@commands.add(
    "vdsm verify paper/obs1 --trajectory out/obs1/trajectory.csv --out out/obs1",
    "vdsm verify mine.yaml --trajectory mine.csv --out out/mine "
    "--certificate mine.certificate",
    "vdsm verify --urdf ur5.urdf --srdf ur5.srdf --scene scene.yaml "
    "--trajectory plan.csv --required-clearance-mm 5 --out out/ur5",
)
def verify(
    context: typer.Context,
    motion: options.MotionGiven,
    results: Results,
    *,
    asked: Asked,
    errors: options.AllErrorOptions,
    interpolation: options.Interpolation = "auto",
    answer: options.Answer,
) -> None:
    """Prove a trajectory clear, or say where it is not.

    The trajectory may be of any planner. Writes report.html, verification.json,
    clearance.csv, link_angles.csv, centres.csv and cables.csv; of a robot (problem with
    robot, or --urdf) the first three.
    """
    from vdsm_pin.app.workflow import VerifyOrder
    from vdsm_pin.report.run_record import now

    read_as, certificate = motion.read_as(interpolation), results.certificate
    with enforced(read_as.deadline, grace=0.0):
        of_arm: dict[str, object] = {
            "--pdf": results.pdf,
            "--all-pairs": results.all_pairs,
        }
        problem = asked.read(errors.box(), of_arm, motion.topic)
        if certificate is not None and asked.robot.urdf is not None:
            from vdsm_pin.app.stated_problem import stated_cell

            robot = asked.robot
            files = robot.files(), robot.scene, certificate, motion.trajectory
            problem = stated_cell(problem, *files)
        order = VerifyOrder(
            problem=problem,
            trajectory=motion.trajectory,
            folder=results.out,
            command=context.obj,
            certificate=certificate,
            pdf=results.pdf,
            options=read_as,
            all_pairs=results.all_pairs,
            date=now(),
        )
    options.end(passed=_verify_and_tell(order, answer))


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
    motion: options.MotionGiven,
    out: options.OutFolder,
    *,
    asked: Asked,
    errors: options.AllErrorOptions,
    pin: Annotated[
        list[int] | None, options.option("ROW", "A waypoint, from 0, that stays.")
    ] = None,
    answer: options.Answer,
) -> None:
    """Mend a trajectory until it is certified.

    Moves its waypoints; of a snake arm the tip stays on its path. Writes
    trajectory.csv, repair.json (how far each waypoint moved) and what verify writes;
    where no such trajectory is found, nothing, and says why.
    """
    from vdsm_pin.app.repair import repair_to_folder
    from vdsm_pin.app.workflow import VerifyOrder
    from vdsm_pin.report.terminal import show_verification

    read_as = motion.read_as()
    with enforced(read_as.deadline, grace=0.0):
        problem = asked.read(errors.box(), {}, motion.topic)
    with enforced(read_as.deadline):
        order = VerifyOrder(
            problem, motion.trajectory, out, context.obj, options=read_as
        )
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
