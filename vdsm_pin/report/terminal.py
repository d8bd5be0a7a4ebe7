"""What the terminal shows: the same words and numbers as the reports."""

import sys
from pathlib import Path

import typer

from vdsm_pin.report.files import PlanFile, VerificationFile
from vdsm_pin.report.inputs import assumption
from vdsm_pin.report.rows import CheckRow
from vdsm_pin.report.words import (
    check_cells,
    errors,
    lost,
    mean_count,
    outcome,
    survived,
    term,
)
from vdsm_pin.text import printable
from vdsm_pin.units import measured, percent


def show_plan(file: PlanFile, folder: Path) -> None:
    """One plan in a few lines."""
    motion = file.motion
    typer.echo(_headline(file, f"{file.problem}, planned by {file.strategy}"))
    typer.echo(f"  {printable(file.reason)}")
    changed = motion.changed_angles_mean_on_path
    mean = "" if changed is None else f"{mean_count(changed)} on average on the path, "
    ends = (measured(x0, "m") for x0 in (motion.x0_min_m, motion.x0_max_m))
    path: list[tuple[str, str]] = []
    waypoints = f"{motion.waypoints}"
    if motion.on_path_waypoints is not None:
        waypoints += f", {motion.on_path_waypoints} on the path"
        path = [(term("coverage"), percent(file.coverage))]
    show_facts(
        (term("waypoints"), waypoints),
        *path,
        (term("max_link_angle_rad"), measured(max(motion.max_link_angle_rad), "rad")),
        (
            term("changed_angles_mean_on_path"),
            f"{mean}{motion.changed_angles_max} at most",
        ),
        ("base travel", " to ".join(ends)),
        *_under(file),
        *(("not drawn", stretch) for stretch in file.undrawn),
        *(("note", note) for note in file.notes),
        ("report", str(folder / "report.html")),
    )


def show_verification(
    file: VerificationFile, folder: Path, *more: tuple[str, str]
) -> None:
    """One verification: the verdict, why, every check, and where the files are.

    Args:
        file: What verification.json says.
        folder: Where it stands.
        more: Names and values of further lines.
    """
    typer.echo(_headline(file, file.problem))
    typer.echo(f"  {printable(file.reason)}")
    show_checks(file.checks)
    more = (*_under(file), *more)
    if file.path_length_m is not None:
        more = ((term("coverage"), percent(file.coverage)), *more)
    if file.max_joint_error_rad is not None:
        margin = survived(file.max_joint_error_rad)
        if file.refuted_joint_error_rad is not None:
            margin += f", lost at {lost(file.refuted_joint_error_rad)}"
        more = ((term("max_joint_error_rad"), margin), *more)
    undone = (("not done", what) for what in file.not_done)
    notes = (("note", note) for note in file.notes)
    show_facts(*undone, *more, *notes, ("report", str(folder / "report.html")))


def show_facts(*rows: tuple[str, str]) -> None:
    """Names and values in two columns."""
    width = max(len(name) for name, _ in rows)
    for name, value in rows:
        typer.echo(f"  {name:<{width}}  {printable(value)}")


def _under(file: PlanFile | VerificationFile) -> tuple[tuple[str, str], ...]:
    """The errors under which clearances are kept, if there are any."""
    words = errors(file.error_box)
    return (("under errors up to", words),) if words else ()


def _headline(file: PlanFile | VerificationFile, subject: str) -> str:
    """Verdict, problem, and what the verdict rests on that nobody stated."""
    verdict = _verdict(file.verdict, bold=True)
    rests_on = assumption(file.assumed_sizes)
    return f"{verdict}  {printable(', '.join(filter(None, (subject, rests_on))))}"


def _verdict(word: str, *, bold: bool | None = None) -> str:
    """A verdict as people read it, in its colour on a terminal."""
    known = outcome(word)
    colour = known.colour if sys.stdout.isatty() else None
    return typer.style(f"{known.mark} {known.word}", fg=colour, bold=bold)


def show_checks(checks: tuple[CheckRow, ...]) -> None:
    """Print checks in columns."""
    rows = [("check", "worst", "limit", "count", "verdict")]
    for one in checks:
        cells = *check_cells(one), str(one.count)
        rows.append((one.name, *cells, _verdict(one.verdict)))
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for name, *numbers, verdict in rows:
        middle = "  ".join(
            f"{cell:>{width}}" for cell, width in zip(numbers, widths[1:4], strict=True)
        )
        typer.echo(f"  {name:<{widths[0]}}  {middle}  {verdict}")
