"""Other robots of a problem: links that move by a trajectory of their own."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import cast

from vdsm_pin.geometry.convex import FlatCylinder, Hull
from vdsm_pin.geometry.solids import ConvexCover
from vdsm_pin.io.others import HELD, OtherFile, Others
from vdsm_pin.io.source import files_in
from vdsm_pin.problem.scene import ByItself, Carrier, Moving
from vdsm_pin.proof.tree import Tree
from vdsm_pin.robots.by_itself import checks_by_itself
from vdsm_pin.robots.files import HULLS, files_of_robot
from vdsm_pin.robots.model import Robot
from vdsm_pin.robots.trajectory_files import joint_path, read_motion
from vdsm_pin.robots.urdf import read_robot


def read_other(one: OtherFile) -> Others:
    """One of the other robots of a problem file.

    Raises:
        InvalidFile: If one of its files breaks its contract.
    """
    files = files_of_robot(one.model, one.folder)
    robot = read_robot(files)
    motion = read_motion(one.trajectory, robot.joints, one.topic, robot.values)
    path = joint_path(one.trajectory, motion)
    base, *joints = robot.tree.joints
    tree = Tree((replace(base, placement=one.pose), *joints))
    said = (*robot.notes, *(f"trajectory: {note}" for note in motion.notes))
    notes = (HELD.format(one.name), *(f"{one.name}: {note}" for note in said))
    itself = ByItself(
        notes=notes,
        covers={} if robot.solids == HULLS else robot.covers,
        checks=partial(checks_by_itself, robot, path),
    )
    links = tuple(_links(robot, Carrier(tree, path, one.name, itself)))
    named = (*files.files, *robot.more_files, *files_in(one.trajectory))
    return Others(links, named, path.times is not None)


def _links(robot: Robot, carrier: Carrier) -> Iterator[Moving]:
    for body in robot.bodies:
        pieces = cast("tuple[Hull | FlatCylinder, ...]", tuple(body.pieces))
        cover = ConvexCover(f"{carrier.robot}: {body.name}", pieces)
        yield Moving(cover, carrier, body.frame)
