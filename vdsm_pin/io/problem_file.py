"""Problem files by path or built-in name: the only reader of the YAML contract."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError
from pydantic_core import ErrorDetails

from vdsm_pin.errors import InvalidFile, UnknownName
from vdsm_pin.io.problem_builder import build_problem
from vdsm_pin.io.problem_schema import ProblemModel
from vdsm_pin.io.source import check_is_file, decode, read_bytes, sha256_of
from vdsm_pin.io.yaml_reader import Data, Location, YamlDocument, read_yaml
from vdsm_pin.problem import PlanningProblem

MAX_PROBLEM_BYTES: Final = 32 << 20

SCHEMA_DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"

_FOLDER: Final = Path(__file__).resolve().parent.parent / "problems"

_KINDS: Final = {dict: "a mapping", list: "a list", str: "text", type(None): "nothing"}


@dataclass(frozen=True)
class ProblemFile:
    """A problem and where it came from.

    Args:
        problem: What to plan.
        path: The file.
        sha256: Of the file's bytes followed by those of its meshes, in the order of
            the obstacles.
    """

    problem: PlanningProblem
    path: Path
    sha256: str


def read_problem(name_or_path: str | Path) -> ProblemFile:
    """The problem of a built-in name or a file.

    Args:
        name_or_path: Such as `paper/obs1` or `problems/mine.yaml`.

    Returns:
        The problem in metres, radians and the base frame.

    Raises:
        InvalidFile: If the file or its content breaks the contract.
    """
    path = find_problem(name_or_path)
    content = read_bytes(path, limit=MAX_PROBLEM_BYTES)
    document = read_yaml(decode(content, path), file=path)
    try:
        model = ProblemModel.model_validate(document.data)
    except ValidationError as error:
        raise _first_error(error, document) from None
    stem = "".join(c if c.isascii() and c.isalnum() else "_" for c in path.stem)
    built = build_problem(model, document, name=stem, folder=path.parent)
    return ProblemFile(built.problem, path, sha256_of([content, *built.mesh_contents]))


def find_problem(name_or_path: str | Path) -> Path:
    """The file of a built-in name or a path.

    Raises:
        InvalidFile: If there is neither.
    """
    name = str(name_or_path)
    if name in built_in_names():
        return _FOLDER / f"{name}.yaml"
    path = Path(name_or_path)
    try:
        check_is_file(path)
    except InvalidFile as error:
        known = ", ".join(built_in_names())
        problem = f"{error.problem}; built-in problems: {known}"
        raise InvalidFile(file=name, problem=problem) from None
    return path


def built_in_names() -> tuple[str, ...]:
    """Names of the problems that come with the package, sorted."""
    paths = _FOLDER.rglob("*.yaml")
    return tuple(
        sorted(p.relative_to(_FOLDER).with_suffix("").as_posix() for p in paths)
    )


def built_in_text(name: str) -> str:
    """A built-in problem file as it stands.

    Raises:
        UnknownName: If there is none of that name.
    """
    if name not in built_in_names():
        raise UnknownName(kind="problem", name=name, known=built_in_names())
    return (_FOLDER / f"{name}.yaml").read_text(encoding="utf-8")


def problem_schema() -> dict[str, Any]:
    """JSON Schema of the problem file, for editors."""
    schema = ProblemModel.model_json_schema(by_alias=True)
    return {"$schema": SCHEMA_DIALECT, "title": "vdsm problem file", **schema}


def _first_error(error: ValidationError, document: YamlDocument) -> InvalidFile:
    """The error nearest to the top of the file, in this package's words."""
    found = [
        (_location(details, document.data), details)
        for details in error.errors(include_url=False, include_context=True)
    ]
    at, details = min(found, key=lambda pair: document.line(pair[0]) or 0)
    more = f" (and {len(found) - 1} more)" if len(found) > 1 else ""
    return document.invalid(at, _problem(details) + more)


def _location(details: ErrorDetails, data: Data) -> Location:
    """Where an error is, without the names of the union members tried on the way."""
    location: list[str | int] = []
    value: Any = data
    *_, last = details["loc"] or ("",)
    for step in details["loc"]:
        if isinstance(value, dict) and step in value:
            value = value[step]
        elif isinstance(value, list) and isinstance(step, int) and step < len(value):
            value = value[step]
        elif not (details["type"] == "missing" and step == last):
            continue
        location.append(step)
    return tuple(location)


def _problem(details: ErrorDetails) -> str:
    """One clause: the value found and what was expected."""
    kind, context = details["type"], details.get("ctx", {})
    match kind:
        case "missing":
            return "is missing"
        case "extra_forbidden":
            return "is not a known key"
        case "union_tag_not_found":
            return f"has no {context['discriminator']}"
    found = _shown(details["input"])
    match kind:
        case "union_tag_invalid":
            found, expected = repr(context["tag"]), f"one of {context['expected_tags']}"
        case "literal_error":
            expected = context["expected"]
        case "float_type" | "int_type":
            expected = "a number"
        case "finite_number":
            expected = "a finite number"
        case "string_type":
            expected = "text"
        case "bool_type":
            expected = "true or false"
        case "list_type":
            expected = "a list"
        case "model_type" | "model_attributes_type":
            expected = "a mapping"
        case "greater_than":
            expected = f"above {context['gt']:g}"
        case "greater_than_equal":
            expected = f"{context['ge']:g} or more"
        case "less_than":
            expected = f"below {context['lt']:g}"
        case "less_than_equal":
            expected = f"{context['le']:g} or less"
        case "too_short" | "too_long":
            few = kind == "too_short"
            found = f"a list of {context['actual_length']}"
            bound = context["min_length" if few else "max_length"]
            expected = f"at {'least' if few else 'most'} {bound} entries"
        case _:
            expected = details["msg"][:1].lower() + details["msg"][1:]
    return f"is {found}, expected {expected}"


def _shown(value: object) -> str:
    """A value as short as a message needs it."""
    if type(value) in (dict, list) or value is None:
        return _KINDS[type(value)]
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
