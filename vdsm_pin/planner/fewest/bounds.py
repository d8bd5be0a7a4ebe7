"""What can be proved about a problem: tips no arm reaches, angles no plan can spare.

Every proof here rests on a necessary condition. A tip beyond the curled reach or within
an obstacle's margin cannot be drawn (`passage.py` finds those no way leads to,
`last_link.py` those where the last link has no room). An arm without a changed link
angle lies along the rail, and an arm with one lies along it up to that joint, but for a
sway that is bounded (`sway.py`): N postures for each tip, and where none of them comes
near being clear a second angle must change.
"""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.geometry.bodies import new_body
from vdsm_pin.geometry.compiled import borrowed, compiled
from vdsm_pin.geometry.kernels import BRACKET, NORMAL, SCRATCH_ROWS, UPPER
from vdsm_pin.geometry.obstacles import STACK, obstacle_bracket
from vdsm_pin.geometry.pieces import PackedPieces, pack_pieces
from vdsm_pin.planner.feasibility import curled_reach
from vdsm_pin.planner.fewest.kernels import pose_shapes
from vdsm_pin.planner.fewest.sway import sway
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES

GOAL: Final = TOLERANCES.bracket_gap
"""Width of a bracket at which to stop; [m]."""


@dataclass(frozen=True)
class TipProof:
    """Which tips nobody can reach.

    Args:
        far: Beyond the reach of the curled arm, shape (n,).
        buried: Within the margin of an obstacle, shape (n,).
        cut_off: No way leads there from the start, shape (n,).
        hemmed_in: The last link has no room there, shape (n,).
    """

    far: BoolArray
    buried: BoolArray
    cut_off: BoolArray
    hemmed_in: BoolArray

    @property
    def closed(self) -> BoolArray:
        """Any of them, shape (n,)."""
        return self.far | self.buried | self.cut_off | self.hemmed_in


@compiled
def upper_bounds(pieces: PackedPieces, segments: FloatArray) -> FloatArray:
    """Proved upper bounds of the distance of segments to each obstacle.

    Args:
        pieces: The scene.
        segments: Shape (n, 2, 3); [m].

    Returns:
        Shape (n, n_obstacles); [m].
    """
    pieces = borrowed(pieces)
    count = pieces.root.size
    result = np.full((segments.shape[0], count), np.inf)
    scratch = np.zeros((SCRATCH_ROWS + 2, 3))
    stack = np.zeros(STACK, np.int64)
    trial, out = np.zeros(BRACKET + 4), np.zeros(BRACKET + 4)
    body = new_body(2, 0)
    for n in range(segments.shape[0]):
        body.points[:] = segments[n]
        for o in range(count):
            out[NORMAL : NORMAL + 3] = 1.0
            obstacle_bracket(pieces, o, body, GOAL, scratch, stack, trial, out)
            result[n, o] = out[UPPER]
    return result


def upper_clearance(problem: PlanningProblem, segments: FloatArray) -> FloatArray:
    """Upper bounds of the clearance of links along segments to each obstacle.

    Each rests on two points, one of the link and one of the obstacle's surface.

    Args:
        problem: Arm and scene.
        segments: Axes of links, shape (n, 2, 3); [m].

    Returns:
        Shape (n, n_obstacles); [m].
    """
    obstacles = problem.scene.obstacles
    if not obstacles:
        return np.full((len(segments), 0), np.inf)
    pieces = pack_pieces([obstacle.pieces for obstacle in obstacles])
    upper = upper_bounds(pieces, np.ascontiguousarray(segments))
    return np.asarray(upper - problem.manipulator.link_radius)


def prove_tips(
    problem: PlanningProblem, clearance: LinkClearance, tips: FloatArray
) -> TipProof:
    """Tips that no configuration reaches with the required clearance.

    Args:
        problem: Arm, scene, required clearance.
        clearance: Lower bounds, which tell where a proof is worth trying.
        tips: Shape (n, 3); [m].
    """
    reach = curled_reach(problem.manipulator)
    far = np.hypot(tips[:, 1], tips[:, 2]) > reach + TOLERANCES.tip_on_path
    points = np.stack([tips, tips], axis=1)
    buried = clearance(points)[:, 0] < problem.required_clearance
    near = np.flatnonzero(buried)
    upper = upper_clearance(problem, points[near]).min(axis=1, initial=np.inf)
    buried[near] = upper < problem.required_clearance - TOLERANCES.bracket_gap
    none = np.zeros(len(tips), dtype=np.bool_)
    return TipProof(far, buried, none, none)


def least_changed(
    problem: PlanningProblem, clearance: LinkClearance, tips: FloatArray
) -> IntArray:
    """Proved lower bounds of the number of changed link angles, shape (n,).

    Args:
        problem: Arm, scene, required clearance.
        clearance: Lower bounds, which tell where a proof is worth trying.
        tips: Shape (n, 3); [m].

    Returns:
        0 where the tip is within the sway of unchanged angles of the rail, 1 elsewhere,
        and 2 where every posture with one changed angle breaks a limit or the clearance
        whatever the unchanged ones do below their threshold.
    """
    arm = problem.manipulator
    n_links = arm.n_links
    off = np.hypot(tips[:, 1], tips[:, 2])
    slack = sway(arm, off)
    least = np.where(off > slack.straight, 1, 0)
    if np.isnan(slack.bend).any():
        return least
    reserve = float(np.nanmax(slack.body, initial=0.0))
    low, high = arm.base_range
    knees = np.arange(n_links)
    everywhere, straight = np.ones(len(tips), dtype=np.bool_), np.zeros((n_links, 2))
    node, ends, bends = pose_shapes(
        np.ascontiguousarray(tips), everywhere, knees, straight, arm.stations,
        float(slack.bend.max()), low - reserve, high + reserve,
    )  # fmt: skip
    possible = bends.max(axis=1, initial=0.0) <= slack.bend[node % n_links]
    node, ends = node[possible], ends[possible]
    tip, joint = node // n_links, node % n_links
    required = problem.required_clearance - TOLERANCES.bracket_gap
    free = np.zeros(len(tips), dtype=np.bool_)
    free[tip[clearance(ends).min(axis=1) >= required]] = True
    doubtful = np.flatnonzero(~free[tip])
    for part in (0, 1):
        segments = ends[doubtful, part : part + 2]
        upper = upper_clearance(problem, segments).min(axis=1, initial=np.inf)
        upper = upper + slack.body[tip[doubtful], joint[doubtful]]
        doubtful = doubtful[~(upper < required)]
    free[tip[doubtful]] = True
    return np.asarray(np.where(free | (least == 0), least, 2))


def culprit(problem: PlanningProblem, centres: FloatArray) -> tuple[int, str, float]:
    """The link nearest to an obstacle, that obstacle, and the clearance's upper bound.

    Args:
        problem: Arm and scene.
        centres: Joint centres of one configuration, shape (N + 1, 3); [m].
    """
    upper = upper_clearance(problem, np.stack([centres[:-1], centres[1:]], axis=1))
    link, obstacle = np.unravel_index(int(np.argmin(upper)), upper.shape)
    name = problem.scene.obstacles[int(obstacle)].name
    return int(link) + 1, name, float(upper[link, obstacle])
