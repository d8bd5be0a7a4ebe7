"""What commands share: arguments and options, exit codes, help pages."""

from pathlib import Path
from typing import Annotated, Final

import typer

from vdsm_pin.planner.strategies import STRATEGIES

PASSED: Final = 0
NOT_PASSED: Final = 1

Problem = Annotated[
    str, typer.Argument(metavar="PROBLEM", help="A built-in name or a problem file.")
]
OutFolder = Annotated[Path, typer.Option("--out", help="Folder for the results.")]
Trajectory = Annotated[Path, typer.Option(help="A trajectory.csv.")]
Strategy = Annotated[str, typer.Option(help=f"How to plan: {', '.join(STRATEGIES)}.")]

JointError = Annotated[
    float, typer.Option(min=0.0, help="Largest error of every joint angle [deg].")
]
BaseError = Annotated[
    float, typer.Option(min=0.0, help="Largest shift of the base, any direction [mm].")
]
BaseTurn = Annotated[
    float,
    typer.Option(min=0.0, help="Largest turn of the base about its origin [deg]."),
]
ObstacleError = Annotated[
    float, typer.Option(min=0.0, help="Largest error of the obstacles [mm].")
]

PlanningTime = Annotated[
    float, typer.Option(min=0.001, help="Time limit in seconds; inf for none.")
]
TimeLimit = Annotated[
    float | None,
    typer.Option(min=0.001, help="Time limit in seconds, for each problem."),
]

Quiet = Annotated[bool, typer.Option("--quiet", help="Say nothing but errors.")]
AsJson = Annotated[
    bool, typer.Option("--json", help="Print the result as JSON, for other programs.")
]


def family() -> typer.Typer:
    """What the commands of one module are added to."""
    # Without rich markup the help page is plain text and opens twice as fast.
    return typer.Typer(rich_markup_mode=None)


def examples(*lines: str) -> str:
    """Examples for a help page; the first line keeps click from joining them."""
    return "\n".join(["\b", "Examples:", *(f"  {line}" for line in lines)])
