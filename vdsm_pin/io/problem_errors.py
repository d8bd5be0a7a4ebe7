"""Pydantic's complaints in this package's words: field, line, value, expectation."""

from collections.abc import Mapping
from typing import Any, Final

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from vdsm_pin.errors import InvalidFile
from vdsm_pin.io import body_schema as bodies
from vdsm_pin.io import motion_schema as movables
from vdsm_pin.io import path_schema as paths
from vdsm_pin.io import problem_schema as schema
from vdsm_pin.io.schema_types import NAME_PATTERN, FileModel
from vdsm_pin.io.yaml_reader import Data, Location, YamlDocument

_SOLIDS: Final = ("cylinder", "prism", "sphere", "capsule", "box", "half_space")
_SHAPES: Final = (*_SOLIDS, "mesh", "points", "voxels")

LONGEST_SHOWN: Final = 60
"""Values are cut to this many characters in a message."""

_MODELS: Final[Mapping[str | int, type[FileModel]]] = {
    "manipulator": schema.ManipulatorModel,
    "value": schema.ManipulatorModel,
    "cables": schema.CablesModel,
    "tool": schema.ToolModel,
    "feed": schema.FeedModel,
    "errors": schema.ErrorsModel,
    "ratios": schema.RatiosModel,
    "base": schema.BasePoseModel,
    "tip_path": schema.TipPathModel,
    "pointing": schema.PointingModel,
    "arc": paths.ArcModel,
    "circle": paths.CircleModel,
    "spline": paths.SplinePart,
    "file": paths.FilePart,
    "joints": schema.JointsModel,
    "goal": schema.GoalModel,
    "motion": movables.MotionModel,
    "cylinder": movables.CylinderObstacle,
    "capsule": movables.CapsuleObstacle,
    "sphere": movables.SphereObstacle,
    "box": movables.BoxObstacle,
    "prism": movables.PrismObstacle,
    "half_space": movables.HalfSpaceObstacle,
    "mesh": movables.MeshObstacle,
    "points": movables.PointsObstacle,
    "voxels": movables.VoxelsObstacle,
}
"""The model that holds a field, by the step before it in pydantic's location."""

_BODIES: Final[Mapping[str, type[FileModel]]] = {
    "cylinder": bodies.CylinderBody,
    "capsule": bodies.CapsuleBody,
    "sphere": bodies.SphereBody,
    "box": bodies.BoxBody,
    "prism": bodies.PrismBody,
    "mesh": bodies.MeshBody,
}
"""The same for what rides on links."""

_LISTED: Final[Mapping[str, type[FileModel]]] = {
    "others": schema.OtherModel,
    "errors": schema.ObstacleErrorModel,
}
"""Those that stand in lists, of one form each."""

_EITHER: Final[Mapping[str | int, str]] = {
    "manipulator": "the name of a built-in arm or a mapping",
    "start": "3 numbers or a mapping with joints",
    "retreat": "a number or home",
    "axis": "x, y, z or a list of 3 numbers",
}
"""What fields of two forms take."""

_NAMES: Final = {
    NAME_PATTERN: "signs that can be seen, no space or = + - @ first",
}


def first_error(error: ValidationError, document: YamlDocument) -> InvalidFile:
    """The error that most likely explains the others, which it carries.

    A wrong version comes first and a missing key last, since a misspelt key is missing
    too; else they are in the order of the file.

    Args:
        error: All that pydantic found.
        document: The file, for its lines.

    Returns:
        One error that names field, line, value and expectation.
    """
    found = [
        (_location(details, document.data), details)
        for details in error.errors(include_url=False)
    ]

    def rank(pair: tuple[Location, ErrorDetails]) -> tuple[bool, bool, int]:
        at, kind = pair[0], pair[1]["type"]
        missing = kind == "missing"
        return at != ("vdsm_problem",) or missing, missing, document.line(at) or 0

    first, *rest = sorted(found, key=rank)
    more = f" (and {len(rest)} more)" if rest else ""
    raised = document.invalid(first[0], _problem(first[1], first[0]) + more)
    raised.others = tuple(document.invalid(at, _problem(what, at)) for at, what in rest)
    return raised


