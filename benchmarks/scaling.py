"""What a million problems on a thousand cores would cost, from what one costs here.

    python -m benchmarks.scaling [--problems 24] [--cores 1000] [--save FOLDER]

Measured: processor time of a small problem in a warm process; bytes of its folder for
every `--keep`; bytes of its row in Parquet; processor time of a real Dask scheduler for
an errand of the size this package sends, with workers that answer at once. The rest is
arithmetic, spelled out in the page.
"""

import argparse
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from distributed import Client, as_completed

from benchmarks.batch import write_problems
from benchmarks.common import Results, described, save, surroundings, table
from vdsm_pin.batch.cluster import LONGEST_ERRAND
from vdsm_pin.batch.pool import Ended
from vdsm_pin.batch.task import Done, Task, TaskSettings
from vdsm_pin.batch.worker import perform
from vdsm_pin.report.files import BatchRow
from vdsm_pin.report.summaries import write_columns

PROBLEMS = 1_000_000

PAGE = """\
# A million problems, modelled

Rebuilt by `python -m benchmarks.scaling --save reports/performance`.

{around}

## Measured

{measured}
## Modelled: {problems:,} problems on {cores:,} cores

| what | value | how |
|---|---|---|
| most cores one scheduler feeds | {most:,.0f} | where it is busy all the time |
| cores at work | {fed:,.0f} | no more than one scheduler feeds |
| throughput | {rate:.0f} problems a second | cores at work / time of a problem |
| duration | {minutes:.1f} min | problems / throughput |
| errands | {errands:.1f} a second | throughput / {errand} problems an errand |
| scheduler | {busy:.1%} of a core | errands x its processor time for one |
| written while it runs, keep all | {stream:.0f} MB/s | throughput x bytes of a folder |
| storage, keep all | {keep_all:.0f} GB | problems x bytes of a folder |
| storage, keep none | {keep_none:.1f} GB | problems x bytes of manifest and timing |
| files, keep all | {files_all:,.0f} | problems x files of a folder |
| files, keep none | {files_none:,.0f} | problems x 2 |
| rows.parquet | {parquet:.0f} MB | problems x bytes of a row |
"""


