"""Limits, tip and coverage: kept, broken at one place, and stated exactly."""

from dataclasses import replace

import numpy as np
import pytest

from vdsm_pin.arm.kinematics import joint_angles, joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.problem.desired_path import DesiredPath, Order
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.drawing import check_order, coverage
from vdsm_pin.verification.limits import check_limits
from vdsm_pin.verification.records import Check, Verdict
from vdsm_pin.verification.tip import check_tip

ARM = built_in("hrm8")
SQUARE = np.array([[3.1, 0, 0], [3.1, 0.4, 0], [3.1, 0.4, 0.4], [3.1, 0, 0.4]])


def drawing(n: int = 161, laps: float = 1.0) -> tuple[PlanningProblem, Trajectory]:
    """The straight arm's tip drawing a closed square of side 0.4 m."""
    path = DesiredPath(SQUARE[0], SQUARE, closed=True, required_coverage=1.0)
    stations = np.linspace(0.0, laps * path.length, n)
    tips = path.at(np.mod(stations, path.length))
    tips[-1] = path.at(np.array([np.mod(stations[-1], path.length)]))[0]
    x0 = tips[:, 0] - np.sqrt(ARM.total_length**2 - (tips[:, 1:] ** 2).sum(axis=1))
    base = np.column_stack([x0, np.zeros((n, 2))])
    centres = base[:, None] + ARM.ratios[:, None] * (tips - base)[:, None]
    alpha, theta = joint_angles(ARM, centres)
    problem = PlanningProblem(ARM, Scene(), path, 0.0, name="p")
    return problem, Trajectory(np.ones(n, bool), stations, x0, alpha, theta)


def named(checks: tuple[Check, ...], words: str) -> Check:
    (found,) = [check for check in checks if words in check.name]
    return found


def test_a_drawn_square_passes_and_is_covered() -> None:
    problem, motion = drawing()
    report = check_tip(problem, motion)
    assert {check.verdict for check in report.checks} == {Verdict.CERTIFIED}
    assert report.coverage == pytest.approx(1.0, abs=1e-12)
    assert report.coverage <= 1.0
    assert report.undrawn.shape == (0, 2)
    limits = check_limits(problem, motion)
    assert {check.verdict for check in limits} == {Verdict.CERTIFIED}


def test_the_change_per_row_is_judged_only_where_it_is_limited() -> None:
    problem, motion = drawing(9)
    change = float(np.abs(np.diff(motion.alpha, axis=0)).max())
    names = [check.name for check in check_limits(problem, motion)]
    assert not [name for name in names if "change" in name]
    for limit, verdict in (
        (change * 1.001, Verdict.CERTIFIED),
        (change * 0.999, Verdict.REFUTED),
    ):
        limited = replace(problem, max_row_change=limit)
        row = named(check_limits(limited, motion), "change")
        assert (row.verdict, row.limit) == (verdict, limit)
        assert row.worst == pytest.approx(change)


@pytest.mark.parametrize("tolerance", [1e-6, 1e-5, 1e-3])
def test_the_tip_may_be_off_by_its_tolerance_and_no_farther(tolerance: float) -> None:
    problem, motion = drawing()
    problem = replace(problem, tip_tolerance=tolerance)
    pad = TOLERANCES.arithmetic  # rounding is on the safe side
    for most, verdict in (
        (0.999 * tolerance, Verdict.CERTIFIED),
        (tolerance - 1.1 * pad, Verdict.CERTIFIED),
        (tolerance - 0.9 * pad, Verdict.REFUTED),
        (1.001 * tolerance, Verdict.REFUTED),
    ):
        off = motion.x0 + np.where(np.arange(161) == 50, most, 0.0)
        report = check_tip(problem, replace(motion, x0=off))
        row = named(report.checks, "at the way")
        assert (row.verdict, row.moment, row.count) == (verdict, 50, 161)
        assert (row.limit, row.unit) == (tolerance, "m")
        assert row.worst == pytest.approx(most, abs=0.01 * pad)
        assert (report.coverage > 0.999) is (verdict is Verdict.CERTIFIED)
        off = motion.x0 + np.where(np.arange(161) == 0, most, 0.0)
        row = named(check_tip(problem, replace(motion, x0=off)).checks, "tip at its st")
        assert row.verdict is verdict


def test_stations_within_the_tolerance_are_the_same_place() -> None:
    problem, motion = drawing()
    stations = motion.path_m.copy()
    stations[80] = stations[79] - 2e-5
    back = replace(motion, path_m=stations)
    for tolerance, verdict in ((3e-5, Verdict.CERTIFIED), (1e-5, Verdict.REFUTED)):
        (row,) = check_order(replace(problem, tip_tolerance=tolerance), back)
        assert row.verdict is verdict


