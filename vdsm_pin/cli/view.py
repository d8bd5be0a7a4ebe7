"""`vdsm view`."""

from pathlib import Path
from typing import Annotated

import typer

from vdsm_pin.cli.options import Problem, examples, family

commands = family()


@commands.command(
    epilog=examples(
        "vdsm view paper/obs1 --trajectory out/obs1/trajectory.csv",
        "vdsm view paper/obs1 --html obs1.html",
    ),
)
def view(
    problem: Problem,
    trajectory: Annotated[
        Path | None, typer.Option(help="A trajectory.csv; without it the start.")
    ] = None,
    html: Annotated[Path | None, typer.Option(help="Write a page and end.")] = None,
    port: Annotated[
        int, typer.Option(min=0, max=65535, help="Port to serve on; 0 for any.")
    ] = 7000,
    watch: Annotated[
        bool, typer.Option("--watch", help="Reload when a file changes.")
    ] = False,
) -> None:
    """Show a motion in 3D in the browser."""
    from vdsm_pin.app.visualization import serve, write_page

    if html is not None:
        write_page(html, problem, trajectory)
        typer.echo(f"wrote {html}")
        return
    serve(problem, trajectory, port=port, watch=watch, announce=typer.echo)
