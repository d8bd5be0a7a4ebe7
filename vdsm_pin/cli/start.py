"""What a beginner asks first: `vdsm problems`, `vdsm new`, `vdsm doctor`."""

import shlex
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from vdsm_pin.cli.options import NOT_PASSED, PASSED, Answer, examples, family, grouped
from vdsm_pin.text import printable

commands = family()


@commands.command(
    epilog=examples(
        "vdsm problems",
        "vdsm problems --show paper/obs1 > mine.yaml",
    ),
)
def problems(
    show: Annotated[
        str | None, typer.Option(metavar="NAME", help="Print this problem's file.")
    ] = None,
) -> None:
    """List the built-in problems, or print one."""
    from vdsm_pin.io.problem_file import built_in_names, built_in_text

    names = "\n".join(built_in_names()) + "\n"
    typer.echo(names if show is None else built_in_text(show), nl=False)


@commands.command(epilog=examples("vdsm new mine", "vdsm new cell --from robot"))
@grouped
def new(
    folder: Annotated[
        Path, typer.Argument(metavar="NAME", help="Folder to make; names the problem.")
    ],
    kind: Annotated[
        str, typer.Option("--from", metavar="KIND", help="snake, port, robot or paper.")
    ] = "snake",
    *,
    answer: Answer,
) -> None:
    """Make a folder with a problem to start from."""
    from vdsm_pin.app.new_project import new_project

    files = new_project(folder, kind)
    words = ["vdsm", "plan", str(folder / "problem.yaml")]
    if kind == "robot":
        words = ["vdsm", "verify", words[-1], "--trajectory", str(folder / "plan.csv")]
    then = f"{shlex.join(words)} --out out"
    text = f"made {folder} with {', '.join(files)}; next:\n  {then}"
    answer.tell(text, folder=folder, files=files, next=then)


@commands.command(epilog=examples("vdsm doctor"))
@grouped
def doctor(*, answer: Answer) -> None:
    """Say what this installation can do and lacks.

    A line for each part, with the way to get what is missing.

    Exit status 1 if planning or verification lacks something.
    """
    from vdsm_pin.app.doctor import examine

    findings, lines = examine(), []
    for one in findings:
        sign = "✓" if one.works else "✗" if one.needed else "–"
        remedy = f"; {one.remedy}" if one.remedy else ""
        lines.append(printable(f"{sign} {one.what:<14} {one.found}{remedy}"))
    answer.tell("\n".join(lines), findings=[asdict(one) for one in findings])
    lacking = any(one.needed and not one.works for one in findings)
    raise typer.Exit(NOT_PASSED if lacking else PASSED)
