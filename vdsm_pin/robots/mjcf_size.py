"""How much a world of MuJoCo (MJCF) has, before mujoco makes all of it."""

import math
import xml.etree.ElementTree as ET
from contextlib import suppress
from pathlib import Path
from typing import Final

from vdsm_pin.errors import InvalidFile
from vdsm_pin.io.source import read_bytes
from vdsm_pin.io.xml_reader import read_xml

MAX_BYTES: Final = 64 << 20
"""Largest file that is read; [bytes]."""

MOST: Final = 50_000
"""Elements of a world, each as often as it is repeated."""

DEEPEST: Final = 100
"""Most files that include one another in turn."""

REPEATED: Final = ("replicate", "composite", "flexcomp")
"""Elements whose `count` says how often what is in them stands there."""


def check_size(file: Path) -> tuple[Path, ...]:
    """Refuse a world with more elements than are read.

    Returns:
        The files that it includes or attaches, each once.

    Raises:
        InvalidFile: If it has more, or is no XML.
    """
    seen: dict[Path, None] = {}
    count = _elements(file, file.parent, seen, 0)
    if not count <= MOST:
        problem = (
            f"has {count:.6g} elements, each counted as often as `replicate` and the "
            f"like repeat it, expected at most {MOST}"
        )
        raise InvalidFile(file=file, problem=problem)
    return tuple(seen)[1:]


def _elements(file: Path, folder: Path, seen: dict[Path, None], depth: int) -> float:
    """Elements of a file and of all that it includes or attaches.

    Args:
        file: The file.
        folder: Of the world, from where files are named.
        seen: Files that were counted; mujoco includes none twice.
        depth: How many files include it, one within another.

    Raises:
        InvalidFile: If that are more than are read.
    """
    if file in seen or not file.is_file():  # which mujoco tells
        return 0.0
    if depth > DEEPEST:
        problem = f"is included by {depth} files, one within another"
        raise InvalidFile(file=file, problem=f"{problem}, expected {DEEPEST} at most")
    seen[file] = None
    root = read_xml(read_bytes(file, limit=MAX_BYTES), file)

    def named(element: ET.Element) -> float:
        return _elements(folder / element.get("file", ""), folder, seen, depth + 1)

    models = sum(map(named, root.iter("model")))
    total, left = 0.0, [(root, 1.0)]
    while left:
        element, times = left.pop()
        times *= _count(element)
        total += times
        if element.tag == "include":
            total += times * named(element)
        elif element.tag == "attach":
            total += times * models
        left += [(child, times) for child in element]
    return total


def _count(element: ET.Element) -> float:
    """How often what is in an element stands there; 1 where that cannot be read."""
    if element.tag in REPEATED:
        with suppress(ValueError):
            counts = map(float, element.get("count", "1").split())
            return math.prod(max(1.0, count) for count in counts)
    return 1.0
