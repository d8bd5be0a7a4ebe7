"""Every exception the package raises on purpose.

    VdsmError
    ├── InvalidInput          exit 2: a file, field or argument is wrong
    │   ├── InvalidFile       names the file, the place in it and the expectation
    │   │   └── CannotWrite   a full disk, a folder that may not be written
    │   ├── UnknownName       lists the known names
    │   ├── InconsistentCables  no joint angles give these cable lengths
    │   └── WrongLinkLength   two joint centres are not one link length apart
    ├── Infeasible            exit 1: the problem is well-formed and has no plan here
    │   ├── OutOfReach        step 1 says no
    │   ├── LinkTooShort      a projected gap exceeds its link
    │   ├── LimitExceeded     a joint limit would be broken
    │   ├── StartBlocked      the arm as it starts is too close to an obstacle
    │   ├── StartFolded       two of its own bodies are too close to each other there
    │   ├── StartInside       the arm as it starts is inside a mesh
    │   ├── InsideUnknown     whether it is inside a mesh cannot be decided
    │   ├── PathBlocked       an obstacle is in the way of the tip
    │   ├── CutOff            proved: no way for the tip is wide enough
    │   ├── HemmedIn          proved: the last link has no room at the tip
    │   └── NoPlanFound       the search ended without a plan; not a proof
    │       └── NoWayOut      of the start, as finely as it was looked for
    ├── OutOfTime             exit 1: the time limit ended the work
    └── VerificationFailed    exit 1: a check could not be carried out
        └── CertificateTooLarge  proved, but too much to be read by the checker

Messages say what, where, how much and against what; the same facts are attributes.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vdsm_pin.text import printable
from vdsm_pin.units import MM_PER_M, clearance_words, in_mm


class VdsmError(Exception):
    """Base of all errors raised on purpose; as text one line that can be shown.

    Attributes:
        heading: What begins the text.
        notes: What was found of the problem, told before the message.
        more: What else is known of the work that failed, told after the message.
        page: A page that was written and tells more.

    Example:
        >>> try:
        ...     vp.read_problem("no/such.yaml")
        ... except vp.VdsmError as error:
        ...     print(type(error).__name__)
        InvalidFile
    """

    heading: str = ""
    notes: tuple[str, ...] = ()
    more: tuple[str, ...] = ()
    page: Path | None = None

    def __str__(self) -> str:
        """All of it, which may quote a file: every sign of it can be seen."""
        parts = *self.notes, super().__str__(), *self.more
        return printable(self.heading + "; ".join(parts))


class InvalidInput(VdsmError):
    """An input breaks its contract.

    Example:
        >>> try:
        ...     vp.ErrorBox(base_mm=-1.0)
        ... except vp.InvalidInput as error:
        ...     print(error)
        base error is -0.001 m, expected 0 or more
    """


class InvalidFile(InvalidInput):
    """A file breaks its contract.

    Args:
        file: The file as the user named it.
        where: Field or line inside the file; empty for the file as a whole.
        fault: What is wrong and what was expected.

    Attributes:
        others: What else is wrong in the file; as text the error tells how many
            there are.
    """

    def __init__(self, *, file: object, where: str = "", fault: str) -> None:
        self.file, self.where, self.fault = str(file), where, fault
        self.others: tuple[InvalidFile, ...] = ()
        place = f"{file}: {where}" if where else str(file)
        super().__init__(f"{place}: {fault}")

    def __str__(self) -> str:
        """The message, and how many more there are."""
        more = f" (and {len(self.others)} more)" if self.others else ""
        return self.alone + more

    @property
    def alone(self) -> str:
        """The message without the number of others, for who tells them all."""
        return super().__str__()


class CannotWrite(InvalidFile):
    """A result cannot be written.

    Attributes:
        reason: As the system says it.
    """

    def __init__(self, *, file: object, reason: str) -> None:
        self.reason = reason
        super().__init__(file=file, fault=f"cannot be written: {reason}")


class UnknownName(InvalidInput):
    """A name is not among the known ones."""

    def __init__(self, *, kind: str, name: str, known: tuple[str, ...]) -> None:
        self.kind, self.name, self.known = kind, name, known
        super().__init__(f"unknown {kind} {name!r}; known: {', '.join(known)}")


class InconsistentCables(InvalidInput):
    """Three cable lengths of a link that no two joint angles give."""

    def __init__(
        self, *, waypoint: int, link: int, residual: float, tolerance: float
    ) -> None:
        self.waypoint, self.link = waypoint, link
        self.residual, self.tolerance = residual, tolerance
        self.fault = f"the cable lengths of link {link} fit no joint angles"
        if math.isfinite(residual):
            self.fault += (
                f"; the nearest leave {residual * MM_PER_M:.3g} mm, expected "
                f"{tolerance * MM_PER_M:.1e} mm at most"
            )
        message = f"waypoint {waypoint}: {self.fault}"
        super().__init__(message)


class WrongLinkLength(InvalidInput):
    """Two adjacent joint centres that are not one link length apart."""

    def __init__(self, *, waypoint: int, link: int, gap: float, length: float) -> None:
        self.waypoint, self.link, self.gap, self.length = waypoint, link, gap, length
        self.fault = (
            f"o{link} and o{link + 1} are {gap * MM_PER_M:.6f} mm apart, expected the "
            f"length of link {link}, {length * MM_PER_M:.6f} mm"
        )
        super().__init__(f"waypoint {waypoint}: {self.fault}")


@dataclass(frozen=True, slots=True)
class Reached:
    """How far a search came.

    Args:
        words: All of it in words.
        station: Where along the desired path the first stretch begins that is not
            drawn; [m].
        link: Of the arm in question, the one nearest to an obstacle, from 1; 0 where
            nobody knows.
        obstacle: Name of that obstacle; empty where nobody knows.
        centres: Joint centres of the arm where it came farthest, base frame; none
            where nobody knows, then the arm in question is the straight one with its
            tip at the station; [m].
        narrowest: Where the best way in is narrowest, base frame; empty where there is
            no such way; [m].
    """

    words: str
    station: float = 0.0
    link: int = 0
    obstacle: str = ""
    centres: Sequence[Sequence[float]] = ()
    narrowest: Sequence[float] = ()

    def __str__(self) -> str:
        """The words."""
        return self.words


class Infeasible(VdsmError):
    """The problem is well-formed and this method has no plan for it.

    Example:
        >>> problem, far = vp.read_problem("paper/free"), np.array([[9.0, 9.0, 9.0]])
        >>> arm, path = problem.manipulator, vp.DesiredPath(problem.path.start, far)
        >>> try:
        ...     vp.plan(vp.Problem(arm, vp.Scene(), path, 0.0))
        ... except vp.Infeasible:
        ...     print("nobody reaches that far")
        nobody reaches that far
    """


class OutOfReach(Infeasible):
    """A tip position lies farther from the rail than the arm reaches.

    Args:
        place: Which position, in words: there are no waypoints yet.
        distance: From the rail; [m].
        reach: How far the arm reaches; [m].
        reason: What limits the reach.
    """

    def __init__(
        self, *, place: str, distance: float, reach: float, reason: str
    ) -> None:
        self.place, self.distance, self.reach = place, distance, reach
        message = (
            f"{place} lies {in_mm(distance)} from the rail, beyond the reach of "
            f"{in_mm(reach)} ({reason})"
        )
        super().__init__(message)


class LinkTooShort(Infeasible):
    """The projections of two adjacent joints are farther apart than the link."""

    def __init__(self, *, waypoint: int, link: int, gap: float, length: float) -> None:
        self.waypoint, self.link, self.gap, self.length = waypoint, link, gap, length
        message = (
            f"waypoint {waypoint}: projected gap {in_mm(gap)} exceeds "
            f"link {link} of length {in_mm(length)} (excess "
            f"{(gap - length) * MM_PER_M:.3e} mm)"
        )
        super().__init__(message)


class LimitExceeded(Infeasible):
    """A configuration breaks a joint limit."""

    def __init__(
        self, *, waypoint: int, quantity: str, value: float, limit: float, unit: str
    ) -> None:
        self.waypoint, self.quantity = waypoint, quantity
        self.value, self.limit, self.unit = value, limit, unit
        message = (
            f"waypoint {waypoint}: {quantity} is {value:.4f} {unit}, "
            f"the limit is {limit:.4f} {unit}"
        )
        super().__init__(message)


class StartBlocked(Infeasible):
    """The arm as it starts is too close to an obstacle.

    Args:
        link: Number of the link, from 1; 0 for the feed.
        obstacle: Name of the obstacle.
        clearance: Between the two; [m].
        required: What it must be; [m].
        bent: Whether the problem states the joints, not the tip of a straight arm.
        called: The link in words; 'link k' unless stated.
        deeper: Whether the clearance is that deep or deeper.
    """

    def __init__(
        self,
        *,
        link: int,
        obstacle: str,
        clearance: float,
        required: float,
        bent: bool,
        called: str = "",
        deeper: bool = False,
    ) -> None:
        self.link, self.obstacle = link, obstacle
        self.clearance, self.required = clearance, required
        message = (
            f"at its start {called or f'link {link}'} of the "
            f"{'' if bent else 'straight '}arm has "
            f"{clearance_words(clearance, deeper)} to obstacle "
            f"{obstacle!r}, required are {in_mm(required)}"
        )
        if not bent:
            message += "; `start: {joints: ...}` states a start that is bent"
        super().__init__(message)


class StartFolded(Infeasible):
    """Two bodies of the arm are too close to each other as it starts.

    Args:
        pair: Both in words.
        clearance: Between the two, at most; [m].
        required: What it must be; [m].
        deeper: Whether the clearance is that deep or deeper.
    """

    def __init__(
        self, *, pair: str, clearance: float, required: float, deeper: bool
    ) -> None:
        self.pair, self.clearance, self.required = pair, clearance, required
        super().__init__(
            f"at its start {pair} of the arm have "
            f"{clearance_words(clearance, deeper)}, required are {in_mm(required)}; "
            "`ignore_pairs` leaves out what may touch"
        )


class StartInside(Infeasible):
    """The arm as it starts is inside a mesh."""

    def __init__(self, *, obstacle: str) -> None:
        self.obstacle = obstacle
        super().__init__(f"at its start the arm is inside {obstacle!r}")


class InsideUnknown(Infeasible):
    """Whether the arm starts inside a mesh cannot be decided.

    Args:
        obstacle: Name of the mesh.
        reason: Why, in a sentence that names it.
    """

    def __init__(self, *, obstacle: str, reason: str) -> None:
        self.obstacle, self.reason = obstacle, reason
        super().__init__(reason)


class PathBlocked(Infeasible):
    """The tip cannot be brought past an obstacle by this method.

    Args:
        obstacle: Name of the obstacle.
        reason: Why not.
        station: Arc length of the place along the desired path, where it is one; [m].
    """

    def __init__(
        self, *, obstacle: str, reason: str, station: float | None = None
    ) -> None:
        self.obstacle, self.reason, self.station = obstacle, reason, station
        super().__init__(f"obstacle {obstacle!r} blocks the tip path: {reason}")


class CutOff(Infeasible):
    """Every way of the tip to a place is narrower than the body and its clearance.

    Args:
        station: Arc length of that place along the desired path; [m].
        narrowest: Where the best way is narrowest, in words; may be empty.
    """

    def __init__(self, *, station: float, narrowest: str = "") -> None:
        self.station, self.narrowest = station, narrowest
        message = (
            f"proved: every way of the tip to {in_mm(station)} along the path is "
            "narrower than the body and its clearance"
        )
        super().__init__(f"{message}; {narrowest}" if narrowest else message)


class HemmedIn(Infeasible):
    """At a place of the tip the last link is too close to obstacles however it lies.

    Args:
        station: Arc length of that place along the desired path; [m].
    """

    def __init__(self, *, station: float) -> None:
        self.station = station
        super().__init__(
            f"proved: with the tip at {in_mm(station)} along the path the last link is "
            "too close to an obstacle in every direction the joint limits leave it"
        )


class NoPlanFound(Infeasible):
    """The search ended without a plan; this proves nothing about the problem.

    Args:
        message: What was found instead.
        reached: How far the search came, where that is known.
    """

    def __init__(self, message: str, reached: Reached | None = None) -> None:
        self.reached = reached
        super().__init__(message)


class NoWayOut(NoPlanFound):
    """No way out of the start was found.

    Args:
        why: What keeps the arm there; empty if nobody knows.
    """

    def __init__(self, why: str = "") -> None:
        words = "no way out of the start was found"
        super().__init__(f"{words}: {why}" if why else words)


class OutOfTime(VdsmError):
    """The time limit ended the work; this proves nothing about the problem.

    Args:
        limit: The time limit; [s].
        reached: How far the work had come; empty if nobody knows.
    """

    def __init__(self, limit: float, reached: Reached | str = "") -> None:
        self.limit, self.reached = limit, reached
        message = f"the time limit of {limit:g} s came first"
        super().__init__(f"{message}; {reached}" if reached else message)


class VerificationFailed(VdsmError):
    """A check could not be carried out at all."""


class CertificateTooLarge(VerificationFailed):
    """A proof is more than a file can hold that is read again."""


def lacks_memory(error: BaseException) -> bool:
    """Whether an error, or one that led to it, is a lack of memory.

    A library for which there is no room is told as a file that cannot be opened.
    """
    told: BaseException | None = error
    while told is not None:
        if isinstance(told, MemoryError) or "failed to map segment" in str(told):
            return True
        told = told.__cause__ or told.__context__
    return False
