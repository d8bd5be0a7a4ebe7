"""What links carry, the feed behind the base, errors of single things, end to end."""

import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from oracles.certificate_cases import certificate_lines, write_cube
from oracles.certificate_oracle import sealed, sha256

from vdsm_pin.api import write_report
from vdsm_pin.arm.kinematics import joint_centres, link_frames
from vdsm_pin.certificate_checker import check_certificate
from vdsm_pin.certificate_writer.certificate import write_certificate
from vdsm_pin.certificate_writer.lines import Hashes
from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import rotation_from_rpy
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.reason import reason
from vdsm_pin.verification.coal_check import COAL
from vdsm_pin.verification.judgement import _station
from vdsm_pin.verification.records import (
    ClosestApproach,
    Pair,
    Verdict,
    Verification,
)
from vdsm_pin.verification.verify import verify

ARM = {
    "link_lengths": [0.5, 0.4, 0.4],
    "link_radius": 0.03,
    "max_link_angle_deg": 60,
    "max_joint_angle_deg": 60,
}
CAMERA = {
    "name": "camera", "link": 3, "shape": "box",
    "center": [0.35, 0.05, 0.0], "size": [0.06, 0.06, 0.04],
}  # fmt: skip
BALL = {"name": "post", "shape": "sphere", "center": [1.25, 0.14, 0.0], "radius": 0.05}


def problem_in(folder: Path, arm: Any, obstacles: Any, **more: Any) -> Path:
    path = folder / "p.yaml"
    data = {
        "vdsm_problem": 1,
        "length_unit": "m",
        "manipulator": ARM | arm,
        "obstacles": obstacles,
        "required_clearance": 0.005,
    }
    path.write_text(yaml.safe_dump(json.loads(json.dumps(data | more))))
    return path


def motion_in(folder: Path, joints: Any) -> Path:
    """Rows of x0, alpha1, theta1, .."""
    rows, path = np.array(joints, float), folder / "rows.csv"
    blank = np.zeros(len(rows))
    motion = Trajectory(blank > 0, blank, rows[:, 0], rows[:, 1::2], rows[:, 2::2])
    write_trajectory(motion, path)
    return path


def judged(problem: Path, rows: Path) -> tuple[PlanningProblem, Verification]:
    file = read_problem(problem)
    arm = file.manipulator
    motion = read_trajectory(rows, arm)
    return file, verify(file, motion)


def certified(problem: Path, rows: Path) -> Path:
    """The certificate of a motion, which must be certified."""
    file, found = judged(problem, rows)
    assert found.verdict is Verdict.CERTIFIED, found.checks
    path = problem.parent / "c.certificate"
    hashes = Hashes(file.sha256, sha256(rows.read_bytes()))
    write_certificate(path, found, hashes)
    return path


STILL = np.zeros((2, 7))
"""A motion along the rail; the camera's face is 5 mm and 10 um off the post's track."""


def sliding(much: float = 0.1) -> Any:
    rows = STILL.copy()
    rows[:, 0] = -much, much
    return rows


def test_a_camera_too_large_by_a_tenth_of_a_millimetre_is_refuted(
    tmp_path: Path,
) -> None:
    rows = motion_in(tmp_path, sliding())
    post = BALL | {"center": [1.25, 0.08 + 0.05 + 0.005 + 1e-5, 0.0]}
    problem = problem_in(tmp_path, {"bodies": [CAMERA]}, [post])
    assert judged(problem, rows)[1].verdict is Verdict.CERTIFIED
    larger = CAMERA | {"size": [0.06, 0.06 + 2e-4, 0.04]}
    problem = problem_in(tmp_path, {"bodies": [larger]}, [post])
    _, found = judged(problem, rows)
    assert found.verdict is Verdict.REFUTED
    near = found.approaches[0]
    assert (near.pair.own, near.pair.obstacle) == ("camera", "post")
    assert near.upper < 0.005
    # It touches where it passes: the face 0.32 to 0.38 m along link 3.
    np.testing.assert_allclose(near.link_point[1], 0.0801, atol=1e-6)
    assert abs(near.link_point[0] - 1.25) < 1e-3
    assert near.coal == pytest.approx(near.upper, abs=1e-5)


