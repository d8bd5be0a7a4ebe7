"""The size of a mesh: stated, known from its file, or assumed and told."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from problem_texts import TETRAHEDRON, binary_stl

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.inputs import assumed_sizes, assumption, input_notes


def problem(folder: Path, size: float, unit: str = "mm", **fields: object) -> Path:
    """A tetrahedron with three edges of that size beside an arm of 1600 mm or m."""
    (folder / "part.stl").write_bytes(binary_stl(TETRAHEDRON * size))
    part = {"name": "part", "shape": "mesh", "file": "part.stl"}
    arm = {"link_lengths": [400.0] * 4, "link_radius": 50.0}
    angles = {"max_link_angle_deg": 40, "max_joint_angle_deg": 40}
    point = [1600.0, 0.0, 0.0]
    if unit == "m":
        arm = {"link_lengths": [0.4] * 4, "link_radius": 0.05}
        point = [1.6, 0.0, 0.0]
    data = {
        "vdsm_problem": 1,
        "length_unit": unit,
        "manipulator": arm | angles,
        "obstacles": [part | fields],
        "tip_path": {"start": point, "points": [list(point)]},
        "required_clearance": 0,
    }
    path = folder / "p.yaml"
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    return path


def mesh_of(path: Path) -> Mesh:
    (mesh,) = read_problem(path).scene.obstacles
    assert isinstance(mesh, Mesh)
    return mesh


def refusal(path: Path) -> str:
    with pytest.raises(InvalidFile) as caught:
        read_problem(path)
    return str(caught.value)


@pytest.mark.parametrize("axis", range(3))
def test_the_size_of_a_flat_mesh_counts_too(axis: int, tmp_path: Path) -> None:
    file = problem(tmp_path, 1e-3)
    flat = TETRAHEDRON * 1e-3
    flat[..., axis] = 0.0
    (tmp_path / "part.stl").write_bytes(binary_stl(flat))
    assert "try scale: 1000" in refusal(file)


def extent(mesh: Mesh) -> float:
    """Longest distance of two vertices: the tetrahedron's is sqrt(2) edges; [m]."""
    away = mesh.vertices[:, None] - mesh.vertices[None]
    return float(np.linalg.norm(away, axis=2).max())


@pytest.mark.parametrize(
    ("unit", "fields", "edge"),
    [
        ("mm", {}, 0.5),
        ("mm", {"scale": 1}, 0.5),
        ("mm", {"scale": 2}, 1.0),
        ("mm", {"length_unit": "mm"}, 0.5),
        ("mm", {"length_unit": "mm", "scale": 3}, 1.5),
        ("m", {"length_unit": "mm"}, 0.5),
        ("m", {"length_unit": "mm", "scale": 4}, 2.0),
        ("m", {"scale": 0.001}, 0.5),
    ],
)
def test_unit_and_scale_make_the_size(
    tmp_path: Path, unit: str, fields: dict[str, object], edge: float
) -> None:
    path = problem(tmp_path, 500.0, unit, **fields)
    mesh = mesh_of(path)
    assert extent(mesh) == pytest.approx(np.sqrt(2.0) * edge, rel=1e-14)
    assert bool(mesh.assumed_size) == (not fields)


def test_metres_in_a_file_of_millimetres(tmp_path: Path) -> None:
    mesh = mesh_of(problem(tmp_path, 0.5, length_unit="m"))
    assert extent(mesh) == pytest.approx(np.sqrt(0.5), rel=1e-14)
    assert not mesh.assumed_size


def test_a_size_that_nobody_states_is_told_in_the_files_unit(tmp_path: Path) -> None:
    found = read_problem(problem(tmp_path, 500.0))
    assert assumed_sizes(found) == ("'part' is 500 x 500 x 500 mm",)
    found = read_problem(problem(tmp_path, 0.5, "m"))
    assert assumed_sizes(found) == ("'part' is 0.5 x 0.5 x 0.5 m",)


@pytest.mark.parametrize("size", [0.0047, 0.01, 0.02, 0.029])
def test_what_is_small_in_millimetres_and_usual_in_metres_is_asked(
    tmp_path: Path, size: float
) -> None:
    """Diagonal over arm: both a few thousandths and a thousand times that will do."""
    edge = size * 1600.0 / np.sqrt(3.0)
    message = refusal(problem(tmp_path, edge))
    assert "obstacles[0].file" in message
    assert f"states no unit and is {size * 1600:.4g} mm or {size * 1600:.4g} m" in (
        message
    )
    assert message.endswith("expected length_unit: mm or length_unit: m")
    for stated in (
        {"length_unit": "mm"}, {"length_unit": "m"}, {"scale": 1}, {"check_size": False}
    ):  # fmt: skip
        mesh = mesh_of(problem(tmp_path, edge, **stated))
        assert bool(mesh.assumed_size) == ("check_size" in stated)


@pytest.mark.parametrize("size", [0.031, 0.1, 1.0, 29.0])
def test_what_would_be_no_usual_size_in_metres_is_not_asked(
    tmp_path: Path, size: float
) -> None:
    assert mesh_of(problem(tmp_path, size * 1600.0 / np.sqrt(3.0))).assumed_size


def test_a_problem_in_metres_is_not_asked(tmp_path: Path) -> None:
    assert mesh_of(problem(tmp_path, 0.01, "m")).assumed_size
    assert mesh_of(problem(tmp_path, 20.0, "m")).assumed_size


@pytest.mark.parametrize(("size", "hint"), [(0.003, "1000"), (31.0, "0.001")])
def test_what_is_no_usual_size_is_refused_stated_or_not(
    tmp_path: Path, size: float, hint: str
) -> None:
    edge = size * 1600.0 / np.sqrt(3.0)
    for fields in ({}, {"scale": 1}, {"length_unit": "mm"}):
        message = refusal(problem(tmp_path, edge, **fields))
        assert f"try scale: {hint}, else set check_size: false" in message
    assert mesh_of(problem(tmp_path, edge, check_size=False)).assumed_size


def test_three_sizes_are_named_and_the_rest_counted() -> None:
    assert assumption([]) == ""
    assert assumption(["a"]) == "assuming that a; no unit is stated"
    sizes = assumption(["a", "b", "c", "d", "e"])
    assert sizes == "assuming that a, b, c and 2 more; no unit is stated"


def test_bent_faces_and_odd_files_are_noted(tmp_path: Path) -> None:
    path = problem(tmp_path, 500.0)
    path.write_text(path.read_text().replace("part.stl", "part.obj"), encoding="utf-8")
    still = Trajectory(
        np.zeros(1, dtype=bool), np.zeros(1), np.zeros(1), np.zeros((1, 5)),
        np.zeros((1, 5)), ("column 't' is ignored",),
    )  # fmt: skip
    for lift, words in ((0, 0), (1e-4, 0), (3, 1)):
        text = f"v 0 0 0\nv 900 0 0\nv 900 900 {lift}\nv 0 900 0\nf 1 2 3 4\nl 1 2\n"
        (tmp_path / "part.obj").write_text(text)
        ours = ("mesh 'part': lines", "mesh 'part': faces", "trajectory: ")
        found = input_notes(read_problem(path), still)
        notes = [note for note in found if note.startswith(ours)]
        assert notes[0] == "mesh 'part': lines and points left out: 1"
        assert notes[-1] == "trajectory: column 't' is ignored"
        assert len(notes) == 2 + words
    off = "1.5 mm"
    assert notes[1] == (
        f"mesh 'part': faces bent by up to {off} are cut into triangles one way of "
        f"several, all within {off}; an obstacle error of as much covers them"
    )
