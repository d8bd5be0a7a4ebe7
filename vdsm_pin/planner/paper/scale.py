"""Step 3: scale the tip's projected path to the joints (paper, 3.4-3.5, Eq. 5, 6)."""

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.paper.project import project
from vdsm_pin.planner.records import TipPath
from vdsm_pin.problem.planning_problem import PlanningProblem


def references(problem: PlanningProblem, tip_path: TipPath) -> FloatArray:
    """Reference paths of the joints: in constant ratios, or as the problem asks.

    Where it asks for others, the arm goes over to them on its way to the path, and back
    on its way home: it starts straight.

    Args:
        problem: What is asked.
        tip_path: Step 4's route.

    Returns:
        Projected joint centres, shape (n_samples, N + 1, 2); [m].

    Raises:
        NoPlanFound: If the tip leaves what the problem's scaling covers.
    """
    tip = project(tip_path.points)
    straight = scale(problem.manipulator, tip)
    if problem.scaling is None:
        return straight
    scaled = problem.scaling.planar(problem.manipulator.stations, tip)
    share = _on_its_way(tip_path)[:, None, None]
    return np.asarray(straight + share * (scaled - straight))


def _on_its_way(tip_path: TipPath) -> FloatArray:
    """How far the tip is from its start (0) to the path (1), and back, (n_samples,)."""
    drawn = np.flatnonzero(tip_path.on_path)
    steps = np.linalg.norm(np.diff(tip_path.points, axis=0), axis=1)
    walked = np.concatenate([[0.0], np.cumsum(steps)])
    marks = [0.0, walked[drawn[0]], walked[drawn[-1]], walked[-1]]
    return np.asarray(np.interp(walked, marks, [0.0, 1.0, 1.0, 0.0]))


def scale(manipulator: Manipulator, tip: FloatArray) -> FloatArray:
    """Reference paths P_1..P_{N+1} of the straight arm: P_i = k_{i,N+1} P_{N+1}.

    Args:
        manipulator: The arm with its ratios (Eq. 5).
        tip: Projected tip P_{N+1}, shape (n_samples, 2); [m].

    Returns:
        Projected joint centres, shape (n_samples, N + 1, 2); [m].
    """
    planar = np.zeros((len(tip), manipulator.n_links + 1, 2))
    for column in (0, 1):
        planar[..., column] = tip[:, column, None] * manipulator.ratios
    return planar
