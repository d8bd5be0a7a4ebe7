"""Where an insertion came to an end, what stopped it, and what might help."""

from dataclasses import dataclass
from typing import Final

import numpy as np

from vdsm_pin.errors import Reached
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.planner.fewest.pose_kernels import bends_of
from vdsm_pin.planner.upper_clearance import culprit, upper_clearance
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.units import in_mm

AT_LIMIT: Final = 0.97
"""Part of the largest link angle from which on a joint counts as at its limit; [-]."""
AT_END: Final = 1e-3
"""Distance of the base from an end of its rail, over the arm's length, up to which it
counts as there; [-]."""
SNUG: Final = 1.15
"""An opening up to this many times what the body needs counts as the reason; [-]."""


@dataclass(frozen=True)
class Stuck:
    """The insertion that came farthest.

    Args:
        route: Of the tip from the start to the path, widest first tried, shape (k, 3),
            k >= 1; [m].
        come: Its points that the tip has reached, 1 to k.
        centres: Joint centres of the arm there, or on the path, shape (N + 1, 3); [m].
    """

    route: FloatArray
    come: int
    centres: FloatArray


def where_stuck(
    problem: PlanningProblem, stuck: Stuck, words: str, station: float
) -> Reached:
    """The narrowest passage, how far the arm came, what to try.

    Args:
        problem: Arm and scene.
        stuck: The insertion that came farthest.
        words: What is known besides, told first.
        station: Where along the path the first stretch begins that is not drawn; [m].
    """
    parts, link, obstacle = [words], 0, ""
    narrowest: list[float] = []
    if problem.scene.obstacles:
        parts.append(_passage(problem, stuck))
        link, obstacle, _ = culprit(problem, stuck.centres)
        narrowest = stuck.route[_opening(problem, stuck)[0]].tolist()
    parts.append(_stop(problem, stuck))
    parts.append(f"try {' or '.join(_advice(problem, stuck))}")
    centres = stuck.centres.tolist()
    return Reached("; ".join(parts), station, link, obstacle, centres, narrowest)


def _opening(problem: PlanningProblem, stuck: Stuck) -> tuple[int, float]:
    """Number of the narrowest point of the way, and how wide it is there; [m]."""
    clearances = upper_clearance(problem, np.stack([stuck.route, stuck.route], axis=1))
    narrow = int(np.argmin(clearances.min(axis=1)))
    return narrow, 2.0 * (
        float(clearances[narrow].min()) + problem.manipulator.most_radius
    )


def _needed(problem: PlanningProblem) -> float:
    """Width of the body with its clearance on both sides; [m]."""
    return 2.0 * (problem.manipulator.most_radius + problem.required_clearance)


def _passage(problem: PlanningProblem, stuck: Stuck) -> str:
    narrow, width = _opening(problem, stuck)
    arm = problem.manipulator
    return (
        f"the best way in is narrowest at {problem.in_file(stuck.route[narrow])}: "
        f"{in_mm(width)} wide, for a body of {in_mm(2.0 * arm.most_radius)} with "
        f"{in_mm(problem.required_clearance)} on either side"
    )


def _stop(problem: PlanningProblem, stuck: Stuck) -> str:
    gaps = np.linalg.norm(np.diff(stuck.route, axis=0), axis=1)
    whole, come = float(gaps.sum()), float(gaps[: stuck.come - 1].sum())
    words = f"the arm came {in_mm(come)} of {in_mm(whole)} along it"
    if stuck.come == len(stuck.route):
        tip = problem.in_file(stuck.centres[-1])
        words = f"the arm came all the way in and along the path to {tip}"
    if problem.scene.obstacles:
        link, name, least = culprit(problem, stuck.centres)
        words += f", where link {link} has {in_mm(least)} to {name!r}"
    return words


def _advice(problem: PlanningProblem, stuck: Stuck) -> list[str]:
    """What might help, most likely first."""
    arm, tried = problem.manipulator, []
    base, (low, high) = float(stuck.centres[0, 0]), arm.base_range
    if min(base - low, high - base) <= AT_END * arm.total_length:
        tried.append("a longer rail (`base_range`), the base is at its end")
    bends = bends_of(stuck.centres[None])[0]
    if bends.max() >= AT_LIMIT * arm.max_link_angle:
        joint = int(np.argmax(bends)) + 1
        tried.append(f"larger joint limits, joint {joint} is at its own")
    if problem.scene.obstacles:
        _, width = _opening(problem, stuck)
        if width <= SNUG * _needed(problem):
            tried.append("a smaller `required_clearance` or a wider opening")
    return [*tried, "another start", "a longer time limit"]
