"""What the terminal shows of a simulation."""

from pathlib import Path

import typer

from vdsm_pin.report.terminal import show_facts
from vdsm_pin.report.words import at_least, measured, outcome, percent
from vdsm_pin.simulation.folder import SimulationFile
from vdsm_pin.text import printable


def show_simulation(file: SimulationFile, folder: Path) -> None:
    """One simulation in a few lines."""
    known = outcome(file.executed.verdict)
    typer.echo(f"{known.mark} {known.word}  {printable(file.problem)}, executed motion")
    show_facts(
        ("duration", f"{file.duration_s:.1f} s"),
        ("clearance planned", at_least(file.planned.min_clearance_m)),
        ("clearance executed", at_least(file.executed.min_clearance_m)),
        ("largest joint error", measured(file.largest_error_rad, "rad")),
        ("largest base error", measured(file.largest_base_error_m, "m")),
        ("any motion within these errors", file.within_error_box.verdict),
        ("joints within ±0.3°", percent(file.within_band_share)),
        ("largest tension", f"{file.largest_tension_n:.0f} N"),
        ("slack", f"{percent(file.slack_share)} of all cables and times"),
        ("least joint stiffness", f"{file.least_stiffness_nm_rad:.1f} Nm/rad"),
        ("tension margin", f"{file.least_tension_margin_n:.0f} N in every cable"),
        ("files in", str(folder)),
    )
