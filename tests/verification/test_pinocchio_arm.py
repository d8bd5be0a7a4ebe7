"""Three roads to the joint centres, and a reader that notices what got lost."""

import hashlib
import io
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import yourdfpy

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.arm.urdf_writer import urdf_text
from vdsm_pin.errors import InvalidInput, VerificationFailed
from vdsm_pin.verification.coal_hulls import coal_parts
from vdsm_pin.verification.pinocchio_arm import load_arm, read_arm
from vdsm_pin.verification.pinocchio_frames import PinocchioFrames, read_model

HRM8 = built_in("hrm8")
AGREEMENT = 1e-12


def random_arm(rng: np.random.Generator, n_links: int) -> Manipulator:
    lengths = rng.uniform(0.05, 0.8, n_links)
    radius = float(rng.uniform(0.01, 0.09))
    cables = CableLayout(0.9 * radius, 0.9 * radius, paper_hole_angles(n_links))
    limit = float(rng.uniform(0.2, 1.2))
    return Manipulator("any", lengths, radius, limit, limit, (-2.0, 1.0), cables)


def random_joints(
    rng: np.random.Generator, arm: Manipulator, n: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Half uniform, a quarter on the limits, a quarter within 1e-7 of zero.

    They alternate: trimesh, which keeps yourdfpy's transforms, ignores a change of less
    than 1e-8, so that tiny configurations in a row would not be computed at all.
    """
    box = arm.max_joint_angle
    angles = rng.uniform(-box, box, (2, n, arm.n_links))
    angles[:, 1::4] = box * rng.choice([-1.0, 0.0, 1.0], angles[:, 1::4].shape)
    angles[:, 3::4] = rng.uniform(-1e-7, 1e-7, angles[:, 3::4].shape)
    return rng.uniform(*arm.base_range, n), angles[0], angles[1]


def yourdfpy_centres(
    arm: Manipulator, x0: np.ndarray, alpha: np.ndarray, theta: np.ndarray
) -> np.ndarray:
    """Joint centres from the joint transforms that yourdfpy computes.

    Its `get_transform` multiplies them up at 0.5 ms a frame; here that is done for all
    samples at once.
    """
    robot = yourdfpy.URDF.load(io.BytesIO(urdf_text(arm).encode()), load_meshes=False)
    assert robot.validate()
    names = [
        f"{kind}{i}" for i in range(1, arm.n_links + 1) for kind in ("yaw", "link")
    ]
    chain = ["rail", "base", *names, "tip"]
    edges = list(pairwise(chain))
    data = robot.scene.graph.transforms.edge_data
    q = np.zeros((x0.size, 1 + 2 * arm.n_links))
    q[:, 0], q[:, 1::2], q[:, 2::2] = x0, alpha, theta
    steps = np.zeros((x0.size, len(edges), 4, 4))
    for k in range(x0.size):
        robot.update_cfg(q[k])
        steps[k] = [data[edge]["matrix"] for edge in edges]
    robot.update_cfg(q[0])
    tip = robot.get_transform("tip")
    poses = [steps[:, 0]]
    for i in range(1, len(edges)):
        poses.append(poses[-1] @ steps[:, i])
    np.testing.assert_allclose(poses[-1][0], tip, rtol=0, atol=AGREEMENT)
    centres = [pose[:, :3, 3] for pose in [*poses[2::2], poses[-1]]]
    return np.stack(centres, axis=1)


def test_pinocchio_and_the_closed_form_agree_at_10000_configurations() -> None:
    joints = random_joints(np.random.default_rng(11), HRM8, 10_000)
    ours = joint_centres(HRM8, *joints)
    pinocchio = load_arm(HRM8).joint_centres(*joints)
    np.testing.assert_allclose(pinocchio, ours, rtol=0, atol=AGREEMENT)
    third = yourdfpy_centres(HRM8, *(values[:1_000] for values in joints))
    np.testing.assert_allclose(third, ours[:1_000], rtol=0, atol=AGREEMENT)


@pytest.mark.parametrize("n_links", [2, 3, 5, 12, 40])
def test_they_agree_on_any_arm(n_links: int) -> None:
    rng = np.random.default_rng(n_links)
    arm = random_arm(rng, n_links)
    joints = random_joints(rng, arm, 300)
    ours = joint_centres(arm, *joints)
    pinocchio = load_arm(arm).joint_centres(*joints)
    np.testing.assert_allclose(pinocchio, ours, rtol=0, atol=AGREEMENT)
    few = tuple(values[:12] for values in joints)
    third = yourdfpy_centres(arm, *few)
    np.testing.assert_allclose(third, ours[:12], rtol=0, atol=AGREEMENT)


def test_link_frames_point_along_the_links() -> None:
    x0, alpha, theta = random_joints(np.random.default_rng(2), HRM8, 50)
    turns = load_arm(HRM8).poses(x0, alpha, theta)[:, :-1, :, :3]
    centres = joint_centres(HRM8, x0, alpha, theta)
    along = np.diff(centres, axis=1) / HRM8.link_lengths[:, None]
    np.testing.assert_allclose(turns[..., 0], along, atol=1e-14)
    identity = turns @ turns.swapaxes(2, 3)
    np.testing.assert_allclose(
        identity, np.broadcast_to(np.eye(3), identity.shape), atol=1e-14
    )
    np.testing.assert_allclose(np.linalg.det(turns), 1.0, atol=1e-14)


def test_capsules_lie_between_the_joint_centres() -> None:
    pieces = [body.piece for body in HRM8.convex_bodies]
    parts = coal_parts(pieces)
    assert parts is not None
    for part, length in zip(parts, HRM8.link_lengths, strict=True):
        middle, turn = part.pose.getTranslation(), part.pose.getRotation()
        half = turn[:, 2] * part.geometry.halfLength
        np.testing.assert_allclose(middle - half, [0, 0, 0], atol=1e-16)
        np.testing.assert_allclose(middle + half, [length, 0, 0], atol=1e-16)
        assert part.geometry.radius == HRM8.link_radius


def test_answers_of_one_call_survive_the_next() -> None:
    robot = load_arm(HRM8)
    rng = np.random.default_rng(4)
    first = robot.poses(*random_joints(rng, HRM8, 9))
    kept = first.copy()
    robot.poses(*random_joints(rng, HRM8, 9))
    np.testing.assert_array_equal(first, kept)


def test_hash_is_of_the_document() -> None:
    text = urdf_text(HRM8)
    assert load_arm(HRM8).urdf_sha256 == hashlib.sha256(text.encode()).hexdigest()


def test_an_unknown_link_is_no_number() -> None:
    """`x0` is the name of a joint's frame, which is no link's."""
    model = load_arm(HRM8).model
    (number,) = PinocchioFrames.of(model, ["link3"]).numbers
    assert model.frames[number].name == "link3"
    for name in ("link9", "x0"):
        with pytest.raises(VerificationFailed, match=f"no link '{name}'"):
            PinocchioFrames.of(model, [name])


def test_angles_of_another_arm_are_refused() -> None:
    fit, arm = np.zeros((4, 8)), load_arm(HRM8)
    assert arm.joint_centres(np.zeros(4), fit, fit).shape == (4, 9, 3)
    for other in (np.zeros((4, 7)), np.zeros((3, 8)), np.zeros(8)):
        for angles in ((other, other), (other, fit), (fit, other)):
            with pytest.raises(InvalidInput, match=r"expected \(4, 8\)"):
                arm.joint_centres(np.zeros(4), *angles)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            urdf_text(random_arm(np.random.default_rng(1), 7)),
            "joints are .* expected",
        ),
        (urdf_text(HRM8).replace('"alpha3"', '"beta3"'), "joints are .*beta3"),
        (urdf_text(HRM8).replace('"link3"', '"rod3"'), "no link 'link3'"),
    ],
)
def test_a_document_of_another_arm_is_refused(text: str, message: str) -> None:
    with pytest.raises(VerificationFailed, match=message):
        read_arm(HRM8, text)


def test_a_base_that_stands_still_is_a_rail_of_no_length() -> None:
    fixed = replace(HRM8, base_range=(0.25, 0.25))
    robot = read_arm(fixed, urdf_text(fixed))
    assert robot.model.lowerPositionLimit[0] == robot.model.upperPositionLimit[0]
    assert robot.model.lowerPositionLimit[0] == 0.25


def test_a_broken_document_is_refused_before_pinocchio_sees_it() -> None:
    text = urdf_text(HRM8).replace('<parent link="base" />', '<parent link="b" />')
    with pytest.raises(InvalidInput, match="parent link 'b' does not exist"):
        read_arm(HRM8, text)


def test_an_arm_loaded_again_is_the_same_and_another_one_is_not_taken_for_it() -> None:
    longer = replace(HRM8, link_lengths=1.5 * HRM8.link_lengths)
    twin = replace(HRM8)
    zero = np.zeros(1), np.zeros((1, 8)), np.zeros((1, 8))
    for arm in (HRM8, HRM8, twin, longer, HRM8, longer):
        robot = load_arm(arm)
        assert robot.manipulator is arm
        reach = robot.joint_centres(*zero)[0, -1, 0]
        assert reach == pytest.approx(arm.total_length)
        text = urdf_text(arm)
        assert robot.urdf_sha256 == hashlib.sha256(text.encode()).hexdigest()


def test_frames_are_read_by_turns_and_by_threads_at_once() -> None:
    model, rng = load_arm(HRM8).model, np.random.default_rng(12)
    frames = PinocchioFrames.of(model, ["link2", "link7", "tip"])
    q = 0.3 * rng.normal(size=(8, 40, model.nq))
    usual = [PinocchioFrames.of(model, ["link2", "link7", "tip"]).poses(x) for x in q]
    for x, poses in zip(q, usual, strict=True):
        np.testing.assert_array_equal(frames.origins(x), poses[..., 3])
        np.testing.assert_array_equal(frames.poses(x), poses)
    with ThreadPoolExecutor(4) as pool:
        for poses, found in zip(usual, pool.map(frames.poses, q), strict=True):
            np.testing.assert_array_equal(found, poses)


def test_what_pinocchio_cannot_read_is_told() -> None:
    with pytest.raises(VerificationFailed, match="Pinocchio refuses the URDF"):
        read_model("<robot")
