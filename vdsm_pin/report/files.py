"""The JSON files as models: what is written is what `vdsm schema` describes."""

import json
from typing import Any, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from vdsm_pin.errors import UnknownName

Point = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
VerdictWord = Literal["certified", "refuted", "undecided"]
OutcomeWord = Literal[
    "certified", "refuted", "undecided", "infeasible", "error", "timeout"
]


class FileModel(BaseModel):
    """Common rules: no unknown keys, nothing changes after it is built."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    def text(self) -> str:
        """The file's text; an undefined number is null, never a pass."""
        return self.model_dump_json(indent=2) + "\n"


class CheckRow(FileModel):
    """One check."""

    name: str
    verdict: VerdictWord
    count: int = Field(description="items checked")
    worst: FiniteFloat | None = Field(description="null where there is none; SI")
    limit: FiniteFloat | None = Field(description="null where there is none; SI")
    unit: str = Field(description="m, rad, share (of a whole) or -")
    where: str = Field(description="place of the worst case")


class ClosestRow(FileModel):
    """One closest approach; points in the frame of the problem file, in metres."""

    waypoint: int = Field(description="rows waypoint and waypoint + 1 bound it, from 0")
    time: FiniteFloat = Field(description="place between the two rows, 0 to 1")
    link: int
    obstacle: str = Field(description="an obstacle's name, or 'link k'")
    lower: FiniteFloat | None = Field(description="proved lower bound; m")
    upper: FiniteFloat | None = Field(description="proved upper bound; m")
    station: FiniteFloat | None = Field(description="along the link's axis; m")
    link_point: Point | None
    other_point: Point | None


class MinClearance(FileModel):
    """The smallest clearance of the whole motion as a proved bracket; [m]."""

    lower: FiniteFloat | None
    upper: FiniteFloat | None
    link: int
    obstacle: str
    waypoint: int


class ErrorBoxRow(FileModel):
    """The errors of the real arm that the clearance proof covers."""

    joint_rad: FiniteFloat
    base_m: FiniteFloat
    obstacle_m: FiniteFloat


class MotionFacts(FileModel):
    """What the arm does, measured on the rows of the trajectory."""

    waypoints: int
    on_path_waypoints: int
    max_link_angle_rad: tuple[FiniteFloat, ...] = Field(description="per joint")
    x0_min_m: FiniteFloat
    x0_max_m: FiniteFloat
    changed_angle_threshold_rad: FiniteFloat
    changed_angles_mean_on_path: FiniteFloat | None = Field(
        description="mean number of link angles above the threshold"
    )
    changed_angles_max: int


class Hashes(FileModel):
    """SHA-256 of the inputs; empty where there was none."""

    problem_sha256: str
    trajectory_sha256: str
    urdf_sha256: str


class VerificationFile(FileModel):
    """verification.json."""

    vdsm_verification: Literal[1] = 1
    problem: str
    verdict: VerdictWord
    reason: str = Field(description="the verdict in one sentence")
    checks: tuple[CheckRow, ...]
    min_clearance_m: MinClearance | None
    required_clearance_m: FiniteFloat
    closest: tuple[ClosestRow, ...]
    coverage: FiniteFloat | None = Field(description="part of the desired path drawn")
    path_length_m: FiniteFloat
    undrawn_m: tuple[tuple[FiniteFloat, FiniteFloat], ...]
    errors: ErrorBoxRow
    joint_error_rad: FiniteFloat | None = Field(
        description="largest joint error still certified; null where not sought"
    )
    motion: MotionFacts
    hashes: Hashes
    versions: dict[str, str]
    machine: str
    tolerances: dict[str, FiniteFloat]
    command: str


class PlanFile(FileModel):
    """plan.json."""

    vdsm_plan: Literal[1] = 1
    problem: str
    strategy: str
    verdict: VerdictWord
    notes: tuple[str, ...]
    rounds: int = Field(description="rounds of plan, verify, larger margins")
    coverage: FiniteFloat | None
    motion: MotionFacts
    hashes: Hashes
    versions: dict[str, str]
    command: str


class BatchRow(FileModel):
    """One problem of a batch; what summary.csv shows."""

    folder: str
    problem: str
    strategy: str
    outcome: OutcomeWord
    min_clearance_lower_m: FiniteFloat | None = None
    min_clearance_upper_m: FiniteFloat | None = None
    closest: str = ""
    coverage: FiniteFloat | None = None
    max_link_angle_rad: FiniteFloat | None = None
    changed_angles_mean_on_path: FiniteFloat | None = None
    joint_error_rad: FiniteFloat | None = None
    x0_min_m: FiniteFloat | None = None
    x0_max_m: FiniteFloat | None = None
    waypoints: int | None = None
    reason: str = ""


class ManifestFile(FileModel):
    """manifest.json of one problem's folder; a folder with it is finished."""

    vdsm_manifest: Literal[1] = 1
    problem_sha256: str
    settings: dict[str, str]
    row: BatchRow
    files: dict[str, str] = Field(description="SHA-256 by file name")


_MODELS: Final[dict[str, type[FileModel]]] = {
    "verification": VerificationFile,
    "plan": PlanFile,
    "manifest": ManifestFile,
}
PROBLEM: Final = "problem"
"""Name of the problem file's schema, which its reader knows."""

SCHEMA_NAMES: Final = (PROBLEM, *_MODELS)
"""Every file with a schema."""


def schema(name: str) -> dict[str, Any]:
    """JSON Schema of one file.

    Raises:
        UnknownName: If no such file exists.
    """
    if name not in _MODELS:
        raise UnknownName(kind="schema", name=name, known=SCHEMA_NAMES)
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema"}
    return head | _MODELS[name].model_json_schema(mode="serialization")


def schema_text(description: dict[str, Any]) -> str:
    """A schema as indented JSON."""
    return json.dumps(description, indent=2) + "\n"
