"""centres.csv and cables.csv: waypoints in other coordinates than joint angles.

    waypoint,on_path,path_m,o1_x_m,o1_y_m,o1_z_m,..,o{N+1}_z_m
    waypoint,on_path,path_m,x0_m,l1a_m,l1b_m,l1c_m,..,lNc_m

Points are in the frame of the problem file. A file of another program may leave
`on_path` and `path_m` out: its waypoints then claim to draw nothing.
"""

from pathlib import Path
from typing import Final

import numpy as np

from vdsm_pin.arm.cables import angles_from_cables
from vdsm_pin.arm.kinematics import joint_angles
from vdsm_pin.errors import InconsistentCables, InvalidFile, WrongLinkLength
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.source import check_is_file, readable
from vdsm_pin.io.tables import Table, open_text
from vdsm_pin.io.trajectory_file import LENGTH, PLACE, WAYPOINT, read_waypoints
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import MM_PER_M

HOLES: Final = "abc"


def centre_columns(n_links: int) -> tuple[str, ...]:
    """Names of the columns of the joint centres of an arm of N links."""
    return tuple(f"o{i}_{x}_m" for i in range(1, n_links + 2) for x in "xyz")


def cable_columns(n_links: int) -> tuple[str, ...]:
    """Names of the columns of the base position and of the cables of N links."""
    cables = (f"l{j}{hole}_m" for j in range(1, n_links + 1) for hole in HOLES)
    return ("x0_m", *cables)


def read_centres(path: Path, problem: PlanningProblem) -> Trajectory:
    """The motion whose joint centres stand in a file (Eq. 11-15).

    Args:
        path: The CSV file.
        problem: The arm, and the frame of the file.

    Raises:
        InvalidFile: If the file breaks its contract, two centres are not one link
            apart, or the first one is not on the rail. Names the line.
    """
    arm, pose = problem.manipulator, problem.T_world_base
    table, notes = _read(path, centre_columns(arm.n_links))
    points = table[:, 3:].reshape(len(table), arm.n_links + 1, 3)
    centres = np.ascontiguousarray((points - pose[:3, 3]) @ pose[:3, :3])
    off = np.hypot(centres[:, 0, 1], centres[:, 0, 2])
    row = int(np.argmax(off))
    if not off[row] <= TOLERANCES.joint_centre:
        away = f"{off[row] * MM_PER_M:.3g} mm"
        raise _bad_row(path, row, f"o1 is {away} off the rail, expected on it")
    try:
        alpha, theta = joint_angles(arm, centres)
    except WrongLinkLength as error:
        raise _bad_row(path, error.waypoint, error.fault) from None
    place = table[:, 1] != 0.0, table[:, 2]
    return Trajectory(*place, centres[:, 0, 0], alpha, theta, notes)


def read_cables(path: Path, problem: PlanningProblem) -> Trajectory:
    """The motion whose cable lengths stand in a file (Eq. 16-21 inverted).

    Args:
        path: The CSV file.
        problem: The arm with its cable holes.

    Raises:
        InvalidFile: If the file breaks its contract or lengths fit no angles. Names
            the line.
    """
    arm = problem.manipulator
    table, notes = _read(path, cable_columns(arm.n_links))
    lengths = table[:, 4:].reshape(len(table), arm.n_links, 3)
    try:
        alpha, theta = angles_from_cables(arm, np.ascontiguousarray(lengths))
    except InconsistentCables as error:
        raise _bad_row(path, error.waypoint, error.fault) from None
    place = table[:, 1] != 0.0, table[:, 2]
    return Trajectory(*place, table[:, 3], alpha, theta, notes)


def _read(path: Path, columns: tuple[str, ...]) -> tuple[FloatArray, tuple[str, ...]]:
    """All rows: waypoint, on_path, path_m, the columns, shape (n, 3 + m); notes."""
    check_is_file(path)
    with readable(path), open_text(path) as text:
        found = Table(path, text, {WAYPOINT, *columns}.__contains__)
        places = PLACE if set(PLACE) & set(found.names) else ()
        found.choose((WAYPOINT, *places, *columns))
        table = read_waypoints(found)
    for name in columns:
        near = np.abs(table[name]) <= TOLERANCES.scene_extent
        table.check(name, near, LENGTH)
    rows = table.rows if places else np.insert(table.rows, [1, 1], 0.0, axis=1)
    return rows, found.notes


def _bad_row(path: Path, row: int, fault: str) -> InvalidFile:
    return InvalidFile(file=path, where=f"line {row + 2}", fault=fault)
