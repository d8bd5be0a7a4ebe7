"""Given motions of robots and arms in a batch: rows, pages, JUnit, resumed."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from math import radians
from pathlib import Path

import pytest
from oracles.certificate_cases import certificate_lines

from vdsm_pin.app.workflow import Verified, VerifyOrder
from vdsm_pin.batch import worker as worker_module
from vdsm_pin.batch.run import Batch, run_batch
from vdsm_pin.batch.task import CERTIFICATE, Task, TaskSettings
from vdsm_pin.batch.worker import perform
from vdsm_pin.errors import InvalidFile
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.report.files import VerificationFile

URDF = """<robot name="r"><link name="foot"/><link name="arm"><collision>
<origin xyz="1 0 0"/><geometry><sphere radius="0.1"/></geometry></collision></link>
<joint name="turn" type="revolute"><parent link="foot"/><child link="arm"/>
<axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>
</robot>"""
PROBLEM = """vdsm_problem: 1
length_unit: mm
robot: {urdf: r.urdf}
required_clearance: 10
obstacles: [{name: ball, shape: sphere, center: [0, 1000, 0], radius: 100}]
"""
PLANS = {
    "clear.csv": "turn_deg\n-90\n60\n",
    "through.csv": "turn_deg\n0\n120\n",
    "other.csv": "elbow_deg\n0\n120\n",
}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "r.urdf").write_text(URDF)
    (tmp_path / "cell.yaml").write_text(PROBLEM)
    (tmp_path / "plans").mkdir()
    for name, text in PLANS.items():
        (tmp_path / "plans" / name).write_text(text)
    return tmp_path


FEWEST = TaskSettings("fewest")


def asked(folder: Path, settings: TaskSettings = FEWEST) -> Batch:
    problems, plans = (str(folder / "cell.yaml"),), (str(folder / "plans"),)
    return Batch(problems, folder / "out", settings, quiet=True, trajectories=plans)


def test_each_motion_gets_a_row_a_page_and_a_test_case(folder: Path) -> None:
    rows = {row.folder: row for row in run_batch(asked(folder))}
    outcomes = {name: row.outcome for name, row in rows.items()}
    assert outcomes == {
        "cell-clear": "certified",
        "cell-through": "refuted",
        "cell-other": "error",
    }
    assert "no column for joint 'turn'" in rows["cell-other"].reason
    assert "arm and ball" in rows["cell-through"].reason
    assert rows["cell-through"].strategy == "given"
    for name in ("cell-clear", "cell-through"):
        kept = folder / "out" / name
        file = VerificationFile.model_validate_json(
            (kept / "verification.json").read_text()
        )
        assert file.verdict == outcomes[name]
        assert "<canvas" not in (kept / "report.html").read_text()[:100]
        picture = ET.fromstring((kept / "picture.svg").read_text())
        assert len(picture) == 2  # the ball and the arm
    cases = ET.parse(folder / "out" / "junit.xml").getroot().iter("testcase")
    bad = {case.get("name"): [mark.tag for mark in case] for case in cases}
    assert bad == {
        "cell-clear": [],
        "cell-through": ["failure"],
        "cell-other": ["error"],
    }
    page = (folder / "out" / "index.html").read_text()
    assert "cell-clear/report.html" in page


@pytest.mark.usefixtures("in_this_process")
def test_the_problem_beside_the_motions_is_no_motion(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "plans" / "clear.csv").rename(folder / "clear.csv")
    (row,) = run_batch(replace(asked(folder), trajectories=(str(folder),), quiet=False))
    assert (row.folder, row.outcome) == ("cell-clear", "certified")
    said = capsys.readouterr().out
    assert "smallest proved clearance" in said and "not available" not in said


@pytest.mark.usefixtures("in_this_process")
def test_a_problem_of_a_folder_of_its_own_is_named_after_that(folder: Path) -> None:
    """As `vdsm new` makes them; each page leads back to that of the batch."""
    (folder / "problem.yaml").write_text(PROBLEM)
    given = (str(folder / "problem.yaml"),), (str(folder / "plans" / "clear.csv"),)
    batch = Batch(given[0], folder / "out", FEWEST, quiet=True, trajectories=given[1])
    (row,) = run_batch(batch)
    assert row.folder == f"{folder.name}-clear"
    page = (folder / "out" / row.folder / "report.html").read_text()
    assert 'href="../index.html"' in page
    assert f'href="{row.folder}/report.html"' in (folder / "out/index.html").read_text()


@pytest.mark.usefixtures("in_this_process")
def test_endings_may_be_large(folder: Path) -> None:
    for path in (folder / "plans").iterdir():
        path.rename(path.with_suffix(".CSV"))
    (folder / "cell.yaml").rename(folder / "cell.YML")
    rows = run_batch(replace(asked(folder), problems=(str(folder),)))
    assert {row.folder for row in rows} == {"cell-clear", "cell-other", "cell-through"}


@pytest.mark.usefixtures("in_this_process")
def test_what_changed_is_done_again(folder: Path) -> None:
    """A motion that is another one now is not taken from the earlier batch."""
    before = {row.folder: row for row in run_batch(asked(folder))}
    (folder / "plans" / "clear.csv").write_text(PLANS["through.csv"])
    after = {
        row.folder: row
        for row in run_batch(asked(folder, TaskSettings("fewest", resume=True)))
    }
    assert after["cell-clear"].outcome == "refuted"
    assert after["cell-through"] == before["cell-through"]


def test_what_changes_while_results_are_written_is_done_again(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As while the report is printed: the result is of the motion before."""
    file, verify = folder / "plans" / "clear.csv", worker_module.verify_to_folder
    final, aside = folder / "done", folder / "aside"
    task = Task(str(folder / "cell.yaml"), final, aside, FEWEST, str(file))

    def judged(order: VerifyOrder) -> Verified:
        found = verify(order)
        file.write_text(PLANS["through.csv"])
        return found

    monkeypatch.setattr(worker_module, "verify_to_folder", judged)
    assert perform(task).row.outcome == "certified"
    aside.rename(final)
    again = perform(replace(task, settings=replace(FEWEST, resume=True)))
    assert (again.kept, again.row.outcome) == (False, "refuted")


