"""Good problem files: every shape, unit, frame and default, against closed forms."""

import hashlib
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from problem_texts import EVERYTHING, TETRAHEDRON, binary_stl, edited, write_everything

from vdsm_pin.arm.cable_layout import paper_hole_angles
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.errors import UnknownName
from vdsm_pin.geometry import solids
from vdsm_pin.geometry.arrays import rotation_from_rpy
from vdsm_pin.io.problem_file import (
    built_in_names,
    built_in_text,
    problem_schema,
    read_problem,
)
from vdsm_pin.problem.desired_path import Approach, Blocked, Order
from vdsm_pin.problem.planning_problem import PlanningProblem

MINIMAL = """\
vdsm_problem: 1
length_unit: m
manipulator: hrm8
tip_path: {start: [3.126, 0, 0], points: [[3.126, 0, 0]]}
required_clearance: 0
"""


def read_text(folder: Path, text: str, name: str = "p.yaml") -> PlanningProblem:
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return read_problem(path)


def test_built_in_problems_are_those_of_the_paper() -> None:
    assert built_in_names() == (
        "paper/free",
        "paper/obs1",
        "paper/obs2",
        "paper/obs2-small",
        "paper/obs3",
    )


@pytest.mark.parametrize("name", built_in_names())
def test_built_in_problems_share_the_papers_task(name: str) -> None:
    problem = read_problem(name)
    assert problem.name == name.removeprefix("paper/")
    assert problem.manipulator.name == "hrm8"
    assert problem.required_clearance == 0.0035
    path = problem.path
    assert path.start.tolist() == [3.126, 0.0, 0.0]
    assert path.points[:, 0].tolist() == [3.126] * 5
    corners = [[0, -0.2], [1, -0.2], [1, 1.3], [-0.5, 1.3], [-0.5, -0.2]]
    assert path.points[:, 1:].tolist() == corners
    assert (path.closed, path.spacing, path.retreat) == (True, 0.01, 0.1)
    assert path.length == pytest.approx(6.0, abs=1e-15)
    np.testing.assert_array_equal(problem.T_world_base, np.eye(4))


def test_the_axes_of_obs1_and_obs3_are_the_papers() -> None:
    (pillar,) = read_problem("paper/obs1").scene.obstacles
    (column,) = read_problem("paper/obs3").scene.obstacles
    assert isinstance(pillar, solids.Cylinder)
    assert isinstance(column, solids.Cylinder)
    assert pillar.axis.tolist() == [1, 0, 0]
    assert column.axis.tolist() == [0, 0, 1]
    assert pillar.centre[1:].tolist() == [0.7, 0.6]
    assert column.centre[:2].tolist() == [2.126, 0.6]
    assert pillar.radius == column.radius == 0.2


@pytest.mark.parametrize(
    ("name", "inscribed", "circumscribed"),
    [("paper/obs2", 0.2, 0.4), ("paper/obs2-small", 0.1, 0.2)],
)
def test_prisms_of_obs2_are_equilateral_about_the_papers_axis(
    name: str, inscribed: float, circumscribed: float
) -> None:
    (prism,) = read_problem(name).scene.obstacles
    assert isinstance(prism, solids.Prism)
    arms = prism.polygon - [0.4, 0.4]
    np.testing.assert_allclose(np.linalg.norm(arms, axis=1), circumscribed, atol=1e-9)
    middles = (arms + np.roll(arms, 1, axis=0)) / 2.0
    np.testing.assert_allclose(np.linalg.norm(middles, axis=1), inscribed, atol=1e-9)


def test_minimal_file_gets_the_stated_defaults(tmp_path: Path) -> None:
    problem = read_text(tmp_path, MINIMAL, "my scene.yaml")
    assert problem.name == "my_scene"
    assert problem.scene.obstacles == ()
    assert problem.required_self_clearance == 0.0
    assert (problem.tip_tolerance, problem.max_row_change) == (1e-6, None)
    path = problem.path
    assert (path.closed, path.spacing, path.retreat) == (False, 0.01, 0.0)
    assert (path.approach, path.blocked) == (Approach.SHORTEST, Blocked.DETOUR)
    assert (path.required_coverage, path.order) == (1.0, Order.AS_GIVEN)
    assert path.start_joints is None


