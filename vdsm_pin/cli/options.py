"""What commands share: arguments and options, exit codes, help pages."""

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import wraps
from inspect import Parameter, Signature, signature
from itertools import pairwise
from pathlib import Path
from typing import (
    TYPE_CHECKING,
    Annotated,
    Any,
    Final,
    Literal,
    NamedTuple,
    NoReturn,
    TypeAlias,
)

import typer
from typer.core import TyperCommand

from vdsm_pin.errors import InvalidInput
from vdsm_pin.planner.strategies import STRATEGIES
from vdsm_pin.text import plain_number
from vdsm_pin.time_limit import COLD_PLAN_LIMIT, PLAN_LIMIT, Deadline

if TYPE_CHECKING:
    from vdsm_pin.app.motions import MotionOptions
    from vdsm_pin.problem.error_boxes import ErrorBox

PASSED: Final = 0
NOT_PASSED: Final = 1

Run: TypeAlias = Callable[..., None]
"""What a command does."""


def from_words(words: Iterable[str]) -> Callable[[str], list[str]]:
    """Completes what is one of some words."""

    def completed(incomplete: str) -> list[str]:
        return [word for word in words if word.startswith(incomplete)]

    return completed


def problems_from(incomplete: str) -> list[str]:
    """Built-in problems; where there is none, the shell goes on with files."""
    from vdsm_pin.io.problem_file import built_in_names

    return from_words(built_in_names())(incomplete)


def problem_argument(help: str) -> Any:
    """An argument that is a problem, or several."""
    return typer.Argument(metavar="PROBLEM", help=help, autocompletion=problems_from)


def option(metavar: str | None, help: str, **how: Any) -> Any:
    """An option that is called as its parameter, and what its value is called."""
    return typer.Option(metavar=metavar, help=help, **how)


ProblemArgument = Annotated[str, problem_argument("A built-in name or a problem file.")]
OutFolder = Annotated[
    Path, typer.Option("--out", metavar="FOLDER", help="Where the results go.")
]
Trajectory = Annotated[
    Path,
    option(
        "FILE",
        "The motion: rows of joint values (CSV); of a robot YAML, JSON, bags too.",
    ),
]
ShownMotion = Annotated[
    Path | None, option("FILE", "The motion (CSV); the arm at its start if none.")
]
Strategy = Annotated[
    str,
    option(
        "NAME",
        f"One of {', '.join(STRATEGIES)}.",
        autocompletion=from_words(STRATEGIES),
    ),
]
SlideErrors = Annotated[
    str,
    option(
        "MM",
        "Largest error of a robot's joints that slide, or JOINT=MM[,JOINT=MM..] [mm].",
    ),
]
PlanningTime = Annotated[
    float | None,
    option(
        "SECONDS",
        "When to give up, in a batch on each problem; inf for never. By default "
        f"{PLAN_LIMIT:g}, and {COLD_PLAN_LIMIT:g} for the first plan here (it "
        "compiles) and on a cluster.",
        min=0.001,
    ),
]
Interpolated: TypeAlias = Literal["auto", "linear", "cubic", "quintic"]
Interpolation = Annotated[
    Interpolated,
    option(
        None,
        "What joins waypoints: straight lines, or smooth pieces by the velocities "
        "(cubic) and accelerations (quintic) of the trajectory.",
    ),
]
Topic = Annotated[
    str | None, option("NAME[#K]", "Of a trajectory in a bag, and its message from 0.")
]
TimeLimit = Annotated[
    float | None, option("SECONDS", "When to give up; never by default.", min=0.001)
]


class MotionGiven(NamedTuple):
    """A motion as it was given, see `grouped`."""

    trajectory: Trajectory
    topic: Topic = None
    time_limit: TimeLimit = None

    def read_as(self, interpolation: Interpolated = "auto") -> "MotionOptions":
        """How its file is read, from now on in the time that was given."""
        from vdsm_pin.app.motions import MotionOptions

        return MotionOptions(Deadline.after(self.time_limit), interpolation, self.topic)