def test_start_joints_are_held_to_the_tolerance_by_the_way_they_move_the_tip() -> None:
    problem, motion = drawing()
    joints = motion.part(0, 1).joints[0]
    for column, most in ((0, 1e-5), (3, 1e-5 / ARM.total_length)):
        for part, verdict in ((0.99, Verdict.CERTIFIED), (1.01, Verdict.REFUTED)):
            given = joints.copy()
            given[column] += part * most
            path = replace(problem.path, start_joints=given)
            asked = replace(problem, tip_path=path, tip_tolerance=1e-5)
            row = named(check_tip(asked, motion).checks, "joints at their start")
            assert row.verdict is verdict


def test_a_fixed_base_is_kept_to_a_nanometre() -> None:
    problem, motion = drawing()
    fixed = replace(ARM, base_range=(0.1, 0.1))
    still = replace(motion, x0=np.full(161, 0.1))
    for shift, verdict in ((5e-10, Verdict.CERTIFIED), (-2e-9, Verdict.REFUTED)):
        moved = replace(still, x0=still.x0 + np.where(np.arange(161) == 7, shift, 0.0))
        row = named(check_limits(replace(problem, manipulator=fixed), moved), "base")
        assert row.verdict is verdict
    assert row.moment == 7


def test_the_deviation_bounds_the_tip_between_the_rows() -> None:
    problem, motion = drawing(41)
    bound = check_tip(problem, motion).deviation
    worst = 0.0
    for t in np.linspace(0.0, 1.0, 41):
        now = [
            v[:-1] + t * (v[1:] - v[:-1])
            for v in (motion.x0, motion.alpha, motion.theta, motion.path_m)
        ]
        tips = joint_centres(ARM, *now[:3])[:, -1]
        goal = problem.path.at(np.mod(now[3], problem.path.length))
        worst = max(worst, float(np.linalg.norm(tips - goal, axis=1).max()))
    assert 0.0 < worst <= bound <= 20.0 * worst


@pytest.mark.parametrize("rows", [1, 2])
def test_a_deviation_is_what_the_tip_is_off_by_and_the_rounding(rows: int) -> None:
    """The straight arm moves along a line beside its path."""
    x0, angles, off = np.array([0.0, 0.1])[:rows], np.zeros((rows, 8)), 3e-4
    points = np.array([[ARM.total_length + x, off, 0.0] for x in x0])
    path = DesiredPath(points[0], points, required_coverage=0.0)
    problem = PlanningProblem(ARM, Scene(), path, 0.0, name="p")
    motion = Trajectory(np.ones(rows, bool), x0, x0, angles, angles)
    found = check_tip(problem, motion).deviation
    assert found == pytest.approx(off + TOLERANCES.arithmetic, abs=1e-14)


def test_a_smooth_piece_draws_only_where_all_of_it_is_near() -> None:
    """The straight arm's tip along its axis; it swings aside before and after row 1."""
    x0, angles = np.array([0.0, 0.1, 0.2, 0.3]), np.zeros((4, 8))
    ends = np.array([[ARM.total_length + x, 0.0, 0.0] for x in (0.0, 0.3)])
    path = DesiredPath(ends[0], ends)
    problem = PlanningProblem(ARM, Scene(), path, 0.0, name="p")
    for rate, share in ((0.0, 1.0), (0.05, 1.0 / 3.0)):
        rates = np.zeros((4, 17))
        rates[:, 0], rates[1, 1] = 0.1, rate
        more = {"times": np.arange(4.0), "rates": rates}
        motion = Trajectory(np.ones(4, bool), x0, x0, angles, angles, **more)
        report = check_tip(problem, motion)
        aside = 4.0 / 27.0 * rate * ARM.total_length  # of a Hermite piece
        assert aside == 0.0 or aside > 2.0 * path.spacing
        assert aside <= report.deviation <= aside + path.spacing
        assert report.coverage == pytest.approx(share, abs=1e-9)
        undrawn = [[0.0, 0.2]] if rate else np.zeros((0, 2))
        np.testing.assert_allclose(report.undrawn, undrawn, atol=1e-9)


def test_a_corner_skipped_between_rows_shows_in_the_deviation() -> None:
    problem, motion = drawing(4 * 40 + 1)
    keep = np.ones(motion.n_samples, bool)
    keep[40] = False  # the corner at 0.4 m
    cut = Trajectory(*(getattr(motion, n)[keep] for n in
                       ("on_path", "path_m", "x0", "alpha", "theta")))  # fmt: skip
    # The chord misses the corner by 10 mm / sqrt 2.
    assert check_tip(problem, cut).deviation == pytest.approx(7.07e-3, abs=2e-4)


