"""Progress of a batch: a bar on a terminal, plain lines elsewhere."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from itertools import count

from vdsm_pin.batch.task import Done
from vdsm_pin.report.files import BatchRow
from vdsm_pin.report.words import at_least, outcome, term
from vdsm_pin.text import printable
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import percent, quantity


@contextmanager
def progress(total: int, quiet: bool = False) -> Iterator[Callable[[Done], None]]:
    """Says which problems ended, and how.

    Args:
        total: Number of problems.
        quiet: Whether nothing is said.

    Yields:
        What says it of one problem.
    """
    numbers, width = count(1), len(str(total))

    def head() -> str:
        return f"[{next(numbers):>{width}}/{total}]"

    if quiet:
        yield lambda done: None
    elif not sys.stdout.isatty():
        yield lambda done: print(head(), *_said(done), flush=True)  # noqa: T201
    else:
        from rich.progress import Progress
        from rich.text import Text

        with Progress(transient=True) as bar:
            task = bar.add_task("batch", total=total)

            def show(done: Done) -> None:
                verdict, place, tail = _said(done)
                colour = outcome(done.row.outcome).colour
                parts = (verdict, colour), f" {place} ", (tail, "dim")
                bar.console.print(Text.assemble(head() + " ", *parts))
                bar.advance(task)

            yield show


def _said(done: Done) -> tuple[str, str, str]:
    """Verdict, place and what there is to say of a problem."""
    row, known = done.row, outcome(done.row.outcome)
    tail = _measures(row) if known.passed else printable(row.reason)
    place = printable(row.folder) + (" (kept)" if done.kept else "")
    return f"{known.mark} {known.word:<10}", place, " " + tail


def _measures(row: BatchRow) -> str:
    """The numbers of a problem that passed."""
    near = f"{term('min_clearance_lower_m')} {at_least(row.min_clearance_lower_m)}"
    parts = [near if row.closest_link else "no obstacle"]
    if row.max_link_angle_rad is not None:
        parts.append(_measure(row, "max_link_angle_rad", "rad"))
    if row.coverage is not None and row.coverage < 1.0 - TOLERANCES.coverage:
        parts.append(f"{percent(row.coverage)} drawn")
    return ", ".join(parts)


def _measure(row: BatchRow, key: str, unit: str) -> str:
    return f"{term(key)} {quantity(getattr(row, key), unit)}"
