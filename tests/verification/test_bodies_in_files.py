"""Cameras, feeds and errors stated in a problem file, proved and checked.

Oracles: problems whose answer is known, and Coal's distances at many instants.
"""

import copy
import gzip
import json
from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import coal
import numpy as np
import pytest
from oracles.certificate_cases import write_rows
from oracles.certificate_oracle import sealed, sha256

from vdsm_pin.arm.bodies import ArmBody, arm_bodies
from vdsm_pin.arm.kinematics import joint_centres, link_frames
from vdsm_pin.certificate_checker import Outcome, check_certificate
from vdsm_pin.certificate_writer.certificate import write_certificate
from vdsm_pin.certificate_writer.lines import Hashes
from vdsm_pin.cli import main
from vdsm_pin.errors import InvalidFile, InvalidInput
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.io.trajectory_file import read_trajectory
from vdsm_pin.problem.error_boxes import ErrorBox, ObstacleError
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.verification.clearance import prove_clearance
from vdsm_pin.verification.records import Verdict, Verification
from vdsm_pin.verification.verify import verify

LENGTHS = [400.0, 300.0, 300.0]
TOTAL = sum(LENGTHS)


def problem(*bodies: Any, **more: Any) -> dict[str, Any]:
    """A straight arm of three links, 1 m long, as a problem file has it; [mm]."""
    arm = {
        "link_lengths": LENGTHS,
        "link_radius": 30.0,
        "max_link_angle_deg": 60.0,
        "max_joint_angle_deg": 60.0,
        "bodies": list(bodies),
    }
    obstacles = more.pop("obstacles", [])
    errors = {"errors": more.pop("errors")} if "errors" in more else {}
    return {
        "vdsm_problem": 1,
        "name": "carrying",
        "length_unit": "mm",
        "manipulator": arm | more,
        "obstacles": obstacles,
        "required_clearance": 2.0,
        **errors,
    }


def camera(radius: float = 40.0, **more: Any) -> dict[str, Any]:
    place = {"name": "camera", "link": 3, "shape": "sphere", "center": [150.0, 0, 50.0]}
    return place | {"radius": radius} | more


def ball(name: str, center: list[float], radius: float = 50.0) -> dict[str, Any]:
    return {"name": name, "shape": "sphere", "center": center, "radius": radius}


class Files:
    """A problem and rows on disk, what the verifier says, and the certificate."""

    def __init__(self, folder: Path, data: Any, rows: FloatArray) -> None:
        self.data, self.problem = data, folder / "p.yaml"
        self.trajectory, self.certificate = folder / "t.csv", folder / "c"
        self.problem.write_text(json.dumps(data))
        write_rows(self.trajectory, rows)

    def verify(self, errors: ErrorBox | None = None) -> Verification:
        asked = read_problem(self.problem)
        rows = read_trajectory(self.trajectory, asked.manipulator)
        box = errors or ErrorBox()
        return verify(asked.under(box), rows)

    def check(self, found: Verification) -> Outcome:
        named = read_problem(self.problem).sha256, sha256(self.trajectory.read_bytes())
        write_certificate(self.certificate, found, Hashes(*named))
        return self.again()

    def again(self) -> Outcome:
        return check_certificate(self.certificate, self.problem, self.trajectory)

    def lines(self) -> list[Any]:
        lines = gzip.decompress(self.certificate.read_bytes()).splitlines()
        return [json.loads(line) for line in lines[:-1]]

    def forged(self, change: Any) -> Outcome:
        lines = copy.deepcopy(self.lines())
        change(lines)
        self.certificate.write_bytes(sealed(lines))
        return self.again()


STILL = np.zeros((1, 7))


