"""Whatever a command writes, it leaves alone what it reads, under any name.

Oracle: the bytes of the inputs before and after.
"""

import os
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest

from vdsm_pin import api
from vdsm_pin.app import arm_subject
from vdsm_pin.app.workflow import planned_by
from vdsm_pin.batch.folders import finished, folder_names
from vdsm_pin.batch.run import OWN, Batch, run_batch, seconds_of
from vdsm_pin.batch.task import MANIFEST, TIMING, Task, TaskSettings
from vdsm_pin.batch.worker import perform
from vdsm_pin.cli import main
from vdsm_pin.errors import Infeasible, InvalidFile, OutOfTime

PROBLEM = """\
vdsm_problem: 1
length_unit: m
manipulator: {link_lengths: [1, 1], link_radius: 0.05,
  max_link_angle_deg: 45, max_joint_angle_deg: 45}
obstacles: [{name: part, shape: mesh, file: part.stl, center: [1, 1, 0], solid: false}]
tip_path: {start: [2, 0, 0], points: [[2, 0, 0], [2.01, 0, 0]]}
required_clearance: 0
"""
PART = """\
solid part
facet normal 0 0 1
outer loop
vertex 0 0 0
vertex 1 0 0
vertex 0 1 0
endloop
endfacet
endsolid part
"""
FEWEST = TaskSettings("fewest")
INPUTS = ("problem.yaml", "part.stl", "motion.csv", "plan.json")


def run(*words: object) -> int:
    with pytest.raises(SystemExit) as ended:
        main([str(word) for word in words])
    return int(ended.value.code or 0)


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("made")
    (folder / "problem.yaml").write_text(PROBLEM)
    (folder / "part.stl").write_text(PART)
    assert run("plan", folder / "problem.yaml", "--out", folder) == 0
    (folder / "trajectory.csv").rename(folder / "motion.csv")
    return folder


