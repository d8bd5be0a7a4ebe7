"""What the scene of a problem consists of, an obstacle a row."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from vdsm_pin.geometry.solids import ConvexCover, Mesh, Solid
from vdsm_pin.io.source import BLOCK
from vdsm_pin.problem.any_problem import AnyProblem, ProblemSource
from vdsm_pin.problem.scene import Moving, Obstacle, Scene, solid_of
from vdsm_pin.report.words import counted

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
