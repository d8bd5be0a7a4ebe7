"""Every tolerance of the package, with its unit and its reason."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Any, Final


def _held(value: float, unit: str) -> Any:
    """A field with its unit: m, rad, - or the ones it serves."""
    return field(default=value, metadata={"unit": unit})


@dataclass(frozen=True, slots=True)
class Tolerances:
    """The numbers that decide between equal and different."""

    joint_centre: float = _held(1e-9, "m")
    """Joint centres by Pinocchio against the closed form; [m].

    Both are sums of at most 40 products of order 1 m; 1e-12 is seen, 1e-9 promised.
    """

    tip_on_path: float = _held(1e-6, "m")
    """Tip against its start, its goal and, at a waypoint marked on_path, the desired
    path, where the problem states no `tip_tolerance`; [m]."""

    cable_round_trip: float = _held(1e-9, "rad")
    """Angles recovered from cable lengths; [rad]."""

    cable_length: float = _held(1e-11, "m")
    """Length by which three cables of a link may contradict each other; [m].

    Rounding of a 20 m cable summed over 40 joints is 1e-13 m; on a hole circle of
    10 mm, 1e-11 m are the promised 1e-9 rad.
    """

    cable_step: float = _held(1e-7, "-")
    """Newton step in tan(angle / 2) after which the next one is rounding; [-].

    The steps converge quadratically: the error after a step of 1e-7 is about 1e-14.
    """

    joint_limit: float = _held(0.999e-9, "rad")
    """Excess over theta/alpha/psi that counts as rounding of a CSV; [rad].

    The checker, which computes in balls, allows 1e-9: it accepts what rounding here
    leaves within this.
    """

    base_limit: float = _held(0.999e-9, "m")
    """Excess over the x0 range that counts as rounding of a CSV, as above; [m]."""

    planned_limit: float = _held(5e-10, "m and rad")
    """Excess over limits that counts as rounding where arms are planned; [m], [rad].

    The verification allows twice as much. A start at the end of the rail, or bent as
    far as may be, is not off by a rounding of 1e-15.
    """

    changed_angle: float = _held(8.726646259971648e-4, "rad")
    """A link angle above this counts as changed: 0.05 deg; [rad]."""

    widest_region: float = _held(5e-5, "m")
    """To what the widest danger region that draws as much is told; [m].

    Some fifteen plans of about 0.1 s each tell it so far.
    """

    row_change: float = _held(8.726646259971648e-2, "rad")
    """Largest change of a joint angle from row to row of a plan: 5 deg; [rad]."""

    start_joints: float = _held(1e-9, "m or rad")
    """Joint values of a start up to which the arm counts as straight; [m] and [rad]."""

    coverage: float = _held(1e-9, "-")
    """Coverage below the required one that counts as rounding of a CSV; [-]."""

    joint_error: float = _held(1e-5, "rad")
    """Width to which the largest certified joint error is bisected; [rad]."""

    flat_slope: float = _held(1e-4, "m/rad")
    """Slopes of a clearance up to this are rounding where a counterexample is sought.

    That is a lever of a tenth of a millimetre, and a ten-thousandth for the base.
    """

    least_bracket: float = _held(1e-6, "m")
    """Width to which the bracket of the least clearance is narrowed; [m]."""

    far_bracket: float = _held(0.75, "-")
    """Part of the clearance that a bracket of a pair far beyond what is required may be
    wide, in judging robots: no verdict hangs on it, and a new plane costs more; [-]."""

    coal_gjk: float = _held(1e-8, "m")
    """Coal's gjk_tolerance: 1e-6 is 1.5e-6 m unsafe, 1e-12 returns NaN; [m]."""

    coal_travel: float = _held(5e-4, "m")
    """Of each stretch of a motion in which the joint centres move by this much, Coal
    sees one row; it proves nothing, and rows that close add no evidence; [m]."""

    coal_agreement: float = _held(5e-6, "m")
    """Coal's distance against our bracket: beyond it the row is undecided; [m]."""

    bracket_gap: float = _held(1e-9, "m")
    """Upper minus lower at which a distance bracket counts as closed; [m]."""

    arithmetic: float = _held(1e-11, "m")
    """Bound of all rounding in one clearance evaluation for scenes within 100 m; [m].

    A coordinate is a sum of at most 40 terms below 100 m, each within 8 ulp of
    1.4e-14 m: 40 * 8 * 1.4e-14 = 4.5e-12 m.
    """

    scene_extent: float = _held(100.0, "m")
    """Largest coordinate in the base frame, for which `arithmetic` is derived; [m]."""

    mesh_extent: float = _held(10.0, "m")
    """Largest coordinate of a mesh in its own frame that is turned about its origin in
    floating point, which loses 5e-14 m there; [m]."""

    path_extent: float = _held(1e4, "m")
    """Largest path_m of a trajectory; [m].

    A closed path's length is known to 4 ulp of a double, so that after this many metres
    of laps the place on it is off by 5e-12 m, within `arithmetic`.
    """

    mesh_size_low: float = _held(1.0 / 300.0, "-")
    """Mesh diagonal over arm length below which the unit is taken to be wrong; [-].

    A millimetre taken for a metre is off by 1000; parts that matter to an arm are
    between a tenth and a few times its length.
    """

    mesh_size_high: float = _held(30.0, "-")
    """Mesh diagonal over arm length above which the unit is taken to be wrong; [-]."""

    flat_face: float = _held(1e-6, "-")
    """How far a face's corners may be off its plane, over the mesh's diagonal; [-].

    Files have six digits or more; what is off by less is their rounding.
    """

    mesh_gap: float = _held(2e-4, "-")
    """Gap over the mesh's diagonal that is joined where its inside is asked for; [-].

    Real files leave 1e-7 (single precision) to 1e-4 (parts meshed one by one); the arm,
    whose radius is larger, passes through none of these gaps.
    """

    mesh_wall: float = _held(1e-6, "-")
    """Wall over the mesh's diagonal that cannot be told from a face given twice; [-].

    A face written twice in single precision differs by some 1e-7.
    """

    mesh_flat: float = _held(1e-12, "-")
    """Height of a triangle over the mesh's diagonal up to which it has no area; [-].

    Corners in line before they are turned into the base frame are so to 1e-15 after.
    """

    straight_slope: float = _held(1e-10, "-")
    """Change of a link's slope dy/dL or dz/dL that counts as none; [-].

    Sums of a few products of order 1 leave 1e-15; over 3 m of arm 1e-10 moves the body
    by 3e-10 m, far below every clearance that is planned for.
    """

    on_path_length: float = _held(1e-9, "m")
    """Arc lengths closer than this are the same place on the desired path; [m]."""

    parallel: float = _held(1e-9, "-")
    """Sine of the angle below which two directions count as parallel; [-]."""

    circle_plane: float = _held(1e-6, "-")
    """How far the start of a circle may be off its plane, over its radius; [-].

    Files have six digits or more; what is off by less is their rounding.
    """

    rotation: float = _held(1e-9, "-")
    """How far R R^T may be off the identity, and a unit vector's length off 1; [-]."""

    quaternion: float = _held(1e-3, "-")
    """How far the length of a quaternion in a file may be from 1; [-].

    Programs write three digits or more; it is divided by its length.
    """

    still: float = _held(1e-9, "m or rad")
    """How far a joint may move where it must stand still; [m] and [rad]."""

    held_joint: float = _held(1e-6, "m or rad")
    """How far a joint that is judged at one value may be written elsewhere; [m] and
    [rad]."""

    mimicked_joint: float = _held(1e-3, "m or rad")
    """How far a joint that mimics another may be measured elsewhere; [m] and [rad]."""

    on_boundary: float = _held(1e-9, "m")
    """A point this little inside a planner's danger region is on its boundary; [m]."""

    planned_clearance: float = _held(1e-6, "m")
    """What a planner keeps beyond the clearance asked for; [m].

    Proved lower bounds and the digits of a CSV stay a hundred times closer than this.
    """

    planned_step: float = _held(8.552113334772214e-2, "rad")
    """Largest change of a joint angle per row the planner leaves: 4.9 deg; [rad].

    5 deg is asked for; the reserve covers the rounding of a CSV many times over.
    """

    planned_stray: float = _held(3.2e-6, "-")
    """How far from its path a planner lets the tip stray between two waypoints, over
    the arm's length; [-].

    The arm draws straight lines in joint space, not in space. hrm8 may stray by 10 um:
    on a path 10 mm a row it does by 7 um when straight; ten times less would take three
    times the rows.
    """

    planned_reserve: float = _held(3.2e-5, "-")
    """What the paper's planner keeps beyond that for the way between waypoints, over
    the arm's length; [-].

    Of hrm8 that is 0.1 mm: a joint that slides 10 mm a row on a region of radius 125 mm
    cuts as much off it; where that is not enough the refinement adds to it. It also
    makes proofs cheap: they cut time finely where the clearance just suffices.
    """

    whole_parts: float = _held(1e-9, "-")
    """Excess over a whole number of parts that counts as rounding; [-].

    1e6 rows leave 1e-10 of a row; without it a row of 10 mm would be cut in two.
    """

    search_gain: float = _held(1e-12, "m")
    """Cost by which one way must be cheaper than another to replace it; [m].

    Sums of some thousand costs of order 1 m leave 1e-13; without it rounding would keep
    a search that sweeps until nothing gets cheaper from ending.
    """

    result_change: float = _held(1e-6, "m, rad or -")
    """Difference of two results below which `vdsm diff` calls them equal; SI."""


TOLERANCES: Final = Tolerances()
"""The values in force. Reports print them all."""

UNITS: Final[Mapping[str, str]] = MappingProxyType(
    {one.name: one.metadata.get("unit", "") for one in fields(Tolerances)}
)
"""The unit of every tolerance, by name."""