def test_a_camera_a_tenth_too_large_is_refuted_at_the_camera(tmp_path: Path) -> None:
    above = ball("lamp", [850.0, 0.0, 50.0 + 40.0 + 2.0 + 50.0 + 0.05])
    good = Files(tmp_path, problem(camera(), obstacles=[above]), STILL)
    found = good.verify()
    assert found.verdict is Verdict.CERTIFIED
    outcome = good.check(found)
    assert outcome.accepted, outcome.reason
    wrong = Files(tmp_path, problem(camera(40.1), obstacles=[above]), STILL).verify()
    assert wrong.verdict is Verdict.REFUTED
    row = next(c for c in wrong.checks if c.name == "clearance from obstacles")
    assert row.verdict is Verdict.REFUTED
    assert "camera and lamp" in row.where
    assert wrong.approaches[0].pair.own == "camera"
    np.testing.assert_allclose(
        wrong.approaches[0].link_point, [0.85, 0, 0.0901], atol=1e-6
    )


def test_a_camera_meets_the_link_before_its_own(tmp_path: Path) -> None:
    """It reaches back over the joint: a pair of neighbours that is judged."""
    far = camera(20.0, center=[40.0, 0.0, 75.0])
    rows = np.zeros((2, 7))
    assert Files(tmp_path, problem(far), rows).verify().verdict is Verdict.CERTIFIED
    back = camera(20.0, center=[-40.0, 0.0, 60.0])
    for angle, verdict in ((-50.0, Verdict.REFUTED), (50.0, Verdict.CERTIFIED)):
        rows[:, 6] = np.deg2rad(angle)  # upwards, towards the link before, and down
        assert Files(tmp_path, problem(back), rows).verify().verdict is verdict
    near = camera(20.0, center=[-40.0, 0.0, 49.0])
    touching = Files(tmp_path, problem(near), np.zeros((1, 7))).verify()
    row = next(c for c in touching.checks if c.name == "clearance between links")
    assert row.verdict is Verdict.REFUTED
    assert "link 2 and camera" in row.where
    left = problem(near, ignore_pairs=[["camera", "link 2"]])
    assert Files(tmp_path, left, np.zeros((1, 7))).verify().verdict is Verdict.CERTIFIED


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"ignore_pairs": [["camera", "lamp"]]}, "lamp"),
        ({"ignore_pairs": [["camera", "camera"]]}, "camera"),
        ({"bodies": [camera(link=4)]}, "expected 1 to 3"),
        ({"bodies": [camera(), camera()]}, "names are unique"),
        ({"bodies": [camera(name="tool")]}, "tool"),
        ({"bodies": [camera(name="link 2")]}, "link 2"),
        ({"bodies": [camera(shape="half_space")]}, "expected one of"),
        ({"bodies": [{"name": "x", "shape": "sphere", "link": 1}]}, "center"),
        ({"feed": {"length": -1.0}}, "above 0"),
    ],
)
def test_bad_bodies_are_refused_by_field(
    change: Any, message: str, tmp_path: Path
) -> None:
    data = problem(camera())
    data["manipulator"] |= change
    (tmp_path / "p.yaml").write_text(json.dumps(data))
    with pytest.raises(InvalidFile, match=message):
        read_problem(tmp_path / "p.yaml")


def test_an_obstacle_may_not_be_called_like_a_body(tmp_path: Path) -> None:
    data = problem(camera(), obstacles=[ball("camera", [0.0, 900.0, 0.0])])
    (tmp_path / "p.yaml").write_text(json.dumps(data))
    with pytest.raises(InvalidFile, match="a body of the arm"):
        read_problem(tmp_path / "p.yaml")


