"""Obstacles that move: closed forms, dense sampling, and wrong motions refused."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from flint import arb, ctx

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.coal_arm import SPREAD, CoalArm
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict, Verification
from vdsm_pin.verification.verify import verify

HEAD = """
vdsm_problem: 1
name: moving
length_unit: mm
manipulator: {link_lengths: %s, link_radius: 40, max_link_angle_deg: 80,
              max_joint_angle_deg: 80, base_range: [-4000, 4000]}
base: {position: %s, rpy_deg: %s}
required_clearance: %g
obstacles:
"""


def problem_of(
    path: Path, obstacles: str, required: float = 5.0, **kwargs: object
) -> PlanningProblem:
    """A problem whose obstacles are these lines; lengths in mm."""
    lengths = kwargs.get("lengths", [300, 300, 300])
    base = kwargs.get("base", ([0, 0, 0], [0, 0, 0]))
    assert isinstance(base, tuple)
    path.write_text(HEAD % (lengths, *base, required) + obstacles, encoding="utf-8")
    return read_problem(path)


def motion_of(joints: FloatArray, times: FloatArray) -> Trajectory:
    none = np.zeros(len(joints))
    alpha, theta = joints[:, 1::2], joints[:, 2::2]
    return Trajectory(none > 0, none, joints[:, 0], alpha, theta, times=times)


def judged(problem: PlanningProblem, motion: Trajectory) -> Verification:
    return verify(problem, motion)


def clearance(found: Verification) -> tuple[Verdict, float, float]:
    row = next(c for c in found.checks if c.name == "clearance from obstacles")
    return row.verdict, row.worst, row.moment


# ---- many turns, from which little is left ----


@pytest.mark.parametrize(
    "first, last",
    [(999_999_999_983, 999_999_999_983), (-1e12 + 17, -1e12 + 40), (0, 1e9), (7, 1e12)],
)
@pytest.mark.parametrize("moment", [0.3, 0.7123])
def test_brackets_hold_the_clearance_of_what_turns_many_times(
    first: float, last: float, moment: float, tmp_path: Path
) -> None:
    """A ball on a lever about the middle of the arm; the truth by 300 bits."""
    obstacle = (
        "  - {name: ball, shape: sphere, center: [300, 100, 0], radius: 10, motion: "
        "{times_s: [0, 1], positions: [[450, 0, 0], [450, 0, 0]], "
        f"rpy_deg: [[0, 0, {first}], [0, 0, {last}]]}}}}\n"
    )
    problem = problem_of(tmp_path / "p.yaml", obstacle, required=0.0)
    times = np.array([moment, np.nextafter(moment, 1.0)])
    found = judged(problem, motion_of(STRAIGHT, times)).closest(1)[0]
    with ctx.workprec(300):
        truth = []
        for time in times.tolist():
            begin, end = arb(float(first)), arb(float(last))
            angle = (begin + (end - begin) * arb(time)) * arb.pi() / 180
            x = 450 + 300 * angle.cos() - 100 * angle.sin()
            y = 300 * angle.sin() + 100 * angle.cos()
            beyond = abs(x - 450) - 450  # of the axis, which is 900 mm long
            off = (y**2 + beyond.max(arb(0)) ** 2).sqrt() - 50
            truth.append(float(off / 1000))
    assert found.lower <= min(truth) <= found.upper


# ---- a ball that meets a capsule -----------------------------------------------------


def ball(start: str, end: str) -> str:
    return (
        "  - {name: ball, shape: sphere, center: [0, 0, 0], radius: 50, motion: "
        f"{{times_s: [1, 3], positions: [{start}, {end}]}}}}\n"
    )


STRAIGHT = np.zeros((2, 7))


def test_a_ball_meets_a_capsule_when_the_closed_form_says(tmp_path: Path) -> None:
    # It comes down on the middle of link 2 at 100 mm/s: 90 mm off the axis they touch.
    problem = problem_of(
        tmp_path / "p.yaml", ball("[450, 0, 200]", "[450, 0, 0]"), required=0.0
    )
    found = judged(problem, motion_of(STRAIGHT, np.array([0.0, 4.0])))
    assert found.verdict is Verdict.REFUTED
    row = next(c for c in found.checks if c.name == "clearance from obstacles")
    assert row.first_moment == pytest.approx((1.0 + 1.1) / 4.0, abs=2e-6)
    assert "ball" in row.where
    assert f"({1.0 + 1.1:.3f} s)" in row.where


@pytest.mark.parametrize("off, verdict", [(0.1, "certified"), (-0.1, "refuted")])
def test_a_tenth_of_a_millimetre_decides(
    tmp_path: Path, off: float, verdict: str
) -> None:
    low = 40.0 + 50.0 + 5.0 + off
    problem = problem_of(
        tmp_path / "p.yaml", ball(f"[450, -900, {low}]", f"[450, 900, {low}]")
    )
    found = judged(problem, motion_of(STRAIGHT, np.array([0.0, 4.0])))
    value, worst, _ = clearance(found)
    assert value.value == verdict
    assert worst == pytest.approx(1e-3 * (5.0 + off), abs=2e-6)
    # At its witness: half-way, at 2 s of 4.
    assert found.approaches[0].moment == pytest.approx(0.5, abs=1e-2)
    assert found.approaches[0].upper == pytest.approx(1e-3 * (5.0 + off), abs=2e-6)


def test_what_happens_between_the_rows_is_told_in_the_trajectorys_rows(
    tmp_path: Path,
) -> None:
    knots = "times_s: [0, 1, 2, 3, 9], positions: "
    knots += "[[450, 0, 900], [450, 0, 300], [450, 0, 100], [450, 0, 900], [9, 9, 900]]"
    lines = "  - {name: ball, shape: sphere, center: [0, 0, 0], radius: 50, motion: "
    problem = problem_of(tmp_path / "p.yaml", f"{lines}{{{knots}}}}}\n")
    found = judged(problem, motion_of(np.zeros((3, 7)), np.array([0.0, 1.5, 10.0])))
    assert found.approaches[0].moment == pytest.approx(1.0 + 0.5 / 8.5, abs=1e-9)
    assert found.approaches[0].upper == pytest.approx(0.010, abs=1e-6)
    assert found.profile.first_interval.tolist() == [0, 1]
    assert found.profile.obstacle_lower.min() == pytest.approx(0.010, abs=1e-6)


# ---- a door --------------------------------------------------------------------------


def door(begin: float, end: float) -> str:
    """A leaf of 800 by 40 mm about the z axis at (1500, -400), shut across the rail."""
    return (
        "  - {name: door, shape: box, center: [0, 400, 0], size: [40, 800, 900], "
        f"motion: {{times_s: [{begin!r}, {end!r}], positions: [[1500, -400, 0], "
        "[1500, -400, 0]], rpy_deg: [[0, 0, 0], [0, 0, -90]]}}\n"
    )


def test_a_door_that_opens_in_time_and_one_too_late(tmp_path: Path) -> None:
    # The arm goes at 500 mm/s through the doorway; its tip is there at 1.2 s.
    joints = np.zeros((2, 7))
    joints[1, 0] = 1.5
    motion = motion_of(joints, np.array([0.0, 3.0]))
    good = judged(problem_of(tmp_path / "a.yaml", door(0.0, 1.0)), motion)
    assert clearance(good)[0] is Verdict.CERTIFIED
    late = judged(problem_of(tmp_path / "b.yaml", door(1.2, 2.2)), motion)
    row = next(c for c in late.checks if c.name == "clearance from obstacles")
    assert row.verdict is Verdict.REFUTED
    assert "door" in row.where
    # The tip's cap is at 5 mm from the shut leaf at x = 1475, when it still stands.
    assert row.first_moment == pytest.approx((1.475 - 0.94) / 0.5 / 3.0, abs=1e-3)


def sliding_door(early_mm: float) -> str:
    """A leaf that shuts behind the arm at 100 mm/s, so much farther than it may."""
    begin, end = 1000.0 - early_mm, -early_mm
    return (
        "  - {name: door, shape: box, center: [700, 500, 0], size: [20, 800, 900], "
        f"motion: {{times_s: [0, 10], positions: [[0, {begin!r}, 0], [0, {end!r}, 0]]"
        "}}\n"
    )


@pytest.mark.parametrize("early, verdict", [(-0.1, "certified"), (0.1, "refuted")])
def test_a_door_a_tenth_of_a_millimetre_too_early(
    tmp_path: Path, early: float, verdict: str
) -> None:
    # The edge of the leaf stands at y = 100 + 1000 - 100 t - early. The arm goes back
    # at 100 mm/s along x; its tip's cap (x = 900 + 40 at 0 s) leaves the leaf's plane.
    # The nearest moment is in closed form: two lines of one speed.
    joints = np.zeros((2, 7))
    joints[0, 0], joints[1, 0] = 0.45, -0.55
    motion = motion_of(joints, np.array([0.0, 10.0]))
    times = np.linspace(0.0, 10.0, 2_000_001)
    tip, edge = 1350.0 - 100.0 * times, 1100.0 - 100.0 * times
    across = np.maximum(np.maximum(690.0 - tip, 0.0), 0.0)
    gaps = np.hypot(across, edge) - 40.0
    least = float(gaps.min())
    problem = problem_of(tmp_path / "p.yaml", sliding_door(early), required=least)
    found = judged(problem, motion)
    value, worst, _ = clearance(found)
    assert value.value == verdict
    off = np.hypot(across, edge - early) - 40.0
    assert 1e3 * worst == pytest.approx(float(off.min()), abs=2e-3)
    nearest = found.approaches[0]
    assert 10.0 * nearest.moment == pytest.approx(float(times[off.argmin()]), abs=0.02)
    if verdict == "refuted":
        row = next(c for c in found.checks if c.name == "clearance from obstacles")
        begin = float(times[np.flatnonzero(off < least)[0]])
        assert 10.0 * row.first_moment == pytest.approx(begin, abs=1e-3)


# ---- random problems against dense sampling ------------------------------------------


def turn(rpy: FloatArray) -> FloatArray:
    """R = Rz Ry Rx by hand, shape (n, 3, 3)."""
    r, p, y = rpy.T
    zero, one = np.zeros_like(r), np.ones_like(r)
    rows = [
        [
            [np.cos(y), -np.sin(y), zero],
            [np.sin(y), np.cos(y), zero],
            [zero, zero, one],
        ],
        [
            [np.cos(p), zero, np.sin(p)],
            [zero, one, zero],
            [-np.sin(p), zero, np.cos(p)],
        ],
        [
            [one, zero, zero],
            [zero, np.cos(r), -np.sin(r)],
            [zero, np.sin(r), np.cos(r)],
        ],
    ]
    z, yy, x = (np.moveaxis(np.array(m), 2, 0) for m in rows)
    return np.asarray(z @ yy @ x)


def centres(joints: FloatArray, lengths: FloatArray) -> FloatArray:
    """Joint centres by the chain of rotations, shape (n, N + 1, 3)."""
    n = len(joints)
    frame = np.tile(np.eye(3), (n, 1, 1))
    points = [np.column_stack([joints[:, 0], np.zeros(n), np.zeros(n)])]
    for k, length in enumerate(lengths):
        alpha, theta = joints[:, 1 + 2 * k], joints[:, 2 + 2 * k]
        zero = np.zeros(n)
        frame = frame @ turn(np.column_stack([zero, zero, alpha]))
        frame = frame @ turn(np.column_stack([zero, theta, zero]))
        points.append(points[-1] + length * frame[:, :, 0])
    return np.stack(points, axis=1)


@dataclass
class Case:
    """A random problem, and what it is made of, in metres."""

    text: str
    kind: str
    size: FloatArray
    centre: FloatArray
    knots: FloatArray
    times: FloatArray
    base: tuple[FloatArray, FloatArray]


def random_case(rng: np.random.Generator) -> Case:
    kind = str(rng.choice(["sphere", "box", "half_space", "capsule"]))
    count = int(rng.integers(1, 6))
    times = np.sort(rng.uniform(-1.0, 5.0, count)).round(3) + 0.01 * np.arange(count)
    places = rng.normal([600.0, 0.0, 0.0], 700.0, (count, 3))
    turns = rng.uniform(-200.0, 200.0, (count, 3)) * rng.integers(0, 2)
    base = rng.normal(0.0, 300.0, 3), rng.uniform(-180.0, 180.0, 3)
    centre, size = rng.normal(0.0, 100.0, 3), rng.uniform(20.0, 300.0, 3)
    if kind == "half_space":
        places[:, 2] -= 2500.0
        shape = f"point: {centre.tolist()}, normal: [0, 0, 1]"
        turns *= 0.1
    elif kind == "box":
        shape = f"center: {centre.tolist()}, size: {size.tolist()}"
    elif kind == "capsule":
        shape = (
            f"center: {centre.tolist()}, axis: z, length: {float(size[0])!r}, "
            f"radius: {float(size[1])!r}"
        )
    else:
        shape = f"center: {centre.tolist()}, radius: {float(size[0])!r}"
    text = (
        f"  - {{name: thing, shape: {kind}, {shape}, motion: {{times_s: "
        f"{times.tolist()}, positions: {places.tolist()}, rpy_deg: {turns.tolist()}}}}}"
    )
    knots = np.hstack([places * 1e-3, np.deg2rad(turns)])
    return Case(text, kind, size * 1e-3, centre * 1e-3, knots, times, base)


def distances(case: Case, points: FloatArray, t: FloatArray) -> FloatArray:
    """Of points (n, m, 3) of the base's frame at times (n,) from the solid, (n, m)."""
    place, rpy = case.base
    world = points @ turn(np.deg2rad(rpy)[None])[0].T + place * 1e-3
    pose = np.stack([np.interp(t, case.times, x) for x in case.knots.T], axis=1)
    local = np.einsum("nmi,nij->nmj", world - pose[:, None, :3], turn(pose[:, 3:]))
    local = local - case.centre
    if case.kind == "half_space":
        return np.asarray(local[..., 2])
    if case.kind == "sphere":
        return np.asarray(np.linalg.norm(local, axis=2) - case.size[0])
    if case.kind == "capsule":
        high = case.size[0] / 2.0
        local[..., 2] -= local[..., 2].clip(-high, high)
        return np.asarray(np.linalg.norm(local, axis=2) - case.size[1])
    out = np.maximum(np.abs(local) - case.size / 2.0, 0.0)
    return np.asarray(np.linalg.norm(out, axis=2))