@pytest.mark.parametrize("laps", [0.5, 1.25])
def test_coverage_counts_each_place_once(laps: float) -> None:
    problem, motion = drawing(201, laps)
    share, gaps = coverage(problem.path, motion)
    assert share == pytest.approx(min(1.0, laps), abs=1e-9)
    assert len(gaps) == (1 if laps < 1.0 else 0)
    if laps < 1.0:
        np.testing.assert_allclose(gaps, [[0.8, 1.6]], atol=1e-9)
        row = named(check_tip(problem, motion).checks, "coverage")
        assert row.verdict is Verdict.INCOMPLETE


def test_a_tip_off_the_path_by_two_micrometres_is_refuted_at_its_row() -> None:
    problem, motion = drawing()
    x0 = motion.x0.copy()
    x0[17] += 2e-6
    row = named(
        check_tip(problem, replace(motion, x0=x0)).checks, "path at the waypoints"
    )
    assert row.verdict is Verdict.REFUTED
    assert row.moment == 17.0
    assert row.worst == pytest.approx(2e-6, rel=1e-6)


def test_what_is_not_proved_to_be_drawn_is_not_covered() -> None:
    """Of 160 equal steps the two beside a row that is off are not drawn."""
    problem, motion = drawing()
    x0 = motion.x0.copy()
    x0[17] += 2e-6
    report = check_tip(problem, replace(motion, x0=x0))
    assert report.coverage == pytest.approx(158 / 160, abs=1e-9)
    np.testing.assert_allclose(report.undrawn, [[0.16, 0.18]], atol=1e-9)
    row = named(report.checks, "coverage")
    assert (row.verdict, row.worst) == (Verdict.INCOMPLETE, report.coverage)
    assert row.where == "waypoints off it do not count: 1"
    # Rows that say they draw all of it, while the arm does not move.
    still = {n: 0.0 * getattr(motion, n) for n in ("x0", "alpha", "theta")}
    report = check_tip(problem, replace(motion, **still))
    assert report.coverage < 0.02
    assert named(report.checks, "coverage").verdict is Verdict.INCOMPLETE


def test_a_step_that_cuts_a_corner_is_not_covered() -> None:
    """The rows are on the path, the chord of the step at the first corner is not."""
    problem, motion = drawing()
    keep = np.ones(motion.n_samples, bool)
    keep[30:51] = False
    cut = Trajectory(*(getattr(motion, n)[keep] for n in
                       ("on_path", "path_m", "x0", "alpha", "theta")))  # fmt: skip
    report = check_tip(problem, cut)
    assert report.deviation > problem.path.spacing
    np.testing.assert_allclose(report.undrawn, [[0.29, 0.51]], atol=1e-9)
    assert report.coverage == pytest.approx(138 / 160, abs=1e-9)


def test_a_wrong_start_is_refuted() -> None:
    problem, motion = drawing()
    moved = replace(problem, tip_path=replace(problem.path, start=SQUARE[0] + 2e-6))
    assert named(check_tip(moved, motion).checks, "start").verdict is Verdict.REFUTED
    joints = motion.joints[0].copy()
    given = replace(problem, tip_path=replace(problem.path, start_joints=joints))
    good = named(check_tip(given, motion).checks, "joints at")
    assert good.verdict is Verdict.CERTIFIED
    joints[3] += 1e-6
    given = replace(problem, tip_path=replace(problem.path, start_joints=joints))
    bad = named(check_tip(given, motion).checks, "joints at")
    assert bad.verdict is Verdict.REFUTED


def test_nothing_on_the_path_is_not_a_pass() -> None:
    problem, motion = drawing()
    off = replace(motion, on_path=np.zeros(motion.n_samples, bool))
    report = check_tip(problem, off)
    assert named(report.checks, "path at the waypoints").verdict is Verdict.UNDECIDED
    assert named(report.checks, "between").verdict is Verdict.UNDECIDED
    assert report.coverage == 0.0


@pytest.mark.parametrize(
    ("field", "joint", "words"), [("alpha", 3, "alpha in"), ("theta", 6, "theta in")]
)
def test_one_angle_past_its_limit_is_found(field: str, joint: int, words: str) -> None:
    problem, motion = drawing()
    for past, verdict in ((2e-9, Verdict.REFUTED), (-1e-12, Verdict.CERTIFIED)):
        values = getattr(motion, field).copy()
        values[9, joint - 1] = -(ARM.max_joint_angle + past)
        row = named(check_limits(problem, replace(motion, **{field: values})), words)
        assert row.verdict is verdict
        assert (row.moment, row.where) == (9.0, f"{field}{joint}")


def test_the_cone_is_judged_apart_from_the_box() -> None:
    problem, motion = drawing()
    alpha, theta = motion.alpha.copy(), motion.theta.copy()
    alpha[5, 2] = theta[5, 2] = np.deg2rad(40.0)
    rows = check_limits(problem, replace(motion, alpha=alpha, theta=theta))
    assert named(rows, "alpha in").verdict is Verdict.CERTIFIED
    cone = named(rows, "psi")
    assert cone.verdict is Verdict.REFUTED
    truth = np.arccos(np.cos(np.deg2rad(40.0)) ** 2)
    assert cone.worst == pytest.approx(truth, abs=1e-12)


