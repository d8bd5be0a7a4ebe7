"""Oracle: the bytes of the same batch done here by one process."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from batch_folders import tree
from problem_files import NEAR, OUT_OF_REACH, write_problem

from vdsm_pin.batch import cluster
from vdsm_pin.batch.run import Batch, run_batch
from vdsm_pin.batch.task import Task, TaskSettings
from vdsm_pin.errors import InvalidInput
from vdsm_pin.report.run_record import versions

distributed = pytest.importorskip("distributed")

N_GOOD = 9
PATIENCE = 90.0  # seconds a scheduler or worker may take to come up on a busy machine
NEEDS = ["--host", "127.0.0.1", "--no-dashboard"]


def until(condition: Callable[[], bool]) -> None:
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.01)


def started(module: str, *words: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", f"distributed.cli.{module}", *NEEDS, *words]
    return subprocess.Popen(command, stderr=subprocess.DEVNULL)


def ended(processes: list[subprocess.Popen[bytes]]) -> None:
    for process in processes:
        process.kill()
        process.wait()


def worker(address: str, folder: Path, *words: str) -> subprocess.Popen[bytes]:
    aside = ["--nthreads", "1", "--local-directory", str(folder)]
    return started("dask_worker", address, *aside, *words)


@pytest.fixture
def scheduler(tmp_path: Path) -> Iterator[str]:
    """Address of a scheduler without workers."""
    file = tmp_path / "scheduler.json"
    process = started("dask_scheduler", "--port", "0", "--scheduler-file", str(file))
    try:
        until(file.exists)
        with distributed.Client(scheduler_file=str(file), set_as_default=False) as c:
            yield c.scheduler.address
    finally:
        ended([process])


@pytest.fixture
def problems(tmp_path: Path) -> Path:
    """Nine problems to solve, one out of reach, one broken file."""
    folder = tmp_path / "problems"
    folder.mkdir()
    for k in range(N_GOOD):
        text = NEAR.replace("[2000, 900", f"[{2000 + 20 * k}, 900")
        write_problem(folder / f"good{k}.yaml", text)
    write_problem(folder / "far.yaml", OUT_OF_REACH)
    write_problem(folder / "bad.yaml", "vdsm_problem: 1\n")
    return folder


@pytest.mark.slow
def test_a_lost_worker_changes_no_byte(
    problems: Path, scheduler: str, tmp_path: Path
) -> None:
    here, there = tmp_path / "here", tmp_path / "there"
    run_batch(Batch((str(problems),), here, TaskSettings("paper")))
    workers = [worker(scheduler, tmp_path, "--no-nanny") for _ in range(3)]
    busy = threading.Event()

    def kill_one() -> None:
        """Kill the worker whose attempt has just begun to write."""
        attempts = there / ".unfinished"
        until(lambda: attempts.is_dir() and any(attempts.iterdir()))
        until(lambda: any(there.glob("*/manifest.json")))
        os.kill(workers[0].pid, signal.SIGKILL)
        busy.set()

    try:
        with distributed.Client(scheduler, set_as_default=False) as client:
            client.wait_for_workers(3, timeout=PATIENCE)
        killer = threading.Thread(target=kill_one)
        killer.start()
        rows = run_batch(
            Batch((str(problems),), there, TaskSettings("paper"), scheduler=scheduler)
        )
        killer.join()
        assert busy.is_set()
        assert workers[0].wait() == -signal.SIGKILL
    finally:
        ended(workers)
    assert len(rows) == N_GOOD + 2
    assert tree(there) == tree(here)


@pytest.mark.slow
def test_a_worker_that_may_not_start_processes_is_told_how(
    problems: Path, scheduler: str, tmp_path: Path
) -> None:
    workers = [worker(scheduler, tmp_path)]
    try:
        with pytest.raises(InvalidInput, match="--no-nanny"):
            run_batch(
                Batch(
                    (str(problems),),
                    tmp_path / "out",
                    TaskSettings("paper"),
                    scheduler=scheduler,
                )
            )
    finally:
        ended(workers)


def test_paths_start_from_the_folder_of_each_batch(tmp_path: Path) -> None:
    """Oracle: what each folder's file is, though one process reads them all."""
    task = Task("p.yaml", tmp_path / "a", tmp_path / "b", TaskSettings("paper"))
    here = Path.cwd()
    for name in ("one", "two", "one"):
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        (folder / "p.yaml").write_text(f"vdsm_problem: 1\n{name}: 1\n")
        (found,) = cluster._run(cluster._Errand((task,), folder, versions()))
        assert found.result is not None
        assert name in found.result.row.reason
    cluster._ours.process._worker.give_up()
    del cluster._ours.process
    assert Path.cwd() == here
    with pytest.raises(InvalidInput, match="a worker has no folder"):
        cluster._run(cluster._Errand((task,), tmp_path / "three", versions()))


def test_no_scheduler_is_a_message(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("vdsm_pin.batch.cluster._CONNECT", "1s")
    asked = Batch(
        ("paper/free",),
        tmp_path / "out",
        TaskSettings("paper"),
        scheduler="tcp://127.0.0.1:9",
    )
    with pytest.raises(InvalidInput, match="no Dask scheduler answers"):
        run_batch(asked)
