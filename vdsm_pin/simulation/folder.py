"""One simulation from files to a result folder."""

import math
from contextlib import nullcontext
from importlib.metadata import version
from pathlib import Path
from typing import Final, Literal

import numpy as np
import typer
from pydantic import Field

from vdsm_pin.errors import InvalidInput
from vdsm_pin.io.source import (
    check_is_file,
    check_unchanged,
    naming_file,
    sha256_of_file,
)
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.folder import check_outputs, staged
from vdsm_pin.report.rows import ResultModel, VerdictWord
from vdsm_pin.report.run_record import versions
from vdsm_pin.report.terminal import show_facts
from vdsm_pin.report.words import at_least, finite, outcome
from vdsm_pin.simulation.closed_loop import SLACK, Simulation, simulate
from vdsm_pin.simulation.page import BAND_DEG, page
from vdsm_pin.simulation.plant import cable_name
from vdsm_pin.simulation.settings import Settings
from vdsm_pin.text import printable
from vdsm_pin.units import measured_at_most, percent, percent_at_most
from vdsm_pin.verification.clearance import prove_clearance
from vdsm_pin.verification.inside import located
from vdsm_pin.verification.judgement import BestEffort, judge_clearance
from vdsm_pin.verification.pinocchio_arm import load_arm
from vdsm_pin.verification.records import combine

EXECUTED: Final = "executed.csv"
RECORD: Final = "simulation.csv"
SUMMARY: Final = "simulation.json"
PAGE: Final = "simulation.html"

BAND: Final = float(np.deg2rad(BAND_DEG))
"""The same in radians; [rad]."""


class Cleared(ResultModel):
    """A motion and what is proved of its clearance, the problem's errors included."""

    verdict: VerdictWord
    min_clearance_m: float | None = Field(description="proved; null: no obstacle")


class SimulationFile(ResultModel):
    """simulation.json."""

    vdsm_simulation: Literal[1] = Field(default=1, description="version of this format")
    problem: str = Field(description="name of the problem")
    trajectory_sha256: str = Field(description="of the planned trajectory")
    settings: Settings = Field(description="everything that was assumed")
    duration_s: float = Field(description="of the simulated motion")
    largest_error_rad: float = Field(
        description="of any joint angle at any step of the controller"
    )
    largest_errors_rad: tuple[float, ...] = Field(
        description="of each angle: alpha1, theta1, alpha2, .."
    )
    largest_base_error_m: float = Field(description="of x0, at any such step")
    within_band_share: float = Field(
        description="of all angles and recorded times with an error of 0.3 deg or less"
    )
    largest_tension_n: float = Field(
        description="of any cable at any step of the controller"
    )
    slack_share: float = Field(description="of all cables and recorded times below 1 N")
    least_stiffness_nm_rad: float = Field(
        description="of the joints, at 24 times of the motion at most; at 0 or below "
        "the arm buckles"
    )
    least_tension_margin_n: float = Field(
        description="what may be added to every tension before the arm buckles, at the "
        "same times"
    )
    planned: Cleared
    executed: Cleared = Field(
        description="the recorded rows of executed.csv, joined by straight lines"
    )
    within_error_box: Cleared = Field(
        description="the planned motion with every joint off by the largest error, and "
        "the base by that of x0"
    )
    versions: dict[str, str] = Field(description="of everything a number depends on")


def simulate_to_folder(
    problem: PlanningProblem,
    trajectory: Path,
    folder: Path,
    settings: Settings,
    settings_file: Path | None = None,
) -> SimulationFile:
    """Run a plan in closed loop; write executed.csv, simulation.csv, .json and .html.

    Args:
        problem: As it was read.
        trajectory: The planned trajectory file.
        folder: Where the results go.
        settings: What is assumed.
        settings_file: Where that was read; None for the defaults.

    Raises:
        InvalidInput: If a file is bad or the folder cannot be written, or MuJoCo is
            missing.
        VerificationFailed: If the simulation diverges.
    """
    read = filter(None, [*problem.files, trajectory, settings_file])
    check_outputs(read, folder=folder, names=(EXECUTED, RECORD, SUMMARY, PAGE))
    if problem.scene.moving:
        name = problem.scene.moving[0].name
        message = (
            f"obstacle {name!r} moves: the closed loop runs in a time of its own, so "
            "nothing could be said of its clearance"
        )
        raise InvalidInput(message)
    arm, asked = problem.manipulator, problem.tip_path is not None
    with nullcontext() if settings_file is None else naming_file(settings_file):
        settings.check(arm.n_links)
    check_is_file(trajectory)
    digest = sha256_of_file(trajectory)
    planned = read_trajectory(trajectory, arm, "linear", places=asked)
    found = simulate(arm, planned, settings)
    file = summary(problem, planned, found, settings, digest)
    check_unchanged(trajectory, digest)
    with staged(folder) as staging:
        write_trajectory(found.trajectory, staging / EXECUTED)
        _write_record(staging / RECORD, found)
        (staging / SUMMARY).write_text(file.text(), encoding="utf-8")
        text = page(file, found, settings, problem.required_clearance)
        (staging / PAGE).write_text(text, encoding="utf-8")
    return file