def test_every_field_arrives_in_si(tmp_path: Path) -> None:
    problem = read_problem(write_everything(tmp_path))
    arm = problem.manipulator
    assert (arm.name, arm.n_links) == ("five", 5)
    assert arm.link_lengths.tolist() == [0.4, 0.4, 0.3, 0.3, 0.2]
    assert (arm.link_radius, arm.base_range) == (0.05, (-2.0, 3.0))
    assert arm.max_link_angle == np.deg2rad(40)
    assert arm.max_joint_angle == np.deg2rad(35.5)
    assert (arm.cables.hole_radius, arm.cables.half_gap) == (0.04, 0.02)
    np.testing.assert_array_equal(arm.cables.hole_angles, paper_hole_angles(5))
    path = problem.path
    assert (path.approach, path.blocked) == (Approach.EQUIDISTANT, Blocked.FAIL)
    assert (path.required_coverage, path.order) == (0.75, Order.FREE)
    assert (path.spacing, path.retreat) == (0.005, 0.1)
    assert problem.required_clearance == 0.0035
    assert problem.required_self_clearance == 0.002
    assert problem.tip_tolerance == 1e-5
    assert problem.max_row_change == np.deg2rad(3.0)
    assert problem.scene.names == (
        "pillar", "bar", "ball", "rod", "crate", "wall", "part"
    )  # fmt: skip


def test_an_arm_is_as_thick_as_its_thickest_link(tmp_path: Path) -> None:
    text = EVERYTHING.replace("link_radius: 50", "link_radius: [50, 45, 60, 42, 41]")
    write_everything(tmp_path)
    arm = read_text(tmp_path, text).manipulator
    assert arm.link_radius == 0.06
    np.testing.assert_allclose(arm.radii, [0.05, 0.045, 0.06, 0.042, 0.041], rtol=1e-15)


def test_without_a_path_start_and_goal_stand_on_their_own(tmp_path: Path) -> None:
    text = edited(MINIMAL, ("tip_path",))
    free = read_text(tmp_path, text)
    assert (free.tip_path, free.start, free.goal) == (None, None, None)
    joints = {"x0": 0.1, "alpha_deg": [10] + [0] * 7, "theta_deg": [0] * 8}
    given = edited(text, ("start",), [3.126, 0, 0])
    given = edited(given, ("goal",), {"joints": joints})
    problem = read_text(tmp_path, given)
    assert problem.start is not None
    assert problem.goal is not None
    assert problem.start.joints is None
    np.testing.assert_allclose(problem.start.tip, [3.126, 0, 0], atol=1e-15)
    turn = np.deg2rad(10)
    tip = [0.1 + 3.126 * np.cos(turn), 3.126 * np.sin(turn), 0.0]
    np.testing.assert_allclose(problem.goal.tip, tip, atol=1e-12)
    given = edited(given, ("goal",), {"tip": [3.0, 0.1, 0]})
    goal = read_text(tmp_path, given).goal
    assert goal is not None
    assert goal.joints is None
    np.testing.assert_allclose(goal.tip, [3.0, 0.1, 0], atol=1e-15)


def test_start_joints_and_their_tip_agree(tmp_path: Path) -> None:
    problem = read_problem(write_everything(tmp_path))
    q = problem.path.start_joints
    assert q is not None
    assert q[0] == 0.0125
    np.testing.assert_allclose(np.rad2deg(q[1::2]), [0, 5, -5, 1, 2], atol=1e-13)
    np.testing.assert_allclose(np.rad2deg(q[2::2]), [1, 2, 3, 4, 5], atol=1e-13)
    alpha, theta = q[None, 1::2], q[None, 2::2]
    tip = joint_centres(problem.manipulator, q[:1], alpha, theta)[0, -1]
    np.testing.assert_array_equal(problem.path.start, tip)


