"""What commands share: arguments and options, exit codes, help pages."""

import math
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

import typer

from vdsm_pin.errors import InvalidInput
from vdsm_pin.planner.strategies import STRATEGIES

if TYPE_CHECKING:
    from vdsm_pin.problem.error_boxes import ErrorBox

PASSED: Final = 0
NOT_PASSED: Final = 1

Problem = Annotated[
    str, typer.Argument(metavar="PROBLEM", help="A built-in name or a problem file.")
]
OutFolder = Annotated[
    Path, typer.Option("--out", metavar="FOLDER", help="Where the results go.")
]
Trajectory = Annotated[
    Path, typer.Option(metavar="FILE", help="The motion: rows of joint values (CSV).")
]
ShownMotion = Annotated[
    Path | None,
    typer.Option(
        metavar="FILE", help="The motion (CSV); the arm at its start if none."
    ),
]
Strategy = Annotated[
    str, typer.Option(metavar="NAME", help=f"One of {', '.join(STRATEGIES)}.")
]

JointError = Annotated[
    float,
    typer.Option(
        min=0.0, metavar="DEG", help="Largest error of every joint angle [deg]."
    ),
]
BaseError = Annotated[
    float,
    typer.Option(
        min=0.0, metavar="MM", help="Largest shift of the base, any direction [mm]."
    ),
]
BaseTurn = Annotated[
    float,
    typer.Option(
        min=0.0, metavar="DEG", help="Largest turn of the base about its origin [deg]."
    ),
]
ObstacleError = Annotated[
    float,
    typer.Option(min=0.0, metavar="MM", help="Largest error of the obstacles [mm]."),
]

JointErrors = Annotated[
    str,
    typer.Option(
        metavar="DEG[,DEG..]",
        help="Largest error of every joint angle, or one for each joint from the base "
        "[deg]; of some joints of a robot: JOINT=DEG[,JOINT=DEG..].",
    ),
]
SlideErrors = Annotated[
    str,
    typer.Option(
        metavar="MM",
        help="Largest error of a robot's joints that slide, or JOINT=MM[,JOINT=MM..] "
        "[mm].",
    ),
]
ObstacleErrors = Annotated[
    list[str] | None,
    typer.Option(
        metavar="[NAME=]MM",
        help="Largest error of the obstacles, or of one; again for another [mm].",
    ),
]
ObstacleTurns = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=DEG",
        help="Largest turn of an obstacle about its middle; again for another [deg].",
    ),
]

PlanningTime = Annotated[
    float | None,
    typer.Option(
        min=0.001,
        metavar="SECONDS",
        help="When to give up; 60 by default, 600 until a first plan has been made, "
        "inf for never.",
    ),
]
TimeLimit = Annotated[
    float | None,
    typer.Option(
        min=0.001,
        metavar="SECONDS",
        help="When to give up; in a batch, on each problem.",
    ),
]

Quiet = Annotated[bool, typer.Option("--quiet", help="Print errors only.")]
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


def errors_of(
    joint_deg: str,
    base_mm: float,
    base_deg: float,
    obstacles_mm: Sequence[str] | None,
    obstacles_deg: Sequence[str] | None,
    slide_mm: str = "0",
) -> "ErrorBox":
    """The error box that a user types.

    Raises:
        InvalidInput: If one is no number, or negative, or has no name and needs one.
    """
    from vdsm_pin.problem.error_boxes import ErrorBox

    shifts = _by_name("--obstacle-error-mm", obstacles_mm or ())
    turns = _by_name("--obstacle-error-deg", obstacles_deg or ())
    if "" in turns:
        message = "--obstacle-error-deg needs the obstacle's name, NAME=DEG"
        raise InvalidInput(message)
    slide = _of_joints("--slide-error-mm", slide_mm)
    if isinstance(slide, list):
        message = f"--slide-error-mm is {slide_mm!r}, expected a number or JOINT=MM"
        raise InvalidInput(message)
    return ErrorBox.typed(
        _of_joints("--joint-error-deg", joint_deg),
        base_mm,
        shifts.pop("", 0.0),
        base_deg,
        shifts,
        turns,
        slide,
    )


def _of_joints(option: str, text: str) -> float | list[float] | dict[str, float]:
    """One number, one for each joint, or some by name."""
    words = text.split(",")
    if "=" in text:
        named = _by_name(option, words)
        if "" in named:
            message = f"{option} is {text!r}, expected a name before each number"
            raise InvalidInput(message)
        return named
    each = [_number(option, word) for word in words]
    return each if len(each) > 1 else each[0]


def _by_name(option: str, words: Sequence[str]) -> dict[str, float]:
    """Numbers by the names before them; an empty name where there is none."""
    found = {}
    for word in words:
        name, _, number = word.rpartition("=")
        if name in found:
            message = f"{option} is given twice for {name or 'all obstacles'}"
            raise InvalidInput(message)
        found[name] = _number(option, number)
    return found


def _number(option: str, word: str) -> float:
    with suppress(ValueError):
        if 0.0 <= (value := float(word)) < math.inf:
            return value
    message = f"{option} is {word!r}, expected a number, 0 or more"
    raise InvalidInput(message)
