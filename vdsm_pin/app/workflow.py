"""One problem from file to result folder: what `plan`, `verify` and `batch` share.

Nothing is judged here: problems are read, planned, verified and written down.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, NamedTuple

from pydantic import ValidationError

from vdsm_pin.app.arm_subject import CABLES, CENTRES, LINK_ANGLES
from vdsm_pin.app.motions import NO_OPTIONS, MotionOptions
from vdsm_pin.app.subjects import ProblemOrCell, Subject, subject_of
from vdsm_pin.errors import (
    Infeasible,
    InvalidFile,
    OutOfTime,
    VerificationFailed,
)
from vdsm_pin.io.source import (
    check_is_file_or_bag,
    check_unchanged,
    read_text,
    sha256_of_file,
)
from vdsm_pin.io.trajectory_file import write_trajectory
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.progress import step
from vdsm_pin.report.facts import plan_file, verification_file
from vdsm_pin.report.files import PlanFile, VerificationFile
from vdsm_pin.report.film import find_browser, print_page
from vdsm_pin.report.folder import (
    CERTIFICATES,
    check_outputs,
    staged,
)
from vdsm_pin.report.run_record import RunRecord, now
from vdsm_pin.report.tables import write_cables, write_centres
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.pinocchio_arm import load_arm
from vdsm_pin.verification.records import Verdict, Verification

TRAJECTORY: Final = "trajectory.csv"
PLAN: Final = "plan.json"
VERIFICATION: Final = "verification.json"
REPORT: Final = "report.html"
CLEARANCE: Final = "clearance.csv"

NO_PLAN: Final = "no_plan.html"

MAX_PLAN_BYTES: Final = 64 << 20
"""Of a plan.json, which names stretches that are not drawn and margins; [bytes]."""

PLANNED: Final = TRAJECTORY, PLAN, CENTRES, CABLES, REPORT, NO_PLAN
"""What planning writes to its folder: all but the last, or the last alone."""

JUDGED: Final = VERIFICATION, REPORT, CLEARANCE, LINK_ANGLES, CENTRES, CABLES
"""What verifying writes to its folder."""


@dataclass(frozen=True)
class VerifyOrder:
    """What to verify and what to write besides the folder.

    Args:
        problem: The problem of an arm or of any other robot, as it was read.
        trajectory: The trajectory file. The report tells of plan.json beside it where
            that is of this motion.
        folder: Where the results go.
        command: The exact command line, for the report.
        certificate: Where the certificate of a certified motion goes; None for none.
        pdf: Where the report on paper goes; None for none.
        options: The deadline, and how the trajectory file is read.
        date: When the run began, for the report; None where files shall be the same
            from run to run.
        all_pairs: Whether clearance.csv has every pair at every interval; otherwise it
            has the near pairs, and the least clearance of each other one.
        index: Where the page of the batch is, seen from the report; empty if of none.
    """

    problem: ProblemOrCell
    trajectory: Path
    folder: Path
    command: str
    certificate: Path | None = None
    pdf: Path | None = None
    options: MotionOptions = NO_OPTIONS
    all_pairs: bool = False
    date: str | None = None
    index: str = ""


@dataclass(frozen=True)
class Verified:
    """A verification as records and as the content of verification.json.

    Args:
        content: Of verification.json.
        records: The verification.
        no_certificate: Why a certificate that was asked for is missing, in words;
            empty where none is.
    """

    content: VerificationFile
    records: Verification
    no_certificate: str = ""


def plan_to_folder(
    problem: PlanningProblem,
    strategy: str,
    folder: Path,
    command: str,
    deadline: Deadline = NO_LIMIT,
    report: bool = True,
    index: str = "",
) -> PlanFile:
    """Plan, and write trajectory.csv, centres.csv, cables.csv, plan.json, report.html.

    A plan is certified, or incomplete: it is clear, but draws less than required.

    Args:
        problem: As it was read.
        strategy: Name of the strategy.
        folder: Where the results go.
        command: The exact command line, for the files.
        deadline: When to give up.
        report: Whether to write report.html; a caller that verifies next writes a
            fuller one.
        index: Where the page of the batch is, seen from the folder; empty if of none.

    Raises:
        UnknownName: If there is no such strategy.
        Infeasible: If there is no such plan; a page that tells of it is written.
        OutOfTime: If there is none in time; such a page is written.
        InvalidInput: If the folder cannot be written.
    """
    # Whoever has a trajectory verified needs no planner.
    from vdsm_pin.refinement import plan_and_verify
    from vdsm_pin.report.html import write_no_plan, write_report

    _check_plannable(problem)
    check_outputs(problem.files, folder=folder, names=PLANNED)
    urdf, date = load_arm(problem.manipulator).urdf_sha256, now() if report else None
    record = RunRecord(command, problem.sha256, urdf_sha256=urdf, date=date)
    with naming_earlier(folder / PLAN):
        try:
            refinement = plan_and_verify(problem, strategy, deadline=deadline)
        except (Infeasible, OutOfTime) as error:
            with staged(folder) as staging:
                write_no_plan(
                    staging / NO_PLAN, problem, error, strategy, record, index
                )
            error.page = folder / NO_PLAN
            raise
    plan = refinement.plan
    with staged(folder) as staging:
        write_trajectory(plan.trajectory, staging / TRAJECTORY)
        write_centres(staging / CENTRES, problem, plan.trajectory, plan.centres)
        write_cables(staging / CABLES, problem, plan.trajectory)
        digest = sha256_of_file(staging / TRAJECTORY)
        record = replace(record, trajectory_sha256=digest)
        file = plan_file(refinement, record)
        (staging / PLAN).write_text(file.text(), encoding="utf-8")
        if report:
            judged = refinement.verification
            words = verification_file(judged, record)
            write_report(staging / REPORT, judged, words, file)
    (folder / NO_PLAN).unlink(missing_ok=True)
    return file


def _check_plannable(problem: PlanningProblem) -> None:
    """Refuse what no strategy can plan.

    Raises:
        InvalidFile: If the problem has neither tip path nor start and goal.
    """
    if problem.tip_path is None and (problem.start is None or problem.goal is None):
        need = (
            "is missing; planning needs it, or a start and a goal: tip_path states the "
            "start and what the tip shall draw. Without them `vdsm verify` judges a "
            "given motion"
        )
        raise InvalidFile(file=problem.files[0], where="tip_path", fault=need)


def verify_to_folder(order: VerifyOrder) -> Verified:
    """Verify a trajectory file and write every result of it.

    Raises:
        InvalidInput: If a file is bad or the folder cannot be written.
        VerificationFailed: If a check could not be carried out.
    """
    _check_outputs(order)
    given = read_given(order)
    with naming_earlier(order.folder / VERIFICATION), staged(order.folder) as staging:
        verified = verify_into(order, given, staging)
    if order.pdf is not None:
        print_page(order.folder / REPORT, order.pdf)
    return verified


@contextmanager
def naming_earlier(result: Path) -> Iterator[None]:
    """Have an error of the block say that a result is of an earlier run."""
    try:
        yield
    except (Infeasible, OutOfTime, VerificationFailed) as error:
        if result.exists():
            error.more += (f"{result} is of an earlier run",)
        raise


class Given(NamedTuple):
    """A trajectory file as it was read, its SHA-256, and who judges it."""

    motion: Any
    sha256: str
    subject: Subject


def read_given(order: VerifyOrder) -> Given:
    """The trajectory of an order.

    Raises:
        InvalidInput: If it is bad.
    """
    check_is_file_or_bag(order.trajectory)
    digest = sha256_of_file(order.trajectory)
    subject = subject_of(order.problem, order.options)
    return Given(subject.read(order.trajectory), digest, subject)


def verify_into(order: VerifyOrder, given: Given, staging: Path) -> Verified:
    """Verify a trajectory; all but the certificate and the PDF goes to a folder.

    Raises:
        InvalidInput: If the file has changed since it was read.
        VerificationFailed: If a check could not be carried out.
    """
    # Pages are written by jinja2, which nobody else waits for.
    from vdsm_pin.report.html import write_report

    motion, digest, subject = given
    verification = subject.judge(
        motion, staging / CLEARANCE, all_pairs=order.all_pairs, joint_error=True
    )
    step("writing the results")
    subject.write_tables(staging, verification)
    check_unchanged(order.trajectory, digest)
    hashes = order.problem.sha256, digest, subject.urdf_sha256
    record = RunRecord(order.command, *hashes, order.date)
    file = verification_file(verification, record)
    (staging / VERIFICATION).write_text(file.text(), encoding="utf-8")
    plan = planned_by(order.trajectory)
    write_report(staging / REPORT, verification, file, plan, order.index)
    # Last inside: a certificate that cannot be written leaves no half of a result.
    missing = _certify(order, verification, record)
    return Verified(file, verification, missing)


def _check_outputs(order: VerifyOrder) -> None:
    """Refuse what cannot be written before any work is done."""
    alone = (order.certificate, CERTIFICATES), (order.pdf, (".pdf",))
    files = [(file, endings) for file, endings in alone if file is not None]
    inputs = *order.problem.files, order.trajectory, order.trajectory.parent / PLAN
    check_outputs(inputs, folder=order.folder, names=JUDGED, files=files)
    if order.pdf is not None:
        find_browser()


def planned_by(trajectory: Path) -> PlanFile | None:
    """plan.json beside a trajectory, if it belongs to exactly this trajectory."""
    beside = trajectory.parent / PLAN
    try:
        text = read_text(beside, limit=MAX_PLAN_BYTES)
        plan = PlanFile.model_validate_json(text)
    except (InvalidFile, ValidationError):
        return None
    same = plan.hashes.trajectory_sha256 == sha256_of_file(trajectory)
    return plan if same else None


def _certify(order: VerifyOrder, verification: Verification, record: RunRecord) -> str:
    """Write the proof down if it is asked for, or say why not."""
    if order.certificate is None:
        return ""
    if verification.verdict is not Verdict.CERTIFIED:
        return "no proof"
    # Imported by those who ask for one: its schema takes a while to build.
    from vdsm_pin.certificate_writer.certificate import write_certificate
    from vdsm_pin.certificate_writer.lines import Hashes

    hashes = Hashes(record.problem_sha256, record.trajectory_sha256)
    how = order.options.deadline, order.options.topic
    try:
        write_certificate(order.certificate, verification, hashes, *how)
    except (OutOfTime, VerificationFailed) as error:
        return str(error)
    return ""
