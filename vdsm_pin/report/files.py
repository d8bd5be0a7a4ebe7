"""The JSON files as models: what is written is what `vdsm schema` describes."""

import json
from collections.abc import Callable
from typing import Any, Final, Literal

from pydantic import Field, FiniteFloat

from vdsm_pin.errors import UnknownName
from vdsm_pin.io.problem_file import SCHEMA_DIALECT, problem_schema
from vdsm_pin.report import rows

OutcomeWord = Literal[
    "certified",
    "incomplete",
    "refuted",
    "undecided",
    "infeasible",
    "error",
    "time-limit",
]


_COVERAGE: Final = (
    "proved share of the desired path that is drawn, 0 to 1; null where there is none"
)
_JOINT_ERROR: Final = "largest joint error still certified; null where not sought"
_ASSUMED: Final = "meshes whose unit nobody states, with the size assumed"
_NOTES: Final = "what was left out, joined or odd in meshes and trajectory"
_PROBLEM: Final = "name of the problem"
_STRATEGY: Final = "how it was planned"
_VERSIONS: Final = "of everything a number may depend on"
_COMMAND: Final = "exact command line"


class VerificationFile(rows.ResultModel):
    """verification.json."""

    vdsm_verification: Literal[1] = Field(
        default=1, description="version of this format"
    )
    problem: str = Field(description=_PROBLEM)
    date: str | None = Field(
        default=None,
        description="when it was verified, in UTC; null in a batch, whose files are "
        "the same from run to run",
    )
    verdict: rows.VerdictWord
    reason: str = Field(description="the verdict in one sentence")
    assumed_sizes: tuple[str, ...] = Field(description=_ASSUMED)
    notes: tuple[str, ...] = Field(description=_NOTES)
    checks: tuple[rows.CheckRow, ...] = Field(
        description="every check, in a fixed order"
    )
    min_clearance: rows.MinClearance | None = Field(
        description="smallest clearance from an obstacle; null where there is none"
    )
    required_clearance_m: FiniteFloat = Field(description="asked for by the problem")
    closest: tuple[rows.ClosestRow, ...] = Field(
        description="ten closest approaches, obstacles first, each pair once"
    )
    coverage: FiniteFloat | None = Field(description=_COVERAGE)
    path_length_m: FiniteFloat | None = Field(
        description="of the desired path; null where there is none"
    )
    undrawn_m: tuple[tuple[FiniteFloat, FiniteFloat], ...] = Field(
        description="stretches of the desired path not drawn: arc lengths from and to"
    )
    error_box: rows.ErrorBoxRow
    max_joint_error_rad: FiniteFloat | None = Field(description=_JOINT_ERROR)
    refuted_joint_error_rad: FiniteFloat | None = Field(
        description="smallest joint error found that loses the clearance; null: none"
    )
    time_limit_s: FiniteFloat | None = Field(
        description="when the verification had to end; null: there was no limit"
    )
    not_done: tuple[str, ...] = Field(
        description="what the time limit left out besides checks, which have their rows"
    )
    left_out: tuple[rows.LeftOutRow, ...] = Field(
        description="bodies that are not held apart, with a reason each"
    )
    counterexamples: tuple[rows.CounterexampleRow, ...] = Field(
        description="errors within the box that lose the clearance where it is refuted "
        "for the box alone: one against obstacles, one between links, at most"
    )
    nominal_clear: bool | None = Field(
        description="whether the motion without errors is proved clear; null where "
        "there is no counterexample"
    )
    motion: rows.MotionFacts | rows.RobotFacts = Field(
        description="what an arm, or any other robot, does at the waypoints"
    )
    hashes: rows.Hashes
    versions: dict[str, str] = Field(description=_VERSIONS)
    machine: str = Field(description="system, architecture, processors")
    tolerances: dict[str, rows.ToleranceRow] = Field(description="in force, by name")
    command: str = Field(description=_COMMAND)


