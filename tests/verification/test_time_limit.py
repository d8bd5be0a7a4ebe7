"""A time limit: what was not judged is not called judged, whenever it comes.

Oracle: the same verification without a limit.
"""

import sys
import time
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from vdsm_pin.certificate_writer.certificate import write_certificate
from vdsm_pin.certificate_writer.lines import Hashes
from vdsm_pin.errors import OutOfTime, VerificationFailed
from vdsm_pin.geometry.pieces import pack_pieces
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.impossible.cut_off import cut_off
from vdsm_pin.planner.upper_clearance import upper_bounds
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.pointing import Pointing
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.budget import Budget
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.report.facts import verification_file
from vdsm_pin.report.html import write_report
from vdsm_pin.report.run_record import RunRecord
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.brackets import ClearanceChunk
from vdsm_pin.verification.clearance import prove_clearance, prove_motion
from vdsm_pin.verification.judgement import guarded
from vdsm_pin.verification.pointing import check_pointing
from vdsm_pin.verification.records import Check, Verdict, Verification
from vdsm_pin.verification.robust import largest_joint_error
from vdsm_pin.verification.verify import verify
from vdsm_pin.verification.yes_or_no import is_certified

PASSED = Deadline(2.0, 0.0)
"""A limit of two seconds that was over when the machine started."""


def case(required: float = 0.0035, n: int = 400) -> tuple[PlanningProblem, Trajectory]:
    """The arm sways beside the bar of a problem of the paper."""
    problem = read_problem("paper/obs1")
    rng, links = np.random.default_rng(3), problem.manipulator.n_links
    zero = np.zeros(n)
    angles = rng.uniform(-0.02, 0.02, (2, n, links))
    rows = Trajectory(zero.astype(bool), zero, zero, angles[0], angles[1])
    return replace(problem, required_clearance=required), rows


def judged(deadline: Deadline) -> Verification:
    problem, rows = case()
    return verify(
        problem.under(ErrorBox(joint=1e-4)),
        rows,
        joint_error=True,
        sinks=[lambda chunk: None],
        deadline=deadline,
    )


def test_a_deadline_is_a_value() -> None:
    assert not NO_LIMIT.passed
    assert not Deadline.after(None).passed
    assert not Deadline.after(1e6).passed
    assert Deadline.after(0.0).end <= time.monotonic()
    with pytest.raises(OutOfTime, match="the time limit of 2 s came first"):
        PASSED.check()


def test_a_limit_that_is_over_judges_no_clearance(tmp_path: Path) -> None:
    found = judged(PASSED)
    assert found.verdict is not Verdict.CERTIFIED
    rows = {check.name: check for check in found.checks}
    for name in ("clearance from obstacles", "clearance between links"):
        row = rows[name]
        assert row.verdict is Verdict.UNDECIDED
        assert f"{row.count} of {row.count} undecided" in row.where
        assert "the time limit of 2 s came first" in row.where
        assert not np.isfinite(row.worst)
    late = [row for row in found.checks if row.where.startswith("not done")]
    assert len(late) == 3  # joint centres, Coal, cables
    assert all(row.verdict is Verdict.UNDECIDED and row.count == 0 for row in late)
    assert np.isnan(found.joint_error)
    said = dict(found.summary())
    assert (said["verdict"], said["waypoints"]) == (found.verdict.value, "400")
    assert "drawn" in said
    assert all(row.name in said for row in late)
    assert [what.split(":")[0] for what in found.not_done] == [
        "search for counterexamples",
        "clearance.csv from interval 0 on",
        "largest joint error",
    ]
    file = verification_file(found, RunRecord("vdsm", "0"))
    assert file.time_limit_s == 2.0
    assert file.min_clearance is None
    write_report(tmp_path / "report.html", found, file)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "nothing was judged in time" in page
    assert "Not done: largest joint error" in page
    assert "there is no obstacle" not in page


def test_a_limit_at_any_moment_claims_no_more_than_was_proved() -> None:
    problem, rows = case(n=20_000)
    whole = prove_clearance(problem, rows, ErrorBox())
    begin = time.monotonic()
    prove_clearance(problem, rows, ErrorBox())
    spent, partly = time.monotonic() - begin, 0
    for share in np.arange(100) / 50.0:
        chunks: list[ClearanceChunk] = []
        deadline = Deadline.after(float(share) * spent)
        motion = AskedMotion.of_arm(problem, rows, ErrorBox())
        found = prove_motion(motion, Budget(until=deadline.end), [chunks.append])
        assert (found.counts.sum(axis=1) == rows.n_samples - 1).all()
        assert (found.counts[:, 0] <= whole.counts[:, 0]).all()
        assert (found.counts[:, 1] <= whole.counts[:, 1]).all()
        left = found.counts[:, 2] > whole.counts[:, 2]
        assert found.late or not left.any()
        partly += bool(0 < found.counts[:, 0].sum() < whole.counts[:, 0].sum())
        lower, least = found.least.lower, whole.least.upper
        assert (lower <= least + 1e-9).all()
        assert (lower[left] == -np.inf).all()
        assert sum(len(chunk.lower) for chunk in chunks) == found.sent
        if partly == 3:
            return
    pytest.fail("no limit came in the middle of the proof")


