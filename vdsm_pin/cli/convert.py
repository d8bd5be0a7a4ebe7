"""`vdsm convert`."""

from pathlib import Path
from typing import Annotated

import typer

from vdsm_pin.cli.options import OutFolder, Problem, examples, family

commands = family()


@commands.command(
    epilog=examples(
        "vdsm convert paper/obs1 --trajectory out/obs1/trajectory.csv --out out/all",
        "vdsm convert mine.yaml --cables measured.csv --out out/mine",
    )
)
def convert(
    problem: Problem,
    out: OutFolder,
    trajectory: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Joint angles, as trajectory.csv."),
    ] = None,
    centres: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Joint centres, as centres.csv.")
    ] = None,
    cables: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Cable lengths, as cables.csv.")
    ] = None,
) -> None:
    """Convert angles, centres and cable lengths.

    Takes joint angles, joint centres or cable lengths, and writes all of them:
    trajectory.csv, centres.csv and cables.csv. Nothing is judged.
    """
    from vdsm_pin.app.conversion import Given, convert_to_folder
    from vdsm_pin.io.problem_file import read_problem

    given = Given(trajectory, centres, cables)
    rows = convert_to_folder(read_problem(problem), given, out)
    typer.echo(f"wrote {rows.n_samples} waypoints to {out}")
