"""Oracle: the bytes of whole folders, compared between runs; the exit status.

Timing files are the only ones that may differ.
"""

import contextlib
import fcntl
import random
import re
import resource
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from itertools import pairwise
from pathlib import Path

import junitparser
import pytest
from batch_folders import tree
from problem_files import BEHIND_A_WALL, NEAR, OUT_OF_REACH, write_problem

import vdsm_pin.batch.folders as inputs_module
import vdsm_pin.batch.run as run_module
import vdsm_pin.batch.worker as worker_module
from vdsm_pin.batch.folders import expanded, folder_names, passed_over
from vdsm_pin.batch.pool import Ended
from vdsm_pin.batch.run import Batch, Interrupted, run_batch
from vdsm_pin.batch.task import MANIFEST, TIMING, Done, Task, TaskSettings
from vdsm_pin.batch.worker import perform
from vdsm_pin.errors import CannotWrite, InvalidFile, InvalidInput, UnknownName
from vdsm_pin.report.summaries import read_summary

NAMES = ("good", "other", "far", "bad")


@pytest.fixture(scope="module")
def problems(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder of problem files: two to solve, one without a plan, one broken."""
    folder = tmp_path_factory.mktemp("problems")
    write_problem(folder / "good.yaml", NEAR)
    write_problem(folder / "other.yaml", NEAR.replace("[2000, 900", "[2100, 950"))
    write_problem(folder / "far.yaml", OUT_OF_REACH)
    write_problem(folder / "bad.yaml", "vdsm_problem: 1\n")
    return folder


@pytest.fixture(scope="module")
def reference(problems: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The batch done once, by one process."""
    folder = tmp_path_factory.mktemp("reference") / "out"
    run_batch(Batch((str(problems),), folder, TaskSettings("paper")))
    return folder


def command(problems: Path, out: Path, *more: str) -> list[str]:
    words = ["batch", str(problems), "--out", str(out), "--strategy", "paper"]
    words += ["--time-limit", "inf"]  # as the reference has none
    return [sys.executable, "-m", "vdsm_pin", *words, *more]


def test_every_problem_has_its_row_and_its_folder(reference: Path) -> None:
    rows = {row.folder: row for row in read_summary(reference / "summary.csv")}
    outcomes = {name: row.outcome for name, row in rows.items()}
    assert outcomes == {
        "good": "certified",
        "other": "certified",
        "far": "infeasible",
        "bad": "error",
    }
    assert "reach" in rows["far"].reason
    assert "bad.yaml" in rows["bad"].reason
    for name in ("good", "other"):
        assert (reference / name / "report.html").is_file()
        assert (reference / name / "picture.svg").is_file()
    assert {p.name for p in (reference / "far").iterdir()} == {
        "manifest.json",
        "timing.json",
        "no_plan.html",
    }
    index = (reference / "index.html").read_text(encoding="utf-8")
    assert 'href="far/no_plan.html"' in index
    assert 'href="bad/' not in index
    assert 'href="good/report.html"' in index
    (suite,) = junitparser.JUnitXml.fromfile(str(reference / "junit.xml"))
    assert (suite.tests, suite.failures, suite.errors) == (4, 1, 1)
    assert not (reference / ".unfinished").exists()


@pytest.mark.usefixtures("in_this_process")
def test_a_problem_has_one_name_in_progress_table_junit_and_folder(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_problem(tmp_path / "stem.yaml", NEAR.replace("near", "its own name"))
    given, out = (
        ("paper/free", str(tmp_path / "stem.yaml"), "none.yaml"),
        tmp_path / "o",
    )
    run_batch(Batch(given, out, TaskSettings("paper")))
    names = {"paper-free", "stem", "none"}
    assert {path.name for path in out.iterdir() if path.is_dir()} == names
    said = capsys.readouterr().out.splitlines()
    assert {line.split("]")[1].split()[2] for line in said} == names
    (suite,) = junitparser.JUnitXml.fromfile(str(out / "junit.xml"))
    assert {case.name for case in suite} == names
    page = (out / "index.html").read_text(encoding="utf-8")
    assert set(re.findall(r'<th scope="row" data-key="([^"]*)"', page)) == names
    assert re.findall(r'<div class="soft">(.*?)</div>', page) == ["none.yaml", given[1]]
    rows = {row.folder: row.problem for row in read_summary(out / "summary.csv")}
    assert rows == dict(zip(("paper-free", "stem", "none"), given, strict=True))


@pytest.mark.usefixtures("in_this_process")
def test_a_plan_that_draws_too_little_is_no_pass(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_problem(tmp_path / "wall.yaml", BEHIND_A_WALL)
    asked = Batch(
        (str(tmp_path / "wall.yaml"),), tmp_path / "out", TaskSettings("fewest")
    )
    (row,) = run_batch(asked)
    assert row.outcome == "incomplete"
    assert "within the margin of 'wall'" in row.reason
    assert "incomplete" in capsys.readouterr().out
    page = (tmp_path / "out" / "index.html").read_text(encoding="utf-8")
    assert "0 of 1 problems certified" in page
    assert "within the margin of" in page
    (suite,) = junitparser.JUnitXml.fromfile(str(tmp_path / "out" / "junit.xml"))
    assert (suite.tests, suite.failures, suite.errors) == (1, 1, 0)


def test_jobs_and_order_change_no_byte_and_rows_can_be_read_as_they_come(
    problems: Path, reference: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out, seen = tmp_path / "out", []

    def look(done: Done) -> None:
        rows = read_summary(out / "running.csv")
        assert rows[-1] == done.row
        seen.append([row.folder for row in rows])

    shown = contextlib.nullcontext(look)
    monkeypatch.setattr("vdsm_pin.batch.run.progress", lambda *_: shown)
    files = tuple(str(problems / f"{name}.yaml") for name in reversed(NAMES))
    run_batch(Batch(files, out, TaskSettings("paper"), jobs=2))
    assert [len(rows) for rows in seen] == [1, 2, 3, 4]
    assert all(later[:-1] == sooner for sooner, later in pairwise(seen))
    assert tree(out) == tree(reference)
    assert not (out / "running.csv").exists()


@pytest.mark.usefixtures("in_this_process")
def test_resuming_keeps_what_is_intact_and_mends_the_rest(
    problems: Path, reference: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    shutil.copytree(reference, out)
    spoilt = out / "other" / "cables.csv"
    spoilt.write_bytes(spoilt.read_bytes().replace(b"1", b"2", 1))
    (out / "summary.csv").unlink()
    run_batch(Batch((str(problems),), out, TaskSettings("paper", resume=True)))
    kept = {line.split()[3] for line in capsys.readouterr().out.splitlines()
            if "(kept)" in line}  # fmt: skip
    assert kept == {"good", "far"}
    assert tree(out) == tree(reference)


def kill_once(words: list[str], moment: float) -> bool:
    """Start the batch, kill -9 it after a while; whether it was still at work."""
    with subprocess.Popen(words, stdout=subprocess.DEVNULL) as process:
        try:
            process.wait(timeout=moment)
        except subprocess.TimeoutExpired:
            process.kill()
            return True
    return False


def check_kills(problems: Path, reference: Path, out: Path, kills: int) -> None:
    """Kill the batch at so many random moments of a whole run."""
    rng = random.Random(kills)
    words = command(problems, out, "--jobs", "2", "--resume")
    begin = time.monotonic()
    subprocess.run(words, capture_output=True, check=False)
    whole = time.monotonic() - begin
    while kills:
        shutil.rmtree(out, ignore_errors=True)
        moment = rng.uniform(0.1, 1.0) * whole
        if not kill_once(words, moment):
            whole = moment  # it takes no longer by now
            continue
        kills -= 1
        ran = subprocess.run(words, capture_output=True, text=True, check=False)
        assert ran.returncode == 1, ran.stderr
        assert tree(out) == tree(reference)


@pytest.mark.usefixtures("in_this_process")
def test_what_a_killed_batch_was_writing_is_gone_after_the_next(
    problems: Path, reference: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    shutil.copytree(reference, out)
    (out / ".unfinished" / "good").mkdir(parents=True)
    run_batch(Batch((str(problems),), out, TaskSettings("paper", resume=True)))
    assert tree(out) == tree(reference)


def test_a_full_disk_ends_the_batch_and_costs_no_earlier_result(
    problems: Path, reference: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    most, never = resource.getrlimit(resource.RLIMIT_FSIZE)

    def on_a_small_disk(_: Batch, tasks: list[Task]) -> Iterator[Ended[Task, Done]]:
        for task in tasks:
            resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, never))
            try:
                done = perform(task)
            finally:
                resource.setrlimit(resource.RLIMIT_FSIZE, (most, never))
            yield Ended(task, done, "done")

    monkeypatch.setattr(run_module, "_all_ended", on_a_small_disk)
    out = tmp_path / "out"
    shutil.copytree(reference, out)
    why = "File too large; 1 of 4 problems are finished, --resume does the rest"
    with pytest.raises(CannotWrite, match=why):
        run_batch(Batch((str(problems),), out, TaskSettings("paper")))
    (out / "running.csv").unlink()
    assert tree(out) == tree(reference)


def test_killed_and_resumed_is_the_same_to_the_byte(
    problems: Path, reference: Path, tmp_path: Path
) -> None:
    """Killed when the first problem is done and the others are being done."""
    words = command(problems, tmp_path / "out", "--jobs", "2", "--resume")
    with subprocess.Popen(words, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline()
        process.kill()
    ran = subprocess.run(words, capture_output=True, text=True, check=False)
    assert ran.returncode == 1, ran.stderr
    assert tree(tmp_path / "out") == tree(reference)


@pytest.mark.slow
def test_killed_fifty_times_and_resumed_is_the_same_to_the_byte(
    problems: Path, reference: Path, tmp_path: Path
) -> None:
    check_kills(problems, reference, tmp_path / "out", 50)


def test_ctrl_c_ends_with_what_is_done(tmp_path: Path) -> None:
    many, out = tmp_path / "many", tmp_path / "out"
    many.mkdir()
    for k in range(40):  # far from done when the first is
        write_problem(many / f"{k}.yaml", NEAR)
    with subprocess.Popen(
        command(many, out),
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        process.stdout.readline()
        process.send_signal(signal.SIGINT)
        _, said = process.communicate(timeout=60.0)
    assert process.returncode == 130
    assert "--resume does the rest" in said
    assert "Traceback" not in said
    assert 1 <= len(read_summary(out / "summary.csv")) < 40
    assert not (out / ".unfinished").exists()


@pytest.mark.usefixtures("in_this_process")
def test_ctrl_c_is_heard_even_where_python_loses_it(
    problems: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def lose(done: Done) -> None:
        with contextlib.suppress(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)

    shown = contextlib.nullcontext(lose)
    monkeypatch.setattr("vdsm_pin.batch.run.progress", lambda *_: shown)
    with pytest.raises(Interrupted, match="1 of 4 problems"):
        run_batch(Batch((str(problems),), tmp_path / "out", TaskSettings("paper")))
    assert len(read_summary(tmp_path / "out" / "summary.csv")) == 1


def test_a_time_limit_makes_a_row(problems: Path, tmp_path: Path) -> None:
    file = str(problems / "good.yaml")
    (row,) = run_batch(Batch((file,), tmp_path, TaskSettings("paper", time_limit=0.01)))
    assert (row.outcome, row.folder) == ("time-limit", "good")
    assert "0.01 s came first" in row.reason
    assert (tmp_path / "good" / "manifest.json").is_file()


def test_a_worker_that_never_asks_the_clock_ends_by_itself(
    problems: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def for_ever(*_: object, **__: object) -> None:
        while True:
            pass

    for slow in ("read_problem", "plan_to_folder"):
        with monkeypatch.context() as changed:
            changed.setattr(worker_module, slow, for_ever)
            file, place = str(problems / "good.yaml"), tmp_path / slow
            aside, settings = (
                place.with_suffix(".part"),
                TaskSettings("paper", time_limit=0.05),
            )
            task = Task(file, place, aside, settings)
            row = perform(task).row
        assert row.outcome == "time-limit"
        assert "0.05 s came first" in row.reason
        assert sorted(p.name for p in aside.iterdir()) == [MANIFEST, TIMING]


def test_what_is_not_a_result_is_never_overwritten(
    problems: Path, tmp_path: Path
) -> None:
    (tmp_path / "good").mkdir()
    (tmp_path / "good" / "thesis.txt").write_text("mine")
    with pytest.raises(InvalidFile, match="nothing was overwritten"):
        run_batch(Batch((str(problems),), tmp_path, TaskSettings("paper")))
    assert [p.name for p in tmp_path.iterdir()] == ["good"]
    with pytest.raises(UnknownName, match="strategy"):
        run_batch(Batch((str(problems),), tmp_path / "x", TaskSettings("luck")))
    assert not (tmp_path / "x").exists()


def test_two_batches_do_not_share_a_folder(problems: Path, tmp_path: Path) -> None:
    with (tmp_path / ".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with pytest.raises(InvalidInput, match="another batch"):
            run_batch(Batch((str(problems),), tmp_path, TaskSettings("paper")))


def test_names_of_folders_depend_on_nothing_but_the_problem(tmp_path: Path) -> None:
    names = folder_names(("paper/obs1", "a/x.yaml", "b/x.yaml", "y.yml", "../..yaml"))
    assert names["paper/obs1"] == "paper-obs1"
    assert names["y.yml"] == "y"
    assert names["a/x.yaml"].startswith("x-")
    assert len(set(names.values())) == 5
    assert names == folder_names(tuple(reversed(names)))
    assert all("/" not in n and not n.startswith(".") for n in names.values())


def test_folders_in_folders_are_named_not_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    inner, outer = tmp_path / "inner", str(tmp_path)
    inner.mkdir()
    write_problem(tmp_path / "good.yaml", NEAR)
    assert passed_over((outer,)) == ()
    write_problem(inner / "other.yaml", NEAR)
    assert passed_over((outer, "paper/free")) == (str(inner),)
    assert passed_over((outer, str(inner))) == ()
    assert expanded((outer,)) == (str(tmp_path / "good.yaml"),)
    (tmp_path / "good.yaml").unlink()
    with pytest.raises(InvalidFile, match=r"no \.yaml file; folders in it do: .*inner"):
        expanded((outer,))

    def may_not_be_read(_: Path) -> list[Path]:
        raise PermissionError

    monkeypatch.setattr(inputs_module, "_problem_files", may_not_be_read)
    assert passed_over((outer,)) == ()


def test_folders_and_built_ins_expand_in_order(problems: Path, tmp_path: Path) -> None:
    assert "paper/obs1" in expanded(())
    inside = expanded((str(problems), str(problems / "good.yaml")))
    assert [Path(p).stem for p in inside] == ["bad", "far", "good", "other"]
    assert expanded((str(problems), f"{problems}/.//good.yaml")) == inside
    with pytest.raises(InvalidFile, match="holds no"):
        expanded((str(tmp_path),))


@pytest.mark.slow
def test_no_process_outlives_a_killed_batch(problems: Path, tmp_path: Path) -> None:
    words = command(problems, tmp_path / "out", "--jobs", "1")
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        process.stdout.readline()
        children = Path(f"/proc/{process.pid}/task/{process.pid}/children")
        if not children.exists():
            pytest.skip("the system does not list children")
        workers = [int(pid) for pid in children.read_text().split()]
        process.kill()
    assert workers
    until = time.monotonic() + 20.0
    while any(Path(f"/proc/{pid}/exe").exists() for pid in workers):
        assert time.monotonic() < until, "a worker lives on"
        time.sleep(0.1)


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.parametrize("keep", ["failed", "none"])
def test_what_is_not_kept_leaves_its_row(
    problems: Path, reference: Path, tmp_path: Path, keep: str
) -> None:
    out = tmp_path / "out"
    run_batch(Batch((str(problems),), out, TaskSettings("paper", keep=keep)))
    kept = sorted(path.name for path in (out / "good").iterdir())
    assert kept == ["manifest.json", "timing.json"]
    assert read_summary(out / "summary.csv") == read_summary(reference / "summary.csv")
    assert "good/report.html" not in (out / "index.html").read_text(encoding="utf-8")
    assert "good/report.html" in (reference / "index.html").read_text(encoding="utf-8")


def test_columns_and_summary_say_the_same(reference: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    rows = parquet.read_table(reference / "rows.parquet").to_pylist()
    written = read_summary(reference / "summary.csv")
    assert rows == [row.model_dump() for row in written]
