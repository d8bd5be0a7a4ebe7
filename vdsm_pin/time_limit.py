"""The one clock that ends work: a time limit as a value, passed on to whoever works.

Work asks the deadline between its steps. Compiled loops are given `Deadline.end` and
stop in the middle of their work once it has passed; their result is then no result, and
who called them says so with `Deadline.check` before it is looked at. Until then every
answer is the same as without a limit. What does not ask, as readers and writers, is
interrupted by `enforced` a little later.
"""

import signal
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from math import inf, isnan
from numbers import Real
from types import FrameType
from typing import Final

from vdsm_pin.errors import InvalidInput, OutOfTime

PLAN_LIMIT: Final = 60.0
COLD_PLAN_LIMIT: Final = 600.0
"""Time to plan by default; more until a first plan has made the machine code; [s]."""


@dataclass(frozen=True)
class Deadline:
    """When work must have ended.

    Args:
        limit: The time limit as it was given; infinite for none; [s].
        end: The end by the monotonic clock of the machine; [s].
        patience: How long a search goes on that has found nothing, by its own begin,
            if it may go on until then at all; [s].
    """

    limit: float = inf
    end: float = inf
    patience: float = inf

    @classmethod
    def after(cls, seconds: float | None) -> "Deadline":
        """So many seconds from now; None for never.

        Raises:
            InvalidInput: If the seconds are not a number.
        """
        if seconds is None:
            return cls()
        if not isinstance(seconds, Real) or isnan(seconds):
            message = f"the time limit is {seconds!r}, expected seconds"
            raise InvalidInput(message)
        limit = float(seconds)
        return cls(limit, time.monotonic() + limit)

    @property
    def passed(self) -> bool:
        """Whether the time is over."""
        return time.monotonic() > self.end

    @property
    def left(self) -> float:
        """The time until then; [s]."""
        return self.end - time.monotonic()

    def earlier(self, seconds: float) -> "Deadline":
        """The same limit, which ends so much before."""
        return replace(self, end=self.end - seconds)

    def share(self, part: float) -> "Deadline":
        """The same limit, for a part of the time that is left; [-]."""
        return self if self.end == inf else self.earlier((1.0 - part) * self.left)

    def check(self, reached: str = "") -> None:
        """Go on, unless the time is over; the error says how far the work came.

        Raises:
            OutOfTime: If it is.
        """
        if self.passed:
            raise OutOfTime(self.limit, reached)


NO_LIMIT: Final = Deadline()
"""Work may take as long as it takes."""

GRACE: Final = 0.5
"""Work that has heard of the end has so long to write down what it found; [s]."""

AGAIN: Final = 1.0
"""Interval of the alarm, which repeats as a library may swallow the first; [s]."""


SOON: Final = 0.02
"""When the alarm is tried again while an import is under way; [s]."""


def _imports(frame: FrameType | None, caller: FrameType) -> bool:
    """Whether what runs is a part of an import that the caller or its work began.

    The caller itself may run while it is imported: that import does not count.
    """
    while frame is not None and frame is not caller:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
        frame = frame.f_back
    return False


@contextmanager
def enforced(deadline: Deadline, grace: float = GRACE) -> Iterator[None]:
    """Interrupt whatever still runs a little after a deadline.

    Python code is interrupted between two of its steps; one call of a library is not,
    nor is an import: a library that is half imported is of no use to who comes next.
    Only the main thread of a process can be, and only where there are such signals:
    elsewhere nothing is enforced.

    Args:
        deadline: When work must have ended.
        grace: How long after it; none for work that has nothing to write; [s].

    Raises:
        OutOfTime: Out of the block.
    """
    main = threading.current_thread() is threading.main_thread()
    if deadline.end == inf or not main or not hasattr(signal, "setitimer"):
        yield
        return

    rung, caller = False, sys._getframe(2)  # past contextlib's own

    def ring(_: int, frame: FrameType | None) -> None:
        nonlocal rung
        if _imports(frame, caller):
            signal.setitimer(signal.ITIMER_REAL, SOON, AGAIN)
            return
        rung = True
        raise OutOfTime(deadline.limit)

    before = signal.signal(signal.SIGALRM, ring)
    left = deadline.end + grace - time.monotonic()
    try:
        signal.setitimer(signal.ITIMER_REAL, max(left, 1e-6), AGAIN)
        yield
    except Exception as error:
        if rung and not isinstance(error, OutOfTime):
            # A library told the interruption as an error of its own.
            raise OutOfTime(deadline.limit) from error
        raise
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
