"""The reader and a second one find the same in the same files.

The strongest oracle there is for reading: two readers without a common line, one in
floating point, one in ball arithmetic. Planner, verifier and certificate checker all
rest on the first.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from far_scenes import FarScene
from flint import ctx
from oracles import ball_reader
from problem_texts import TETRAHEDRON, binary_stl, edited, write_everything

from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.certificate_checker.balls import column
from vdsm_pin.geometry import solids
from vdsm_pin.geometry.convex import FlatCylinder, HalfSpacePiece, Hull
from vdsm_pin.io.problem_file import built_in_names, find_problem, read_problem
from vdsm_pin.io.trajectory_file import read_trajectory, write_trajectory
from vdsm_pin.problem import scene
from vdsm_pin.problem.trajectory import Trajectory

CLOSE = 1e-13
"""Rounding of a few products of numbers of some metres; [m]."""

PRECISION = 256
"""Bits of the second reader: what is left of numbers of 1e12 is known to the last."""


def numbers(balls: Any) -> np.ndarray:
    """Midpoints of balls: a column matrix, or a list of whatever depth."""
    if hasattr(balls, "entries"):
        balls = balls.entries()
    return np.array(
        [numbers(b) for b in balls] if isinstance(balls, list) else float(balls)
    )


def assert_same_solid(ours: scene.Obstacle, theirs: Any) -> None:
    if isinstance(ours, solids.Mesh):
        places = [
            numbers(theirs.linear * column(*corner) + theirs.shift)
            for corner in theirs.corners.reshape(-1, 3).tolist()
        ]
        found = ours.vertices[ours.triangles].reshape(-1, 3)
        np.testing.assert_allclose(found, places, rtol=0, atol=CLOSE)
        return
    if isinstance(theirs, ball_reader.SweptPolygon):
        assert isinstance(ours, solids.Prism)
        ends = [
            np.column_stack([ours.polygon, np.full(len(ours.polygon), s)])
            for s in ours.span
        ]
        found = [ours.origin + end @ ours.rotation.T for end in ends]
        np.testing.assert_allclose(
            found, numbers(list(theirs.ends)), rtol=0, atol=CLOSE
        )
        return
    (piece,) = ours.pieces
    match piece, theirs:
        case Hull(), ball_reader.Hull():
            found, expected = (
                points[np.lexsort(np.round(points, 9).T)]
                for points in (piece.points, numbers(theirs.points))
            )
            np.testing.assert_allclose(found, expected, rtol=0, atol=CLOSE)
            assert piece.radius == pytest.approx(float(theirs.radius), abs=CLOSE)
        case FlatCylinder(), ball_reader.FlatCylinder():
            for name in ("centre", "axis", "half_length", "radius"):
                np.testing.assert_allclose(
                    getattr(piece, name),
                    numbers(getattr(theirs, name)),
                    rtol=0,
                    atol=CLOSE,
                )
        case HalfSpacePiece(), ball_reader.HalfSpace():
            np.testing.assert_allclose(
                piece.normal, numbers(theirs.normal), rtol=0, atol=CLOSE
            )
            assert piece.offset == pytest.approx(float(theirs.offset), abs=CLOSE)
        case _:
            pytest.fail(f"{type(piece)} against {type(theirs)}")


def assert_same_problem(path: Path) -> None:
    with ctx.workprec(PRECISION):
        assert_same_content(path)


def assert_same_content(path: Path) -> None:
    ours, theirs = read_problem(path), ball_reader.Problem(path)
    assert ours.sha256 == theirs.sha256
    arm = ours.manipulator
    np.testing.assert_allclose(
        arm.link_lengths, numbers(theirs.lengths), rtol=0, atol=CLOSE
    )
    for mine, other in (
        (arm.link_radius, theirs.radius),
        (arm.max_link_angle, theirs.cone),
        (arm.max_joint_angle, theirs.box),
        (arm.base_range[0], theirs.rail[0]),
        (arm.base_range[1], theirs.rail[1]),
        (ours.required_clearance, theirs.clearance),
        (ours.required_self_clearance, theirs.self_clearance),
        (ours.path.required_coverage, theirs.coverage),
    ):
        assert mine == pytest.approx(float(other), abs=CLOSE)
    assert ours.path.closed == theirs.closed
    points = np.array([numbers(point) for point in theirs.path])
    np.testing.assert_allclose(ours.path.points, points, rtol=0, atol=CLOSE)
    assert ours.scene.names == tuple(theirs.shapes)
    for obstacle in ours.scene.obstacles:
        assert_same_solid(obstacle, theirs.shapes[obstacle.name])


@pytest.mark.parametrize("name", built_in_names())
def test_both_read_the_built_in_problems_alike(name: str) -> None:
    assert_same_problem(find_problem(name))


CLOSING_CORNERS = """\
vdsm_problem: 1
name: repeats
length_unit: mm
manipulator: hrm8
obstacles:
  - {name: bar, shape: prism, axis: x, from: 0, to: 100,
     polygon: [[900, 900], [900, 900], [990, 900], [990, 990], [900, 900]]}
