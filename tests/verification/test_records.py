"""Rows of evidence and what is said of them: by hand."""

from dataclasses import replace
from math import inf, nan
from types import SimpleNamespace
from typing import Any

import made_up
import numpy as np
import pytest

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.solids import Box
from vdsm_pin.geometry.winding import Location, Side
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.clearance_check import _row
from vdsm_pin.verification.inside import Place, check_inside
from vdsm_pin.verification.records import (
    Check,
    CheckKind,
    Pair,
    Verdict,
    _place,
    is_deepest,
)
from vdsm_pin.verification.verify import verify


@pytest.mark.parametrize(
    ("moment", "where", "words"),
    [
        (nan, "", ""),
        (2.25, "", ", at waypoint 2.25"),
        (0.0, "", ", at waypoint 0"),
        (nan, "link 3", ", link 3"),
        (1234567.0, "link 3 and a", ", at waypoint 1.23457e+06, link 3 and a"),
    ],
)
def test_the_place_of_a_worst_case_in_words(
    moment: float, where: str, words: str
) -> None:
    row = Check("n", Verdict.REFUTED, 1, 0.0, 0.0, "m", where=where, moment=moment)
    assert _place(row) == words


def test_no_depth_beyond_the_radius_is_measured() -> None:
    limit = TOLERANCES.bracket_gap - 0.05
    for clearance in (limit, -0.05, -9.0):
        assert is_deepest(clearance, 0.05)
    for clearance in (limit + 1e-12, 0.0, 0.05, nan, inf, -inf):
        assert not is_deepest(clearance, 0.05)


OUTSIDE, INSIDE = Location(Side.OUTSIDE), Location(Side.INSIDE)
UNKNOWN = Location(Side.UNKNOWN, "it has a hole")


@pytest.mark.parametrize(
    ("sides", "verdict", "bad"),
    [
        ({"a": OUTSIDE, "b": OUTSIDE}, Verdict.CERTIFIED, ""),
        ({"a": OUTSIDE, "b": UNKNOWN, "c": UNKNOWN}, Verdict.UNDECIDED, "bc"),
        ({"a": UNKNOWN, "b": INSIDE, "c": OUTSIDE}, Verdict.REFUTED, "b"),
        ({"a": INSIDE, "b": INSIDE}, Verdict.REFUTED, "ab"),
    ],
)
def test_the_row_of_meshes_counts_those_that_decide_it(
    sides: dict[str, Location], verdict: Verdict, bad: str
) -> None:
    """Of the first moment, where the arm is outside of them all or is not."""
    asked: Any = SimpleNamespace(chain=0, pair=lambda k: Pair(1, [*sides][k]))
    places = {k: Place(one, np.zeros(3)) for k, one in enumerate(sides.values())}
    (row,) = check_inside(asked, places)
    assert (row.name, row.verdict, row.count) == (
        CheckKind.LINKS_OUTSIDE,
        verdict,
        len(sides),
    )
    assert (row.worst, row.limit, row.unit) == (float(len(bad)), 0.0, "-")
    assert row.where == "; ".join(sides[name].words(name) for name in bad)
    assert [row.moment] == pytest.approx([0.0 if bad else nan], nan_ok=True)
    assert check_inside(asked, {}) == ()


def test_each_row_says_how_much_of_what_was_looked_at_against_which_limit() -> None:
    """Of a straight arm of eight links in 41 rows, beside one box."""
    ends = np.array([[3.126, 0.0, 0.0], [3.526, 0.0, 0.0]])
    path = DesiredPath(ends[0], ends, required_coverage=1.0)
    crate = Box("crate", np.array([1.5, 0.0, -1.0]), np.eye(3), np.full(3, 0.2))
    needed: dict[str, Any] = {
        "required_clearance": 0.01,
        "required_self_clearance": 0.002,
    }
    needed |= {"max_row_change": 0.2, "tip_tolerance": 1e-5}
    arm = built_in("hrm8")
    problem = PlanningProblem(arm, Scene((crate,)), path, 0.0, name="p")
    problem = replace(problem, **needed)
    x0 = np.linspace(0.0, 0.4, 41)
    motion = Trajectory(np.ones(41, bool), x0, x0, *np.zeros((2, 41, 8)))
    verification = verify(problem, motion)
    assert verification.verdict is Verdict.CERTIFIED
    found = [(row.name, row.count, row.limit, row.unit) for row in verification.checks]
    box, cone = arm.max_joint_angle, arm.max_link_angle
    coal = found.pop(13)
    assert coal[0].startswith("distances by Coal")
    assert coal[2:] == (TOLERANCES.coal_agreement, "m")
    assert 8 + 21 <= coal[1] <= 41 * (8 + 21)
    assert found == [
        ("joint centres by Pinocchio against the closed form", 9 * 41, 1e-9, "m"),
        ("alpha in its box", 8 * 41, box, "rad"),
        ("theta in its box", 8 * 41, box, "rad"),
        ("link angle psi in its cone", 8 * 41, cone, "rad"),
        ("base on its rail", 41, arm.base_range[1], "m"),
        ("change of a joint angle between waypoints", 8 * 41, 0.2, "rad"),
        ("tip at its start", 1, 1e-5, "m"),
        ("tip on the desired path at the waypoints", 41, 1e-5, "m"),
        ("tip near the desired path between the waypoints", 40, path.spacing, "m"),
        ("tip draws the path in the order given", 41, 1e-5, "m"),
        ("coverage of the desired path", 1, 1.0, "share"),
        ("clearance from obstacles", 8 * 40, 0.01, "m"),
        ("clearance between links", 21 * 40, 0.002, "m"),
        ("angles recovered from the cable lengths", 2 * 8 * 41, 1e-9, "rad"),
    ]
    moments = {row.name: row.moment for row in verification.checks}
    assert moments["base on its rail"] == 40.0
    assert moments["clearance from obstacles"] >= 0.0


def test_a_row_names_the_nearest_of_pairs_with_one_bound() -> None:
    """Far pairs are bounded no better than what the whole motion keeps."""
    least = SimpleNamespace(
        lower=np.array([0.3, 0.2, 0.2]),
        upper=np.array([0.31, 0.9, 0.21]),
        verdict=np.zeros(3, dtype=np.int64),
        interval=np.array([1, 84, 7]),
        share=np.array([0.0, 0.0, 0.5]),
    )
    evidence: Any = SimpleNamespace(
        pairs=["far", "rough", "near"],
        least=least,
        counts=np.array([[1, 0, 0]] * 3),
        deepest=lambda pair, value: False,
    )
    empty = Check("clearance", Verdict.UNDECIDED, 0, nan, 0.1, "m")
    row = _row(empty, evidence, np.arange(3))
    assert (row.where, row.moment, row.worst) == ("near", 7.5, 0.2)


def test_of_a_motion_alone_no_more_is_found_out_than_is_asked() -> None:
    """No largest joint error, nothing left out; Coal beside the whole proof."""
    found = verify(made_up.problem(), made_up.trajectory(20))
    assert np.isnan(found.joint_error)
    assert found.not_done == ()
    (row,) = (row for row in found.checks if "Coal" in row.name)
    assert row.where.endswith(f"; {row.count} of 1540 pairs measured")
    told: list[object] = []
    whole = verify(made_up.problem(), made_up.trajectory(20), sinks=(told.append,))
    assert told and whole.not_done == ()
