"""What is mounted on an arm: a tool, a feed behind it, and bodies on its links."""

from dataclasses import dataclass
from typing import Final, TypeAlias

import numpy as np

from vdsm_pin.errors import InvalidInput
from vdsm_pin.geometry.arrays import check_numbers
from vdsm_pin.geometry.solids import Box, Capsule, Cylinder, Mesh, Prism, Sphere

MAX_LENGTH: Final = 1e6
"""Largest length of an arm; far beyond it inertias overflow; [m]."""


@dataclass(frozen=True)
class _Extension:
    """A straight extension of the arm, a capsule about its axis.

    Args:
        length: From the arm to its end; [m].
        radius: Of the capsule; [m].
    """

    length: float
    radius: float

    def __post_init__(self) -> None:
        """Refuse impossible sizes."""
        check_numbers(self, "length", "radius")
        for name in ("length", "radius"):
            if not 0.0 < getattr(self, name) <= MAX_LENGTH:
                value, kind = getattr(self, name), type(self).__name__.lower()
                message = f"{kind}: {name} is {value} m, expected above 0"
                raise InvalidInput(message)


class Tool(_Extension):
    """A straight extension of the last link; its end draws the path.

    Example:
        >>> vp.Tool(length=0.05, radius=0.004).length
        0.05
    """


class Feed(_Extension):
    """What pushes the arm along its rail: from O_1 backwards, moved by x0 alone.

    Example:
        >>> vp.Feed(length=1.2, radius=0.03).radius
        0.03
    """


BodySolid: TypeAlias = Sphere | Capsule | Cylinder | Box | Prism | Mesh
"""Solids that may ride on a link: no half-space, points or voxels."""


@dataclass(frozen=True)
class LinkBody:
    """A solid that rides on a link, in its frame: origin at O_i, x along the link.

    Args:
        link: The link, 1 to N.
        solid: Any of `BodySolid`.
        parts: Hulls that a mesh is covered by, 1 or more.

    Example:
        >>> camera = vp.Sphere("camera", np.array([0.1, 0.0, 0.03]), 0.01)
        >>> vp.LinkBody(3, camera).name
        'camera'
    """

    link: int
    solid: BodySolid
    parts: int = 1

    @property
    def name(self) -> str:
        """Name of the solid."""
        return self.solid.name

    def __post_init__(self) -> None:
        """Refuse a solid that cannot ride on a link, and numbers that are none.

        Raises:
            InvalidInput: If the solid is no `BodySolid`, or `link` or `parts` is no
                whole number.
        """
        if not isinstance(self.solid, BodySolid):
            kind = type(self.solid).__name__
            message = f"a {kind} rides on no link, expected one of {BodySolid}"
            raise InvalidInput(message)
        for field in ("link", "parts"):
            value = getattr(self, field)
            if not isinstance(value, (int, np.integer)):
                message = f"body {self.name!r}: {field} is {value!r}, expected a number"
                raise InvalidInput(message)
