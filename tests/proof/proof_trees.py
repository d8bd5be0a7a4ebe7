"""Random trees of joints of mixed kinds."""

import numpy as np

from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy
from vdsm_pin.proof.error_box import ErrorBox
from vdsm_pin.proof.paths import Path, cubic_path, quintic_path
from vdsm_pin.proof.tree import Joint, Kind, Tree

AXES = np.concatenate([np.eye(3), -np.eye(3)])


def random_placement(rng: np.random.Generator, size: float = 0.3) -> FloatArray:
    """A rigid motion, every third one without rotation; [m]."""
    placement = np.eye(4)
    placement[:3, 3] = rng.uniform(-size, size, 3) * rng.integers(0, 2, 3)
    if rng.integers(3):
        placement[:3, :3] = rotation_from_rpy(rng.uniform(-np.pi, np.pi, 3))
    return placement


def random_tree(rng: np.random.Generator, n_joints: int) -> Tree:
    """A tree or forest with every kind of joint, some of which mimic others."""
    joints, columns = [], 0
    for number in range(n_joints):
        kind = Kind(rng.choice(3, p=[0.15, 0.65, 0.2]))
        axis = AXES[rng.integers(6)]
        if rng.integers(2):
            axis = rng.normal(size=3)
            axis /= np.linalg.norm(axis)
        column, ratio = None, 1.0
        if kind is not Kind.FIXED and rng.uniform() < 0.95:
            column = columns
            if columns and rng.uniform() < 0.1:
                column, ratio = int(rng.integers(columns)), rng.uniform(-2.0, 2.0)
            columns = max(columns, column + 1)
        parent = number if rng.uniform() < 0.7 else int(rng.integers(number + 1))
        joints.append(
            Joint(
                parent,
                kind,
                axis,
                random_placement(rng),
                column,
                ratio,
                float(rng.choice([0.0, rng.uniform(-1.0, 1.0)])),
                f"j{number}",
            )
        )
    return Tree(tuple(joints))


def random_path(rng: np.random.Generator, tree: Tree, n_rows: int, degree: int) -> Path:
    """Knots some of whose columns rest, and pieces of a degree between them."""
    shape = (n_rows, tree.n_columns)
    size = rng.choice([1e-3, 0.1, 0.5], tree.n_columns)
    q = rng.uniform(-1.5, 1.5, tree.n_columns) + size * rng.uniform(-1.0, 1.0, shape)
    times = np.cumsum(rng.uniform(0.2, 1.5, n_rows))
    rates, changes = size * rng.normal(size=(2, *shape))
    if degree == 1:
        return Path(q)
    if degree == 3:
        return cubic_path(q, rates, times)
    return quintic_path(q, rates, changes, times)


def random_box(rng: np.random.Generator, tree: Tree) -> ErrorBox:
    """Errors of joints and of placements, or none; [rad], [m]."""
    n = len(tree.joints)
    joints = rng.choice([0.0, 1e-3, 0.02], n) * rng.choice([0.0, 1.0])
    tilts = rng.choice([0.0, 0.0, 0.01], n) * rng.choice([0.0, 1.0])
    shifts = rng.choice([0.0, 1e-3], n) * rng.choice([0.0, 1.0])
    return ErrorBox(joints, shifts, tilts)
