"""The proof over continuous time against dense sampling by closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Capsule, Cylinder, HalfSpace, Mesh, Sphere
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.budget import Budget
from vdsm_pin.report.facts import min_clearance
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.brackets import ClearanceChunk
from vdsm_pin.verification.clearance import ClearanceProof, prove_motion
from vdsm_pin.verification.inside import check_inside, located_at_start
from vdsm_pin.verification.records import Verdict
from vdsm_pin.verification.verify import verify
from vdsm_pin.verification.yes_or_no import is_certified

ARM = built_in("hrm8")
NOMINAL = ErrorBox()
SPHERE = Sphere("ball", np.array([2.0, 0.45, 0.1]), 0.2)


def problem_with(*obstacles: Obstacle, required: float = 0.0) -> PlanningProblem:
    point = np.array([3.126, 0.0, 0.0])
    path = DesiredPath(point, point[None])
    return PlanningProblem(ARM, Scene(obstacles), path, required, name="p")


def motion(seed: int, n_rows: int = 6, size: float = 0.12) -> Trajectory:
    rng = np.random.default_rng(seed)
    return trajectory(
        rng.uniform(-0.1, 0.1, n_rows),
        rng.uniform(-size, size, (n_rows, 8)),
        rng.uniform(-size, size, (n_rows, 8)),
    )


def trajectory(x0: FloatArray, alpha: FloatArray, theta: FloatArray) -> Trajectory:
    n = x0.size
    return Trajectory(np.zeros(n, bool), np.zeros(n), x0, alpha, theta)


def dense(rows: Trajectory, per_interval: int) -> Trajectory:
    at = np.linspace(0, rows.n_samples - 1, (rows.n_samples - 1) * per_interval + 1)

    def along(values: FloatArray) -> FloatArray:
        k = np.minimum(at.astype(int), rows.n_samples - 2)
        t = (at - k).reshape(-1, *[1] * (values.ndim - 1))
        return values[k] + t * (values[k + 1] - values[k])

    return trajectory(along(rows.x0), along(rows.alpha), along(rows.theta))


def to_point(rows: Trajectory, point: FloatArray) -> FloatArray:
    """Distance of a point from every link's axis, shape (n_samples, 8); [m]."""
    centres = joint_centres(ARM, rows.x0, rows.alpha, rows.theta)
    start, link = centres[:, :-1], np.diff(centres, axis=1)
    t = ((point - start) * link).sum(axis=2) / (link**2).sum(axis=2)
    foot = start + np.clip(t, 0.0, 1.0)[..., None] * link
    return np.asarray(np.linalg.norm(point - foot, axis=2))


def prove(
    problem: PlanningProblem, rows: Trajectory, errors: ErrorBox = NOMINAL
) -> tuple[ClearanceProof, list[ClearanceChunk]]:
    chunks: list[ClearanceChunk] = []
    motion = AskedMotion.of_arm(problem, rows, errors)
    return prove_motion(motion, Budget(), [chunks.append]), chunks


@pytest.mark.parametrize("seed", range(4))
def test_brackets_hold_a_dense_estimate(seed: int) -> None:
    problem, rows = problem_with(SPHERE), motion(seed)
    proof, (chunk,) = prove(problem, rows)
    sampled = to_point(dense(rows, 1000), SPHERE.centre) - 0.2 - ARM.link_radius
    least = np.array([sampled[k * 1000 : k * 1000 + 1001].min(0) for k in range(5)])
    assert (chunk.lower[:, :8] <= least + 1e-11).all()
    apart = sampled.min() > 0.0
    if apart:
        # A thousandth of an interval away from the least place nothing rises by 10 um.
        assert (chunk.upper[:, :8] >= least - 1e-5).all()
        assert proof.least.upper[:8].min() >= least.min() - 1e-7
        assert proof.least.lower[:8].min() >= least.min() - 2e-6
    assert (proof.counts.sum(axis=1) == 5).all()
    for name in ("lower", "upper", "share", "link_point", "other_point"):
        assert np.isfinite(getattr(proof.least, name)).all()


def test_the_least_bracket_is_narrow_and_its_witness_real() -> None:
    problem, rows = problem_with(SPHERE, required=0.001), motion(11, size=0.03)
    proof, _ = prove(problem, rows)
    least, k = proof.least, int(np.argmin(proof.least.upper[:8]))
    upper, own, other = least.upper[k], least.link_point[k], least.other_point[k]
    assert 0.0 <= upper - least.lower[:8].min() <= 2e-6
    assert np.linalg.norm(own - other) == pytest.approx(upper, abs=1e-8)
    assert np.linalg.norm(other - SPHERE.centre) == pytest.approx(0.2, abs=1e-8)


