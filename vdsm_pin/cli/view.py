"""`vdsm view`."""

from pathlib import Path
from typing import Annotated

import typer

from vdsm_pin.cli.options import ProblemArgument, ShownMotion, examples, family

commands = family()


@commands.command(
    epilog=examples(
        "vdsm view paper/obs1 --trajectory out/obs1/trajectory.csv",
        "vdsm view paper/obs1 --html obs1.html",
    ),
)
def view(
    problem: ProblemArgument,
    trajectory: ShownMotion = None,
    html: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Write the page to this file; serve nothing."
        ),
    ] = None,
    port: Annotated[
        int,
        typer.Option(
            min=0, max=65535, metavar="NUMBER", help="Port to serve on; 0 for any."
        ),
    ] = 7000,
    watch: Annotated[
        bool, typer.Option("--watch", help="Reload the page when a file changes.")
    ] = False,
) -> None:
    """Show a motion in 3D in the browser.

    Serves a page to this machine until Ctrl-C, or writes it with --html.
    """
    from vdsm_pin.app.visualization import serve, write_page

    if html is not None:
        write_page(html, problem, trajectory)
        typer.echo(f"wrote {html}")
        return
    serve(problem, trajectory, port=port, watch=watch, announce=typer.echo)