def test_psi_over_an_interval_is_largest_at_an_end() -> None:
    rng = np.random.default_rng(0)
    a, b = rng.uniform(-1.5, 1.5, (2, 20_000, 2))
    t = rng.uniform(0.0, 1.0, (20_000, 1))
    psi = [np.arccos(np.cos(q).prod(axis=1)) for q in (a, b, a + t * (b - a))]
    assert (psi[2] <= np.maximum(psi[0], psi[1]) + 1e-12).all()


def test_base_and_steps_are_judged() -> None:
    problem, motion = drawing()
    x0 = motion.x0.copy()
    x0[3] = -5.1
    rail = named(check_limits(problem, replace(motion, x0=x0)), "rail")
    assert rail.verdict is Verdict.REFUTED
    assert (rail.worst, rail.limit) == (-5.1, -5.0)
    alpha = motion.alpha.copy()
    alpha[4:, 0] += np.deg2rad(5.5)
    limited = replace(problem, max_row_change=np.deg2rad(5.0))
    step = named(
        check_limits(limited, replace(motion, alpha=alpha)), "between waypoints"
    )
    assert step.verdict is Verdict.REFUTED
    assert (step.moment, step.where) == (3.0, "joint 1")


def parts(motion: Trajectory, *ranges: tuple[int, int]) -> Trajectory:
    """Ranges of rows one after the other, a row off the path between them."""
    rows, off = [], []
    for first, last in ranges:
        step = 1 if last > first else -1
        rows += [first, *range(first, last, step)]
        off.append(len(rows) - abs(last - first) - 1)
    on = np.ones(len(rows), bool)
    on[off] = False
    return Trajectory(
        on, *(getattr(motion, n)[rows] for n in ("path_m", "x0", "alpha", "theta"))
    )


@pytest.mark.parametrize("closed", [True, False])
def test_pieces_in_another_order_are_refuted_unless_free(closed: bool) -> None:
    problem, motion = drawing()
    problem = replace(problem, tip_path=replace(problem.path, closed=closed))
    if not closed:
        motion = motion.part(0, 120)
    given = parts(motion, (0, 40), (50, 70), (80, 110))
    swapped = parts(motion, (0, 40), (80, 110), (50, 70))
    turned = parts(motion, (0, 40), (70, 50), (80, 110))
    begun = parts(motion, (50, 70), (80, 110), (0, 40))
    for rows, right in (
        (motion, True), (given, True), (swapped, False), (turned, False),
        (begun, closed),
    ):  # fmt: skip
        (row,) = check_order(problem, rows)
        assert row.verdict is (Verdict.CERTIFIED if right else Verdict.REFUTED)
        free = replace(problem, tip_path=replace(problem.path, order=Order.FREE))
        assert check_order(free, rows) == ()


def test_the_place_where_the_order_breaks_is_named() -> None:
    problem, motion = drawing()
    path_m = motion.path_m.copy()
    path_m[60] -= 0.02
    (row,) = check_order(problem, replace(motion, path_m=path_m))
    assert (row.verdict, row.moment) == (Verdict.REFUTED, 60.0)
    assert row.worst == pytest.approx(0.01, abs=1e-9)
    (row,) = check_order(problem, parts(motion, (0, 40), (80, 110), (50, 70)))
    assert row.moment == 73.0  # the last piece: a row before each is off
    nothing = replace(motion, on_path=np.zeros(motion.n_samples, bool))
    (row,) = check_order(problem, nothing)
    assert row.verdict is Verdict.UNDECIDED


def test_laps_in_one_go_and_rounding_are_in_order() -> None:
    problem, motion = drawing(401, 2.5)
    (row,) = check_order(problem, motion)
    assert row.verdict is Verdict.CERTIFIED
    path_m = np.random.default_rng(0).normal(motion.path_m, 1e-12)
    (row,) = check_order(problem, replace(motion, path_m=path_m))
    assert row.verdict is Verdict.CERTIFIED
    wrapped = np.mod(motion.path_m, problem.path.length)
    (row,) = check_order(problem, replace(motion, path_m=wrapped))
    assert row.verdict is Verdict.CERTIFIED


def test_coverage_that_nobody_asks_for_is_no_check() -> None:
    problem, motion = drawing(201, 0.5)
    asked = replace(problem, tip_path=replace(problem.path, required_coverage=0.0))
    report = check_tip(asked, motion)
    assert not [check for check in report.checks if "coverage" in check.name]
    assert report.coverage == pytest.approx(0.5, abs=1e-9)
