"""`vdsm check-certificate`."""

from pathlib import Path
from typing import Annotated

import typer

from vdsm_pin.cli.options import ProblemArgument, examples, family

commands = family()


@commands.command(
    "check-certificate",
    epilog=examples("vdsm check-certificate mine.certificate mine.yaml mine.csv"),
)
def check_certificate(
    certificate: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="Written by vdsm verify --certificate."),
    ],
    problem: ProblemArgument,
    trajectory: Annotated[
        Path,
        typer.Argument(metavar="TRAJECTORY", help="The motion that it is about."),
    ],
) -> None:
    """Recheck a certificate.

    The checker is a second program that shares only the reading of files with the
    verifier.
    """
    from vdsm_pin.certificate_checker import main as check
    from vdsm_pin.progress import shown, step

    with shown(lines=False):
        step("recomputing every claim")
        status = check([str(certificate), problem, str(trajectory)])
    raise typer.Exit(status)
