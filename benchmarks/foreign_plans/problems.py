"""MotionBenchMaker's problems, read from a folder that the environment names."""

import os
import tarfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import yaml

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import FloatArray

FOLDER: Final = "VDSM_MOTION_BENCH_MAKER"
"""Environment variable: folder of ROBOT/{ROBOT.urdf, ROBOT.srdf, problems.tar.bz2}."""

ARMS: Final = {"panda": "panda_arm", "ur5": "manipulator"}
"""Of each robot the group of joints that is planned for; its base stands."""

ROBOTS: Final = tuple(ARMS)


@dataclass(frozen=True)
class Problem:
    """One start and goal of one robot in one scene.

    Args:
        robot: Name of the robot.
        family: Name of the set.
        number: Within the set, from 1.
        scene: A PlanningScene as YAML.
        start: Values of the joints by name; [rad].
        goal: Of the joints that the goal names; [rad].
    """

    robot: str
    family: str
    number: int
    scene: Path
    start: dict[str, float]
    goal: dict[str, float]

    def ends(self, names: tuple[str, ...]) -> tuple[FloatArray, FloatArray]:
        """Start and goal in the order of the robot's joints; [rad]."""
        both = {**self.start, **self.goal}
        first = np.array([self.start[name] for name in names])
        return first, np.array([both[name] for name in names])


def source(robot: str) -> Path:
    """The folder of a robot.

    Raises:
        InvalidInput: If the environment names no such folder.
    """
    stated = os.environ.get(FOLDER, "")
    folder = Path(stated) / robot
    if not stated or not (folder / "problems.tar.bz2").is_file():
        message = (
            f"{FOLDER} is {stated!r}, expected a folder with {robot}/{robot}.urdf, "
            f"{robot}/{robot}.srdf and {robot}/problems.tar.bz2"
        )
        raise InvalidInput(message)
    return folder


def problems(robot: str, per_set: int, aside: Path) -> Iterator[Problem]:
    """The first problems of each set.

    Args:
        robot: Which robot's.
        per_set: How many.
        aside: Where scenes are unpacked.
    """
    with tarfile.open(source(robot) / "problems.tar.bz2") as archive:
        archive.extractall(aside, filter="data")
    for scene in sorted(aside.rglob("scene*.yaml")):
        number = int(scene.stem.removeprefix("scene"))
        if number <= per_set:
            request = load(scene.with_name(f"request{number:04d}.yaml"))
            state = request["start_state"]["joint_state"]
            (constraints,) = request["goal_constraints"]
            goal = constraints["joint_constraints"]
            yield Problem(
                robot=robot,
                family=scene.parent.name.removesuffix(f"_{robot}"),
                number=number,
                scene=scene,
                start=dict(zip(state["name"], state["position"], strict=True)),
                goal={one["joint_name"]: one["position"] for one in goal},
            )


def load(path: Path) -> Any:
    """The content of a YAML file."""
    return yaml.load(path.read_text(encoding="utf-8"), yaml.CSafeLoader)