def test_coal_measures_every_approach_of_all_that_the_arm_has(tmp_path: Path) -> None:
    """Links, tool, body and feed, to what stands, what moves and to one another."""
    moving = BALL | {"name": "door", "center": [0, 0, 0]}
    moving["motion"] = {"times_s": [0, 2], "positions": [[1.6, 0, 0], [1.5, 0, 0.1]]}
    post = BALL | {"center": [1.45, 0.14, 0.0]}
    rack = BALL | {"name": "rack", "center": [-0.3, 0.15, 0.0]}
    feed, tool = {"length": 0.3, "radius": 0.04}, {"length": 0.1, "radius": 0.01}
    arm = {"bodies": [CAMERA], "feed": feed, "tool": tool}
    rng, seen = np.random.default_rng(2), set()
    for obstacles in 3 * [[post, rack, moving], []]:
        problem = read_problem(problem_in(tmp_path, arm, obstacles))
        q, none = rng.uniform(-1.5, 1.5, (3, 7)) * [0.03, *6 * [1]], np.zeros(3)
        motion = Trajectory(
            none > 0, none, q[:, 0], q[:, 1::2], q[:, 2::2], times=[0, 1, 2]
        )
        found = verify(problem, motion)
        for near in found.approaches:
            pair = near.pair
            seen.add((pair.body, pair.obstacle or f"own {pair.other_body}".strip()))
            assert near.lower - 1e-5 <= near.coal <= near.upper + 1e-5, near
    for body in ("", "tool", "camera"):
        assert {(body, "post"), (body, "door")} <= seen
    assert {("", "rack"), ("feed", "rack"), ("", "own")} <= seen


def test_a_tool_prolongs_the_last_link_alone(tmp_path: Path) -> None:
    problem = problem_in(tmp_path, {"tool": {"length": 0.1, "radius": 0.01}}, [])
    lengths = read_problem(problem).manipulator.link_lengths
    np.testing.assert_allclose(lengths, [0.5, 0.4, 0.5], rtol=1e-15)


def test_a_body_beside_a_joint_is_held_off_the_link_before_it(tmp_path: Path) -> None:
    """Links that meet at a joint are no pair; what one carries there is."""
    clip = CAMERA | {"center": [0.03, 0.1, 0.0], "size": [0.02, 0.02, 0.02]}
    rows = motion_in(tmp_path, sliding())
    problem = problem_in(tmp_path, {"bodies": [clip]}, [])
    path = certified(problem, rows)
    outcome = check_certificate(path, problem, rows)
    assert outcome.accepted, outcome.reason
    pairs = certificate_lines(path)[0]["pairs"]
    assert ["camera", "link 2"] in pairs
    assert ["link 3", "link 2"] not in pairs


def test_forged_certificates_are_rejected(tmp_path: Path) -> None:
    rows = motion_in(tmp_path, sliding())
    feed = {"length": 0.3, "radius": 0.04}
    arm = {"bodies": [CAMERA], "feed": feed}
    problem = problem_in(tmp_path, arm, [BALL])
    path = certified(problem, rows)
    outcome = check_certificate(path, problem, rows)
    assert outcome.accepted, outcome.reason
    lines = certificate_lines(path)[:-1]
    pairs = lines[0]["pairs"]
    assert ["camera", "post"] in pairs
    assert ["feed", "post"] in pairs
    assert ["camera", "link 2"] in pairs
    assert ["camera", "link 3"] not in pairs
    number = pairs.index(["camera", "post"])
    wrong = json.loads(json.dumps(lines))
    wrong[0]["pairs"][number][0] = "link 3"
    assert (
        rejected(path, wrong, problem, rows)
        == "header: the pairs are not those of the problem"
    )
    wrong = json.loads(json.dumps(lines))
    for line in wrong[1:]:
        del line["proofs"][number]
    del wrong[0]["pairs"][number]
    assert "pairs" in rejected(path, wrong, problem, rows)
    thicker = BALL | {"radius": 0.0501}
    for change, obstacles, named in (
        ({"bodies": [CAMERA | {"size": [0.06, 0.0601, 0.04]}]}, [BALL], "camera"),
        ({"bodies": [CAMERA | {"link": 2}]}, [BALL], "pairs"),
        ({"feed": feed | {"radius": 0.0401}}, [BALL], "feed"),
        ({}, [thicker], "post"),
        ({"ignore_pairs": [["camera", "post"]]}, [BALL], "pairs"),
    ):
        other = problem_in(tmp_path, arm | change, obstacles)
        wrong = json.loads(json.dumps(lines))
        wrong[0]["problem_sha256"] = read_problem(other).sha256
        assert named in rejected(path, wrong, other, rows)


