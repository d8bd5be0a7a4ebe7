"""What a verification has besides its checks, as far as there is time for it."""

from collections.abc import Callable
from typing import TypeVar

from vdsm_pin.errors import OutOfTime
from vdsm_pin.progress import step
from vdsm_pin.time_limit import Deadline

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
