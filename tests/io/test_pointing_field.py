"""`tip_path.pointing` of a problem file: what it becomes, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from vdsm_pin.errors import InvalidFile, InvalidInput
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.pointing import Pointing

TEXT = """
vdsm_problem: 1
length_unit: mm
manipulator: hrm8
base: {{position: [100, 200, 300], rpy_deg: [0, 0, 90]}}
tip_path:
  start: [100, 3300, 300]
  points: {points}
  closed: {closed}
  pointing: {pointing}
required_clearance: 3.5
"""
POINTS = "[[100, 3300, 300], [100, 3300, 400], [0, 3300, 400]]"


def read(
    folder: Path, pointing: str, points: str = POINTS, closed: str = "false"
) -> DesiredPath:
    file = folder / "p.yaml"
    file.write_text(TEXT.format(points=points, pointing=pointing, closed=closed))
    return read_problem(file).path


def wish(folder: Path, pointing: str, closed: str = "false") -> Pointing:
    found = read(folder, pointing, closed=closed).pointing
    assert found is not None
    return found


def test_a_target_and_directions_are_brought_into_the_bases_frame(
    tmp_path: Path,
) -> None:
    """The rail runs along the file's y: 1 m on is x, and the file's -x is y."""
    found = wish(tmp_path, "{target: [100, 1200, 350], cone_deg: 5}")
    assert found.cone == pytest.approx(np.deg2rad(5.0))
    assert found.target is not None
    np.testing.assert_allclose(found.target, [1.0, 0.0, 0.05], atol=1e-12)
    found = wish(tmp_path, "{direction: [-7, 0, 0], cone_deg: 89}")
    assert found.directions is not None
    np.testing.assert_allclose(found.directions, [[0.0, 1.0, 0.0]], atol=1e-12)
    each = "{directions: [[0, 1, 0], [-2, 0, 0], [0, 0, 3]], cone_deg: 5}"
    np.testing.assert_allclose(wish(tmp_path, each).directions, np.eye(3), atol=1e-12)
    closed = wish(tmp_path, each, closed="true").directions
    np.testing.assert_allclose(closed, np.eye(3)[[0, 1, 2, 0]], atol=1e-12)


def test_between_corners_a_direction_runs_along_the_chord(tmp_path: Path) -> None:
    path = read(
        tmp_path, "{directions: [[0, 1, 0], [-2, 0, 0], [0, 0, 3]], cone_deg: 5}"
    )
    stations = np.array([0.0, 0.025, 0.1, 0.2])
    expected = [[1.0, 0, 0], [0.75, 0.25, 0], [0, 1, 0], [0, 0, 1]]
    aims = path.aims(path.at(stations), stations)
    np.testing.assert_allclose(aims, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("pointing", "words"),
    [
        ("{cone_deg: 5}", "expected one of target, direction and directions"),
        ("{target: [1, 2, 3], direction: [1, 0, 0], cone_deg: 5}", "expected one of"),
        ("{target: [1, 2, 3], cone_deg: 0}", "cone_deg"),
        ("{target: [1, 2, 3], cone_deg: 90}", "cone_deg"),
        ("{target: [1, 2, .nan], cone_deg: 5}", "target"),
        ("{target: [1, 2, 3]}", "cone_deg"),
        ("{direction: [0, 0, 0], cone_deg: 5}", "has no length"),
        ("{directions: [[1, 0, 0], [1, 0, 0]], cone_deg: 5}", "2 directions for 3"),
        ("{directions: [], cone_deg: 5}", "directions"),
        ("{aim: [1, 2, 3], cone_deg: 5}", "aim"),
        (
            "{directions: [[0, 1, 0], [1, 0, 0], [-2, 0, 0]], cone_deg: 5}",
            "opposite directions at points 2 and 3",
        ),
        ("{target: [100, 3300, 350], cone_deg: 5}", "its target on the path"),
    ],
)
def test_what_makes_no_sense_is_one_message_with_its_place(
    tmp_path: Path, pointing: str, words: str
) -> None:
    with pytest.raises(InvalidFile) as refused:
        read(tmp_path, pointing)
    assert words in str(refused.value)
    assert "tip_path" in str(refused.value)
    assert "p.yaml" in str(refused.value)


def test_a_target_on_the_closing_side_is_refused_when_there_is_one(
    tmp_path: Path,
) -> None:
    """The side from the last point back to the first has its middle there."""
    aim = "{target: [50, 3300, 350], cone_deg: 5}"
    assert wish(tmp_path, aim).target is not None
    with pytest.raises(InvalidFile, match="its target on the path"):
        read(tmp_path, aim, closed="true")


def test_a_target_is_as_far_from_the_path_as_the_tip_may_be() -> None:
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [1.0, 2.0, 0.0]])
    Pointing(0.1, target=np.array([0.3, 0.0, 1.1e-6])).check_aims(corners)
    for near, path in (([0.3, 0.0, 0.9e-6], corners), ([0.0, 0.0, 0.0], corners[:1])):
        with pytest.raises(InvalidInput, match="its target on the path"):
            Pointing(0.1, target=np.array(near)).check_aims(path)


def test_directions_need_plain_points(tmp_path: Path) -> None:
    arc = "[[100, 3300, 300], {arc: {through: [100, 3300, 400], to: [0, 3300, 400]}}]"
    with pytest.raises(InvalidFile, match="no curves and files"):
        read(tmp_path, "{directions: [[1, 0, 0], [1, 0, 0]], cone_deg: 5}", arc)
    twice = "[[100, 3300, 300], [100, 3300, 400], [100, 3300, 400]]"
    with pytest.raises(InvalidFile, match="need points without repeats"):
        each = "{directions: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], cone_deg: 5}"
        read(tmp_path, each, twice)
    target = read(tmp_path, "{target: [100, 4000, 300], cone_deg: 5}", arc)
    assert target.pointing is not None


def test_values_that_break_their_range_are_refused() -> None:
    for cone in (0.0, -1.0, 1.6, float("nan")):
        with pytest.raises(InvalidInput):
            Pointing(cone, target=np.zeros(3))
    with pytest.raises(InvalidInput):
        Pointing(0.1)
    with pytest.raises(InvalidInput):
        Pointing(0.1, target=np.zeros(3), directions=np.eye(3))
    with pytest.raises(InvalidInput):
        DesiredPath(np.zeros(3), np.eye(3), pointing=Pointing(0.1, None, np.eye(3)[:2]))
