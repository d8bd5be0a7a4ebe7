"""`vdsm explain`."""

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

commands = family()


@commands.command(
    epilog=examples(
        "vdsm explain paper/obs1 --out out/explain",
        "vdsm explain paper/obs3 --waypoint 300 --out out/explain",
    )
)
@grouped
def explain(
    problem: ProblemArgument,
    out: OutFolder,
    waypoint: Annotated[
        int | None,
        typer.Option(
            min=0,
            metavar="NUMBER",
            help="From 0; the one with the largest link angle if none.",
        ),
    ] = None,
    *,
    answer: Answer,
) -> None:
    """Follow the paper's seven steps at one waypoint.

    Plans by the strategy `paper` and writes explain.html: numbers and a picture of
    every step.
    """
    from vdsm_pin.app.explanation.folder import explain_to_folder
    from vdsm_pin.io.problem_file import read_problem

    page, row = explain_to_folder(read_problem(problem), waypoint, out)
    answer.tell(f"waypoint {row}: wrote {page}", waypoint=int(row), page=page)