@pytest.fixture
def here(made: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A copy of the inputs to work in."""
    for name in INPUTS:
        shutil.copy(made / name, tmp_path / name)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def itself(target: Path, name: Path) -> Path:
    return target


def roundabout(target: Path, name: Path) -> Path:
    return target.parent / ".." / target.parent.name / target.name


def symbolic(target: Path, name: Path) -> Path:
    name.symlink_to(target)
    return name


def hard(target: Path, name: Path) -> Path:
    os.link(target, name)
    return name


READ = {
    "certificate": INPUTS,
    "pdf": INPUTS[:1],
    "view": INPUTS[:3],
    "report": INPUTS[:2],
    "proof": INPUTS[:3],
}
"""What each way of writing a file reads; the last two are the package's own."""

CASES = [
    *(("certificate", target, way) for target in INPUTS for way in (roundabout, hard)),
    *(("certificate", "motion.csv", way) for way in (itself, symbolic)),
    *((command, target, itself) for command, read in READ.items() for target in read),
]


@pytest.mark.parametrize(("command", "target", "way"), CASES)
def test_no_output_is_an_input(
    command: str,
    target: str,
    way: Callable[[Path, Path], Path],
    here: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    before = {name: (here / name).read_bytes() for name in INPUTS}
    output = way(here / target, here / "other.name")
    if command in ("report", "proof"):
        problem = api.read_problem("problem.yaml")
        motion = api.read_trajectory("motion.csv", problem)
        result = api.verify(problem, motion)
        with pytest.raises(InvalidFile, match="is an input"):
            if command == "report":
                api.write_report(result, output)
            else:
                api.write_certificate(result, output, "motion.csv")
    else:
        words = ["problem.yaml", "--trajectory", "motion.csv"]
        if command == "view":
            words = ["view", *words, "--html", str(output)]
        else:
            words = ["verify", *words, "--out", "out", f"--{command}", str(output)]
        assert run(*words) == 2
        said = capsys.readouterr()
        assert "is an input, read as" in said.err
        assert not (here / "out").exists()
    assert before == {name: (here / name).read_bytes() for name in INPUTS}


@pytest.mark.parametrize("way", [symbolic, hard])
def test_no_file_of_a_folder_is_an_input(
    way: Callable[[Path, Path], Path], here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "out").mkdir()
    way(here / "part.stl", here / "out" / "link_angles.csv")
    way(here / "part.stl", here / "out" / "plan.json")
    assert run("plan", "problem.yaml", "--out", "out") == 2
    verify = ["verify", "problem.yaml", "--trajectory", "motion.csv", "--out", "out"]
    assert run(*verify) == 2
    assert capsys.readouterr().err.count("is an input") == 2
    assert (here / "part.stl").read_text() == PART


def test_a_trajectory_that_changes_meanwhile_gets_no_result(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Its hash would be of a motion that nobody judged."""

    def judged(*given: object, **more: object) -> object:
        found = verify(*given, **more)
        (here / "motion.csv").write_text("x0_m\n0\n")
        return found

    verify = arm_subject.verify
    monkeypatch.setattr(arm_subject, "verify", judged)
    words = ["problem.yaml", "--trajectory", "motion.csv", "--out", "out"]
    assert run("verify", *words, "--certificate", "proof") == 2
    assert "motion.csv: changed while it was worked on" in capsys.readouterr().err
    assert not any((here / "out").iterdir())
    assert not (here / "proof").exists()


def test_results_that_stay_are_called_those_of_an_earlier_run(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Of a plan, a verification and a repair that come to nothing."""
    text = (here / "problem.yaml").read_text()
    assert run("plan", "problem.yaml", "--out", "out") == 0
    verify = ["verify", "problem.yaml", "--trajectory", "motion.csv", "--out", "out"]
    assert run(*verify) == 0
    before = (here / "out" / "plan.json").read_bytes()
    (here / "problem.yaml").write_text(
        text.replace("[2.01, 0, 0]]", "[9, 9, 0]], blocked: fail")
    )
    capsys.readouterr()
    assert run("plan", "problem.yaml", "--out", "new") == 1
    assert "earlier run" not in capsys.readouterr().err
    assert run("plan", "problem.yaml", "--out", "out") == 1
    assert "out/plan.json is of an earlier run" in capsys.readouterr().err
    assert (here / "out" / "plan.json").read_bytes() == before

    def late(*_: object, **__: object) -> object:
        raise OutOfTime(1.0)

    monkeypatch.setattr("vdsm_pin.app.arm_subject.verify", late)
    assert run(*verify) == 1
    assert "out/verification.json is of an earlier run" in capsys.readouterr().err

    def lost(*_: object) -> object:
        message = "no way"
        raise Infeasible(message)

    monkeypatch.setattr(arm_subject.ArmSubject, "repair", lost)
    assert run("repair", *verify[1:]) == 1
    assert "out/verification.json is of an earlier run" in capsys.readouterr().err


def test_two_outputs_do_not_share_a_place(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    verify = ["verify", "problem.yaml", "--trajectory", "motion.csv", "--out", "out"]
    for output in ("out/report.html", "out/../out/cables.csv"):
        assert run(*verify, "--certificate", output) == 2
        assert "goes too; nothing was written" in capsys.readouterr().err
    assert run(*verify, "--certificate", "proof") == 0


@pytest.mark.usefixtures("in_this_process")
def test_a_problem_may_have_the_name_of_any_file_of_a_batch(here: Path) -> None:
    (here / "summary.csv.yaml").write_text(PROBLEM)
    (row,) = run_batch(
        Batch(("summary.csv.yaml",), here / "out", TaskSettings("fewest"))
    )
    assert row.outcome == "certified"
    assert (here / "out" / "summary.csv").is_file()
    assert (here / "out" / row.folder / "report.html").is_file()
    names = folder_names(tuple(f"{name}.yaml" for name in OWN), OWN)
    assert not set(names.values()) & set(OWN)


def test_a_folder_made_by_vdsm_new_gives_its_problem_the_name() -> None:
    names = folder_names(("a/mine/problem.yaml", "vessel/problem.yaml", "problem.yaml"))
    assert list(names.values()) == ["mine", "vessel", "problem"]


def test_names_that_meet_a_hash_stay_apart() -> None:
    twins = ("a/x.yaml", "b/x.yaml")
    met = folder_names(twins)["a/x.yaml"]
    assert len(set(folder_names((*twins, f"{met}.yaml")).values())) == 3


@pytest.mark.usefixtures("in_this_process")
def test_a_batch_leaves_its_inputs_alone(here: Path) -> None:
    out = here / "out"
    batch = Batch(("problem.yaml",), out, TaskSettings("fewest"))
    run_batch(batch)
    # A file of the batch that is read as a problem.
    shutil.copy("problem.yaml", out / ".lock")
    with pytest.raises(InvalidFile, match="is an input"):
        run_batch(Batch((str(out / ".lock"),), out, TaskSettings("fewest")))
    assert (out / ".lock").read_text() == PROBLEM
    # A file beside results that would be replaced.
    (out / "problem" / "notes.txt").write_text("mine")
    with pytest.raises(InvalidFile, match=r"holds 'notes.txt', which no batch wrote"):
        run_batch(batch)
    (out / "problem" / "notes.txt").unlink()
    # A mesh there under a name that the batch uses.
    inside = out / "problem" / "cables.csv"
    inside.write_text(PART)
    (here / "part.stl").unlink()
    (here / "part.stl").symlink_to(inside)
    (row,) = run_batch(batch)
    assert row.outcome == "error"
    assert "which the results would replace" in row.reason


def test_long_and_odd_names_have_folders_of_their_own(here: Path) -> None:
    names = ["a" * 230, "b", "summary.csv", os.fsdecode(b"\xff\x1b[31m")]
    for name in names:
        (here / f"{name}.yaml").write_text(PROBLEM)
    rows = run_batch(
        Batch(tuple(f"{n}.yaml" for n in names), here / "out", TaskSettings("fewest"))
    )
    assert [row.outcome for row in rows] == 4 * ["certified"]
    assert len({row.folder for row in rows}) == 4


def test_an_arm_is_not_written_over_its_problem(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run("urdf", "problem.yaml", "--out", "../" + here.name + "/part.stl") == 2
    assert run("urdf", "problem.yaml", "--out", "problem.yaml") == 2
    assert capsys.readouterr().err.count("is an input") == 2
    assert (here / "problem.yaml").read_text() == PROBLEM
    assert run("urdf", "problem.yaml", "--out", "arm.urdf") == 0


@pytest.mark.parametrize("name", ["executed.csv", "simulation.html"])
def test_a_simulation_is_not_written_over_its_plan(
    name: str, here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copy("motion.csv", name)
    before = (here / name).read_bytes()
    words = ["simulate", "problem.yaml", "--trajectory", name, "--out", "."]
    assert run(*words) == 2
    assert "is an input" in capsys.readouterr().err
    assert (here / name).read_bytes() == before


def test_nothing_takes_the_place_of_a_pipe(
    here: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (here / "out").mkdir()
    pipes = here / "pipe", here / "out" / "cables.csv"
    verify = ["verify", "problem.yaml", "--trajectory", "motion.csv"]
    for pipe in pipes:
        os.mkfifo(pipe)
        assert run(*verify, "--out", pipe.parent, "--certificate", pipes[0]) == 2
    assert run("plan", "problem.yaml", "--out", "out") == 2
    assert run("view", "problem.yaml", "--html", "pipe") == 2
    with pytest.raises(InvalidFile, match="is there and is not a regular file"):
        problem = api.read_problem("problem.yaml")
        motion = api.read_trajectory("motion.csv", problem)
        api.write_trajectory(motion, pipes[0])
    assert capsys.readouterr().err.count("is not a regular file") == 4
    assert all(pipe.is_fifo() for pipe in pipes)


def test_no_pipe_is_waited_for(here: Path) -> None:
    """Where results lie, beside a motion, and where a motion is given."""
    for name in (TIMING, MANIFEST, "motion.csv.pipe"):
        os.mkfifo(here / name)
    (here / "plan.json").unlink()
    os.mkfifo(here / "plan.json")
    given, final = str(here / "motion.csv.pipe"), here / "b"
    task = Task(str(here / "problem.yaml"), here, here / "aside", FEWEST)
    assert finished(task, "", {}) is None
    assert seconds_of(here) is None
    assert planned_by(here / "motion.csv") is None
    done = perform(replace(task, final=final, trajectory=given))
    assert done.row.reason.endswith("motion.csv.pipe: is not a regular file")


def test_a_batch_writes_over_no_table_of_others(here: Path) -> None:
    (here / "summary.csv").write_text("mine")
    with pytest.raises(InvalidFile, match="is not a result of a batch"):
        run_batch(Batch(("problem.yaml",), here, TaskSettings("fewest")))
    assert (here / "summary.csv").read_text() == "mine"
