"""`vdsm batch`."""

from pathlib import Path
from typing import Annotated, Literal, NamedTuple

import typer

from vdsm_pin.cli import options
from vdsm_pin.cli.ending import INTERRUPTED, fail
from vdsm_pin.errors import InvalidInput
from vdsm_pin.planner.strategies import DEFAULT_STRATEGY
from vdsm_pin.time_limit import COLD_PLAN_LIMIT

commands = options.Family()


class Motions(NamedTuple):
    """What is judged, see `options.grouped`: plans, or motions that are given."""

    strategy: options.Strategy = DEFAULT_STRATEGY
    trajectories: Annotated[
        list[str] | None,
        options.option(
            "FILE",
            "Given motions, or folders of them: each is verified for each "
            "problem, nothing is planned; robots of a URDF need it.",
        ),
    ] = None
    interpolation: options.Interpolation = "auto"

    def words(self) -> tuple[str, ...]:
        """The interpolation as on a command line, nothing where it was left out.

        Raises:
            InvalidInput: If it was given without motions.
        """
        if self.interpolation == "auto":
            return ()
        if not self.trajectories:
            message = "--interpolation has no meaning without --trajectories"
            raise InvalidInput(message)
        return "--interpolation", self.interpolation


class Running(NamedTuple):
    """How the work is done, see `options.grouped`."""

    jobs: Annotated[int, options.option("NUMBER", "Processes.", min=1)] = 1
    resume: Annotated[
        bool,
        typer.Option("--resume", help="Skip problems that are finished and intact."),
    ] = False
    time_limit: options.PlanningTime = None
    scheduler: Annotated[
        str | None,
        options.option("ADDRESS", "A Dask scheduler, as tcp://host:8786; no --jobs."),
    ] = None


class Written(NamedTuple):
    """What is written, see `options.grouped`."""

    keep: Annotated[
        Literal["all", "failed", "none"],
        options.option(None, "Whose files stay; every problem keeps its row."),
    ] = "all"
    certificate: Annotated[
        bool, typer.Option("--certificate", help="Write a proof of each to its folder.")
    ] = False
    pdf: Annotated[
        bool, typer.Option("--pdf", help="Print each report to its folder too.")
    ] = False


@commands.add(
    "vdsm batch --out out/demo",
    "vdsm batch problems/*.yaml --out out/night --jobs 8 --time-limit 60 --resume",
    "vdsm batch cell.yaml --trajectories plans --out out/plans",
)
def batch(
    out: options.OutFolder = Path("out"),
    *,
    problems: Annotated[
        list[str] | None,
        options.problem_argument(
            "Built-in names, problem files or folders of them; the built-in problems "
            "if there is none."
        ),
    ] = None,
    motions: Motions,
    running: Running,
    written: Written,
    errors: options.AllErrorOptions,
    answer: options.Answer,
) -> None:
    """Plan and verify many problems.

    Each gets a folder with its report; summary.csv, junit.xml and index.html show all.
    """
    import json

    from vdsm_pin.app.first_plan import default_limit
    from vdsm_pin.batch.folders import passed_over
    from vdsm_pin.batch.run import Batch, Interrupted, run_batch
    from vdsm_pin.batch.task import TaskSettings
    from vdsm_pin.report.words import outcome
    from vdsm_pin.text import printable

    limit = running.time_limit
    if limit is None:  # machines of a cluster may have no machine code yet
        limit = COLD_PLAN_LIMIT if running.scheduler else default_limit()
    settings = TaskSettings(
        strategy=motions.strategy,
        errors=errors.box(),
        words=errors.words() + motions.words(),
        interpolation=motions.interpolation,
        resume=running.resume,
        time_limit=limit,
        **written._asdict(),
    )
    asked = Batch(
        problems=tuple(problems or ()),
        folder=out,
        settings=settings,
        jobs=running.jobs,
        scheduler=running.scheduler,
        quiet=answer.wordless,
        trajectories=tuple(motions.trajectories or ()),
    )
    for folder in passed_over(asked.problems):
        note = "is in a folder that was named, and passed over; name it too to do it"
        typer.echo(printable(f"note: {folder} {note}"), err=True)
    try:
        rows = run_batch(asked)
    except Interrupted as error:
        fail(error, INTERRUPTED)
    passed = sum(outcome(row.outcome).passed for row in rows)
    if answer.as_json:
        typer.echo(json.dumps([row.model_dump() for row in rows], indent=2))
    elif not answer.quiet:
        typer.echo(f"{passed} of {len(rows)} certified; see {out / 'index.html'}")
    options.end(passed=passed == len(rows))