class Answer(NamedTuple):
    """How a command says what it did."""

    quiet: Annotated[bool, typer.Option("--quiet", help="Print errors only.")] = False
    as_json: Annotated[
        bool,
        typer.Option("--json", help="Print the result as JSON, for other programs."),
    ] = False

    @property
    def wordless(self) -> bool:
        """Whether no words for people are wanted."""
        return self.quiet or self.as_json

    def tell(self, text: str, **facts: Any) -> None:
        """Say it in words, as facts for other programs, or not at all."""
        self.tell_facts(**facts)
        if not self.wordless:
            typer.echo(text)

    def tell_facts(self, **facts: Any) -> None:
        """Say it as facts for other programs, if they are wanted."""
        if self.as_json:
            typer.echo(json.dumps(facts, indent=2, default=str))


def end(*, passed: bool) -> NoReturn:
    """End the command, by whether all is as it was asked."""
    raise typer.Exit(PASSED if passed else NOT_PASSED)


class _Command(TyperCommand):
    """A command that takes no option for the value of the option before it."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Take the command line apart."""
        named = {name: one for one in self.get_params(ctx) for name in one.opts}
        for name, word in pairwise(args):
            needs = name in named and not getattr(named[name], "is_flag", True)
            if needs and word.partition("=")[0] in named and word[0] == "-":
                message = f"{name} needs a value; {word} after it is an option"
                raise InvalidInput(message)
        return super().parse_args(ctx, args)


class Family(typer.Typer):
    """What the commands of one module are added to."""

    def __init__(self) -> None:
        # Without rich markup the help page is plain text and opens twice as fast.
        super().__init__(rich_markup_mode=None)

    def add(self, *examples: str) -> Callable[[Run], Run]:
        """Add a command, called as its function, with examples for its help page.

        Its parameters that are groups of options become these, see `grouped`.
        """
        # The first line keeps click from joining them.
        lines = ["\b", "Examples:", *(f"  {line}" for line in examples)]
        add = self.command(cls=_Command, epilog="\n".join(lines))
        return lambda run: add(grouped(run))


class ErrorOptions(NamedTuple):
    """Errors as they were given, see `grouped`."""

    joint_error_deg: Annotated[
        str,
        option(
            "DEG[,DEG..]",
            "Largest error of every joint angle, or one for each joint from the base "
            "[deg]; of some joints of a robot: JOINT=DEG[,JOINT=DEG..].",
        ),
    ] = "0"
    base_error_mm: Annotated[
        float, option("MM", "Largest shift of the base, any direction [mm].", min=0.0)
    ] = 0.0
    base_error_deg: Annotated[
        float,
        option("DEG", "Largest turn of the base about its origin [deg].", min=0.0),
    ] = 0.0
    obstacle_error_mm: Annotated[
        list[str] | None,
        option(
            "[NAME=]MM",
            "Largest error of the obstacles, or of one; again for another [mm].",
        ),
    ] = None
    obstacle_error_deg: Annotated[
        list[str] | None,
        option(
            "NAME=DEG",
            "Largest turn of an obstacle about its middle; again for another [deg].",
        ),
    ] = None

    def box(self, slide_mm: str = "0") -> "ErrorBox":
        """The error box that they say, with what joints that slide are off by.

        Raises:
            InvalidInput: If one is no number, or negative, or has no name and needs
                one.
        """
        from vdsm_pin.problem.error_boxes import TypedErrorBox

        shifts = by_name("--obstacle-error-mm", self.obstacle_error_mm or ())
        turns = by_name("--obstacle-error-deg", self.obstacle_error_deg or ())
        if "" in turns:
            message = "--obstacle-error-deg needs the obstacle's name, NAME=DEG"
            raise InvalidInput(message)
        slide = _of_joints("--slide-error-mm", slide_mm)
        if isinstance(slide, list):
            message = f"--slide-error-mm is {slide_mm!r}, expected a number or JOINT=MM"
            raise InvalidInput(message)
        return TypedErrorBox(
            joint_deg=_of_joints("--joint-error-deg", self.joint_error_deg),
            base_mm=self.base_error_mm,
            base_deg=self.base_error_deg,
            obstacle_mm=shifts.pop("", 0.0),
            obstacles_mm=shifts,
            obstacles_deg=turns,
            slide_mm=slide,
        )

    def words(self) -> tuple[str, ...]:
        """The options as on a command line, those that were left out missing."""
        found: list[str] = []
        for name, value in self._asdict().items():
            if value != self._field_defaults[name]:
                option = f"--{name.replace('_', '-')}"
                each = value if isinstance(value, list) else [value]
                found += [word for one in each for word in (option, str(one))]
        return tuple(found)