def test_the_feed_is_proved_and_checked(tmp_path: Path) -> None:
    """A ball beside the rail, behind the base as the arm moves out."""
    rows = np.zeros((2, 7))
    rows[1, 0] = 0.4
    beside = ball("post", [-100.0, 0.0, 30.0 + 2.0 + 50.0 + 0.1])
    free = Files(tmp_path, problem(obstacles=[beside]), rows)
    assert free.verify().verdict is Verdict.CERTIFIED
    fed = Files(tmp_path, problem(obstacles=[beside], feed={"length": 600.0}), rows)
    found = fed.verify()
    assert found.verdict is Verdict.CERTIFIED
    outcome = fed.check(found)
    assert outcome.accepted, outcome.reason
    assert ["feed", "post"] in fed.lines()[0]["pairs"]
    thick = {"length": 600.0, "radius": 30.2}
    wrong = Files(tmp_path, problem(obstacles=[beside], feed=thick), rows).verify()
    assert wrong.verdict is Verdict.REFUTED
    near = wrong.approaches[0]
    assert near.pair.own == "feed"
    # The post stands at x = -100 mm, and O_1 at 400 mm times the moment.
    assert near.station == pytest.approx(-0.1 - 0.4 * near.moment, abs=1e-6)


@pytest.mark.parametrize("shift", [0.0, 1.0])
def test_a_feed_stands_in_every_file(tmp_path: Path, shift: float) -> None:
    """Nearest of all, and as the body of a counterexample."""
    beside = ball("post", [-100.0, 0.0, 30.0 + 2.0 + 50.0 + 0.1])
    asked = problem(obstacles=[beside], feed={"length": 600.0})
    made = Files(tmp_path, {**asked, "errors": {"base": shift}}, STILL)
    words = ["verify", str(made.problem), "--trajectory", str(made.trajectory)]
    with pytest.raises(SystemExit) as ended:
        main([*words, "--out", str(tmp_path / "out")])
    assert ended.value.code == (1 if shift else 0)
    told = json.loads((tmp_path / "out" / "verification.json").read_text())
    for row in (told["closest"][0], told["min_clearance"], *told["counterexamples"]):
        assert (row["link"], row["body"], row["obstacle"]) == (0, "feed", "post")
    assert len(told["counterexamples"]) == bool(shift)


@pytest.mark.parametrize("bend", [60.0, 5.0])
def test_a_plan_keeps_the_feed_clear_or_says_what_is_in_its_way(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], bend: float
) -> None:
    """The rail ends 4.05 mm, sqrt(82² - 81.9²), before the rear meets the post."""
    beside = ball("post", [-650.0, 0.0, 81.9])
    asked = problem(obstacles=[beside], feed={"length": 600.0}, max_link_angle_deg=bend)
    tip = [TOTAL, 0.0, 0.0]
    asked["tip_path"] = {"start": tip, "points": [[TOTAL - 100.0, 0.0, 0.0]]}
    made = Files(tmp_path, asked, STILL)
    with pytest.raises(SystemExit) as ended:
        words = ["plan", str(made.problem), "--out", str(tmp_path / "out")]
        main([*words, "--time-limit", "60" if bend == 60.0 else "2"])
    told = "".join(capsys.readouterr())
    assert "the feed keeps x0 above \N{MINUS SIGN}45.95" in told
    assert ended.value.code == (bend < 60.0)
    assert ("certified" in told) == (bend == 60.0)


def test_forged_certificates_of_bodies_are_rejected(tmp_path: Path) -> None:
    above = ball("lamp", [850.0, 0.0, 200.0])
    good = Files(tmp_path, problem(camera(), obstacles=[above]), STILL)
    assert good.check(good.verify()).accepted
    at = good.lines()[0]["pairs"].index(["camera", "lamp"])

    def without(lines: Any) -> None:
        for line, key in ((lines[0], "pairs"), (lines[1], "proofs")):
            del line[key][at]

    def renamed(lines: Any) -> None:
        lines[0]["pairs"][at] = ["link 3", "lamp"]

    content = good.certificate.read_bytes()
    for change in (without, renamed):
        assert "the pairs are not those" in good.forged(change).reason
        good.certificate.write_bytes(content)
    # A certificate of a smaller camera beside the problem with the larger one.
    larger = problem(camera(120.0), obstacles=[above])
    good.problem.write_text(json.dumps(larger))
    sha = read_problem(good.problem).sha256
    outcome = good.forged(lambda lines: lines[0].update(problem_sha256=sha))
    assert not outcome.accepted
    assert "camera and lamp" in outcome.reason


