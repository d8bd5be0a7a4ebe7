"""Where the last link looks: proved against dense sampling and closed forms."""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from vdsm_pin.arm.kinematics import joint_centres, link_frames
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.pointing import Pointing, angles_between
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification import pointing as judging
from vdsm_pin.verification.pointing import check_pointing
from vdsm_pin.verification.records import Check, Verdict

ARM = built_in("hrm8")


def motion(
    rng: np.random.Generator, rows: int, size: float, step: float
) -> tuple[Trajectory, FloatArray]:
    """A motion all of which draws, and its tips at the rows."""
    turns = rng.uniform(-1.0, 1.0, (2, rows, ARM.n_links))
    angles = rng.uniform(-size, size, (2, 1, ARM.n_links)) + step * turns.cumsum(axis=1)
    x0 = 0.01 * rng.uniform(-1.0, 1.0, rows).cumsum()
    tips = joint_centres(ARM, x0, *angles)[:, -1]
    gaps = np.linalg.norm(np.diff(tips, axis=0), axis=1)
    stations = np.append(0.0, gaps.cumsum())
    on = np.ones(rows, dtype=np.bool_)
    return Trajectory(on, stations, x0, *angles), tips


def asked(tips: FloatArray, pointing: Pointing) -> PlanningProblem:
    """The problem to draw the polyline through some tips."""
    path = DesiredPath(tips[0], tips, pointing=pointing)
    return PlanningProblem(ARM, Scene(()), path, 0.0, name="test")


def sampled(task: PlanningProblem, told: Trajectory, count: int) -> FloatArray:
    """Angles at many instants, in plain arithmetic, shape (k,); [rad]."""
    last = told.n_samples - 1
    at = np.linspace(0.0, last, count * last + 1)
    k = np.minimum(at.astype(np.int64), last - 1)
    t = (at - k)[:, None]
    rows = (1.0 - t) * told.joints[k] + t * told.joints[k + 1]
    station = (1.0 - t[:, 0]) * told.path_m[k] + t[:, 0] * told.path_m[k + 1]
    centres = joint_centres(ARM, rows[:, 0], rows[:, 1::2], rows[:, 2::2])
    axes = centres[:, -1] - centres[:, -2]
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    aims = task.path.aims(centres[:, -1], station)
    aims /= np.linalg.norm(aims, axis=1, keepdims=True)
    return np.asarray(np.arccos(np.clip((axes * aims).sum(axis=1), -1.0, 1.0)))


def the_row(task: PlanningProblem, told: Trajectory) -> Check:
    (row,) = check_pointing(task, told)
    return row


def pointings(rng: np.random.Generator, tips: FloatArray) -> list[Pointing]:
    """A target, a direction, and a direction for each corner."""
    ahead = np.array([1.0, 0.0, 0.0])
    each = ahead + rng.normal(0.0, 0.3, tips.shape)
    return [
        Pointing(0.1, target=tips[0] + rng.uniform(0.3, 1.0, 3)),
        Pointing(0.1, directions=np.array([ahead])),
        Pointing(0.1, directions=each),
    ]


@pytest.mark.parametrize("seed", range(12))
def test_the_largest_angle_is_bounded_closely_and_decides(seed: int) -> None:
    rng = np.random.default_rng(seed)
    told, tips = motion(rng, 30, 0.1, 0.02)
    for pointing in pointings(rng, tips):
        task = asked(tips, pointing)
        truth = float(sampled(task, told, 200).max())
        for cone, verdict in (
            (truth + 2e-3, Verdict.CERTIFIED),
            (truth + 1e-5, Verdict.CERTIFIED),
            (truth - 1e-5, Verdict.REFUTED),
            (truth / 2.0, Verdict.REFUTED),
        ):
            if not 0.0 < cone < np.pi / 2.0:
                continue
            row = the_row(asked(tips, replace(pointing, cone=cone)), told)
            assert row.verdict is verdict, (cone - truth, row)
            assert row.count == 29
            if verdict is Verdict.CERTIFIED:
                assert truth - 1e-9 <= row.worst <= min(cone, truth + 1.01e-3) + 1e-9
            else:
                assert cone < row.worst <= truth + 1e-6


