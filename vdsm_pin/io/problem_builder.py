"""A checked problem file to a planning problem: units, frames, defaults, and sense."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.io import problem_schema as schema
from vdsm_pin.io.arm_builder import ArmBuilder
from vdsm_pin.io.errors_field import ErrorsModel
from vdsm_pin.io.frames import Frame, Reading
from vdsm_pin.io.obstacle_builder import ObstacleBuilder
from vdsm_pin.io.others import MAX_BYTES, Others
from vdsm_pin.io.path_builder import PathBuilder, spacing_of
from vdsm_pin.io.problem_errors import ErrorCollector
from vdsm_pin.io.source import read_bytes
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
    reading: Reading,
    *,
    name: str,
    read_others: Callable[[Sequence[schema.OtherModel]], Others],
) -> PlanningProblem:
    """The planning problem that a file describes.

    Args:
        model: The file's content, each value checked by itself.
        reading: The file. What it names is read, and goes to the hash, in the order of
            the calls below, which certificates hold to: the arm's URDF or the meshes
            that links carry, those of the obstacles, the files of other arms and
            robots, those of the path.
        name: Name of the problem where the file gives none.
        read_others: Reads the other arms and robots.

    Returns:
        The problem, in the base frame; [m], [rad].

    Raises:
        InvalidFile: If values that are each in range make no sense together.
    """
    document, frame, digest = reading.document, reading.frame, reading.digest
    collector = ErrorCollector()
    arm = collector.attempt(_arm, model, reading)
    obstacles = ObstacleBuilder(reading, arm.total_length if arm else None)
    rest = collector.attempt(obstacles.build_scene, model.obstacles, arm)
    others = collector.attempt(read_others, model.others)
    scene = None
    if rest is not None and others is not None:
        for file in others.files:
            read = others.contents.get(file)
            digest.update(read_bytes(file, limit=MAX_BYTES) if read is None else read)
        reading.files.extend(others.files)
        scene = collector.attempt(joined, rest, others.bodies, document)
    collector.attempt(_check_ends, model, document)
    tip_tolerance = collector.attempt(_tip_tolerance, model, frame, document)
    if arm and scene:
        collector.attempt(_check_ignored, arm, scene.names, document)
    task = _task(model, arm, reading, collector)
    errors = collector.attempt(_errors, model.errors, arm, scene, reading)
    collector.raise_if_any()
    assert arm and scene and errors  # what is None was raised
    assert tip_tolerance is not None
    return PlanningProblem(
        name=model.name or name,
        manipulator=arm,
        scene=scene,
        required_clearance=float(frame.metres(model.required_clearance)),
        T_world_base=frame.pose,
        required_self_clearance=float(frame.metres(model.required_self_clearance)),
        tip_tolerance=tip_tolerance,
        max_row_change=_row_change(model),
        errors=errors,
        **task,
    )


def _arm(model: schema.ProblemModel, reading: Reading) -> Manipulator:
    """The arm, its links far enough apart."""
    arm = ArmBuilder(reading).build(model.manipulator)
    _check_links_apart(arm, model, reading)
    return arm


def _task(
    model: schema.ProblemModel,
    arm: Manipulator | None,
    reading: Reading,
    collector: ErrorCollector,
) -> dict[str, Any]:
    """What an arm shall do: path, start, goal and scaling, as far as they are given."""
    if arm is None:
        return {}
    paths, attempt = PathBuilder(reading, arm), collector.attempt
    return {
        "tip_path": model.tip_path and attempt(paths.build, model.tip_path),
        "start": model.start and attempt(paths.start, model.start, ("start",)),
        "goal": model.goal and attempt(paths.goal, model.goal, ("goal",)),
        "scaling": model.ratios and attempt(_scaling, model.ratios, arm, reading),
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
    arm: Manipulator | None,
    scene: Scene | None,
    reading: Reading,
) -> ErrorBox | None:
    """The errors that every clearance holds under; None where the scene is invalid."""
    document, joint, collector = reading.document, model.joint_deg, ErrorCollector()
    if arm and isinstance(joint, list) and len(joint) != arm.n_links:
        fault = f"has {len(joint)} values, expected {arm.n_links}: one per joint"
        collector.add(document.invalid(("errors", "joint_deg"), fault))
    errors = None
    if scene is not None:
        errors = collector.attempt(model.box, reading.frame.unit, scene, document)
    collector.raise_if_any()
    if arm and errors:
        with document.naming(("errors",)):
            errors.angles(arm.n_links)
    return errors


def _scaling(model: schema.RatiosModel, arm: Manipulator, reading: Reading) -> Scaling:
    """What takes the place of constant ratios about the rail."""
    document, frame = reading.document, reading.frame
    given = (model.values, model.scaling_centre, model.cylinder_radius)
    if sum(one is not None for one in given) != 1:
        fault = "expected one of values, scaling_centre and cylinder_radius"
        raise document.invalid(("ratios",), fault)
    if (model.joint is None) != (model.scaling_centre is None):
        fault = "expected scaling_centre and joint together"
        raise document.invalid(("ratios",), fault)
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
            fault = (
                f"is {frame.shown(tolerance)}, expected at most the spacing of the "
                f"path, {frame.shown(spacing)}: so far may the tip stray between "
                "waypoints"
            )
            raise document.invalid(("tip_tolerance",), fault)
    return tolerance


def _row_change(model: schema.ProblemModel) -> float | None:
    change = model.max_change_per_row_deg
    return None if change is None else float(np.deg2rad(change))


def _check_ends(model: schema.ProblemModel, document: YamlDocument) -> None:
    """Refuse start and goal beside tip_path, which has its own."""
    if model.tip_path is None:
        return
    for name, advice in (
        ("start", "give it as tip_path.start"),
        ("goal", "let the path end there"),
    ):
        if getattr(model, name) is not None:
            fault = f"stands beside tip_path, which has its own; {advice}"
            raise document.invalid((name,), fault)


def _check_ignored(
    arm: Manipulator, obstacles: tuple[str, ...], document: YamlDocument
) -> None:
    """Pairs that are not to be judged name what there is."""
    for i, pair in enumerate(arm.ignore_pairs):
        with document.naming(("manipulator", "ignore_pairs", i)):
            arm.check_ignored(pair, obstacles)


def _check_links_apart(
    arm: Manipulator, model: schema.ProblemModel, reading: Reading
) -> None:
    """A link between two others must keep them apart while the arm is straight."""
    frame = reading.frame
    self_clearance = float(frame.metres(model.required_self_clearance))
    for i in range(1, arm.n_links - 1):
        needed = arm.radius_of(i) + arm.radius_of(i + 2) + self_clearance
        if not arm.link_lengths[i] > needed:
            fault = (
                f"is {frame.shown(arm.link_lengths[i])}, expected above "
                f"{frame.shown(needed)}: the radii of its neighbours and the "
                "self-clearance, else the links on either side of it always touch"
            )
            at = ("manipulator", "link_lengths", i)
            raise reading.document.invalid(at, fault)