def rejected(path: Path, lines: Any, problem: Path, rows: Path) -> str:
    path.write_bytes(sealed(lines))
    outcome = check_certificate(path, problem, rows)
    assert not outcome.accepted
    return outcome.reason


def test_the_feed_hits_what_is_behind_the_base(tmp_path: Path) -> None:
    behind = {"name": "rack", "shape": "sphere", "center": [-0.4, 0, 0], "radius": 0.05}
    rows = motion_in(tmp_path, sliding())
    problem = problem_in(tmp_path, {}, [behind])
    _, found = judged(problem, rows)
    assert found.verdict is Verdict.CERTIFIED
    problem = problem_in(tmp_path, {"feed": {"length": 0.3}}, [behind])
    _, found = judged(problem, rows)
    assert found.verdict is Verdict.REFUTED
    assert found.approaches[0].pair.own == "feed"
    # It moves with x0: at 0.1 m it is clear again.
    rows = motion_in(tmp_path, sliding() * [[0.0], [1.0]] + 0.0)
    problem = problem_in(tmp_path, {"feed": {"length": 0.3}}, [behind])
    assert judged(problem, rows)[1].verdict is Verdict.CERTIFIED


def test_a_witness_is_told_along_its_link_or_back_from_the_first_joint(
    tmp_path: Path,
) -> None:
    """On the axis and beside it, past either end and between, at any moment."""
    rng = np.random.default_rng(4)
    joints = rng.uniform(-0.5, 0.5, (3, 7))
    file = problem_in(tmp_path, {"feed": {"length": 0.3}}, [BALL])
    problem = read_problem(file)
    rows = read_trajectory(motion_in(tmp_path, joints), problem.manipulator)
    for share in (0.0, 0.25, 1.0):
        q = joints[1] + share * (joints[2] - joints[1])
        centres = joint_centres(
            problem.manipulator, q[:1], q[None, 1::2], q[None, 2::2]
        )
        ends = [centres[0, 0] - [0.3, 0.0, 0.0], *centres[0]]
        for link, (begin, end) in enumerate(pairwise(ends)):
            length = float(np.linalg.norm(end - begin))
            for along in (-0.1, 0.0, 0.1, 0.99 * length, length + 0.2):
                axis = (end - begin) / length
                beside = np.cross(axis, [0.0, 0.0, 1.0])
                point = begin + along * axis + 0.07 * beside
                pair = Pair(link, "post", body="" if link else "feed")
                near = ClosestApproach(1, share, pair, 0.1, 0.2, 0.0, point, point)
                expected = np.clip(along, 0.0, length) - (0.0 if link else 0.3)
                assert _station(problem, rows, near) == pytest.approx(expected)


def test_pairs_are_left_out_by_name_and_unknown_names_refused(tmp_path: Path) -> None:
    inside = BALL | {"center": [1.25, 0.05, 0.0], "radius": 0.01}
    rows = motion_in(tmp_path, sliding(0.0))
    arm = {"bodies": [CAMERA], "ignore_pairs": [["camera", "post"]]}
    problem = problem_in(tmp_path, arm, [inside])
    found = judged(problem, rows)[1]
    assert found.verdict is Verdict.CERTIFIED
    left_out = "from every obstacle (the problem leaves out 'camera and post'), "
    assert left_out in reason(found)
    accepted = check_certificate(certified(problem, rows), problem, rows)
    assert accepted.accepted
    assert "camera and post left out" in accepted.notes
    for pair, words in (
        (["camera", "pots"], "'pots'"),
        (["post", "post"], "not a body"),
        (["camera", "camera"], "not a body"),
    ):
        problem = problem_in(tmp_path, arm | {"ignore_pairs": [pair]}, [inside])
        with pytest.raises(InvalidFile, match="ignore_pairs") as error:
            read_problem(problem)
        assert words in str(error.value)