def test_a_swing_between_two_rows_is_seen() -> None:
    """Both rows look ahead; in between, the two last joints turn out and back."""
    alpha = np.zeros((3, ARM.n_links))
    alpha[1, -1] = 0.3
    still = np.zeros(3), alpha, np.zeros_like(alpha)
    tips = joint_centres(ARM, *still)[:, -1]
    on, stations = np.ones(3, dtype=np.bool_), np.array([0.0, 0.05, 0.1])
    told = Trajectory(on, stations, *still)
    path = DesiredPath(
        tips[0], np.array([[0.0, 0, 0], [0.1, 0, 0]]),
        pointing=Pointing(0.2, directions=np.eye(3)[:1]),
    )  # fmt: skip
    task = PlanningProblem(ARM, Scene(()), path, 0.0, name="test")
    row = the_row(task, told)
    assert (row.verdict, row.moment) == (Verdict.REFUTED, 1.0)
    assert row.worst == pytest.approx(0.3, abs=1e-12)
    # Off the path it may look anywhere; a row alone on the path is looked at too.
    off = replace(told, on_path=np.array([True, False, True]))
    row = the_row(task, off)
    assert (row.verdict, row.count) == (Verdict.CERTIFIED, 2)
    alone = replace(told, on_path=np.array([False, True, False]))
    assert the_row(task, alone).verdict is Verdict.REFUTED
    last = replace(told, on_path=np.array([False, False, True]))
    row = the_row(task, last)
    assert (row.verdict, row.count) == (Verdict.CERTIFIED, 1)


def test_a_target_that_the_tip_runs_through_is_never_green() -> None:
    x0 = np.linspace(0.0, 1.0, 11)
    flat = np.zeros((11, ARM.n_links))
    tips = joint_centres(ARM, x0, flat, flat)[:, -1]
    told = Trajectory(np.ones(11, dtype=np.bool_), x0, x0, flat, flat)
    for target, verdict in (
        (tips[5], {Verdict.REFUTED, Verdict.UNDECIDED}),
        ((tips[5] + tips[6]) / 2.0, {Verdict.REFUTED, Verdict.UNDECIDED}),
        (tips[-1] + np.array([0.1, 0.0, 0.0]), {Verdict.CERTIFIED}),
    ):
        task = asked(tips[[0, -1]], Pointing(0.5, target=target))
        assert the_row(task, told).verdict in verdict


def test_directions_that_turn_back_on_themselves_are_never_green() -> None:
    """Half-way between a direction and its opposite there is none."""
    x0 = np.linspace(0.0, 1.0, 11)
    flat = np.zeros((11, ARM.n_links))
    tips = joint_centres(ARM, x0, flat, flat)[:, -1]
    told = Trajectory(np.ones(11, dtype=np.bool_), x0, x0, flat, flat)
    ends = np.array([[1.0, 0, 0], [-1.0, 0, 0]])
    task = asked(tips[[0, -1]], Pointing(1.5, directions=ends))
    assert the_row(task, told).verdict is not Verdict.CERTIFIED


def test_a_closed_path_has_one_direction_where_it_closes() -> None:
    """Of two the one at its end would not be asked for."""
    corners = np.array([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]])
    known = np.eye(3)[[0, 1, 1]]
    for last, good in (([1.0, 0.0, 0.0], True), ([1.0, 1e-9, 0.0], False)):
        looks = Pointing(0.1, directions=np.vstack([known, [last]]))
        context = nullcontext() if good else pytest.raises(InvalidInput, match="closed")
        with context:
            DesiredPath(corners[0], corners, True, pointing=looks)


