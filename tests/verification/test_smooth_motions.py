"""Smooth pieces between rows: the curve is judged, by its own values and samples."""

from pathlib import Path

import numpy as np
import pytest

from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.limits import check_limits
from vdsm_pin.verification.records import Check, Verdict, Verification
from vdsm_pin.verification.tip import check_tip
from vdsm_pin.verification.verify import verify

HEAD = """
vdsm_problem: 1
name: smooth
length_unit: mm
manipulator: {link_lengths: [300, 300, 300], link_radius: 40, max_link_angle_deg: 60,
              max_joint_angle_deg: 50, base_range: [-1000, 1000]}
required_clearance: 5
"""


def problem_of(folder: Path, more: str = "") -> PlanningProblem:
    path = folder / "p.yaml"
    path.write_text(HEAD + more, encoding="utf-8")
    return read_problem(path)


def motion_of(
    q: FloatArray,
    times: FloatArray,
    rates: FloatArray | None = None,
    changes: FloatArray | None = None,
) -> Trajectory:
    none, x0, alpha, theta = np.zeros(len(q)), q[:, 0], q[:, 1::2], q[:, 2::2]
    more = {"times": times, "rates": rates, "changes": changes}
    return Trajectory(none > 0, none, x0, alpha, theta, **more)


def judged(problem: PlanningProblem, motion: Trajectory) -> Verification:
    return verify(problem, motion)


def row(found: Verification, name: str) -> Check:
    return next(check for check in found.checks if check.name == name)


def curve(motion: Trajectory, t: FloatArray) -> FloatArray:
    """Rows of q at times, by solving for each piece's polynomial in time."""
    assert motion.times is not None and motion.rates is not None
    q, v, a, times = motion.joints, motion.rates, motion.changes, motion.times
    k = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
    found = np.zeros((len(t), q.shape[1]))
    values = [q, v] if a is None else [q, v, a]
    m = len(values)
    n = 2 * m
    for piece in np.unique(k):
        h = times[piece + 1] - times[piece]
        ends = [
            [h**i for i in range(n)],
            [i * h ** max(i - 1, 0) for i in range(n)],
            [i * (i - 1) * h ** max(i - 2, 0) for i in range(n)],
        ]
        begin = np.diag([1.0, 1.0, 2.0])[:m, :m]
        lines = np.vstack([np.hstack([begin, np.zeros((m, n - m))]), ends[:m]])
        right = [x[piece] for x in values] + [x[piece + 1] for x in values]
        polynomial = np.linalg.solve(lines, np.array(right))
        mine = k == piece
        s = (t[mine] - times[piece])[:, None]
        found[mine] = sum(polynomial[i] * s**i for i in range(n))
    return found


# ---- a spline that overshoots between clear knots ------------------------------------


def wall(x_mm: float) -> str:
    return (
        "obstacles:\n  - {name: wall, shape: half_space, point: "
        f"[{x_mm!r}, 0, 0], normal: [-1, 0, 0]}}\n"
    )


BULGE = 4.0 / 27.0
"""The largest value of s (1 - s)^2, at s = 1/3."""


@pytest.mark.parametrize("off, verdict", [(0.1, "certified"), (-0.1, "refuted")])
def test_a_spline_that_overshoots_between_clear_knots(
    tmp_path: Path, off: float, verdict: str
) -> None:
    # x0(s) = 0.5 + 0.6 s (1 - s)^2 between two rows at 0.5 m.
    q, rates = np.zeros((2, 7)), np.zeros((2, 7))
    q[:, 0], rates[0, 0] = 0.5, 0.6
    motion, times = motion_of(q, np.array([1.0, 2.0]), rates), np.array([1.0, 2.0])
    peak = 1000.0 * (0.5 + 0.6 * BULGE)
    problem = problem_of(tmp_path, wall(peak + 900.0 + 40.0 + 5.0 + off))
    found = judged(problem, motion)
    check = row(found, "clearance from obstacles")
    assert check.verdict.value == verdict
    assert check.worst == pytest.approx(1e-3 * (5.0 + off), abs=2e-6)
    assert found.approaches[0].moment == pytest.approx(1.0 / 3.0, abs=0.02)
    if verdict == "refuted":
        s = np.linspace(0.0, 1.0, 2_000_001)
        near = s[0.6 * s * (1.0 - s) ** 2 > 0.6 * BULGE - 1e-4]
        assert check.first_moment == pytest.approx(float(near[0]), abs=1e-4)
        assert check.last_moment == pytest.approx(float(near[-1]), abs=1e-4)
    # Its chord stands still, 88.8 mm farther off.
    still = row(judged(problem, motion_of(q, times)), "clearance from obstacles")
    assert still.verdict is Verdict.CERTIFIED
    assert still.worst == pytest.approx(1e-3 * (5.0 + off) + 0.6 * BULGE, abs=2e-6)


# ---- limits over the curve -----------------------------------------------------------


