"""The worker of a batch: plans, verifies and writes a problem's staging folder."""

import shutil
import time
from pathlib import Path

from vdsm_pin.app.first_plan import note_planned
from vdsm_pin.app.motions import MotionOptions
from vdsm_pin.app.problems import read_problem
from vdsm_pin.app.subjects import ProblemOrCell, read_problem_or_cell
from vdsm_pin.app.workflow import (
    NO_PLAN,
    TRAJECTORY,
    VerifyOrder,
    plan_to_folder,
    verify_to_folder,
)
from vdsm_pin.batch.folders import finished, write_manifest
from vdsm_pin.batch.task import (
    CERTIFICATE,
    INDEX,
    PDF,
    PICTURE,
    TIMING,
    Done,
    Task,
    failed_row,
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
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.refinement import HANDED_OUT
from vdsm_pin.report.facts import batch_row
from vdsm_pin.report.files import BatchRow, TimingFile
from vdsm_pin.report.picture import picture
from vdsm_pin.report.words import TIME_LIMIT
from vdsm_pin.text import printable
from vdsm_pin.time_limit import Deadline, enforced
from vdsm_pin.verification.records import Verdict


def perform(task: Task) -> Done:
    """Do one problem in a worker; whatever goes wrong becomes its row."""
    try:
        with writing(task.staging):
            return _performed(task)
    except CannotWrite as error:
        row = failed_row(task, "error", str(error))
        return Done(row, kept=True, unwritten=error.reason)


def _performed(task: Task) -> Done:
    started, deadline = time.monotonic(), Deadline.after(task.settings.time_limit)
    shutil.rmtree(task.staging, ignore_errors=True)
    digest, asked = "", task.depends_on()  # before the motion is read
    try:
        with enforced(deadline, grace=0.0):
            problem = _read(task)
            digest = problem.sha256
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
        shutil.rmtree(task.staging, ignore_errors=True)
    elif not row.waypoints:
        _clear(task.staging)
    write_manifest(task, row, digest, asked)
    timing = TimingFile(seconds=round(time.monotonic() - started, 3))
    (task.staging / TIMING).write_text(timing.text(), encoding="utf-8")
    return Done(row, kept=False)


def _clear(folder: Path) -> None:
    """Leave nothing but the page that tells why there is no plan."""
    for path in folder.iterdir() if folder.is_dir() else ():
        if path.name != NO_PLAN:
            path.unlink()


def _read(task: Task) -> ProblemOrCell:
    """The problem of an arm, under the errors asked for, or of any other robot."""
    plans = task.trajectory is None
    asked = read_problem(task.problem) if plans else read_problem_or_cell(task.problem)
    return asked.under(task.settings.errors)


def _check_apart(task: Task, problem: ProblemOrCell) -> None:
    """Refuse a problem with files in the folder that its results replace."""
    final = task.final.resolve()
    files = [*problem.files]
    files += [] if task.trajectory is None else [Path(task.trajectory)]
    for file in files:
        if final in file.resolve().parents:
            why = f"lies in {task.final}, which the results would replace"
            raise InvalidFile(file=file, fault=why)


def _done(task: Task, problem: ProblemOrCell, deadline: Deadline) -> BatchRow:
    """Plan where no motion is given, verify, and tell."""
    asked, plan = task.settings, None
    if task.trajectory is None:
        assert isinstance(problem, PlanningProblem)
        plan = plan_to_folder(
            problem,
            task.strategy,
            task.staging,
            task.command,
            deadline,
            report=False,
            index=INDEX,
        )
        if problem.scene.obstacles:  # without any, little is compiled
            note_planned()
    order = VerifyOrder(
        problem,
        Path(task.trajectory) if task.trajectory else task.staging / TRAJECTORY,
        task.staging,
        task.command,
        certificate=task.staging / CERTIFICATE if asked.certificate else None,
        pdf=task.staging / PDF if asked.pdf else None,
        options=MotionOptions(deadline, asked.interpolation),
        index=INDEX,
    )
    verified = verify_to_folder(order)
    certified = verified.records.verdict is Verdict.CERTIFIED
    if certified and verified.no_certificate:
        message = f"certified, but without a certificate: {verified.no_certificate}"
        raise VerificationFailed(message)
    planned = task.trajectory is None
    if planned and deadline.passed and verified.records.verdict not in HANDED_OUT:
        raise OutOfTime(deadline.limit, "a plan was found and proved, but not reported")
    drawing = picture(verified.records)
    (task.staging / PICTURE).write_text(drawing, encoding="utf-8")
    row = batch_row(task.final.name, task.strategy, verified.content)
    known = {"problem": printable(task.problem)}
    # The planner knows why it left something out, the verification does not.
    if plan is not None and plan.verdict == row.outcome == "incomplete":
        known["reason"] = plan.reason
    return row.model_copy(update=known)
