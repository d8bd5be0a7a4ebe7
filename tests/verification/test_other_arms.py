"""A second arm: held off like any obstacle, wherever its own trajectory puts it."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io import others
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.records import Verdict, Verification
from vdsm_pin.verification.verify import verify

ARM = (
    "{link_lengths: %s, link_radius: %g, max_link_angle_deg: 80, "
    "max_joint_angle_deg: 80, base_range: [-4000, 4000]%s}"
)
TEXT = """vdsm_problem: 1
name: %s
length_unit: mm
manipulator: %s
base: %s
required_clearance: 5
others:
  - {name: mate, manipulator: %s, base: %s, trajectory: %s}
"""


def random_motion(rng: np.random.Generator, n_links: int) -> Trajectory:
    n = int(rng.integers(1, 5))
    q = rng.uniform(-0.6, 0.6, (n, 1 + 2 * n_links))
    times, none = np.cumsum(rng.uniform(0.1, 1.5, n)), np.zeros(n)
    rates = rng.normal(0.0, 0.6, q.shape) if rng.random() < 0.5 else None
    return Trajectory(
        none > 0,
        none,
        q[:, 0],
        q[:, 1::2],
        q[:, 2::2],
        times=times,
        rates=rates,
    )


def write_pair(folder: Path, seed: int) -> tuple[Path, Path]:
    """Two problems: each arm with the other one beside it."""
    rng = np.random.default_rng(seed)
    arms, bases, files = [], [], []
    for k in range(2):
        count = int(rng.integers(2, 5))
        lengths = rng.uniform(200.0, 400.0, count).round(2).tolist()
        more = ", tool: {length: 120, radius: 15}" if rng.random() < 0.4 else ""
        if rng.random() < 0.4:
            more += (
                f", bodies: [{{name: box{k}, link: 1, shape: box, center: [90, 60, 0], "
                "size: [60, 40, 50]}]"
            )
        arms.append(ARM % (lengths, float(rng.uniform(20.0, 60.0)), more))
        place = rng.normal(0.0, 500.0, 3).tolist()
        rpy = rng.uniform(-180.0, 180.0, 3).tolist()
        bases.append(f"{{position: {place}, rpy_deg: {rpy}}}")
        files.append(f"t{k}.csv")
        write_trajectory(random_motion(rng, count), folder / files[k])
    for k in range(2):
        text = TEXT % (f"p{k}", arms[k], bases[k], arms[1 - k], bases[1 - k],
                       files[1 - k])  # fmt: skip
        (folder / f"p{k}.yaml").write_text(text, encoding="utf-8")
    return folder / "p0.yaml", folder / "p1.yaml"


def judged(problem: PlanningProblem, motion: Trajectory) -> Verification:
    return verify(problem, motion)


def centres(problem: PlanningProblem, motion: Trajectory, t: FloatArray) -> FloatArray:
    """Ends of all links in the file's frame, (n, N + 1, 3), by the chain of turns."""
    assert motion.times is not None
    t = t.clip(motion.times[0], motion.times[-1])
    if motion.n_samples == 1:
        q = np.repeat(motion.joints, len(t), axis=0)
    else:
        q = motion.path.at_moments(
            np.interp(t, motion.times, np.arange(motion.n_samples))
        )
    n, frame = len(t), np.tile(np.eye(3), (len(t), 1, 1))
    points = [np.column_stack([q[:, 0], np.zeros((n, 2))])]
    for link, length in enumerate(problem.manipulator.link_lengths):
        a, b = q[:, 1 + 2 * link], q[:, 2 + 2 * link]
        yaw, pitch = np.tile(np.eye(3), (2, n, 1, 1))
        yaw[:, 0, 0] = yaw[:, 1, 1] = np.cos(a)
        yaw[:, 1, 0], yaw[:, 0, 1] = np.sin(a), -np.sin(a)
        pitch[:, 0, 0] = pitch[:, 2, 2] = np.cos(b)
        pitch[:, 0, 2], pitch[:, 2, 0] = np.sin(b), -np.sin(b)
        frame = frame @ yaw @ pitch
        points.append(points[-1] + length * frame[:, :, 0])
    pose = problem.T_world_base
    return np.asarray(np.stack(points, axis=1) @ pose[:3, :3].T + pose[:3, 3])


def compare(seed: int, folder: Path) -> Verdict:
    """Judge one arm beside the other, sample both, and ask the other way round."""
    problems = [read_problem(path) for path in write_pair(folder, seed)]
    motions = [
        read_trajectory(folder / f"t{k}.csv", problems[k].manipulator) for k in range(2)
    ]
    found = judged(problems[0], motions[0])
    times = motions[0].times
    assert times is not None
    t = np.linspace(times[0], times[-1], 401)
    ends = [centres(p, m, t) for p, m in zip(problems, motions, strict=True)]
    share = np.linspace(0.0, 1.0, 15)[:, None, None]
    for k, pair in enumerate(found.pairs):
        if pair.body or not pair.obstacle or ": link" not in pair.obstacle:
            continue
        one, two = pair.link - 1, int(pair.obstacle.split(": link ")[1]) - 1
        arms = [p.manipulator for p in problems]
        if any(
            a.tool and i == a.n_links - 1 for a, i in zip(arms, (one, two), strict=True)
        ):
            continue  # that link ends where its tool begins
        lines = [
            e[:, i] + share * (e[:, i + 1] - e[:, i])
            for e, i in zip(ends, (one, two), strict=True)
        ]
        gaps = np.linalg.norm(lines[0][:, None] - lines[1][None], axis=3)
        radii = arms[0].radius_of(one), arms[1].radius_of(two)
        # A lower bound never lies above a sample.
        assert found.least.lower[k] <= float(gaps.min()) - sum(radii) + 1e-9
    row = next(c for c in found.checks if c.name == "clearance from obstacles")
    assert row.verdict in (Verdict.CERTIFIED, Verdict.REFUTED)
    coal = next(c for c in found.checks if "distances by Coal" in c.name)
    assert coal.verdict is Verdict.CERTIFIED
    return row.verdict


