"""The lines of a certificate as models: what `vdsm schema certificate` describes."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, FiniteFloat, RootModel

from vdsm_pin.problem.any_problem import Joined

Number = Annotated[int, Field(ge=0)]
Share = Annotated[FiniteFloat, Field(ge=0.0, le=1.0)]
Sha256 = Annotated[str, Field(pattern="^[0-9a-f]{64}$")]
Error = Annotated[FiniteFloat, Field(ge=0.0)]
ShiftAndTurn = tuple[Error, Error]
Pair = tuple[str, str]
Normal = FiniteFloat
Point = tuple[FiniteFloat, FiniteFloat, FiniteFloat]
Plane = tuple[Number, Number, Normal, Normal, Normal, int | FiniteFloat]
Slice = tuple[Share, Share, Annotated[list[Plane], Field(min_length=1)]]


class LineModel(BaseModel):
    """Common rules: no unknown keys, nothing changes after it is built."""

    model_config = ConfigDict(extra="forbid", frozen=True, defer_build=True)


class AnyErrors(LineModel):
    """The errors that every clearance is proved under, of whatever moves."""

    base: ShiftAndTurn = Field(
        description="displacement of the base, in any direction [m], and turn about "
        "its origin [rad]"
    )
    obstacles: dict[str, ShiftAndTurn] = Field(
        description="by name, of each: displacement of its surface [m] and turn about "
        "the middle of the box around its corners [rad]"
    )


class ErrorLimits(AnyErrors):
    """Those of an arm."""

    joints_rad: list[Error] = Field(
        description="of alpha and theta of each joint in turn, either way"
    )


class RobotErrors(AnyErrors):
    """Those of any robot."""

    joints_rad: dict[str, Error] = Field(
        description="by name, of each joint that turns and follows no other, either way"
    )
    joints_m: dict[str, Error] = Field(description="of each one that slides")


class Primitive(LineModel):
    """A ball, capsule or box that holds a mesh: no, one or three edges."""

    origin_m: Point = Field(description="a corner, in the link's frame [m]")
    edges_m: list[Point] = Field(description="from there [m]")
    radius_m: Error = Field(description="by which that is grown [m]")


class LinkPieces(LineModel):
    """What a robot's link is made of, beyond what its URDF says."""

    order: list[Number] = Field(
        description="its pieces in the order in which planes count them; empty for "
        "that of the file"
    )
    meshes: list[list[Number] | Primitive] = Field(
        description="of each of its meshes the hull over each triangle, by numbers "
        "from 0, or what holds it; empty where each is one hull"
    )


class AnyHeader(LineModel):
    """Line 1, of whatever moves."""

    vdsm_certificate: Literal[9] = Field(default=9, description="version of the format")
    problem_sha256: Sha256 = Field(description="problem file and all that it names")
    trajectory_sha256: Sha256 = Field(description="the trajectory file")
    versions: dict[str, str] = Field(description="of the writer; told, not proved")
    interpolation: Joined = Field(
        description="what joins the rows: straight lines or smooth pieces"
    )
    pairs: list[Pair] = Field(
        description="moving body, `link 1` and so on, `tool`, `feed`, the name of what "
        "a link carries or of a robot's link, and what it is proved clear of: an "
        "obstacle's name, or another body at rest"
    )
    pieces: dict[str, list[Number] | list[list[Number]]] = Field(
        description="numbers of a mesh's triangles, none for their order by halves, or "
        "corner numbers of a prism's, in the order in which planes count them; of a "
        "mesh on a link the triangles under each of its hulls"
    )
    joined: dict[
        str,
        tuple[list[tuple[Number, Number]], list[tuple[Number, Number, Number, Number]]],
    ] = Field(
        description="by mesh the corners joined to close it, [corner, the one it is "
        "joined with], and seams, [three corners, where the edge beside them begins]; "
        "corner 3 k + i is corner i of triangle k, both from 0"
    )
    links: dict[str, LinkPieces] = Field(
        description="by name, of links that are not as their URDF says, those of other "
        "robots too"
    )


class HeaderLine(AnyHeader):
    """Line 1, of an arm."""

    errors: ErrorLimits


class RobotHeaderLine(AnyHeader):
    """Line 1, of any robot."""

    errors: RobotErrors
    topic: str | None = Field(description="of a bag, where the trajectory is one")


class IntervalLine(LineModel):
    """One line per interval."""

    k: Number = Field(description="the interval, from 0")
    proofs: list[Annotated[list[Slice], Field(min_length=1)]] = Field(
        description="per pair its slices [from, to, planes] of the interval; a plane "
        "is [first piece, one past the last, nx, ny, nz, clearance], n of any length, "
        "the clearance in 1e-10 m where it is a whole number, else in m"
    )


class LastLine(LineModel):
    """The seal."""

    end: Literal[True] = Field(description="this is the last line")
    sha256: Sha256 = Field(description="of all lines before")


class CertificateLine(
    RootModel[HeaderLine | RobotHeaderLine | IntervalLine | LastLine]
):
    """Every line of a certificate fits this."""


def certificate_schema() -> dict[str, Any]:
    """JSON Schema of each line of a certificate."""
    return CertificateLine.model_json_schema(mode="serialization")
