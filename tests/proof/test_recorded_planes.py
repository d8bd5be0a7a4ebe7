"""Planes that are written down prove what is required, by all corners."""

import numpy as np
import pytest

from vdsm_pin.geometry.solids import Box
from vdsm_pin.proof.bodies import Body, Pair, PairTable
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.layouts import CLAIM, RECORD
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.question import Question
from vdsm_pin.proof.recording import by_all_corners, record
from vdsm_pin.proof.terms import Task
from vdsm_pin.proof.tree import Joint, Kind, Tree, X, Y, Z, shifted
from vdsm_pin.proof.workspace import new_workspace
from vdsm_pin.robots.hulls import covering_hull


def asked(seed: int, required: float = 0.0) -> tuple[Question, Path]:
    """A link of many corners that swings far in one interval beside a box."""
    rng = np.random.default_rng(seed)
    joints = tuple(
        Joint(k, Kind.REVOLUTE, axis, shifted(0.4 * (k > 0), 0.0, 0.0), column=k)
        for k, axis in enumerate((Z, Y, X))
    )
    corners = rng.normal(size=(170, 3))
    corners *= rng.uniform(0.05, 0.15) / np.linalg.norm(corners, axis=1)[:, None]
    corners[:, 0] += rng.uniform(0.0, 0.4, 170)
    box = Box(
        "box", np.array([0.0, rng.uniform(0.4, 1.0), 0.0]), np.eye(3), np.full(3, 0.1)
    )
    bodies = [Body(2, (covering_hull(corners),)), Body(0, box.pieces)]
    ends = np.array([rng.uniform(-1.5, 0.0, 3), np.zeros(3)])
    ends[1] = ends[0] + rng.uniform(-1.5, 1.5, 3)
    tree = Tree(joints)
    return Question.of(tree, bodies, PairTable.of([Pair(0, 1, required)])), Path(ends)


def recorded(task: Task, path: Path) -> tuple[bool, np.ndarray]:
    """Whether the interval is proved, and what its planes claim; [m]."""
    work, found = new_workspace(task, 3, Budget().slices), np.zeros((4096, RECORD))
    count, reached, _ = record(task, path.packed(), work, 0, 1, found)
    return reached == 1, found[:count, CLAIM]


@pytest.mark.parametrize("required", [0.468, 0.4686, 0.4695])
def test_planes_are_sought_by_all_corners(required: float) -> None:
    # Few corners, less what they miss, prove half of this interval; all do not.
    question, path = asked(273, required)
    task = question.about(path).task
    proved, claims = recorded(task, path)
    assert proved and claims.min() < required
    proved, claims = recorded(by_all_corners(task), path)
    assert proved and claims.min() >= required


def test_every_plane_of_a_proved_interval_proves_what_is_required() -> None:
    proved = 0
    for seed in range(60):
        required = np.random.default_rng(seed).uniform(0.0, 0.5)
        question, path = asked(seed, required)
        good, claims = recorded(by_all_corners(question.about(path).task), path)
        if good:
            proved += 1
            assert claims.min() >= required
    assert proved > 30