def test_an_arm_that_is_held_apart_from_nothing_is_told_so(tmp_path: Path) -> None:
    """It stands in the obstacle, which is there; two links are no pair either."""
    pairs = [["link 1", "post"], ["link 2", "post"]]
    arm = {"link_lengths": [0.5, 0.4], "ignore_pairs": pairs}
    rows = motion_in(tmp_path, np.zeros((1, 5)))
    problem = problem_in(tmp_path, arm, [BALL | {"center": [0.5, 0.0, 0.0]}])
    _, found = judged(problem, rows)
    assert found.verdict is Verdict.CERTIFIED
    assert "no obstacle is held apart (the problem leaves out" in reason(found)
    write_report(found, tmp_path / "report.html")
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "no obstacle is held apart" in page
    assert "there is no obstacle" not in page


def test_bad_bodies_are_refused_with_their_place(tmp_path: Path) -> None:
    for change, words in (
        ({"link": 4}, r"bodies\[0\].link"),
        ({"shape": "half_space"}, "expected one of"),
        ({"name": "feed"}, r"bodies\[0\].name"),
        ({"name": "link 2"}, r"bodies\[0\].name"),
        ({"name": "post"}, "obstacles"),
        ({"parts": 2}, "not a known key"),
    ):
        problem = problem_in(tmp_path, {"bodies": [CAMERA | change]}, [BALL])
        with pytest.raises(InvalidFile, match=words):
            read_problem(problem)


def test_errors_of_the_file_are_asked_for(tmp_path: Path) -> None:
    """A turn of the base moves the tip by its distance; the checker asks for it too."""
    rows = motion_in(tmp_path, sliding())
    problem = problem_in(tmp_path, {"bodies": [CAMERA]}, [BALL])
    path = certified(problem, rows)
    lines = certificate_lines(path)[:-1]
    for errors, good in (
        ({"base_deg": 0.05, "joint_deg": [0.01, 0.0, 0.02], "base": 1e-4}, True),
        ({"obstacles": [{"name": "post", "shift": 1e-3, "turn_deg": 1.0}]}, True),
        ({"base_deg": 0.5}, False),
        ({"joint_deg": [0.5, 0.0, 0.0]}, False),
        ({"obstacles": [{"name": "post", "shift": 0.006}]}, False),
        ({"obstacles": [{"name": "post", "turn_deg": 8.0}]}, False),
    ):
        other = problem_in(tmp_path, {"bodies": [CAMERA]}, [BALL], errors=errors)
        _, found = judged(other, rows)
        assert (found.verdict is Verdict.CERTIFIED) == good, errors
        wrong = json.loads(json.dumps(lines))
        wrong[0]["problem_sha256"] = read_problem(other).sha256
        assert "less than the problem asks" in rejected(path, wrong, other, rows)
        if good:
            mine = certified(other, rows)
            outcome = check_certificate(mine, other, rows)
            assert outcome.accepted, outcome.reason


@pytest.mark.parametrize(
    ("body", "x", "z"),
    [
        ("feed", -0.2, 0.045 + 0.07),
        ("link 1", 0.25, 0.06 + 0.07),
        ("link 2", 0.58, 0.05 + 0.07),
        ("camera", 0.7, 0.065 + 0.07),
        ("link 3", 0.98, 0.04 + 0.07),
        ("tool", 1.1, np.sqrt((0.2 + 0.07) ** 2 - 0.15**2)),  # nearest its start
    ],
)
def test_checker_knows_how_thick_each_body_is(
    body: str, x: float, z: float, tmp_path: Path
) -> None:
    """A ball 20.2 mm off it, then 20 mm; 20.1 mm are asked for and claimed."""
    rows = motion_in(tmp_path, STILL)
    camera = CAMERA | {"link": 2, "center": [0.2, 0, 0], "size": [0.06, 0.05, 0.13]}
    arm = {"link_radius": [0.06, 0.05, 0.04], "feed": {"length": 0.3, "radius": 0.045}}
    arm |= {"bodies": [camera], "tool": {"length": 0.1, "radius": 0.2}}
    arm |= {"link_lengths": [0.5, 0.4, 0.35], "ignore_pairs": [["camera", "link 3"]]}

    def asked(more: float) -> Path:
        post = [BALL | {"center": [x, 0.0, float(z) + more]}]
        return problem_in(tmp_path, arm, post, required_clearance=0.0201)

    problem = asked(3e-4)
    path = certified(problem, rows)
    # All claims a little lower: the ball's way decides of the pair near it alone.
    lines = certificate_lines(path)[:-1]
    least = round(0.0201e10) + 1
    for line in lines[1:]:
        for plane in (p for pair in line["proofs"] for *_, ps in pair for p in ps):
            plane[-1] = max(least, int(plane[-1]) - round(3.5e-4 * 1e10))
    path.write_bytes(sealed(lines))
    outcome = check_certificate(path, problem, rows)
    assert outcome.accepted, outcome.reason
    problem = asked(0.0)
    lines[0]["problem_sha256"] = read_problem(problem).sha256
    assert f"{body} and post" in rejected(path, lines, problem, rows)


