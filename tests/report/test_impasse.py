"""Where a search ended. Oracles: the error's own facts, forward kinematics."""

from dataclasses import replace
from pathlib import Path

import made_up
import numpy as np
import pytest

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.errors import (
    CutOff,
    HemmedIn,
    NoPlanFound,
    OutOfTime,
    PathBlocked,
    Reached,
    StartBlocked,
    VdsmError,
)
from vdsm_pin.problem.planning_problem import Posture
from vdsm_pin.report.html import write_no_plan
from vdsm_pin.report.impasse import Impasse, impasse_of

REACHED = Reached("drew 1 m", 1.25, 3, "ball")
SOMEWHERE: list[VdsmError] = [
    NoPlanFound("in vain", REACHED),
    OutOfTime(2.0, REACHED),
    HemmedIn(station=1.25),
    CutOff(station=1.25, narrowest="3 mm to 'ball'"),
    PathBlocked(obstacle="ball", reason="too near", station=1.25),
]


def tip_of(place: Impasse) -> np.ndarray:
    arm, rows = made_up.problem().manipulator, place.arm
    return np.asarray(joint_centres(arm, rows.x0, rows.alpha, rows.theta)[0, -1])


def test_a_goal_that_was_not_reached_is_marked(tmp_path: Path) -> None:
    problem = made_up.problem()
    tip, begin = np.array([1.0, 0.2, 0.1]), Posture(problem.path.start)
    asked = replace(problem, tip_path=None, start=begin, goal=Posture(tip))
    for error in SOMEWHERE:
        place = impasse_of(asked, error)
        assert place.station is None
        np.testing.assert_array_equal(place.tip, tip)
    page = tmp_path / "no_plan.html"
    write_no_plan(page, asked, SOMEWHERE[0], "fewest", made_up.RECORD)
    assert "a ring marks the goal" in page.read_text(encoding="utf-8")


@pytest.mark.parametrize("error", SOMEWHERE, ids=lambda one: type(one).__name__)
def test_the_arm_is_straight_to_the_place_that_was_not_passed(error: VdsmError) -> None:
    problem = made_up.problem()
    place = impasse_of(problem, error)
    expected = problem.path.at(np.array([1.25]))[0]
    np.testing.assert_allclose(place.tip, expected)
    np.testing.assert_allclose(tip_of(place), expected, atol=1e-12)
    assert place.posture == "straight"
    assert not place.arm.alpha[0, 1:].any()


def test_what_is_in_the_way_is_named_where_it_is_known() -> None:
    problem = made_up.problem()
    place = impasse_of(problem, SOMEWHERE[0])
    assert (place.link, place.obstacle) == (3, "ball")
    place = impasse_of(problem, SOMEWHERE[4])
    assert (place.link, place.obstacle) == (0, "ball")
    facts = {"link": 2, "obstacle": "rod", "clearance": 0.0, "required": 0.1}
    place = impasse_of(problem, StartBlocked(**facts, bent=False))
    assert (place.link, place.obstacle) == (2, "rod")
    assert place.posture == "as it starts"


def test_an_error_that_knows_no_place_shows_the_start() -> None:
    problem = made_up.problem()
    for error in (NoPlanFound("in vain"), OutOfTime(2.0), OutOfTime(2.0, "words")):
        place = impasse_of(problem, error)
        assert place.posture == "as it starts"
        assert place.tip is None
        np.testing.assert_allclose(tip_of(place), problem.path.start, atol=1e-12)


def test_the_arm_is_shown_where_it_came_farthest() -> None:
    arm, rows = made_up.problem().manipulator, made_up.trajectory().part(60, 61)
    centres = joint_centres(arm, rows.x0, rows.alpha, rows.theta)[0]
    reached = Reached("so far", 1.25, 3, "ball", centres.tolist(), [1.0, 2.0, 3.0])
    place = impasse_of(made_up.problem(), NoPlanFound("in vain", reached))
    assert place.posture == "where it came farthest"
    assert place.narrowest == (1.0, 2.0, 3.0)
    np.testing.assert_allclose(place.arm.joints, rows.joints, atol=1e-12)


@pytest.mark.parametrize("error", SOMEWHERE, ids=lambda one: type(one).__name__)
def test_the_page_says_why_and_claims_a_proof_only_where_there_is_one(
    tmp_path: Path, error: VdsmError
) -> None:
    page = tmp_path / "no_plan.html"
    run = "fewest", made_up.RECORD
    write_no_plan(page, made_up.problem(), error, *run)
    text = page.read_text(encoding="utf-8")
    assert "<strong>no plan</strong>" in text
    searched = isinstance(error, NoPlanFound | OutOfTime)
    assert ("that proves nothing about the problem" in text) is searched
    assert ("time-limit" in text) is isinstance(error, OutOfTime)
    assert "1250.0 mm along the desired path" in text
    assert made_up.RECORD.problem_sha256 in text
    assert "certified" not in text.split("<body>")[1].split("<script")[0]
