"""The tasks of a batch on a Dask cluster: many machines, one shared file system.

Each Dask worker keeps one warm process per thread and gives it one problem at a time,
so a problem that crashes, hangs or eats memory ends as the same row as in a local batch
and leaves the worker alive. A lost worker has its problems done again elsewhere; every
attempt writes a folder of its own, and only the reported one is moved into place.
"""

import itertools
import multiprocessing
import os
import threading
import uuid
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from vdsm_pin.batch.pool import Ended, WarmProcess
from vdsm_pin.batch.task import Done, Task
from vdsm_pin.batch.worker import perform
from vdsm_pin.errors import InvalidInput
from vdsm_pin.report.run_record import versions

if TYPE_CHECKING:
    from distributed import Client, Future

LONGEST_ERRAND: Final = 64
"""Problems. A scheduler needs about ten milliseconds for such an errand, so that it
feeds some five hundred cores that do ten problems a second, more where they take
longer.
"""

_ERRANDS_AHEAD: Final = 3  # for each thread, so that none waits for the scheduler
_CONNECT: Final = "20s"

_ours = threading.local()


def _perform(placed: tuple[Task, Path]) -> Done:
    """Perform a task whose paths start from a folder, in a warm process.

    The process may have done others elsewhere.
    """
    task, folder = placed
    os.chdir(folder)
    return perform(task)


@dataclass(frozen=True)
class _Errand:
    """Some problems for one worker.

    Args:
        tasks: Done one after the other.
        folder: Working directory of the command, which relative paths start from.
        versions: What the worker must have installed.
    """

    tasks: tuple[Task, ...]
    folder: Path
    versions: dict[str, str]


def run_on_cluster(tasks: Sequence[Task], address: str) -> Iterator[Ended[Task, Done]]:
    """Perform the tasks on the workers of a Dask scheduler.

    Args:
        tasks: Their folders must be reachable by the workers under the same names.
        address: Such as `tcp://host:8786`.

    Yields:
        Each task when it ends, in any order. Its `staging` is where the worker wrote.

    Raises:
        InvalidInput: If there is no scheduler, or a worker cannot do the work.
    """
    client = _connected(address)
    from distributed import as_completed

    try:
        threads = sum(client.nthreads().values()) or 1
        errands = iter(_errands(tasks, threads))
        first = itertools.islice(errands, threads * _ERRANDS_AHEAD)
        asked = {_send(client, errand): errand for errand in first}
        running = as_completed(list(asked), loop=client.loop)
        for future in running:
            ended = _ended(future, asked.pop(future))
            for errand in itertools.islice(errands, 1):
                following = _send(client, errand)
                asked[following] = errand
                running.add(following)
            yield from ended
    finally:
        # Closing drops every future, and with it what has not been started.
        client.close()


def _connected(address: str) -> "Client":
    try:
        from distributed import Client
    except ImportError as error:
        message = "--scheduler needs Dask: pip install 'vdsm-pin[cluster]'"
        raise InvalidInput(message) from error
    try:
        return Client(address, timeout=_CONNECT, set_as_default=False)
    except (OSError, ValueError) as error:
        message = f"no Dask scheduler answers at {address}: {error}"
        raise InvalidInput(message) from error


def _errands(tasks: Sequence[Task], threads: int) -> Iterator[_Errand]:
    """Long errands for large batches, short ones to share out few problems."""
    share = len(tasks) // (threads * 8)
    size = max(1, min(LONGEST_ERRAND, share))
    folder, ours = Path.cwd(), versions()
    for k in range(0, len(tasks), size):
        yield _Errand(tuple(tasks[k : k + size]), folder, ours)


def _send(client: "Client", errand: _Errand) -> "Future":
    return client.submit(_run, errand, pure=False)


def _ended(future: "Future", errand: _Errand) -> list[Ended[Task, Done]]:
    """What became of an errand."""
    from distributed import KilledWorker

    try:
        result: list[Ended[Task, Done]] = future.result()
    except KilledWorker:
        reason = "every worker that was given this problem was lost"
        return [Ended(task, None, "error", reason) for task in errand.tasks]
    return result


def _run(errand: _Errand) -> list[Ended[Task, Done]]:
    """Life of an errand inside a Dask worker."""
    if errand.versions != versions():
        message = "a worker has other versions than this machine: "
        raise InvalidInput(message + _difference(errand.versions, versions()))
    if multiprocessing.current_process().daemon:
        message = "a Dask worker may not start processes: run it with --no-nanny"
        raise InvalidInput(message)
    if not errand.folder.is_dir():
        message = f"a worker has no folder {errand.folder}, which paths start from"
        raise InvalidInput(message)
    if not hasattr(_ours, "process"):
        _ours.process = WarmProcess(_perform)
    process: WarmProcess[tuple[Task, Path], Done] = _ours.process
    found = []
    for task in errand.tasks:
        tried = _attempt(task)
        ended = process.run((tried, errand.folder), task.settings.time_limit)
        found.append(Ended(tried, ended.result, ended.outcome, ended.reason))
    return found


def _attempt(task: Task) -> Task:
    """The task with a folder of this attempt alone."""
    name = f"{task.staging.name}.{uuid.uuid4().hex[:8]}"
    return replace(task, staging=task.staging.with_name(name))


def _difference(ours: dict[str, Any], theirs: dict[str, Any]) -> str:
    names = [name for name in ours if ours[name] != theirs.get(name)]
    return ", ".join(f"{n} {theirs.get(n)} instead of {ours[n]}" for n in names)
