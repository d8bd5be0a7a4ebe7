"""`vdsm plan`."""

import time
from contextlib import nullcontext

import typer

from vdsm_pin.cli.options import (
    NOT_PASSED,
    PASSED,
    Answer,
    ErrorOptions,
    OutFolder,
    PlanningTime,
    ProblemArgument,
    Strategy,
    examples,
    family,
    grouped,
)
from vdsm_pin.errors import Infeasible, NoPlanFound, OutOfTime, VdsmError
from vdsm_pin.planner.strategies import DEFAULT_STRATEGY
from vdsm_pin.time_limit import Deadline, enforced

commands = family()


@commands.command(
    epilog=examples(
        "vdsm plan paper/obs1 --out out/obs1",
        "vdsm plan paper/obs1 --joint-error-deg 0.1 --out out/sturdy",
    )
)
@grouped
def plan(
    context: typer.Context,
    problem: ProblemArgument,
    out: OutFolder,
    *,
    strategy: Strategy = DEFAULT_STRATEGY,
    errors: ErrorOptions,
    time_limit: PlanningTime = None,
    answer: Answer,
) -> None:
    """Plan a motion.

    Writes trajectory.csv, centres.csv, cables.csv, plan.json and report.html, or
    no_plan.html where there is no plan. A plan that draws less of the path than
    required is written, is called incomplete, and ends with status 1. Errors are added
    to those of the problem file; the plan keeps its clearances under them.
    """
    from vdsm_pin.app.problems import read_problem
    from vdsm_pin.app.workflow import plan_to_folder
    from vdsm_pin.kept import default_limit, is_cold, note_planned
    from vdsm_pin.progress import shown
    from vdsm_pin.report.terminal import show_plan
    from vdsm_pin.report.words import outcome

    box, cold = errors.box(), time_limit is None and is_cold()
    limit = default_limit() if time_limit is None else time_limit
    deadline, begin = Deadline.after(limit), time.monotonic()
    try:
        with enforced(deadline, grace=0.0):
            asked = read_problem(problem).under(box)
        told = nullcontext() if any(answer) else shown(limit=limit)
        with enforced(deadline), told:
            file = plan_to_folder(asked, strategy, out, context.obj, deadline)
        if asked.scene.obstacles:  # without any, little is compiled
            note_planned()
    except OutOfTime as error:  # which tells its time itself
        compiled = "; compiling took part of it, the next plan is quicker"
        if cold:
            note_planned()
        said = f"no plan found: {error}{compiled if cold else ''}{_see(error)}"
        error.args = (said,)
        raise
    except NoPlanFound as error:
        note_planned()
        spent = time.monotonic() - begin
        said = f"no plan found: {error}; searched for {spent:.1f} s{_see(error)}"
        error.args = (said,)
        raise
    except Infeasible as error:
        error.args = (f"{error}{_see(error)}",)
        raise
    if answer.as_json:
        typer.echo(file.text(), nl=False)
    elif not answer.quiet:
        show_plan(file, out)
    raise typer.Exit(PASSED if outcome(file.verdict).passed else NOT_PASSED)


def _see(error: VdsmError) -> str:
    """Names the page that tells of an error, where there was time to write it."""
    return f"; see {error.page}" if error.page else ""