def summary(
    problem: PlanningProblem,
    planned: Trajectory,
    found: Simulation,
    settings: Settings,
    digest: str,
) -> SimulationFile:
    """The simulation in numbers, and what is proved of it."""
    errors, worst = np.abs(found.errors), found.largest_errors.tolist()
    box = ErrorBox(joint=found.largest_error, base=worst[0])
    model = load_arm(problem.manipulator)
    return SimulationFile(
        problem=problem.name,
        trajectory_sha256=digest,
        settings=settings,
        duration_s=float(found.times[-1]),
        largest_error_rad=found.largest_error,
        largest_errors_rad=tuple(worst[1:]),
        largest_base_error_m=worst[0],
        within_band_share=float((errors <= BAND).mean()),
        largest_tension_n=found.largest_tension,
        slack_share=float((found.tensions < SLACK).mean()),
        least_stiffness_nm_rad=float(found.least_stiffness[:, 1].min()),
        least_tension_margin_n=float(found.tension_margin[:, 1].min()),
        planned=cleared(problem, planned, ErrorBox()),
        executed=cleared(problem, found.trajectory, ErrorBox()),
        within_error_box=cleared(problem, planned, box),
        versions=versions() | {"mujoco": version("mujoco"), "urdf": model.urdf_sha256},
    )


def cleared(
    problem: PlanningProblem, trajectory: Trajectory, errors: ErrorBox
) -> Cleared:
    """What is proved of a motion's clearance over continuous time.

    Args:
        problem: What is asked.
        trajectory: The motion.
        errors: Covered besides those that the problem states.
    """
    errors = problem.errors.widened(errors)
    proof = prove_clearance(problem, trajectory, errors)
    known = proof, located(proof.motion), BestEffort()
    found = judge_clearance(problem, trajectory, *known, contacts=False)
    verdict = combine(tuple(row.verdict for row in found.checks))
    lower = found.least.lower[proof.motion.asked.outer]
    least = finite(float(lower.min(initial=np.inf)))
    return Cleared(verdict=verdict.value, min_clearance_m=least)


def _write_record(path: Path, found: Simulation) -> None:
    """Planned and executed joints and tensions over time as CSV."""
    n_links = (found.planned.shape[1] - 1) // 2
    joints = ["x0_m", *(f"{a}{i}_rad" for i in range(1, n_links + 1)
                        for a in ("alpha", "theta"))]  # fmt: skip
    cables = [f"{cable_name(i, k)}_n" for i in range(1, n_links + 1) for k in range(3)]
    names = ["time_s", *(f"planned_{n}" for n in joints),
             *(f"executed_{n}" for n in joints), *cables]  # fmt: skip
    table = np.column_stack(
        [found.times, found.planned, found.executed, found.tensions]
    )
    lines = (",".join(map(repr, row)) for row in table.tolist())
    path.write_text("\n".join([",".join(names), *lines]) + "\n", encoding="utf-8")


def show_simulation(file: SimulationFile, folder: Path) -> None:
    """One simulation in a few lines."""
    known = outcome(file.executed.verdict)
    typer.echo(f"{known.mark} {known.word}  {printable(file.problem)}, executed motion")
    show_facts(
        ("duration", f"{file.duration_s:.1f} s"),
        ("clearance planned", at_least(file.planned.min_clearance_m)),
        ("clearance executed", at_least(file.executed.min_clearance_m)),
        ("largest joint error", measured_at_most(file.largest_error_rad, "rad")),
        ("largest base error", measured_at_most(file.largest_base_error_m, "m")),
        ("any motion within these errors", file.within_error_box.verdict),
        ("joints within ±0.3°", percent(file.within_band_share)),
        ("largest tension", f"{math.ceil(file.largest_tension_n)} N"),
        ("slack", f"{percent_at_most(file.slack_share)} of all cables and times"),
        ("least joint stiffness", f"{math.floor(file.least_stiffness_nm_rad)} Nm/rad"),
        ("tension margin", f"{math.floor(file.least_tension_margin_n)} N a cable"),
        ("files in", str(folder)),
    )
