"""The certificate of a motion: what stands above the lines of its proof.

The format is docs/certificate.md.
"""

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vdsm_pin.certificate_writer.lines import (
    Hashes,
    Recorded,
    check_certified,
    write_lines,
)
from vdsm_pin.certificate_writer.pieces import (
    Covers,
    joined_corners,
    link_pieces,
    links_of_others,
    pieces_carried,
    pieces_of_obstacles,
)
from vdsm_pin.certificate_writer.schema import (
    AnyHeader,
    ErrorLimits,
    HeaderLine,
    Pair,
    RobotErrors,
    RobotHeaderLine,
)
from vdsm_pin.proof.budget import Budget
from vdsm_pin.proof.parts import PartPlan
from vdsm_pin.proof.recording import by_all_corners
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.verification.asked_motion import AskedMotion
from vdsm_pin.verification.inside import (
    located_at_start,
    question_of_hulls,
    unlocated,
)
from vdsm_pin.verification.moving import joined_path
from vdsm_pin.verification.records import ArmVerification, Verification


def write_certificate(
    path: Path,
    verification: Verification,
    hashes: Hashes,
    deadline: Deadline = NO_LIMIT,
    topic: str | None = None,
) -> None:
    """Write the proof of a certified motion.

    Args:
        path: The file; it appears whole or not at all.
        verification: Of the same problem and trajectory files.
        hashes: Of the files.
        deadline: When to give up; there is no file then.
        topic: Of a robot's trajectory file, where it is a bag.

    Raises:
        OutOfTime: If the time is over.
        VerificationFailed: If the motion is not certified: there is nothing to write.
        InvalidFile: If the file cannot be written.
    """
    check_certified(verification)
    until = Budget(until=deadline.end)
    if isinstance(verification, ArmVerification):
        header, proof = _of_arm(verification, hashes, until)
    else:
        header, proof = _of_robot(verification, hashes, until, topic)
    write_lines(path, header, proof, deadline)


def _of_arm(
    verification: ArmVerification, hashes: Hashes, budget: Budget
) -> tuple[AnyHeader, Recorded]:
    """The header and the proof of a snake arm's motion."""
    problem, box = verification.problem, verification.errors
    motion = AskedMotion.of_arm(problem, verification.trajectory, box)
    told, proof = _proved(motion, hashes, [()] * len(motion.asked.own), budget)
    told["pieces"] |= pieces_carried(problem.manipulator.bodies)
    angles = box.angles(problem.manipulator.n_links).ravel().tolist()
    return HeaderLine(
        **told,
        interpolation=verification.trajectory.interpolation,
        errors=ErrorLimits(joints_rad=angles, **_errors_beside(motion)),
    ), proof


def _of_robot(
    verification: Verification, hashes: Hashes, budget: Budget, topic: str | None
) -> tuple[AnyHeader, Recorded]:
    """The same of any other robot's, its long intervals uncut."""
    from vdsm_pin.robots.cell import joint_errors
    from vdsm_pin.robots.files import HULLS
    from vdsm_pin.robots.judgement import RobotVerification

    assert isinstance(verification, RobotVerification)
    cell, path = verification.problem, verification.trajectory.path
    robot, whole = cell.robot, joined_path(path, cell.scene)
    motion = AskedMotion(cell.asked, *whole, verification.errors)
    known = {} if robot.solids == HULLS else robot.covers
    covers = [known.get(body.name, ()) for body in robot.bodies]
    told, proof = _proved(motion, hashes, covers, budget)
    errors = joint_errors(robot.joints, verification.errors).tolist()
    units: dict[str, dict[str, float]] = {"rad": {}, "m": {}}
    for joint, error in zip(robot.joints, errors, strict=True):
        units[joint.unit][joint.name] = error
    return RobotHeaderLine(
        **told,
        interpolation=verification.trajectory.interpolation,
        errors=RobotErrors(
            joints_rad=units["rad"], joints_m=units["m"], **_errors_beside(motion)
        ),
        topic=topic,
    ), proof


def _errors_beside(motion: AskedMotion) -> dict[str, Any]:
    """How far base and obstacles may be off, as every header has it."""
    errors = motion.errors
    off = map(errors.of_obstacle, motion.asked.scene.names)
    return {
        "base": (errors.base, errors.base_turn),
        "obstacles": {one.name: (one.shift, one.turn) for one in off},
    }


def _proved(
    motion: AskedMotion, hashes: Hashes, covers: Sequence[Covers], budget: Budget
) -> tuple[dict[str, Any], Recorded]:
    """What every header says of the files and of what is proved, and the proof.

    Of a mesh without known inside the hull is proved clear, by planes for all of it.

    Args:
        motion: What is asked.
        hashes: Of the files.
        covers: Of the meshes of each of its own bodies; none where each is one hull.
        budget: How long the proof may take.
    """
    asked, bodies = motion.asked, motion.asked.bodies
    hulled = unlocated(located_at_start(motion))
    question = question_of_hulls(motion, hulled) if hulled else motion.question
    proving, places = question.about(motion.path, budget), question.places
    meshes = dict.fromkeys(asked.table.one[hulled].tolist())
    pieces = proving.task.pieces
    whole = np.zeros(len(pieces.root), np.int64)
    for place, number in zip(places[len(bodies) :], meshes, strict=True):
        whole[place] = len(bodies[number].pieces)
    own, others = places[: len(asked.own)], places[len(asked.own) : len(bodies)]
    obstacles = [*zip(others, asked.scene.obstacles, strict=True)]
    # Of a mesh that every pair is held off by its hull no plane counts the triangles.
    by_hull = {*meshes} - {*np.delete(asked.table.one, hulled).tolist()}
    names = {bodies[number].name for number in by_hull}
    counted = [one for one in obstacles if one[1].name not in names]
    links = zip((body.name for body in asked.own), covers, strict=True)
    return {
        **hashes.as_json(),
        "pairs": _pairs(question.plan, len(places)),
        "pieces": pieces_of_obstacles(counted, pieces),
        "joined": joined_corners(asked.scene),
        "links": {
            **dict(link_pieces(links, own, pieces)),
            **links_of_others(obstacles, pieces),
        },
    }, Recorded(by_all_corners(proving.task), proving.motion, whole)


def _pairs(plan: PartPlan, n_bodies: int) -> list[Pair]:
    """The convex part of a body that moves, and what it is proved clear of.

    Args:
        plan: How the pairs are asked.
        n_bodies: Bodies before the parts of those with several.
    """
    names = [body.name for body in plan.bodies]
    count, seen = Counter(names[n_bodies:]), Counter[str]()
    for k, name in enumerate(names[n_bodies:], start=n_bodies):
        seen[name] += 1
        if count[name] > 1:
            names[k] = f"{name} part {seen[name]}"
    both = zip(plan.pairs.one.tolist(), plan.pairs.other.tolist(), strict=True)
    return [(names[one], names[other]) for one, other in both]