def compare(seed: int, tmp_path: Path) -> Verdict:
    """Judge one random problem and hold it against dense sampling."""
    rng = np.random.default_rng(seed)
    case, lengths = random_case(rng), rng.uniform(150.0, 400.0, 3).round(1)
    text = case.text + "\n"
    base = case.base[0].tolist(), case.base[1].tolist()
    problem = problem_of(tmp_path / "p.yaml", text, lengths=lengths.tolist(), base=base)
    rows = int(rng.integers(1, 5))
    joints = rng.uniform(-0.7, 0.7, (rows, 7))
    times = np.sort(rng.uniform(0.0, 4.0, rows)) + 0.05 * np.arange(rows)
    found = judged(problem, motion_of(joints, times))
    t = np.concatenate([np.linspace(times[0], times[-1], 4001), case.times, times])
    t = t[(t >= times[0]) & (t <= times[-1])]
    q = np.stack([np.interp(t, times, x) for x in joints.T], axis=1)
    ends = centres(q, lengths * 1e-3)
    share, least = np.linspace(0.0, 1.0, 61)[:, None], []
    for link in range(3):
        axis = (
            ends[:, link, None] + share * (ends[:, link + 1] - ends[:, link])[:, None]
        )
        gaps = distances(case, axis, t).min(axis=1) - 0.040
        index = next(k for k, p in enumerate(found.pairs) if p.link == link + 1)
        lower, upper = found.least.lower[index], found.least.upper[index]
        assert lower <= max(gaps.min(), -0.040) + 1e-9
        # Where it says that it is, it is: by the distance at the witness's moment.
        moment = found.least.interval[index] + found.least.share[index]
        when = np.interp(moment, np.arange(rows), times)
        now = np.stack([np.interp([when], times, x) for x in joints.T], axis=1)
        spine = centres(now, lengths * 1e-3)
        fine = np.linspace(0.0, 1.0, 4001)[:, None]
        line = spine[:, link, None] + fine * (spine[:, link + 1] - spine[:, link])
        exact = float(distances(case, line, np.array([when])).min()) - 0.040
        if upper > -0.039:
            assert exact - 2e-5 <= upper
        least.append((upper, exact, float(gaps.min())))
    upper, exact, sampled = min(least)
    if upper > -0.039:
        assert upper == pytest.approx(exact, abs=2e-5)
    if upper > 0.005:
        # Samples are 1 ms apart, on the axis 7 mm; of what is refuted any will do.
        assert upper == pytest.approx(sampled, abs=2e-3)
    value, worst, _ = clearance(found)
    assert value is not Verdict.UNDECIDED
    assert (value is Verdict.CERTIFIED) == bool(worst >= 0.005)
    coal = next(c for c in found.checks if "distances by Coal" in c.name)
    assert coal.verdict is Verdict.CERTIFIED, coal
    return value


