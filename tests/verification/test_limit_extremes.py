"""Limits over random motions; oracle: thousands of moments of each."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from flint import arb_mat

from vdsm_pin.arm.kinematics import link_angles
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.certificate_checker.rows import Rows
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification import extremes, limits
from vdsm_pin.verification.limits import check_limits
from vdsm_pin.verification.records import Check, Verdict

BOX, CONE, RAIL, STEP = 0.3, 0.38, 0.2, 0.35
ARM = replace(
    built_in("hrm8"), max_joint_angle=BOX, max_link_angle=CONE, base_range=(-RAIL, RAIL)
)
TIP = np.array([ARM.total_length, 0.0, 0.0])
PROBLEM = PlanningProblem(
    ARM, Scene(), DesiredPath(TIP, TIP[None]), 0.0, name="p", max_row_change=STEP
)


def random_motion(
    rng: np.random.Generator, degree: int, most: float = 1.1
) -> Trajectory:
    n, links = int(rng.integers(1, 9)), ARM.n_links
    size = rng.uniform(most - 0.8, most)
    angles, x0 = size * BOX * rng.uniform(-1, 1, (2, n, links)), rng.uniform(-1, 1, n)
    more = {}
    if degree > 1:
        more["times"] = np.cumsum(rng.uniform(0.5, 2.0, n))
        more["rates"] = 0.2 * rng.normal(size=(n, 1 + 2 * links))
    if degree > 3:
        more["changes"] = 0.1 * rng.normal(size=(n, 1 + 2 * links))
    off = np.zeros(n)
    return Trajectory(off.astype(bool), off, size * RAIL * x0, *angles, **more)


def dense(motion: Trajectory, per_row: int = 400) -> tuple[np.ndarray, np.ndarray]:
    last = motion.n_samples - 1
    moments = np.linspace(0.0, last, last * per_row + 1)
    return moments, np.asarray(motion.path.at_moments(moments))


def assert_judged(
    row: Check, value: np.ndarray, limit: float, tolerance: float, exact: bool
) -> None:
    """A row about a value over moments, shape (n_moments, n); its joint and moment."""
    most = float(value.max())
    if most > limit + tolerance:
        assert row.verdict is Verdict.REFUTED
        assert row.worst == pytest.approx(most, rel=0.02, abs=1e-9)
    elif exact or most < limit - 2e-3:
        assert row.verdict is Verdict.CERTIFIED
        assert most - 1e-12 <= row.worst <= most + (1e-12 if exact else 2e-3)


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_links_that_turn_past_a_right_angle_leave_their_cone(degree: int) -> None:
    """Psi falls again there: 0 where alpha and theta are 180 deg, as at these rows."""
    rng, left = np.random.default_rng(degree), 0
    for _ in range(30):
        motion = random_motion(rng, degree)
        turned = rng.choice([0.0, np.pi, -np.pi], (2, motion.n_samples, 1, 1))
        alpha, theta = turned[:, :, 0] + 0.1 * np.stack([motion.alpha, motion.theta])
        motion = replace(motion, alpha=alpha, theta=theta)
        psi = link_angles(*(dense(motion)[1][:, k::2] for k in (1, 2)))
        if psi.max() > CONE + 2e-3:
            left += 1
            assert check_limits(PROBLEM, motion)[2].verdict is Verdict.REFUTED
    assert left > 10


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_a_broken_limit_is_told_at_its_worst_of_all_parts(
    degree: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Oracle: the motion at the ends of all parts of all pieces."""
    monkeypatch.setattr(extremes, "CHUNK", 96)
    monkeypatch.setattr(limits, "CHUNK", 96)
    rng, parts, seen = np.random.default_rng(10 + degree), limits.PARTS, 0
    for _ in range(60):
        motion = random_motion(rng, degree, 1.2)
        moments, joints = dense(motion, parts)
        angles = np.abs(joints[:, 1::2]), np.abs(joints[:, 2::2])
        psi = link_angles(joints[:, 1::2], joints[:, 2::2])
        rows = check_limits(PROBLEM, motion)
        for row, value in zip(rows[:3], (*angles, psi), strict=True):
            if row.verdict is Verdict.REFUTED:
                at, joint = np.unravel_index(value.argmax(), value.shape)
                assert row.worst == pytest.approx(value.max(), abs=1e-9)
                assert (row.where[-1], row.moment) == (f"{joint + 1}", moments[at])
                seen += 1
        if rows[3].verdict is Verdict.REFUTED:
            away = np.abs(joints[:, 0])
            assert rows[3].moment == moments[away.argmax()]
            assert abs(rows[3].worst) == pytest.approx(away.max(), abs=1e-9)
        if len(rows) == 5 and rows[4].verdict is Verdict.REFUTED:
            each = [np.ptp(joints[parts * k : parts * (k + 1) + 1, 1:], axis=0)
                    for k in range(motion.n_samples - 1)]  # fmt: skip
            k, column = np.unravel_index(np.argmax(each), np.shape(each))
            assert rows[4].worst == pytest.approx(np.max(each), abs=1e-9)
            named = f"joint {column // 2 + 1}", k
            assert (rows[4].where, rows[4].moment) == named
    assert seen > 30