@pytest.mark.parametrize("seed", range(8))
def test_a_second_arm_never_contradicts_samples(seed: int, tmp_path: Path) -> None:
    compare(seed, tmp_path)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 300))
def test_many_second_arms_never_contradict_samples(seed: int, tmp_path: Path) -> None:
    compare(seed, tmp_path)


@pytest.mark.parametrize("seed", range(6))
def test_either_arm_is_as_far_from_the_other(seed: int, tmp_path: Path) -> None:
    """The same pair asked from both sides, over the same time."""
    paths = write_pair(tmp_path, seed)
    for k, path in enumerate(paths):
        arm = read_problem(path).manipulator
        motion = read_trajectory(tmp_path / f"t{k}.csv", arm)
        n = motion.n_samples
        if n == 1:  # a motion of two rows that stands still
            motion = motion.part(0, 1)
            rows = np.repeat(motion.joints, 2, axis=0)
            none, n = np.zeros(2), 2
            motion = Trajectory(
                none > 0, none, rows[:, 0], rows[:, 1::2], rows[:, 2::2],
                times=np.array([0.0, 1.0]),
            )  # fmt: skip
        same = np.linspace(0.0, 2.0, n)
        write_trajectory(
            Trajectory(
                motion.on_path, motion.path_m, motion.x0, motion.alpha, motion.theta,
                times=same, rates=motion.rates,
            ),
            tmp_path / f"t{k}.csv",
        )  # fmt: skip
    least = []
    for k, path in enumerate(paths):
        problem = read_problem(path)
        motion = read_trajectory(tmp_path / f"t{k}.csv", problem.manipulator)
        row = next(
            c
            for c in judged(problem, motion).checks
            if c.name == "clearance from obstacles"
        )
        least.append((row.verdict, row.worst))
    assert least[0][0] is least[1][0]
    if least[0][0] is Verdict.CERTIFIED:
        assert least[0][1] == pytest.approx(least[1][1], abs=3e-6)


def test_what_is_wrong_with_another_arm_is_named(tmp_path: Path) -> None:
    path, _ = write_pair(tmp_path, 1)
    text = path.read_text()
    none = tmp_path / "none.yaml"
    none.write_text(text.replace("t1.csv", "t9.csv"))
    with pytest.raises(InvalidFile, match=r"others\[0\].trajectory.*t9.csv"):
        read_problem(none)
    file = tmp_path / "t1.csv"
    rows = file.read_text()
    file.write_text(rows.replace("time_s", "time"))
    with pytest.raises(InvalidFile, match=r"others\[0\].trajectory.*time_s"):
        read_problem(path)
    file.write_text(rows)
    two = tmp_path / "two.yaml"
    two.write_text(text + text[text.index("  - {name: mate") :])
    with pytest.raises(InvalidFile, match=r"others.*two obstacles are named"):
        read_problem(two)
    both = tmp_path / "both.yaml"
    both.write_text(text.replace("name: mate, ", "name: mate, robot: {urdf: r.urdf}, "))
    with pytest.raises(InvalidFile, match="has both or none of manipulator and robot"):
        read_problem(both)
    bad = tmp_path / "bad.yaml"
    odd = "name: mate, manipulator: {link_radii: 3, "
    bad.write_text(text.replace("name: mate, manipulator: {", odd))
    with pytest.raises(InvalidFile, match=r"others\[0\].manipulator.link_radii"):
        read_problem(bad)
    missing = tmp_path / "missing.yaml"
    missing.write_text(text.replace("name: mate, ", ""))
    with pytest.raises(InvalidFile, match=r"others\[0\].name .*is missing"):
        read_problem(missing)


def test_what_is_judged_is_what_the_hash_is_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The file is another one as soon as it was read: neither sees that."""
    path, _ = write_pair(tmp_path, 2)
    whole, read = read_problem(path), others.read_trajectory_text

    def changed(file: Path, *more: Any, **how: Any) -> Trajectory:
        file.write_text("")
        return read(file, *more, **how)

    monkeypatch.setattr(others, "read_trajectory_text", changed)
    found = read_problem(path)
    assert (tmp_path / "t1.csv").read_text() == ""
    assert found.sha256 == whole.sha256
    assert len(found.scene.moving) == len(whole.scene.moving)


def test_its_files_belong_to_the_problem(tmp_path: Path) -> None:
    path, _ = write_pair(tmp_path, 2)
    before = read_problem(path)
    assert (tmp_path / "t1.csv") in before.source.files
    file = tmp_path / "t1.csv"
    file.write_text(file.read_text().replace("waypoint", '"waypoint"', 1))
    assert read_problem(path).sha256 != before.sha256
