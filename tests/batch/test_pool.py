"""Oracle: each errand's own answer; the processes that are left afterwards."""

import multiprocessing
import os

import pytest
from errands import errand

from vdsm_pin.batch import pool
from vdsm_pin.batch.pool import WorkerFailed, run_tasks


@pytest.mark.parametrize("jobs", [2])
def test_every_task_ends_once_whatever_the_others_do(jobs: int) -> None:
    words = ["a", "crash", "b", "hang", "c", "leave", "d"]
    ended = list(run_tasks(words, errand, jobs=jobs, time_limit=1.0))
    assert sorted(one.task for one in ended) == sorted(words)
    outcomes = {one.task: (one.result, one.outcome) for one in ended}
    for word in "abcd":
        assert outcomes[word] == (f"{word}, 1", "done")
    assert outcomes["crash"] == (None, "error")
    assert outcomes["leave"] == (None, "error")
    assert outcomes["hang"] == (None, "time-limit")
    reasons = {one.task: one.reason for one in ended}
    assert "SIGSEGV" in reasons["crash"]
    assert "exit code 7" in reasons["leave"]
    assert not multiprocessing.active_children()
    assert "OMP_NUM_THREADS" not in os.environ


def test_a_process_that_eats_memory_is_given_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(pool, "_MEMORY_SHARE", 0.0)
    monkeypatch.setattr(pool, "_memory_limit", lambda jobs: 200.0 * 2**20)
    (ended,) = run_tasks(["eat"], errand, jobs=1)
    assert ended.outcome == "error"
    assert "GiB" in ended.reason


def test_leaving_early_leaves_no_process_behind() -> None:
    ended = run_tasks(["a", "hang", "b"], errand, jobs=2)
    next(ended)
    ended.close()  # type: ignore[attr-defined]
    assert not multiprocessing.active_children()


def test_a_function_that_cannot_be_loaded_is_an_error() -> None:
    with pytest.raises((WorkerFailed, AttributeError)):
        list(run_tasks(["a"], lambda word: word, jobs=1))
