"""How deep links are inside obstacles, in words; oracle: where the scene puts them."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vdsm_pin.geometry.solids import Box
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.facts import min_clearance, verification_file
from vdsm_pin.report.html import write_report
from vdsm_pin.report.reason import reason
from vdsm_pin.report.run_record import RunRecord
from vdsm_pin.report.words import at_least, at_most, check_cells, kept_at_least
from vdsm_pin.verification.records import Verification
from vdsm_pin.verification.verify import verify


def beside_a_box(gap: float, base_turn: float = 0.0) -> Verification:
    """The straight arm along a box whose face is so far from the axis; [m]."""
    problem = read_problem("paper/free")
    half = np.array([2.0, 0.5, 0.5])
    box = Box("box", np.array([1.5, 0.0, gap + 0.5]), np.eye(3), half)
    zero, links = np.zeros(1), np.zeros((1, problem.manipulator.n_links))
    rows = Trajectory(zero.astype(bool), zero, zero, links, links)
    errors = ErrorBox(base_turn=base_turn)
    problem = replace(problem, scene=Scene((box,)), errors=errors)
    return verify(problem, rows)


@pytest.mark.parametrize("gap", [-0.3, -0.001, 0.001, 0.03])
def test_a_depth_beyond_the_radius_is_called_that_or_deeper(
    gap: float, tmp_path: Path
) -> None:
    found = beside_a_box(gap)
    radius = found.problem.manipulator.link_radius
    row = next(one for one in found.checks if one.name == "clearance from obstacles")
    nearest = min_clearance(found)
    assert nearest is not None
    assert row.deeper == nearest.deeper == (gap < 0.0)
    assert row.worst == pytest.approx(max(gap, 0.0) - radius, abs=1e-6)
    file = verification_file(found, RunRecord("vdsm", "0"))
    write_report(tmp_path / "report.html", found, file)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    # No deeper than proved: a thousandth of a millimetre above it at most.
    told = math.floor(-row.worst * 1e6) / 1e3
    deepest = f"−{told:.3f} mm or deeper"
    for text in (reason(found), page):
        assert (deepest in text) == (gap < 0.0)


def test_a_refuted_clearance_never_reads_as_its_limit() -> None:
    found = beside_a_box(0.03)
    row = next(one for one in found.checks if one.name == "clearance from obstacles")
    for worst in (0.0049990001, 0.0049996, 0.0049999999):
        told = check_cells(replace(row, worst=worst, limit=0.005, deeper=False))
        assert told == ("4.999 mm", "5.000 mm")
    told = check_cells(replace(row, worst=0.0049984, limit=0.005, deeper=False))
    assert told == ("4.999 mm", "5.000 mm")


def test_a_bound_that_leaves_the_verdict_open_is_no_depth() -> None:
    """The arm is 0.4 m off; nothing is found under a turn that is not searched."""
    found = beside_a_box(0.4, base_turn=3.0)
    row = next(one for one in found.checks if one.name == "clearance from obstacles")
    assert row.verdict == "undecided"
    assert not row.deeper
    told = f"clearance from obstacles is proved to be at least {check_cells(row)[0]} "
    assert told in reason(replace(found, checks=(row,)))


def test_a_lower_bound_of_a_depth_is_no_depth_that_was_found() -> None:
    """The axis lies 0.3 m deep in the box; the most that is measured is the radius."""
    found = beside_a_box(-0.3)
    (row, *_) = verification_file(found, RunRecord("vdsm", "0")).closest
    assert row.deeper
    assert row.lower_m is not None and row.lower_m < -0.3615
    assert kept_at_least(row) == at_least(row.lower_m)
    assert at_most(row.upper_m, row.deeper) == "−61.499 mm or deeper"
    both = row.model_copy(update={"lower_m": row.upper_m})
    assert kept_at_least(both).endswith(" mm or deeper")


def test_a_refuted_clearance_is_told_as_what_two_points_prove() -> None:
    """The motion may come nearer than the points that were found."""
    found = beside_a_box(0.03)
    row = next(one for one in found.checks if one.name == "clearance from obstacles")
    told = reason(replace(found, checks=(row,)))
    assert "clearance from obstacles is at most −31.499 mm against" in told
    near = replace(row, worst=0.0049996, limit=0.005)
    told = reason(replace(found, checks=(near,)))
    assert "clearance from obstacles is 4.999 mm against a limit of 5.000 mm" in told
