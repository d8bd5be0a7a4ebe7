"""Other robots of a problem: links that move by a trajectory of their own."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final, cast

from vdsm_pin.geometry.convex import FlatCylinder, Hull
from vdsm_pin.geometry.solids import ConvexCover
from vdsm_pin.problem.scene import Carrier, Moving
from vdsm_pin.proof.paths import Path
from vdsm_pin.proof.tree import Tree
from vdsm_pin.robots.files import CellFile
from vdsm_pin.robots.model import Robot
from vdsm_pin.robots.trajectory_files import path_of, read_motion
from vdsm_pin.robots.urdf import robot_of

HELD: Final = (
    "is judged by its limits and its clearance from this robot alone: clearances "
    "between its own links and from obstacles are not judged"
)


@dataclass(frozen=True, eq=False)
class OtherRobot:
    """Another robot, and how it moves.

    Args:
        name: Of the robot in its problem.
        robot: On a base of its own.
        path: Its motion, with times.
        links: Its bodies as obstacles.
        notes: What a reader should know, a sentence each.
    """

    name: str
    robot: Robot
    path: Path
    links: tuple[Moving, ...]
    notes: tuple[str, ...]


def read_other(file: CellFile, number: int) -> OtherRobot:
    """One of the other robots of a problem file.

    Args:
        file: The problem.
        number: Which one, from 0.

    Raises:
        InvalidFile: If one of its files breaks its contract, or its trajectory has no
            times.
    """
    one = file.others[number]
    robot = robot_of(one.robot)
    motion = read_motion(one.trajectory, robot.joints, one.topic, robot.values)
    path = path_of(one.trajectory, motion)
    if path.times is None:
        problem = f"{one.trajectory.name!r} has no times, which it needs"
        raise file.document.invalid(("others", number, "trajectory"), problem)
    base, *joints = robot.tree.joints
    tree = Tree((replace(base, placement=one.pose), *joints))
    links = tuple(_links(one.name, robot, Carrier(tree, path, one.name)))
    said = (HELD, *robot.notes, *(f"trajectory: {note}" for note in motion.notes))
    notes = tuple(f"{one.name}: {note}" for note in said)
    return OtherRobot(one.name, robot, path, links, notes)


def _links(name: str, robot: Robot, carrier: Carrier) -> Iterator[Moving]:
    for body in robot.bodies:
        pieces = cast("tuple[Hull | FlatCylinder, ...]", tuple(body.pieces))
        cover = ConvexCover(f"{name}: {body.name}", pieces)
        yield Moving(cover, carrier, body.frame)
