"""What long work says while it lasts: one logger, and a handler that shows it.

Whoever works long says how far it has come with `say`. Nobody hears it unless a handler
asks for it, as the command line does: it shows lines once work has lasted a while.
"""

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

_LOG: Final = logging.getLogger(__name__)

QUIET: Final = 2.0
"""What ends sooner says nothing; [s]."""

say: Final = _LOG.info
"""Say how far work has come: a format string and its values, as for `logging`."""


class _Shown(logging.Handler):
    """Writes lines to stderr with the time since it was made."""

    def __init__(self, quiet: float) -> None:
        super().__init__(logging.INFO)
        self.begin, self.quiet = time.monotonic(), quiet
        self.last = ""

    def emit(self, record: logging.LogRecord) -> None:
        """Write a line, unless it is too soon or says what the last one said."""
        spent, words = time.monotonic() - self.begin, record.getMessage()
        if spent >= self.quiet and words != self.last:
            self.last = words
            sys.stderr.write(f"{spent:6.1f} s  {words}\n")
            sys.stderr.flush()


@contextmanager
def shown(quiet: float = QUIET) -> Iterator[None]:
    """Show on stderr what is said within; see `QUIET` [s]."""
    handler, level = _Shown(quiet), _LOG.level
    _LOG.addHandler(handler)
    _LOG.setLevel(logging.INFO)
    try:
        yield
    finally:
        _LOG.removeHandler(handler)
        _LOG.setLevel(level)