def test_joint_errors_of_the_file_are_asked_for_alone(tmp_path: Path) -> None:
    """One number for all joints; the certificate states none."""
    rows = motion_in(tmp_path, STILL)
    problem = problem_in(tmp_path, {}, [])
    path = certified(problem, rows)
    lines = certificate_lines(path)[:-1]
    asked = problem_in(tmp_path, {}, [], errors={"joint_deg": 0.01})
    lines[0]["problem_sha256"] = read_problem(asked).sha256
    assert "less than the problem asks" in rejected(path, lines, asked, rows)


# ---- many, against samples -----------------------------------------------------------


def random_body(rng: np.random.Generator, name: str, folder: Path) -> Any:
    """A solid near a link, and its distance function in the link's frame."""
    centre = np.array([rng.uniform(0.0, 0.4), *rng.uniform(-0.08, 0.08, 2)]).round(4)
    shape = rng.choice(["sphere", "capsule", "cylinder", "box", "prism", "mesh"])
    size, turn = rng.uniform(0.01, 0.05, 3).round(4), rng.uniform(-180, 180, 3).round(2)
    common = {"name": name, "link": int(rng.integers(1, 4)), "shape": str(shape)}
    at = {"center": centre.tolist()}
    rotation, half = rotation_from_rpy(np.deg2rad(turn)), size
    if shape == "sphere":
        return common | at | {"radius": float(size[0])}, ball(centre, size[0])
    if shape in ("capsule", "cylinder"):
        axis = rotation[:, 0].round(4)
        sizes = {"radius": float(size[0]), "length": float(2 * size[1])}
        axis_of = axis / np.linalg.norm(axis)
        rod = (centre, axis_of, size[1], size[0])
        found = capsule(*rod) if shape == "capsule" else cylinder(*rod)
        return common | at | {"axis": axis.tolist()} | sizes, found
    if shape == "box":
        more = {"size": (2 * size).tolist(), "rpy_deg": turn.tolist()}
        return common | at | more, cuboid(centre, rotation, half)
    if shape == "mesh":
        path = folder / f"{name}.stl"
        write_cube(path, 1.0)
        scale = float(size[0])
        more = {"file": path.name, "length_unit": "m", "scale": scale}
        more |= {"rpy_deg": turn.tolist(), "parts": int(rng.integers(1, 4))}
        return common | at | more, cuboid(centre, rotation, np.full(3, scale))
    (x, y, z), (a, b, c) = centre.tolist(), size.tolist()
    corners = [[x - a, y - b], [x + a, y - b], [x + a, y + b], [x - a, y + b]]
    prism = {"axis": "z", "polygon": corners, "from": z - c, "to": z + c}
    return common | prism, cuboid(centre, np.eye(3), half)


def ball(centre: Any, radius: float) -> Any:
    return lambda p: np.linalg.norm(p - centre, axis=1) - radius


def capsule(centre: Any, axis: Any, half: float, radius: float) -> Any:
    def found(p: Any) -> Any:
        along = np.clip((p - centre) @ axis, -half, half)
        return np.linalg.norm(p - centre - along[:, None] * axis, axis=1) - radius

    return found


def cylinder(centre: Any, axis: Any, half: float, radius: float) -> Any:
    def found(p: Any) -> Any:
        along = (p - centre) @ axis
        across = np.linalg.norm(p - centre - along[:, None] * axis, axis=1)
        out = np.column_stack([across - radius, np.abs(along) - half])
        return np.linalg.norm(out.clip(0.0), axis=1) + out.max(axis=1).clip(None, 0.0)

    return found


