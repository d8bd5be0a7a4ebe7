"""Links inside meshes of a scene: solid angles, checker, and what cannot be told."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from oracles.shortcuts import named, read_rows, read_scene

from tests.oracles.certificate_cases import certificate_lines
from tests.oracles.certificate_oracle import sealed
from tests.robots.test_robots import write
from vdsm_pin.certificate_checker import check_certificate
from vdsm_pin.certificate_writer.certificate import write_certificate
from vdsm_pin.certificate_writer.lines import Hashes
from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.source import sha256_of_file
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.proof.paths import Path as Motion
from vdsm_pin.report.reason import reason
from vdsm_pin.robots.cell import Cell, read_cell
from vdsm_pin.robots.judgement import RobotVerification, verify_robot
from vdsm_pin.verification.records import CheckKind, Verdict

URDF = """<robot name="one"><link name="base"/>
  <link name="arm"><collision><origin xyz="0.5 0 0"/>
    <geometry><sphere radius="0.02"/></geometry></collision></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/>
    <axis xyz="0 0 1"/><limit lower="-3" upper="3" effort="1" velocity="9"/></joint>
</robot>
"""
ROWS = "turn_rad\n0\n0.2\n"


def cell_in(folder: Path, mesh: Any, more: str = "") -> Cell:
    """The robot in a scene of one mesh; its ball starts at (0.5, 0, 0)."""
    write(folder, "one.urdf", URDF)
    write(folder, "t.csv", ROWS)
    mesh.export(folder / "m.stl")
    return read_cell(
        write(
            folder,
            "cell.yaml",
            "vdsm_problem: 1\nlength_unit: m\nrobot: {urdf: one.urdf}\n"
            "required_clearance: 0.005\nobstacles:\n"
            f"  - {{name: shell, shape: mesh, file: m.stl, length_unit: m{more}}}\n",
        )
    )


def judged(cell: Cell, folder: Path) -> RobotVerification:
    return verify_robot(cell, read_rows(folder / "t.csv", cell.robot))


def winding(mesh: Any, point: FloatArray) -> float:
    """Solid angle of the triangles over 4 pi (Van Oosterom and Strackee 1983)."""
    a, b, c = np.moveaxis(mesh.triangles - point, 1, 0)
    la, lb, lc = (np.linalg.norm(x, axis=1) for x in (a, b, c))
    triple = np.einsum("ij,ij->i", a, np.cross(b, c))
    dots = (
        np.einsum("ij,ij->i", x, y) * z
        for x, y, z in ((a, b, lc), (a, c, lb), (b, c, la))
    )
    return float(np.arctan2(triple, la * lb * lc + sum(dots)).sum() / (2.0 * np.pi))


@pytest.mark.parametrize("seed", range(24))
def test_verdicts_are_those_of_solid_angles(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    shapes = (
        lambda: trimesh.creation.torus(0.3, 0.12, 24, 16),
        lambda: trimesh.creation.annulus(0.15, 0.4, 0.5, sections=24),
        lambda: trimesh.creation.icosphere(2, 0.35),
        lambda: trimesh.creation.box((0.5, 0.4, 0.6)),
    )
    mesh = shapes[seed % 4]()
    mesh.apply_transform(trimesh.transformations.random_rotation_matrix(rng.random(3)))
    mesh.apply_translation(np.array([0.5, 0.0, 0.0]) + rng.uniform(-0.4, 0.4, 3))
    result = judged(cell_in(tmp_path, mesh), tmp_path)
    (row,) = (check for check in result.checks if check.name == CheckKind.LINKS_OUTSIDE)
    inside = abs(winding(mesh, np.array([0.5, 0.0, 0.0]))) > 0.5
    assert row.verdict is (Verdict.REFUTED if inside else Verdict.CERTIFIED)
    if inside:
        assert result.verdict is Verdict.REFUTED
        assert row.where == "link 'arm' is inside 'shell'"
        assert result.closest(1)[0].upper <= 0.0
        np.testing.assert_allclose(result.closest(1)[0].link_point, [0.5, 0, 0])
        clear = next(
            check for check in result.checks if check.name == CheckKind.OBSTACLES
        )
        assert clear.first_moment == 0.0
        assert clear.where == "link 'arm' is inside 'shell'"


def test_between_two_shells_is_outside_and_in_their_wall_is_not(tmp_path: Path) -> None:
    outer = trimesh.creation.icosphere(2, 2.0)
    inner = trimesh.creation.icosphere(2, 1.0)
    inner.invert()
    hollow = trimesh.util.concatenate([outer, inner])  # the ball is in the cavity
    assert judged(cell_in(tmp_path, hollow), tmp_path).verdict is Verdict.CERTIFIED
    nested = trimesh.util.concatenate([outer, trimesh.creation.icosphere(2, 1.0)])
    assert judged(cell_in(tmp_path, nested), tmp_path).verdict is Verdict.REFUTED


def test_an_inside_that_cannot_be_told_is_undecided_or_far(tmp_path: Path) -> None:
    bowl = trimesh.creation.icosphere(2, 0.3)
    bowl.update_faces(bowl.triangles_center[:, 0] > -0.1)
    bowl.apply_translation([0.5, 0.0, 0.0])
    result = judged(cell_in(tmp_path, bowl), tmp_path)
    assert result.verdict is Verdict.UNDECIDED
    row = next(
        check for check in result.checks if check.name == CheckKind.LINKS_OUTSIDE
    )
    assert row.where.startswith(
        "whether link 'arm' is inside 'shell' cannot be decided"
    )
    stated = cell_in(tmp_path, bowl, ", solid: false")
    assert judged(stated, tmp_path).verdict is Verdict.CERTIFIED
    bowl.apply_translation([0.5, 0.0, 0.0])
    assert judged(cell_in(tmp_path, bowl), tmp_path).verdict is Verdict.CERTIFIED


def test_the_motion_without_errors_is_located_without_them(tmp_path: Path) -> None:
    """A bowl whose hull the ball clears by 0.04 m, the bowl itself by 0.27 m."""
    bowl = trimesh.creation.icosphere(3, 0.3)
    bowl.update_faces(bowl.triangles_center[:, 0] > -0.1)
    bowl.apply_translation([0.66, 0.0, 0.0])
    found = judged(
        replace(cell_in(tmp_path, bowl), errors=ErrorBox(base=0.3)), tmp_path
    )
    assert found.verdict is Verdict.REFUTED
    assert len(found.counterexamples) == 1
    assert found.nominal_clear


def test_a_mesh_that_moves_over_a_link_is_refuted(tmp_path: Path) -> None:
    box = trimesh.creation.box((0.5, 0.5, 0.5))
    motion = ", motion: {times_s: [0, 1], positions: [[0.5, 0, 0], [0.6, 0, 0]]}"
    cell = cell_in(tmp_path, box, motion)
    q, times = np.array([[0.0], [0.1]]), np.array([0.0, 1.0])
    assert verify_robot(cell, named(Motion(q, times=times))).verdict is Verdict.REFUTED
    away = cell_in(tmp_path, box, motion.replace("0.5, 0, 0]", "-0.5, 0, 0]"))
    late = Motion(q, times=np.array([-2.0, -1.0]))
    assert verify_robot(away, named(late)).verdict is Verdict.CERTIFIED


def test_the_checker_asks_for_the_inside_too(tmp_path: Path) -> None:
    files = tmp_path / "cell.yaml", tmp_path / "t.csv"
    beside = trimesh.creation.icosphere(2, 0.3)
    around = trimesh.creation.icosphere(2, 2.0)
    for mesh, is_outside in ((beside, True), (around, False)):
        # Proved of the surface alone, and then told of the solid.
        found = judged(cell_in(tmp_path, mesh, ", solid: false"), tmp_path)
        assert found.verdict is Verdict.CERTIFIED
        source = cell_in(tmp_path, mesh).source
        assert source is not None
        hashes = Hashes(source.sha256, sha256_of_file(files[1]))
        write_certificate(tmp_path / "c", found, hashes)
        outcome = check_certificate(tmp_path / "c", *files)
        assert outcome.accepted is is_outside
        if not is_outside:
            assert "a body is not proved outside shell: it is inside" in outcome.reason


def certified(cell: Cell, folder: Path) -> Any:
    """What the checker says of the certificate of the motion in a folder."""
    found, source = judged(cell, folder), cell.source
    assert found.verdict is Verdict.CERTIFIED
    assert source is not None
    hashes = Hashes(source.sha256, sha256_of_file(folder / "t.csv"))
    write_certificate(folder / "c", found, hashes)
    return check_certificate(folder / "c", folder / "cell.yaml", folder / "t.csv")


def test_certificates_beside_meshes_with_gaps(tmp_path: Path) -> None:
    """Joined where gaps are narrow, off the hull where they are wide, or a surface."""
    torn = trimesh.creation.annulus(0.65, 0.9, 0.5, sections=24)  # the ball is within
    corners = torn.triangles.copy()
    corners[torn.triangles_center[:, 2] > 0.0] += [0.0, 0.0, 1e-4]
    torn = trimesh.Trimesh(**trimesh.triangles.to_kwargs(corners), process=False)
    assert not torn.is_watertight
    outcome = certified(cell_in(tmp_path, torn), tmp_path)
    assert outcome.accepted, outcome.reason
    assert "gaps of shell, up to 0.1 mm wide, are joined" in outcome.notes
    lines = certificate_lines(tmp_path / "c")
    assert lines[0]["joined"]["shell"][0]
    lines[0]["joined"] = {}
    check_refused(tmp_path, lines, "outside shell: the mesh is not closed")

    # A box beside it may be as thin as the gaps, and keeps off the hull.
    box = '<link name="up"><collision><origin xyz="0 0 1"/><geometry>'
    box += '<box size=".1 .1 .1"/></geometry></collision></link>'
    box += '<joint name="lift" type="fixed"><parent link="arm"/><child link="up"/>'
    write(tmp_path, "one.urdf", URDF.replace("</robot>", f"{box}</joint></robot>"))
    text = (tmp_path / "cell.yaml").read_text().replace("0.005", "0")
    outcome = certified(read_cell(write(tmp_path, "cell.yaml", text)), tmp_path)
    assert outcome.accepted, outcome.reason
    lines = certificate_lines(tmp_path / "c")
    assert lines[0]["pairs"] == [["arm", "shell"], ["up", "shell"]]
    whole = [len(proof[0][2]) == 1 for proof in lines[1]["proofs"]]
    assert whole == [False, True]

    bowl = trimesh.creation.icosphere(2, 0.3)
    bowl.update_faces(bowl.triangles_center[:, 0] > -0.1)
    bowl.apply_translation([1.0, 0.0, 0.0])
    outcome = certified(cell_in(tmp_path, bowl), tmp_path)
    assert outcome.accepted, outcome.reason
    lines = certificate_lines(tmp_path / "c")
    ((_, _, planes),) = lines[1]["proofs"][0]
    half = len(bowl.triangles) // 2
    lines[1]["proofs"][0][0][2] = [
        [0, half, *planes[0][2:]],
        [half, planes[0][1], *planes[0][2:]],
    ]
    check_refused(tmp_path, lines, "outside shell: the mesh is not closed")

    bowl.apply_translation([-0.5, 0.0, 0.0])
    cell = cell_in(tmp_path, bowl, ", solid: false")
    assert "'shell' is a surface only" in reason(judged(cell, tmp_path))
    outcome = certified(cell, tmp_path)
    assert outcome.accepted, outcome.reason
    assert "shell is a surface only" in outcome.notes


def check_refused(folder: Path, lines: list[Any], why: str) -> None:
    (folder / "forged").write_bytes(sealed(lines[:-1]))
    files = folder / "cell.yaml", folder / "t.csv"
    outcome = check_certificate(folder / "forged", *files)
    assert not outcome.accepted
    assert why in outcome.reason


def test_a_planning_scene_brings_its_meshes(tmp_path: Path) -> None:
    box = trimesh.creation.box((0.2, 0.4, 0.6))
    corners = [dict(zip("xyz", map(float, v), strict=True)) for v in box.vertices]
    faces = [{"vertex_indices": [int(k) for k in face]} for face in box.faces]
    yaml = write(
        tmp_path,
        "m.yaml",
        "world:\n  collision_objects:\n    - id: crate\n"
        f"      meshes: [{{vertices: {corners}, triangles: {faces}}}]\n"
        "      mesh_poses: [{position: [0, 0, 1], orientation: [0, 0, 1, 0]}]\n",
    )
    numbers = [*map(str, box.vertices.ravel().tolist()), *map(str, box.faces.ravel())]
    text = write(
        tmp_path,
        "m.scene",
        f"crates\n* crate\n1\nmesh\n8 12\n{' '.join(numbers)}\n"
        "0 0 1\n0 0 1 0\n0 0 0 0\n.\n",
    )
    for file in (yaml, text):
        (mesh,) = read_scene(file, 1.0).obstacles
        np.testing.assert_allclose(
            mesh.closed_mesh.corners.mean(axis=(0, 1)), [0, 0, 1], atol=1e-15
        )
        assert mesh.has_inside
        np.testing.assert_allclose(np.ptp(mesh.vertices, axis=0), [0.2, 0.4, 0.6])
    good, first = yaml.read_text(), str(faces[0]["vertex_indices"])
    for bad in ("[0, 1, 99]", "[0, 1, -1]", "[0, 1, 1e30]", "[0, 1, 0.5]", "[0, 1]"):
        text = write(tmp_path, "bad.yaml", good.replace(first, bad, 1))
        with pytest.raises(InvalidFile, match=r"of 8 vertices|3 finite num"):
            read_scene(text, 1.0)