@pytest.mark.parametrize("degree", [1, 3, 5])
def test_every_limit_is_judged_by_what_the_motion_does(
    degree: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(extremes, "CHUNK", 96)  # three intervals at once
    monkeypatch.setattr(limits, "CHUNK", 96)
    rng, exact = np.random.default_rng(degree), degree == 1
    verdicts: set[tuple[str, Verdict]] = set()
    for _ in range(60):
        motion = random_motion(rng, degree)
        moments, joints = dense(motion)
        alpha, theta = np.abs(joints[:, 1::2]), np.abs(joints[:, 2::2])
        psi = link_angles(joints[:, 1::2], joints[:, 2::2])
        rows = check_limits(PROBLEM, motion)
        assert len(rows) == (5 if motion.n_samples > 1 else 4)
        for row, value, limit in zip(rows, (alpha, theta, psi), (BOX, BOX, CONE)):  # noqa: B905
            assert_judged(row, value, limit, TOLERANCES.joint_limit, exact)
            assert (row.limit, row.count) == (limit, motion.alpha.size)
            if exact:
                at, joint = np.unravel_index(value.argmax(), value.shape)
                name = (
                    row.name.split()[-4] if "psi" in row.name else row.name.split()[0]
                )
                assert (row.where, row.moment) == (f"{name}{joint + 1}", moments[at])
        x0 = joints[:, 0]
        assert_judged_rail(rows[3], x0, exact)
        if motion.n_samples > 1:
            parts = joints[:-1, 1:].reshape(
                motion.n_samples - 1, -1, joints.shape[1] - 1
            )
            ends = joints[400::400, None, 1:]
            change = np.ptp(np.concatenate([parts, ends], axis=1), axis=1)
            assert_judged(rows[4], change, STEP, TOLERANCES.joint_limit, exact)
            k, column = np.unravel_index(change.argmax(), change.shape)
            if exact:
                named = f"joint {column // 2 + 1}"
                assert (rows[4].where, rows[4].moment) == (named, k)
        verdicts |= {(row.name, row.verdict) for row in rows}
    assert len({key for key in verdicts if key[1] is not Verdict.UNDECIDED}) >= 9


def assert_judged_rail(row: Check, x0: np.ndarray, exact: bool) -> None:
    below, above = -RAIL - x0.min(), x0.max() - RAIL
    most = max(below, above)
    if most > TOLERANCES.base_limit:
        assert row.verdict is Verdict.REFUTED
    elif exact or most < -2e-3:
        assert row.verdict is Verdict.CERTIFIED
    if exact or abs(below - above) > 0.01:
        at, limit = (x0.min(), -RAIL) if below > above else (x0.max(), RAIL)
        assert (row.worst, row.limit) == (pytest.approx(at, abs=2e-3), limit)


@pytest.mark.parametrize("seed", range(40))
def test_the_checker_accepts_what_is_certified_on_a_limit(seed: int) -> None:
    """Joints within a few units in the last place of the most that is allowed."""
    rng, slack = np.random.default_rng(seed), TOLERANCES.joint_limit
    joints = np.zeros((2, 1 + 2 * ARM.n_links))
    joint, sign = 2 * int(rng.integers(ARM.n_links)), float(rng.choice([-1.0, 1.0]))
    yaw = float(rng.uniform(0.25, BOX))
    pitch = np.arccos(np.cos(CONE + slack) / np.cos(yaw))
    cases = [
        (1 + joint, sign * (BOX + slack), 0.0),
        (1 + joint, yaw, sign * pitch),
        (0, sign * (RAIL + TOLERANCES.base_limit), 0.0),
        (1 + joint, sign * yaw, sign * (yaw - STEP - slack)),
    ]
    for k, (column, most, other) in enumerate(cases):
        rows = joints.copy()
        value = most + int(rng.integers(-3, 4)) * np.spacing(most)
        if k == 3:
            rows[0, column], rows[1, column] = value, other
        elif k == 1:
            rows[:, column : column + 2] = value, other
        else:
            rows[:, column] = value
        motion = Trajectory.of_joints(rows)
        found = [row.verdict for row in check_limits(PROBLEM, motion)]
        if all(verdict is Verdict.CERTIFIED for verdict in found):
            points = [arb_mat([row]) for row in rows.tolist()]
            interval: Any = SimpleNamespace(controls=points, degree=1)
            asked: Any = SimpleNamespace(problem=PROBLEM, lengths=[1.0])
            Rows(asked, motion)._limits(interval)
