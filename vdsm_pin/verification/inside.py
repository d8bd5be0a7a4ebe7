"""Whether the arm is inside a mesh: where its base is as the motion begins.

The arm is connected and the clearance proof keeps its axis off the surface, so one
point of one row decides for the whole motion. Where the inside of a mesh cannot be
told, the arm is outside if it is proved to keep its clearance from the mesh's hull.
"""

from collections import Counter
from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from vdsm_pin.arm_bodies import arm_bodies
from vdsm_pin.errors import OutOfTime
from vdsm_pin.geometry.winding import Location, Side, locate
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.proof.terms import CERTIFIED
from vdsm_pin.scene import Mesh, Scene, with_hulls
from vdsm_pin.time_limit import NO_LIMIT, Deadline
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.clearance import ClearanceProof, prove_clearance
from vdsm_pin.verification.records import Check, ErrorBox, Verdict, combine

NAME: Final = "arm outside the meshes"
"""Name of the row."""

VERDICTS: Final = {
    Side.INSIDE: Verdict.REFUTED,
    Side.UNKNOWN: Verdict.UNDECIDED,
    Side.OUTSIDE: Verdict.CERTIFIED,
}


def locate_start(
    problem: PlanningProblem, trajectory: Trajectory
) -> dict[str, Location]:
    """Where the first joint begins as seen from each mesh that may have an inside."""
    base = np.array([trajectory.x0[0], 0.0, 0.0])
    radius = problem.manipulator.least_radius
    return {
        mesh.name: locate(mesh.closed_mesh, base, radius)
        for mesh in problem.scene.obstacles
        if isinstance(mesh, Mesh) and not mesh.is_surface
    }


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
    """Where the arm is as seen from each mesh that may have an inside, by its name.

    Args:
        problem: Arm, scene, required clearance.
        trajectory: The motion.
        errors: Every motion within it is meant.
        deadline: What is not proved by then stays unknown.
    """
    found = locate_start(problem, trajectory)
    doubtful = unlocated(found)
    if not doubtful:
        return found
    scene = Scene(tuple(o for o in problem.scene.obstacles if o.name in doubtful))
    hulls = replace(problem, scene=with_hulls(scene, doubtful))
    proof = prove_clearance(hulls, trajectory, errors, deadline=deadline)
    clear = _clear_of(doubtful, proof, len(arm_bodies(problem.manipulator)))
    if proof.late:
        late = f"; {OutOfTime(deadline.limit)}"
        found = {n: one._replace(reason=one.reason + late) for n, one in found.items()}
    return found | dict.fromkeys(clear, Location(Side.OUTSIDE))


def _clear_of(
    names: Collection[str], proof: ClearanceProof, n_bodies: int
) -> tuple[str, ...]:
    """Which obstacles every body of the arm is proved to keep its clearance from."""
    proved = Counter(
        pair.obstacle
        for pair, counts in zip(proof.pairs, proof.counts, strict=True)
        if counts[CERTIFIED] == proof.n_intervals
    )
    return tuple(name for name in names if proved[name] == n_bodies)


def arm_inside(located: Mapping[str, Location]) -> tuple[str, ...]:
    """Names of the meshes that the arm is inside of."""
    found = located.items()
    return tuple(name for name, where in found if where.side is Side.INSIDE)


def check_inside(located: Mapping[str, Location]) -> tuple[Check, ...]:
    """The arm is not inside a mesh.

    Args:
        located: What `locate_arm` found.

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
            name=NAME,
            verdict=verdict,
            count=len(located),
            worst=float(len(bad)),
            limit=0.0,
            unit="-",
            where="; ".join(found.words(name) for name, found in bad.items()),
            moment=0.0 if bad else float("nan"),
        ),
    )


def surfaces(problem: PlanningProblem) -> tuple[str, ...]:
    """Names of the meshes of which only the surface is meant."""
    meshes = (o for o in problem.scene.obstacles if isinstance(o, Mesh))
    return tuple(mesh.name for mesh in meshes if mesh.is_surface)


def mesh_notes(problem: PlanningProblem) -> tuple[str, ...]:
    """What a reader must know of the meshes: surfaces only, and gaps that were joined.

    Args:
        problem: The scene.
    """
    notes = [
        f"{name!r} is a surface only, as the problem says: it has no inside"
        for name in surfaces(problem)
    ]
    for mesh in problem.scene.obstacles:
        if isinstance(mesh, Mesh) and not mesh.is_surface:
            gap, closed = mesh.closed_mesh.gap, mesh.closed_mesh.closed
            if closed and gap > TOLERANCES.mesh_flat * mesh.closed_mesh.size:
                notes.append(
                    f"gaps of {mesh.name!r}, up to {gap * MM_PER_M:.2g} mm wide, were "
                    "joined to tell its inside; distances are those of its triangles"
                )
    return tuple(notes)
