"""Certificates beside clouds: planes of some points serve those points alone."""

from pathlib import Path

import numpy as np
import pytest

import vdsm_pin as vp
from vdsm_pin.certificate_checker import check_certificate, solids
from vdsm_pin.geometry.arrays import IntArray
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.robots.cell import read_cell

URDF = """<robot name="slide"><link name="rail"/>
<link name="ball"><collision><geometry><sphere radius="0.1"/></geometry></collision>
</link><joint name="x" type="prismatic"><parent link="rail"/><child link="ball"/>
<axis xyz="1 0 0"/><limit lower="-1" upper="1" velocity="1" effort="1"/></joint></robot>
"""

N = 200
"""Points all around the ball, which no one plane keeps apart from it."""


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path, Path]:
    """A certificate of a ball among points, its problem and its motion."""
    folder = tmp_path_factory.mktemp("cloud")
    (folder / "slide.urdf").write_text(URDF)
    way = np.random.default_rng(3).normal(size=(N, 3))
    np.save(folder / "scan.npy", 0.3 * way / np.linalg.norm(way, axis=1)[:, None])
    problem = folder / "slide.yaml"
    problem.write_text(
        "vdsm_problem: 1\nlength_unit: m\nrequired_clearance: 0.01\n"
        "robot: {urdf: slide.urdf}\nobstacles:\n"
        "- {name: scan, shape: points, file: scan.npy, radius: 0.002}\n"
    )
    motion = JointTrajectory(("x",), np.array([[-0.05], [0.0], [0.06]]))
    found = vp.verify(read_cell(problem), motion)
    assert found.verdict.value == "certified"
    certificate = folder / "slide.certificate"
    vp.write_certificate(found, certificate)
    return certificate, problem, folder / "slide.csv"


def accepted(files: tuple[Path, Path, Path]) -> bool:
    return check_certificate(*files).accepted


def test_the_order_by_halves_is_the_one_that_planes_are_counted_in(
    files: tuple[Path, Path, Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    assert accepted(files)
    right, rng = solids.halved, np.random.default_rng(4)

    def refused(change: IntArray) -> bool:
        with monkeypatch.context() as patch:
            patch.setattr(solids, "halved", lambda points: right(points)[change])
            return not accepted(files)

    each = np.arange(N)
    assert not refused(each)
    halves = np.roll(each, N // 2)
    assert all(map(refused, [halves, each[::-1], *(rng.permutation(N) for _ in "12")]))
    # Of neighbours that one plane serves either may come first; others may not.
    swapped = [each.copy() for _ in range(30)]
    for order in swapped:
        one, other = rng.choice(N, 2, replace=False)
        order[[one, other]] = other, one
    assert sum(map(refused, swapped)) > 20
