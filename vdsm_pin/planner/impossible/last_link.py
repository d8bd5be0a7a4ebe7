"""Which tips are hemmed in: proved, as the last link has no way to lie there.

Let the last link lean by l from the rail, in the direction e across it. Adjoining links
differ by at most w, so link i of N is within a = min(i w, 180 deg) of the rail and
within b = min((N - i) w, 180 deg) of the last one. Its part along e is therefore at
least that of the first bound and, with s = 90 deg - |90 deg - l|, of the second:

    -sin(min(a, 90 deg)),   sin(max(s - b, -90 deg)) .

With d its direction and x the rail's, cos b <= d . (cos l x + sin l e). Where the last
link leans back, l > 90 deg, d . x >= cos a makes that

    (cos b - cos l cos a) / sin l .

All links together go from the rail to the tip. That leaves the last one only some
directions: a long link cannot lie square to the rail at a tip near the rail. A tip is
hemmed in if each of those is too close to an obstacle.

Directions are cut into cells of lean and turn round the rail. Turned by d, a link has
no point that moves farther than d times its distance from the tip, so a cell is shut if
part of the link in its middle is too close by more than that. Other cells are halved.
"""

from typing import Final

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.planner.upper_clearance import upper_clearance
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES

LEANS: Final = 4
TURNS: Final = 8
"""Cells of lean and of turn begun with."""
HALVINGS: Final = 14
"""Halvings of a cell at which a tip is given up."""
MOST: Final = 1000
"""Cells of one tip at which it is given up."""
PARTS: Final = (0.25, 0.5, 1.0)
"""Parts of the link, from the tip, that are held against obstacles; [-]."""
SQUARE: Final = np.pi / 2.0
STEEPEST: Final = 3.1
"""Lean up to which the third bound is asked; [rad]."""


def hemmed_in(
    problem: PlanningProblem, clearance: LinkClearance, tips: FloatArray
) -> BoolArray:
    """Tips at which every posture of the last link is blocked; proved.

    Args:
        problem: Arm, limits, scene, required clearance.
        clearance: Lower bounds, which tell where a proof is hopeless.
        tips: Shape (n, 3); [m].

    Returns:
        Shape (n,).
    """
    arm = problem.manipulator
    proved = np.zeros(len(tips), dtype=np.bool_)
    if not len(tips) or not problem.scene.obstacles:
        return proved
    proved[:] = True
    tip, cells = _first_cells(arm, len(tips))
    for _ in range(HALVINGS):
        possible = _within_limits(problem, tips[tip], cells)
        tip, cells = tip[possible], cells[possible]
        links = _links(tips[tip], cells, arm.link_lengths[-1])
        middle = np.repeat(cells.mean(axis=2, keepdims=True), 2, axis=2)
        likely = np.flatnonzero(_within_limits(problem, tips[tip], middle))
        open_ = clearance(links[likely])[:, 0] >= problem.required_clearance
        proved[tip[likely[open_]]] = False
        proved[np.bincount(tip, minlength=len(tips)) > MOST] = False
        rest = np.flatnonzero(proved[tip])
        shut = _shut(problem, clearance, links[rest], _turned(cells[rest]))
        rest = rest[~shut]
        if not rest.size:
            return proved
        tip, cells = np.repeat(tip[rest], 2), _halved(cells[rest])
    proved[tip] = False
    return proved


def _first_cells(arm: Manipulator, count: int) -> tuple[IntArray, FloatArray]:
    """Every direction at every tip: the tip, and least and largest lean and turn.

    Returns:
        Shape (m,) and (m, 2, 2), [cell, lean or turn, least or largest]; [rad].
    """
    number = np.stack(np.meshgrid(np.arange(LEANS), np.arange(TURNS)), -1).reshape(
        -1, 2
    )
    size = np.array([np.pi / LEANS, 2.0 * np.pi / TURNS])
    cells = np.stack([number * size, (number + 1) * size], axis=2)
    return np.repeat(np.arange(count), len(cells)), np.tile(cells, (count, 1, 1))


