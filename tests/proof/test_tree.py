"""Oracles: Pinocchio, the snake arm's closed form, and finite differences."""

import numpy as np
import pinocchio
import pytest
from oracles.tree_queries import random_pieces, random_tree

from vdsm_pin.arm.kinematics import joint_centres, link_frames
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.geometry.pieces import pack_pieces
from vdsm_pin.proof.packed_tree import TreePoses
from vdsm_pin.proof.question import _extent
from vdsm_pin.proof.tree import Joint, Kind, Tree, free_tree, shifted

SEEDS = range(40)


def pinocchio_poses(tree: Tree, q: FloatArray) -> FloatArray:
    """T_world_frame of one row as Pinocchio has them, shape (n_frames, 4, 4)."""
    model, numbers = pinocchio.Model(), [0]
    values = tree.values(q[None])[0]
    for number, joint in enumerate(tree.joints):
        kinds = {
            Kind.REVOLUTE: pinocchio.JointModelRevoluteUnaligned,
            Kind.PRISMATIC: pinocchio.JointModelPrismaticUnaligned,
            Kind.FIXED: pinocchio.JointModelPrismaticUnaligned,
        }
        moves = kinds[joint.kind](np.array(joint.axis))
        at = pinocchio.SE3(np.array(joint.placement))
        parent = numbers[joint.parent]
        numbers.append(model.addJoint(parent, moves, at, f"j{number}"))
    given = np.zeros(model.nq)
    for number, joint in enumerate(tree.joints):
        place = model.joints[numbers[number + 1]].idx_q
        given[place] = 0.0 if joint.kind is Kind.FIXED else values[number]
    data = model.createData()
    pinocchio.forwardKinematics(model, data, given)
    return np.array([data.oMi[k].homogeneous for k in numbers])


@pytest.mark.parametrize("seed", SEEDS)
def test_the_proof_places_frames_as_numpy_does(seed: int) -> None:
    rng = np.random.default_rng([2, seed])
    tree = random_tree(rng, int(rng.integers(1, 12)))
    q = rng.normal(size=(5, tree.n_columns))
    placed, expected = TreePoses(tree)(q), tree.poses(q)
    assert placed.shape == (5, tree.n_frames, 4, 4)
    np.testing.assert_allclose(placed, expected, rtol=0.0, atol=1e-13)


@pytest.mark.parametrize("seed", SEEDS)
def test_nothing_is_farther_off_than_rounding_is_allowed_for(seed: int) -> None:
    rng = np.random.default_rng([3, seed])
    tree = random_tree(rng, int(rng.integers(1, 8)))
    pieces = pack_pieces([random_pieces(rng, "box")])
    at_zero = tree.poses(np.zeros((1, tree.n_columns)))[0]
    far = np.linalg.norm(at_zero[:, :3, 3], axis=1).max()
    assert _extent(tree, pieces) >= far + np.abs(pieces.points).max() - 1e-9


@pytest.mark.parametrize("seed", SEEDS)
def test_poses_are_those_of_pinocchio(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tree = random_tree(rng, int(rng.integers(1, 21)))
    q = rng.uniform(-3.0, 3.0, (3, tree.n_columns))
    for poses, row in zip(tree.poses(q), q, strict=True):
        np.testing.assert_allclose(poses, pinocchio_poses(tree, row), atol=1e-12)


def test_a_snake_arm_is_a_tree() -> None:
    arm, rng = built_in("hrm8"), np.random.default_rng(1)
    joints = [Joint(0, Kind.PRISMATIC, (1.0, 0.0, 0.0), column=0)]
    for link in range(arm.n_links):
        before = arm.link_lengths[link - 1] if link else 0.0
        placed, at = shifted(before, 0.0, 0.0), 2 * link + 1
        joints += [
            Joint(at, Kind.REVOLUTE, (0.0, 0.0, 1.0), placed, column=at),
            Joint(at + 1, Kind.REVOLUTE, (0.0, 1.0, 0.0), column=at + 1),
        ]
    tree, q = Tree(tuple(joints)), rng.uniform(-0.7, 0.7, (20, 17))
    poses = tree.poses(q)
    centres = joint_centres(arm, q[:, 0], q[:, 1::2], q[:, 2::2])
    frames = link_frames(q[:, 1::2], q[:, 2::2])
    np.testing.assert_allclose(poses[:, 3::2, :3, 3], centres[:, :-1], atol=1e-13)
    np.testing.assert_allclose(poses[:, 3::2, :3, :3], frames, atol=1e-13)


def test_the_way_goes_over_the_nearest_common_ancestor() -> None:
    tree = Tree(tuple(Joint(parent) for parent in (0, 1, 2, 1, 4, 0)))
    up, down = tree.way(3, 5)
    assert up.tolist() == [2, 1] and down.tolist() == [3, 4]
    up, down = tree.way(5, 6)
    assert up.tolist() == [4, 3, 0] and down.tolist() == [5]


def test_joined_trees_move_as_each_does_alone() -> None:
    rng = np.random.default_rng(3)
    one, other = random_tree(rng, 7), free_tree()
    q, p = rng.normal(size=(4, one.n_columns)), rng.normal(size=(4, 6))
    poses = one.joined(other).poses(np.concatenate([q, p], axis=1))
    np.testing.assert_array_equal(poses[:, :8], one.poses(q))
    np.testing.assert_array_equal(poses[:, 8:], other.poses(p)[:, 1:])
    turns = [rotation_from_rpy(row[[5, 4, 3]]) for row in p]
    np.testing.assert_allclose(poses[:, -1, :3, :3], turns, atol=1e-14)
    np.testing.assert_allclose(poses[:, -1, :3, 3], p[:, :3], atol=1e-14)


@pytest.mark.parametrize(
    ("joints", "words"),
    [
        (lambda: (Joint(1),), "hangs on frame 1"),
        (lambda: (Joint(0, Kind.REVOLUTE, column=1),), "without gaps"),
        (lambda: (Joint(0, Kind.REVOLUTE, (0.0, 0.0, 2.0), name="a"),), "unit vector"),
        (lambda: (Joint(0, axis=(0.0, 0.0, np.nan)),), "unit vector"),
        (lambda: (Joint(0, placement=2.0 * np.eye(4)),), "no rigid motion"),
        (lambda: (Joint(0, placement=np.diag([1.0, 1, -1, 1])),), "no rigid motion"),
        (lambda: (Joint(0, ratio=np.inf),), "finite"),
        (lambda: (Joint(0, offset=np.nan),), "finite"),
        (lambda: (Joint(0), Joint(-1)), "frame 2 and hangs on frame -1"),
        (lambda: (Joint(0), Joint(2)), "expected one from 0 to 1"),
        (lambda: (Joint(0, column=0), Joint(1, column=2)), r"are \[0, 2\], expected"),
    ],
)
def test_what_is_no_tree_is_refused(joints: object, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Tree(joints())  # type: ignore[operator]


def test_rows_of_another_length_are_refused() -> None:
    with pytest.raises(ValueError, match=r"expected \(n_rows, 6\)"):
        free_tree().poses(np.zeros((2, 5)))
