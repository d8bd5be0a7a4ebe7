"""The errors of a problem file, of an arm's or of any other robot's."""

from collections.abc import Mapping

import numpy as np

from vdsm_pin.geometry.solids import HalfSpace, Solid
from vdsm_pin.io.errors_schema import ErrorsModel
from vdsm_pin.io.frames import Frame
from vdsm_pin.io.yaml_reader import YamlDocument
from vdsm_pin.problem.error_boxes import ErrorBox, JointError, ObstacleError
from vdsm_pin.problem.scene import Scene, solid_of


def build_errors(
    model: ErrorsModel,
    frame: Frame,
    scene: Scene,
    document: YamlDocument,
) -> ErrorBox:
    """The errors under which every clearance is asked for.

    Args:
        model: As the file has them.
        frame: Its unit.
        scene: The obstacles.
        document: The file, for messages.

    Raises:
        InvalidFile: If they name an obstacle that there is not, or turn a half-space.
    """
    solids = {one.name: solid_of(one) for one in scene.obstacles}
    _check_obstacles(model, solids, document)
    joint, slide = model.joint_deg, model.slide
    turns = joint if isinstance(joint, Mapping) else {}
    shifts = slide if isinstance(slide, Mapping) else {}
    each = np.deg2rad(joint).tolist() if isinstance(joint, list) else ()
    return ErrorBox(
        joint=float(np.deg2rad(joint)) if isinstance(joint, float) else 0.0,
        base=float(frame.metres(model.base)),
        obstacle=float(frame.metres(model.obstacle)),
        base_turn=float(np.deg2rad(model.base_deg)),
        joints=tuple((error, error) for error in each),
        obstacles=tuple(
            ObstacleError(
                one.name,
                float(frame.metres(one.shift)),
                float(np.deg2rad(one.turn_deg)),
            )
            for one in model.obstacles
        ),
        slide=float(frame.metres(slide)) if isinstance(slide, float) else 0.0,
        named=JointError.of(
            turns, {name: float(frame.metres(value)) for name, value in shifts.items()}
        ),
    )


def _check_obstacles(
    model: ErrorsModel, kinds: Mapping[str, Solid | None], document: YamlDocument
) -> None:
    for i, one in enumerate(model.obstacles):
        at = ("errors", "obstacles", i)
        if one.name not in kinds:
            problem = f"is {one.name!r}, expected one of {', '.join(kinds) or 'none'}"
            raise document.invalid((*at, "name"), problem)
        if one.turn_deg and isinstance(kinds[one.name], HalfSpace):
            problem = "is of a half_space, which has no middle to turn about"
            raise document.invalid((*at, "turn_deg"), problem)