def test_scene_is_carried_into_the_base_frame(tmp_path: Path) -> None:
    """Oracle: the inverse of the 4x4 pose, applied to points written by hand."""
    problem = read_problem(write_everything(tmp_path))
    T = np.eye(4)
    T[:3, :3] = rotation_from_rpy(np.deg2rad([10, -20, 30]))
    T[:3, 3] = [0.1, -0.05, 0.025]
    np.testing.assert_allclose(problem.T_world_base, T, atol=1e-15)
    inverse = np.linalg.inv(T)

    def base(*points_mm: list[float]) -> np.ndarray:
        homogeneous = np.column_stack(
            [np.array(points_mm) / 1e3, np.ones(len(points_mm))]
        )
        return (homogeneous @ inverse.T)[:, :3]

    def rotate(vector: list[float]) -> np.ndarray:
        return inverse[:3, :3] @ np.array(vector)

    close = {"rtol": 0.0, "atol": 1e-14}
    pillar, bar, ball, rod, crate, wall, part = problem.scene.obstacles
    assert isinstance(pillar, solids.Cylinder)
    np.testing.assert_allclose(pillar.centre, base([1563, 700, 600])[0], **close)
    np.testing.assert_allclose(pillar.axis, rotate([1, 0, 0]), **close)
    assert (pillar.radius, pillar.half_length) == (0.2, 0.45)
    assert isinstance(bar, solids.Prism)
    (piece,) = bar.pieces
    # Across axis y the polygon is [z, x].
    ends = [
        [x, y, z] for y in (-1000, 500) for z, x in ((0, 900), (100, 900), (100, 1000))
    ]
    np.testing.assert_allclose(piece.points, base(*ends), **close)
    assert isinstance(ball, solids.Sphere)
    np.testing.assert_allclose(ball.centre, base([900, 900, 900])[0], **close)
    assert ball.radius == 0.015
    assert isinstance(rod, solids.Capsule)
    np.testing.assert_allclose(rod.axis, rotate([0, 0.5**0.5, 0.5**0.5]), **close)
    assert (rod.half_length, rod.radius) == (0.025, 0.01)
    assert isinstance(crate, solids.Box)
    turn = rotation_from_rpy(np.deg2rad([0, 0, 45]))
    np.testing.assert_allclose(crate.rotation, inverse[:3, :3] @ turn, **close)
    assert crate.half_size.tolist() == [0.005, 0.01, 0.015]
    assert isinstance(wall, solids.HalfSpace)
    np.testing.assert_allclose(wall.normal, rotate([0, 0, 1]), **close)
    assert wall.normal @ base([7, 8, -2000])[0] == pytest.approx(
        wall.normal @ wall.point, abs=1e-14
    )
    assert isinstance(part, solids.Mesh)
    assert part.closed_mesh.closed
    placed = 500 * TETRAHEDRON.reshape(-1, 3)[:, [2, 1, 0]] * [1, 1, -1] + [0, 900, 0]
    corners = part.vertices[part.triangles].reshape(-1, 3)
    np.testing.assert_allclose(corners, base(*placed.tolist()), **close)


@pytest.mark.parametrize(
    ("axis", "polygon", "low", "high"),
    [
        ("x", [[1, 2], [3, 2], [3, 5]], [7, 1, 2], [9, 3, 5]),
        ("y", [[1, 2], [3, 2], [3, 5]], [2, 7, 1], [5, 9, 3]),
        ("z", [[1, 2], [3, 2], [3, 5]], [1, 2, 7], [3, 5, 9]),
    ],
)
def test_prism_sections_read_y_z_then_z_x_then_x_y(
    tmp_path: Path,
    axis: str,
    polygon: list[list[float]],
    low: list[float],
    high: list[float],
) -> None:
    bar = {"name": "b", "shape": "prism", "axis": axis, "polygon": polygon}
    text = edited(MINIMAL, ("obstacles",), [bar | {"from": 7, "to": 9}])
    (prism,) = read_text(tmp_path, text).scene.obstacles
    assert isinstance(prism, solids.Prism)
    assert np.linalg.det(prism.rotation) == 1.0
    (piece,) = prism.pieces
    assert piece.points.min(axis=0).tolist() == low
    assert piece.points.max(axis=0).tolist() == high


def test_millimetres_and_metres_give_the_same_numbers(tmp_path: Path) -> None:
    text = built_in_text("paper/obs1")
    metres = text.replace("length_unit: mm", "length_unit: m")
    for old, new in (
        ("[1563, 700, 600]", "[1.563, 0.7, 0.6]"), ("radius: 200", "radius: 0.2"),
        ("length: 9000", "length: 9"), ("[3126, 0, 0]", "[3.126, 0, 0]"),
        ("[3126, 0, -200]", "[3.126, 0, -0.2]"), ("spacing: 10", "spacing: 0.01"),
        ("[3126, 1000, -200]", "[3.126, 1, -0.2]"), ("retreat: 100", "retreat: 0.1"),
        ("[3126, 1000, 1300]", "[3.126, 1, 1.3]"), ("3.5", "0.0035"),
        ("[3126, -500, 1300]", "[3.126, -0.5, 1.3]"),
        ("[3126, -500, -200]", "[3.126, -0.5, -0.2]"),
    ):  # fmt: skip
        assert old in metres
        metres = metres.replace(old, new)
    first = read_problem("paper/obs1")
    second = read_text(tmp_path, metres)
    assert repr(first.scene) == repr(second.scene)
    assert repr(first.path) == repr(second.path)
    assert first.required_clearance == second.required_clearance


def test_repeated_points_are_one_point_and_the_path_begins_at_the_first(
    tmp_path: Path,
) -> None:
    points = [[3, 0, 0], [3, 0, 0], [3, 0.5, 0], [3, 0.5, 0.5], [3, 0, 0]]
    text = edited(MINIMAL, ("tip_path", "points"), points)
    path = read_text(tmp_path, text).path
    assert path.points.tolist() == [points[0], points[2], points[3], points[4]]
    path = read_text(tmp_path, edited(text, ("tip_path", "closed"), True)).path
    assert path.points.tolist() == [points[0], points[2], points[3]]


