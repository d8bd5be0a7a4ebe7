"""`vdsm diff`."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from vdsm_pin.cli.options import NOT_PASSED, PASSED, Answer, examples, family, grouped

commands = family()


@commands.command(epilog=examples("vdsm diff out/monday out/tuesday"))
@grouped
def diff(
    old: Annotated[
        Path,
        typer.Argument(metavar="OLD", help="A result folder of vdsm batch or verify."),
    ],
    new: Annotated[Path, typer.Argument(metavar="NEW", help="A newer one.")],
    *,
    answer: Answer,
) -> None:
    """Compare two result folders.

    Exit status 1 if anything got worse.
    """
    from vdsm_pin.report.diff import compare_folders, diff_lines

    changes = compare_folders(old, new)
    worse = any(one.worse for one in changes)
    told = [asdict(one) for one in changes]
    answer.tell("\n".join(diff_lines(changes)), worse=worse, changes=told)
    raise typer.Exit(NOT_PASSED if worse else PASSED)
