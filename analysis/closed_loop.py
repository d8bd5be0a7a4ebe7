"""Section 7 in simulation: plans run by elastic cables and motors.

    python analysis/closed_loop.py --out reports/paper

What is assumed stands in `vdsm_pin/simulation/settings.py`; nothing was fitted.
`closed_loop_figures.py` draws Fig. 19 to 21.
"""

import math
from functools import cache
from pathlib import Path

from closed_loop_figures import FIGURES
from result_files import output_folder, table_lines, write_table

from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.simulation.closed_loop import simulate
from vdsm_pin.simulation.folder import Cleared, SimulationFile, summary
from vdsm_pin.simulation.settings import Settings
from vdsm_pin.units import percent, proved_mm, quantity

SCENES = ("free", "obs1", "obs2", "obs2-small", "obs3")
STRATEGIES = ("paper", "fewest", "sturdiest")

SWEEPS = (
    ("mass of the links [kg/m]", "bodies", "mass_per_length_kg_m", (2.0, 4.0, 8.0)),
    ("EA of a cable [N]", "cables", "stiffness_ea_n", (1.5e5, 3.5e5, 6.0e5)),
    ("Coulomb friction [Nm]", "bodies", "joint_friction_nm", (0.0, 0.2, 1.0)),
    ("pretension [N]", "cables", "pretension_n", (30.0, 100.0, 300.0, 1000.0)),
    ("what the PID is on", "controller", "regulates", ("angles", "lengths")),
    ("proportional gain [-]", "controller", "proportional", (0.1, 0.2, 0.4)),
    ("integral gain [1/s]", "controller", "integral_per_s", (0.0, 0.5, 1.0)),
    ("gravity feed-forward", "controller", "gravity_feed_forward", (True, False)),
)
"""Assumptions that are varied one at a time, on obs3 by the paper's rule."""


@cache
def _ran(scene: str, strategy: str, settings: str) -> SimulationFile:
    return _run(scene, strategy, Settings.model_validate_json(settings))


def run(scene: str, strategy: str, settings: Settings) -> SimulationFile:
    """Plan, simulate, prove; once, however often the same is asked for."""
    return _ran(scene, strategy, settings.model_dump_json())


def _run(scene: str, strategy: str, settings: Settings) -> SimulationFile:
    problem = read_problem(f"paper/{scene}")
    trajectory = plan_and_verify(problem, strategy).plan.trajectory
    found = simulate(problem.manipulator, trajectory, settings)
    return summary(problem, trajectory, found, settings, "")


def row(scene: str, strategy: str, file: SimulationFile) -> dict[str, str]:
    """One line of the table."""
    return {
        "scene": scene,
        "strategy": strategy,
        "planned": _clearance(file.planned),
        "executed": _clearance(file.executed),
        "largest error": quantity(file.largest_error_rad, "rad", math.ceil),
        "within 0.3 deg": percent(file.within_band_share),
        "any motion within that error": _clearance(file.within_error_box),
        "tension [N]": f"{math.ceil(file.largest_tension_n)}",
        "least stiffness [Nm/rad]": f"{math.floor(file.least_stiffness_nm_rad)}",
        "tension margin [N]": f"{math.floor(file.least_tension_margin_n)}",
    }


def sweep() -> list[dict[str, str]]:
    """obs3 by the paper's rule with one assumption changed at a time."""
    rows = []
    for name, part, key, values in SWEEPS:
        for value in values:
            before = getattr(Settings(), part)
            changed = before.model_copy(update={key: value})
            file = run("obs3", "paper", Settings(**{part: changed}))
            found = row("obs3", "paper", file)
            kept = [*list(found)[3:6], *list(found)[7:]]
            said = f"{value:g}" if isinstance(value, float) else str(value)
            kept_cells = {k: found[k] for k in kept}
            rows.append({"assumption": name, "value": said} | kept_cells)
            print(rows[-1], flush=True)
    return rows


def _clearance(found: Cleared) -> str:
    if found.min_clearance_m is None:
        return f"{found.verdict}, no obstacle"
    return f"{found.verdict}, {proved_mm(found.min_clearance_m)}"


def markdown(rows: list[dict[str, str]], swept: list[dict[str, str]]) -> str:
    """The tables for reading."""
    lines = ["# Plans in closed loop", "", "Made by `python analysis/closed_loop.py`; "
             "what is assumed: [docs/simulation.md](../../docs/simulation.md). \"Any "
             "motion within that error\": the largest error of any joint at any step "
             "of the controller fed to the proof as the error of every joint, and that "
             "of x0 as the base's. Clearances are proved lower bounds: an undecided "
             "one may be larger. What is simulated is rounded to the worse side.",
             ""]  # fmt: skip
    planned, changed = (
        table_lines(list(some[0]), [one.values() for one in some])
        for some in (rows, swept)
    )
    lines += [*planned, "", "## What the assumptions do", "",
              "obs3 by the paper's rule, one assumption changed at a time.", "",
              *changed]  # fmt: skip
    for name in FIGURES:
        lines += ["", f'<img src="{name}.png" width="800" alt="{name}">']
    return "\n".join(lines) + "\n"


def main(folder: Path) -> None:
    """Run everything, write the tables."""
    rows = []
    for scene in SCENES:
        for strategy in STRATEGIES:
            rows.append(row(scene, strategy, run(scene, strategy, Settings())))
            print(rows[-1], flush=True)
    swept = sweep()
    write_table(folder, "closed_loop", [*rows, *swept], markdown(rows, swept))


if __name__ == "__main__":
    main(output_folder(__doc__))
