"""Models of what the JSON files hold: checks, approaches, errors, motions."""

from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat

from vdsm_pin.problem.any_problem import Joined
from vdsm_pin.report.words import BASE_ERROR

Point = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Range = tuple[FiniteFloat, FiniteFloat]
Limits = tuple[FiniteFloat | None, FiniteFloat | None]
VerdictWord = Annotated[
    Literal["certified", "incomplete", "refuted", "undecided"],
    Field(description="only certified counts as passed"),
]
_MOMENT: Final = "in waypoints, 12.25 is a quarter of the way from 12 to 13"
_TIME: Final = "when that is [s]; null where the trajectory has no times"
LINK: Final = (
    "links count from 1 at the base; of a robot of a URDF those with solids do, and "
    "`body` is the name; 0 is a feed's"
)
_BODY: Final = (
    "`tool`, `feed` or what a link carries where it is that; of a robot of a URDF the "
    "name of the link; null for a link of an arm"
)
_FRAME: Final = "in the frame of the problem file"
_DEEPER: Final = (
    "whether the link's axis meets the body: no depth beyond the link's radius is "
    "measured, so it may be deeper than this"
)
_COAL: Final = (
    "distance by Coal at `moment`, of the nominal motion; null where it was not asked "
    "or gave no usable answer"
)
CHANGED: Final = "number of changed link angles, mean over the length drawn"


class ResultModel(BaseModel):
    """Common rules: no unknown keys, nothing changes after it is built."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)

    def text(self) -> str:
        """The file's text; an undefined number is null, never a pass."""
        return self.model_dump_json(indent=2) + "\n"


class CheckRow(ResultModel):
    """One check; `worst` and `limit` are in `unit`."""

    name: str = Field(description="what was checked")
    verdict: VerdictWord
    count: int = Field(description="items checked")
    worst: FiniteFloat | None = Field(description="worst value; null: there is none")
    limit: FiniteFloat | None = Field(description="its limit; null: there is none")
    unit: str = Field(description="m, rad, share (of a whole, 0 to 1) or - (a number)")
    moment: FiniteFloat | None = Field(description=_MOMENT)
    time_s: FiniteFloat | None = Field(default=None, description=_TIME)
    first_moment: FiniteFloat | None = Field(
        default=None,
        description="when a clearance is first lost; null where it is not, or was not "
        f"looked for; {_MOMENT}",
    )
    last_moment: FiniteFloat | None = Field(
        default=None,
        description="when a clearance is last lost; null where it is not, or was not "
        f"looked for; {_MOMENT}",
    )
    too_close_intervals: int | None = Field(
        default=None,
        description="intervals in which a clearance is lost; null where it is not, or "
        "they were not counted",
    )
    too_close_stretches: int | None = Field(
        default=None, description="how many runs of neighbours those intervals make"
    )
    where: str = Field(description="place of the worst case in words, without moment")
    deeper: bool = Field(description=f"of worst: {_DEEPER}")


class ClosestRow(ResultModel):
    """One closest approach, of a link to an obstacle or to another link."""

    interval: int = Field(
        description="the bracket holds from waypoint `interval` to the next one"
    )
    moment: FiniteFloat = Field(description=f"when upper_m was found; {_MOMENT}")
    time_s: FiniteFloat | None = Field(default=None, description=_TIME)
    link: int = Field(description=LINK)
    body: str | None = Field(description=_BODY)
    obstacle: str | None = Field(description="its name; null in a pair of links")
    other_link: int | None = Field(description="null unless a pair of links")
    other_body: str | None = Field(description="as body, of the other link")
    lower_m: FiniteFloat | None = Field(description="proved lower bound")
    upper_m: FiniteFloat | None = Field(description="proved upper bound")
    station_m: FiniteFloat | None = Field(
        description="of link_point_m, along the link's axis from its first joint; "
        "of the feed back from O1, below 0"
    )
    link_point_m: Point | None = Field(description=f"on the link; {_FRAME}")
    other_point_m: Point | None = Field(description=f"on its partner; {_FRAME}")
    deeper: bool = Field(
        description=f"of upper_m, of lower_m where both are one: {_DEEPER}"
    )
    coal_m: FiniteFloat | None = Field(default=None, description=_COAL)