def test_without_rows_on_the_path_nothing_is_proved() -> None:
    rng = np.random.default_rng(0)
    told, tips = motion(rng, 5, 0.1, 0.02)
    task = asked(tips, Pointing(1.0, directions=np.eye(3)[:1]))
    off = replace(told, on_path=np.zeros(5, dtype=np.bool_))
    assert the_row(task, off).verdict is Verdict.UNDECIDED


def test_angles_are_those_of_arccos() -> None:
    rng = np.random.default_rng(1)
    one, other = rng.normal(size=(2, 1000, 3))
    sizes = np.linalg.norm(one, axis=1) * np.linalg.norm(other, axis=1)
    expected = np.arccos((one * other).sum(axis=1) / sizes)
    np.testing.assert_allclose(angles_between(one, other), expected, atol=1e-7)
    assert np.isnan(angles_between(np.zeros((1, 3)), one[:1])[0])


def with_errors(
    rng: np.random.Generator, task: PlanningProblem, told: Trajectory, box: ErrorBox
) -> float:
    """The largest angle at rows under errors at the ends of the box; [rad]."""
    largest, joints = 0.0, box.angles(ARM.n_links)
    for k in range(300):
        signs = rng.choice((-1.0, 1.0), (2, ARM.n_links))
        if k < 4:
            signs = np.full((2, ARM.n_links), 1.0 if k % 2 else -1.0)
            signs[0] *= 1.0 if k < 2 else -1.0
        alpha, theta = told.alpha + signs[0] * joints[:, 0], told.theta
        centres = joint_centres(ARM, told.x0, alpha, theta + signs[1] * joints[:, 1])
        centres += box.base * (lambda v: v / np.linalg.norm(v))(rng.normal(size=3))
        turn = rng.normal(size=3)
        turn /= np.linalg.norm(turn)
        cos, sin = np.cos(box.base_turn), np.sin(box.base_turn)
        along = (centres @ turn)[..., None] * turn
        centres = along + cos * (centres - along) + sin * np.cross(turn, centres)
        aims = task.path.aims(centres[:, -1], told.path_m)
        largest = max(
            largest, float(angles_between(centres[:, -1] - centres[:, -2], aims).max())
        )
    return largest


def test_no_error_of_a_joint_turns_its_link_by_more() -> None:
    """By rotation matrices; at a corner of the box it is as much."""
    rng = np.random.default_rng(8)
    for _ in range(200):
        box = ErrorBox(joints=(tuple(rng.uniform(0.0, 1.0, 2) ** 2),))
        (most,) = box.turns(1)
        alpha, theta = rng.uniform(-1.0, 1.0, (2, 1))
        errors = box.angles(1)[0] * rng.uniform(-1.0, 1.0, (50, 2))
        errors[0] = box.angles(1)[0]
        nominal = link_frames(alpha[None], theta[None])[0, 0]
        off = link_frames(alpha + errors[:, :1], theta + errors[:, 1:])[:, 0]
        cosines = (np.einsum("nij,ij->n", off, nominal) - 1.0) / 2.0
        turns = np.arccos(np.clip(cosines, -1.0, 1.0))
        assert turns.max() <= most + 1e-7
        assert turns[0] == pytest.approx(most, abs=1e-7)


