"""Problem files by path or built-in name: the only reader of the YAML contract."""

import hashlib
from collections.abc import Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NamedTuple

from vdsm_pin.errors import InvalidFile, UnknownName
from vdsm_pin.io.frames import Reading
from vdsm_pin.io.motion_field import MovableModel
from vdsm_pin.io.others import OtherReader, ReadRobot
from vdsm_pin.io.problem_builder import build_problem
from vdsm_pin.io.problem_errors import checked
from vdsm_pin.io.problem_schema import ProblemModel
from vdsm_pin.io.source import check_is_file, decode, path_of, read_bytes
from vdsm_pin.io.yaml_reader import YamlDocument, read_yaml
from vdsm_pin.problem.any_problem import ProblemSource
from vdsm_pin.problem.planning_problem import PlanningProblem

MAX_PROBLEM_BYTES: Final = 32 << 20

SCHEMA_DIALECT: Final = "https://json-schema.org/draft/2020-12/schema"

_FOLDER: Final = Path(__file__).resolve().parent.parent / "problems"


class ProblemDocument(NamedTuple):
    """A problem file, of an arm or of any other robot.

    Args:
        path: The file.
        content: Its bytes.
        yaml: What they say.
    """

    path: Path
    content: bytes
    yaml: YamlDocument

    @property
    def is_of_robot(self) -> bool:
        """Whether it has `robot` in place of `manipulator`: `robots.cell` reads it."""
        return isinstance(self.yaml.data, dict) and "robot" in self.yaml.data


def read_document(path: Path) -> ProblemDocument:
    """A problem file as YAML.

    Raises:
        InvalidFile: If it cannot be read, or is no YAML.
    """
    content = read_bytes(path, limit=MAX_PROBLEM_BYTES)
    text = decode(content, path)
    if text.lstrip().startswith(("<?xml", "<robot", "<!--")):
        what = "is XML, expected a problem file, which may name a URDF"
        raise InvalidFile(file=path, fault=what)
    return ProblemDocument(path, content, read_yaml(text, file=path))


def read_problem(
    name_or_path: str | Path, read_robot: ReadRobot | None = None
) -> PlanningProblem:
    """The problem of a built-in name or a file.

    Args:
        name_or_path: Such as `paper/obs1` or `problems/mine.yaml`.
        read_robot: Reads robots of a URDF among its `others`; None where nobody does.

    Returns:
        The problem in metres, radians and the base frame (x along the rail).

    Raises:
        InvalidFile: If the file or its content breaks the contract of docs/files.md.
    """
    return arm_problem(read_document(find_problem(name_or_path)), read_robot)


def arm_problem(
    file: ProblemDocument, read_robot: ReadRobot | None = None
) -> PlanningProblem:
    """The problem of a snake arm that a file states.

    Raises:
        InvalidFile: As `read_problem`; if the file is of another robot, too.
    """
    path, content, document = file
    if file.is_of_robot:
        what = (
            "makes this a problem of a robot, and only snake arms are handled here; "
            "expected manipulator. `vdsm verify` and `read_cell` take robots"
        )
        raise document.invalid(("robot",), what)
    model = checked(document, ProblemModel)
    stem = "".join(c if c.isalnum() else "_" for c in path.stem[:100])
    reading = Reading(document, model.frame, path.parent, hashlib.sha256(content))
    others = OtherReader(reading, read_robot)
    problem = build_problem(model, reading, name=stem, read_others=others.read)
    of_obstacles = files_of_obstacles(model.obstacles, path.parent)
    named, sha256 = tuple(reading.files), reading.digest.hexdigest()
    source = ProblemSource(path, sha256, named, of_obstacles)
    return problem.read_from(source)


def files_of_obstacles(
    obstacles: Iterable[MovableModel], folder: Path
) -> tuple[tuple[str, Path], ...]:
    """Names of the obstacles that have a file of their own, with it."""
    files = ((one.name, getattr(one, "file", "")) for one in obstacles)
    return tuple((name, folder / file) for name, file in files if file)


def find_problem(name_or_path: str | Path) -> Path:
    """The file of a built-in name or a path.

    Raises:
        InvalidFile: If there is neither.
    """
    name = str(name_or_path)
    if name in built_in_names():
        return _FOLDER / f"{name}.yaml"
    path = path_of(name_or_path)
    try:
        check_is_file(path)
    except InvalidFile as error:
        hint = f"built-in problems: {', '.join(built_in_names())}"
        with suppress(OSError, ValueError):
            inside = path / "problem.yaml"
            hint = f"try {inside}" if inside.is_file() else hint
        fault = f"{error.fault}; {hint}"
        raise InvalidFile(file=name or "''", fault=fault) from None
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
    return {"$schema": SCHEMA_DIALECT, **schema, "title": "vdsm problem file"}
