"""Point clouds and voxels in the proof: as balls and boxes one by one, and on file."""

import gzip
import hashlib
from pathlib import Path

import numpy as np
import pytest
from problem_files import NEAR

from vdsm_pin.app.workflow import VerifyOrder, plan_to_folder, verify_to_folder
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.certificate_checker import main as check_certificate
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.ordering import coherent_order
from vdsm_pin.geometry.solids import Box, PointCloud, Sphere, Voxels
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.solids import detail, surface
from vdsm_pin.verification.clearance import prove_clearance
from vdsm_pin.verification.coal_check import check_coal
from vdsm_pin.verification.records import ErrorBox, Verdict

ARM = built_in("hrm8")
TURN = np.array([[0.6, -0.8, 0.0], [0.8, 0.6, 0.0], [0.0, 0.0, 1.0]])
HALF = np.array([0.03, 0.02, 0.05])


def some_points(seed: int, count: int) -> FloatArray:
    """Around the arm, some of them near."""
    rng = np.random.default_rng(seed)
    return np.asarray(rng.uniform([0.2, 0.2, -0.5], [3.5, 0.9, 0.5], (count, 3)))


def motion(seed: int) -> Trajectory:
    rng = np.random.default_rng(seed)
    rows = np.cumsum(rng.uniform(-0.05, 0.05, (2, 5, 8)), axis=1)
    return Trajectory(np.zeros(5, bool), np.zeros(5), np.zeros(5), *rows)


def problem(*obstacles: Obstacle) -> PlanningProblem:
    return PlanningProblem(ARM, Scene(obstacles), None, 0.01, name="p")


@pytest.mark.parametrize("seed", range(6))
def test_a_cloud_is_as_far_as_its_nearest_part(seed: int) -> None:
    points, rows, none = some_points(seed, 60), motion(seed), ErrorBox()
    balls = [Sphere(f"s{k}", p, 0.02) for k, p in enumerate(points)]
    boxes = [Box(f"b{k}", p, TURN, HALF) for k, p in enumerate(points)]
    whole = PointCloud("c", points, 0.02), Voxels("v", points, TURN, HALF)
    for one, parts in zip(whole, (balls, boxes), strict=True):
        apart = prove_clearance(problem(*parts), rows, none).least
        bounds = np.stack([apart.lower, apart.upper], axis=1)[: 8 * 60]
        least = bounds.reshape(60, 8, 2).min(axis=0)
        proved = prove_clearance(problem(one), rows, none).least
        found = np.stack([proved.lower, proved.upper], axis=1)[:8]
        # Brackets of the same number overlap, and the least is narrow.
        assert (found[:, 0] <= least[:, 1] + 1e-9).all()
        assert (least[:, 0] <= found[:, 1] + 1e-9).all()
        # Depths beyond a link's radius are not measured.
        lows = np.maximum([found[:, 0].min(), least[:, 0].min()], -ARM.link_radius)
        assert lows[0] == pytest.approx(lows[1], abs=2e-6)


@pytest.mark.parametrize("seed", range(3))
def test_coal_agrees_about_clouds(seed: int) -> None:
    points = some_points(seed, 500)
    both = PointCloud("c", points, 0.004), Voxels("v", points + 0.5, TURN, HALF)
    (row,) = check_coal(problem(*both), motion(seed))
    assert row.verdict is Verdict.CERTIFIED, row
    moved = PointCloud("c", points + 1e-3, 0.004)  # Coal is asked about another cloud
    asked = problem(moved, both[1])
    vars(asked)["packed"] = problem(*both).packed
    (row,) = check_coal(asked, motion(seed))
    assert row.verdict is Verdict.UNDECIDED


CLOUD = NEAR.replace(
    "{name: ball, shape: sphere, center: [2000, 900, 0], radius: 200}",
    "{name: scan, shape: points, file: scan.npy, length_unit: mm, radius: 5}\n"
    "  - {name: map, shape: voxels, file: map.npy, size: [40, 30, 20], "
    "center: [1500, -900, 100], rpy_deg: [10, 20, 30]}",
)


