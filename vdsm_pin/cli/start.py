"""What a beginner asks first: problems, new and doctor; and schema and urdf."""

import shlex
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from vdsm_pin.cli import options
from vdsm_pin.text import printable

commands = options.Family()


def _kinds_from(incomplete: str) -> list[str]:
    from vdsm_pin.app.new_project import KINDS

    return options.from_words(KINDS)(incomplete)


def _schemas_from(incomplete: str) -> list[str]:
    from vdsm_pin.report.files import SCHEMA_NAMES

    return options.from_words(SCHEMA_NAMES)(incomplete)


@commands.add("vdsm problems", "vdsm problems --show paper/obs1 > mine.yaml")
def problems(
    show: Annotated[
        str | None,
        options.option(
            "NAME", "Print this problem's file.", autocompletion=options.problems_from
        ),
    ] = None,
) -> None:
    """List the built-in problems, or print one."""
    from vdsm_pin.io.problem_file import built_in_names, built_in_text

    names = "\n".join(built_in_names()) + "\n"
    typer.echo(names if show is None else built_in_text(show), nl=False)


@commands.add("vdsm new mine", "vdsm new cell --from robot")
def new(
    folder: Annotated[
        Path, typer.Argument(metavar="NAME", help="Folder to make; names the problem.")
    ],
    kind: Annotated[
        str,
        typer.Option(
            "--from",
            metavar="KIND",
            help="snake, port, robot or paper.",
            autocompletion=_kinds_from,
        ),
    ] = "snake",
    *,
    answer: options.Answer,
) -> None:
    """Make a folder with a problem to start from."""
    from vdsm_pin.app.new_project import new_project

    files = new_project(folder, kind)
    words = ["vdsm", "plan", str(folder / "problem.yaml")]
    if kind == "robot":
        words = ["vdsm", "verify", words[-1], "--trajectory", str(folder / "plan.csv")]
    then = shlex.join([*words, "--out", str(folder / "out")])
    text = f"made {folder} with {', '.join(files)}; next:\n  {then}"
    answer.tell(text, folder=folder, files=files, next=then)


@commands.add("vdsm doctor")
def doctor(*, answer: options.Answer) -> None:
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
    options.end(passed=not lacking)


@commands.add("vdsm schema verification")
def schema(
    name: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            help="problem, certificate, verification, plan, manifest or timing.",
            autocompletion=_schemas_from,
        ),
    ] = "problem",
) -> None:
    """Print the JSON Schema of a file.

    Of a certificate it is that of each line.
    """
    from vdsm_pin.report.files import schema, schema_text

    typer.echo(schema_text(schema(name)), nl=False)


@commands.add("vdsm urdf hrm8 --out hrm8.urdf", "vdsm urdf mine.yaml --out a.urdf")
def urdf(
    name: Annotated[
        str,
        typer.Argument(metavar="ARM", help="A built-in arm, or a problem for its arm."),
    ],
    out: Annotated[Path, typer.Option("--out", metavar="FILE", help="The URDF.")],
    *,
    answer: options.Answer,
) -> None:
    """Write the URDF of an arm, and beside it the SRDF.

    The SRDF lists the pairs of links that the arm does not hold apart.
    """
    from vdsm_pin.app.problems import read_problem
    from vdsm_pin.arm.manipulator import BUILT_IN, built_in
    from vdsm_pin.arm.urdf_writer import mesh_names, srdf_text, urdf_text
    from vdsm_pin.io.atomic import atomic_path
    from vdsm_pin.io.problem_file import built_in_names
    from vdsm_pin.report.folder import check_outputs
    from vdsm_pin.report.solids import obj_text

    known = name in BUILT_IN or name in built_in_names() or Path(name).exists()
    if not known:
        built_in(name)  # which says what arms there are
    problem = None if name in BUILT_IN else read_problem(name)
    arm = BUILT_IN[name] if problem is None else problem.manipulator
    texts = {out: urdf_text(arm), out.with_suffix(".srdf"): srdf_text(arm)}
    shapes = {solid.name: solid for _, solid in arm.carried}
    files = {
        out.with_name(file): obj_text(shapes[body])
        for body, file in mesh_names(arm).items()
    }
    read = () if problem is None else problem.files
    others = [*[*texts][1:], *files]
    outputs = (out, (".urdf", ".xml")), *((file, ()) for file in others)
    check_outputs(read, files=outputs)
    for file, content in {**files, **texts}.items():
        with atomic_path(file) as path:
            path.write_text(content, encoding="utf-8")
    made = [str(file) for file in (*texts, *files)]
    answer.tell(f"wrote {', '.join(made)}", files=made)