ERRORS = [
    ErrorBox(joint=0.002),
    ErrorBox(base=0.001, base_turn=0.002),
    ErrorBox(joints=((0.0, 0.003), (0.001, 0.0), (0.0, 0.0)), base_turn=0.001),
    ErrorBox(obstacle=0.001, obstacles=(ObstacleError("lamp", 0.003, 0.02),)),
]


@pytest.mark.parametrize("errors", ERRORS, ids=range(len(ERRORS)))
def test_every_error_is_certified_and_checked(errors: ErrorBox, tmp_path: Path) -> None:
    lamp = {"name": "lamp", "shape": "box", "center": [850.0, 0.0, 190.0]}
    lamp |= {"size": [200.0, 60.0, 100.0]}
    rows = np.zeros((3, 7))
    rows[:, 2], rows[:, 5] = [0.0, 0.01, 0.02], [0.0, -0.02, 0.01]
    files = Files(tmp_path, problem(camera(), obstacles=[lamp]), rows)
    found = files.verify(errors)
    assert found.verdict is Verdict.CERTIFIED
    outcome = files.check(found)
    assert outcome.accepted, outcome.reason

    def less(lines: Any) -> None:
        told = lines[0]["errors"]
        told["joints_rad"] = [3 * e + 1e-3 for e in told["joints_rad"]]

    assert not files.forged(less).accepted


def test_a_half_space_cannot_be_turned(tmp_path: Path) -> None:
    floor = {"name": "floor", "shape": "half_space"}
    floor |= {"point": [0, 0, -500.0], "normal": [0, 0, 1.0]}
    files = Files(tmp_path, problem(obstacles=[floor]), STILL)
    box = ErrorBox(obstacles=(ObstacleError("floor", turn=0.1),))
    with pytest.raises(InvalidInput, match="half-space"):
        files.verify(box)


def test_a_part_that_no_body_has_is_refused(tmp_path: Path) -> None:
    """It would leave nothing out, without a word."""
    for name in ("camera part 1", "camera part 9"):
        data = problem(camera(), ignore_pairs=[[name, "link 1"]])
        with pytest.raises(InvalidInput, match=f"part of a body '{name}'"):
            Files(tmp_path, data, STILL).verify()


@pytest.mark.parametrize(("off", "turn"), [(0, 30), (50, 0), (89.9, 30), (90.1, 0)])
@pytest.mark.parametrize("shape", ["box", "cylinder", "another body"])
def test_bodies_that_nothing_grows_are_refuted_where_they_meet(
    shape: str, off: float, turn: float, tmp_path: Path
) -> None:
    """A box of 60 mm in a wall, 0 mm required. Oracle: the halves of both."""
    near = {"link": 1, "shape": "box", "center": [200.0, 200.0, 0.0]}
    box = near | {"name": "box", "size": [60.0, 60.0, 60.0], "rpy_deg": [turn, 0, 0]}
    other = {"name": "other", "center": [200.0 + off, 200.0, 0.0]}
    match shape:
        case "box":
            other |= {"shape": "box", "size": [120.0, 300.0, 300.0]}
        case "cylinder":
            more = {"axis": [1, 0, 0], "radius": 150.0, "length": 120.0}
            other |= {"shape": "cylinder", **more}
        case _:
            other |= {"shape": "box", "size": [120.0, 300.0, 300.0], "link": 3}
            other["center"] = [off - 500.0, 200.0, 0.0]
    mine = [box, other] if "link" in other else [box]
    data = problem(*mine, obstacles=[] if "link" in other else [other])
    ignored = [["other", f"link {k}"] for k in (1, 2)]
    data["manipulator"]["ignore_pairs"] = ignored if len(mine) > 1 else []
    data |= {"required_clearance": 0.0, "required_self_clearance": 0.0}
    found = Files(tmp_path, data, STILL).verify()
    meet = off < 90.0
    assert found.verdict is (Verdict.REFUTED if meet else Verdict.CERTIFIED)
    row = next(c for c in found.checks if "box and other" in c.where)
    assert row.verdict is found.verdict
    assert not meet or (off - 90.0) / 1000.0 <= row.worst < 0.0
    assert meet or row.worst == pytest.approx((off - 90.0) / 1000.0, abs=1e-8)