def one_problem(results: Results, folder: Path, count: int) -> BatchRow:
    """Processor time and bytes of small problems, one after the other in here."""
    write_problems(folder / "problems", count + 1)
    files = sorted((folder / "problems").iterdir())
    rows, seconds, sizes, numbers = [], [], [], []
    for file in files:
        aside = folder / "aside" / file.stem
        task = Task(str(file), folder / "x", aside, TaskSettings("paper"))
        start = time.process_time()
        done = perform(task)
        seconds.append(time.process_time() - start)
        written = [path.stat().st_size for path in aside.iterdir()]
        sizes.append(sum(written))
        numbers.append(len(written))
        rows.append(done.row)
    row = rows[-1]
    spent = sorted(seconds[1:])  # the first one loads what stays warm
    results["a problem in a warm process [s]"] = {
        "median": spent[len(spent) // 2], "p95": spent[int(0.95 * len(spent))],
        "waypoints": float(row.waypoints or 0),
    }  # fmt: skip
    results["its folder, keep all [kB]"] = {
        "median": sorted(sizes)[len(sizes) // 2] / 1e3, "files": float(numbers[-1]),
    }  # fmt: skip
    perform(replace(task, settings=TaskSettings("paper", keep="none")))
    left = sum(path.stat().st_size for path in aside.iterdir())
    results["its folder, keep none, or failed where it passed [kB]"] = {
        "median": left / 1e3, "files": float(len(list(aside.iterdir()))),
    }  # fmt: skip
    rng = np.random.default_rng(0)
    many = [_varied(rows[k % len(rows)], f"small{k:07}", rng) for k in range(10_000)]
    write_columns(folder / "rows.parquet", many)
    size = (folder / "rows.parquet").stat().st_size
    results["its row in Parquet [byte]"] = {"median": size / len(many)}
    return row


def _varied(row: BatchRow, name: str, rng: np.random.Generator) -> BatchRow:
    """Such a row of another problem: no two numbers alike, as in a real batch."""
    return row.model_copy(
        update={
            key: value * rng.uniform(0.9, 1.1)
            for key, value in row.model_dump().items()
            if isinstance(value, float)
        }
        | {"folder": name, "problem": name}
    )


def answer(tasks: tuple[Task, ...], row: BatchRow) -> list[Ended[Task, Done]]:
    """What an errand hands back, without doing it."""
    return [Ended(task, Done(row, kept=False), "done") for task in tasks]


@contextmanager
def scheduler(folder: Path, workers: int) -> Iterator[tuple[Client, int]]:
    """A scheduler and workers in processes of their own; its process number."""
    file, common = folder / "scheduler.json", ["--host", "127.0.0.1", "--no-dashboard"]
    started = [_started("dask_scheduler", "--port", "0", "--scheduler-file",
                        str(file), *common)]  # fmt: skip
    try:
        started += [
            _started("dask_worker", "--scheduler-file", str(file), "--no-nanny",
                     "--nthreads", "1", "--local-directory", str(folder), *common)
            for _ in range(workers)
        ]  # fmt: skip
        while not file.exists():
            time.sleep(0.1)
        with Client(scheduler_file=str(file), set_as_default=False) as client:
            client.wait_for_workers(workers, timeout=120)
            yield client, started[0].pid
    finally:
        for process in started:
            process.kill()
            process.wait()


def _started(module: str, *words: str) -> subprocess.Popen[bytes]:
    line = [sys.executable, "-m", f"distributed.cli.{module}", *words]
    return subprocess.Popen(line, stderr=subprocess.DEVNULL)


def processor_seconds(pid: int) -> float:
    """Processor time of another process so far; [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="ascii").rsplit(")", 1)[1]
    ticks = fields.split()[11:13]
    return sum(map(int, ticks)) / os.sysconf("SC_CLK_TCK")


def scheduling(results: Results, folder: Path, row: BatchRow, errands: int) -> None:
    """Processor time of the scheduler for an errand."""
    tasks = tuple(
        Task(f"problems/small{k:05}.yaml", folder / f"small{k:05}",
             folder / f"aside{k}", TaskSettings("paper"))
        for k in range(LONGEST_ERRAND)
    )  # fmt: skip
    with scheduler(folder, 2) as (client, pid):
        client.gather([client.submit(answer, tasks, row, pure=False)])
        before, start = processor_seconds(pid), time.perf_counter()
        waiting = [
            client.submit(answer, tasks, row, pure=False) for _ in range(errands)
        ]
        for future in as_completed(waiting, loop=client.loop):
            assert len(future.result()) == LONGEST_ERRAND
        wall = time.perf_counter() - start
        spent = processor_seconds(pid) - before
    results[f"scheduler, an errand of {LONGEST_ERRAND} problems [ms]"] = {
        "median": 1e3 * spent / errands, "errands": float(errands),
        "errands a second here": errands / wall,
    }  # fmt: skip


def page(results: Results, cores: int) -> str:
    """What was measured and what follows from it."""
    by_start = {name.split(" [")[0]: row for name, row in results.items()}
    cost = by_start["a problem in a warm process"]["median"]
    keep_all = by_start["its folder, keep all"]
    keep_none = by_start["its folder, keep none, or failed where it passed"]
    errand_ms = by_start[f"scheduler, an errand of {LONGEST_ERRAND} problems"]["median"]
    most = LONGEST_ERRAND * cost / (errand_ms / 1e3)
    fed = min(float(cores), most)
    rate = fed / cost
    errands = rate / LONGEST_ERRAND
    busy = errands * errand_ms / 1e3
    return PAGE.format(
        around=described(surroundings()), measured=table(results),
        problems=PROBLEMS, cores=cores,
        fed=fed, rate=rate, minutes=PROBLEMS / rate / 60.0, errands=errands,
        errand=LONGEST_ERRAND, busy=busy, most=most,
        stream=rate * keep_all["median"] / 1e3,
        keep_all=PROBLEMS * keep_all["median"] / 1e6,
        keep_none=PROBLEMS * keep_none["median"] / 1e6,
        files_all=PROBLEMS * keep_all["files"],
        files_none=PROBLEMS * keep_none["files"],
        parquet=PROBLEMS * by_start["its row in Parquet"]["median"] / 1e6,
    )  # fmt: skip


def main() -> None:
    """Measure, model, write."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--problems", type=int, default=24)
    parser.add_argument("--errands", type=int, default=1000)
    parser.add_argument("--cores", type=int, default=1000)
    parser.add_argument("--save", type=Path, metavar="FOLDER")
    asked = parser.parse_args()
    results: Results = {}
    with tempfile.TemporaryDirectory() as name:
        row = one_problem(results, Path(name), asked.problems)
        scheduling(results, Path(name), row, asked.errands)
    text = page(results, asked.cores)
    print(text)
    if asked.save:
        save(asked.save / "scaling.json", results)
        (asked.save / "scaling.md").write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