def test_limits_hold_over_the_curve_and_not_at_its_knots_alone(tmp_path: Path) -> None:
    problem = problem_of(tmp_path)
    for k, name in ((1, "alpha in its box"), (2, "theta in its box")):
        q, rates = np.zeros((2, 7)), np.zeros((2, 7))
        q[:, k] = np.deg2rad(48.0)
        for over, verdict in ((1.9, Verdict.CERTIFIED), (2.1, Verdict.REFUTED)):
            rates[0, k] = np.deg2rad(over) / BULGE / 0.5
            motion = motion_of(q, np.array([3.0, 3.5]), rates)
            found = {c.name: c for c in check_limits(problem, motion)}
            assert found[name].verdict is verdict
            assert np.rad2deg(found[name].worst) == pytest.approx(48.0 + over, abs=0.01)
            assert found[name].moment == pytest.approx(1.0 / 3.0, abs=0.03)
    q, rates = np.zeros((2, 7)), np.zeros((2, 7))
    q[:, 0], rates[0, 0] = 0.95, 0.051 / BULGE
    rows = check_limits(problem, motion_of(q, np.arange(2.0), rates))
    found = {c.name: c for c in rows}
    assert found["base on its rail"].verdict is Verdict.REFUTED
    assert found["base on its rail"].worst == pytest.approx(1.001, abs=1e-4)


@pytest.mark.parametrize(
    ("tolerances", "verdict"),
    [(0.0, "certified"), (0.99, "certified"), (1.0, "undecided"), (1.02, "refuted")],
)
def test_a_peak_at_the_limit_is_held_against_the_tolerance(
    tolerances: float, verdict: str, tmp_path: Path
) -> None:
    q, rates = np.zeros((2, 7)), np.zeros((2, 7))
    over = tolerances * TOLERANCES.joint_limit
    q[:, 1], rates[0, 1] = np.deg2rad(49.0) + over, np.deg2rad(1.0) / BULGE
    (box, *_) = check_limits(problem_of(tmp_path), motion_of(q, np.arange(2.0), rates))
    assert box.verdict.value == verdict


def test_the_change_from_row_to_row_is_that_of_the_curve(tmp_path: Path) -> None:
    problem = problem_of(tmp_path, "max_change_per_row_deg: 3\n")
    q, rates = np.zeros((2, 7)), np.zeros((2, 7))
    for over, verdict in ((2.9, Verdict.CERTIFIED), (3.1, Verdict.REFUTED)):
        rates[0, 4] = np.deg2rad(over) / BULGE
        found = check_limits(problem, motion_of(q, np.arange(2.0), rates))[-1]
        assert found.name == "change of a joint angle between waypoints"
        assert found.verdict is verdict
        assert np.rad2deg(found.worst) == pytest.approx(over, abs=0.02)
        assert found.where == "joint 2"


# ---- the tip's way and where it looks ------------------------------------------------


PATH = """tip_path:
  start: [900, 0, 0]
  points: [[900, 0, 0], [1000, 0, 0]]
  spacing: 20
  pointing: {direction: [1, 0, 0], cone_deg: 4}
"""


def drawing(bulge_deg: float) -> Trajectory:
    """The arm goes 100 mm along the rail, its first joint bulging in between."""
    q, rates = np.zeros((2, 7)), np.zeros((2, 7))
    q[1, 0], rates[:, 0] = 0.1, 0.1
    rates[0, 1] = np.deg2rad(bulge_deg) / BULGE
    both, along = np.ones(2) > 0, np.array([0.0, 0.1])
    x0, alpha, theta = q[:, 0], q[:, 1::2], q[:, 2::2]
    more = {"times": np.arange(2.0), "rates": rates}
    return Trajectory(both, along, x0, alpha, theta, **more)


def test_the_tip_is_held_to_the_path_along_the_curve(tmp_path: Path) -> None:
    problem = problem_of(tmp_path, PATH)
    for bulge, verdict in ((1.0, Verdict.CERTIFIED), (2.0, Verdict.UNDECIDED)):
        report = check_tip(problem, drawing(bulge))
        name = "tip near the desired path between the waypoints"
        found = next(check for check in report.checks if check.name == name)
        assert found.verdict is verdict
        # The tip swings out by 2 sin(bulge / 2) of the arm's length of 900 mm.
        sway = 2.0 * 0.9 * np.sin(np.deg2rad(bulge) / 2.0)
        assert sway - 1e-12 <= found.worst <= 1.05 * sway + 1e-3


def test_the_last_link_looks_along_the_curve(tmp_path: Path) -> None:
    problem = problem_of(tmp_path, PATH)
    for bulge, verdict in ((3.9, "certified"), (4.1, "refuted")):
        name = "last link's axis within its cone on the path"
        found = row(judged(problem, drawing(bulge)), name)
        assert found.verdict.value == verdict
        assert np.rad2deg(found.worst) == pytest.approx(bulge, abs=0.1)
        assert found.moment == pytest.approx(1.0 / 3.0, abs=0.05)


# ---- random curves against samples ---------------------------------------------------


