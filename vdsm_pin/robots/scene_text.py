"""The `.scene` text files of MoveIt, as the PlanningScene that they hold."""

from collections.abc import Iterator
from io import StringIO
from math import isnan
from pathlib import Path
from typing import Any, Final

from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.yaml_reader import Location, YamlDocument
from vdsm_pin.text import plain_number

MOST: Final = 100_000
"""Most shapes of one object."""

SIZES: Final = {"sphere": 1, "box": 3, "cylinder": 2, "plane": 4}
"""Numbers of each shape: radius; sizes; radius and length; a, b, c, d."""


class _Words:
    """The words of a file, one after the other, and the line of each."""

    def __init__(self, file: Path, text: str) -> None:
        self._file, self._lines = file, StringIO(text, newline=None).readlines()
        self._words = self._split()
        self.line = 1

    def _split(self) -> Iterator[tuple[int, str]]:
        for number, line in enumerate(self._lines[1:], start=2):
            for place, word in enumerate(line.split()):
                yield number, word
                if word == "*" and place == 0:  # the rest of the line is a name
                    yield number, line.split("*", 1)[1].strip()
                    break

    def next(self, expected: str) -> str:
        """The next word."""
        found = next(self._words, None)
        if found is None:
            fault = f"the file ends, expected {expected}"
            raise self.invalid(fault)
        self.line, word = found
        return word

    def numbers(self, count: int) -> list[float]:
        """The next numbers."""
        found = []
        for _ in range(count):
            word = self.next("a number")
            found.append(plain_number(word))
            if isnan(found[-1]):
                fault = f"is {word[:40]!r}, expected a number"
                raise self.invalid(fault)
        return found

    def count(self, what: str) -> int:
        """The next whole number."""
        word = self.next(f"a number of {what}")
        if not word.isdecimal() or len(word) > len(str(MOST)) or int(word) > MOST:
            fault = f"is {word[:40]!r}, expected a number of {what}"
            raise self.invalid(fault)
        return int(word)

    def check_end(self) -> None:
        """Refuse words behind the end of the scene."""
        for number, word in self._words:
            self.line, fault = number, f"is {word!r}, expected nothing behind '.'"
            raise self.invalid(fault)

    def has_poses(self) -> bool:
        """Whether objects have a pose of their own, by the line after a name."""
        after = False
        for line in self._lines[1:]:
            if after:
                return len(line.split()) > 1
            after = line.startswith("*")
        return False

    def invalid(self, fault: str) -> InvalidFile:
        """A word is not what is expected."""
        where = f"line {self.line}"
        return InvalidFile(file=self._file, where=where, fault=fault)


def read_scene_text(file: Path, text: str) -> YamlDocument:
    """The PlanningScene of a `.scene` file, old form or new, as if it were YAML.

    Raises:
        InvalidFile: If a word is not what is expected, or a shape is of another kind
            than box, sphere, cylinder, plane and mesh.
    """
    words = _Words(file, text)
    with_pose, things = words.has_poses(), list[dict[str, Any]]()
    lines: dict[Location, int] = {(): 1}
    while (marker := words.next("* or .")) != ".":
        if marker != "*":
            fault = f"is {marker!r}, expected * or ."
            raise words.invalid(fault)
        at: Location = ("world", "collision_objects", len(things))
        thing = _thing(words, with_pose)
        lines[at] = words.line
        things.append(thing)
    words.check_end()
    data: Any = {"world": {"collision_objects": things}}
    return YamlDocument(file, data, lines)


def _thing(words: _Words, with_pose: bool) -> dict[str, Any]:
    thing: dict[str, Any] = {"id": words.next("a name")}
    if with_pose:
        thing["pose"] = _pose(words)
    for _ in range(words.count("shapes")):
        kind = words.next("a shape")
        key, poses, shape = _shape(words, kind)
        thing.setdefault(key, []).append(shape)
        thing.setdefault(poses, []).append(_pose(words))
        words.numbers(4)  # its colour
    if with_pose:
        for _ in range(words.count("subframes")):
            words.next("a name")
            _pose(words)
    return thing


def _shape(words: _Words, kind: str) -> tuple[str, str, dict[str, Any]]:
    """Keys of its shapes and of their poses in a PlanningScene, and the shape."""
    if kind == "mesh":
        corners, faces = words.count("vertices"), words.count("triangles")
        vertices = [words.numbers(3) for _ in range(corners)]
        triangles = [words.numbers(3) for _ in range(faces)]
        return "meshes", "mesh_poses", {"vertices": vertices, "triangles": triangles}
    if kind not in SIZES:
        known = ", ".join((*SIZES, "mesh"))
        fault = f"is the shape {kind!r}, expected one of {known}"
        raise words.invalid(fault)
    sizes = words.numbers(SIZES[kind])
    if kind == "plane":
        return "planes", "plane_poses", {"coef": sizes}
    sizes = sizes[::-1] if kind == "cylinder" else sizes
    shape = {"type": kind, "dimensions": sizes}
    return "primitives", "primitive_poses", shape


def _pose(words: _Words) -> dict[str, list[float]]:
    return {"position": words.numbers(3), "orientation": words.numbers(4)}
