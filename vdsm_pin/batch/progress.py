"""Progress of a batch: a bar on a terminal, plain lines elsewhere."""

import sys
from types import TracebackType
from typing import TYPE_CHECKING, Self

from vdsm_pin.batch.task import Done
from vdsm_pin.report.files import BatchRow
from vdsm_pin.report.words import outcome, percent, quantity, term
from vdsm_pin.text import printable
from vdsm_pin.tolerances import TOLERANCES

if TYPE_CHECKING:
    from rich.progress import Progress as Bar


class Progress:
    """Says which problem ended, and how.

    Args:
        total: Number of problems.
        quiet: Whether there is no bar.
    """

    def __init__(self, total: int, quiet: bool = False) -> None:
        self._wanted = not quiet and sys.stdout.isatty()
        self._total, self._count = total, 0
        self._bar: Bar | None = None

    def __enter__(self) -> Self:
        """Start the bar where there is a terminal."""
        if self._wanted:
            from rich.progress import Progress as Bar

            self._bar = Bar(transient=True)
            self._bar.add_task("batch", total=self._total)
            self._bar.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Take the bar away."""
        if self._bar is not None:
            self._bar.stop()

    def show(self, done: Done) -> None:
        """One problem that ended."""
        self._count += 1
        row, known = done.row, outcome(done.row.outcome)
        width = len(str(self._total))
        head = f"[{self._count:>{width}}/{self._total}]"
        verdict = f"{known.mark} {known.word:<10}"
        tail = printable(row.reason)
        if known.passed:
            near = _said(row, "min_clearance_lower_m", "m")
            near = near if row.closest_link else "no obstacle"
            tail = near
            if row.max_link_angle_rad is not None:
                tail += f", {_said(row, 'max_link_angle_rad', 'rad')}"
            if row.coverage is not None and row.coverage < 1.0 - TOLERANCES.coverage:
                tail += f", {percent(row.coverage)} drawn"
        place = printable(row.folder) + (" (kept)" if done.kept else "")
        if self._bar is None:
            sys.stdout.write(f"{head} {verdict} {place}  {tail}\n")
            sys.stdout.flush()
            return
        from rich.text import Text

        line = Text.assemble(
            head + " ", (verdict, known.colour), f" {place}  ", (tail, "dim")
        )
        self._bar.console.print(line)
        self._bar.advance(self._bar.task_ids[0])


def _said(row: BatchRow, key: str, unit: str) -> str:
    return f"{term(key)} {quantity(getattr(row, key), unit)}"
