"""Problems written to files are read back as they were."""

from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from problem_texts import TETRAHEDRON, binary_stl

from vdsm_pin.app.problems import read_problem
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import rotation_from_rpy, rpy_from_rotation
from vdsm_pin.geometry.solids import Mesh, Prism
from vdsm_pin.io.problem_writer import write_problem
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Moving, Scene, solid_of

WHOLE = """
vdsm_problem: 1
name: whole
length_unit: mm
base: {position: [100, -50, 20], rpy_deg: [10, -20, 30]}
manipulator:
  name: five
  link_lengths: [300, 250, 200, 200, 200]
  link_radius: [40, 35, 30, 30, 25]
  max_link_angle_deg: 42
  max_joint_angle_deg: 40
  base_range: [-500, 400]
  cables: {hole_radius: 20, half_gap: 15}
  tool: {length: 60, radius: 10}
  feed: {length: 400}
  bodies:
    - {name: camera, link: 5, shape: box, center: [50, 0, 50], size: [40, 30, 20],
       rpy_deg: [5, 6, 7]}
    - {name: pyramid, link: 2, shape: mesh, file: m.stl, parts: 2, scale: 50}
  ignore_pairs: [[camera, link 3], [feed, ball]]
obstacles:
  - {name: ball, shape: sphere, center: [900, 300, 100], radius: 50}
  - {name: rod, shape: capsule, axis: [1, 2, 3], center: [0, 900, 0], radius: 30,
     length: 200}
  - {name: tin, shape: cylinder, axis: y, center: [0, 0, 900], radius: 30, length: 200}
  - {name: crate, shape: box, center: [900, 900, 0], size: [100, 200, 50],
     rpy_deg: [0, 90, 30]}
  - {name: beam, shape: prism, axis: y, polygon: [[0, 800], [100, 800], [0, 900]],
     from: 100, to: 300}
  - {name: floor, shape: half_space, point: [0, 0, -2000], normal: [0, 0, 3]}
  - {name: rock, shape: mesh, file: m.stl, center: [2000, 0, 2000], solid: true,
     rpy_deg: [1, 2, 3], scale: 100}
  - {name: scan, shape: points, file: s.xyz, center: [2000, 0, 0], radius: 2,
     check_size: false}
  - {name: cells, shape: voxels, file: s.xyz, center: [-2000, 0, 0], size: [4, 5, 6],
     check_size: false, rpy_deg: [0, 0, 45]}
  - {name: door, shape: box, center: [0, 0, 0], size: [20, 400, 400],
     motion: {times_s: [0, 2], positions: [[0, 1500, 0], [100, 1500, 0]],
              rpy_deg: [[0, 0, 0], [10, 20, 400]]}}
errors: {joint_deg: [0.1, 0.1, 0.2, 0.1, 0.1], base: 0.2, base_deg: 0.05, obstacle: 0.1,
         obstacles: [{name: ball, shift: 1, turn_deg: 2}]}
required_clearance: 2.5
required_self_clearance: 1
tip_tolerance: 0.05
max_change_per_row_deg: 4
"""

DRAWN = """
ratios: {scaling_centre: [10, 20], joint: 3}
tip_path:
  start: {joints: {x0: 5, alpha_deg: [1, 2, 3, 4, 5], theta_deg: [0, 1, 0, 1, 0]}}
  points: [[900, 100, 0], {arc: {through: [900, 150, 50], to: [900, 100, 100]}}]
  closed: true
  spacing: 7
  approach: equidistant
  retreat: 30
  blocked: fail
  required_coverage: 0.9
  order: free
  insertion: [[700, 0, 0], [800, 0, 0]]
"""
AIMS = {
    "target": "  pointing: {target: [2000, 0, 0], cone_deg: 30}\n",
    "direction": "  pointing: {direction: [1, 1, 0], cone_deg: 30}\n",
}
ENDS = """
start: {joints: {x0: 5, alpha_deg: [1, 2, 3, 4, 5], theta_deg: [0, 1, 0, 1, 0]}}
goal: {tip: [900, 100, 50]}
"""
STRAIGHT = "tip_path: {start: [1200, -50, 20], points: [[1300, 0, 0]], retreat: home}"


def written(folder: Path, problem: PlanningProblem) -> PlanningProblem:
    """The problem as it is read back."""
    file = folder / "again" / "p.yaml"
    write_problem(file, problem)
    return read_problem(str(file))


def asked(folder: Path, more: str, base: str = "") -> PlanningProblem:
    """A problem with everything that files say."""
    (folder / "m.stl").write_bytes(binary_stl(TETRAHEDRON))
    (folder / "s.xyz").write_text("0 0 0\n10 0 0\n0 20 0\n", encoding="utf-8")
    text = WHOLE.replace(base, "") if base else WHOLE
    (folder / "p.yaml").write_text(text + more, encoding="utf-8")
    return read_problem(str(folder / "p.yaml"))


