"""Pydantic's complaints in this package's words: field, line, value, expectation."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final, ParamSpec, TypeVar, get_args

from pydantic import Tag, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.schema_types import NAME_PATTERN, FileModel
from vdsm_pin.io.yaml_reader import Data, Location, YamlDocument

LONGEST_SHOWN: Final = 60
"""Values are cut to this many characters in a message."""

_EITHER: Final[Mapping[str | int, str]] = {
    "manipulator": "the name of a built-in arm or a mapping",
    "start": "3 numbers or a mapping with joints",
    "retreat": "a number or home",
    "axis": "x, y, z or a list of 3 numbers",
    "joint_deg": "a number, one for each joint, or some by name",
    "slide": "a number, or some by name",
}
"""What fields of two forms take."""

_NAMES: Final = {NAME_PATTERN: "signs that can be seen, no space or = + - @ first"}


_WORDS: Final = {
    "float_type": "a number",
    "finite_number": "a finite number",
    "string_type": "text",
    "bool_type": "true or false",
    "list_type": "a list",
    "model_type": "a mapping",
    "model_attributes_type": "a mapping",
    "literal_error": "{expected}",
    "greater_than": "above {gt:g}",
    "greater_than_equal": "{ge:g} or more",
    "less_than": "below {lt:g}",
    "less_than_equal": "{le:g} or less",
    "string_too_long": "at most {max_length} characters",
    "string_too_short": "at least {min_length} characters",
}
"""What is expected, by pydantic's kind of error and with its values."""


Model = TypeVar("Model", bound=FileModel)
P = ParamSpec("P")
T = TypeVar("T")


class ErrorCollector:
    """Collects errors of the parts of one file, so that all are told at once."""

    def __init__(self) -> None:
        self._found: list[InvalidFile] = []

    def attempt(
        self, read: Callable[P, T], *args: P.args, **kwargs: P.kwargs
    ) -> T | None:
        """What a call returns; None where it raises InvalidFile, which is kept."""
        try:
            return read(*args, **kwargs)
        except InvalidFile as error:
            self.add(error)
        return None

    def add(self, error: InvalidFile) -> None:
        """Keep an error, and those that it carries."""
        self._found += [error, *error.others]

    def raise_if_any(self) -> None:
        """Raise what was kept.

        Raises:
            InvalidFile: The first of them, which carries the others.
        """
        if self._found:
            raise together(self._found)


def together(errors: Sequence[InvalidFile]) -> InvalidFile:
    """The first of several errors of one file, which carries the others."""
    first, *rest = errors
    for one in rest:
        one.others = ()
    first.others = tuple(rest)
    return first


def checked(document: YamlDocument, model: type[Model]) -> Model:
    """What a document holds, each value checked by itself.

    Raises:
        InvalidFile: If it is not what the model says; see `first_error`.
    """
    try:
        return model.model_validate(document.data)
    except ValidationError as error:
        raise first_error(error, document, model) from None


def first_error(
    error: ValidationError, document: YamlDocument, model: type[FileModel]
) -> InvalidFile:
    """The error that most likely explains the others, which it carries.

    A wrong version comes first and a missing key last, since a misspelt key is missing
    too; else they are in the order of the file.

    Args:
        error: All that pydantic found.
        document: The file, for its lines.
        model: What the file was held against.

    Returns:
        One error that names field, line, value and expectation.
    """
    told = error.errors(include_url=False)
    found = [
        (_location(details, document.data), details)
        for one in told
        for details in (one, *_of_any_shape(one, model))
    ]

    def rank(pair: tuple[Location, ErrorDetails]) -> tuple[bool, bool, int]:
        at, kind = pair[0], pair[1]["type"]
        missing = kind == "missing"
        return at != ("vdsm_problem",) or missing, missing, document.line(at) or 0

    return together(
        [
            document.invalid(at, _fault(details, at, model))
            for at, details in sorted(found, key=rank)
        ]
    )


