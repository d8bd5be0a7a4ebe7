"""XML of unknown origin, and what readers of URDFs ask of it."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Final

import numpy as np

from vdsm_pin.errors import InvalidFile
from vdsm_pin.geometry.arrays import FloatArray, rotation_from_rpy

_COMMENT: Final = re.compile(r"<!--.*?(?:-->|\Z)", re.DOTALL)
_ROOT: Final = re.compile(rf"{_COMMENT.pattern}|<robot(?=[\s>])", re.DOTALL)
_PREFIX: Final = re.compile(r"[<\s/]([A-Za-z_][\w.-]*):[A-Za-z_]")
"""Before the name of an element or attribute."""

_KNOWN: Final = ("xml", "xmlns")
"""Prefixes that need not and must not be declared."""


def read_xml(content: str | bytes, path: Path) -> ET.Element:
    """The root element of a document.

    Args:
        content: The document; bytes in the encoding that it states.
        path: Its file, for messages.

    Raises:
        InvalidFile: If it is no XML, or in an encoding that is not known.
    """
    try:
        return ET.fromstring(content)
    except (ET.ParseError, ValueError, LookupError) as error:
        fault = f"is not XML: {' '.join(str(error).split())[:100]}"
        raise InvalidFile(file=path, fault=fault) from None


def declared(text: str) -> str:
    """The same URDF, its root declaring the prefixes that nothing else does.

    ROS reads `drake:acceleration="2.5"` without; an XML parser does not.
    """
    bare = _COMMENT.sub("", text)
    prefixes = dict.fromkeys(_PREFIX.findall(bare))
    names = [one for one in prefixes if f"xmlns:{one}" not in bare]
    more = "".join(f' xmlns:{one}="{one}"' for one in names if one not in _KNOWN)
    return _ROOT.sub(lambda m: m[0] + more if m[0] == "<robot" else m[0], text)


def origin_of(element: ET.Element) -> FloatArray:
    """T_parent_element, shape (4, 4), of numbers that were checked."""
    placement, origin = np.eye(4), element.find("origin")
    if origin is not None:
        rpy = np.array([float(word) for word in origin.get("rpy", "0 0 0").split()])
        placement[:3, :3] = rotation_from_rpy(rpy)
        placement[:3, 3] = [float(word) for word in origin.get("xyz", "0 0 0").split()]
    return placement


def end(joint: ET.Element, which: str) -> str:
    """The `parent` or `child` link of a joint of a URDF."""
    element = joint.find(which)
    return "" if element is None else element.get("link", "")
