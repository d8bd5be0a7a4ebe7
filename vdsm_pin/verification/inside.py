"""Whether the arm is inside a mesh: where its base is as the motion begins.

The arm is connected and the clearance proof keeps its axis off the surface, so one
point of one row decides for the whole motion.
"""

from collections.abc import Mapping
from typing import Final

import numpy as np

from vdsm_pin.geometry.winding import Location, Side, locate
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.scene import Mesh
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.trajectory import Trajectory
from vdsm_pin.units import MM_PER_M
from vdsm_pin.verification.records import Check, Verdict, combine

NAME: Final = "arm outside the meshes"
"""Name of the row."""

VERDICTS: Final = {
    Side.INSIDE: Verdict.REFUTED,
    Side.UNKNOWN: Verdict.UNDECIDED,
    Side.OUTSIDE: Verdict.CERTIFIED,
}


def locate_arm(problem: PlanningProblem, trajectory: Trajectory) -> dict[str, Location]:
    """Where the arm is as seen from each mesh that may have an inside, by its name."""
    base = np.array([trajectory.x0[0], 0.0, 0.0])
    radius = problem.manipulator.least_radius
    return {
        mesh.name: locate(mesh.closed_mesh, base, radius)
        for mesh in problem.scene.obstacles
        if isinstance(mesh, Mesh) and not mesh.is_surface
    }


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
