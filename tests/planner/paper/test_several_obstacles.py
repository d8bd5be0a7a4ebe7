"""Several prisms along one axis: one is gone round, or the hull of more."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from vdsm_pin.errors import NoPlanFound
from vdsm_pin.geometry.solids import Cylinder, Sphere
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.paper.approach import first_station
from vdsm_pin.planner.paper.danger_region import DangerRegion
from vdsm_pin.planner.paper.sections import merged
from vdsm_pin.problem.desired_path import Approach
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.refinement import plan_and_verify
from vdsm_pin.verification.records import Verdict

FREE = read_problem("paper/free")
PAIR = (0.7, 0.6, 0.12), (0.5, 0.8, 0.10)
TRIO = (0.7, 0.6, 0.10), (0.55, 0.75, 0.08), (0.85, 0.5, 0.06)


def rods(*places: tuple[float, float, float]) -> PlanningProblem:
    """Cylinders along the rail at (y, z) with a radius."""
    along = np.array([1.0, 0.0, 0.0])
    bodies = [
        Cylinder(f"rod {i}", np.array([1.5, y, z]), along, 4.0, radius)
        for i, (y, z, radius) in enumerate(places, start=1)
    ]
    return replace(FREE, scene=Scene(tuple(bodies)))


@pytest.mark.parametrize("places", [PAIR, TRIO])
def test_two_and_three_prisms_along_the_rail_are_passed(
    places: tuple[tuple[float, float, float], ...],
) -> None:
    found = plan_and_verify(rods(*places), "paper")
    assert found.verification.verdict in (Verdict.CERTIFIED, Verdict.INCOMPLETE)
    assert found.verification.min_clearance >= FREE.required_clearance
    assert found.verification.coverage > 0.9
    steps = found.plan.steps
    assert steps is not None
    assert " and " in steps.avoidance.passed


def test_an_obstacle_out_of_the_way_is_left_alone() -> None:
    """The far one is no prism; the rule goes round the near one and stays clear."""
    far = Sphere("ball", np.array([1.0, -1.5, -1.5]), 0.2)
    near = rods((0.7, 0.6, 0.2)).scene.obstacles[0]
    problem = replace(FREE, scene=Scene((far, near)))
    found = plan_and_verify(problem, "paper")
    assert found.verification.verdict is Verdict.CERTIFIED
    assert found.plan.steps is not None
    assert found.plan.steps.avoidance.passed == "rod 1"


def test_a_plan_in_part_is_kept_where_both_together_cannot_be_passed() -> None:
    """Their hull holds the rail; round the prism alone 98 % are drawn."""
    alone = read_problem("paper/obs2")
    opposite = rods((-0.9, -0.9, 0.1)).scene.obstacles
    problem = replace(alone, scene=Scene(alone.scene.obstacles + opposite))
    found = plan_and_verify(problem, "paper")
    assert found.verification.verdict is Verdict.CERTIFIED
    assert found.verification.coverage == pytest.approx(0.983, abs=1e-3)
    wanted = plan_and_verify(alone, "paper").plan.trajectory
    np.testing.assert_array_equal(found.plan.trajectory.joints, wanted.joints)


def test_an_obstacle_that_is_hit_on_the_way_round_another_is_no_plan() -> None:
    ball = Sphere("ball", np.array([3.126, -0.5, 0.5]), 0.1)  # on the path itself
    near = rods((0.7, 0.6, 0.2)).scene.obstacles[0]
    problem = replace(FREE, scene=Scene((near, ball)))
    with pytest.raises(NoPlanFound, match=r"round .rod 1. the links meet an obstacle"):
        plan_and_verify(problem, "paper")


def test_more_obstacles_than_groups_are_made_of_are_refused() -> None:
    places = [(0.7, 0.1 * k, 0.02) for k in range(5)]
    with pytest.raises(NoPlanFound, match=r"there are 5 obstacles.*round up to 4"):
        plan_and_verify(rods(*places), "paper")


def test_the_merged_section_holds_all() -> None:
    rng = np.random.default_rng(2)
    for _ in range(50):
        parts = [
            DangerRegion(f"{k}", rng.normal(size=(1, 2)), rng.uniform(0.0, 0.3))
            for k in range(int(rng.integers(2, 5)))
        ]
        whole = merged(parts)
        shape = shapely.MultiPoint(whole.corners).convex_hull.buffer(
            whole.radius + 1e-9
        )
        for part in parts:
            disc = shapely.Point(part.corners[0]).buffer(part.radius)
            assert shape.buffer(1e-3).contains(disc)
        assert whole.name == " and ".join(part.name for part in parts)
        assert whole.core_distance(np.zeros((1, 2, 2))).shape == (1,)
    assert merged(parts[:1]) is parts[0]


def test_the_schemes_of_the_approach_differ_for_several_obstacles() -> None:
    """The middle of both lies on the diagonal, the second rod alone above it."""
    centres = np.array([[0.7, 0.5], [0.3, 0.9]])
    region = DangerRegion("both", np.array([[0.5, 0.7]]), 0.4, centres)
    found = {}
    for approach in Approach:
        path = replace(FREE.path, approach=approach)
        station, note = first_station(path, region)
        assert note == ""
        found[approach] = path.at(np.array([station]))[0, 1:]
    np.testing.assert_allclose(found[Approach.SHORTEST], [0.0, -0.2], atol=1e-9)
    middle = found[Approach.EQUIDISTANT]
    assert middle[0] / middle[1] == pytest.approx(0.5 / 0.7)
    nearest = found[Approach.NEAREST_EQUIDISTANT]
    ends = [np.array([1.0, 5.0 / 7.0]), np.array([1.3 / 3.0, 1.3])]
    best = min(ends, key=np.linalg.norm)
    np.testing.assert_allclose(nearest, best, atol=1e-9)
