"""A checked problem file to a planning problem: units, frames, defaults, and sense."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.io import problem_schema as schema
from vdsm_pin.io.arm_builder import ArmBuilder
from vdsm_pin.io.errors_field import ErrorsModel
from vdsm_pin.io.frames import Frame
from vdsm_pin.io.obstacle_builder import ObstacleBuilder
from vdsm_pin.io.others import MAX_BYTES, Others
from vdsm_pin.io.path_builder import PathBuilder, spacing_of
from vdsm_pin.io.problem_errors import Gathered
from vdsm_pin.io.source import Digest, read_bytes
from vdsm_pin.io.yaml_reader import YamlDocument
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scaling import (
    OtherRatios,
    ProjectionCylinder,
    Scaling,
    ScalingCentre,
)
from vdsm_pin.problem.scene import Obstacle, Scene
from vdsm_pin.tolerances import TOLERANCES


def build_problem(
    model: schema.ProblemModel,
    document: YamlDocument,
    *,
    name: str,
    folder: Path,
    digest: Digest,
    read_others: Callable[[Frame], Others],
) -> PlanningProblem:
    """The planning problem that a file describes.

    Args:
        model: The file's content, each value checked by itself.
        document: The same with line numbers, for messages.
        name: Name of the problem where the file gives none.
        folder: Where relative mesh paths start.
        read_others: Reads the other arms and robots.
        digest: Gets the bytes of the arm's URDF, if one is named, then those of the
            meshes that links carry and those of the obstacles, in file order, then
            those of the other arms and their trajectories, then those of the path's
            files.

    Returns:
        The problem, in the base frame; [m], [rad].

    Raises:
        InvalidFile: If values that are each in range make no sense together.
    """
    frame = model.frame
    known, each = (document, frame, folder, digest), Gathered()
    self_clearance = float(frame.metres(model.required_self_clearance))

    def read_arm() -> Manipulator:
        arm = ArmBuilder(*known).build(model.manipulator)
        _check_links_apart(arm, self_clearance, frame, document)
        return arm

    arm = each.get(read_arm)
    obstacles = ObstacleBuilder(*known, arm.total_length if arm else None)
    rest = each.get(lambda: obstacles.build_scene(model.obstacles, arm))
    others = each.get(lambda: read_others(frame))
    scene = None
    if rest is not None and others is not None:
        for file in others.files:
            read = others.contents.get(file)
            digest.update(read_bytes(file, limit=MAX_BYTES) if read is None else read)
        scene = each.get(partial(joined, rest, others.bodies, document))
    each.get(lambda: _check_ends(model, document))
    tip_tolerance = each.get(lambda: _tip_tolerance(model, frame, document))
    if arm and scene:
        each.get(partial(_check_ignored, arm, scene.names, document))
    asked = _asked_of(arm, model, known, each)
    errors = each.get(lambda: _errors(model.errors, frame, (arm, scene), document))
    each.end()
    assert arm and scene and errors and tip_tolerance  # else what is wrong was told
    return PlanningProblem(
        name=model.name or name,
        manipulator=arm,
        scene=scene,
        required_clearance=float(frame.metres(model.required_clearance)),
        T_world_base=frame.pose,
        required_self_clearance=self_clearance,
        tip_tolerance=tip_tolerance,
        max_row_change=_row_change(model),
        errors=errors,
        **asked,
    )


def _asked_of(
    arm: Manipulator | None,
    model: schema.ProblemModel,
    known: tuple[YamlDocument, Frame, Path, Digest],
    each: Gathered,
) -> dict[str, Any]:
    """What an arm shall do: path, start, goal and scaling, as far as they are given."""
    if arm is None:
        return {}
    paths = PathBuilder(*known, arm)
    start, goal = partial(paths.start, at=("start",)), partial(paths.goal, at=("goal",))
    scaling = partial(_scaling, arm=arm, document=known[0], frame=known[1])
    reads: dict[str, tuple[Callable[[Any], Any], Any]] = {
        "tip_path": (paths.build, model.tip_path),
        "start": (start, model.start),
        "goal": (goal, model.goal),
        "scaling": (scaling, model.ratios),
    }
    return {
        name: None if given is None else each.get(partial(read, given))
        for name, (read, given) in reads.items()
    }


def joined(
    scene: Scene, more: Sequence[Obstacle], document: YamlDocument, at: str = "others"
) -> Scene:
    """The obstacles, then more, such as the bodies of other arms and robots.

    Raises:
        InvalidFile: If two have the same name, or one is too far away.
    """
    with document.naming((at,)):
        return Scene((*scene.obstacles, *more)) if more else scene


def _errors(
    model: ErrorsModel,
    frame: Frame,
    known: tuple[Manipulator | None, Scene | None],
    document: YamlDocument,
) -> ErrorBox | None:
    """The errors under which every clearance is asked for; None where nobody knows."""
    (arm, scene), joint, each = known, model.joint_deg, Gathered()
    if arm and isinstance(joint, list) and len(joint) != arm.n_links:
        problem = f"has {len(joint)} values, expected {arm.n_links}: one per joint"
        each.note(document.invalid(("errors", "joint_deg"), problem))
    errors = None
    if scene is not None:
        errors = each.get(partial(model.box, frame.unit, scene, document))
    each.end()
    if arm and errors:
        with document.naming(("errors",)):
            errors.angles(arm.n_links)
    return errors


def _scaling(
    model: schema.RatiosModel, arm: Manipulator, frame: Frame, document: YamlDocument
) -> Scaling:
    """What takes the place of constant ratios about the rail."""
    given = (model.values, model.scaling_centre, model.cylinder_radius)
    if sum(one is not None for one in given) != 1:
        problem = "expected one of values, scaling_centre and cylinder_radius"
        raise document.invalid(("ratios",), problem)
    if (model.joint is None) != (model.scaling_centre is None):
        problem = "expected scaling_centre and joint together"
        raise document.invalid(("ratios",), problem)
    found: Scaling
    with document.naming(("ratios",)):
        if model.values is not None:
            found = OtherRatios(np.array(model.values))
        elif model.scaling_centre is not None and model.joint is not None:
            centre = frame.metres(np.array(model.scaling_centre))
            found = ScalingCentre(np.asarray(centre), model.joint)
        else:
            radius = float(frame.metres(model.cylinder_radius))
            found = ProjectionCylinder(radius, model.cylinder_axis)
        found.check(arm.n_links)
    return found


def _tip_tolerance(
    model: schema.ProblemModel, frame: Frame, document: YamlDocument
) -> float:
    """How far the tip may be off; no farther than between two waypoints; [m]."""
    if model.tip_tolerance is None:
        return TOLERANCES.tip_on_path
    tolerance = float(frame.metres(model.tip_tolerance))
    if model.tip_path is not None:
        spacing = spacing_of(model.tip_path, frame)
        if not tolerance <= spacing:
            problem = (
                f"is {frame.shown(tolerance)}, expected at most the spacing of the "
                f"path, {frame.shown(spacing)}: so far may the tip stray between "
                "waypoints"
            )
            raise document.invalid(("tip_tolerance",), problem)
    return tolerance


def _row_change(model: schema.ProblemModel) -> float | None:
    change = model.max_change_per_row_deg
    return None if change is None else float(np.deg2rad(change))


def _check_ends(model: schema.ProblemModel, document: YamlDocument) -> None:
    """A path says itself where the motion begins; start and goal are for the others."""
    if model.tip_path is None:
        return
    for name, advice in (
        ("start", "give it as tip_path.start"),
        ("goal", "let the path end there"),
    ):
        if getattr(model, name) is not None:
            problem = f"stands beside tip_path, which has its own; {advice}"
            raise document.invalid((name,), problem)


def _check_ignored(
    arm: Manipulator, obstacles: tuple[str, ...], document: YamlDocument
) -> None:
    """Pairs that are not to be judged name what there is."""
    for i, pair in enumerate(arm.ignore_pairs):
        with document.naming(("manipulator", "ignore_pairs", i)):
            arm.check_ignored(pair, obstacles)


def _check_links_apart(
    arm: Manipulator, self_clearance: float, frame: Frame, document: YamlDocument
) -> None:
    """A link between two others must keep them apart while the arm is straight."""
    for i in range(1, arm.n_links - 1):
        needed = arm.radius_of(i) + arm.radius_of(i + 2) + self_clearance
        if not arm.link_lengths[i] > needed:
            problem = (
                f"is {frame.shown(arm.link_lengths[i])}, expected above "
                f"{frame.shown(needed)}: the radii of its neighbours and the "
                "self-clearance, else the links on either side of it always touch"
            )
            raise document.invalid(("manipulator", "link_lengths", i), problem)
