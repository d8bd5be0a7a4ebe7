"""`vdsm view`, `vdsm export`: a motion as it looks."""

from pathlib import Path
from typing import Annotated, Final, NamedTuple

import typer

from vdsm_pin.cli import options
from vdsm_pin.cli.robot import refuse_beside

commands = options.Family()

PORT: Final = 7000
"""Where a page is served."""

WIDTH, HEIGHT, OVERVIEW = 1280, 720, "overview"
"""How a picture is, unless asked for otherwise."""


@commands.add(
    "vdsm view paper/obs1 --trajectory out/obs1/trajectory.csv",
    "vdsm view paper/obs1 --html obs1.html",
)
def view(
    problem: options.ProblemArgument,
    trajectory: options.ShownMotion = None,
    html: Annotated[
        Path | None,
        options.option("FILE", "Write the page to this file; serve nothing."),
    ] = None,
    port: Annotated[
        int, options.option("NUMBER", "Port to serve on; 0 for any.", min=0, max=65535)
    ] = PORT,
    watch: Annotated[
        bool, typer.Option("--watch", help="Reload the page when a file changes.")
    ] = False,
) -> None:
    """Show a motion in 3D in the browser.

    Serves a page to this machine until Ctrl-C, or writes it with --html.
    """
    from vdsm_pin.app.visualization import serve, write_page

    if html is not None:
        refuse_beside("--html", {"--watch": watch, "--port": port != PORT})
        write_page(html, problem, trajectory)
        typer.echo(f"wrote {html}")
        return
    serve(problem, trajectory, port=port, watch=watch, announce=typer.echo)


class Picture(NamedTuple):
    """How it looks, see `options.grouped`."""

    look: Annotated[
        str,
        options.option(
            "VIEW", "overview, side, top, front, tip, or a direction: 1,-1,0.5."
        ),
    ] = OVERVIEW
    width: Annotated[
        int, options.option("PIXELS", "Of the picture.", min=64, max=4096)
    ] = WIDTH
    height: Annotated[
        int, options.option("PIXELS", "Of the picture.", min=64, max=4096)
    ] = HEIGHT
    numbers: Annotated[bool, typer.Option("--numbers", help="Number the links.")] = (
        False
    )

    @property
    def given(self) -> dict[str, object]:
        """What was asked for, by the names of the command line."""
        return {
            "--look": self.look != OVERVIEW,
            "--numbers": self.numbers,
            "--width": self.width != WIDTH,
            "--height": self.height != HEIGHT,
        }


@commands.add(
    "vdsm export paper/obs1 --trajectory out/obs1/trajectory.csv --out obs1.glb",
    "vdsm export mine.yaml --trajectory mine.csv --out mine.png --moment 120",
    "vdsm export mine.yaml --trajectory mine.csv --out mine.mp4 --look tip",
)
def export(
    problem: options.ProblemArgument,
    out: Annotated[
        Path,
        options.option("FILE", ".glb (glTF), .png or .mp4 (needs ffmpeg)."),
    ],
    trajectory: options.ShownMotion = None,
    moment: Annotated[
        float | None,
        options.option(
            "WAYPOINT", "Of a .png; 12.5 is between two; 0 by default.", min=0.0
        ),
    ] = None,
    seconds: Annotated[
        float | None,
        options.option(
            "SECONDS",
            "How long it plays; as the trajectory's times say, or 10.",
            min=0.1,
            max=86400.0,
        ),
    ] = None,
    *,
    picture: Picture,
    answer: options.Answer,
) -> None:
    """Write a motion as glTF, as a picture or as a film.

    PNG and MP4 are drawn by a Chromium or Chrome of this machine, without a window.
    """
    from vdsm_pin.app.export import export as write
    from vdsm_pin.app.subjects import read_problem_or_cell
    from vdsm_pin.problem.planning_problem import PlanningProblem
    from vdsm_pin.report.film import Shot, look_of

    ending = out.suffix.lower()
    unused: dict[str, dict[str, object]] = {
        ".glb": {"--moment": moment, **picture.given},
        ".png": {"--seconds": seconds},
        ".mp4": {"--moment": moment},
    }
    refuse_beside(ending, unused.get(ending, {}))
    odd = 2 if ending == ".mp4" else 1  # players need even numbers
    width, height = (n - n % odd for n in (picture.width, picture.height))
    shot = Shot(look_of(picture.look), width, height, picture.numbers)
    asked = read_problem_or_cell(problem)
    if picture.look == "tip" and not isinstance(asked, PlanningProblem):
        refuse_beside("a robot", {"--look tip": picture.look})
    write(asked, trajectory, out, moment or 0.0, seconds, shot)
    answer.tell(f"wrote {out}", file=out)
