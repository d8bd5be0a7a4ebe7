"""The URDF is the arm: equal to the committed file, read back to the last bit."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin
import pytest

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.arm.mounted import Tool
from vdsm_pin.arm.urdf_validator import validate_urdf
from vdsm_pin.arm.urdf_writer import DENSITY, urdf_text

HRM8 = built_in("hrm8")
COMMITTED = Path(__file__).parents[2] / "urdf" / "hrm8.urdf"


def random_arm(rng: np.random.Generator, n_links: int) -> Manipulator:
    lengths = rng.uniform(0.05, 0.8, n_links)
    radius = float(rng.uniform(0.01, 0.09))
    cables = CableLayout(0.9 * radius, 0.9 * radius, paper_hole_angles(n_links))
    limit = float(rng.uniform(0.2, 1.2))
    low = float(rng.uniform(-9.0, 0.0))
    return Manipulator("any", lengths, radius, limit, limit, (low, low + 3.0), cables)


def test_committed_file_is_what_the_generator_writes() -> None:
    assert urdf_text(HRM8).encode() == COMMITTED.read_bytes()


@pytest.mark.parametrize("n_links", [2, 3, 8, 17, 40])
def test_every_arm_gives_a_sound_document_twice_the_same(n_links: int) -> None:
    arm = random_arm(np.random.default_rng(n_links), n_links)
    text = urdf_text(arm)
    validate_urdf(text)
    assert text == urdf_text(arm)
    assert text.endswith("</robot>\n")


def test_numbers_read_back_to_the_same_bits() -> None:
    arm = random_arm(np.random.default_rng(5), 6)
    robot = ET.fromstring(urdf_text(arm))
    for i, length in enumerate(arm.link_lengths, start=1):
        link = robot.find(f"link[@name='link{i}']")
        assert link is not None
        cylinder = link.find("collision/geometry/cylinder")
        assert cylinder is not None
        assert float(cylinder.attrib["length"]) == length
        assert float(cylinder.attrib["radius"]) == arm.link_radius
        for kind in ("alpha", "theta"):
            limit = robot.find(f"joint[@name='{kind}{i}']/limit")
            assert limit is not None
            assert float(limit.attrib["upper"]) == arm.max_joint_angle
            assert float(limit.attrib["lower"]) == -arm.max_joint_angle
    limit = robot.find("joint[@name='x0']/limit")
    assert limit is not None
    assert float(limit.attrib["lower"]) == arm.base_range[0]
    assert float(limit.attrib["upper"]) == arm.base_range[1]


def test_a_hostile_name_stays_a_name() -> None:
    arm = Manipulator(
        'arm "<&>" \u03b1', *[getattr(HRM8, f) for f in list(vars(HRM8))[1:7]]
    )
    assert ET.fromstring(urdf_text(arm)).get("name") == arm.name
    assert pin.buildModelFromXML(urdf_text(arm)).name == arm.name


@pytest.mark.parametrize("tool", [None, Tool(0.2, 0.005)])
def test_pinocchio_finds_the_arm(tool: Tool | None) -> None:
    """Centres, limits, and one rod and two balls for each link and the tool."""
    rng = np.random.default_rng(6)
    arm = random_arm(rng, 5)
    radii = rng.uniform(0.01, arm.link_radius, 5)
    radii[2] = arm.link_radius
    lengths = arm.link_lengths + (0.2 if tool else 0.0) * np.eye(5)[4]
    arm = replace(arm, radii=radii, link_lengths=lengths, tool=tool)
    text, (low, high) = urdf_text(arm), arm.base_range
    model, box = pin.buildModelFromXML(text), np.full(10, arm.max_joint_angle)
    np.testing.assert_array_equal(model.lowerPositionLimit, [low, *-box])
    np.testing.assert_array_equal(model.upperPositionLimit, [high, *box])
    offsets = [0.0, *arm.link_lengths]
    yaws = [model.jointPlacements[model.getJointId(f"alpha{i}")] for i in range(1, 6)]
    tip = model.frames[model.getFrameId("tip")].placement
    for offset, place in zip(offsets, [*yaws, tip], strict=True):
        assert place.translation.tolist() == [offset, 0.0, 0.0]
    shapes = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    found, expected = [], []
    for one in shapes.geometryObjects:
        rod = isinstance(one.geometry, coal.Cylinder)
        assert not rod or abs(one.placement.rotation[0, 2]) == 1.0
        length = 2.0 * one.geometry.halfLength if rod else 0.0
        place = float(one.placement.translation[0])
        found.append((one.parentJoint, place, one.geometry.radius, length))
    for k, (start, end) in enumerate(arm.axis_spans.tolist()):
        joint, radius = model.getJointId(f"theta{min(k + 1, 5)}"), arm.axis_radii[k]
        expected += [(joint, start + x, radius, 0.0) for x in (0.0, end - start)]
        expected.append((joint, start + (end - start) / 2.0, radius, end - start))
    assert sorted(found) == sorted(expected)


def capsule_inertia(length: float, radius: float) -> tuple[float, float, float]:
    """Mass and moments of a capsule about its centre, summed over thin discs."""
    half = length / 2.0 + radius
    edges = np.linspace(-half, half, 200_001)
    x, dx = (edges[1:] + edges[:-1]) / 2.0, np.diff(edges)
    past = np.maximum(np.abs(x) - length / 2.0, 0.0)
    square = radius**2 - past**2
    mass = DENSITY * np.pi * square * dx
    along = float(np.sum(mass * square / 2.0))
    across = float(np.sum(mass * (square / 4.0 + x**2)))
    return float(mass.sum()), along, across


def test_inertia_of_a_link_is_that_of_a_capsule_of_uniform_density() -> None:
    model = pin.buildModelFromXML(urdf_text(HRM8))
    for i, length in enumerate(HRM8.link_lengths, start=1):
        body = model.inertias[model.getJointId(f"theta{i}")]
        mass, along, across = capsule_inertia(float(length), HRM8.link_radius)
        np.testing.assert_allclose(body.mass, mass, rtol=1e-8)
        np.testing.assert_allclose(body.lever, [length / 2.0, 0.0, 0.0], atol=1e-12)
        moments = np.diag([along, across, across])
        np.testing.assert_allclose(body.inertia, moments, rtol=1e-8, atol=1e-15)


def test_cylinder_and_two_spheres_are_the_capsule() -> None:
    text = urdf_text(HRM8)
    model = pin.buildModelFromXML(text)
    shapes = pin.buildGeomFromUrdfString(model, text, pin.GeometryType.COLLISION)
    rng = np.random.default_rng(3)
    request = coal.DistanceRequest()
    request.gjk_tolerance = 1e-9
    for i, length in enumerate(HRM8.link_lengths, start=1):
        joint = model.getJointId(f"theta{i}")
        parts = [s for s in shapes.geometryObjects if s.parentJoint == joint]
        assert len(parts) == 3
        capsule = coal.Capsule(HRM8.link_radius, length)
        lying = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
        T_capsule = coal.Transform3s(lying, np.array([length / 2.0, 0.0, 0.0]))
        ball = coal.Sphere(0.02)
        for point in rng.uniform([-0.4, -0.3, -0.3], [0.9, 0.3, 0.3], (200, 3)):
            T_ball = coal.Transform3s(np.eye(3), point)
            whole = coal.distance(
                capsule, T_capsule, ball, T_ball, request, coal.DistanceResult()
            )
            pieces = []
            for part in parts:
                pose = coal.Transform3s(
                    part.placement.rotation, part.placement.translation
                )
                result = coal.DistanceResult()
                pieces.append(
                    coal.distance(part.geometry, pose, ball, T_ball, request, result)
                )
            if whole > 0.0:
                assert abs(min(pieces) - whole) < 1e-8
            else:
                assert min(pieces) < 1e-8
