"""Warm worker processes; one that crashes, hangs or eats memory ends alone."""

import contextlib
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, Final, Generic, TypeVar

from vdsm_pin.errors import OutOfTime, VdsmError
from vdsm_pin.report.words import TIME_LIMIT
from vdsm_pin.time_limit import NO_LIMIT, Deadline

Task = TypeVar("Task")
Result = TypeVar("Result")

_ONE_THREAD: Final = (
    "OMP_NUM_THREADS",
    "OPENBLAS_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
)
_LOOK: Final = 0.5  # seconds between looks at deadlines and memory
GRACE: Final = 0.9
"""A task that has heard of its time limit ends by itself within this; [s]."""

_MEMORY_SHARE: Final = 0.85  # of the machine's memory, split between the workers
_READY: Final = "ready"


@dataclass(frozen=True)
class Ended(Generic[Task, Result]):
    """One task that ended.

    Args:
        task: The task.
        result: What its function returned; None if its process had to be given up.
        outcome: "done", "error" or "time-limit".
        reason: Why the process was given up; empty if it was not.
    """

    task: Task
    result: Result | None
    outcome: str
    reason: str = ""


@dataclass
class _Worker(Generic[Task]):
    """A process, our end of its pipe, and what it is busy with."""

    process: BaseProcess
    pipe: Connection
    task: Task | None = None
    ready: bool = False
    deadline: Deadline = NO_LIMIT

    def give_up(self) -> None:
        self.process.kill()
        self.process.join()
        self.pipe.close()


class WorkerFailed(VdsmError):
    """A worker process ended before it was ready: no task can run."""


def run_tasks(
    tasks: Sequence[Task],
    perform: Callable[[Task], Result],
    *,
    jobs: int,
    time_limit: float | None = None,
) -> Iterator[Ended[Task, Result]]:
    """Perform every task in its turn on one of `jobs` processes.

    Args:
        tasks: Picklable.
        perform: A function of a module; importing it is what warms a process.
        jobs: Number of processes.
        time_limit: For each task, from the moment a warm process receives it: one that
            has not ended `GRACE` later is given up; [s].

    Yields:
        Each task when it ends, in any order.

    Raises:
        WorkerFailed: If a process ends before it is ready.
    """
    waiting = list(reversed(tasks))
    limit = float("inf") if time_limit is None else time_limit
    most = _memory_limit(jobs)
    workers: list[_Worker[Task]] = []
    try:
        while waiting or any(worker.task is not None for worker in workers):
            wanted = min(jobs, len(waiting) + sum(w.task is not None for w in workers))
            while len(workers) < wanted:
                workers.append(_start(perform))
            _feed(workers, waiting, limit)
            wait([worker.pipe for worker in workers], timeout=_pause(workers))
            for worker in list(workers):
                ended = _look_at(worker, most)
                if ended is not None:
                    yield ended
                if worker.pipe.closed:
                    workers.remove(worker)
    finally:
        for worker in workers:
            worker.give_up()


class WarmProcess(Generic[Task, Result]):
    """One process that stays warm between the tasks it is given one at a time.

    Args:
        perform: A function of a module; importing it is what warms the process.
    """

    def __init__(self, perform: Callable[[Task], Result]) -> None:
        self._perform = perform
        self._worker: _Worker[Task] | None = None

    def run(self, task: Task, time_limit: float | None) -> Ended[Task, Result]:
        """Perform a task; a process that is lost with it is replaced for the next.

        Raises:
            WorkerFailed: If the process ends before it is ready.
        """
        worker = self._worker = self._worker or _start(self._perform)
        waiting = [task]
        most = _memory_limit(os.cpu_count() or 1)
        ended: Ended[Task, Result] | None = None
        try:
            while ended is None:
                _feed([worker], waiting, time_limit or float("inf"))
                wait([worker.pipe], timeout=_pause([worker]))
                ended = _look_at(worker, most)
        finally:
            if ended is None and not worker.pipe.closed:
                worker.give_up()
            if worker.pipe.closed:
                self._worker = None
        return ended


def _start(perform: Callable[[Task], Result]) -> _Worker[Task]:
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, perform), daemon=True)
    with _environment(dict.fromkeys(_ONE_THREAD, "1")):
        process.start()
    theirs.close()
    return _Worker(process, ours)


@contextlib.contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    """Environment variables for the processes started inside."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value


def _feed(workers: list[_Worker[Task]], waiting: list[Task], limit: float) -> None:
    for worker in workers:
        if worker.ready and worker.task is None and waiting:
            worker.task = waiting.pop()
            worker.deadline = Deadline(limit, time.monotonic() + limit + GRACE)
            # A worker that just died is found out when it is looked at.
            with contextlib.suppress(BrokenPipeError):
                worker.pipe.send(worker.task)


def _pause(workers: list[_Worker[Task]]) -> float:
    soonest = min((worker.deadline.end for worker in workers), default=float("inf"))
    return max(0.0, min(_LOOK, soonest - time.monotonic()))


def _look_at(worker: _Worker[Task], most: float) -> Ended[Task, Any] | None:
    """What became of a worker since the last look; a lost one has its pipe closed."""
    task = worker.task
    try:
        if worker.pipe.poll():
            message = worker.pipe.recv()
            if not worker.ready:
                worker.ready = message == _READY
                return None
            worker.task, worker.deadline = None, NO_LIMIT
            assert task is not None
            return Ended(task, message, "done")
    except (EOFError, ConnectionError):
        worker.process.join()
        code = worker.process.exitcode
        worker.give_up()
        if task is None:
            message = f"a worker process ended with code {code} before it was ready"
            raise WorkerFailed(message) from None
        return Ended(task, None, "error", f"the process crashed: {_died_of(code)}")
    if task is None:
        return None
    if worker.deadline.passed:
        worker.give_up()
        late = OutOfTime(worker.deadline.limit, "the process did not end by itself")
        return Ended(task, None, TIME_LIMIT, str(late))
    if _memory_of(worker.process.pid) > most:
        worker.give_up()
        return Ended(task, None, "error", f"used more than {most / 2**30:.1f} GiB")
    return None


def _died_of(code: int | None) -> str:
    if code is not None and code < 0:
        return signal.Signals(-code).name
    return f"exit code {code}"


def _memory_limit(jobs: int) -> float:
    try:
        pages = os.sysconf("SC_PHYS_PAGES")
    except (ValueError, OSError):
        return float("inf")
    return _MEMORY_SHARE * pages * os.sysconf("SC_PAGE_SIZE") / jobs


def _memory_of(pid: int | None) -> float:
    """Resident memory of a process; 0 where the system does not tell; [byte]."""
    try:
        fields = Path(f"/proc/{pid}/statm").read_text(encoding="ascii").split()
    except OSError:
        return 0.0
    return float(fields[1]) * os.sysconf("SC_PAGE_SIZE")


def _serve(pipe: Connection, perform: Callable[[Task], Result]) -> None:
    """Life of a worker: it ends with its parent, however that ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    answer: Any = _READY
    while True:
        try:
            pipe.send(answer)
            task = pipe.recv()
        except (EOFError, ConnectionError):  # nobody is left to ask
            return
        answer = perform(task)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
