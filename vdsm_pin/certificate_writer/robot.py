"""The certificate of a robot's motion: what stands above the lines of its proof."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from vdsm_pin.certificate_writer.arm import (
    errors_beside,
    joined_corners,
    pieces_of_obstacles,
)
from vdsm_pin.certificate_writer.lines import (
    Hashes,
    Recorded,
    check_certified,
    write_lines,
)
from vdsm_pin.certificate_writer.links import Covers, link_pieces, links_of_others
from vdsm_pin.certificate_writer.schema import Pair, RobotErrors, RobotHeaderLine
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.trajectory import JOINED
from vdsm_pin.proof.bodies import Body, PairTable
from vdsm_pin.proof.budget import Budget
from vdsm_pin.robots.cell import Cell, joint_errors
from vdsm_pin.robots.files import HULLS
from vdsm_pin.robots.inside import at_start, question_of_hulls, unlocated_pairs
from vdsm_pin.robots.judgement import RobotVerification
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.moving import joined_path


def write_robot_certificate(
    path: Path,
    verification: RobotVerification,
    hashes: Hashes,
    topic: str | None = None,
    deadline: Deadline = NO_LIMIT,
) -> None:
    """Write the proof of a certified motion of a robot.

    Args:
        path: The file; it appears whole or not at all.
        verification: Of the same problem and trajectory files.
        hashes: Of the files.
        topic: Of the trajectory file, where it is a bag.
        deadline: When to give up; there is no file then.

    Raises:
        OutOfTime: If the time is over.
        VerificationFailed: If the motion is not certified: there is nothing to write.
        InvalidFile: If the file cannot be written.
    """
    check_certified(verification)
    cell, motion = verification.problem, verification.trajectory
    bodies, errors = cell.asked.bodies, verification.errors
    whole, knots = joined_path(motion, cell.scene)
    # Of a mesh without known inside the hull is proved clear, by planes for all of it.
    hulled = unlocated_pairs(at_start(cell, whole))
    asked = AskedMotion(cell.asked, whole, knots, errors).question
    if hulled:
        asked = question_of_hulls(cell, hulled, errors)
    proving, plan = asked.about(whole, Budget(until=deadline.end)), asked.plan
    pieces, n_links = proving.task.pieces, len(cell.robot.bodies)
    meshes = dict.fromkeys(cell.asked.table.one[hulled].tolist())
    n_bodies, places = len(bodies) + len(meshes), asked.places
    of_obstacles = places[n_links : len(bodies)]
    obstacles = [*zip(of_obstacles, cell.scene.obstacles, strict=True)]
    header = RobotHeaderLine(
        **hashes.as_json(),
        interpolation=JOINED[motion.degree],
        pairs=_pairs(plan.bodies[n_bodies:], plan.bodies, plan.pairs),
        pieces=pieces_of_obstacles(obstacles, pieces),
        joined=joined_corners(cell.scene),
        errors=_errors(cell, errors),
        links={
            **dict(link_pieces(_covered(cell), places[:n_links], pieces)),
            **links_of_others(obstacles, pieces),
        },
        topic=topic,
    )
    one_plane = np.zeros(len(pieces.root), np.int64)
    for place, number in zip(places[len(bodies) :], meshes, strict=True):
        one_plane[place] = len(bodies[number].pieces)
    proof = Recorded(proving.task, proving.motion, one_plane)
    write_lines(path, header, proof, deadline)


def _covered(cell: Cell) -> Iterator[tuple[str, Covers]]:
    """Each link with what covers its meshes; nothing where each is one hull."""
    robot = cell.robot
    for body in robot.bodies:
        covers = () if robot.solids == HULLS else robot.covers.get(body.name, ())
        yield body.name, covers


def _errors(cell: Cell, errors: ErrorBox) -> RobotErrors:
    """Of each joint by its name and unit, of the base and of the obstacles."""
    joints = cell.robot.joints
    values = zip(joints, joint_errors(joints, errors).tolist(), strict=True)
    by_unit: dict[str, dict[str, float]] = {"rad": {}, "m": {}}
    for joint, error in values:
        by_unit[joint.unit][joint.name] = error
    return RobotErrors(
        joints_rad=by_unit["rad"],
        joints_m=by_unit["m"],
        **errors_beside(errors, cell.scene),
    )


def _pairs(parts: list[Body], bodies: list[Body], pairs: PairTable) -> list[Pair]:
    """The convex part of a link that moves, and what it is proved clear of."""
    count, seen = Counter(part.name for part in parts), Counter[str]()
    names = [body.name for body in bodies]
    for k, part in enumerate(parts, start=len(bodies) - len(parts)):
        seen[part.name] += 1
        if count[part.name] > 1:
            names[k] = f"{part.name} part {seen[part.name]}"
    both = zip(pairs.one.tolist(), pairs.other.tolist(), strict=True)
    return [(names[one], names[other]) for one, other in both]