def _location(details: ErrorDetails, data: Data) -> Location:
    """Where an error is, without the names of the union members tried on the way."""
    location: list[str | int] = []
    value: Any = data
    for step in details["loc"]:
        if isinstance(value, dict) and step in value:
            value = value[step]
        elif isinstance(value, list) and isinstance(step, int) and step < len(value):
            value = value[step]
        else:
            continue
        location.append(step)
    if details["type"] == "missing":
        location.append(details["loc"][-1])
    elif details["type"].startswith("union_tag"):
        location.append("shape")
    return tuple(location)


def _problem(details: ErrorDetails, at: Location) -> str:
    """One clause: the value found and what was expected."""
    loc, kind, context = details["loc"], details["type"], details.get("ctx", {})
    match kind:
        case "missing":
            field = _model(loc).model_fields.get(str(loc[-1]))
            hint = field.description if field else None
            return f"is missing; expected: {hint}" if hint else "is missing"
        case "extra_forbidden":
            fields = _model(loc).model_fields.items()
            known = ", ".join(field.alias or name for name, field in fields)
            return f"is not a known key; known: {known}"
        case "union_tag_not_found":
            return f"is missing; expected: one of {_known_shapes(loc)}"
        case "union_tag_invalid":
            return f"is {context['tag']!r}, expected one of {_known_shapes(loc)}"
    return f"is {_shown(details['input'])}, expected {_expected(details, at)}"


def _known_shapes(loc: tuple[str | int, ...]) -> str:
    return ", ".join(_BODIES if "bodies" in loc else _SHAPES)


def _model(loc: tuple[str | int, ...]) -> type[FileModel]:
    """The model that a field belongs to, by pydantic's location of the field."""
    if len(loc) > 2 and isinstance(loc[-2], int):
        return _LISTED["others" if "others" in loc else "errors"]
    if "bodies" in loc and str(loc[-2]) in _BODIES:
        return _BODIES[str(loc[-2])]
    return _MODELS[loc[-2]] if len(loc) > 1 else schema.ProblemModel


def _expected(details: ErrorDetails, at: Location) -> str:
    kind, context = details["type"], details.get("ctx", {})
    if kind.endswith("_type") and at and at[-1] in _EITHER:
        return _EITHER[at[-1]]
    words = {
        "float_type": "a number",
        "finite_number": "a finite number",
        "string_type": "text",
        "bool_type": "true or false",
        "list_type": "a list",
        "model_type": "a mapping",
        "model_attributes_type": "a mapping",
    }
    match kind:
        case "literal_error":
            return str(context["expected"])
        case "greater_than":
            return f"above {context['gt']:g}"
        case "greater_than_equal":
            return f"{context['ge']:g} or more"
        case "less_than":
            return f"below {context['lt']:g}"
        case "less_than_equal":
            return f"{context['le']:g} or less"
        case "too_short":
            return f"at least {_entries(context['min_length'])}"
        case "too_long":
            return f"at most {_entries(context['max_length'])}"
        case "string_too_long":
            return f"at most {context['max_length']} characters"
        case "string_too_short":
            return f"at least {context['min_length']} characters"
        case "string_pattern_mismatch":
            return _NAMES[context["pattern"]]
    return words.get(kind) or details["msg"][:1].lower() + details["msg"][1:]


def _entries(count: int) -> str:
    return f"{count} entry" if count == 1 else f"{count} entries"


def _shown(value: object) -> str:
    """A value as short as a message needs it, as YAML has it."""
    match value:
        case None:
            return "empty"
        case bool():
            return str(value).lower()
        case dict():
            return "a mapping"
        case list() if len(value) > 6:
            return f"a list of {len(value)}"
    text = repr(value)
    if len(text) <= LONGEST_SHOWN:
        return text
    return f"{text[: LONGEST_SHOWN - 3]}..."