class PlanFile(rows.ResultModel):
    """plan.json."""

    vdsm_plan: Literal[1] = Field(default=1, description="version of this format")
    problem: str = Field(description=_PROBLEM)
    strategy: str = Field(description=_STRATEGY)
    verdict: rows.VerdictWord
    reason: str = Field(description="the verdict in one sentence")
    undrawn: tuple[str, ...] = Field(
        description="stretches of the desired path not drawn, and why"
    )
    assumed_sizes: tuple[str, ...] = Field(description=_ASSUMED)
    notes: tuple[str, ...] = Field(
        description=f"what the strategy has to say; {_NOTES}"
    )
    rounds: int = Field(
        description="rounds of plan, measure, verify, larger margins; a lift after "
        "which joints were moved on is one too"
    )
    adjustments: tuple[rows.AdjustmentRow, ...] = Field(
        default=(),
        description="what was missed after each round: margins raised, joints moved",
    )
    centres_error_m: FiniteFloat | None = Field(
        default=None,
        description="largest distance of a planned joint centre from Pinocchio's",
    )
    error_box: rows.ErrorBoxRow = Field(
        default=rows.ErrorBoxRow(), description="errors that the plan was made for"
    )
    coverage: FiniteFloat | None = Field(description=_COVERAGE)
    motion: rows.MotionFacts
    hashes: rows.Hashes
    versions: dict[str, str] = Field(description=_VERSIONS)
    command: str = Field(description=_COMMAND)


class BatchRow(rows.ResultModel):
    """One problem of a batch; what summary.csv shows."""

    folder: str = Field(
        description="folder of its files, whose name stands for it in progress, table, "
        "JUnit and diff"
    )
    problem: str = Field(description="as it was given: built-in name or file")
    strategy: str = Field(description=_STRATEGY)
    outcome: OutcomeWord = Field(
        description="the verdict, or why there is none: infeasible, error, time-limit"
    )
    min_clearance_lower_m: FiniteFloat | None = Field(
        default=None,
        description="smallest clearance from an obstacle, proved lower bound",
    )
    min_clearance_upper_m: FiniteFloat | None = Field(
        default=None, description="the same, proved upper bound"
    )
    closest_link: int | None = Field(
        default=None, description=f"where it is; {rows.LINK}"
    )
    closest_obstacle: str | None = Field(
        default=None, description="and to which obstacle"
    )
    coverage: FiniteFloat | None = Field(default=None, description=_COVERAGE)
    max_link_angle_rad: FiniteFloat | None = Field(
        default=None, description="largest link angle psi of any joint"
    )
    changed_angles_mean_on_path: FiniteFloat | None = Field(
        default=None, description=rows.CHANGED
    )
    max_joint_error_rad: FiniteFloat | None = Field(
        default=None, description=_JOINT_ERROR
    )
    x0_min_m: FiniteFloat | None = Field(
        default=None, description="smallest base position"
    )
    x0_max_m: FiniteFloat | None = Field(
        default=None, description="largest base position"
    )
    waypoints: int | None = Field(default=None, description="rows of the trajectory")
    reason: str = Field(default="", description="the outcome in one sentence")


class ManifestFile(rows.ResultModel):
    """manifest.json of one problem's folder; a folder with it is finished."""

    vdsm_manifest: Literal[1] = Field(default=1, description="version of this format")
    problem_sha256: str = Field(description="problem file and the meshes it names")
    settings: dict[str, str] = Field(description="what a result depends on besides")
    row: BatchRow
    files: dict[str, str] = Field(description="SHA-256 by file name")


class TimingFile(rows.ResultModel):
    """timing.json of one problem's folder, the only file that differs between runs."""

    seconds: FiniteFloat = Field(description="time spent on the problem")


def _certificate_schema() -> dict[str, Any]:
    # Its models take a while to build, and only this asks for them here.
    from vdsm_pin.certificate_writer.schema import certificate_schema

    return certificate_schema()


_MODELS: Final[dict[str, type[rows.ResultModel]]] = {
    "verification": VerificationFile,
    "plan": PlanFile,
    "manifest": ManifestFile,
    "timing": TimingFile,
}
_ELSEWHERE: Final[dict[str, Callable[[], dict[str, Any]]]] = {
    "problem": problem_schema,
    "certificate": _certificate_schema,
}
"""Files that are described where they are read or written."""

SCHEMA_NAMES: Final = (*_ELSEWHERE, *_MODELS)
"""Every file with a schema."""


def schema(name: str) -> dict[str, Any]:
    """JSON Schema of one file; of a certificate, of each of its lines.

    Raises:
        UnknownName: If no such file exists.
    """
    if name not in SCHEMA_NAMES:
        raise UnknownName(kind="schema", name=name, known=SCHEMA_NAMES)
    if name in _ELSEWHERE:
        return {"$schema": SCHEMA_DIALECT} | _ELSEWHERE[name]()
    found = _MODELS[name].model_json_schema(mode="serialization")
    return {"$schema": SCHEMA_DIALECT} | found


def schema_text(description: dict[str, Any]) -> str:
    """A schema as indented JSON."""
    return json.dumps(description, indent=2) + "\n"
