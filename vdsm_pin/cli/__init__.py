"""The `vdsm` command: arguments, exit codes and nothing else.

One module for commands that belong together. They import what they work with
inside the commands, so that `vdsm --help` answers at once.
"""

import shlex
import sys
from collections.abc import Sequence
from typing import Annotated, NoReturn

import typer

from vdsm_pin.cli import afterwards, batch, plan, start, verify, view
from vdsm_pin.cli.ending import BAD_INPUT, fail, nobody_reads
from vdsm_pin.cli.options import NOT_PASSED, PASSED
from vdsm_pin.errors import InvalidInput, VdsmError, lacks_memory
from vdsm_pin.startup import live_briefly
from vdsm_pin.text import show_everything

app = typer.Typer(
    rich_markup_mode=None,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    help="Plan motions of snake arms; prove those of any robot free of collisions.",
    epilog="Exit status: 0 certified; 1 incomplete, refuted, undecided or infeasible; "
    "2 bad input.",
)
for module in (plan, verify, batch, view, start, afterwards):
    app.add_typer(module.commands)


def _show_version(asked: bool) -> None:
    if asked:
        from vdsm_pin import __version__

        typer.echo(f"vdsm {__version__}")
        raise typer.Exit(PASSED)


@app.callback()
def vdsm(
    version: Annotated[
        bool,
        typer.Option(
            "--version", is_eager=True, callback=_show_version, help="Print it and end."
        ),
    ] = False,
) -> None:
    """Plan motions of snake arms; prove those of any robot free of collisions."""


def main(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run the command; every error raised on purpose becomes one message."""
    live_briefly()
    show_everything()
    given = list(sys.argv[1:] if arguments is None else arguments)
    try:
        for place, word in enumerate(given, 1):
            if not word or (word[:2] == "--" and word[-1] == "="):
                what = word or f"argument {place}"
                message = f"{what} is empty; is a variable not set?"
                raise InvalidInput(message)
        try:
            app(given, prog_name="vdsm", obj=shlex.join(["vdsm", *given]))
        finally:
            sys.stdout.flush()  # here a closed pipe is heard, later it is not
    except SystemExit as ended:
        if isinstance(ended.__context__, BrokenPipeError):  # as typer says it
            nobody_reads()
        raise
    except InvalidInput as error:
        fail(error, BAD_INPUT)
    except VdsmError as error:
        fail(error, NOT_PASSED)
    except BrokenPipeError:
        nobody_reads()
    except (OSError, ImportError, MemoryError) as error:
        _fail_beside(error)
    sys.exit(PASSED)


def _fail_beside(error: OSError | ImportError | MemoryError) -> NoReturn:
    """End for what is no fault of the input: a disk, a library, too little memory."""
    if lacks_memory(error):
        said = error if isinstance(error, MemoryError) else "a library has no room"
        told = f"there is too little memory; {said}".rstrip("; ")
        fail(MemoryError(told), BAD_INPUT)
    if isinstance(error, ImportError):
        if (error.name or "").startswith("vdsm_pin"):
            raise error
        fail(ImportError(f"{error}; vdsm doctor says what is missing"), NOT_PASSED)
    assert isinstance(error, OSError)  # no other is left
    where, why = error.filename, error.strerror or error
    fail(OSError(f"{where}: {why}" if where else str(why)), BAD_INPUT)