def test_hash_covers_the_file_and_its_meshes(tmp_path: Path) -> None:
    path = write_everything(tmp_path)
    mesh = (tmp_path / "part.stl").read_bytes()
    expected = hashlib.sha256(path.read_bytes() + mesh).hexdigest()
    assert read_problem(path).sha256 == expected
    (tmp_path / "part.stl").write_bytes(mesh[:-1] + b"\x01")
    assert read_problem(path).sha256 != expected


def test_unknown_built_in_lists_the_known_ones() -> None:
    with pytest.raises(UnknownName, match=r"paper/free, paper/obs1"):
        built_in_text("paper/obs9")


def test_a_byte_order_mark_is_no_content(tmp_path: Path) -> None:
    assert read_text(tmp_path, "\ufeff" + MINIMAL).name == "p"


def test_numbers_are_read_as_yaml_1_2(tmp_path: Path) -> None:
    text = MINIMAL.replace("required_clearance: 0", "required_clearance: 1e-3")
    assert read_text(tmp_path, text).required_clearance == 0.001


def test_reading_a_scene_without_prisms_loads_no_geometry_library() -> None:
    code = (
        "import sys; from vdsm_pin.io.problem_file import read_problem; "
        "read_problem('paper/obs1'); "
        "sys.exit(any(m in sys.modules for m in ('shapely', 'trimesh', 'pinocchio', "
        "'coal', 'numba', 'meshcat')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_schema_accepts_good_files_and_refuses_broken_ones() -> None:
    import jsonschema
    import yaml

    validator = jsonschema.Draft202012Validator(problem_schema())
    validator.check_schema(validator.schema)
    texts = [built_in_text(name) for name in built_in_names()] + [EVERYTHING]
    for text in texts:
        # PyYAML's own loader reads 1e3 as text; the schema is about numbers.
        data = yaml.safe_load(text.replace("1e3", "1.0e+3").replace("1.5e1", "15"))
        assert list(validator.iter_errors(data)) == []
    for location, value in (
        (("length_unit",), "cm"),
        (("vdsm_problem",), 2),
        (("obstacles", 0, "radius"), 0),
        (("obstacles", 0, "shape"), "cone"),
        (("obstacles", 0, "colour"), "red"),
        (("tip_path", "points"), []),
        (("tip_path", "start"), [0, 0]),
        (("required_clearance",), ...),
        (("manipulator",), {"link_lengths": [1, 1]}),
    ):
        data = yaml.safe_load(edited(texts[1], location, value))
        assert not validator.is_valid(data), location


def test_schema_describes_every_field_and_the_unit_of_every_number() -> None:
    definitions = problem_schema()["$defs"]
    assert len(definitions) >= 12
    for name, definition in definitions.items():
        for field, entry in definition["properties"].items():
            if field == "shape":
                continue
            assert entry.get("description"), (name, field)


def test_the_hash_takes_files_in_the_order_in_which_they_are_listed(
    tmp_path: Path,
) -> None:
    """Certificates are bound to it: the file, bodies, obstacles, others, the path."""
    for k, name in enumerate(("camera.stl", "wall.stl", "mate.stl")):
        (tmp_path / name).write_bytes(binary_stl(TETRAHEDRON * (0.1 + 0.1 * k)))
    (tmp_path / "line.csv").write_text("x,y,z\n1.8,0,0.1\n")
    arm = (
        "{link_lengths: [1, 1], link_radius: 0.05, max_link_angle_deg: 60, "
        "max_joint_angle_deg: 60, base_range: [-5, 5], "
        "bodies: [{name: camera, link: 1, shape: mesh, file: FILE.stl}]}"
    )
    text = f"""\
vdsm_problem: 1
length_unit: m
manipulator: {arm.replace("FILE", "camera")}
obstacles: [{{name: wall, shape: mesh, file: wall.stl, center: [5, 5, 5]}}]
others:
  - {{name: mate, trajectory: mate.csv, base: {{position: [0, 9, 0]}},
     manipulator: {arm.replace("FILE", "mate")}}}
tip_path: {{start: [2, 0, 0], points: [[1.9, 0, 0], {{file: line.csv}}]}}
required_clearance: 0
"""
    columns = "waypoint,on_path,path_m,x0_m,alpha1_rad,theta1_rad,alpha2_rad,theta2_rad"
    rows = ",time_s\n0,0,0,0,0,0,0,0,0\n1,0,0,0,0,0,0,0,1\n"
    (tmp_path / "mate.csv").write_text(columns + rows)
    problem = read_text(tmp_path, text)
    assert [file.name for file in problem.files] == [
        *("p.yaml", "camera.stl", "wall.stl", "mate.stl", "mate.csv", "line.csv")
    ]
    content = b"".join(file.read_bytes() for file in problem.files)
    assert problem.sha256 == hashlib.sha256(content).hexdigest()
