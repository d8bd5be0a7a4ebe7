"""How far things may be off in a problem file, of an arm or of any other robot."""

from collections.abc import Mapping
from typing import Annotated, Any, TypeAlias

import numpy as np
from pydantic import Discriminator, Field, Tag

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.solids import HalfSpace
from vdsm_pin.io.problem_errors import ErrorCollector
from vdsm_pin.io.schema_types import FileModel, Name, NotNegative
from vdsm_pin.io.yaml_reader import YamlDocument
from vdsm_pin.problem.error_boxes import ErrorBox, in_si
from vdsm_pin.problem.scene import Scene, solid_of
from vdsm_pin.units import UNITS_PER_METRE


def _one_or_names(value: Any) -> str:
    return "by name" if isinstance(value, Mapping) else "one"


def _any_form(value: Any) -> str:
    return "each" if isinstance(value, list) else _one_or_names(value)


_One: TypeAlias = Annotated[NotNegative, Tag("one")]
_ByName: TypeAlias = Annotated[dict[str, NotNegative], Tag("by name")]


class ObstacleErrorModel(FileModel):
    """How far one obstacle may be off."""

    name: Name = Field(description="Of the obstacle.")
    shift: NotNegative = Field(
        default=0.0,
        description="In any direction [length_unit]; counts where it is larger than "
        "that of all obstacles.",
    )
    turn_deg: NotNegative = Field(
        default=0.0,
        description="About any axis through the middle of the box around its corners "
        "[deg]; not of a half_space.",
    )


class ErrorsModel(FileModel):
    """How far the real motion, its base and the obstacles may be off."""

    joint_deg: Annotated[
        _One | Annotated[list[NotNegative], Tag("each")] | _ByName,
        Discriminator(_any_form),
    ] = Field(
        default=0.0,
        description="Of every alpha and theta, either way [deg]; a list has a value "
        "per joint, from the base. Of a robot: of every joint that turns, or of some "
        "by name.",
    )
    slide: Annotated[_One | _ByName, Discriminator(_one_or_names)] = Field(
        default=0.0,
        description="Of a robot: of every joint that slides, or of some by name "
        "[length_unit].",
    )
    base: NotNegative = Field(
        default=0.0, description="Shift of the base, in any direction [length_unit]."
    )
    base_deg: NotNegative = Field(
        default=0.0, description="Turn of the base about its origin [deg]."
    )
    obstacle: NotNegative = Field(
        default=0.0, description="Of every obstacle's surface [length_unit]."
    )
    obstacles: list[ObstacleErrorModel] = Field(
        default=[], description="Of single obstacles."
    )

    def box(self, unit: str, scene: Scene, document: YamlDocument) -> ErrorBox:
        """The errors under which every clearance is asked for.

        Args:
            unit: Of the file's lengths.
            scene: The obstacles.
            document: The file, for messages.

        Raises:
            InvalidFile: If they name an obstacle that there is not, or turn a
                half-space.
        """
        solids = {one.name: solid_of(one) for one in scene.obstacles}
        errors = ErrorCollector()
        for i, one in enumerate(self.obstacles):
            at = ("errors", "obstacles", i)
            if one.name not in solids:
                known = ", ".join(solids) or "none"
                fault = f"is {one.name!r}, expected one of {known}"
                errors.add(document.invalid((*at, "name"), fault))
            elif one.turn_deg and isinstance(solids[one.name], HalfSpace):
                fault = "is of a half_space, which has no middle to turn about"
                errors.add(document.invalid((*at, "turn_deg"), fault))
        errors.raise_if_any()
        fields = in_si(
            UNITS_PER_METRE[unit],
            joint_deg=self.joint_deg,
            slide=self.slide,
            base=self.base,
            base_deg=self.base_deg,
            obstacle=self.obstacle,
            obstacles=[(one.name, one.shift, one.turn_deg) for one in self.obstacles],
        )
        return ErrorBox(**fields)


def stated_errors(box: ErrorBox, per_metre: float, n_links: int = 0) -> dict[str, Any]:
    """Errors as a problem file has them, those that are none left out.

    Args:
        box: The errors.
        per_metre: Of the file's unit of length.
        n_links: Of a snake arm.

    Raises:
        InvalidInput: If alpha and theta of a joint are off by different angles.
    """
    each = []
    if box.joints:
        for alpha, theta in box.angles(n_links).tolist():
            if alpha != theta:
                message = "no problem file has errors of alpha and theta that differ"
                raise InvalidInput(message)
            each.append(_deg(alpha))
    turns = {one.name: _deg(one.turn) for one in box.named if one.turn}
    slides = {one.name: one.shift * per_metre for one in box.named if one.shift}
    off = [
        {"name": one.name, "shift": one.shift * per_metre, "turn_deg": _deg(one.turn)}
        for one in box.obstacles
    ]
    stated: dict[str, Any] = {
        "joint_deg": each or turns or _deg(box.joint),
        "slide": slides or box.slide * per_metre,
        "base": box.base * per_metre,
        "base_deg": _deg(box.base_turn),
        "obstacle": box.obstacle * per_metre,
        "obstacles": off,
    }
    return {key: value for key, value in stated.items() if value}


def _deg(angle: float) -> float:
    return float(np.rad2deg(angle))