@pytest.mark.parametrize("seed", range(12))
def test_random_problems_never_contradict_dense_sampling(
    seed: int, tmp_path: Path
) -> None:
    compare(seed, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 400))
def test_many_random_problems_never_contradict_dense_sampling(
    seed: int, tmp_path: Path
) -> None:
    compare(seed, tmp_path)


def test_a_motion_without_times_is_refused(tmp_path: Path) -> None:
    problem = problem_of(tmp_path / "p.yaml", ball("[0, 0, 900]", "[0, 0, 800]"))
    none = np.zeros(2)
    rows = Trajectory(none > 0, none, none, np.zeros((2, 3)), np.zeros((2, 3)))
    with pytest.raises(InvalidInput, match=r"time_s.*'ball' moves"):
        verify(problem, rows)


@pytest.mark.parametrize("n", [1, 7, 100])
def test_coal_measures_what_moves_at_rows_all_over(n: int, tmp_path: Path) -> None:
    """From the first row to the last, of every link; a ball beside a straight arm."""
    still = "  - {name: post, shape: sphere, center: [0, 900, 0], radius: 50}\n"
    lines = ball("[450, 0, 900]", "[450, 300, 200]") + still
    problem = problem_of(tmp_path / "p.yaml", lines)
    joints = np.zeros((n, 7))
    joints[:, 0] = np.linspace(0.0, 0.4, n)
    times = np.linspace(1.0, 3.0, n)
    arm = CoalArm(problem)
    found = list(arm.spread(motion_of(joints, times)))
    rows = sorted({int(k * (n - 1) / (SPREAD - 1)) for k in range(SPREAD)})
    asked = [(row, link) for row in rows for link in range(3)]
    row = np.concatenate([one.moment for one in found]).astype(int)
    pair = np.concatenate([one.pair for one in found])
    assert [*zip(row, arm.pairs.one[pair], strict=True)] == asked
    assert {arm.pairs.named(k)[1] for k in pair} == {"ball"}
    share = (times[row] - 1.0) / 2.0
    centre = np.outer(1.0 - share, [0.45, 0.0, 0.9]) + np.outer(share, [0.45, 0.3, 0.2])
    begin = joints[row, 0] + 0.3 * arm.pairs.one[pair]
    along = np.clip(centre[:, 0], begin, begin + 0.3)
    off = np.hypot(np.hypot(centre[:, 1], centre[:, 2]), centre[:, 0] - along)
    distance = np.concatenate([one.distance for one in found])
    np.testing.assert_allclose(distance, off - 0.09, atol=1e-9)
    assert all((one.lower == -np.inf).all() for one in found)
    assert all((one.upper == np.inf).all() for one in found)


def test_beside_what_moves_rows_have_times_and_nothing_is_planned(
    tmp_path: Path,
) -> None:
    ball = (
        "  - {name: ball, shape: sphere, center: [0, 0, 0], radius: 10, "
        "motion: {times_s: [0, 1], positions: [[0, 900, 0], [0, 950, 0]]}}\n"
    )
    problem, rows = problem_of(tmp_path / "p.yaml", ball), np.zeros((2, 7))
    judged(problem, motion_of(rows, np.arange(2.0)))
    none = np.zeros(2)
    untimed = Trajectory(none > 0, none, none, rows[:, 1::2], rows[:, 2::2])
    with pytest.raises(InvalidInput, match="no column 'time_s', but obstacle 'ball'"):
        judged(problem, untimed)
    with pytest.raises(InvalidInput, match="obstacle 'ball' moves: no motion is plan"):
        link_clearance(problem)
