"""`vdsm diff`."""

from pathlib import Path
from typing import Annotated

import typer

from vdsm_pin.cli.options import NOT_PASSED, PASSED, examples, family

commands = family()


@commands.command(epilog=examples("vdsm diff out/monday out/tuesday"))
def diff(
    old: Annotated[
        Path,
        typer.Argument(metavar="OLD", help="A result folder of vdsm batch or verify."),
    ],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="A newer one.")],
) -> None:
    """Compare two result folders.

    Exit status 1 if anything got worse.
    """
    from vdsm_pin.report.diff import compare_folders, diff_lines

    changes = compare_folders(old, new)
    typer.echo("\n".join(diff_lines(changes)))
    raise typer.Exit(NOT_PASSED if any(one.worse for one in changes) else PASSED)
