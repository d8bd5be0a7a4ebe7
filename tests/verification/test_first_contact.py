"""When a clearance is first lost: closed forms, dense samples, and the error box."""

import numpy as np
import pytest

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.geometry.solids import HalfSpace, Sphere
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.clearance import prove_clearance
from vdsm_pin.verification.first_contact import contacts_of
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.verify import verify

ARM = built_in("hrm8")
NONE = ErrorBox()


def advance(x0: np.ndarray) -> Trajectory:
    """The straight arm moving along its rail."""
    n, angles = len(x0), np.zeros((len(x0), ARM.n_links))
    return Trajectory(np.zeros(n, bool), np.zeros(n), x0, angles, angles)


def wall(distance: float, required: float = 0.01) -> PlanningProblem:
    """A wall across the rail so far in front of the arm at x0 = 0, and a far ball."""
    x = np.array([1.0, 0.0, 0.0])
    front = ARM.total_length + ARM.link_radius + distance
    scene = Scene((Sphere("ball", -5.0 * x, 0.1), HalfSpace("wall", front * x, -x)))
    return PlanningProblem(ARM, scene, None, required, name="wall")


@pytest.mark.parametrize("n", [11, 501])
@pytest.mark.parametrize("distance", [0.0513, 0.3507, 0.9001])
def test_the_moment_at_which_a_wall_is_too_close(n: int, distance: float) -> None:
    motion, problem = advance(np.linspace(0.0, 1.0, n)), wall(distance)
    proof = prove_clearance(problem, motion, NONE)
    (found,) = contacts_of(problem, motion, proof.motion, proof.least)
    assert found.moment == pytest.approx((distance - 0.01) * (n - 1), abs=2e-6)
    assert (found.pair.link, found.pair.obstacle) == (8, "wall")
    assert found.clear_before
    assert (found.last, found.stretches) == (n - 1, 1)
    assert found.intervals == n - 1 - int((distance - 0.01) * (n - 1))
    # An obstacle that may stand nearer by 20 mm is met that much earlier.
    box = ErrorBox(obstacle=0.02)
    proof = prove_clearance(problem, motion, box)
    (sooner,) = contacts_of(problem, motion, proof.motion, proof.least)
    assert sooner.moment <= found.moment + 1e-6


def test_a_motion_that_begins_too_close_is_so_at_once() -> None:
    for motion in (advance(np.linspace(0.1, 0.0, 4)), advance(np.array([0.1]))):
        problem = wall(0.05)
        proof = prove_clearance(problem, motion, NONE)
        (found,) = contacts_of(problem, motion, proof.motion, proof.least)
        assert found.moment == 0.0


def test_a_clear_motion_has_no_contact() -> None:
    motion, problem = advance(np.linspace(0.0, 0.1, 11)), wall(0.2)
    proof = prove_clearance(problem, motion, NONE)
    assert contacts_of(problem, motion, proof.motion, proof.least) == ()


def curling() -> tuple[PlanningProblem, Trajectory]:
    """Four links of which the fourth folds back over the first."""
    lengths, limit = np.array([0.9, 0.15, 0.15, 0.9]), np.deg2rad(89.0)
    cables = CableLayout(0.03, 0.01, paper_hole_angles(4))
    arm = Manipulator("curl", lengths, 0.05, limit, limit, (-1.0, 1.0), cables)
    share = np.linspace(0.0, 1.0, 6)[:, None]
    alpha = share * np.array([0.0, 1.2, 1.2, 1.2])
    none = np.zeros(6)
    motion = Trajectory(none.astype(bool), none, none, alpha, 0.01 * alpha)
    return PlanningProblem(
        arm, Scene(), None, 0.0, name="curl", required_self_clearance=0.03
    ), motion


def test_links_that_meet_are_named_at_their_first_moment_and_at_their_worst() -> None:
    problem, motion = curling()
    arm = problem.manipulator
    along = np.linspace(0.0, 1.0, 301)[:, None]

    def gap(moment: float) -> float:
        """Between links 1 and 4, by hundreds of points of each."""
        k = min(int(moment), 4)
        q = motion.joints[k] + (moment - k) * (motion.joints[k + 1] - motion.joints[k])
        o = joint_centres(arm, q[:1], q[None, 1::2], q[None, 2::2])[0]
        one, other = o[0] + along * (o[1] - o[0]), o[3] + along * (o[4] - o[3])
        distance = np.linalg.norm(one[:, None] - other[None], axis=2).min()
        return float(distance) - 2.0 * arm.link_radius

    moments = np.linspace(4.0, 5.0, 51)
    gaps = np.array([gap(t) for t in moments])
    lost = int(np.argmax(gaps < 0.03))
    assert gaps[0] > 0.01
    result = verify(problem, motion)
    (row,) = [check for check in result.checks if check.name.startswith("clearance")]
    assert row.verdict is Verdict.REFUTED
    assert moments[lost - 1] - 1e-3 <= row.first_moment <= moments[lost] + 1e-3
    assert row.first_moment < row.moment
    assert "link 1 and link 4; first too close at waypoint" in row.where


@pytest.mark.parametrize("n", [11, 501])
def test_a_contact_has_its_end_and_its_intervals(n: int) -> None:
    """In and out of the wall's margin twice: closed forms of all four moments."""
    there = np.concatenate([np.linspace(0, 1, n), np.linspace(1, 0, n)[1:]])
    motion, problem = advance(np.concatenate([there, there[1:]])), wall(0.3507)
    row = next(
        one for one in verify(problem, motion).checks
        if one.name == "clearance from obstacles"
    )  # fmt: skip
    enters = 0.3407 * (n - 1)
    assert row.first_moment == pytest.approx(enters, abs=2e-6)
    assert row.last_moment == pytest.approx(4 * (n - 1) - enters, abs=2e-6)
    x0 = motion.x0
    above = (np.maximum(x0[:-1], x0[1:]) > 0.3407).sum()
    assert row.too_close_intervals == above
    assert row.too_close_stretches == 2
    assert f"{above} intervals in 2 stretches" in row.where


def test_a_motion_that_ends_too_close_is_so_to_its_end() -> None:
    for motion, last in (
        (advance(np.linspace(0, 1, 6)), 5),
        (advance(np.array([0.5])), 0),
    ):
        judged = verify(wall(0.05), motion)
        (row,) = (one for one in judged.checks if "obstacles" in one.name)
        assert row.too_close_stretches == 1
        assert row.too_close_intervals == max(1, motion.n_samples - 1)
        assert row.last_moment == pytest.approx(last, abs=1e-6)
        assert row.too_close_stretches == 1
