"""`vdsm plan`."""

import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import replace

import typer

from vdsm_pin.cli import options
from vdsm_pin.errors import Infeasible, NoPlanFound, OutOfTime
from vdsm_pin.planner.strategies import DEFAULT_STRATEGY
from vdsm_pin.time_limit import PLAN_LIMIT, Deadline, enforced

commands = options.Family()


@commands.add(
    "vdsm plan paper/obs1 --out out/obs1",
    "vdsm plan paper/obs1 --joint-error-deg 0.1 --out out/sturdy",
)
def plan(
    context: typer.Context,
    problem: options.ProblemArgument,
    out: options.OutFolder,
    *,
    strategy: options.Strategy = DEFAULT_STRATEGY,
    errors: options.ErrorOptions,
    time_limit: options.PlanningTime = None,
    answer: options.Answer,
) -> None:
    """Plan a motion.

    Writes trajectory.csv, centres.csv, cables.csv, plan.json and report.html, or
    no_plan.html where there is no plan. A plan that draws less of the path than
    required is written, is called incomplete, and ends with status 1. Errors are added
    to those of the problem file; the plan keeps its clearances under them.
    """
    from vdsm_pin.app.first_plan import note_planned
    from vdsm_pin.app.problems import read_problem
    from vdsm_pin.app.workflow import plan_to_folder
    from vdsm_pin.progress import shown
    from vdsm_pin.report.terminal import show_plan
    from vdsm_pin.report.words import outcome

    box = errors.box()
    with _planning(time_limit) as deadline:
        with enforced(deadline, grace=0.0):
            asked = read_problem(problem).under(box)
        told = nullcontext() if answer.wordless else shown(limit=deadline.limit)
        with enforced(deadline), told:
            file = plan_to_folder(asked, strategy, out, context.obj, deadline)
        if asked.scene.obstacles:  # without any, little is compiled
            note_planned()
    if answer.as_json:
        typer.echo(file.text(), nl=False)
    elif not answer.quiet:
        show_plan(file, out)
    options.end(passed=outcome(file.verdict).passed)


@contextmanager
def _planning(limit: float | None) -> Iterator[Deadline]:
    """Plan within a limit; None for the default, longer where code is yet to be made.

    Where there is no plan, the error says what was spent on it.
    """
    from vdsm_pin.app.first_plan import default_limit, is_cold, note_planned

    compiles, begin = limit is None and is_cold(), time.monotonic()
    try:
        deadline = Deadline.after(default_limit() if limit is None else limit)
        yield replace(deadline, patience=PLAN_LIMIT) if compiles else deadline
    except (Infeasible, OutOfTime) as error:
        if isinstance(error, OutOfTime | NoPlanFound):
            error.heading = "no plan found: "
        if isinstance(error, OutOfTime) and compiles:
            error.more += ("compiling took part of it, the next plan is quicker",)
            note_planned()
        if isinstance(error, NoPlanFound):
            error.more += (f"searched for {time.monotonic() - begin:.1f} s",)
            note_planned()
        if error.page:
            error.more += (f"see {error.page}",)
        raise
