"""What links carry, read back from the URDF by Pinocchio."""

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yaml
from typer.testing import CliRunner

from vdsm_pin.cli import app

BODIES = [
    {"name": "ball", "shape": "sphere", "link": 1, "center": [1, 2, 3], "radius": 2},
    {"name": "rod", "shape": "capsule", "link": 2, "axis": [1, 2, 3],
     "center": [4, 0, 0], "radius": 1, "length": 3},
    {"name": "can", "shape": "cylinder", "link": 2, "axis": [0, -1, 0.3],
     "center": [5, 0, 0], "radius": 1, "length": 3},
    {"name": "crate", "shape": "box", "link": 3, "center": [5, 1, 0],
     "size": [1, 2, 3], "rpy_deg": [10, 70, -30]},
    {"name": "bar & co", "shape": "prism", "link": 3, "axis": "y",
     "polygon": [[0, 0], [2, 0], [2, 2]], "from": 1, "to": 5},
]  # fmt: skip


def support(geometry: object, direction: np.ndarray) -> float:
    """Largest coordinate along a direction, of the vertices or in closed form."""
    kind = type(geometry).__name__
    if kind == "Sphere":
        return float(geometry.radius)  # type: ignore[attr-defined]
    if kind == "Cylinder":
        across = float(np.linalg.norm(direction[:2]))
        along = geometry.halfLength * abs(direction[2])  # type: ignore[attr-defined]
        return float(geometry.radius * across + along)  # type: ignore[attr-defined]
    if kind == "Box":
        return float(geometry.halfSide @ np.abs(direction))  # type: ignore[attr-defined]
    corners = geometry.vertices()  # type: ignore[attr-defined]
    return float((np.asarray(corners) @ direction).max())


def test_the_urdf_has_what_links_carry(tmp_path: Path) -> None:
    arm = {"link_lengths": [10, 10, 10], "link_radius": 0.5, "bodies": BODIES,
           "max_link_angle_deg": 40, "max_joint_angle_deg": 40,
           "feed": {"length": 7}}  # fmt: skip
    problem = {"vdsm_problem": 1, "length_unit": "m", "manipulator": arm,
               "required_clearance": 0.0}  # fmt: skip
    (tmp_path / "p.yaml").write_text(yaml.safe_dump(problem))
    out = tmp_path / "arm.urdf"
    run = CliRunner().invoke(app, ["urdf", str(tmp_path / "p.yaml"), "--out", str(out)])
    assert run.exit_code == 0, run.output
    model = pin.buildModelFromUrdf(str(out))
    kind, folder = pin.GeometryType.COLLISION, str(tmp_path)
    shapes = pin.buildGeomFromUrdf(model, str(out), kind, None, [folder])
    names = {one.name.rsplit("_", 1)[0] for one in shapes.geometryObjects}
    assert {f"body{k}" for k in range(1, 7)} <= names
    from vdsm_pin.io.problem_file import read_problem

    carried = read_problem(tmp_path / "p.yaml").manipulator.carried
    rng = np.random.default_rng(0)
    for k, (link, solid) in enumerate(carried, start=1):
        mine = [o for o in shapes.geometryObjects if o.name.startswith(f"body{k}_")]
        joint = f"theta{link}" if link else "x0"
        assert {one.parentJoint for one in mine} == {model.getJointId(joint)}
        for direction in rng.normal(size=(20, 3)):
            n = direction / np.linalg.norm(direction)
            found = max(
                one.placement.translation @ n
                + support(one.geometry, one.placement.rotation.T @ n)
                for one in mine
            )
            points, grown = solid.corners, solid.grown
            if solid.name == "can":
                grown *= np.linalg.norm(np.cross(n, solid.axis))
            assert found == pytest.approx((points @ n).max() + grown, abs=1e-5), solid
