"""Motions of snake arms and of other robots: how they are read, and what they lack."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, TypeAlias, TypeVar

from vdsm_pin.errors import InvalidFile, InvalidInput
from vdsm_pin.io.trajectory_file import Interpolation
from vdsm_pin.notebook import known_as
from vdsm_pin.problem.joint_trajectory import JointTrajectory
from vdsm_pin.problem.scene import Scene
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.moving import untimed

T = TypeVar("T")


Motion: TypeAlias = Trajectory | JointTrajectory
"""A motion of a snake arm, or of any other robot."""


@dataclass(frozen=True)
class MotionOptions:
    """How a motion is read from its file, and when work on it must end.

    Args:
        deadline: What is not judged by then is undecided.
        interpolation: What joins the rows of the file.
        topic: Topic of a bag that holds the motion of another robot; None for the
            only one.
    """

    deadline: Deadline = NO_LIMIT
    interpolation: Interpolation = "auto"
    topic: str | None = None


NO_OPTIONS: Final = MotionOptions()
"""No time limit; the file itself says what joins its rows."""


def expect(value: Any, kind: type[T], how: str) -> T:
    """The value itself, if it has the expected type.

    Args:
        value: Any object that a caller passed.
        kind: The expected type.
        how: Python that makes a value of this type, for the message.

    Raises:
        InvalidInput: If the value has another type.
    """
    if not isinstance(value, kind):
        found = known_as(type(value))
        message = f"expected {known_as(kind)}, as of {how}; found {found}"
        raise InvalidInput(message)
    return value


def check_times(file: Path, scene: Scene, motion: Motion) -> None:
    """Refuse a motion without times in a scene where obstacles move.

    Raises:
        InvalidFile: If obstacles move and the motion has no times.
    """
    if why := untimed(scene, motion):
        raise InvalidFile(file=file, where="line 1", fault=why)
