"""What becomes of a check that fails, and of results for which no time is left."""

from collections.abc import Callable
from math import nan
from typing import ParamSpec, TypeVar

from vdsm_pin.errors import OutOfTime, VdsmError
from vdsm_pin.progress import step
from vdsm_pin.time_limit import Deadline
from vdsm_pin.verification.records import Check, Verdict

T = TypeVar("T")
P = ParamSpec("P")


class BestEffort:
    """Results besides the checks, as far as the time allows them.

    Attributes:
        not_done: What the time did not allow, and why, one entry each.
    """

    def __init__(self) -> None:
        self.not_done: list[str] = []

    def take(
        self,
        name: str,
        otherwise: T,
        run: Callable[P, T],
        *args: P.args,
        **kw: P.kwargs,
    ) -> T:
        """What `run` returns, or `otherwise` and a note if it raises `OutOfTime`.

        Args:
            name: What is worked out, for the note and the progress bar.
            otherwise: What stands for the result if the time is over.
            run: Works it out.
            args: What it is given.
            kw: The same by name.
        """
        step("%s", name)
        try:
            return run(*args, **kw)
        except OutOfTime as error:
            self.not_done.append(f"{name}: {error}")
            return otherwise

    def note(self, name: str, deadline: Deadline) -> None:
        """Note that the time did not allow a result."""
        self.not_done.append(f"{name}: {OutOfTime(deadline.limit)}")


def guarded(
    name: str,
    run: Callable[P, Check | tuple[Check, ...]],
    *args: P.args,
    **kw: P.kwargs,
) -> tuple[Check, ...]:
    """A check's rows; one undecided row if it raises a domain or arithmetic error."""
    step("%s", name)
    try:
        rows = run(*args, **kw)
    except (VdsmError, ArithmeticError) as error:
        return (Check(name, Verdict.UNDECIDED, 0, nan, nan, "-", f"not done: {error}"),)
    return rows if isinstance(rows, tuple) else (rows,)
