"""A deadline for any strategy: the clearance function stops answering.

Every strategy asks for clearances all the time, so this is where the clock can end it.
It can only stop, never steer: until then every answer is the same as without a limit.
"""

from dataclasses import dataclass

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem.held import Axes
from vdsm_pin.time_limit import NO_LIMIT, Deadline


def within_time(clearance: LinkClearance, deadline: Deadline) -> LinkClearance:
    """The same clearance function, up to a deadline.

    Args:
        clearance: Clearance of links at given joint centres.
        deadline: Until when it shall answer.

    Returns:
        A function that raises `OutOfTime` once the time is over.
    """
    return _Timed(clearance, deadline)


def deadline_of(clearance: LinkClearance) -> Deadline:
    """The deadline a clearance function was given, for what asks for no clearance."""
    deadline: Deadline = getattr(clearance, "deadline", NO_LIMIT)
    return deadline


def with_share(clearance: LinkClearance, share: float) -> LinkClearance:
    """The same clearance function, for a part of the time that is left; [-]."""
    return within_time(clearance, deadline_of(clearance).share(share))


@dataclass(frozen=True)
class _Timed:
    """A clearance function and its deadline."""

    clearance: LinkClearance
    deadline: Deadline

    def __call__(self, centres: FloatArray, axes: Axes = None, /) -> FloatArray:
        self.deadline.check()
        return self.clearance(centres, axes)
