"""Ratios of the problem file: other ratios, scaling centre, projection cylinder."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vdsm_pin.errors import InvalidFile, InvalidInput, NoPlanFound
from vdsm_pin.io.problem_file import built_in_text, read_problem
from vdsm_pin.planner.paper.online import OnlineRule
from vdsm_pin.planner.paper.pipeline import plan_paper
from vdsm_pin.planner.records import Plan
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scaling import (
    OtherRatios,
    ProjectionCylinder,
    Scaling,
    ScalingCentre,
)
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.verification.link_clearance import link_clearance
from vdsm_pin.verification.records import Verdict

FREE = read_problem("paper/free")
ARM = FREE.manipulator


def planned(scaling: Scaling | None, problem: PlanningProblem = FREE) -> Plan:
    asked = replace(problem, scaling=scaling)
    return plan_paper(asked, link_clearance(asked), 0.0)


@pytest.mark.parametrize("axis", ["y", "z"])
def test_an_ever_larger_cylinder_gives_the_papers_plan(axis: str) -> None:
    paper = planned(None)

    def off(radius: float) -> float:
        plan = planned(ProjectionCylinder(radius, axis))  # type: ignore[arg-type]
        return float(np.abs(plan.centres - paper.centres).max())

    # sin and asin differ from their arguments by cubes: the error falls with 1 / R^2.
    assert off(100.0) / off(1000.0) == pytest.approx(100.0, rel=1e-3)
    assert off(1e6) < 1e-12


@pytest.mark.parametrize("axis", ["y", "z"])
def test_joints_lie_evenly_on_the_unrolled_cylinder(axis: str) -> None:
    radius, tip = 1.4, np.array([[1.0, 1.3], [-0.5, -0.2]])
    planar = ProjectionCylinder(radius, axis).planar(ARM.stations, tip)  # type: ignore[arg-type]
    across = 0 if axis == "z" else 1
    unrolled = planar.copy()
    unrolled[..., across] = radius * np.arcsin(planar[..., across] / radius)
    even = ARM.ratios[None, :, None] * unrolled[:, -1:]
    np.testing.assert_allclose(unrolled, even, rtol=0, atol=1e-14)
    np.testing.assert_array_equal(planar[:, -1], tip)


def test_ratios_of_the_arm_itself_change_nothing() -> None:
    paper, same = planned(None), planned(OtherRatios(ARM.ratios[1:-1]))
    np.testing.assert_allclose(same.centres, paper.centres, rtol=0, atol=1e-15)


def test_the_joint_stays_over_the_centre_while_the_tip_draws() -> None:
    centre = np.array([0.05, 0.1])
    plan = planned(ScalingCentre(centre, 3))
    drawing = plan.trajectory.on_path
    held = plan.centres[drawing, 2, 1:]
    np.testing.assert_allclose(held, np.broadcast_to(centre, held.shape), atol=1e-15)
    assert np.abs(plan.centres[0, :, 1:]).max() == 0.0, "it starts straight"
    # The other joints after it are scaled about the centre.
    tip = plan.centres[drawing, -1, 1:]
    k = (ARM.stations[5] - ARM.stations[2]) / (ARM.total_length - ARM.stations[2])
    np.testing.assert_allclose(
        plan.centres[drawing, 5, 1:], centre + k * (tip - centre), rtol=0, atol=1e-14
    )


@pytest.mark.parametrize(
    "block",
    [
        "{values: [0.1, 0.25, 0.4, 0.58, 0.75, 0.82, 0.9]}",
        "{scaling_centre: [50, 100], joint: 3}",
        "{cylinder_radius: 1600, cylinder_axis: y}",
    ],
)
def test_what_the_file_asks_for_is_planned_and_certified(
    block: str, tmp_path: Path
) -> None:
    problem = read_problem(written(tmp_path, block))
    found = plan_and_verify(problem, "paper")
    assert found.verification.verdict is Verdict.CERTIFIED
    assert np.abs(found.plan.centres - planned(None).centres[:1]).max() > 0.1
    with pytest.raises(NoPlanFound, match="does not read ratios"):
        plan_and_verify(problem, "fewest")
    with pytest.raises(ValueError, match="ratios of its own"):
        OnlineRule.of(found.plan)


def test_the_rule_does_not_go_round_obstacles_with_other_ratios() -> None:
    problem = read_problem("paper/obs3")
    with pytest.raises(NoPlanFound, match="with the ratios that are asked for"):
        planned(ProjectionCylinder(2.0), problem)


def test_a_tip_beyond_the_cylinder_is_refused() -> None:
    with pytest.raises(NoPlanFound, match="beyond the projection cylinder"):
        planned(ProjectionCylinder(1.2, "y"))


def written(folder: Path, block: str) -> Path:
    file = folder / "p.yaml"
    file.write_text(f"{built_in_text('paper/free')}\nratios: {block}\n", "utf-8")
    return file


@pytest.mark.parametrize(
    ("block", "words"),
    [
        ("{}", "expected one of values"),
        ("{values: [0.5], cylinder_radius: 3}", "expected one of values"),
        ("{values: [0.5]}", "there are 1 ratios, expected 7"),
        ("{values: []}", "there are 0 ratios, expected 7"),
        ("{scaling_centre: [0, 100]}", "scaling_centre and joint together"),
        ("{cylinder_radius: 3000, joint: 3}", "scaling_centre and joint together"),
        ("{scaling_centre: [0, 100], joint: 9}", "expected 2 to 8"),
        ("{scaling_centre: [0, 100, 3], joint: 4}", "scaling_centre"),
        ("{cylinder_radius: 0}", "cylinder_radius"),
        ("{cylinder_radius: 3, cylinder_axis: x}", "cylinder_axis"),
    ],
)
def test_ratios_that_make_no_sense_are_refused(
    block: str, words: str, tmp_path: Path
) -> None:
    with pytest.raises(InvalidFile, match=words) as error:
        read_problem(written(tmp_path, block))
    assert "ratios" in str(error.value)


@pytest.mark.parametrize(
    "make",
    [
        lambda: OtherRatios(np.array([0.1, np.nan])),
        lambda: ScalingCentre(np.array([np.inf, 0.0]), 3),
        lambda: ScalingCentre(np.zeros(3), 3),
        lambda: ProjectionCylinder(np.inf),
        lambda: replace(FREE, scaling=OtherRatios(np.array([0.5]))),
    ],
)
def test_values_out_of_range_are_refused(make: object) -> None:
    with pytest.raises(InvalidInput):
        make()  # type: ignore[operator]