def cuboid(centre: Any, rotation: Any, half: Any) -> Any:
    def found(p: Any) -> Any:
        out = np.abs((p - centre) @ rotation) - half
        return np.linalg.norm(out.clip(0.0), axis=1) + out.max(axis=1).clip(None, 0.0)

    return found


def least_sampled(file: PlanningProblem, rows: Path, riders: Any, balls: Any) -> float:
    """The least distance of bodies, links and feed from balls over dense samples."""
    arm = file.manipulator
    q = read_trajectory(rows, arm).joints
    t = np.linspace(0.0, 1.0, 200)[:, None]
    dense = np.vstack([a + t * (b - a) for a, b in pairwise(q)])
    centres = joint_centres(arm, dense[:, 0], dense[:, 1::2], dense[:, 2::2])
    frames = link_frames(dense[:, 1::2], dense[:, 2::2])
    base = np.broadcast_to(np.eye(3), frames[:, :1].shape)
    frames = np.concatenate([base, frames], axis=1)
    least = np.inf
    for link, distance in riders:
        origin, frame = centres[:, max(0, link - 1)], frames[:, link]
        for centre, radius in balls:
            seen = np.einsum("nji,nj->ni", frame, centre - origin)
            least = min(least, float(distance(seen).min()) - radius)
    return least


def run_random(folder: Path, seed: int) -> tuple[bool, float]:
    """One random problem: whether certified, and its least sampled clearance.

    The checker accepts what is certified, and nothing else is written.
    """
    rng = np.random.default_rng(seed)
    made = [
        random_body(rng, f"body {k}", folder) for k in range(int(rng.integers(1, 4)))
    ]
    centres = rng.uniform([0.2, -0.4, -0.4], [1.5, 0.4, 0.4], (3, 3)).round(3)
    balls = [(c, float(r)) for c, r in zip(centres, [0.05, 0.08, 0.03], strict=True)]
    obstacles = [
        {"name": f"ball {k}", "shape": "sphere", "center": c.tolist(), "radius": r}
        for k, (c, r) in enumerate(balls)
    ]
    feed = {"length": 0.3, "radius": 0.02}
    known = [data["name"] for data, _ in made]
    apart = [[a, b] for i, a in enumerate(known) for b in known[i + 1 :]]
    links = [[a, f"link {k}"] for a in known for k in (1, 2, 3)]
    arm = {"bodies": [data for data, _ in made], "feed": feed}
    problem = problem_in(
        folder, arm | {"ignore_pairs": apart + links}, obstacles,
        required_clearance=float(rng.choice([0.0, 0.01])),
    )  # fmt: skip
    q = np.cumsum(rng.uniform(-0.15, 0.15, (4, 7)), axis=0)
    rows = motion_in(folder, q)
    file, found = judged(problem, rows)
    riders = [(data["link"], distance) for data, distance in made]
    axis, lengths = np.array([1.0, 0.0, 0.0]), ARM["link_lengths"]
    for k, length in enumerate(lengths, start=1):  # type: ignore[arg-type, var-annotated]
        riders.append((k, capsule(axis * length / 2, axis, length / 2, 0.03)))
    riders.append((0, capsule(-axis * 0.15, axis, 0.15, 0.02)))
    least = least_sampled(file, rows, riders, balls)
    good = [c.verdict for c in found.checks if c.name == "clearance from obstacles"]
    others = [c for c in found.checks if c.name != "clearance from obstacles"]
    assert all(c.verdict is Verdict.CERTIFIED for c in others if "Coal" in c.name)
    if found.verdict is Verdict.CERTIFIED:
        outcome = check_certificate(certified(problem, rows), problem, rows)
        assert outcome.accepted, outcome.reason
    required = file.required_clearance
    if good[0] is Verdict.CERTIFIED:
        assert least >= required - 1e-9
    if good[0] is Verdict.REFUTED and not any(d["shape"] == "mesh" for d, _ in made):
        assert least < required + 1e-4
    assert good[0] is not Verdict.UNDECIDED
    return found.verdict is Verdict.CERTIFIED, least