@pytest.mark.parametrize("seed", range(6))
def test_within_errors_the_cone_is_proved_or_undecided(seed: int) -> None:
    rng = np.random.default_rng(seed)
    told, tips = motion(rng, 12, 0.05, 0.01)
    box = ErrorBox(joint=0.002, base=0.003, base_turn=0.001, joints=((0.004, 0.001),))
    for pointing in pointings(rng, tips):
        task = asked(tips, pointing)
        nominal = float(sampled(task, told, 50).max())
        met = with_errors(rng, task, told, box)
        assert met > nominal
        for cone in (nominal + 0.005, met - 1e-4):
            narrow = replace(task.path, pointing=replace(pointing, cone=cone))
            (row,) = check_pointing(replace(task, tip_path=narrow), told, errors=box)
            assert row.verdict is Verdict.UNDECIDED
            assert row.worst > cone
        wide = replace(task.path, pointing=replace(pointing, cone=nominal + 0.25))
        (row,) = check_pointing(replace(task, tip_path=wide), told, errors=box)
        assert row.verdict is Verdict.CERTIFIED
        assert met <= row.worst <= nominal + 0.25
        past = replace(task.path, pointing=replace(pointing, cone=nominal - 0.01))
        (row,) = check_pointing(replace(task, tip_path=past), told, errors=box)
        assert row.verdict is Verdict.REFUTED
        assert (row,) == check_pointing(replace(task, tip_path=past), told)


def test_a_target_within_reach_of_the_errors_is_never_green() -> None:
    told, tips = motion(np.random.default_rng(3), 6, 0.05, 0.01)
    centres = joint_centres(ARM, told.x0, told.alpha, told.theta)
    ahead = tips[-1] + 2.0 * (centres[-1, -1] - centres[-1, -2])
    task = asked(tips, Pointing(1.5, target=ahead))
    (row,) = check_pointing(task, told)
    assert row.verdict is Verdict.CERTIFIED
    (row,) = check_pointing(task, told, errors=ErrorBox(base=1.0))
    assert row.verdict is Verdict.UNDECIDED


@pytest.mark.parametrize("seed", range(4))
def test_a_bound_beyond_the_cone_is_never_green(
    seed: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With few halvings the angles seen under errors keep a cone, their bound not."""
    monkeypatch.setattr(judging, "ROUNDS", 3)
    rng, box = np.random.default_rng(seed), ErrorBox(joint=0.0005)
    (told, tips), count = motion(rng, 12, 0.05, 0.01), 0
    for looks in pointings(rng, tips):
        task = asked(tips, replace(looks, cone=1.5))
        (nominal, _), (erring, _) = (
            judging._largest(task, told, errors, NO_LIMIT)
            for errors in (ErrorBox(), box)
        )
        least = max(nominal.bound, erring.seen)
        if not least < erring.bound < 1.4:
            continue
        count += 1
        cone = (least + erring.bound) / 2.0 - TOLERANCES.joint_limit
        tight = replace(task.path, pointing=replace(looks, cone=cone))
        tight = replace(task, tip_path=tight)
        (row,) = judging.check_pointing(tight, told)
        assert row.verdict is Verdict.CERTIFIED
        (row,) = judging.check_pointing(tight, told, errors=box)
        assert row.verdict is Verdict.UNDECIDED
    assert count


@pytest.mark.parametrize("rows", [1, 2])
@pytest.mark.parametrize("angle", [0.3, 1.2])
def test_a_cone_is_kept_to_the_tolerance_of_angles(angle: float, rows: int) -> None:
    """Of an arm that stands still, on both sides of it."""
    tip = np.array([ARM.total_length, 0.0, 0.0])
    look = np.array([[np.cos(angle), np.sin(angle), 0.0]])
    on, none, still = np.ones(rows, bool), np.zeros(rows), np.zeros((rows, ARM.n_links))
    rest = Trajectory(on, none, none, still, still)
    for share, verdict in ((-0.5, "certified"), (0.5, "certified"), (1.5, "refuted")):
        cone = angle - share * TOLERANCES.joint_limit
        path = DesiredPath(tip, tip[None], pointing=Pointing(cone, directions=look))
        problem = PlanningProblem(ARM, Scene(()), path, 0.0, name="p")
        row = the_row(problem, rest)
        assert row.verdict.value == verdict
        assert row.worst == pytest.approx(angle, abs=1e-11)
        assert (row.count, row.moment, row.limit) == (1, 0.0, cone)
