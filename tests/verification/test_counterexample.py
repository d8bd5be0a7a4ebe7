"""Refutation of error boxes: found where there is one, true wherever it is found."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np
import pytest

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Box, Capsule, Cylinder, HalfSpace, Mesh, Sphere
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.error_boxes import ErrorBox, ObstacleError
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.proofs import verdicts_of
from vdsm_pin.proof.proving import Proving
from vdsm_pin.proof.terms import CERTIFIED, REFUTED, UNDECIDED
from vdsm_pin.verification import clearances, counterexample
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.brackets import LeastClearances
from vdsm_pin.verification.clearance import prove_clearance
from vdsm_pin.verification.contacts import BESIDE, MEETING
from vdsm_pin.verification.counterexample import (
    GRID,
    GRIDS,
    PARTS,
    Moment,
    Search,
    grown_by,
    starts,
)
from vdsm_pin.verification.records import Counterexample, Pair, Verdict
from vdsm_pin.verification.robust import largest_joint_error, refuted_joint_error
from vdsm_pin.verification.verify import verify
from vdsm_pin.verification.yes_or_no import is_certified

ARM = built_in("hrm8")
LENGTH = float(ARM.total_length)


def problem_with(
    *obstacles: Obstacle, required: float = 0.002, between: float = 0.0
) -> PlanningProblem:
    tip = np.array([LENGTH, 0.0, 0.0])
    scene, path = Scene(obstacles), DesiredPath(tip, tip[None])
    return PlanningProblem(
        ARM, scene, path, required, name="p", required_self_clearance=between
    )


def motion(n_rows: int, seed: int = 0, size: float = 0.0) -> Trajectory:
    rng = np.random.default_rng(seed)
    x0, angles = np.linspace(0.0, 0.02, n_rows), rng.uniform(-size, size, (2, 8))
    alpha, theta = (np.repeat(a[None], n_rows, axis=0) for a in angles)
    return Trajectory(np.zeros(n_rows, bool), np.zeros(n_rows), x0, alpha, theta)


def ceiling(gap: float) -> HalfSpace:
    """Everything above the straight arm, at a distance from its surface."""
    height = np.array([0.0, 0.0, ARM.link_radius + gap])
    return HalfSpace("ceiling", height, np.array([0.0, 0.0, -1.0]))


def checked(
    problem: PlanningProblem, rows: Trajectory, box: ErrorBox
) -> tuple[Counterexample, ...]:
    """Counterexamples, each evaluated again from its numbers alone."""
    proof = prove_clearance(problem, rows, box)
    found = proof.counterexamples()
    for one in found:
        k, q = one.interval, rows.joints
        assert 0 <= k <= max(0, len(q) - 2)
        assert 0.0 <= one.share <= 1.0
        nominal = q[k] + one.share * (q[min(k + 1, len(q) - 1)] - q[k])
        off = np.abs(one.joints - nominal)
        assert off[0] == 0.0
        assert (off[1:] <= box.joint).all()
        centres = joint_centres(
            ARM, one.joints[:1], one.joints[None, 1::2], one.joints[None, 2::2]
        )[0]
        grown = box.obstacle + box.base if one.pair.obstacle else 0.0
        gap = float(np.linalg.norm(one.link_point - one.other_point))
        assert gap <= one.clearance + grown + 1e-9 or one.clearance < 0.0
        assert one.clearance < one.required
        a, b = centres[one.pair.link - 1], centres[one.pair.link]
        t = np.clip((one.link_point - a) @ (b - a) / ((b - a) @ (b - a)), 0.0, 1.0)
        assert (
            np.linalg.norm(one.link_point - a - t * (b - a)) <= ARM.link_radius + 1e-9
        )
    return found


class Bracket(NamedTuple):
    certified: float
    refuted: float


def bracketed(problem: PlanningProblem, rows: Trajectory) -> Bracket:
    """The joint error that is survived, and one that is not."""
    low = largest_joint_error(problem, rows, ErrorBox())
    return Bracket(low, refuted_joint_error(problem, rows, ErrorBox(), low))


def test_a_drooping_arm_is_refuted_at_the_error_that_lifts_its_tip() -> None:
    """All theta off by -e lift the tip by sum L_l sin(l e): closed form."""
    rows, wall = motion(3), ceiling(0.05)
    lifts = np.arange(1, 9)

    def lift(e: float) -> float:
        return float((ARM.link_lengths * np.sin(lifts * e)).sum())

    low, high = 0.0, 0.1
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if lift(middle) < 0.048 else (low, middle)
    problem = problem_with(wall)
    assert checked(problem, rows, ErrorBox(joint=low * 0.999)) == ()
    (found,) = checked(problem, rows, ErrorBox(joint=low * 1.001))
    assert found.pair.link == 8
    np.testing.assert_allclose(found.offsets[2::2], -low * 1.001, rtol=1e-6)
    errors = bracketed(problem, rows)
    assert errors.certified <= low <= errors.refuted
    assert errors.refuted == pytest.approx(low, rel=1e-3)
    assert errors.certified == pytest.approx(low, rel=0.05)


def test_a_motion_that_comes_nearest_at_its_end_is_refuted_there() -> None:
    """The arm slides towards a wall across its rail, and back from it."""
    bend = np.full((5, 8), 0.02)
    tip = joint_centres(ARM, np.array([0.1]), bend[:1], bend[:1])[0, -1]
    beyond = tip + (ARM.link_radius + 0.01) * np.eye(3)[0]
    wall = HalfSpace("end", beyond, np.array([-1.0, 0.0, 0.0]))
    for x0, moment in ((np.linspace(0, 0.1, 5), 4), (np.linspace(0.1, 0, 5), 0)):
        rows = Trajectory(bend[:, 0] < 0, 0 * x0, x0, bend, bend)
        found = checked(problem_with(wall), rows, ErrorBox(joint=0.02))
        assert [one.interval + one.share for one in found] == [moment]


def test_base_and_obstacle_errors_are_used_to_the_full() -> None:
    wall = HalfSpace("end", np.array([LENGTH + 0.1, 0, 0]), np.array([-1.0, 0, 0]))
    rows = motion(2)  # ends 20 mm further on
    gap = 0.1 - 0.02 - ARM.link_radius
    problem = problem_with(wall, required=gap - 0.003)
    assert is_certified(problem, rows, ErrorBox(base=0.0019, obstacle=0.001))
    (found,) = checked(problem, rows, ErrorBox(base=0.0021, obstacle=0.001))
    assert found.interval + found.share == pytest.approx(1.0)
    assert not found.offsets.any()  # the shift may have any direction
    assert found.clearance == pytest.approx(gap - 0.0031, abs=1e-8)


SHAPES = [
    Sphere("o", np.array([2.4, 0.3, 0.1]), 0.2),
    Capsule("o", np.array([2.4, 0.3, 0.1]), np.array([0.0, 0.6, 0.8]), 0.2, 0.1),
    Cylinder("o", np.array([2.0, 0.3, 0.2]), np.array([0.0, 1.0, 0.0]), 0.15, 0.2),
    Box("o", np.array([2.0, 0.0, -0.3]), np.eye(3), np.array([0.2, 0.3, 0.15])),
    Mesh(
        "o",
        np.array([[1.5, 0.2, -0.1], [2.5, 0.2, 0.0], [2.0, 0.2, 0.4], [2.0, 0.6, 0.2]]),
        np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]]),
    ),
]


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_the_bracket_of_the_joint_error_is_true_and_narrow(shape: Obstacle) -> None:
    """What is called certified is proved, what is called refuted has a witness."""
    problem, rows = problem_with(shape), motion(4, seed=3, size=0.01)
    proof = prove_clearance(problem, rows, ErrorBox())
    assert not proof.counts[:, 1:].any()
    errors = bracketed(problem, rows)
    assert is_certified(problem, rows, ErrorBox(joint=errors.certified))
    assert errors.certified < errors.refuted < 1.4 * errors.certified
    assert checked(problem, rows, ErrorBox(joint=errors.refuted * (1 + 1e-6)))
    assert checked(problem, rows, ErrorBox(joint=errors.certified)) == ()


def test_links_that_errors_bring_together_are_refuted() -> None:
    n = 6
    cables = CableLayout(0.03, 0.05, paper_hole_angles(n))
    arm = Manipulator("u", np.full(n, 0.3), 0.04, 1.5, 1.5, (-5.0, 5.0), cables)
    tip = np.array([1.8, 0.0, 0.0])
    problem = PlanningProblem(
        arm,
        Scene(),
        DesiredPath(tip, tip[None]),
        0.0,
        name="u",
        required_self_clearance=0.05,
    )
    alpha = np.zeros((2, n))
    alpha[:, [2, 3]] = 1.2  # a hook: link 5 looks back at link 2
    rows = Trajectory(
        np.zeros(2, bool), np.zeros(2), np.zeros(2), alpha, np.zeros((2, n))
    )
    proof = prove_clearance(problem, rows, ErrorBox())
    assert not proof.counts[:, 1:].any()
    errors = bracketed(problem, rows)
    assert errors.certified > 0.0
    box = ErrorBox(joint=1.01 * errors.refuted)
    (found,) = prove_clearance(problem, rows, box).counterexamples()
    assert found.pair.other_link > found.pair.link
    assert found.clearance < 0.05


def test_the_row_says_refuted_and_the_nominal_motion_needs_no_counterexample() -> None:
    problem, rows = problem_with(ceiling(0.05)), motion(2)
    for box, verdict, count in (
        (ErrorBox(joint=0.0001), Verdict.CERTIFIED, 0),
        (ErrorBox(joint=0.01), Verdict.REFUTED, 1),
    ):
        found = verify(problem.under(box), rows)
        row = next(c for c in found.checks if c.name == "clearance from obstacles")
        assert row.verdict is verdict
        assert len(found.counterexamples) == count
    assert row.worst == found.counterexamples[0].clearance
    assert row.where.endswith("within the error box; the nominal motion is clear")
    assert found.nominal_clear
    touching = replace(problem, required_clearance=0.06)
    found = verify(touching.under(ErrorBox(joint=0.01)), rows)
    assert found.counterexamples == ()
    assert found.verdict is Verdict.REFUTED
    assert not found.nominal_clear


def test_the_nominal_motion_is_called_clear_only_where_all_of_it_is_proved() -> None:
    """Two open sheets beside the arm have a hull: away from it, or around it."""
    rows, box = motion(2), ErrorBox(joint=0.01)
    low = np.array([[0.0, 1.0, -2.0], [1.0, 1.0, -2.0], [0.0, 2.0, -2.0]])
    for other, clear in (([0.0, 0.1, -0.1], True), ([0.0, -3.0, 0.0], False)):
        corners = np.vstack([low, low + other])
        if not clear:
            corners += [0.0, 0.0, 2.0]
        sheets = Mesh("sheets", corners, np.array([[0, 1, 2], [3, 4, 5]]))
        found = verify(problem_with(ceiling(0.05), sheets).under(box), rows)
        assert len(found.counterexamples) == 1
        assert found.nominal_clear is clear
        row = next(c for c in found.checks if c.name == "clearance from obstacles")
        assert row.where.endswith("is clear") is clear


@pytest.mark.parametrize("seed", range(6))
def test_what_meets_is_refuted_where_a_ball_in_both_is_found(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each pair left open at 0 mm is asked about, nearest first; by a plain loop."""
    rng, n_rows, n = np.random.default_rng(seed), 6, 60
    monkeypatch.setattr(clearances, "MOST", n)
    rows = motion(n_rows)
    proof = prove_clearance(problem_with(ceiling(0.1)), rows, ErrorBox())
    counts = rng.integers(0, 2, (n, 3)) * rng.integers(1, 4, (n, 3))
    upper = rng.choice([0.5, 2.0, 0.0, -1.0], n) * MEETING
    shares = rng.choice([0.0, 0.3, 1.0], n)
    numbers, points = rng.integers(0, n_rows - 1, n), rng.normal(size=(2, n, 3))
    lower = rng.uniform(-1.0, 1.0, n)
    least = LeastClearances(
        numbers, shares, lower, upper, verdicts_of(counts), points[0], points[1]
    )
    radii = {k: rng.choice([0.0, 0.25], len(BESIDE) + 1) for k in range(n)}
    left = {k: iter(radii[k].tolist()) for k in range(n)}
    asked = list[tuple[int, float]]()

    def ball(k: int, at: float, middle: FloatArray, _: float) -> tuple[float, Any]:
        asked.append((k, at))
        return next(left[k]), middle + at

    monkeypatch.setattr(clearances, "common_ball", ball)
    held: Any = SimpleNamespace(
        poses=list, placed=lambda k, at: (k, at), ball=lambda _: 0.1
    )
    path: Any = SimpleNamespace(
        n_intervals=n_rows - 1,
        split=proof.motion.path.split,
        at_moments=lambda moments: moments,
    )
    monkeypatch.setattr(clearances, "seeming_depth", lambda *_: -1.0)
    asking = replace(proof.motion, asked=held, path=path)
    given = replace(proof, motion=asking, on_path=least, counts=counts)
    found = given.with_depths()
    wanted, rest = [upper.copy(), points.copy()], counts.copy()
    moments = numbers + shares
    expected = list[tuple[int, float]]()
    for k in np.argsort(upper, kind="stable").tolist():
        near = upper[k] <= MEETING
        if not (counts[k, UNDECIDED] and not counts[k, REFUTED] and near):
            continue
        middle = points[:, k].mean(axis=0)
        for off, radius in zip([*BESIDE, 0.0], radii[k], strict=True):
            moment = min(max(numbers[k] + shares[k] + off, 0.0), n_rows - 1.0)
            expected.append((k, moment))
            if radius > max(0.0, -upper[k]):
                wanted[0][k], wanted[1][:, k] = -radius, middle + moment
                moments[k] = moment
                rest[k, REFUTED] += 1
                rest[k, UNDECIDED] -= 1
                break
    assert [k for k, _ in asked] == [k for k, _ in expected]
    np.testing.assert_allclose([at for _, at in asked], [at for _, at in expected])
    np.testing.assert_array_equal(found.counts, rest)
    np.testing.assert_array_equal(found.on_path.verdict, verdicts_of(rest))
    np.testing.assert_array_equal(found.on_path.lower, lower)
    np.testing.assert_array_equal(found.on_path.upper, wanted[0])
    np.testing.assert_allclose(found.on_path.interval + found.on_path.share, moments)
    np.testing.assert_allclose(found.on_path.link_point, wanted[1][0])
    np.testing.assert_allclose(found.on_path.other_point, wanted[1][1])
    assert expected and (rest != counts).any()


