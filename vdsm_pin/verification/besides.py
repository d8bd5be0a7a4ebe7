"""What to do where a check fails to run, or no time is left for what is wanted."""

from collections.abc import Callable
from math import nan
from typing import TypeVar

from vdsm_pin.errors import OutOfTime, VdsmError
from vdsm_pin.progress import step
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.records import Check, Verdict

T = TypeVar("T")


class Besides:
    """What is wanted besides the checks, as far as the time allows it."""

    def __init__(self) -> None:
        self.not_done: list[str] = []

    def take(self, name: str, run: Callable[[], T], otherwise: T) -> T:
        """A result, and a note where there is none in time."""
        step("%s", name)
        try:
            return run()
        except OutOfTime as error:
            self.not_done.append(f"{name}: {error}")
            return otherwise

    def note(self, name: str, deadline: Deadline) -> None:
        """Say that something is missing."""
        self.not_done.append(f"{name}: {OutOfTime(deadline.limit)}")


def guarded(
    name: str, run: Callable[[], Check | tuple[Check, ...]]
) -> tuple[Check, ...]:
    """A check's rows; one undecided row where it could not be carried out."""
    step("%s", name)
    try:
        rows = run()
    except (VdsmError, ArithmeticError) as error:
        return (Check(name, Verdict.UNDECIDED, 0, nan, nan, "-", f"not done: {error}"),)
    return rows if isinstance(rows, tuple) else (rows,)
