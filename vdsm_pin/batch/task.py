"""One problem of a batch: where it comes from, where it goes, and how it is done."""

import shlex
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Final

from vdsm_pin.app.workflow import JUDGED, PLANNED
from vdsm_pin.errors import VdsmError
from vdsm_pin.io.source import sha256_of_file
from vdsm_pin.io.trajectory_file import Interpolation
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.report.files import BatchRow
from vdsm_pin.report.run_record import versions
from vdsm_pin.report.words import outcome
from vdsm_pin.text import printable

MANIFEST: Final = "manifest.json"
TIMING: Final = "timing.json"
"""Seconds of one problem; the only file that differs from run to run."""

INDEX: Final = "../index.html"
"""The page of the batch, seen from a problem's folder."""

PICTURE: Final = "picture.svg"
CERTIFICATE: Final = "certificate.jsonl"
PDF: Final = "report.pdf"

WRITTEN: Final = frozenset(
    {*PLANNED, *JUDGED, PICTURE, CERTIFICATE, PDF, MANIFEST, TIMING}
)
"""Every file of a problem's folder."""


ALL: Final = "all"
FAILED: Final = "failed"
"""Whose files stay: every problem's, or those of problems that did not pass."""

GIVEN: Final = "given"
"""What a row has for a strategy where the motion was given."""


@dataclass(frozen=True)
class TaskSettings:
    """How each problem of a batch is done.

    Args:
        strategy: Name of the strategy.
        keep: Which problems keep their files: "all", "failed" (all that did not pass)
            or "none".
        errors: Every clearance is asked for under these and the problem's own errors.
        words: Options of the command line that state `errors` and `interpolation`, to
            repeat the run.
        interpolation: What joins the rows of given motions.
        certificate: Whether each certified motion gets its certificate.
        pdf: Whether each report is printed too.
        resume: Whether a finished and intact folder may stay.
        time_limit: How long a worker may take for it; None for no limit; [s].
    """

    strategy: str
    keep: str = ALL
    errors: ErrorBox = field(default_factory=ErrorBox)
    words: tuple[str, ...] = ()
    interpolation: Interpolation = "auto"
    certificate: bool = False
    pdf: bool = False
    resume: bool = False
    time_limit: float | None = None

    def keeps_files(self, row: BatchRow) -> bool:
        """Whether the files of a problem stay beside its manifest."""
        failed = not outcome(row.outcome).passed
        return self.keep == ALL or (self.keep == FAILED and failed)


@dataclass(frozen=True)
class Task:
    """One problem to do.

    Args:
        problem: Built-in name or path, as the user gave it.
        final: The folder of its results.
        staging: The folder that the worker writes, which then becomes `final`.
        settings: How it is done.
        trajectory: A given motion, which is verified as it is; None to plan one.
    """

    problem: str
    final: Path
    staging: Path
    settings: TaskSettings
    trajectory: str | None = None

    @property
    def strategy(self) -> str:
        """The strategy in the summary's row; `GIVEN` where the motion was given."""
        return self.settings.strategy if self.trajectory is None else GIVEN

    def depends_on(self) -> dict[str, str]:
        """What a finished folder must agree with to be kept."""
        found = {name: str(value) for name, value in asdict(self.settings).items()}
        del found["resume"], found["time_limit"]
        given = {} if self.trajectory is None else {"trajectory": self._given_sha256()}
        return found | {"strategy": self.strategy} | given | versions()

    def _given_sha256(self) -> str:
        """SHA-256 of the given motion; empty where it cannot be read."""
        try:
            return sha256_of_file(Path(self.trajectory or ""))
        except (OSError, VdsmError):
            return ""

    @property
    def command(self) -> str:
        """A command that repeats exactly this problem."""
        words, asked = ["vdsm", "batch", self.problem], self.settings
        if self.trajectory is None:
            words += ["--strategy", self.strategy]
        else:
            words += ["--trajectories", self.trajectory]
        more = {"--certificate": asked.certificate, "--pdf": asked.pdf}
        words += [*asked.words, *(name for name, wanted in more.items() if wanted)]
        return shlex.join([*words, "--out", "out"])


@dataclass(frozen=True)
class Done:
    """What a worker hands back.

    Args:
        row: The summary's row.
        kept: Whether an earlier result stays; otherwise `staging` holds a new one.
        unwritten: Why no result could be written; empty where it was.
    """

    row: BatchRow
    kept: bool
    unwritten: str = ""


def failed_row(task: Task, word: str, reason: str) -> BatchRow:
    """The row of a problem without a verified motion."""
    return BatchRow.model_validate(
        {
            "folder": task.final.name,
            "problem": printable(task.problem),
            "strategy": task.strategy,
            "outcome": word,
            "reason": printable(reason),
        }
    )
