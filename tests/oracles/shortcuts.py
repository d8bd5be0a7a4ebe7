"""What many tests ask of the package in one step, and no command does."""

from collections.abc import Sequence
from pathlib import Path as File
from typing import Any

from vdsm_pin.geometry.arrays import IntArray
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.problem.scene import Scene
from vdsm_pin.proof.bodies import Body, ErrorBox, Pair, PairTable
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.proofs import Proof
from vdsm_pin.proof.proving import Proving
from vdsm_pin.proof.question import Question
from vdsm_pin.proof.tree import Tree
from vdsm_pin.robots.model import Robot
from vdsm_pin.robots.scene_files import read_scene_with_files
from vdsm_pin.robots.trajectory_files import joint_path, read_motion


def start_proof(
    tree: Tree,
    bodies: Sequence[Body],
    path: Path,
    pairs: Sequence[Pair] | PairTable,
    errors: ErrorBox | None = None,
    budget: Budget | None = None,
    columns: IntArray | None = None,
) -> Proving:
    """Everything ready, nothing judged."""
    table = pairs if isinstance(pairs, PairTable) else PairTable.of(pairs)
    return Question.of(tree, bodies, table, errors, columns).about(path, budget)


def prove(*asked: Any, **more: Any) -> Proof:
    """All of it judged, as `start_proof` is asked."""
    return start_proof(*asked, **more).prove()


def read_scene(path: File, robot_size: float) -> Scene:
    """The obstacles of a file alone."""
    return read_scene_with_files(path, robot_size)[0]


def named(path: Path) -> JointTrajectory:
    """The rows of a path that straight lines join, by any names."""
    assert path.degree == 1
    columns = range(path.knots.shape[1])
    return JointTrajectory(tuple(map(str, columns)), path.knots, path.times)


def read_rows(file: File, robot: Robot, topic: str | None = None) -> JointTrajectory:
    """The trajectory of a robot in a file."""
    return read_motion(file, robot.joints, topic, robot.values)


def read_path(file: File, robot: Robot, topic: str | None = None) -> Path:
    """A trajectory as the controller of a robot runs it."""
    return joint_path(file, read_rows(file, robot, topic))
