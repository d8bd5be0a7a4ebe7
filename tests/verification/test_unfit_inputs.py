"""What does not fit together is refused before anything is judged of it."""

import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.certificate_writer import lines
from vdsm_pin.errors import InvalidInput, VerificationFailed
from vdsm_pin.geometry.solids import HalfSpace, Mesh, Sphere
from vdsm_pin.problem.error_boxes import ErrorBox, ObstacleError
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.layouts import FIRST, LAST
from vdsm_pin.time_limit import NO_LIMIT
from vdsm_pin.verification.assembly import obstacle_growth
from vdsm_pin.verification.coal_bodies import _surface
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.verify import verify


@pytest.mark.parametrize("verdict", Verdict)
def test_a_certificate_is_of_what_is_certified(verdict: Verdict) -> None:
    found: Any = SimpleNamespace(verdict=verdict)
    if verdict is Verdict.CERTIFIED:
        lines.check_certified(found)
    else:
        with pytest.raises(VerificationFailed, match=f"verdict is {verdict.value}"):
            lines.check_certified(found)


def test_a_proof_that_is_not_found_again_is_not_left_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(lines, "new_workspace", lambda *_: None)
    monkeypatch.setattr(lines, "record", lambda *_: (0, 1, 4))
    knots = SimpleNamespace(knots=np.zeros((3, 1)))
    proof: Any = SimpleNamespace(motion=knots, task=None, whole=None)
    with pytest.raises(VerificationFailed, match="interval 1: the proof of pair 4 was"):
        next(lines._lines(proof, NO_LIMIT))


def test_a_plane_serves_all_pieces_of_its_own_partner(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Where one plane serves a whole solid, as where its inside is not known."""
    starts = [(0, 0.0), (1, 0.0), (1, 0.5), (2, 0.0)]

    def record(*given: Any) -> tuple[int, int, int]:
        rows = given[-1]
        for row, (pair, start) in zip(rows, starts, strict=False):
            row[1:4], row[[FIRST, LAST]] = (pair, start, start + 0.5), (0.0, 1.0)
        return len(starts), 1, -1

    monkeypatch.setattr(lines, "new_workspace", lambda *_: None)
    monkeypatch.setattr(lines, "record", record)
    pairs = SimpleNamespace(
        obstacle=np.array([2, 0, 1]), rough=np.zeros((3, 0)), required=np.zeros(3)
    )
    proof: Any = SimpleNamespace(
        motion=SimpleNamespace(knots=np.zeros((2, 1))),
        task=SimpleNamespace(pairs=pairs),
        whole=np.array([12, 0, 5]),
    )
    (line,) = "".join(lines._lines(proof, NO_LIMIT)).splitlines()
    ends = [
        [planes[0][1] for _, _, planes in one] for one in json.loads(line)["proofs"]
    ]
    assert ends == [[5], [12, 12], [1]]


def test_how_far_errors_move_the_surface_of_an_obstacle() -> None:
    """A turn moves it by the angle times the way from the middle of its box."""
    ball = Sphere("ball", np.array([3.0, 4.0, 0.0]), 0.5)
    wall = HalfSpace("wall", np.zeros(3), np.array([0.0, 0.0, 1.0]))
    both = [ball, wall]
    assert obstacle_growth(both, ErrorBox(obstacle=0.25)) == [0.25, 0.25]
    box = ErrorBox(obstacle=0.25, obstacles=(ObstacleError("ball", 0.5, 0.1),))
    assert obstacle_growth(both, box) == pytest.approx([0.5 + 0.1 * 0.5, 0.25])
    box = ErrorBox(obstacles=(ObstacleError("wall", 0.5, 0.1),))
    with pytest.raises(InvalidInput, match="'wall': a half-space cannot be turned"):
        obstacle_growth(both, box)


@pytest.mark.parametrize("loaded", [3, 4, 5])
def test_coal_loads_every_triangle(loaded: int) -> None:
    given: list[Any] = []
    model = SimpleNamespace(
        beginModel=lambda *sizes: given.append(sizes),
        addVertices=given.append,
        addTriangles=given.append,
        endModel=lambda: None,
        num_tris=loaded,
    )
    coal = SimpleNamespace(BVHModelOBBRSS=lambda: model)
    corners = np.arange(15.0).reshape(5, 3)
    triangles = np.array([[0, 1, 2], [0, 1, 3], [1, 2, 3], [2, 3, 4]])
    mesh = Mesh("part", corners, triangles)
    if loaded == 4:
        assert _surface(coal, mesh) is model
        assert given[0] == (4, 5)
        np.testing.assert_array_equal(given[1], corners)
        np.testing.assert_array_equal(given[2], triangles)
    else:
        said = f"obstacle 'part': Coal loaded {loaded} triangles of 4"
        with pytest.raises(VerificationFailed, match=said):
            _surface(coal, mesh)


def test_a_motion_of_another_arm_is_refused() -> None:
    problem = PlanningProblem(built_in("hrm8"), Scene(), None, 0.0, name="p")
    for links in (7, 9):
        still, rows = np.zeros(2), np.zeros((2, links))
        motion = Trajectory(still > 0, still, still, rows, rows)
        said = f"trajectory has {links} links, the problem's arm has 8"
        with pytest.raises(InvalidInput, match=said):
            verify(problem, motion)
