"""The one clock that ends work: a time limit as a value, passed on to whoever works.

Nothing is interrupted: work asks the deadline between its steps. Compiled loops are
given `Deadline.end` and stop in the middle of their work once it has passed; their
result is then no result, and who called them says so with `Deadline.check` before it is
looked at. Until then every answer is the same as without a limit.
"""

import time
from dataclasses import dataclass
from math import inf
from typing import Final

from vdsm_pin.errors import OutOfTime


@dataclass(frozen=True)
class Deadline:
    """When work must have ended.

    Args:
        limit: The time limit as it was given; infinite for none; [s].
        end: The end by the monotonic clock of the machine; [s].
    """

    limit: float = inf
    end: float = inf

    @classmethod
    def after(cls, seconds: float | None) -> "Deadline":
        """So many seconds from now; None for never."""
        if seconds is None:
            return cls()
        return cls(seconds, time.monotonic() + seconds)

    @property
    def passed(self) -> bool:
        """Whether the time is over."""
        return time.monotonic() > self.end

    def check(self) -> None:
        """Go on, unless the time is over.

        Raises:
            OutOfTime: If it is.
        """
        if self.passed:
            raise OutOfTime(self.limit)


NO_LIMIT: Final = Deadline()
"""Work may take as long as it takes."""