class MinClearance(ResultModel):
    """The smallest clearance from an obstacle in the whole motion."""

    lower_m: FiniteFloat | None = Field(description="proved lower bound")
    upper_m: FiniteFloat | None = Field(description="proved upper bound")
    moment: FiniteFloat = Field(description=f"when upper_m was found; {_MOMENT}")
    time_s: FiniteFloat | None = Field(default=None, description=_TIME)
    link: int = Field(description=LINK)
    body: str | None = Field(description=_BODY)
    obstacle: str = Field(description="name of the obstacle")
    deeper: bool = Field(
        description=f"of upper_m, of lower_m where both are one: {_DEEPER}"
    )
    coal_m: FiniteFloat | None = Field(default=None, description=_COAL)


class LeftOutRow(ResultModel):
    """Two bodies of the arm that are not held apart."""

    body: str = Field(description="`link 1` and so on, `tool`, or a name of the URDF")
    other: str = Field(description="the other one")
    reason: str = Field(description="why they are not")


class ObstacleErrorRow(ResultModel):
    """How far one obstacle may be off."""

    name: str = Field(description="its name")
    shift_m: FiniteFloat = Field(description="in any direction")
    turn_rad: FiniteFloat = Field(
        description="about the middle of the box around its corners"
    )


class JointErrorRow(ResultModel):
    """How far one joint of a robot may be off."""

    name: str = Field(description="its name")
    turn_rad: FiniteFloat = Field(description="of one that turns")
    shift_m: FiniteFloat = Field(description="of one that slides")


class ErrorBoxRow(ResultModel):
    """The errors of the real motion that the clearance proof was asked to cover."""

    joint_error_rad: FiniteFloat = Field(
        default=0.0,
        description="of the joint angle that may be off the most, either way",
    )
    joints_rad: tuple[tuple[FiniteFloat, FiniteFloat], ...] = Field(
        default=(), description="by joint of alpha and theta, where they differ"
    )
    base_error_m: FiniteFloat = Field(default=0.0, description=BASE_ERROR)
    base_error_rad: FiniteFloat = Field(
        default=0.0, description="turn of the base about its origin"
    )
    obstacle_error_m: FiniteFloat = Field(
        default=0.0, description="displacement of every surface"
    )
    obstacles: tuple[ObstacleErrorRow, ...] = Field(
        default=(), description="of single obstacles, where they are off by more"
    )
    slide_error_m: FiniteFloat = Field(
        default=0.0, description="of a robot's joints that slide"
    )
    named: tuple[JointErrorRow, ...] = Field(
        default=(), description="of single joints of a robot, where they err by more"
    )


class ErringJointRow(ResultModel):
    """A joint of a robot in a counterexample."""

    name: str = Field(description="as in the URDF")
    value_rad: FiniteFloat | None = Field(
        default=None, description="then, the error included; null of one that slides"
    )
    error_rad: FiniteFloat | None = Field(
        default=None, description="of it, the same throughout the motion"
    )
    value_m: FiniteFloat | None = Field(
        default=None, description="then, the error included; null of one that turns"
    )
    error_m: FiniteFloat | None = Field(
        default=None, description="of it, the same throughout the motion"
    )


class CounterexampleRow(ResultModel):
    """A motion within the error box that misses a required clearance."""

    moment: FiniteFloat = Field(description=f"when it does; {_MOMENT}")
    link: int = Field(description=LINK)
    body: str | None = Field(description=_BODY)
    obstacle: str | None = Field(description="its name; null in a pair of links")
    other_link: int | None = Field(description="null unless a pair of links")
    other_body: str | None = Field(description="as body, of the other link")
    x0_m: FiniteFloat | None = Field(
        default=None, description="base position then, its error included; of an arm"
    )
    x0_error_m: FiniteFloat | None = Field(
        default=None, description="of it, off the nominal one; of an arm"
    )
    angles_rad: tuple[FiniteFloat, ...] = Field(
        default=(), description="alpha1, theta1, alpha2, .. then, with their errors"
    )
    angle_errors_rad: tuple[FiniteFloat, ...] = Field(
        default=(),
        description="of them, off the nominal ones, the same throughout the motion",
    )
    joints: tuple[ErringJointRow, ...] = Field(
        default=(), description="of any other robot, in place of these"
    )
    clearance_m: FiniteFloat = Field(
        description="proved upper bound, the obstacle's displacement taken off"
    )
    required_m: FiniteFloat = Field(description="what it falls short of")
    link_point_m: Point | None = Field(description=f"on the link; {_FRAME}")
    other_point_m: Point | None = Field(
        description=f"on the partner where it stands nominally; {_FRAME}"
    )
    deeper: bool = Field(description=f"of clearance_m: {_DEEPER}")


