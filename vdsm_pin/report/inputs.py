"""What a verdict is about: the obstacles, and what was odd or assumed in the files."""

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from vdsm_pin.arm.bodies import convex_cover
from vdsm_pin.arm.mounted import LinkBody
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import ConvexCover, FromFile, Mesh, Solid
from vdsm_pin.io.source import BLOCK
from vdsm_pin.problem.any_problem import AnyProblem, ProblemSource
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Moving, Obstacle, Scene, solid_of
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.words import counted
from vdsm_pin.verification.inside import mesh_notes

_NAMED: Final = 3
"""Sizes that one line names; the JSON files have all of them."""

BEHIND: Final = (
    "not checked: what lies behind the base; the arm is judged from O₁ to its tip, and "
    "the problem states no `feed`"
)
"""Where there are obstacles, one may stand in the way of the feed."""


def assumed_sizes(problem: AnyProblem) -> tuple[str, ...]:
    """The solids whose unit nobody states, with the size they were taken to have."""
    found = (one for one in _from_files(problem) if one.assumed_size)
    return tuple(f"{one.name!r} is {one.assumed_size}" for one in found)


def _from_files(problem: AnyProblem) -> Iterator[FromFile]:
    """What stands in files of its own: obstacles, and what an arm carries."""
    bodies = problem.manipulator.bodies if isinstance(problem, PlanningProblem) else ()
    carried = (body.solid for body in bodies)
    for one in (*map(solid_of, problem.scene.obstacles), *carried):
        if isinstance(one, FromFile):
            yield one


def assumption(sizes: Sequence[str]) -> str:
    """The same in one phrase; empty where nothing was assumed."""
    if not sizes:
        return ""
    more = len(sizes) - _NAMED
    named = ", ".join(sizes[:_NAMED]) + (f" and {more} more" if more > 0 else "")
    return f"assuming that {named}; no unit is stated"


def input_notes(problem: PlanningProblem, trajectory: Trajectory) -> tuple[str, ...]:
    """What the readers have to say and what is behind the base, a sentence each."""
    of_rows = (f"trajectory: {note}" for note in trajectory.notes)
    of_time = (*_pieces(trajectory), *longer_motions(problem, trajectory.times))
    unknown = problem.scene.obstacles and not problem.manipulator.feed
    behind = (BEHIND,) if unknown else ()
    notes = (*behind, *_covers(problem), *mesh_notes(problem))
    return (*notes, *of_time, *file_notes(problem), *of_rows)


def file_notes(problem: AnyProblem) -> Iterator[str]:
    """What the readers of other robots, meshes and clouds say, a sentence each."""
    for carrier in problem.scene.carriers:
        yield from carrier.itself.notes
    for one in _from_files(problem):
        kind = "mesh" if isinstance(one, Mesh) else "cloud"
        yield from (f"{kind} {one.name!r}: {note}" for note in one.notes)


def _pieces(trajectory: Trajectory) -> tuple[str, ...]:
    """What joins the rows, where it is not straight lines."""
    if not trajectory.is_smooth:
        return ()
    kind = trajectory.interpolation
    more = "" if trajectory.changes is None else " and accelerations"
    text = f"{kind} pieces join the waypoints, by their velocities{more}: the curve is "
    return (text + "judged, not its chords",)


def longer_motions(problem: AnyProblem, times: FloatArray | None) -> Iterator[str]:
    """Obstacles that move on while the motion is over, or has not begun.

    Args:
        problem: Has the obstacles.
        times: Of the trajectory's waypoints; [s].
    """
    if times is None:
        return
    begin, end = times[0], times[-1]
    carried = {id(one.carrier): one for one in reversed(problem.scene.moving)}
    for one in reversed(carried.values()):
        own = one.carrier.path.own_times
        if own[0] < begin or own[-1] > end:
            yield (
                f"{one.name!r} moves from {own[0]:g} s to {own[-1]:g} s; judged is the "
                f"time of the trajectory, {begin:g} s to {end:g} s"
            )


def _covers(problem: PlanningProblem) -> tuple[str, ...]:
    """What is proved clear in the place of meshes that links carry."""
    bodies = problem.manipulator.bodies
    meshes = [body for body in bodies if isinstance(body.solid, Mesh)]
    return tuple(
        f"{body.name!r} is judged by {_hulls(body, len(convex_cover(body)))}"
        for body in meshes
    )


def _hulls(body: LinkBody, count: int) -> str:
    if count == 1:
        return "the convex hull around its triangles"
    assert isinstance(body.solid, Mesh)
    if body.solid.is_surface:
        return f"{count} convex hulls around its triangles, as a surface only"
    return f"{count} convex hulls, which hold its triangles and what they enclose"


MOST_LISTED: Final = 200
"""Obstacles that a page lists."""

CHANGED: Final = "the file changed after it was read"


@dataclass(frozen=True)
class SceneRow:
    """One obstacle.

    Args:
        name: As the problem file has it.
        shape: Its kind, such as "half space" or "box, moving".
        file: The file of its own that it was read from; empty for none.
        triangles: Of a mesh; None for other shapes.
        inside: Whether it has one: "solid", "surface only", "not known".
        sha256: Of its file, in hexadecimal, or why there is none; empty without a file.
    """

    name: str
    shape: str
    file: str
    triangles: int | None
    inside: str
    sha256: str


def scene_words(scene: Scene) -> str:
    """What stands around a robot: "2 obstacles and 1 other robot of 4 links"."""
    links = [one.carrier.robot for one in scene.moving if one.carrier.robot]
    words = [counted(len(scene.obstacles) - len(links), "obstacle")]
    if links:
        robots = counted(len(set(links)), "other robot")
        words.append(f"{robots} of {counted(len(links), 'link')}")
    return " and ".join(words)


def scene_rows(problem: AnyProblem) -> tuple[SceneRow, ...]:
    """The first obstacles of a problem, `MOST_LISTED` at most."""
    source = problem.source
    listed = problem.scene.obstacles[:MOST_LISTED]
    files = dict(source.of_obstacles) if source else {}
    named = any(one.name in files for one in listed)
    digests = _digests(source) if source and named else {}
    return tuple(_row(one, files.get(one.name), digests) for one in listed)


def _row(obstacle: Obstacle, file: Path | None, digests: dict[Path, str]) -> SceneRow:
    solid: Solid | ConvexCover = solid_of(obstacle)
    kind = "Link" if isinstance(solid, ConvexCover) else type(solid).__name__
    shape = "".join(f" {c.lower()}" if c.isupper() else c for c in kind).strip()
    shape += ", moving" if isinstance(obstacle, Moving) else ""
    triangles, inside = None, "solid"
    if isinstance(solid, Mesh):
        triangles = len(solid.triangles)
        inside = "solid" if solid.has_inside else "not known"
        inside = "surface only" if solid.is_surface else inside
    digest = digests.get(file, CHANGED) if file else ""
    return SceneRow(
        obstacle.name, shape, file.name if file else "", triangles, inside, digest
    )


def _digests(source: ProblemSource) -> dict[Path, str]:
    """The SHA-256 of each file that was read; none where one has changed since."""
    whole, found = hashlib.sha256(), {}
    try:
        for path in source.files:
            own = hashlib.sha256()
            with path.open("rb") as file:
                while part := file.read(BLOCK):
                    own.update(part)
                    whole.update(part)
            found[path] = own.hexdigest()
    except OSError:
        return {}
    return found if whole.hexdigest() == source.sha256 else {}
