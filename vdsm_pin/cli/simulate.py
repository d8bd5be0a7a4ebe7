"""`vdsm simulate`."""

from pathlib import Path
from typing import Annotated

import typer

from vdsm_pin.cli.options import (
    NOT_PASSED,
    PASSED,
    Answer,
    OutFolder,
    ProblemArgument,
    Trajectory,
    examples,
    family,
    grouped,
)

commands = family()


@commands.command(
    epilog=examples(
        "vdsm simulate paper/obs3 --trajectory out/obs3/trajectory.csv --out out/loop"
    )
)
@grouped
def simulate(
    problem: ProblemArgument,
    trajectory: Trajectory,
    out: OutFolder,
    settings: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE", help="Masses, cables, motors, gains and kicks (YAML)."
        ),
    ] = None,
    *,
    answer: Answer,
) -> None:
    """Run a plan in closed loop.

    Simulates elastic cables, motors, encoders and PID. Needs MuJoCo (extra
    `simulation`). Writes executed.csv, simulation.csv, simulation.json and
    simulation.html. Status 1 where the executed motion is not proved clear.
    """
    from vdsm_pin.io.problem_file import read_problem
    from vdsm_pin.simulation.folder import SimulationOrder, simulate_to_folder
    from vdsm_pin.simulation.settings import Settings, read_settings
    from vdsm_pin.simulation.terminal import show_simulation

    assumed = Settings() if settings is None else read_settings(settings)
    asked = read_problem(problem)
    order = SimulationOrder(asked, trajectory, out, assumed, settings)
    file = simulate_to_folder(order)
    if any(answer):
        answer.tell("", **file.model_dump(mode="json"))
    else:
        show_simulation(file, out)
    passed = file.executed.verdict == "certified"
    raise typer.Exit(PASSED if passed else NOT_PASSED)
