"""How the links of a robot look: the visual elements of its URDF, for pictures alone.

Nothing is proved of them. What cannot be read is left out and told.
"""

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.errors import InvalidFile, VdsmError
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.convex import Hull
from vdsm_pin.robots.link_solids import LinkPiece, LinkReader
from vdsm_pin.robots.model import Robot

PLAIN: Final = "#c3c8cf"
"""Colour of what states none."""


class Visual(NamedTuple):
    """What a visual element of a link shows.

    Args:
        shape: In the link's frame; of a mesh its triangles' corners, (n, 3, 3); [m].
        colour: As #rrggbb.
    """

    shape: LinkPiece | FloatArray
    colour: str


class Visuals(NamedTuple):
    """How a robot looks.

    Args:
        links: Of each of its bodies, none where its solids are all there is to show.
        notes: What is not drawn, and why, a sentence each.
    """

    links: list[list[Visual]]
    notes: list[str]


def visuals_of(robot: Robot) -> Visuals:
    """How the links with solids look."""
    links: dict[str, list[Visual]] = {body.name: [] for body in robot.bodies}
    found = Visuals(list(links.values()), [])
    if robot.urdf is None:
        return found
    document = ET.fromstring(robot.text)
    reader = LinkReader(robot.urdf, robot.package_dirs)
    colours = {
        material.get("name", ""): colour
        for material in document.findall("material")
        if (colour := _stated(material))
    }
    for link in document.findall("link"):
        looks = links.get(link.get("name", ""))
        if looks is None:
            continue
        for visual in link.findall("visual"):
            try:
                shapes = [*reader.surfaces(link, visual)]
            except (VdsmError, ValueError) as error:
                fault = error.fault if isinstance(error, InvalidFile) else error
                found.notes.append(f"{link.get('name')!r} is not drawn whole: {fault}")
            else:
                colour = _colour(visual, colours)
                looks += [Visual(shape, colour) for shape in shapes if _is_sound(shape)]
    return found


def _is_sound(shape: LinkPiece | FloatArray) -> bool:
    """Whether a shape can be drawn: its numbers are finite."""
    if isinstance(shape, np.ndarray):
        return bool(np.isfinite(shape).all())
    if isinstance(shape, Hull):
        return bool(np.isfinite(shape.points).all() and np.isfinite(shape.radius))
    sizes = *shape.centre, *shape.axis, shape.half_length, shape.radius
    return bool(np.isfinite(sizes).all())


def _colour(visual: ET.Element, colours: Mapping[str, str]) -> str:
    """The colour of a visual element, its own or that of a material of the robot."""
    material = visual.find("material")
    if material is None:
        return PLAIN
    return _stated(material) or colours.get(material.get("name", ""), PLAIN)


def _stated(material: ET.Element) -> str:
    """The colour that a material states as #rrggbb; "" where it states none."""
    colour = material.find("color")
    words = "" if colour is None else colour.get("rgba", "")
    try:
        rgb = np.array([float(word) for word in words.split()])[:3]
    except ValueError:
        return ""
    if rgb.shape != (3,) or not ((rgb >= 0.0) & (rgb <= 1.0)).all():
        return ""
    return "#" + "".join(f"{round(255 * part):02x}" for part in rgb.tolist())