class AllErrorOptions(NamedTuple):
    """The same, and of a robot's joints that slide."""

    errors: ErrorOptions
    slide_error_mm: SlideErrors = "0"

    def box(self) -> "ErrorBox":
        """The error box that they say, as that of `ErrorOptions`."""
        return self.errors.box(self.slide_error_mm)

    def words(self) -> tuple[str, ...]:
        """The options as on a command line, those that were left out missing."""
        words = self.errors.words()
        if self.slide_error_mm != self._field_defaults["slide_error_mm"]:
            words += ("--slide-error-mm", self.slide_error_mm)
        return words


def grouped(command: Run) -> Run:
    """A command whose parameters that are groups of options become these options.

    A group is a `NamedTuple` of options and groups of them, some with defaults.
    """
    asked = [*signature(command).parameters.values()]

    @wraps(command)
    def run(**given: Any) -> None:
        command(**{one.name: _taken(one.name, one.annotation, given) for one in asked})

    parameters = [option for one in asked for option in _options_of(one)]
    run.__signature__ = Signature(parameters)  # type: ignore[attr-defined]
    run.__annotations__ = {one.name: one.annotation for one in parameters}
    return run


def _is_group(annotation: Any) -> bool:
    return isinstance(annotation, type) and hasattr(annotation, "_field_defaults")


def _options_of(asked: Parameter) -> Iterator[Parameter]:
    """A parameter itself, or those that a group of options stands for."""
    group = asked.annotation
    if not _is_group(group):
        yield asked.replace(kind=Parameter.KEYWORD_ONLY)
        return
    for name, kind in group.__annotations__.items():
        default = group._field_defaults.get(name, Parameter.empty)
        given = Parameter(name, asked.kind, default=default, annotation=kind)
        yield from _options_of(given)


def _taken(name: str, kind: Any, given: dict[str, Any]) -> Any:
    """The value of an option, or a group of the values of its options."""
    if not _is_group(kind):
        return given[name]
    fields = kind.__annotations__.items()
    return kind(*(_taken(field, its_kind, given) for field, its_kind in fields))


def _of_joints(option: str, text: str) -> float | list[float] | dict[str, float]:
    """One number, one for each joint, or some by name."""
    words = text.split(",")
    if "=" in text:
        named = by_name(option, words)
        if "" in named:
            message = f"{option} is {text!r}, expected a name before each number"
            raise InvalidInput(message)
        return named
    each = [by_name(option, [word])[""] for word in words]
    return each if len(each) > 1 else each[0]


def by_name(
    option: str,
    words: Sequence[str],
    least: float = 0.0,
    expected: str = "a number, 0 or more",
) -> dict[str, float]:
    """Numbers by the names before them; an empty name where there is none.

    Raises:
        InvalidInput: If one is no number or below the least, or a name is there twice.
    """
    found = {}
    for word in words:
        name, _, number = word.rpartition("=")
        if name in found:
            whose = repr(name) if name else "all obstacles"
            message = f"{option} is given twice for {whose}"
            raise InvalidInput(message)
        found[name] = plain_number(number)
        if not least <= found[name]:
            message = f"{option} is {word!r}, expected {expected}"
            raise InvalidInput(message)
    return found