def test_a_waypoint_pushed_in_by_a_tenth_of_a_millimetre_is_refuted_there() -> None:
    n = 21
    x0 = np.zeros(n)
    still = trajectory(x0, np.zeros((n, 8)), np.zeros((n, 8)))
    wall = HalfSpace("wall", np.array([3.2, 0, 0]), np.array([-1.0, 0, 0]))
    gap = 3.2 - 3.126 - ARM.link_radius
    problem = problem_with(wall, required=gap - 5e-5)
    proof, _ = prove(problem, still)
    assert proof.counts[:, 0].sum() == proof.counts.sum()
    x0[13] = 1e-4
    proof, (chunk,) = prove(problem, trajectory(x0, still.alpha, still.theta))
    assert sorted(np.unique(np.nonzero(chunk.verdict == 1)[0])) == [12, 13]
    assert proof.counts[7, 1] == 2
    assert proof.least.upper[7] == pytest.approx(gap - 1e-4, abs=1e-9)


def test_a_corner_cut_between_clear_rows_is_refuted_between_them() -> None:
    """The tip swings past a thin pin: both rows are clear, the middle is not."""
    alpha = np.zeros((2, 8))
    alpha[:, 0] = [-0.2, 0.2]
    rows = trajectory(np.zeros(2), alpha, np.zeros((2, 8)))
    pin = Capsule("pin", np.array([2.5, 0, 0]), np.array([0, 0, 1.0]), 1.0, 0.001)
    problem = problem_with(pin)
    for k in range(2):
        ends = trajectory(rows.x0[[k]], rows.alpha[[k]], rows.theta[[k]])
        assert is_certified(problem, ends, NOMINAL)
    proof, (chunk,) = prove(problem, rows)
    pair = 5  # link 6 lies over x = 2.43 to 2.636
    assert chunk.verdict[0, pair] == 1
    assert 0.3 < chunk.share[0, pair] < 0.7
    assert proof.least.upper[pair] < 0.0


def test_refining_a_motion_never_worsens_the_verdict() -> None:
    for seed in range(6):
        rows = motion(seed + 20, n_rows=4)
        sampled = to_point(dense(rows, 400), SPHERE.centre).min() - 0.2 - 0.0615
        problem = problem_with(SPHERE, required=max(0.0, sampled - 1e-4))
        coarse, _ = prove(problem, rows)
        fine, _ = prove(problem, dense(rows, 7))
        if not coarse.counts[:, 1:].any():
            assert not fine.counts[:, 1:].any()


def test_a_larger_obstacle_never_raises_a_lower_bound_past_an_upper_one() -> None:
    rows = motion(3)
    small, _ = prove(problem_with(SPHERE), rows)
    large, _ = prove(problem_with(replace(SPHERE, radius=0.22)), rows)
    assert (large.least.lower[:8] <= small.least.upper[:8] - 0.02 + 1e-9).all()


def test_turning_everything_about_the_rail_changes_nothing() -> None:
    """About the rail the base frame may turn by 90 deg: y, z become z, -y."""
    bar = Cylinder(
        "bar", np.array([1.5, 0.5, 0.3]), np.array([0.6, 0.0, 0.8]), 0.4, 0.1
    )
    n = 5
    one = np.linspace(-0.2, 0.2, n)
    yaw = np.zeros((n, 8))
    yaw[:, 2] = one
    flat = trajectory(np.zeros(n), yaw, np.zeros((n, 8)))
    tilted = trajectory(np.zeros(n), np.zeros((n, 8)), -yaw)
    turn = np.array([[1.0, 0, 0], [0, 0, -1.0], [0, 1.0, 0]])
    turned = replace(bar, centre=turn @ bar.centre, axis=turn @ bar.axis)
    before, _ = prove(problem_with(bar), flat)
    after, _ = prove(problem_with(turned), tilted)
    assert before.least.upper[:8].min() == pytest.approx(
        after.least.upper[:8].min(), abs=2e-6
    )
    assert before.least.lower[:8].min() == pytest.approx(
        after.least.lower[:8].min(), abs=2e-6
    )


def test_the_error_box_covers_perturbed_motions() -> None:
    rng = np.random.default_rng(7)
    errors = ErrorBox(joint=0.004, base=0.003, obstacle=0.002)
    rows, problem = motion(5, size=0.05), problem_with(SPHERE)
    robust, (chunk,) = prove(problem, rows, errors)
    nominal, _ = prove(problem, rows)
    assert (robust.least.lower < nominal.least.upper).all()
    fine = dense(rows, 50)
    for _ in range(40):
        sign = rng.choice([-1.0, 1.0], (2, 8))
        off = trajectory(
            fine.x0 + errors.base * rng.choice([-1.0, 1.0]),
            fine.alpha + errors.joint * sign[0],
            fine.theta + errors.joint * sign[1],
        )
        found = to_point(off, SPHERE.centre) - 0.2 - errors.obstacle - 0.0615
        least = np.array([found[k * 50 : k * 50 + 51].min(0) for k in range(5)])
        assert (chunk.lower[:, :8] <= least).all()


