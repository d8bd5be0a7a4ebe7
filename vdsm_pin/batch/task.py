"""One problem of a batch inside a worker: plan, verify, write its folder aside."""

import hashlib
import os
import shlex
import shutil
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Final

from pydantic import ValidationError

from vdsm_pin.app.motions import MotionOptions
from vdsm_pin.app.subjects import ProblemOrCell, read_problem_or_cell
from vdsm_pin.app.workflow import (
    JUDGED,
    NO_PLAN,
    PLANNED,
    TRAJECTORY,
    VerifyOrder,
    plan_to_folder,
    verify_to_folder,
)
from vdsm_pin.errors import (
    CannotWrite,
    Infeasible,
    InvalidFile,
    OutOfTime,
    VdsmError,
    VerificationFailed,
)
from vdsm_pin.io.atomic import writing
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.source import sha256_of_file
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.refinement import HANDED_OUT
from vdsm_pin.report.facts import batch_row
from vdsm_pin.report.files import BatchRow, ManifestFile, TimingFile
from vdsm_pin.report.picture import picture
from vdsm_pin.report.run_record import versions
from vdsm_pin.report.words import TIME_LIMIT, outcome
from vdsm_pin.text import printable
from vdsm_pin.time_limit import Deadline, enforced
from vdsm_pin.verification.records import Verdict

MANIFEST: Final = "manifest.json"
TIMING: Final = "timing.json"
"""Seconds of one problem; the only file that differs from run to run."""

PICTURE: Final = "picture.svg"
CERTIFICATE: Final = "certificate.jsonl"
PDF: Final = "report.pdf"

WRITTEN: Final = frozenset(
    {*PLANNED, *JUDGED, PICTURE, CERTIFICATE, PDF, MANIFEST, TIMING}
)
"""Every file of a problem's folder."""


NEW: Final = "problem"
LONGEST_NAME: Final = 100
"""Bytes of a folder's name that come from the problem's."""

ALL: Final = "all"
FAILED: Final = "failed"
"""Whose files stay: every problem's, or those of problems that did not pass."""

GIVEN: Final = "given"
"""What a row has for a strategy where the motion was given."""


@dataclass(frozen=True)
class Settings:
    """How each problem of a batch is done.

    Args:
        strategy: Name of the strategy.
        keep: Which problems keep their files: "all", "failed" (all that did not pass)
            or "none".
        errors: That every clearance is asked for under, besides the problem's own.
        words: The options of the command line that say so.
        certificate: Whether each certified motion gets its certificate.
        pdf: Whether each report is printed too.
        resume: Whether a finished and intact folder may stay.
        time_limit: From when a worker begins; None for none; [s].
    """

    strategy: str
    keep: str = ALL
    errors: ErrorBox = field(default_factory=ErrorBox)
    words: tuple[str, ...] = ()
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
        final: Where its folder shall be.
        aside: Where the worker writes it.
        settings: How it is done.
        trajectory: A given motion, which is verified as it is; None to plan one.
    """

    problem: str
    final: Path
    aside: Path
    settings: Settings
    trajectory: str | None = None

    @property
    def strategy(self) -> str:
        """What the row of a problem has for it."""
        return self.settings.strategy if self.trajectory is None else GIVEN

    def depends_on(self) -> dict[str, str]:
        """What a finished folder must agree with to be kept."""
        found = {name: str(value) for name, value in asdict(self.settings).items()}
        del found["resume"], found["time_limit"]
        given = {} if self.trajectory is None else {"trajectory": self._given_sha256()}
        return found | {"strategy": self.strategy} | given | versions()

    def _given_sha256(self) -> str:
        """Of the given motion; empty where it cannot be read."""
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
        kept: Whether an earlier result stays; else `aside` holds a new one.
        unwritten: Why there is no new one: no results can be written.
    """

    row: BatchRow
    kept: bool
    unwritten: str = ""


def perform(task: Task) -> Done:
    """Do one problem; whatever goes wrong becomes its row."""
    try:
        with writing(task.aside):
            return _performed(task)
    except CannotWrite as error:
        row = failed_row(task, "error", str(error))
        return Done(row, kept=True, unwritten=error.reason)


def _performed(task: Task) -> Done:
    started, deadline = time.monotonic(), Deadline.after(task.settings.time_limit)
    shutil.rmtree(task.aside, ignore_errors=True)
    digest, asked = "", task.depends_on()  # before the motion is read
    try:
        with enforced(deadline, grace=0.0):
            problem = _read(task)
            digest = problem.source.sha256 if problem.source else ""
            _check_apart(task, problem)
            if task.settings.resume:
                kept = finished(task, digest, asked)
                if kept is not None:
                    return Done(kept, kept=True)
        with enforced(deadline):
            row = _done(task, problem, deadline)
    except (CannotWrite, OSError):  # of our own files: readers tell of theirs
        raise
    except Infeasible as error:
        row = failed_row(task, "infeasible", str(error))
    except OutOfTime as error:
        row = failed_row(task, TIME_LIMIT, str(error))
    except VdsmError as error:
        row = failed_row(task, "error", str(error))
    except Exception as error:  # noqa: BLE001  a batch outlives any one problem
        row = failed_row(task, "error", f"{type(error).__name__}: {error}")
    if not task.settings.keeps_files(row):
        shutil.rmtree(task.aside, ignore_errors=True)
    elif not row.waypoints:
        _clear(task.aside)
    write_manifest(task, row, digest, asked)
    timing = TimingFile(seconds=round(time.monotonic() - started, 3))
    (task.aside / TIMING).write_text(timing.text(), encoding="utf-8")
    return Done(row, kept=False)


