"""The batch command: tasks out, folders moved into place, summaries written."""

import fcntl
import json
import shutil
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import FrameType
from typing import Final

from pydantic import ValidationError

from vdsm_pin.app.workflow import NO_PLAN, REPORT
from vdsm_pin.batch.folders import (
    MAX_BYTES,
    expanded,
    folder_names,
    jobs_by_name,
    motions,
    write_manifest,
)
from vdsm_pin.batch.pool import Ended, run_tasks
from vdsm_pin.batch.progress import progress
from vdsm_pin.batch.task import (
    MANIFEST,
    TIMING,
    WRITTEN,
    Done,
    Task,
    TaskSettings,
    failed_row,
)
from vdsm_pin.batch.worker import perform
from vdsm_pin.errors import CannotWrite, InvalidFile, InvalidInput, VdsmError
from vdsm_pin.io.atomic import write_text, writing
from vdsm_pin.io.source import read_text
from vdsm_pin.planner.strategies import strategy
from vdsm_pin.report.files import BatchRow, TimingFile
from vdsm_pin.report.film import find_browser
from vdsm_pin.report.folder import check_outputs, staged
from vdsm_pin.report.html import write_index
from vdsm_pin.report.summaries import (
    COLUMNS,
    junit_text,
    summary_csv,
    write_columns,
    write_summary,
)

SUMMARY: Final = "summary.csv"
RUNNING: Final = "running.csv"
"""The same while the batch is at work: its rows as they come."""

JUNIT: Final = "junit.xml"
INDEX: Final = "index.html"
SECONDS: Final = "timing.js"
_STAGING: Final = ".unfinished"
_LOCK: Final = ".lock"


OWN: Final = SUMMARY, RUNNING, COLUMNS, JUNIT, INDEX, SECONDS, _STAGING, _LOCK
"""What a batch writes beside the folders of its problems."""


@dataclass(frozen=True)
class Batch:
    """What the user asked for.

    Args:
        problems: Built-in names, problem files, folders; none means the built-ins.
        folder: Where the results go.
        settings: How each problem is done.
        jobs: Number of processes.
        scheduler: Address of a Dask scheduler whose workers do it; None for here.
        quiet: Whether nothing is said of problems that end.
        trajectories: Given motions, files or folders of them, each of which is verified
            for each problem; none to plan.
    """

    problems: tuple[str, ...]
    folder: Path
    settings: TaskSettings
    jobs: int = 1
    scheduler: str | None = None
    quiet: bool = False
    trajectories: tuple[str, ...] = ()


class Interrupted(VdsmError):
    """The user stopped a batch; what was finished is kept."""


def run_batch(batch: Batch) -> tuple[BatchRow, ...]:
    """Do a batch.

    Returns:
        One row per problem.

    Raises:
        InvalidInput: If the folder, a name or the strategy is wrong.
        CannotWrite: If results cannot be written; earlier ones stay.
        Interrupted: On Ctrl-C or SIGTERM, after everything finished is written down.
    """
    strategy(batch.settings.strategy)
    if batch.settings.pdf:
        find_browser()
    tasks = _tasks(batch)
    batch.folder.mkdir(parents=True, exist_ok=True)
    with writing(batch.folder), _locked(batch.folder), _stoppable() as stop:
        rows: list[BatchRow] = []
        with progress(len(tasks), batch.quiet) as show, _fresh_staging(batch.folder):
            with summary_csv(batch.folder / RUNNING) as so_far:
                try:
                    for ended in _all_ended(batch, tasks):
                        done = _settle(ended)
                        if done.unwritten:
                            why = f"{done.unwritten}; {_count(rows, tasks)}"
                            raise CannotWrite(file=batch.folder, reason=why)
                        rows.append(done.row)
                        so_far(done.row)
                        show(done)
                        if stop.asked:
                            break
                except KeyboardInterrupt:
                    stop.asked = True
            _write_summaries(batch, rows)
        (batch.folder / RUNNING).unlink()
    if stop.asked and len(rows) < len(tasks):
        message = f"stopped; {_count(rows, tasks)}"
        raise Interrupted(message)
    return tuple(rows)


def _count(rows: Sequence[BatchRow], tasks: Sequence[Task]) -> str:
    finished = f"{len(rows)} of {len(tasks)} problems are finished"
    return f"{finished}, --resume does the rest"


@contextmanager
def _fresh_staging(folder: Path) -> Iterator[None]:
    """A block before and after which nothing is staged, whoever was killed before."""
    shutil.rmtree(folder / _STAGING, ignore_errors=True)
    try:
        yield
    finally:
        shutil.rmtree(folder / _STAGING, ignore_errors=True)