tip_path:
  start: [3126, 0, 0]
  points: [[3126, 0, 0], [3126, 90, 0], [3126, 90, 0], [3126, 90, 90], [3126, 0, 0]]
  closed: true
required_clearance: 1
"""


def test_both_drop_repeated_and_closing_corners_alike(tmp_path: Path) -> None:
    path = tmp_path / "repeats.yaml"
    path.write_text(CLOSING_CORNERS, encoding="utf-8")
    assert_same_problem(path)
    assert len(read_problem(path).path.points) == 3


@pytest.mark.parametrize("seed", range(8))
def test_both_read_every_shape_in_any_pose_alike(tmp_path: Path, seed: int) -> None:
    path, rng = write_everything(tmp_path), np.random.default_rng(seed)
    text = path.read_text().replace("1e3", "1000")
    for location, size in (
        (("base", "position"), 500),
        (("base", "rpy_deg"), 180),
        *((("obstacles", i, "center"), 900) for i in (0, 2, 3, 4, 6)),
        *((("obstacles", i, "rpy_deg"), 180) for i in (4, 6)),
        (("obstacles", 3, "axis"), 1),
        (("obstacles", 5, "normal"), 1),
        (("obstacles", 5, "point"), 2000),
    ):
        text = edited(text, location, rng.uniform(-size, size, 3).tolist())
    text = edited(text, ("obstacles", 0, "axis"), "xyz"[seed % 3])
    if seed % 2:
        text = edited(text, ("obstacles", 6, "length_unit"), "m")
        text = edited(text, ("obstacles", 6, "scale"), 0.5)
    text = edited(text, ("obstacles", 1, "axis"), "xyz"[seed % 3])
    polygon = [[0, 0], [900, 0], [900, 900], [450, 100 + 10 * seed], [0, 900]]
    text = edited(text, ("obstacles", 1, "polygon"), polygon)
    path.write_text(text)
    assert_same_problem(path)


def check_far_scene(folder: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    assert_same_problem(FarScene(rng, 10.0 ** rng.uniform(0, 11.5)).write(folder))


@pytest.mark.parametrize("seed", range(150))
def test_both_read_coordinates_alike_that_cancel(tmp_path: Path, seed: int) -> None:
    check_far_scene(tmp_path, seed)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(1, 21))
def test_both_read_many_coordinates_alike_that_cancel(
    tmp_path: Path, seed: int
) -> None:
    for k in range(500):
        check_far_scene(tmp_path, 1000 * seed + k)


@pytest.mark.parametrize("kind", ["text.stl", "obj"])
def test_both_read_text_meshes_alike(tmp_path: Path, kind: str) -> None:
    path = write_everything(tmp_path)
    corners = TETRAHEDRON.reshape(-1, 3).tolist()
    if kind == "obj":
        vertices = "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in corners)
        content = vertices + "f 1/1 2/2 3\nf -1 -2 -3\nf 4//1 5 6 # a remark\nf 1 3 2\n"
    else:
        vertices = [f"vertex {x!r} {y!r} {z!r}\n" for x, y, z in corners]
        facets = [
            f"facet normal 0 0 1\nouter loop\n{a}{b}{c}endloop\nendfacet\n"
            for a, b, c in zip(*[iter(vertices)] * 3, strict=True)
        ]
        content = f"solid part\n{''.join(facets)}endsolid part\n"
    (tmp_path / f"part.{kind}").write_text(content)
    path.write_text(path.read_text().replace("part.stl", f"part.{kind}"))
    assert_same_problem(path)


def test_both_read_trajectories_alike(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    q = rng.uniform(-0.7, 0.7, (50, 17)) * 10.0 ** rng.integers(-12, 1, (50, 17))
    on_path = rng.uniform(size=50) < 0.5
    trajectory = Trajectory(on_path, abs(q[:, 1]), q[:, 0], q[:, 1::2], q[:, 2::2])
    write_trajectory(trajectory, tmp_path / "t.csv")
    ours = read_trajectory(tmp_path / "t.csv", built_in("hrm8"))
    rows = list(ball_reader.read_rows(tmp_path / "t.csv", 8))
    np.testing.assert_array_equal(ours.joints, [numbers(row.joints) for row in rows])
    np.testing.assert_array_equal(ours.path_m, [float(row.path_m) for row in rows])
    assert ours.on_path.tolist() == [row.on_path for row in rows]


def test_the_comparison_can_fail(tmp_path: Path) -> None:
    path = write_everything(tmp_path)
    ours = read_problem(path).scene.obstacles
    (tmp_path / "part.stl").write_bytes(binary_stl(TETRAHEDRON[::-1]))
    path.write_text(path.read_text().replace("radius: 200", "radius: 200.000001"))
    theirs = list(ball_reader.Problem(path).shapes.values())
    for i in (0, 6):
        with pytest.raises(AssertionError):
            assert_same_solid(ours[i], theirs[i])