# ---- random bodies -------------------------------------------------------------------


def random_body(rng: np.random.Generator, k: int) -> dict[str, Any]:
    """A small solid beside the axis of some link."""
    link, angle = int(rng.integers(1, 4)), rng.uniform(-np.pi, np.pi)
    away, along = rng.uniform(30.0, 80.0), rng.uniform(0.0, LENGTHS[link - 1])
    centre = [along, away * np.cos(angle), away * np.sin(angle)]
    shape = ("sphere", "capsule", "cylinder", "box", "prism")[int(rng.integers(5))]
    body = {"name": f"body {k}", "link": link, "shape": shape}
    size = [float(x) for x in rng.uniform(10.0, 60.0, 3)]
    axis = [float(x) for x in rng.normal(size=3)]
    match shape:
        case "sphere":
            return body | {"center": centre, "radius": size[0] / 2}
        case "capsule" | "cylinder":
            more = {"axis": axis, "radius": size[0] / 3, "length": size[1]}
            return body | {"center": centre, **more}
        case "box":
            turn = [float(x) for x in rng.uniform(-180.0, 180.0, 3)]
            return body | {"center": centre, "size": size, "rpy_deg": turn}
    notched = [[0, 0], [3, 0], [3, 3], [2, 3], [2, 1], [1, 1], [1, 3], [0, 3]]
    polygon = [[centre[1] + 8.0 * u, centre[2] + 8.0 * v] for u, v in notched]
    span = {"from": along, "to": along + size[0]}
    return body | {"axis": "x", "polygon": polygon, **span}


def random_files(rng: np.random.Generator, folder: Path) -> Files:
    bodies = [random_body(rng, k) for k in range(int(rng.integers(1, 4)))]
    more: dict[str, Any] = {"obstacles": []}
    if rng.random() < 0.5:
        more["feed"] = {"length": float(rng.uniform(100.0, 800.0))}
    for k in range(2):
        angle, away = rng.uniform(-np.pi, np.pi), rng.uniform(120.0, 260.0)
        centre = [
            float(rng.uniform(-300.0, TOTAL)),
            float(away * np.cos(angle)),
            float(away * np.sin(angle)),
        ]
        more["obstacles"].append(ball(f"ball {k}", centre, float(rng.uniform(20, 80))))
    angles = np.cumsum(rng.normal(size=(3, 6)) * 0.05, axis=0)
    x0 = np.cumsum(rng.uniform(-0.05, 0.05, 3))
    data = problem(*bodies, **more)
    return Files(folder, data, np.column_stack([x0, angles]))


def coal_of(body: ArmBody) -> Any:
    """The core of a body in Coal, and its pose in the link's frame."""
    if not isinstance(body.piece, Hull):
        x = body.piece.axis
        y = np.linalg.svd(x[None])[2][1]
        turned = np.column_stack([y, np.cross(x, y), x])
        size = body.piece.radius, 2.0 * body.piece.half_length
        return coal.Cylinder(*size), coal.Transform3s(turned, body.piece.centre)
    points = coal.StdVec_Vec3s()
    points.extend(list(body.corners))
    hull = (
        coal.Convex.convexHull(points, False, "Qt") if len(body.corners) > 3 else None
    )
    return hull, coal.Transform3s()


def check_stations(asked: Any, rows: Trajectory, found: Verification) -> None:
    """The witness on a link is its radius away from the place its station names."""
    arm = asked.manipulator
    for near in found.approaches:
        if near.pair.body or near.deeper:
            continue
        q, k = rows.path.at_moments(np.array([near.moment])), near.pair.link
        centres = joint_centres(arm, q[:, 0], q[:, 1::2], q[:, 2::2])[0]
        axis = (centres[k] - centres[k - 1]) / arm.link_lengths[k - 1]
        foot = centres[k - 1] + near.station * axis
        away = np.linalg.norm(near.link_point - foot)
        assert away == pytest.approx(arm.radius_of(k), abs=1e-6)