class ToleranceRow(ResultModel):
    """One tolerance in force."""

    value: FiniteFloat = Field(description="in `unit`")
    unit: str = Field(description="m, rad, - or those it serves")


class MotionFacts(ResultModel):
    """What the arm does over the motion; changed link angles at the waypoints."""

    waypoints: int = Field(description="rows of the trajectory")
    on_path_waypoints: int | None = Field(
        description="those with the tip on the desired path; null where there is none"
    )
    max_link_angle_rad: tuple[FiniteFloat, ...] = Field(
        description="largest link angle psi of each joint, from the base to the tip"
    )
    x0_min_m: FiniteFloat = Field(description="smallest base position")
    x0_max_m: FiniteFloat = Field(description="largest base position")
    changed_angle_threshold_rad: FiniteFloat = Field(
        description="a link angle above it counts as changed"
    )
    changed_angles_mean_on_path: FiniteFloat | None = Field(
        description=f"{CHANGED}; null where no waypoint is on the path"
    )
    changed_angles_max: int = Field(description="most of them at any waypoint")


class JointRow(ResultModel):
    """One joint of a robot and where it goes over the motion."""

    name: str = Field(description="as in the URDF")
    range_rad: Range | None = Field(
        default=None, description="of its values; null for one that slides"
    )
    range_m: Range | None = Field(
        default=None, description="of its values; null for one that turns"
    )
    limits_rad: Limits | None = Field(
        default=None, description="lower and upper; null where there is none"
    )
    limits_m: Limits | None = Field(
        default=None, description="lower and upper; null where there is none"
    )


class RobotFacts(ResultModel):
    """What a robot of a URDF does over the motion."""

    waypoints: int = Field(description="rows of the trajectory")
    robot: str = Field(description="its name in the URDF")
    interpolation: Joined = Field(description="what joins the waypoints")
    bodies: str = Field(description="what stands for the solids of its links")
    links: tuple[str, ...] = Field(description="those with solids, link 1 first")
    joints: tuple[JointRow, ...] = Field(description="those that the motion moves")


class Hashes(ResultModel):
    """SHA-256 of the inputs; empty where there was none."""

    problem_sha256: str = Field(description="problem file and the meshes it names")
    trajectory_sha256: str = Field(description="trajectory.csv")
    urdf_sha256: str = Field(description="URDF of the arm or robot")


class AdjustmentRow(ResultModel):
    """What a link missed after a round, and what was done about it."""

    round: int = Field(description="after which round of planning, from 1")
    moment: FiniteFloat = Field(description=f"where it was missed; {_MOMENT}")
    link: int = Field(description=LINK)
    obstacle: str = Field(description="name of the obstacle")
    measured_by: Literal["Coal", "proof"] = Field(
        description="Coal at a waypoint, or the proof over an interval"
    )
    distance_m: FiniteFloat | None = Field(description="what it found")
    margin_m: FiniteFloat | None = Field(
        description="kept by this link from this obstacle beyond the required "
        "clearance in the next round; null where joints moved instead"
    )
    region_m: FiniteFloat | None = Field(
        default=None,
        description="where joints moved, how far the danger region of this obstacle is "
        "grown for this link from then on",
    )
    link_point_m: Point | None = Field(
        default=None, description=f"Coal's witness on the link; {_FRAME}"
    )
    other_point_m: Point | None = Field(
        default=None, description=f"Coal's witness on the obstacle; {_FRAME}"
    )
    normal: Point | None = Field(
        default=None,
        description=f"by Coal, from the obstacle to the link, a unit vector; {_FRAME}",
    )
    joints: tuple[int, ...] = Field(
        default=(),
        description="those that slid on along their auxiliary line, by their numbers",
    )
    moved_m: FiniteFloat | None = Field(default=None, description="how far they did")
