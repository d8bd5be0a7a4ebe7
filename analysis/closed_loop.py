"""Section 7 in simulation: plans run by elastic cables and motors, Fig. 19 to 21.

    python analysis/closed_loop.py --out reports/paper

Every plan runs once as it is and, for the figures of obs3, once with a kick at alpha5
and alpha6. What is assumed stands in `vdsm_pin/simulation/settings.py`; nothing was
fitted.
"""

import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from closed_loop_figures import actual_and_planned, errors, poses
from paper_figures import style
from result_files import output_folder, table_lines, write_table

from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.simulation.closed_loop import Simulation, simulate
from vdsm_pin.simulation.folder import Cleared, SimulationFile, summary
from vdsm_pin.simulation.settings import Kick, Settings
from vdsm_pin.units import percent, proved_mm, quantity

SCENES = ("free", "obs1", "obs2", "obs2-small", "obs3")
STRATEGIES = ("paper", "fewest", "sturdiest")
KICKS = (
    Kick(axis="alpha", joint=5, share=0.35, torque_nm=6.0),
    Kick(axis="alpha", joint=6, share=0.65, torque_nm=12.0),
)
"""Disturbances of the size that the paper's Fig. 21 shows: about 4 deg."""


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


@dataclass(frozen=True)
class Ran:
    """One plan and what came of it."""

    problem: PlanningProblem
    trajectory: Trajectory
    simulation: Simulation
    file: SimulationFile


@cache
def _ran(scene: str, strategy: str, settings: str) -> Ran:
    return _run(scene, strategy, Settings.model_validate_json(settings))


def run(scene: str, strategy: str, settings: Settings) -> Ran:
    """Plan, simulate, prove; once, however often the same is asked for."""
    return _ran(scene, strategy, settings.model_dump_json())


def _run(scene: str, strategy: str, settings: Settings) -> Ran:
    problem = read_problem(f"paper/{scene}")
    trajectory = plan_and_verify(problem, strategy).plan.trajectory
    found = simulate(problem.manipulator, trajectory, settings)
    file = summary(problem, trajectory, found, settings, "")
    return Ran(problem, trajectory, found, file)


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
            file = run("obs3", "paper", Settings(**{part: changed})).file
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
    for name in ("fig19", "fig20-paper", "fig20-fewest", "fig21-paper", "fig21-fewest"):
        lines += ["", f'<img src="{name}.png" width="800" alt="{name}">']
    return "\n".join(lines) + "\n"


def main(folder: Path) -> None:
    """Run everything, write tables and figures."""
    rows = []
    for scene in SCENES:
        for strategy in STRATEGIES:
            ran = run(scene, strategy, Settings())
            rows.append(row(scene, strategy, ran.file))
            print(rows[-1], flush=True)
    swept = sweep()
    write_table(folder, "closed_loop", [*rows, *swept], markdown(rows, swept))
    for strategy in ("paper", "fewest"):
        ran = run("obs3", strategy, Settings(kicks=KICKS))
        figures = {
            f"fig20-{strategy}": actual_and_planned(ran.simulation),
            f"fig21-{strategy}": errors(ran.simulation),
        }
        if strategy == "paper":
            figures["fig19"] = poses(ran.problem, ran.simulation)
        style.save_all(figures, folder)
        for name in figures:
            if name != "fig19":  # twenty thousand points a curve: a picture is smaller
                (folder / f"{name}.svg").unlink()


if __name__ == "__main__":
    main(output_folder(__doc__))
