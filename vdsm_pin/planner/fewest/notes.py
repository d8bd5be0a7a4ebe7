"""What is told of a plan: its order, what it leaves out, what is proved of it."""

import itertools
from contextlib import suppress

import numpy as np

from vdsm_pin.errors import OutOfTime
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.fewest.explore import Explored
from vdsm_pin.planner.fewest.motion import Corners
from vdsm_pin.planner.fewest.offset_kernels import bends_of
from vdsm_pin.planner.impossible.bounds import least_changed
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.planner.upper_clearance import TIP_ONLY, held_from, upper_clearance
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.units import in_mm


def notes_of(
    problem: PlanningProblem,
    clearance: LinkClearance,
    outcome: Explored,
    trajectory: Trajectory,
    centres: FloatArray,
) -> tuple[str, ...]:
    """Notes of a plan: its order, how sparse it is, what is proved.

    Args:
        problem: What was asked.
        clearance: Clearance of links at given joint centres.
        outcome: What the search came to.
        trajectory: The plan's rows.
        centres: Joint centres of every row, shape (r, N + 1, 3); [m].

    Returns:
        One sentence each.
    """
    notes = _order(problem, outcome)
    on_path = trajectory.on_path
    if not on_path.any():
        return tuple(notes)
    angles = bends_of(centres[on_path])
    changed = (angles > TOLERANCES.changed_angle).sum(axis=1)
    tips = centres[on_path, -1]
    # No more than two are ever proved necessary.
    few, least = changed <= 2, np.zeros_like(changed)
    with suppress(OutOfTime):  # then nothing is said of it
        least[few] = least_changed(held_from(problem), clearance, tips[few])
    if (changed < least).any():
        worst = int(np.flatnonzero(changed < least)[0])
        message = (
            f"internal error: at tip {tips[worst].tolist()} the plan changes "
            f"{changed[worst]} link angles and {least[worst]} were proved necessary"
        )
        raise RuntimeError(message)
    notes += minimal(changed, least)
    connections = _connections(on_path)
    if len(connections) > 1:
        often = "once" if len(connections) == 2 else f"{len(connections) - 1} times"
        notes.append(f"the tip leaves the path {often} to let the arm change sides")
    retreat = problem.path.retreat
    back = _farthest_back(centres[:, -1], connections)
    if back > retreat + TOLERANCES.tip_on_path:
        notes.append(
            f"off the path the tip steps back by up to {in_mm(back)}, more than the "
            f"retreat of {in_mm(retreat)}: no change of sides was found within it"
        )
    return tuple(notes)


def minimal(changed: IntArray, least: IntArray) -> list[str]:
    """At how many waypoints as few link angles change as must; nothing if nowhere."""
    proved = int((changed == least).sum())
    if not proved:
        return []
    return [
        f"the number of changed link angles is proved minimal at {proved} of "
        f"{len(changed)} waypoints on the path: fewer, counting up to "
        f"{np.rad2deg(TOLERANCES.changed_angle):.2g}° as unchanged, would break a "
        "limit or the clearance there"
    ]


def _connections(on_path: BoolArray) -> list[tuple[int, int]]:
    """Runs of rows off the path: their first row and the row past their last."""
    marks = np.flatnonzero(np.diff(on_path.astype(np.int64))) + 1
    edges = [0, *marks.tolist(), len(on_path)]
    return [(a, b) for a, b in itertools.pairwise(edges) if not on_path[a]]


def _farthest_back(tips: FloatArray, connections: list[tuple[int, int]]) -> float:
    """How far the tip goes behind both ends of a way; [m]."""
    worst = 0.0
    for a, b in connections:
        ends = min(tips[max(a - 1, 0), 0], tips[min(b, len(tips) - 1), 0])
        worst = max(worst, float(ends - tips[a:b, 0].min()))
    return worst


def _order(problem: PlanningProblem, outcome: Explored) -> list[str]:
    """In which order and directions the pieces are drawn, where it is not as given."""
    assert outcome.found is not None
    ends = _pieces(outcome.found.corners)
    if all(np.diff(np.array(ends).ravel()) >= 0.0):
        return []
    pieces = ", then ".join(_stretch(problem, a, b) for a, b in ends)
    return [f"drawn in another order than given, as the problem allows: {pieces}"]


def _pieces(corners: Corners) -> list[tuple[float, float]]:
    """Stations between which the path is drawn in one direction, piece by piece."""
    pieces: list[tuple[float, float]] = []
    going, way = False, 0.0
    for k, drawn in enumerate(corners.drawn.tolist()):
        a, b = float(corners.stations[k]), float(corners.stations[k + 1])
        if drawn and going and (b - a) * way >= 0.0:
            pieces[-1] = (pieces[-1][0], b)
            way = way or b - a
        elif drawn:
            pieces.append((a, b))
            way = b - a
        going = drawn
    return pieces


def undrawn(problem: PlanningProblem, outcome: Explored) -> tuple[str, ...]:
    """Each stretch that is not drawn, and why."""
    assert outcome.found is not None
    route = outcome.found.route
    stretches = []
    stretch: list[int] = []
    skipped = outcome.found.skipped
    for k, after in itertools.zip_longest(skipped, skipped[1:]):
        stretch.append(k)
        if after == k + 1 and route.undrawable[after] == route.undrawable[k]:
            continue
        a, b = float(route.stations[stretch[0] - 1]), float(route.stations[k])
        why = "no way was found, which proves nothing"
        if route.undrawable[k]:
            why = f"proved: {_why_undrawable(problem, outcome, a, b)}"
        stretches.append(f"{_stretch(problem, a, b)} along the path ({why})")
        stretch = []
    return tuple(stretches)


def _stretch(problem: PlanningProblem, a: float, b: float) -> str:
    """Where a stretch of the path begins and ends, in words."""
    a, b = map(problem.path.within, (a, b))
    return f"from {in_mm(a)} to {in_mm(b)}"


def _why_undrawable(
    problem: PlanningProblem, outcome: Explored, start: float, stop: float
) -> str:
    """Why nobody can draw some of the path between two stations, in words."""
    rows, proof = outcome.rows, outcome.proof
    here = (rows.stations >= start) & (rows.stations <= stop)
    reasons = []
    if (proof.far & here).any():
        reasons.append("beyond the reach of the arm")
    tips = rows.tips[proof.buried & here]
    if len(tips):
        problem = held_from(problem, TIP_ONLY)
        bounds = upper_clearance(problem, np.stack([tips, tips], axis=1))
        near = np.flatnonzero(bounds.min(axis=0) < problem.required_clearance)
        names = [repr(problem.scene.obstacles[int(o)].name) for o in near]
        reasons.append(f"within the margin of {', '.join(names)}")
    if (proof.hemmed_in & here).any():
        reasons.append("the last link has no room there")
    if (proof.cut_off & here).any():
        reasons.append("no way wide enough leads there")
    return " and ".join(reasons)
