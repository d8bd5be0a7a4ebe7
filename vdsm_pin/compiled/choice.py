"""Which way machine code is made: kept by this package, or by numba as it comes."""

import logging
from functools import cache
from types import ModuleType

from vdsm_pin.compiled import plain_numba


@cache
def compiler() -> ModuleType | None:
    """The compiler whose code is kept here.

    None where VDSM_PLAIN_NUMBA asks for numba as it comes, and where the installed
    numba cannot compile and load a function in our way: it is tried once.
    """
    if plain_numba():
        return None
    try:
        from vdsm_pin.compiled import compiling

        found = compiling.tried()
    except Exception as error:  # noqa: BLE001 (whatever it raises)
        logging.getLogger(__name__).debug("numba is used as it comes: %r", error)
        return None
    return compiling if found else None