def test_random_bodies_are_judged_as_samples_say(tmp_path: Path) -> None:
    verdicts = set()
    for seed in range(4):
        (folder := tmp_path / str(seed)).mkdir()
        verdicts.add(run_random(folder, seed)[0])
    assert verdicts == {True, False}


@pytest.mark.slow
def test_random_bodies_by_the_hundred(tmp_path: Path) -> None:
    count = 0
    for seed in range(100, 400):
        (folder := tmp_path / str(seed)).mkdir()
        count += run_random(folder, seed)[0]
    assert 30 < count < 270


def test_an_obstacle_may_be_named_like_a_part_of_a_mesh(tmp_path: Path) -> None:
    post = BALL | {"name": "post part 2"}
    file = problem_in(tmp_path, {"bodies": [CAMERA]}, [post])
    problem = read_problem(file)
    motion = motion_in(tmp_path, np.zeros((2, 7)))
    found = verify(problem, read_trajectory(motion, problem.manipulator))
    names = {near.pair.obstacle for near in found.approaches}
    assert "post part 2" in names
    assert not [c for c in found.checks if c.where.startswith("not done")]


def test_a_pair_left_out_leaves_out_no_other_name(tmp_path: Path) -> None:
    """`post` is ignored; `post part 2`, another obstacle, is not."""
    near = BALL | {"center": [1.25, 0.09, 0.0]}  # it meets the camera
    both = [near, near | {"name": "post part 2"}]
    for names, verdict in (
        ([["camera", "post"]], Verdict.REFUTED),
        ([["camera", "post"], ["camera", "post part 2"]], Verdict.CERTIFIED),
    ):
        arm = {"bodies": [CAMERA], "ignore_pairs": names}
        file = problem_in(tmp_path, arm, both)
        problem, found = judged(file, motion_in(tmp_path, np.zeros((2, 7))))
        check = next(c for c in found.checks if c.name == "clearance from obstacles")
        assert check.verdict is verdict
        pairs = {(p.own, p.obstacle) for p in found.pairs}
        assert (("camera", "post part 2") in pairs) == (verdict is Verdict.REFUTED)
        assert problem.scene.names == ("post", "post part 2")


@pytest.mark.parametrize("name", ["camera", "camera part 2"])
def test_no_two_things_share_a_name_or_that_of_a_part(
    tmp_path: Path, name: str
) -> None:
    file = problem_in(tmp_path, {"bodies": [CAMERA]}, [BALL | {"name": name}])
    with pytest.raises(InvalidFile, match=r"obstacles\[0\].name.*a body of the arm"):
        read_problem(file)
    bodies = [CAMERA, CAMERA | {"name": name}]
    with pytest.raises(InvalidFile, match=r"body|called already"):
        read_problem(problem_in(tmp_path, {"bodies": bodies}, []))


def test_a_body_may_be_named_like_a_part_of_none(tmp_path: Path) -> None:
    lens = CAMERA | {"name": "lens part 1"}
    file = problem_in(tmp_path, {"bodies": [lens]}, [BALL])
    _, found = judged(file, motion_in(tmp_path, np.zeros((2, 7))))
    assert ("lens part 1", "post") in {(p.own, p.obstacle) for p in found.pairs}
    assert not [c for c in found.checks if c.where.startswith("not done")]


def test_coal_measures_each_part_of_a_carried_mesh(tmp_path: Path) -> None:
    """Two hulls, nearer than the triangles; oracle: Coal's own distance of each."""
    write_cube(tmp_path / "cube.stl", 0.09)
    mesh = {"name": "scanner", "link": 3, "shape": "mesh", "file": "cube.stl"}
    mesh |= {"parts": 2, "check_size": False}
    problem = problem_in(tmp_path, {"bodies": [mesh]}, [BALL | {"center": [1, 0.3, 0]}])
    _, found = judged(problem, motion_in(tmp_path, sliding()))
    parts = [one for one in found.approaches if one.pair.obstacle and one.pair.body]
    assert {one.pair.body for one in parts} == {"scanner part 1", "scanner part 2"}
    for one in parts:
        assert one.lower - 1e-5 <= one.coal <= one.upper + 1e-5
    row = next(row for row in found.checks if row.name == COAL)
    assert row.verdict is Verdict.CERTIFIED
