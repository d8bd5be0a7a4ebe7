"""Text of unknown origin, made fit to be shown.

Names, values and messages from files reach terminals and reports. A file may hold signs
there that move a cursor, hide or turn text round, or that no encoding can write; every
message passes through here first.
"""

import math
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Final

LONGEST: Final = 4_000
"""Characters of one message; what a file holds may be longer."""


NAMED: Final = 8
"""Names of a phrase that lists them; of more it says how many."""

UNSEEN: Final = (
    r"\x00-\x1f\x7f-\x9f\xad\u061c\u200b\u200e\u200f\u2028-\u202e\u2060-\u206f\ufeff"
)
"""Signs that cannot be seen, end lines or turn the direction of writing."""


def printable(text: str) -> str:
    r"""One line in which every sign can be seen, for terminals and files.

    Control signs, line ends, signs of no width, those that turn the direction and lone
    surrogates are spelled as escapes, such as \x1b. What is too long loses its middle:
    a message begins with the place and ends with the cause.
    """
    if len(text) > LONGEST:
        text = f"{text[: LONGEST // 2]}...{text[-LONGEST // 2 :]}"
    if text.isprintable():
        return text
    return "".join(
        c if c.isprintable() else c.encode("unicode_escape").decode() for c in text
    )


def listed(names: Sequence[str]) -> str:
    """Names in one phrase, the first few of many."""
    more = len(names) - NAMED
    shown = ", ".join(repr(name[:40]) for name in names[:NAMED])
    return f"{shown} and {more} more" if more > 0 else shown


def plain_number(text: str) -> float:
    """A finite number as every program reads it; NaN for anything else.

    Python alone reads 1_0, and digits of other alphabets.
    """
    try:
        value = float(text) if text.isascii() and "_" not in text else math.nan
    except ValueError:
        return math.nan
    return value if math.isfinite(value) else math.nan


def show_everything() -> None:
    """Let this process's output spell what the terminal's encoding cannot write.

    What whoever started the process has closed goes nowhere, as a verdict is no other.
    """
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:
            setattr(sys, name, Path(os.devnull).open("w", encoding="utf-8"))
        stream = getattr(sys, name)
        reconfigure = getattr(stream, "reconfigure", None)
        if reconfigure is not None:
            reconfigure(errors="backslashreplace")