def _of_any_shape(
    details: ErrorDetails, model: type[FileModel]
) -> Iterator[ErrorDetails]:
    """What is wrong of something without a known shape, whatever its shape was to be.

    That is what every shape refuses that knows the key: of {name: 7, radius: -1}, which
    has no shape, that a name is text and a radius above 0; not that `size` is missing,
    which boxes alone have.
    """
    given, loc = details["input"], details["loc"]
    if not details["type"].startswith("union_tag") or not isinstance(given, dict):
        return
    shapes = _models(loc, model)
    refused = {
        tag: _refused(one, {**given, "shape": tag}) for tag, one in shapes.items()
    }
    for key in dict.fromkeys((*given, *_fields(shapes))):
        knowing = [tag for tag, one in shapes.items() if key in _fields({tag: one})]
        if not knowing:
            where, value = (*loc, key), given[key]
            yield {"type": "extra_forbidden", "loc": where, "msg": "", "input": value}
        elif key != "shape" and (key in given or len(knowing) == len(shapes)):
            each = [[e for e in refused[tag] if e["loc"][0] == key] for tag in knowing]
            for one in each[0] if all(each) else ():
                yield {**one, "loc": (*loc, knowing[0], *one["loc"])}


def _refused(model: type[FileModel], data: dict[str, Any]) -> list[ErrorDetails]:
    try:
        model.model_validate(data)
    except ValidationError as error:
        return error.errors(include_url=False)
    return []


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


def _fault(details: ErrorDetails, at: Location, model: type[FileModel]) -> str:
    """One clause: the value found and what was expected."""
    loc, kind, context = details["loc"], details["type"], details.get("ctx", {})
    match kind:
        case "missing":
            hint = _fields(_models(loc[:-1], model))[str(loc[-1])].description
            value = "a value " if hint and hint.startswith("[") else ""  # unit alone
            return f"is missing; expected: {value}{hint}" if hint else "is missing"
        case "extra_forbidden":
            known = ", ".join(_fields(_models(loc[:-1], model)))
            return f"is not a known key; known: {known}"
        case "union_tag_not_found":
            return f"is missing; expected: one of {', '.join(_models(loc, model))}"
        case "union_tag_invalid":
            known = ", ".join(_models(loc, model))
            return f"is {context['tag']!r}, expected one of {known}"
    return f"is {_shown(details['input'])}, expected {_expected(details, at)}"


def _models(
    loc: tuple[str | int, ...], model: type[FileModel]
) -> dict[str, type[FileModel]]:
    """The models that may stand at pydantic's location, by the tags of their union."""
    found = {"": model}
    for step in map(str, loc):
        if step in found:
            found = {"": found[step]}
        elif field := _fields(found).get(step):
            found = dict(_tagged(field.annotation))
    return found


def _fields(models: Mapping[str, type[FileModel]]) -> dict[str, FieldInfo]:
    """Fields by their names in the file."""
    fields = [pair for one in models.values() for pair in one.model_fields.items()]
    return {field.alias or name: field for name, field in fields}


def _tagged(kind: Any, tag: str = "") -> Iterator[tuple[str, type[FileModel]]]:
    """The models in a type; a union tells them apart by a tag, or by their `shape`."""
    if isinstance(kind, type) and issubclass(kind, FileModel):
        shape = kind.model_fields.get("shape")
        yield get_args(shape.annotation)[0] if shape else tag, kind
    parts = get_args(kind)
    for part in parts:
        tags = (one.tag for one in parts if isinstance(one, Tag))
        yield from _tagged(part, next(tags, tag))


def _expected(details: ErrorDetails, at: Location) -> str:
    kind, context = details["type"], details.get("ctx", {})
    if kind.endswith("_type") and at and at[-1] in _EITHER:
        return _EITHER[at[-1]]
    if kind == "string_pattern_mismatch":
        return _NAMES[context["pattern"]]
    if kind in ("too_short", "too_long"):
        least = kind == "too_short"
        many = _entries(context["min_length" if least else "max_length"])
        return f"at least {many}" if least else f"at most {many}"
    if kind in _WORDS:
        return _WORDS[kind].format_map(context)
    return details["msg"][:1].lower() + details["msg"][1:]


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
