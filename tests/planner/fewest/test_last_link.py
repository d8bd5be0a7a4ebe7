"""Proofs that the last link has no room, from both sides of what fits."""

from dataclasses import replace

import numpy as np
import pytest
from scenes_for_fewest import problem, random_problem

from vdsm_pin.arm.cable_layout import CableLayout, paper_hole_angles
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.errors import HemmedIn
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Box
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.broad_phase import broad_phase
from vdsm_pin.planner.fewest.strategy import plan_fewest
from vdsm_pin.planner.impossible.last_link import _least_along, hemmed_in
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.verification.link_clearance import link_clearance

X = np.array([1.0, 0.0, 0.0])


def equal_links(count: int) -> Manipulator:
    arm = built_in("hrm8")
    cables = CableLayout(0.01, 0.005, paper_hole_angles(count))
    lengths = np.full(count, arm.total_length / count)
    return replace(arm, link_lengths=lengths, cables=cables)


def random_links(arm: Manipulator, rng: np.random.Generator) -> FloatArray:
    """Directions of the links of arms within the cone of every joint, shape (N, 3)."""
    axis, axes = X, []
    for _ in range(arm.n_links):
        # Half of the joints stand at their limit, where the bounds are tight.
        bend = arm.max_link_angle * (1.0 if rng.random() < 0.5 else rng.random())
        aside = np.cross(axis, rng.normal(size=3))
        axis = np.cos(bend) * axis + np.sin(bend) * aside / np.linalg.norm(aside)
        axes.append(axis)
    return np.array(axes)


@pytest.mark.parametrize("count", [2, 4, 8, 20])
def test_no_arm_within_limits_breaks_the_bounds_of_its_links(count: int) -> None:
    rng, arm = np.random.default_rng([7, count]), equal_links(count)
    for _ in range(400):
        axes = random_links(arm, rng)
        lean = np.arccos(np.clip(axes[-1, 0], -1.0, 1.0))
        e = np.array([0.0, *axes[-1, 1:]]) / np.linalg.norm(axes[-1, 1:])
        for wide in (0.0, 0.2):
            low, high = max(lean - wide * rng.random(), 0.0), lean + wide * rng.random()
            if low < np.pi / 2.0 < high:
                continue
            least = _least_along(arm, np.array([[low, min(high, np.pi)]]))[0]
            assert (axes @ e >= least - 1e-9).all()


def shelf_above(gap: float, half: float, count: int = 4) -> PlanningProblem:
    """A plate square to the rail, `gap` behind the tip, `half` wide each way."""
    place, thick = np.array([3.126, 0.5, 0.0]), 0.02
    middle = place - np.array([gap + thick / 2.0, 0.0, 0.0])
    plate = Box("plate", middle, np.eye(3), np.array([thick / 2.0, half, half]))
    points = np.stack([place, place + np.array([0.0, 0.05, 0.0])])
    task = problem(plate, points=points, closed=False, start=(2.0, 0.0, 0.0))
    return replace(task, manipulator=equal_links(count))


def is_hemmed(task: PlanningProblem, tip: FloatArray) -> bool:
    clearance = broad_phase(task, link_clearance(task)).up_to(task.required_clearance)
    return bool(hemmed_in(task, clearance, tip[None])[0])


def test_a_link_fits_past_the_edge_of_a_plate_or_does_not() -> None:
    tip = np.array([3.126, 0.5, 0.0])
    keep = built_in("hrm8").link_radius + 0.0035
    # A tip half a metre out leaves a link of a quarter of the arm some 75 deg of lean,
    # so 0.3 m of plate are past it where it stands off by 0.3 m / tan(75 deg) or so.
    assert is_hemmed(shelf_above(keep + 0.01, 0.3), tip)
    assert not is_hemmed(shelf_above(keep + 0.15, 0.3), tip)
    assert not is_hemmed(shelf_above(keep + 0.01, 0.03), tip)
    # Many links lie square to the rail, the last of them beside the plate.
    assert not is_hemmed(shelf_above(keep + 0.01, 0.3, count=20), tip)


def test_the_tip_of_a_plan_is_never_hemmed_in() -> None:
    tasks = [read_problem(f"paper/{name}") for name in ("obs1", "obs2", "obs3")]
    tasks += [random_problem(seed, clutter=True) for seed in range(3)]
    for task in tasks:
        clearance = link_clearance(task)
        tips = plan_fewest(task, clearance, 0.0).tip_path.points[::10]
        assert not hemmed_in(task, broad_phase(task, clearance), tips).any()


def test_a_tip_that_is_hemmed_in_is_refused_with_its_place() -> None:
    keep = built_in("hrm8").link_radius + 0.0035
    task = shelf_above(keep + 0.01, 0.3)
    with pytest.raises(HemmedIn, match=r"0\.000 mm along the path the last link"):
        plan_fewest(task, link_clearance(task), 0.0)