class Noting(Deadline):
    """A limit that is never over, which notes who asks."""

    asked: ClassVar[set[str]] = set()

    def check(self, reached: str = "") -> None:
        self.asked.add(sys._getframe(1).f_code.co_qualname)


def test_each_step_that_may_be_long_asks_the_clock() -> None:
    clock = Noting()
    problem, rows = case(n=20)
    verify(problem.under(ErrorBox(1e-4)), rows, joint_error=True, deadline=clock)
    verify(case(0.0)[0].under(ErrorBox(0.03)), rows, deadline=clock)
    verify(case(5.0)[0], rows, deadline=clock)
    look = Pointing(0.1, directions=np.eye(3)[:1])
    looking = replace(problem, tip_path=replace(problem.path, pointing=look))
    check_pointing(looking, replace(rows, on_path=~rows.on_path), clock)
    assert clock.asked == {
        "CoalArm._at",
        "CoalArm._near",
        "YesOrNoProof.holds",
        "_look",
        "_smallest",
        "_Judge.__call__",
        "assembly_shapes.<locals>.shape",
        "check_cables",
        "check_fk",
        "find_counterexamples",
    }


def test_yes_or_no_and_the_joint_error_raise() -> None:
    problem, rows = case()
    with pytest.raises(OutOfTime):
        is_certified(problem, rows, ErrorBox(), PASSED)
    with pytest.raises(OutOfTime):
        largest_joint_error(problem, rows, ErrorBox(), PASSED)


def test_a_certificate_that_is_late_is_no_file(tmp_path: Path) -> None:
    problem, rows = case(required=0.0)
    only = Trajectory(
        np.zeros(1, bool), np.zeros(1), rows.x0[:1], rows.alpha[:1], rows.theta[:1]
    )
    found = verify(problem, only)
    good = replace(
        found, checks=tuple(c for c in found.checks if c.verdict is Verdict.CERTIFIED)
    )
    file = tmp_path / "late.certificate"
    with pytest.raises(OutOfTime):
        write_certificate(file, good, Hashes(*2 * ("0" * 64,)), PASSED)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("strategy", ["fewest", "clearest", "sturdiest", "paper"])
def test_planning_that_is_late_says_so_and_nothing_else(strategy: str) -> None:
    problem = read_problem("paper/obs1")
    with pytest.raises(OutOfTime, match="the time limit of 2 s came first"):
        plan_and_verify(problem, strategy, deadline=PASSED)


def test_proofs_of_the_planner_stop() -> None:
    problem = read_problem("paper/obs1")
    pieces = pack_pieces([one.pieces for one in problem.scene.obstacles])
    segments = np.zeros((3, 2, 3))
    assert np.isfinite(upper_bounds(pieces, segments, np.inf)).all()
    # An upper bound that is not known proves nothing.
    assert np.isinf(upper_bounds(pieces, segments, 0.0)).all()
    with pytest.raises(OutOfTime):
        cut_off(problem, problem.path.points, PASSED)


def test_of_an_arithmetic_error_a_row_and_a_traceback_are_left(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """What the package raises by itself needs none: the row says it."""

    def divide(by: float) -> tuple[Check, ...]:
        if by < 0.0:
            why = "refused"
            raise VerificationFailed(why)
        return (Check("a row", Verdict.CERTIFIED, 1, 1.0 / by, 2.0, "-"),)

    (row,) = guarded("a row", divide, 1.0)
    assert (row.verdict, caplog.text) == (Verdict.CERTIFIED, "")
    (row,) = guarded("a row", divide, -1.0)
    assert (row.verdict, row.where) == (Verdict.UNDECIDED, "not done: refused")
    assert not caplog.text
    (row,) = guarded("a row", divide, 0.0)
    assert (row.verdict, row.count) == (Verdict.UNDECIDED, 0)
    assert row.where == "not done: float division by zero"
    assert "in divide" in caplog.text
