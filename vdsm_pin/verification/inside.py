"""Whether the arm is inside a mesh: where its base is as the motion begins.

The arm is connected and the clearance proof keeps its axis off the surface, so one
point of one row decides for the whole motion, also where the mesh moves. What links
carry may be apart from them, and some links may not be held off the mesh: there a point
of each body decides. Where the inside of a mesh cannot be told, the arm is outside if
it is proved to keep its clearance from the mesh's hull.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Final, TypeAlias

import numpy as np

from vdsm_pin.arm.bodies import ArmBody
from vdsm_pin.arm.kinematics import joint_centres, link_frames
from vdsm_pin.errors import OutOfTime
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Mesh
from vdsm_pin.geometry.winding import Location, Side, locate
from vdsm_pin.problem.any_problem import AnyProblem
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Moving, Scene, solid_of, with_hulls
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.proof.terms import CERTIFIED
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.clearance import ClearanceProof, prove_clearance
from vdsm_pin.verification.records import Check, Verdict, combine

ARM_OUTSIDE: Final = "arm outside the meshes"
LINKS_OUTSIDE: Final = "links outside the meshes"
"""Names of the row of evidence: of a snake arm, and of any other robot."""

Enclosed: TypeAlias = Mapping[str, Mapping[str, FloatArray]]
"""Bodies inside a mesh, by its name and theirs, each with a point there; base frame."""

VERDICTS: Final = {
    Side.INSIDE: Verdict.REFUTED,
    Side.UNKNOWN: Verdict.UNDECIDED,
    Side.OUTSIDE: Verdict.CERTIFIED,
}


def locate_start(
    problem: PlanningProblem, trajectory: Trajectory
) -> dict[str, Location]:
    """On which side of each mesh that may have an inside the arm begins.

    A mesh has the location of the first point of the arm that is inside it; of the
    first point whose side is not known where none is inside.

    Returns:
        Locations by name of the mesh.
    """
    return {
        mesh.name: worst_location(
            [
                locate(mesh.closed_mesh, point, radius)
                for point, radius in _points(problem, trajectory, mesh.name)
            ]
        )
        for mesh in map(solid_of, problem.scene.obstacles)
        if isinstance(mesh, Mesh) and not mesh.is_surface
    }


def worst_location(found: Sequence[Location]) -> Location:
    """The worst of some locations: inside before unknown before outside.

    Args:
        found: Any number; the result is outside where there are none.
    """
    order = list(VERDICTS)
    none = Location(Side.OUTSIDE)
    return min(found, key=lambda one: order.index(one.side), default=none)


def _points(
    problem: PlanningProblem, trajectory: Trajectory, mesh: str
) -> list[tuple[FloatArray, float]]:
    """Points at the first row in a mesh's frame, and how far off it they stay; [m].

    O_1 for links, tool and feed where all of them are held off the mesh, otherwise the
    middle of each that is; the middle of everything that is carried.
    """
    arm = problem.manipulator
    bodies = _middles(problem, trajectory)
    own = [body for body, _ in bodies if not body.carried]
    points = []
    if not any(arm.ignores(body.name, mesh) for body in own):
        thinnest = min(body.ball for body in own)
        points.append((_origin(problem, trajectory), thinnest))
        bodies = [one for one in bodies if one[0].carried]
    points += [
        (middle, body.ball + problem.required_clearance)
        for body, middle in bodies
        if not arm.ignores(body.name, mesh)
    ]
    pose = _pose_at_start(problem, trajectory, mesh)
    return [(_seen_from(pose, point), off) for point, off in points]


def _origin(problem: PlanningProblem, trajectory: Trajectory) -> FloatArray:
    """O_1 at the first row, shape (3,); [m]."""
    return np.array([trajectory.x0[0], 0.0, 0.0])


def _middles(
    problem: PlanningProblem, trajectory: Trajectory
) -> list[tuple[ArmBody, FloatArray]]:
    """Each body of the arm with the middle of its corners at the first row; [m]."""
    row = [0]
    joints = trajectory.x0[row], trajectory.alpha[row], trajectory.theta[row]
    centres = joint_centres(problem.manipulator, *joints)[0]
    frames = link_frames(*joints[1:])[0]
    found = []
    for body in problem.manipulator.convex_bodies:
        turned = frames[body.link - 1] if body.link else np.eye(3)
        middle = turned @ body.corners.mean(axis=0)
        found.append((body, centres[max(0, body.link - 1)] + middle))
    return found


def _seen_from(pose: FloatArray, point: FloatArray) -> FloatArray:
    """A point of the base frame in the frame that stands at a pose, shape (3,); [m]."""
    return np.asarray((point - pose[:3, 3]) @ pose[:3, :3])


def bodies_inside(
    problem: PlanningProblem, trajectory: Trajectory, meshes: Collection[str]
) -> Enclosed:
    """The bodies of the arm that begin inside some meshes.

    A body that is left out reaches out through the surface of the mesh; its clearance
    is the distance from that surface.

    Args:
        problem: Arm and scene.
        trajectory: The motion, of which the first row counts.
        meshes: Names of meshes that the arm is inside of.
    """
    solids = {one.name: solid_of(one) for one in problem.scene.obstacles}
    middles = _middles(problem, trajectory)
    found: dict[str, dict[str, FloatArray]] = {}
    for name in meshes:
        mesh, pose = solids[name], _pose_at_start(problem, trajectory, name)
        assert isinstance(mesh, Mesh)
        sides = [
            locate(mesh.closed_mesh, _seen_from(pose, middle), np.inf).side
            for _, middle in middles
        ]
        found[name] = {
            body.name: middle
            for (body, middle), side in zip(middles, sides, strict=True)
            if side is Side.INSIDE
        }
    return found


def _pose_at_start(
    problem: PlanningProblem, trajectory: Trajectory, name: str
) -> FloatArray:
    """T_base_obstacle at the first row, shape (4, 4); [m]."""
    one = next(one for one in problem.scene.obstacles if one.name == name)
    if not isinstance(one, Moving) or trajectory.times is None:
        return np.eye(4)
    return np.asarray(one.poses(trajectory.times[:1])[0])


def unlocated(located: Mapping[str, Location]) -> tuple[str, ...]:
    """Names of the meshes whose inside cannot be told."""
    found = located.items()
    return tuple(name for name, where in found if where.side is Side.UNKNOWN)


def locate_arm(
    problem: PlanningProblem,
    trajectory: Trajectory,
    errors: ErrorBox,
    deadline: Deadline = NO_LIMIT,
) -> dict[str, Location]:
    """On which side of each mesh that may have an inside the arm is, by its name.

    Args:
        problem: Arm, scene, required clearance.
        trajectory: The motion.
        errors: The result holds for every motion within this error box.
        deadline: What is not proved by then stays unknown.
    """
    found = locate_start(problem, trajectory)
    doubtful = unlocated(found)
    if not doubtful:
        return found
    scene = Scene(tuple(o for o in problem.scene.obstacles if o.name in doubtful))
    hulls = replace(problem, scene=with_hulls(scene, doubtful))
    proof = prove_clearance(hulls, trajectory, errors, deadline=deadline)
    clear = _clear_of(doubtful, proof)
    if proof.late:
        late = f"; {OutOfTime(deadline.limit)}"
        found = {n: one._replace(reason=one.reason + late) for n, one in found.items()}
    return found | dict.fromkeys(clear, Location(Side.OUTSIDE))


def _clear_of(names: Collection[str], proof: ClearanceProof) -> tuple[str, ...]:
    """Which obstacles every body held off them is proved to keep its clearance from."""
    near = {
        pair.obstacle
        for pair, counts in zip(proof.pairs, proof.counts, strict=True)
        if counts[CERTIFIED] < counts.sum()
    }
    return tuple(name for name in names if name not in near)


def arm_inside(located: Mapping[str, Location]) -> tuple[str, ...]:
    """Names of the meshes that the arm is inside of."""
    found = located.items()
    return tuple(name for name, where in found if where.side is Side.INSIDE)


def check_inside(
    located: Mapping[str, Location], name: str = ARM_OUTSIDE
) -> tuple[Check, ...]:
    """The row of evidence that no body held apart from a mesh is inside it.

    Args:
        located: What `locate_arm` found.
        name: Of the row.

    Returns:
        One row for all meshes that may have an inside; none without.
    """
    if not located:
        return ()
    verdict = combine(tuple(VERDICTS[found.side] for found in located.values()))
    bad = {
        name: found
        for name, found in located.items()
        if VERDICTS[found.side] is verdict is not Verdict.CERTIFIED
    }
    return (
        Check(
            name=name,
            verdict=verdict,
            count=len(located),
            worst=float(len(bad)),
            limit=0.0,
            unit="-",
            where="; ".join(found.words(name) for name, found in bad.items()),
            moment=0.0 if bad else float("nan"),
        ),
    )


def surfaces(problem: AnyProblem) -> tuple[str, ...]:
    """Names of the meshes that count as surfaces only: the file says `solid: false`."""
    meshes = (s for s in map(solid_of, problem.scene.obstacles) if isinstance(s, Mesh))
    return tuple(mesh.name for mesh in meshes if mesh.is_surface)


def mesh_notes(problem: AnyProblem) -> tuple[str, ...]:
    """What a reader must know of the meshes: surfaces only, and gaps that were joined.

    Args:
        problem: The scene.
    """
    notes = [
        f"{name!r} is a surface only, as the problem says: it has no inside"
        for name in surfaces(problem)
    ]
    for mesh in map(solid_of, problem.scene.obstacles):
        if isinstance(mesh, Mesh) and not mesh.is_surface:
            gap, closed = mesh.closed_mesh.gap, mesh.closed_mesh.closed
            if closed and gap > TOLERANCES.mesh_flat * mesh.closed_mesh.size:
                notes.append(
                    f"gaps of {mesh.name!r}, up to {gap * MM_PER_M:.2g} mm wide, were "
                    "joined to tell its inside; distances are those of its triangles"
                )
    return tuple(notes)