def test_culled_pairs_are_bounded_too() -> None:
    rng = np.random.default_rng(8)
    balls = [
        Sphere(f"b{k}", np.append(rng.uniform(0, 3), 0.5 + rng.uniform(0, 3, 2)), 0.1)
        for k in range(40)
    ]
    rows = motion(9, n_rows=70, size=0.05)
    proof, (chunk,) = prove(problem_with(*balls), rows)
    fine = dense(rows, 20)
    for k, ball in enumerate(balls):
        found = to_point(fine, ball.centre) - 0.1 - 0.0615
        least = np.array([found[i * 20 : i * 20 + 21].min(0) for i in range(69)])
        pairs = slice(8 * k, 8 * k + 8)
        assert (chunk.lower[:, pairs] <= least + 1e-11).all()
        assert (chunk.upper[:, pairs] >= least - 1e-4).all()
    for name in ("lower", "upper", "share", "link_point", "other_point"):
        assert np.isfinite(getattr(proof.least, name)).all()
    assert np.isfinite(proof.profile.obstacle_upper).all()


def test_one_row_is_an_interval_without_motion() -> None:
    proof, (chunk,) = prove(problem_with(SPHERE), motion(1, n_rows=1, size=0.01))
    assert chunk.lower.shape == (1, 8 + 21)
    assert (chunk.upper - chunk.lower)[0, :8] == pytest.approx(0.0, abs=1e-8)
    assert proof.counts[:, 0].sum() == 29


def cube(half: float, centre: FloatArray) -> Mesh:
    corners = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    faces = [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]  # fmt: skip
    return Mesh("cube", centre + half * corners, np.array(faces))


def test_an_arm_inside_a_closed_mesh_is_refuted() -> None:
    """The proof speaks of the surface, the row beside it of the inside."""
    still = trajectory(np.zeros(1), np.zeros((1, 8)), np.zeros((1, 8)))
    for half, verdict in ((5.0, Verdict.REFUTED), (0.2, Verdict.CERTIFIED)):
        centre = np.array([0.0, 0.0, 0.0 if half > 1.0 else 1.0])
        problem = problem_with(cube(half, centre))
        proof, _ = prove(problem, still)
        assert proof.counts[:, 0].sum() == proof.counts.sum()
        motion = AskedMotion.of_arm(problem, still, NOMINAL)
        (check,) = check_inside(motion.asked, located_at_start(motion))
        assert check.verdict is verdict


def test_a_mesh_said_to_be_a_surface_is_judged_as_one_and_the_row_says_so() -> None:
    still = trajectory(np.zeros(1), np.zeros((1, 8)), np.zeros((1, 8)))
    mesh = replace(cube(5.0, np.zeros(3)), solid=False)
    problem = problem_with(mesh)
    motion = AskedMotion.of_arm(problem, still, NOMINAL)
    assert check_inside(motion.asked, located_at_start(motion)) == ()
    rows = {row.name: row for row in verify(problem, still).checks}
    clearance = rows["clearance from obstacles"]
    assert clearance.verdict is Verdict.CERTIFIED
    assert "'cube' as a surface only" in clearance.where


def test_the_least_clearance_under_errors_is_that_of_every_pair() -> None:
    """Twelve posts by link 1, and one that the tip alone comes near where joints err.

    Oracle: the plane arm with all yaws off by their errors, by its own sums.
    """
    posts = [
        Sphere(f"{k}", np.array([0.2 + 0.02 * k, 0.3, 0.0]), 0.05) for k in range(12)
    ]
    far, error = Sphere("far", np.array([3.1, 0.345, 0.0]), 0.05), np.deg2rad(0.5)
    problem = replace(problem_with(*posts, far, required=0.01), tip_path=None)
    none = np.zeros((2, 8))
    rows = trajectory(np.array([0.0, 1e-3]), none, none)
    result = verify(problem.under(ErrorBox(joint=error)), rows)
    turned = error * np.arange(1.0, 9.0)
    tip = np.array([np.cos(turned), np.sin(turned)]) @ ARM.link_lengths
    met = np.linalg.norm(tip - far.centre[:2]) - far.radius - ARM.link_radius
    assert result.verdict is Verdict.CERTIFIED
    assert 0.1 < result.min_clearance <= met < 0.13
    told = [near.lower for near in result.approaches if near.pair.obstacle == "far"]
    assert told == [result.min_clearance]
    assert len(result.approaches) == 10
    told_of = min_clearance(result)
    assert told_of and (told_of.link, told_of.obstacle) == (8, "far")
    assert told_of.lower_m == result.min_clearance