@pytest.mark.parametrize("radius", [0.0, 1e-6, 0.05])
@pytest.mark.parametrize("verdict", [CERTIFIED, REFUTED, UNDECIDED])
@pytest.mark.parametrize("near", [True, False])
def test_a_configuration_is_judged_by_its_proof_or_a_ball_in_both(
    radius: float, verdict: int, near: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows, box = motion(4), ErrorBox(joint=0.01, base=0.003)
    problem = problem_with(ceiling(0.1))
    about = AskedMotion.of_arm(problem, rows, box)
    number = about.asked.pairs.index(Pair(5, "ceiling"))
    search, limit = Search(about, number), 0.002 + 0.003
    assert search.limit == pytest.approx(limit)
    assert about.asked.ball(number) == ARM.link_radius
    points = np.array([[1.0, 2, 3], [4, 6, 8]])
    upper = np.nextafter(search.limit, 1.0) if not near else search.limit
    balls, centre = list[FloatArray](), np.array([7.0, 8.0, 9.0])

    def common_ball(_: Any, __: Any, at: FloatArray) -> tuple[float, FloatArray]:
        balls.append(at)
        return radius, centre

    told = SimpleNamespace(verdict=[verdict], upper=[upper], points=[points])
    monkeypatch.setattr(Proving, "prove", lambda _: told)
    monkeypatch.setattr(counterexample, "common_ball", common_ball)
    offset = np.linspace(-0.01, 0.01, 17)
    offset[3] = -0.0
    found = search._judged(Moment(2, 0.25), offset)
    asks = verdict != REFUTED and near
    assert [b.tolist() for b in balls] == ([[2.5, 4.0, 5.5]] if asks else [])
    if not (verdict == REFUTED or (asks and radius)):
        assert found is None
        return
    assert found is not None
    depth, ends = (-radius, [centre, centre]) if asks else (upper, points)
    assert found.clearance == pytest.approx(depth - 0.003)
    assert (found.interval, found.share, found.required) == (2, 0.25, 0.002)
    np.testing.assert_array_equal([found.link_point, found.other_point], ends)
    q = rows.joints[2] + 0.25 * (rows.joints[3] - rows.joints[2])
    np.testing.assert_allclose(found.joints, q + offset)
    np.testing.assert_array_equal(found.offsets, offset)
    assert not np.signbit(found.offsets[3])
    assert found.deeper == (depth <= 1e-9 - ARM.link_radius)


def search_among(gaps: Any, **known: Any) -> Any:
    """A search whose clearances are those of a function of rows and its slopes."""
    search: Any = object.__new__(Search)
    search._slopes = gaps
    for name, value in known.items():
        setattr(search, name, value)
    return search


def test_slopes_lead_to_the_corner_of_the_box_that_is_nearest() -> None:
    """Of a clearance that changes evenly; what it does not depend on stays."""
    rng = np.random.default_rng(1)
    for _ in range(30):
        slope = rng.normal(size=6) * (rng.random(6) < 0.7)
        scale, q = rng.uniform(0.1, 1.0, 6), rng.normal(size=(4, 6))

        def gaps(q: FloatArray, slope: FloatArray = slope) -> Any:
            return q @ slope, np.tile(slope, (len(q), 1))

        search = search_among(gaps, sizes=scale)
        begun = scale * rng.choice([-1.0, 0.0, 1.0], (4, 6))
        expected = np.where(slope == 0.0, begun, -np.sign(slope) * scale)
        least = ((expected - begun) @ slope)[:, None]
        expected = np.where(least < 0.0, expected, begun)
        np.testing.assert_array_equal(search._walk(q, begun, scale), expected)


def test_walks_begin_at_corners_that_turn_every_second_joint() -> None:
    search = search_among(None, sizes=np.ones(5))
    assert search._first_corners().tolist() == [
        [0, 0, 0, 0, 0], [0, 1, 0, 1, 0], [0, -1, 0, -1, 0], [1, 0, 1, 0, 1],
        [-1, 0, -1, 0, -1],
    ]  # fmt: skip
    least: Any = SimpleNamespace(interval=[7], share=[0.3])
    begun = starts(least, np.array([4]), 0)
    assert begun == (Moment(7, 0.3), *(Moment(4, k / 8.0) for k in range(9)))


@pytest.mark.parametrize("target", [0.53, 0.0, 0.5, 0.97, 1.0, 1.2, -0.1])
def test_the_nearest_moment_of_the_interval_is_found(target: float) -> None:
    """Within what an eighth of it is cut into; never outside of the interval."""
    offset = np.array([0.25, -0.5])

    def gaps(q: FloatArray) -> Any:
        np.testing.assert_allclose(q[:, 1], q[:, 0] - 0.75, rtol=0, atol=1e-12)
        return np.abs(q[:, 0] - 0.25 - 3.0 - target), None

    rows = SimpleNamespace(rows=lambda m: np.stack([m, m], axis=1))
    search = search_among(gaps, motion=rows)
    for off in (-0.12, 0.0, 0.12):
        share = min(max(target, 0.0), 1.0) + off
        begun = Moment(3, min(max(share, 0.0), 1.0))
        found, kept = search._settle(begun, offset)
        near = np.clip(target, 0.0, 1.0)
        assert found.interval == 3 and kept is offset
        assert abs(found.share - near) <= 0.125 / GRID**GRIDS
        assert 0.0 <= found.share <= 1.0


@pytest.mark.parametrize("limit", [0.5, 0.25, 1.0, 0.0, -1.0])
def test_the_smallest_offset_is_just_beyond_what_keeps_the_clearance(
    limit: float,
) -> None:
    """Of a clearance of 1 less the share, to the second fineness."""
    search = search_among(lambda q: (1.0 - q[:, 0] + 5.0, None))
    search.limit, offset = limit, np.array([1.0, -2.0])
    search._nearest = lambda _: (Moment(1, 0.5), offset)
    search._joints = lambda moment: np.array([5.0, 0.0])
    search._judged = lambda moment, part: (moment, part)
    found = search.smallest(())
    if limit <= 0.0:
        assert found is None
        return
    moment, part = found
    assert moment == Moment(1, 0.5)
    share = part[0]
    assert part.tolist() == [share, -2.0 * share]
    assert 1.0 - limit < share <= 1.0 - limit + 1.0 / (PARTS - 1) ** 2


def test_what_stands_nearer_by_its_error_is_met_sooner() -> None:
    errors = ErrorBox(base=0.25, obstacles=(ObstacleError("post", 0.5, 0.0),))
    assert grown_by(errors, Pair(1, "post")) == 0.75
    assert grown_by(errors, Pair(1, other_link=3)) == 0.0