def _clear(folder: Path) -> None:
    """Leave nothing but the page that tells why there is no plan."""
    for path in folder.iterdir() if folder.is_dir() else ():
        if path.name != NO_PLAN:
            path.unlink()


def _read(task: Task) -> ProblemOrCell:
    """The problem of an arm, under the errors asked for, or of any other robot.

    Raises:
        InvalidFile: If it is bad, or asks for a robot what only arms have.
    """
    plans = task.trajectory is None
    asked = read_problem(task.problem) if plans else read_problem_or_cell(task.problem)
    return asked.under(task.settings.errors)


def _check_apart(task: Task, problem: ProblemOrCell) -> None:
    """Refuse a problem with files in the folder that its results replace.

    Raises:
        InvalidFile: If there is one.
    """
    final = task.final.resolve()
    files = [*problem.files]
    files += [] if task.trajectory is None else [Path(task.trajectory)]
    for file in files:
        if final in file.resolve().parents:
            why = f"lies in {task.final}, which the results would replace"
            raise InvalidFile(file=file, problem=why)


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


def write_manifest(
    task: Task, row: BatchRow, digest: str, asked: dict[str, str]
) -> None:
    """Write manifest.json, which makes the folder a finished one."""
    task.aside.mkdir(parents=True, exist_ok=True)
    files = {path.name: sha256_of_file(path) for path in sorted(task.aside.iterdir())}
    manifest = ManifestFile(problem_sha256=digest, settings=asked, row=row, files=files)
    (task.aside / MANIFEST).write_text(manifest.text(), encoding="utf-8")


def finished(task: Task, digest: str, asked: dict[str, str]) -> BatchRow | None:
    """The row of a folder that is finished, intact and still wanted, else None."""
    try:
        text = (task.final / MANIFEST).read_text(encoding="utf-8")
        manifest = ManifestFile.model_validate_json(text)
        intact = all(
            sha256_of_file(task.final / name) == expected
            for name, expected in manifest.files.items()
        )
    except (OSError, ValidationError, UnicodeDecodeError):
        return None
    same = (manifest.problem_sha256, manifest.settings) == (digest, asked)
    wanted = manifest.row.outcome not in ("error", TIME_LIMIT)
    return manifest.row if intact and same and wanted else None


def folder_names(
    problems: tuple[str, ...], taken: Iterable[str] = ()
) -> dict[str, str]:
    """A folder name for each problem, whatever order they come in.

    Args:
        problems: Each once.
        taken: Names of other files there.
    """
    plain = {problem: _plain_name(problem) for problem in problems}
    count = Counter([*plain.values(), *taken])
    names: dict[str, str] = {}
    for digits in (8, 64):  # more where short ones meet a name or each other
        names = {
            problem: name if count[name] == 1 else f"{name}-{_hash(problem)[:digits]}"
            for problem, name in plain.items()
        }
        if len(set(names.values())) == len(names):
            break
    return names


def _plain_name(problem: str) -> str:
    path = Path(problem)
    stem = path.stem if path.suffix.lower() in (".yaml", ".yml") else problem.strip("/")
    if stem == NEW and path.parent.name:  # as vdsm new makes them: FOLDER/problem.yaml
        stem = path.parent.name
    kept = "".join(c if c.isalnum() or c in "-_." else "-" for c in stem).strip(".-")
    return kept.encode()[:LONGEST_NAME].decode(errors="ignore") or "problem"


def _hash(problem: str) -> str:
    return hashlib.sha256(os.fsencode(problem)).hexdigest()


def _done(task: Task, problem: ProblemOrCell, deadline: Deadline) -> BatchRow:
    """Plan where no motion is given, verify, and tell."""
    asked, plan = task.settings, None
    if task.trajectory is None:
        assert isinstance(problem, PlanningProblem)
        plan = plan_to_folder(
            problem, task.strategy, task.aside, task.command, deadline, report=False
        )
    order = VerifyOrder(
        problem,
        Path(task.trajectory) if task.trajectory else task.aside / TRAJECTORY,
        task.aside,
        task.command,
        certificate=task.aside / CERTIFICATE if asked.certificate else None,
        pdf=task.aside / PDF if asked.pdf else None,
        options=MotionOptions(deadline),
    )
    verified = verify_to_folder(order)
    certified = verified.records.verdict is Verdict.CERTIFIED
    if asked.certificate and certified and verified.no_certificate:
        message = f"certified, but without a certificate: {verified.no_certificate}"
        raise VerificationFailed(message)
    planned = task.trajectory is None
    if planned and deadline.passed and verified.records.verdict not in HANDED_OUT:
        raise OutOfTime(deadline.limit, "a plan was found and proved, but not reported")
    drawing = picture(verified.records)
    (task.aside / PICTURE).write_text(drawing, encoding="utf-8")
    row = batch_row(task.final.name, task.strategy, verified.file)
    # The planner knows why it left something out, the verification does not.
    if plan is not None and plan.verdict == row.outcome == "incomplete":
        return row.model_copy(update={"reason": plan.reason})
    return row