def _least_along(arm: Manipulator, leans: FloatArray) -> FloatArray:
    """The bounds above of each link's part along e, shape (m, N); [-].

    Args:
        arm: Its limits.
        leans: Least and largest lean of the last link, both on one side of 90 deg,
            shape (m, 2); [rad].
    """
    turn = arm.max_link_angle + TOLERANCES.joint_limit
    link = np.arange(1, arm.n_links + 1)
    rail, last = np.minimum(np.stack([link, arm.n_links - link]) * turn, np.pi)
    square = SQUARE - np.abs(SQUARE - leans).max(axis=1)
    along = np.sin(np.maximum(square[:, None] - last, -SQUARE))
    along = np.maximum(along, -np.sin(np.minimum(rail, SQUARE)))
    # Not where sin l may vanish: there the third bound is no number.
    back = (leans[:, 0] >= SQUARE) & (leans[:, 1] <= STEEPEST)
    low, high = leans[back, :1], leans[back, 1:]
    # It is least at an end of the cell or where cos l = cos a / cos b.
    a, b = np.cos(rail), np.cos(last)
    ratio = np.clip(a / np.where(b > 0.0, b, 1.0), -1.0, 1.0)
    places = (low, high, np.clip(np.arccos(ratio), low, high))
    third = [(b - np.cos(lean) * a) / np.sin(lean) for lean in places]
    along[back] = np.maximum(along[back], np.minimum.reduce(third))
    return np.asarray(along)


def _within_limits(
    problem: PlanningProblem, tips: FloatArray, cells: FloatArray
) -> BoolArray:
    """Where the limits may leave the last link some direction of a cell, shape (m,)."""
    arm = problem.manipulator
    share = _least_along(arm, cells[:, 0])
    # The tip is at most so far out along any e of the cell.
    low, high = cells[:, 1].T
    off, at = np.hypot(tips[:, 1], tips[:, 2]), np.arctan2(tips[:, 2], tips[:, 1])
    out = off * (np.cos((low + high) / 2.0 - at) + (high - low) / 2.0)
    reserve = problem.tip_tolerance + TOLERANCES.bracket_gap
    bent = arm.n_links * (arm.max_link_angle + TOLERANCES.joint_limit)
    possible = out + reserve >= share @ arm.link_lengths
    return np.asarray(possible & (cells[:, 0, 0] <= bent))


def _links(tips: FloatArray, cells: FloatArray, length: float) -> FloatArray:
    """The last link in the middle of each cell, from the tip, shape (m, 2, 3); [m]."""
    lean, turn = cells.mean(axis=2).T
    axis = [np.cos(lean), np.sin(lean) * np.cos(turn), np.sin(lean) * np.sin(turn)]
    return np.stack([tips, tips - length * np.stack(axis, axis=1)], axis=1)


def _turned(cells: FloatArray) -> FloatArray:
    """Largest angle of a cell's directions from its middle, shape (m,); [rad]."""
    lean, turn = (cells[:, :, 1] - cells[:, :, 0]).T
    low, high = cells[:, 0].T
    widest = np.sin(np.clip(SQUARE, low, high))
    return np.asarray((lean + widest * turn) / 2.0)


def _shut(
    problem: PlanningProblem,
    clearance: LinkClearance,
    links: FloatArray,
    turned: FloatArray,
) -> BoolArray:
    """Whether links stay too close to some obstacle however they turn so far."""
    shut = np.zeros(len(links), dtype=np.bool_)
    need = problem.required_clearance - TOLERANCES.bracket_gap - problem.tip_tolerance
    for part in PARTS:
        left = np.flatnonzero(~shut)
        ends = links[left]
        ends[:, 1] = ends[:, 0] + part * (ends[:, 1] - ends[:, 0])
        moved = part * problem.manipulator.link_lengths[-1] * turned[left]
        near = clearance(ends)[:, 0] + moved < need
        left, ends, moved = left[near], ends[near], moved[near]
        clearances = upper_clearance(problem, ends).min(axis=1, initial=np.inf)
        shut[left] = clearances + moved < need
    return shut


def _halved(cells: FloatArray) -> FloatArray:
    """Both halves of each cell, cut across its longer side, shape (2 m, 2, 2)."""
    lean, turn = (cells[:, :, 1] - cells[:, :, 0]).T
    side = (np.sin(cells[:, 0].mean(axis=1)) * turn > lean).astype(np.int64)
    rows = np.arange(len(cells))
    middle = cells.mean(axis=2)[rows, side]
    halves = np.repeat(cells, 2, axis=0)
    halves[2 * rows, side, 1] = middle
    halves[2 * rows + 1, side, 0] = middle
    return halves