def compare(seed: int, tmp_path: Path) -> Verdict:
    """A random curve past a ball that may move, against samples in closed form."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(2, 6))
    times = np.cumsum(rng.uniform(0.2, 1.5, n))
    q, rates = rng.uniform(-0.6, 0.6, (n, 7)), rng.normal(0.0, 1.0, (n, 7))
    changes = rng.normal(0.0, 3.0, (n, 7)) if rng.random() < 0.5 else None
    motion = motion_of(q, times, rates, changes)
    centre, radius = rng.normal([600.0, 0.0, 0.0], 600.0), float(rng.uniform(20, 200))
    to = centre + rng.normal(0.0, 300.0, 3) * rng.integers(0, 2)
    knots = np.sort(rng.uniform(0.0, times[-1] + 1.0, 2)) + 0.01 * np.arange(2)
    text = f"""obstacles:
  - {{name: ball, shape: sphere, center: [0, 0, 0], radius: {radius!r}, motion:
      {{times_s: {knots.tolist()}, positions: [{centre.tolist()}, {to.tolist()}]}}}}
"""
    found = judged(problem_of(tmp_path, text), motion)
    t = np.unique(np.concatenate([np.linspace(times[0], times[-1], 6001), times]))
    joints = curve(motion, t)
    ends = zip(centre, to, strict=True)
    place = 1e-3 * np.stack([np.interp(t, knots, [a, b]) for a, b in ends], axis=1)
    gaps = ball_gaps(joints, place) - radius * 1e-3
    check = row(found, "clearance from obstacles")
    assert check.verdict is not Verdict.UNDECIDED
    least = min(one.lower for one in found.approaches if one.pair.obstacle)
    assert least <= max(float(gaps.min()), -0.04) + 1e-9
    if check.verdict is Verdict.CERTIFIED:
        assert check.worst == pytest.approx(float(gaps.min()), abs=2e-4)
    else:
        assert gaps.min() < 0.005 + 2e-4
    coal = next(c for c in found.checks if "distances by Coal" in c.name)
    assert coal.verdict is Verdict.CERTIFIED
    box = {c.name: c for c in found.checks}
    sampled = np.abs(joints[:, 1::2]).max()
    if box["alpha in its box"].verdict is Verdict.CERTIFIED:
        assert sampled <= box["alpha in its box"].worst + 1e-12
    else:
        assert sampled > np.deg2rad(50.0) - 1e-3
    psi = np.arccos(np.cos(joints[:, 1::2]) * np.cos(joints[:, 2::2])).max()
    if box["link angle psi in its cone"].verdict is Verdict.CERTIFIED:
        assert psi <= box["link angle psi in its cone"].worst + 1e-7
    return check.verdict


def ball_gaps(joints: FloatArray, place: FloatArray) -> FloatArray:
    """Distance of a moving point from three links of 300 mm, radius 40, (n,); [m]."""
    n = len(joints)
    frame, gaps = np.tile(np.eye(3), (n, 1, 1)), np.full(n, np.inf)
    start = np.column_stack([joints[:, 0], np.zeros((n, 2))])
    for link in range(3):
        a, b = joints[:, 1 + 2 * link], joints[:, 2 + 2 * link]
        yaw, pitch = np.tile(np.eye(3), (2, n, 1, 1))
        yaw[:, 0, 0] = yaw[:, 1, 1] = np.cos(a)
        yaw[:, 1, 0], yaw[:, 0, 1] = np.sin(a), -np.sin(a)
        pitch[:, 0, 0] = pitch[:, 2, 2] = np.cos(b)
        pitch[:, 0, 2], pitch[:, 2, 0] = np.sin(b), -np.sin(b)
        frame = frame @ yaw @ pitch
        way = 0.3 * frame[:, :, 0]
        share = ((place - start) * way).sum(axis=1) / 0.09
        near = start + share.clip(0.0, 1.0)[:, None] * way
        gaps = np.minimum(gaps, np.linalg.norm(place - near, axis=1) - 0.04)
        start = start + way
    return gaps


@pytest.mark.parametrize("seed", range(10))
def test_random_curves_never_contradict_samples(seed: int, tmp_path: Path) -> None:
    compare(seed, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 400))
def test_many_random_curves_never_contradict_samples(seed: int, tmp_path: Path) -> None:
    compare(seed, tmp_path)


# ---- the same curve, cut -------------------------------------------------------------


@pytest.mark.parametrize("quintic", [False, True])
def test_parts_of_a_curve_are_the_curve(quintic: bool) -> None:
    rng = np.random.default_rng(3)
    q, rates, more = rng.normal(0.0, 0.3, (3, 4, 7))
    times = np.cumsum(rng.uniform(0.3, 2.0, 4))
    motion = motion_of(q, times, rates, more if quintic else None)
    t = np.linspace(times[0], times[-1], 400)
    exact = curve(motion, t)
    moments = np.interp(t, times, np.arange(4.0))
    np.testing.assert_allclose(motion.path.at_moments(moments), exact, atol=1e-12)
    np.testing.assert_allclose(curve(motion.refined(5), t), exact, atol=1e-12)
