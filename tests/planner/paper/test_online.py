"""One tip position at a time gives what the whole plan gives, to the last bit."""

from dataclasses import replace

import numpy as np
import pytest

from vdsm_pin.errors import Infeasible
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.paper.online import OnlineRule
from vdsm_pin.refinement import plan_and_verify


@pytest.mark.parametrize("name", ["free", "obs1", "obs2-small", "obs3"])
def test_steps_are_the_rows_of_the_plan(name: str) -> None:
    problem = read_problem(f"paper/{name}")
    plan = plan_and_verify(problem, "paper").plan
    assert plan.steps is not None
    rule, route = OnlineRule.of(plan), plan.steps.route
    for k in range(0, plan.trajectory.n_samples, 7):
        told = rule.step(route.tip_path.points[k], int(route.side[k]))
        np.testing.assert_array_equal(told.joints, plan.trajectory.joints[k])
        np.testing.assert_array_equal(told.cables, plan.cable_lengths[k])


def test_what_the_rule_cannot_do_is_refused() -> None:
    problem = read_problem("paper/free")
    plan = plan_and_verify(problem, "paper").plan
    with pytest.raises(Infeasible):
        OnlineRule.of(plan).step(np.array([3.126, 2.5, 0.0]))
    with pytest.raises(ValueError, match="'fewest', expected 'paper'"):
        OnlineRule.of(replace(plan, strategy="fewest", steps=None))