@pytest.mark.usefixtures("in_this_process")
@pytest.mark.parametrize(("degrees", "passes"), [(10.0, True), (20.0, False)])
def test_errors_are_asked_about(folder: Path, degrees: float, passes: bool) -> None:
    """By 18.5 deg more the arm, 30 deg from the ball, comes nearer than 10 mm."""
    errors = ErrorBox(joint=radians(degrees))
    rows = run_batch(asked(folder, TaskSettings("fewest", errors=errors)))
    outcomes = {row.folder: row.outcome for row in rows}
    assert (outcomes["cell-clear"] == "certified") is passes


@pytest.mark.usefixtures("in_this_process")
def test_certificates_are_written_under_errors(folder: Path) -> None:
    errors = ErrorBox(joint=radians(1.0))
    both = TaskSettings("fewest", errors=errors, certificate=True)
    rows = {row.folder: row for row in run_batch(asked(folder, both))}
    assert rows["cell-clear"].outcome == "certified"
    lines = certificate_lines(folder / "out" / "cell-clear" / CERTIFICATE)
    assert lines[0]["errors"]["joints_rad"] == {"turn": pytest.approx(radians(1.0))}


@pytest.mark.usefixtures("in_this_process")
def test_what_is_missing_is_named(folder: Path) -> None:
    (row,) = run_batch(replace(asked(folder), trajectories=()))
    assert row.outcome == "error"
    assert "expected manipulator" in row.reason
    (folder / "none").mkdir()
    with pytest.raises(InvalidFile, match="holds no trajectory"):
        run_batch(replace(asked(folder), trajectories=(str(folder / "none"),)))