def files(folder: Path) -> Path:
    rng = np.random.default_rng(1)
    way = rng.normal(size=(3000, 3))
    ball = 200.0 * way / np.linalg.norm(way, axis=1)[:, None]
    np.save(folder / "scan.npy", ball + np.array([2000.0, 500.0, 0.0]))
    np.save(folder / "map.npy", rng.random((8, 6, 5)) < 0.5)
    path = folder / "cloud.yaml"
    path.write_text(CLOUD)
    return path


def test_a_cloud_is_planned_certified_rechecked_and_lies_are_told(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    problem = read_problem(files(tmp_path))
    plan_to_folder(problem, "fewest", tmp_path / "out", "plan")
    rows = tmp_path / "out" / "trajectory.csv"
    proof = tmp_path / "proof.certificate"
    order = VerifyOrder(problem, rows, tmp_path / "v", "verify", certificate=proof)
    verified = verify_to_folder(order)
    assert verified.content.verdict == "certified"
    arguments = [str(proof), str(problem.files[0]), str(rows)]
    assert check_certificate(arguments) == 0, capsys.readouterr()
    # Nothing is stored for each point; the same order, told, counts as well.
    text = gzip.decompress(proof.read_bytes()).decode()
    scan, stored = np.load(tmp_path / "scan.npy"), '"scan":[]'
    assert stored in text
    read = next(o for o in problem.scene.obstacles if isinstance(o, PointCloud))
    by_halves = coherent_order(read.points)
    for order, status in ((by_halves, 0), (by_halves[1:], 1)):
        told = f'"scan":{order.tolist()}'
        body = text.replace(stored, told).splitlines(keepends=True)[:-1]
        proof.write_bytes(gzip.compress("".join([*body, sealed(body)]).encode()))
        assert check_certificate(arguments) == status, capsys.readouterr()
    # The same certificate about a scan that comes 100 mm nearer proves nothing.
    np.save(tmp_path / "scan.npy", scan - [0.0, 300.0, 0.0])
    changed = read_problem(problem.files[0]).sha256
    body = text.replace(problem.sha256, changed, 1).splitlines(keepends=True)[:-1]
    proof.write_bytes(gzip.compress("".join([*body, sealed(body)]).encode()))
    assert check_certificate(arguments) == 1
    assert "scan" in capsys.readouterr().out


def sealed(lines: list[str]) -> str:
    """The last line of a certificate made of these."""
    digest = hashlib.sha256("".join(lines).encode()).hexdigest()
    return f'{{"end":true,"sha256":"{digest}"}}\n'


def test_a_cloud_in_the_way_is_refuted(tmp_path: Path) -> None:
    none = Trajectory(np.zeros(2, bool), *np.zeros((2, 2)), *np.zeros((2, 2, 8)))
    cloud = PointCloud("c", np.array([[1.0, 0.05, 0.0], [9.0, 9.0, 9.0]]), 0.01)
    proof = prove_clearance(problem(cloud), none, ErrorBox())
    assert proof.counts[:, 1].any()


def test_a_page_draws_no_more_of_a_cloud_than_it_can_hold() -> None:
    points = some_points(0, 20_000)
    for one in (PointCloud("c", points, 1e-3), Voxels("v", points, TURN, HALF / 50)):
        fine = detail(1)
        skin = surface(one, 1.0, fine)
        assert 0 < len(skin.triangles) <= fine.triangles
        low, high = skin.vertices.min(axis=0), skin.vertices.max(axis=0)
        assert (low <= points.min(axis=0) + 0.1).all()
        assert (high >= points.max(axis=0) - 0.1).all()
    few = surface(Voxels("v", points[:2], TURN, HALF), 1.0)
    assert few.vertices.shape == (16, 3)
