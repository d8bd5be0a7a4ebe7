"""A time limit for any strategy: the clearance function stops answering.

Every strategy asks for clearances all the time, so this is where a clock can end it. It
can only stop, never steer: until then every answer is the same as without a limit.

It needs no signal, so that it serves threads and libraries. The command line raises one
besides (`workflow.within`), which also ends what asks for no clearance.
"""

import time

from vdsm_pin.errors import OutOfTime
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.records import LinkClearance


def within_time(clearance: LinkClearance, seconds: float | None) -> LinkClearance:
    """The same clearance function, for so long from now.

    Args:
        clearance: Clearance of links at given joint centres.
        seconds: How long it shall answer; None for ever; [s].

    Returns:
        A function that raises `OutOfTime` once the time is over.
    """
    if seconds is None:
        return clearance
    end = time.monotonic() + seconds

    def timed(centres: FloatArray) -> FloatArray:
        if time.monotonic() > end:
            raise OutOfTime(seconds)
        return clearance(centres)

    return timed
