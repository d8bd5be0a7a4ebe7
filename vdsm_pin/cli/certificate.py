"""`vdsm check-certificate`."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from vdsm_pin.cli.options import (
    NOT_PASSED,
    PASSED,
    Answer,
    ProblemArgument,
    examples,
    family,
    grouped,
)

commands = family()


@commands.command(
    "check-certificate",
    epilog=examples("vdsm check-certificate mine.certificate mine.yaml mine.csv"),
)
@grouped
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
    *,
    answer: Answer,
) -> None:
    """Recheck a certificate.

    The checker is a second program that shares only the reading of files with the
    verifier.
    """
    from vdsm_pin.certificate_checker import check_certificate as check
    from vdsm_pin.certificate_checker import main
    from vdsm_pin.progress import shown, step

    if any(answer):
        found = check(certificate, Path(problem), trajectory)
        answer.tell("", accepted=found.accepted, **asdict(found))
        raise typer.Exit(PASSED if found.accepted else NOT_PASSED)
    with shown(lines=False):
        step("recomputing every claim")
        status = main([str(certificate), problem, str(trajectory)])
    raise typer.Exit(status)
