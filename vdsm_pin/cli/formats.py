"""What other programs read: `vdsm schema`, `vdsm urdf`."""

from pathlib import Path
from typing import Annotated

import typer

from vdsm_pin.cli.options import Answer, examples, family, grouped

commands = family()


@commands.command(epilog=examples("vdsm schema verification"))
def schema(
    name: Annotated[
        str,
        typer.Argument(
            metavar="FILE",
            help="problem, certificate, verification, plan, manifest or timing.",
        ),
    ] = "problem",
) -> None:
    """Print the JSON Schema of a file.

    Of a certificate it is that of each line.
    """
    from vdsm_pin.report.files import schema, schema_text

    typer.echo(schema_text(schema(name)), nl=False)


@commands.command(
    epilog=examples(
        "vdsm urdf hrm8 --out hrm8.urdf", "vdsm urdf mine.yaml --out a.urdf"
    )
)
@grouped
def urdf(
    name: Annotated[
        str,
        typer.Argument(metavar="ARM", help="A built-in arm, or a problem for its arm."),
    ],
    out: Annotated[Path, typer.Option("--out", metavar="FILE")],
    *,
    answer: Answer,
) -> None:
    """Write the URDF of an arm."""
    from vdsm_pin.app.problems import read_problem
    from vdsm_pin.arm.manipulator import BUILT_IN, built_in
    from vdsm_pin.arm.urdf_writer import mesh_names, urdf_text
    from vdsm_pin.io.atomic import atomic_path
    from vdsm_pin.io.problem_file import built_in_names
    from vdsm_pin.report.folder import check_kept, check_output_file
    from vdsm_pin.report.solids import obj_text

    known = name in BUILT_IN or name in built_in_names() or Path(name).exists()
    if not known:
        built_in(name)  # which says what arms there are
    problem = None if name in BUILT_IN else read_problem(name)
    arm = BUILT_IN[name] if problem is None else problem.manipulator
    text = urdf_text(arm)
    shapes = {solid.name: solid for _, solid in arm.carried}
    files = {
        out.with_name(file): obj_text(shapes[body])
        for body, file in mesh_names(arm).items()
    }
    for file in (out, *files):
        check_output_file(file)
    check_kept((out, *files), () if problem is None else problem.files)
    for file, content in {**files, out: text}.items():
        with atomic_path(file) as path:
            path.write_text(content, encoding="utf-8")
    made = [str(file) for file in (out, *files)]
    answer.tell(f"wrote {', '.join(made)}", files=made)