def check_same(a: Any, b: Any) -> None:
    """Equal but for the last digits; of meshes the triangles count, not their order."""
    assert type(a) is type(b)
    if isinstance(a, Mesh):
        a, b = (
            replace(one, vertices=one.vertices[one.triangles].reshape(-1, 3),
                    triangles=np.arange(one.triangles.size).reshape(-1, 3))
            for one in (a, b)
        )  # fmt: skip
    if isinstance(a, np.ndarray):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-13)
    elif isinstance(a, tuple):
        assert len(a) == len(b)
        for one, other in zip(a, b, strict=True):
            check_same(one, other)
    elif hasattr(a, "__dataclass_fields__"):
        for one in fields(a):
            if one.name not in ("source", "notes", "assumed_size", "itself"):
                check_same(getattr(a, one.name), getattr(b, one.name))
    elif isinstance(a, float):
        assert a == pytest.approx(b, rel=1e-14, abs=1e-14)
    else:
        assert a == b


@pytest.mark.parametrize("name", ["free", "obs1", "obs2", "obs2-small", "obs3"])
def test_what_is_built_in_comes_back_equal(tmp_path: Path, name: str) -> None:
    problem = read_problem(f"paper/{name}")
    assert written(tmp_path, problem) == problem


MORE = {"drawn": DRAWN, "ends": ENDS, "straight": STRAIGHT} | {
    aim: DRAWN + line for aim, line in AIMS.items()
}


@pytest.mark.parametrize("more", MORE)
def test_everything_a_file_says_comes_back(tmp_path: Path, more: str) -> None:
    turned = "base: {position: [100, -50, 20], rpy_deg: [10, -20, 30]}\n"
    # A straight arm starts on its rail: the base at the file's origin.
    base, text = ("", MORE[more]) if more != "straight" else (turned, MORE[more])
    if base:
        text = text.replace("-50, 20", "0, 0")
    problem = asked(tmp_path, text, base)
    assert len(problem.scene.obstacles) == 10
    # Prisms go along axes of the file, so they come back as long as it is the same.
    again = written(tmp_path, problem)
    check_same(problem, again)


def test_directions_of_each_corner_come_back(tmp_path: Path) -> None:
    path = STRAIGHT.replace("[[1300, 0, 0]]", "[[1300, 0, 0], [1310, 9, 0]]")
    aims = "directions: [[1, 0, 0], [1, 0.2, 0]], cone_deg: 20"
    path = path.replace("-50, 20", "0, 0").replace(
        "home}", f"1, pointing: {{{aims}}}}}"
    )
    problem = asked(
        tmp_path, path, "base: {position: [100, -50, 20], rpy_deg: [10, -20, 30]}\n"
    )
    check_same(problem, written(tmp_path, problem))
    closed = replace(
        problem.path,
        closed=True,
        points=np.array([[1.3, 0.0, 0.0], [1.31, 0.01, 0.0], [1.3, 0.01, 0.01]]),
        pointing=None,
    )
    aim = problem.path.pointing
    assert aim is not None
    corners = np.array([[1.0, 0, 0], [1, 0.1, 0], [1, 0, 0.1], [1, 0, 0]])
    looking = replace(closed, pointing=replace(aim, directions=corners))
    drawn = replace(problem, tip_path=looking)
    check_same(drawn, written(tmp_path, drawn))


def test_what_no_file_says_is_refused(tmp_path: Path) -> None:
    problem = asked(tmp_path, "")
    door = problem.scene.obstacles[-1]
    assert isinstance(door, Moving)
    section = np.array([[0.0, 0.0], [0.1, 0.0], [0.0, 0.1]])
    tilted = rotation_from_rpy(np.array([0.3, 0.2, 0.1]))
    beam = Prism("beam", np.zeros(3), tilted, section, (0.0, 0.2))
    robot = replace(door, carrier=replace(door.carrier, robot="mate"))
    elsewhere = replace(door, frame=3)
    uneven = ErrorBox(joints=((0.1, 0.2),) * 5)
    for other, why in (
        (replace(problem, scene=Scene((beam,))), "along x, y or z"),
        (replace(problem, scene=Scene((robot,))), "is a part of 'mate'"),
        (replace(problem, scene=Scene((elsewhere,))), "moves in a way no problem"),
        (replace(problem, errors=uneven), "alpha and theta that differ"),
    ):
        with pytest.raises(InvalidInput, match=why):
            write_problem(tmp_path / "no.yaml", other)
    assert not (tmp_path / "no.yaml").exists()
    assert solid_of(door).name == "door"


@pytest.mark.parametrize("pitch", [-90.0, -89.9999999, 0.0, 45.0, 89.9999999, 90.0])
def test_angles_of_a_rotation_turn_alike(pitch: float) -> None:
    rng = np.random.default_rng(3)
    for roll, yaw in rng.uniform(-180, 180, (50, 2)):
        rotation = rotation_from_rpy(np.deg2rad([roll, pitch, yaw]))
        again = rotation_from_rpy(rpy_from_rotation(rotation))
        np.testing.assert_allclose(again, rotation, rtol=0, atol=1e-15 * 4)


def test_an_arm_that_is_not_built_in_is_written_out(tmp_path: Path) -> None:
    problem = read_problem("paper/free")
    arm = replace(built_in("hrm8"), link_radius=0.06)
    thin = replace(problem, manipulator=arm)
    assert written(tmp_path, thin).manipulator.link_radius == 0.06