def sampled(asked: Any, rows: Trajectory, times: FloatArray) -> dict[Any, float]:
    """Least clearance of each body from each ball, sampled."""
    arm, found = asked.manipulator, {}
    k = np.minimum(times.astype(int), rows.n_samples - 2)
    q = rows.joints[k] + (times - k)[:, None] * (rows.joints[k + 1] - rows.joints[k])
    joints = q[:, 0], np.ascontiguousarray(q[:, 1::2]), np.ascontiguousarray(q[:, 2::2])
    centres, frames = joint_centres(arm, *joints), link_frames(*joints[1:])
    request = coal.DistanceRequest()
    for body in arm_bodies(arm):
        for o in asked.scene.obstacles:
            least, point = np.inf, coal.Sphere(1e-9)
            for m in range(len(times)):
                frame = frames[m, body.link - 1] if body.link else np.eye(3)
                local = (o.centre - centres[m, max(0, body.link - 1)]) @ frame
                shape, pose = coal_of(body)
                if shape is None:
                    a, b = body.corners[0], body.corners[-1]
                    span = (b - a) @ (b - a)
                    t = np.clip((local - a) @ (b - a) / span, 0, 1) if span else 0.0
                    gap = float(np.linalg.norm(local - a - t * (b - a)))
                else:
                    result = coal.DistanceResult()
                    at = coal.Transform3s(np.eye(3), local)
                    gap = coal.distance(shape, pose, point, at, request, result) + 1e-9
                least = min(least, gap - body.ball - o.radius)
            found[body.name, o.name] = least
    return found


def judge_random(seed: int, folder: Path) -> Verdict:
    """Proof, dense samples and checker of one random problem agree."""
    rng = np.random.default_rng(seed)
    files = random_files(rng, folder)
    found = files.verify()
    rows, asked = found.trajectory, found.problem
    least = sampled(asked, rows, np.linspace(0.0, rows.n_samples - 1, 41))
    check_stations(asked, rows, found)
    for k, pair in enumerate(found.pairs):
        if pair.obstacle and least[pair.own, pair.obstacle] > 0.0:
            assert found.least.lower[k] <= least[pair.own, pair.obstacle] + 3e-6
    clear = min(least.values()) - asked.required_clearance
    if clear < -3e-6:
        assert found.verdict is Verdict.REFUTED
    if found.verdict is Verdict.CERTIFIED:
        outcome = files.check(found)
        assert outcome.accepted, (seed, outcome.reason)
        box = ErrorBox(joint=1e-4, base=1e-4, base_turn=1e-4)
        proof = prove_clearance(asked, rows, box)
        if not proof.counts[:, 1:].any():
            outcome = files.check(replace(found, problem=asked.under(box)))
            assert outcome.accepted, (seed, outcome.reason)
    return found.verdict


def test_random_bodies(tmp_path: Path) -> None:
    verdicts = [judge_random(seed, tmp_path) for seed in range(6)]
    assert {Verdict.CERTIFIED, Verdict.REFUTED} <= set(verdicts)


@pytest.mark.slow
def test_many_random_bodies(tmp_path: Path) -> None:
    verdicts = [judge_random(seed, tmp_path) for seed in range(1000, 1300)]
    assert verdicts.count(Verdict.CERTIFIED) > 60


def test_names_of_parts_are_unique(tmp_path: Path) -> None:
    data = problem(*(random_body(np.random.default_rng(k), k) for k in range(20)))
    (tmp_path / "p.yaml").write_text(json.dumps(data))
    bodies = arm_bodies(read_problem(tmp_path / "p.yaml").manipulator)
    assert all(a.name != b.name for a, b in combinations(bodies, 2))
