"""The arm: a rail, N links on universal joints, cables (paper, section 2, Table 1)."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import TYPE_CHECKING, Final

import numpy as np

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.mounted import MAX_LENGTH, BodySolid, Feed, LinkBody, Tool
from vdsm_pin.errors import InvalidInput, UnknownName
from vdsm_pin.geometry.arrays import ByValue, FloatArray, check_numbers, freeze, frozen
from vdsm_pin.geometry.solids import Capsule
from vdsm_pin.notebook import Summarised
from vdsm_pin.units import MM_PER_M, quantity

if TYPE_CHECKING:
    from vdsm_pin.arm.bodies import ArmBody, SelfPairs

MAX_LINKS: Final = 40
"""Largest number of links the package is tested with."""


TOOL: Final = "tool"
"""Name of the tool among the bodies."""

FEED: Final = "feed"
"""Name of the feed among the bodies."""

PART: Final = " part "
"""Between the name of a body and the number of its convex part."""


@dataclass(frozen=True, eq=False, repr=False)
class Manipulator(Summarised, ByValue):
    """Lengths, bodies and limits of one arm. A link is a capsule about its axis.

    Args:
        name: Name for reports and the URDF.
        link_lengths: L_1..L_N between joint centres, the last one to the tip and so
            with the tool, shape (N,); [m].
        link_radius: Radius of every link, the largest where they differ; [m].
        max_link_angle: Largest link angle psi_i, the cone; [rad].
        max_joint_angle: Largest absolute theta_i and alpha_i, the box; [rad].
        base_range: Smallest and largest x0, the same for a fixed base; [m].
        cables: Cable holes.
        radii: Radius of each link where they differ, shape (N,); [m].
        tool: What is mounted at the end of the last link.
        feed: What is behind the first joint; None where nothing is known of it.
        bodies: What else rides on the links.
        ignore_pairs: Names of two bodies, or of a body and an obstacle, that are not
            held apart.

    Raises:
        InvalidInput: If a value breaks its range.

    Example:
        >>> holes = vp.CableLayout(0.02, 0.01, np.radians([[0.0, 120.0, 240.0]] * 3))
        >>> lengths, rail = np.full(3, 0.3), (-1.0, 1.0)
        >>> arm = vp.Manipulator("three", lengths, 0.03, 0.7, 0.7, rail, holes)
        >>> round(float(arm.total_length), 9)
        0.9
    """

    name: str
    link_lengths: FloatArray
    link_radius: float
    max_link_angle: float
    max_joint_angle: float
    base_range: tuple[float, float]
    cables: CableLayout
    radii: FloatArray | None = None
    tool: Tool | None = None
    feed: Feed | None = None
    bodies: tuple[LinkBody, ...] = ()
    ignore_pairs: tuple[tuple[str, str], ...] = ()

    def __post_init__(self) -> None:
        """Freeze the arrays and refuse impossible arms."""
        freeze(self, "link_lengths", "radii", "base_range")
        check_numbers(self, "link_radius", "max_link_angle", "max_joint_angle")
        lengths = self.link_lengths
        if lengths.ndim != 1 or not 2 <= lengths.size <= MAX_LINKS:
            known = f"2 to {MAX_LINKS} lengths"
            message = f"link_lengths has shape {lengths.shape}, expected {known}"
            raise InvalidInput(message)
        if not ((lengths > 0.0) & (lengths <= MAX_LENGTH)).all():
            known = f"all above 0 and up to {MAX_LENGTH:g}"
            message = f"link_lengths are {lengths.tolist()} m, expected {known}"
            raise InvalidInput(message)
        if not 0.0 < self.link_radius <= MAX_LENGTH:
            known = f"above 0 and up to {MAX_LENGTH:g}"
            message = f"link_radius is {self.link_radius} m, expected {known}"
            raise InvalidInput(message)
        for name in ("max_link_angle", "max_joint_angle"):
            if not 0.0 < getattr(self, name) < np.pi / 2.0:
                value = np.rad2deg(getattr(self, name))
                message = f"{name} is {value}°, expected above 0° and below 90°"
                raise InvalidInput(message)
        ends = np.asarray(self.base_range)
        finite = ends.shape == (2,) and np.isfinite(ends).all()
        if not (finite and ends[0] <= ends[1]):
            message = f"base_range is {ends.tolist()} m, expected low <= high"
            raise InvalidInput(message)
        object.__setattr__(self, "base_range", tuple(ends.tolist()))
        if self.cables.hole_angles.shape[0] != lengths.size:
            count = self.cables.hole_angles.shape[0]
            message = f"hole_angles has {count} rows, expected {lengths.size}"
            raise InvalidInput(message)
        self._check_radii()
        self._check_bodies()

    def _check_radii(self) -> None:
        if self.radii is None:
            return
        radii = self.radii
        if radii.shape != (self.n_links,) or not (radii > 0.0).all():
            known = f"{self.n_links} values above 0"
            message = f"radii are {radii.tolist()} m, expected {known}"
            raise InvalidInput(message)
        if radii.max() != self.link_radius:
            message = (
                f"link_radius is {self.link_radius} m, expected the largest of "
                f"{radii.tolist()}"
            )
            raise InvalidInput(message)

    def _check_bodies(self) -> None:
        for field in ("bodies", "ignore_pairs"):
            object.__setattr__(self, field, tuple(getattr(self, field)))
        last = float(self.link_lengths[-1])
        if self.tool and not self.tool.length < last:
            message = f"tool: length is {self.tool.length} m, expected below {last}"
            raise InvalidInput(message)
        names = {*self.axis_names, TOOL, FEED}
        for body in self.bodies:
            if body.name in names or self.owner_of(body.name) != body.name:
                message = f"body {body.name!r}: another body, or a part, has this name"
                raise InvalidInput(message)
            names.add(body.name)
            if not 1 <= body.link <= self.n_links or body.parts < 1:
                known = f"1 to {self.n_links} and 1 or more"
                found = f"link is {body.link} and parts is {body.parts}"
                message = f"body {body.name!r}: {found}, expected {known}"
                raise InvalidInput(message)

    @property
    def n_links(self) -> int:
        """Number of links N; joint centres are O_1..O_{N+1}."""
        return int(self.link_lengths.size)

    @property
    def tool_length(self) -> float:
        """What the last of the link lengths has beyond the link itself; [m]."""
        return self.tool.length if self.tool else 0.0

    def radius_of(self, link: int) -> float:
        """Radius of a link, counted from 1; [m]."""
        return self.link_radius if self.radii is None else float(self.radii[link - 1])

    @property
    def body_names(self) -> tuple[str, ...]:
        """Names of everything that is held against obstacles, links first."""
        feed = (FEED,) if self.feed else ()
        return (*self.axis_names, *feed, *(body.name for body in self.bodies))

    @cached_property
    def carried(self) -> tuple[tuple[int, BodySolid], ...]:
        """The feed, then the bodies, each with the link that it rides on.

        Links count from 1; the feed has link 0.
        """
        found = [(body.link, body.solid) for body in self.bodies]
        if self.feed:
            half, axis = self.feed.length / 2.0, np.array([1.0, 0.0, 0.0])
            rod = Capsule(FEED, -half * axis, axis, half, self.feed.radius)
            found.insert(0, (0, rod))
        return tuple(found)

    @cached_property
    def convex_bodies(self) -> tuple["ArmBody", ...]:
        """Every convex body: links 1 to N, tool, feed, then the others in order."""
        from vdsm_pin.arm.bodies import arm_bodies  # compiled code, which few need

        return arm_bodies(self)

    @cached_property
    def self_pairs(self) -> "SelfPairs":
        """Which of them are held apart."""
        from vdsm_pin.arm.bodies import self_pairs

        return self_pairs(self, self.convex_bodies)

    def check_ignored(self, pair: tuple[str, str], obstacles: Sequence[str]) -> None:
        """Refuse a pair of `ignore_pairs` that names nothing that is held apart.

        Args:
            pair: Two names of `ignore_pairs`.
            obstacles: Names of the obstacles.

        Raises:
            UnknownName: If there is no such body or obstacle.
            InvalidInput: If neither name is a body of the arm, or both are the same.
        """
        own = self.body_names
        bodies = [self.owner_of(name) in own for name in pair]
        for name, is_body in zip(pair, bodies, strict=True):
            if not is_body and name not in obstacles:
                known = (*own, *obstacles)
                raise UnknownName(kind="body or obstacle", name=name, known=known)
        if not any(bodies) or pair[0] == pair[1]:
            message = f"{list(pair)} are not a body and what it is held apart from"
            raise InvalidInput(message)

    def owner_of(self, name: str) -> str:
        """The body that a name, such as `camera part 2`, is a part of.

        A name that is of no part is returned unchanged.
        """
        owner = name.rpartition(PART)[0]
        return owner if owner in (body.name for body in self.bodies) else name

    def ignores(self, one: str, other: str) -> bool:
        """Whether two named bodies, or parts of bodies, are not to be held apart."""
        if not self.ignore_pairs:
            return False
        names = {one, self.owner_of(one)}, {other, self.owner_of(other)}
        return any(
            (a in names[0] and b in names[1]) or (b in names[0] and a in names[1])
            for a, b in self.ignore_pairs
        )

    @cached_property
    def axis_radii(self) -> FloatArray:
        """Radii of the links and then of the tool, if there is one; [m]."""
        radii = [self.radius_of(i + 1) for i in range(self.n_links)]
        return frozen([*radii, self.tool.radius] if self.tool else radii)

    @cached_property
    def axis_spans(self) -> FloatArray:
        """Where axes of links and tool start and end along their links, (n, 2); [m]."""
        spans = [[0.0, length] for length in self.link_lengths.tolist()]
        if self.tool:
            start = spans[-1][1] - self.tool_length
            spans = [*spans[:-1], [0.0, start], [start, spans[-1][1]]]
        return frozen(spans)

    @property
    def axis_names(self) -> tuple[str, ...]:
        """Names of the links and of the tool: `link 1`, .., `tool`."""
        links = [f"link {i + 1}" for i in range(self.n_links)]
        return (*links, TOOL) if self.tool else tuple(links)

    @property
    def rods(self) -> tuple[tuple[int, BodySolid], ...]:
        """Links and tool in the frames of their links, each with its link, from 1."""
        axis, found = np.array([1.0, 0.0, 0.0]), []
        for k, name in enumerate(self.axis_names):
            start, end = (float(x) for x in self.axis_spans[k])
            size = (end - start) / 2.0, float(self.axis_radii[k])
            rod = Capsule(name, (start + end) / 2.0 * axis, axis, *size)
            found.append((min(k + 1, self.n_links), rod))
        return tuple(found)

    @property
    def least_radius(self) -> float:
        """Smallest radius of a link or of the tool; [m]."""
        return float(self.axis_radii.min())

    @cached_property
    def most_radius(self) -> float:
        """Largest distance of any link, tool or body from the arm's axis; [m]."""
        return float(self.reaches.max())

    @cached_property
    def reaches(self) -> FloatArray:
        """How far each link, its tool and bodies reach from its axis, (N,); [m]."""
        found = np.array([self.radius_of(i + 1) for i in range(self.n_links)])
        if self.tool:
            found[-1] = max(found[-1], self.tool.radius)
        for body in self.bodies:
            found[body.link - 1] = max(found[body.link - 1], self.reach_of(body))
        return frozen(found)

    def reach_of(self, body: LinkBody) -> float:
        """Largest distance of a body from the axis of its link; [m]."""
        points, grown = body.solid.corners, body.solid.grown
        away = points.copy()
        away[:, 0] -= points[:, 0].clip(0.0, self.link_lengths[body.link - 1])
        return float(np.linalg.norm(away, axis=1).max()) + grown

    def round_cover(self, body: LinkBody) -> FloatArray:
        """Radius of a capsule about a link's axis that holds a body and is no thinner.

        And how far that capsule's axis goes on before O_i and past O_{i+1}, shape (3,);
        [m].
        """
        points, grown = body.solid.corners, body.solid.grown
        x, away = points[:, 0], np.hypot(points[:, 1], points[:, 2])
        radius = max(away.max(), self.radius_of(body.link) - grown)
        half = np.sqrt(radius**2 - away**2)
        ends = -(x + half).min(), (x - half).max() - self.link_lengths[body.link - 1]
        return np.array([radius + grown, max(ends[0], 0.0), max(ends[1], 0.0)])

    def axes(self, centres: FloatArray) -> FloatArray:
        """Ends of the axes of the links and of the tool, one after the other.

        Args:
            centres: Joint centres, shape (n_samples, N + 1, 3); [m].

        Returns:
            The joint centres and, before the tip, the place where a tool begins, shape
            (n_samples, n_axes + 1, 3); [m].
        """
        if self.tool is None:
            return centres
        start, end = self.axis_spans[-1]
        share = (end - start) / end
        tip = centres[:, -1:]
        foot = tip + share * (centres[:, -2:-1] - tip)
        return np.concatenate([centres[:, :-1], foot, tip], axis=1)

    @cached_property
    def stations(self) -> FloatArray:
        """Arc length from O_1 to each joint centre, shape (N + 1,); [m]."""
        return frozen(np.concatenate([[0.0], np.cumsum(self.link_lengths)]))

    def summary(self) -> tuple[tuple[str, str], ...]:
        """Sizes, limits and what is mounted."""
        thin, thick = (quantity(r, "m") for r in (self.least_radius, self.most_radius))
        names = [name for name in (TOOL, FEED) if getattr(self, name)]
        mounted = *names, *(body.name for body in self.bodies)
        low, high = (quantity(x, "m") for x in self.base_range)
        return (
            ("name", self.name),
            ("links", f"{self.n_links}, {quantity(self.total_length, 'm')} together"),
            ("radius", thick if thin == thick else f"{thin} to {thick}"),
            ("largest link angle", quantity(self.max_link_angle, "rad")),
            ("largest joint angle", quantity(self.max_joint_angle, "rad")),
            ("rail", f"{low} to {high}"),
            ("mounted", ", ".join(mounted) or "nothing"),
        )

    @property
    def total_length(self) -> float:
        """Sum of the link lengths; [m]."""
        return float(self.stations[-1])

    @cached_property
    def ratios(self) -> FloatArray:
        """k_{i,N+1}: a joint centre's station over the tip's, (N + 1,); [-] (Eq. 5)."""
        return frozen(self.stations / self.stations[-1])

    def ratio(self, i: int, j: int) -> float:
        """k_{i,j}, joints counted from 1 as in the paper (Eq. 6).

        Raises:
            ZeroDivisionError: For j = 1 and i > 1, where the paper has infinity.
        """
        return (
            1.0 if i == j else float(self.stations[i - 1]) / float(self.stations[j - 1])
        )


def _hrm8() -> Manipulator:
    """The arm of the paper's Table 1; body radius from 261.5 - 200 mm."""
    lengths = np.array([486, 486, 486, 486, 486, 206, 206, 284]) / MM_PER_M
    limit = float(np.deg2rad(42.5))
    # r and d are not published; r stays inside the body, d inside half the last links.
    cables = CableLayout(0.050, 0.030, paper_hole_angles(8))
    # The paper calls the rail unrestricted; +-5 m exceeds every stroke of this arm.
    return Manipulator("hrm8", lengths, 0.0615, limit, limit, (-5.0, 5.0), cables)


BUILT_IN: Final[Mapping[str, Manipulator]] = MappingProxyType({"hrm8": _hrm8()})
"""The arms a problem file may name."""


def built_in(name: str) -> Manipulator:
    """The built-in arm of that name.

    Raises:
        UnknownName: If there is none.

    Example:
        >>> vp.built_in("hrm8").n_links
        8
    """
    if name not in BUILT_IN:
        raise UnknownName(kind="manipulator", name=name, known=tuple(BUILT_IN))
    return BUILT_IN[name]
