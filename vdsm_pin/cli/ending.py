"""How the command ends: exit codes, and errors as messages."""

import os
import sys
from contextlib import suppress
from typing import Final, NoReturn

import typer

from vdsm_pin.text import printable

BAD_INPUT: Final = 2
INTERRUPTED: Final = 130
PIPE_CLOSED: Final = 141
"""As a shell reports whoever is ended by SIGPIPE; all files are written by then."""

MOST_TOLD: Final = 50
"""Faults of one file that are told, the most likely first; of the others how many."""


def fail(error: Exception, status: int) -> NoReturn:
    """Say what went wrong, each part on a line of its own on a terminal, and end."""
    with suppress(OSError):  # of a disk that is full, say; the status still tells
        between = "\n  " if sys.stderr.isatty() else "; "
        every = (error, *getattr(error, "others", ()))
        for one in every[:MOST_TOLD]:
            told = getattr(one, "alone", one)
            typer.echo(printable(f"vdsm: {told}").replace("; ", between), err=True)
        if len(every) > MOST_TOLD:
            typer.echo(f"vdsm: and {len(every) - MOST_TOLD} more", err=True)
    sys.exit(status)


def nobody_reads() -> NoReturn:
    """End because the reader of our output has gone, which is no verdict."""
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())  # for what Python flushes at its end
    sys.exit(PIPE_CLOSED)
