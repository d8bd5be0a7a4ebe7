"""What long work says while it lasts: one logger, and handlers that show it.

Whoever works long says how far it has come with `say`, names what it is at with
`step`, and lets itself be asked how much is done with `watched`. Nobody hears it unless
a handler asks for it, as the command line does: a bar with the time left on a terminal,
lines elsewhere, both once work has lasted a while.
"""

import logging
import math
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from threading import Timer
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from rich.progress import Progress

_LOG: Final = logging.getLogger(__name__)

QUIET: Final = 2.0
"""What ends sooner says nothing; [s]."""

say: Final = _LOG.info
"""Say how far work has come: a format string and its values, as for `logging`."""

step: Final = _LOG.debug
"""Name what is worked at, likewise; only a bar shows it."""

Share = Callable[[], float]
"""How much is done, 0 to 1; asked by another thread."""


class _Lines(logging.Handler):
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


class _Bar(logging.Handler):
    """Draws a bar on stderr: what was said last, how much is done, the time left.

    Args:
        quiet: When it appears; [s].
        limit: When work ends at the latest, which counts where nothing is watched; [s].
    """

    def __init__(self, quiet: float, limit: float) -> None:
        super().__init__(logging.DEBUG)
        self.begin, self.limit, self.words = time.monotonic(), limit, ""
        self.share: Share | None = None
        self.drawn: Progress | None = None
        # Who is soon done does not wait until rich is imported.
        self.timer = Timer(quiet, self._draw)
        self.timer.daemon = True
        self.timer.start()

    def emit(self, record: logging.LogRecord) -> None:
        """Remember what was said."""
        self.words = record.getMessage()

    def watch(self, share: Share | None) -> None:
        """Ask this one from now on, or nobody; the time left is reckoned anew."""
        self.share = share
        if self.drawn is not None:
            self.drawn.reset(self.drawn.task_ids[0])

    def close(self) -> None:
        """Take the bar away."""
        self.timer.cancel()
        if self.drawn is not None:
            self.drawn.stop()
        super().close()

    def _draw(self) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            Progress,
            TaskProgressColumn,
            TextColumn,
            TimeRemainingColumn,
        )
        from rich.table import Column

        told = self

        class Asking(Progress):
            def get_renderables(self) -> Any:
                for number in self.task_ids:
                    self.update(number, **told.now())
                return super().get_renderables()

        room = Column(no_wrap=True, overflow="ellipsis", ratio=1)
        columns = BarColumn(24), TaskProgressColumn(), TimeRemainingColumn()
        said = TextColumn("{task.description}", markup=False, table_column=room)
        drawn = Asking(
            *(*columns, said),
            console=Console(stderr=True),
            transient=True,
            expand=True,
            redirect_stdout=False,
            redirect_stderr=False,
        )
        drawn.add_task("", total=1.0)
        self.drawn = drawn
        drawn.start()

    def now(self) -> dict[str, Any]:
        """What the bar shows: without a share it only moves."""
        done: float | None = None
        if self.share is not None:
            done = self.share()
        elif math.isfinite(self.limit):
            done = (time.monotonic() - self.begin) / self.limit
        total = None if done is None else 1.0
        return {"description": self.words, "completed": done or 0.0, "total": total}


@contextmanager
def watched(share: Share) -> Iterator[None]:
    """Let whoever draws a bar ask how much is done of what happens within."""
    bars = [one for one in _LOG.handlers if isinstance(one, _Bar)]
    for bar in bars:
        bar.watch(share)
    try:
        yield
    finally:
        for bar in bars:
            bar.watch(None)


@contextmanager
def shown(
    quiet: float = QUIET, *, lines: bool = True, limit: float = math.inf
) -> Iterator[None]:
    """Show on stderr what is said within.

    Args:
        quiet: For so long nothing; [s].
        lines: Whether there are lines where stderr is no terminal.
        limit: When the work ends at the latest; [s].
    """
    terminal = sys.stderr.isatty()
    if not terminal and not lines:
        yield
        return
    handler = _Bar(quiet, limit) if terminal else _Lines(quiet)
    level = _LOG.level
    _LOG.addHandler(handler)
    _LOG.setLevel(logging.DEBUG if terminal else logging.INFO)
    try:
        yield
    finally:
        _LOG.removeHandler(handler)
        _LOG.setLevel(level)
        handler.close()