def _all_ended(batch: Batch, tasks: list[Task]) -> Iterator[Ended[Task, Done]]:
    """The tasks as they end, here or on a cluster."""
    if batch.scheduler is None:
        limit = batch.settings.time_limit
        return run_tasks(tasks, perform, jobs=batch.jobs, time_limit=limit)
    from vdsm_pin.batch.cluster import run_on_cluster

    return run_on_cluster(tasks, batch.scheduler)


def _tasks(batch: Batch) -> list[Task]:
    """The tasks."""
    problems = expanded(batch.problems)
    given: tuple[str | None, ...] = (None,)
    if batch.trajectories:
        given = motions(batch.trajectories, {Path(name).resolve() for name in problems})
    jobs = jobs_by_name(problems, given)
    names = folder_names(tuple(jobs), OWN)
    _check_own(batch.folder)
    files = [name for name in OWN if name != _STAGING]
    inputs = map(Path, (*problems, *filter(None, given)))
    check_outputs(inputs, folder=batch.folder, names=files)
    tasks = []
    for job, name in names.items():
        problem, motion = jobs[job]
        final, staging = batch.folder / name, batch.folder / _STAGING / name
        _check_replaceable(final)
        tasks.append(Task(problem, final, staging, batch.settings, motion))
    return tasks


def _check_own(folder: Path) -> None:
    """Refuse a folder with files that would be overwritten and are no batch's."""
    if (folder / _LOCK).exists():
        return
    for file in (folder / name for name in OWN):
        if file.exists():
            what = "exists and is not a result of a batch; nothing was overwritten"
            raise InvalidFile(file=file, fault=what)


def _check_replaceable(final: Path) -> None:
    """Refuse to replace a folder in which something is that no batch wrote."""
    if not final.exists():
        return
    if not (final / MANIFEST).is_file():
        what = "exists and is not a result of a batch; nothing was overwritten"
        raise InvalidFile(file=final, fault=what)
    foreign = sorted({path.name for path in final.iterdir()} - WRITTEN)
    if foreign:
        what = f"holds {foreign[0]!r}, which no batch wrote; nothing was overwritten"
        raise InvalidFile(file=final, fault=what)


def _settle(ended: Ended[Task, Done]) -> Done:
    """Move what a worker wrote into place, or write down that it was lost."""
    task, done = ended.task, ended.result
    if done is not None and done.kept:
        return done
    if done is None:
        shutil.rmtree(task.staging, ignore_errors=True)
        done = Done(failed_row(task, ended.outcome, ended.reason), kept=False)
        write_manifest(task, done.row, "", task.depends_on())
    if task.final.exists():
        task.final.rename(task.staging.with_name(f"{task.final.name}.replaced"))
    task.staging.rename(task.final)
    return done


def _write_summaries(batch: Batch, rows: list[BatchRow]) -> None:
    folder = batch.folder
    ordered = sorted(rows, key=lambda row: row.folder)
    seconds = {row.folder: seconds_of(folder / row.folder) for row in ordered}
    known = {name: value for name, value in seconds.items() if value is not None}
    script = f"window.vdsmTiming = {json.dumps(known, indent=1)};\n"
    with staged(folder, folder / _STAGING) as staging:
        write_summary(staging / SUMMARY, ordered)
        write_columns(staging / COLUMNS, ordered)
        write_text(staging / JUNIT, junit_text(ordered))
        write_index(staging / INDEX, ordered, _pages(batch, ordered))
        write_text(staging / SECONDS, script)


def _pages(batch: Batch, rows: list[BatchRow]) -> dict[str, str]:
    """The page of each problem that kept one, by its folder."""
    wanted = {row.folder: REPORT if row.waypoints else NO_PLAN for row in rows}
    return {
        name: page
        for name, page in wanted.items()
        if (batch.folder / name / page).is_file()
    }


def seconds_of(folder: Path) -> float | None:
    """What the problem of a folder took, by its own file; None where there is none."""
    try:
        text = read_text(folder / TIMING, limit=MAX_BYTES)
        return TimingFile.model_validate_json(text).seconds
    except (InvalidFile, ValidationError):
        return None


@contextmanager
def _locked(folder: Path) -> Iterator[None]:
    """One batch at a time in a folder; the lock ends with the process."""
    with (folder / _LOCK).open("w", encoding="utf-8") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            message = f"{folder}: another batch is writing there"
            raise InvalidInput(message) from error
        yield


@dataclass
class _Stop:
    """Whether the user asked for an end."""

    asked: bool = False


@contextmanager
def _stoppable() -> Iterator[_Stop]:
    """Ctrl-C and SIGTERM end a batch.

    They interrupt what is under way, and are noted besides: Python loses an exception
    that comes at the end of a generator or in a callback.
    """
    stop = _Stop()

    def ask(number: int, frame: FrameType | None) -> None:
        stop.asked = True
        raise KeyboardInterrupt

    signals = signal.SIGINT, signal.SIGTERM
    before = {number: signal.signal(number, ask) for number in signals}
    try:
        yield stop
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
