"""A start too close to an obstacle: every strategy refuses it in the same words."""

from dataclasses import replace

import numpy as np
import pytest

from vdsm_pin.arm.cable_layout import CableLayout
from vdsm_pin.arm.kinematics import joint_centres
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.arm.mounted import Feed, LinkBody, Tool
from vdsm_pin.errors import StartBlocked
from vdsm_pin.geometry.solids import Box, Cylinder, Sphere
from vdsm_pin.planner.broad_phase import broad_phase
from vdsm_pin.planner.fewest.strategy import plan_fewest
from vdsm_pin.planner.fewest.stuck import no_way_in
from vdsm_pin.planner.impossible.bounds import prove_tips
from vdsm_pin.planner.start import check_start, start_centres
from vdsm_pin.planner.strategies import STRATEGIES, strategy
from vdsm_pin.planner.upper_clearance import held_from
from vdsm_pin.problem.desired_path import DesiredPath
from vdsm_pin.problem.held import TIP
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene
from vdsm_pin.verification.link_clearance import link_clearance

ARM = built_in("hrm8")
POINTS = np.array([[3.126, 0.3, -0.2], [3.126, 0.5, -0.2]])


def starting(gap: float, joints: np.ndarray | None = None) -> PlanningProblem:
    """A post beside link 3 of the straight arm, which it misses by the gap [m]."""
    aside = 0.05 + ARM.link_radius + gap
    axis = np.array([0.0, 0.0, 1.0])
    post = Cylinder("post", np.array([1.2, -aside, 0.0]), axis, 2.0, 0.05)
    tip = np.array([3.126, 0.0, 0.0])
    if joints is not None:
        tip = joint_centres(ARM, joints[:1], joints[None, 1::2], joints[None, 2::2])
        tip = tip[0, -1]
    path = DesiredPath(tip, POINTS, False, start_joints=joints)
    return PlanningProblem(ARM, Scene((post,)), path, 0.0035, name="start")


def refusal(task: PlanningProblem, name: str) -> StartBlocked:
    with pytest.raises(StartBlocked) as caught:
        strategy(name)(task, link_clearance(task), 0.0)
    return caught.value


def test_every_strategy_refuses_a_blocked_start_in_the_same_words() -> None:
    task = starting(0.0034)
    refusals = [refusal(task, name) for name in STRATEGIES]
    assert len({str(one) for one in refusals}) == 1
    assert (refusals[0].link, refusals[0].obstacle) == (3, "post")
    assert refusals[0].clearance == pytest.approx(0.0034, abs=1e-8)
    assert "straight arm" in str(refusals[0])


# An arm that follows its leader has no way round the corner of this path.
@pytest.mark.parametrize("name", [n for n in STRATEGIES if n != "follow-the-leader"])
def test_a_start_with_a_hair_more_than_required_is_taken(name: str) -> None:
    task = starting(0.0036)
    plan = strategy(name)(task, link_clearance(task), 0.0)
    np.testing.assert_allclose(plan.centres[0], start_centres(task), atol=1e-12)


def test_a_start_stated_by_its_joints_is_judged_as_it_is_bent() -> None:
    joints = np.zeros(17)
    joints[[3, 5]] = -0.3, 0.3
    assert "straight" not in str(refusal(starting(0.1, joints), "fewest"))
    joints[[3, 5]] = 0.3, -0.3
    task = starting(0.0, joints)
    assert strategy("fewest")(task, link_clearance(task), 0.0).trajectory.n_samples


def thick(radii: list[float], **more: object) -> Manipulator:
    lengths = np.full(4, 0.4)
    lengths[-1] += 0.1 if "tool" in more else 0.0
    limits = (0.7, 0.7, (-2.0, 2.0), CableLayout(0.01, 0.01, np.zeros((4, 3))))
    arm = Manipulator("thick", lengths, max(radii), *limits, radii=np.array(radii))
    return replace(arm, **more)


TOOL = Tool(0.1, 0.01)
BOX = Box("camera", np.array([0.2, 0.08, 0.0]), np.eye(3), np.full(3, 0.03))
AROUND = float(np.hypot(0.11, 0.03))  # how far the camera reaches from its link's axis


@pytest.mark.parametrize(
    ("arm", "place", "link", "reach", "words"),
    [
        (thick([0.08, 0.04, 0.03, 0.02]), (0.2, 0.1), 1, 0.08, "link 1 of"),
        (thick([0.02, 0.08, 0.03, 0.02]), (0.6, 0.1), 2, 0.08, "link 2 of"),
        (thick([0.08, 0.04, 0.03, 0.02], tool=TOOL), (0.2, 0.1), 1, 0.08, "link 1 of"),
        (thick([0.03] * 4, tool=TOOL), (1.65, 0.03), 4, 0.01, "4 with its tool of"),
        (
            thick([0.03] * 4, bodies=(LinkBody(3, BOX),)),
            (1.0, -0.12),
            3,
            AROUND,
            "link 3, taken to be as thick as what it carries, of",
        ),
    ],
)
def test_a_blocked_start_names_the_link_that_is_too_near_and_by_how_much(
    arm: Manipulator, place: tuple[float, float], link: int, reach: float, words: str
) -> None:
    ball = Sphere("ball", np.array([*place, 0.0]), 0.018)
    # Nearer to an axis than the ball is, but of a thin link, which it is clear of.
    thin = Sphere("thin", np.array([1.4, 0.06, 0.0]), 0.01)
    tip = np.array([arm.total_length, 0.0, 0.0])
    path = DesiredPath(tip, np.stack([tip, tip + np.array([0.0, 0.1, 0.0])]), False)
    scene = Scene((ball, thin))
    task = PlanningProblem(arm, scene, path, 0.005, name="start")
    caught = refusal(task, "fewest")
    assert (caught.link, caught.obstacle) == (link, "ball")
    assert caught.clearance == pytest.approx(abs(place[1]) - 0.018 - reach, abs=1e-8)
    assert words in str(caught)


@pytest.mark.parametrize("name", STRATEGIES)
def test_a_feed_that_is_too_near_at_the_start_is_named(name: str) -> None:
    arm = thick([0.03] * 4, feed=Feed(0.8, 0.06))
    ball = Sphere("ball", np.array([-0.3, 0.0845, 0.0]), 0.02)
    behind = Sphere("behind", np.array([-0.9, 0.0, 0.0]), 0.02)
    tip = np.array([1.6, 0.0, 0.0])
    path = DesiredPath(tip, np.stack([tip, tip + np.array([0.0, 0.1, 0.0])]), False)
    scene = Scene((behind, ball))
    task = PlanningProblem(arm, scene, path, 0.005, name="feed")
    caught = refusal(task, name)
    assert (caught.link, caught.obstacle) == (0, "ball")
    assert caught.clearance == pytest.approx(0.0045, abs=1e-8)
    assert (
        "at its start the feed of the straight arm has a clearance of 4.500 mm to"
        in str(caught)
    )
    ignoring = replace(arm, ignore_pairs=(("ball", "feed"),))
    check_start(replace(task, manipulator=ignoring), link_clearance(task))
    check_start(replace(task, required_clearance=0.004), link_clearance(task))


def test_a_start_whose_axis_meets_an_obstacle_is_that_deep_or_deeper() -> None:
    assert "has a clearance of −1.000 mm to" in str(refusal(starting(-0.001), "fewest"))
    told = str(refusal(starting(-0.1), "fewest"))
    assert f"has a clearance of −{1e3 * ARM.link_radius:.3f} mm or deeper to" in told


def test_a_narrow_place_is_as_wide_as_it_is_however_thick_the_links() -> None:
    arm = thick([0.08, 0.04, 0.03, 0.02])
    walls = tuple(
        Box(name, np.array([1.0, side, 0.0]), np.eye(3), np.array([0.1, 0.1, 1.0]))
        for name, side in (("left", 0.15), ("right", -0.15))
    )
    path = DesiredPath(np.array([1.6, 0.0, 0.0]), POINTS, False)
    task = PlanningProblem(arm, Scene(walls), path, 0.005, name="walls")
    told = str(no_way_in(task, np.array([1.0, 0.0, 0.0])).words)
    # The tip is the first to pass, and thick links may stay outside.
    assert "100.000 mm wide, for a body of 40.000 mm" in told


# An arm that follows its leader has no way round the corner of this path.
@pytest.mark.parametrize("name", [n for n in STRATEGIES if n != "follow-the-leader"])
def test_what_is_ignored_is_in_the_way_of_no_plan(name: str) -> None:
    """The post is 1 mm from link 3 at the start, and link 1 runs through a wall."""
    wall = Box("wall", np.array([0.18, 0.0, 0.0]), np.eye(3), np.full(3, 0.08))
    task = starting(0.001)
    task = replace(task, scene=Scene((*task.scene.obstacles, wall)))
    with pytest.raises(StartBlocked):
        strategy(name)(task, link_clearance(task), 0.0)
    pairs = ("link 3", "post"), ("wall", "link 1")
    task = replace(task, manipulator=replace(ARM, ignore_pairs=pairs))
    plan = strategy(name)(task, link_clearance(task), 0.0)
    free = replace(task, scene=Scene(()))
    alone = strategy(name)(free, link_clearance(free), 0.0)
    np.testing.assert_array_equal(plan.trajectory.joints[0], alone.trajectory.joints[0])
    assert plan.undrawn == ()


TOOLED = replace(ARM, tool=Tool(0.125, 0.015))
CAMERA = LinkBody(3, Box("camera", np.array([0.2, 0.1, 0.0]), np.eye(3), np.ones(3)))


@pytest.mark.parametrize("arm", [TOOLED, replace(TOOLED, bodies=(CAMERA,))])
@pytest.mark.parametrize("seed", range(4))
def test_clearances_are_those_of_the_pairs_that_are_held_apart(
    arm: Manipulator, seed: int
) -> None:
    """Pair by pair of axes and obstacles, the ignored ones left out by hand."""
    rng = np.random.default_rng(seed)
    balls = tuple(
        Sphere(f"ball {k}", rng.uniform([0.0, -0.5, -0.5], [3.0, 0.5, 0.5]), 0.1)
        for k in range(5)
    )
    names = (*arm.axis_names, *(body.name for body in arm.bodies))
    pairs = [(one, ball.name) for one in names for ball in balls]
    left_out = [pair for pair in pairs if rng.random() < 0.4]
    asked = replace(arm, ignore_pairs=tuple(left_out))
    path = DesiredPath(np.array([3.126, 0.0, 0.0]), POINTS, False)
    task = PlanningProblem(asked, Scene(balls), path, 0.0, name="balls")
    centres = joint_centres(
        arm, np.zeros(50), *rng.uniform(-0.4, 0.4, (2, 50, arm.n_links))
    )
    covers = {body.name: arm.round_cover(body) for body in arm.bodies}
    least = np.full((50, arm.n_links), np.inf)
    for one, name in pairs:
        link = 3 if one == "camera" else min(names.index(one) + 1, arm.n_links)
        ball = next(ball for ball in balls if ball.name == name)
        length = float(arm.link_lengths[link - 1])
        if one in covers:
            radius, behind, past = covers[one]
            first, last = -behind, length + past
        else:
            radius = arm.axis_radii[names.index(one)]
            first, last = arm.axis_spans[names.index(one)]
        begin, end = centres[:, link - 1], centres[:, link]
        axis = (end - begin) / length
        along = ((ball.centre - begin) * axis).sum(axis=1).clip(first, last)
        gap = np.linalg.norm(ball.centre - begin - along[:, None] * axis, axis=1)
        if (one, name) not in left_out:
            least[:, link - 1] = np.minimum(least[:, link - 1], gap - 0.1 - radius)
    found = link_clearance(task)(centres)
    np.testing.assert_allclose(found, least, atol=2e-6)
    # Piece by piece they are the same, but that the tool is part of the last link.
    quick = broad_phase(task, link_clearance(task)).up_to(np.inf)
    for ask in (quick, link_clearance(task)):
        apart = np.stack(
            [ask(centres[:, k : k + 2], k)[:, 0] for k in range(8)], axis=1
        )
        assert (apart <= found + 2e-6).all()
        np.testing.assert_allclose(apart[:, :-1], found[:, :-1], atol=2e-6)
        assert np.array_equal(np.isinf(apart), np.isinf(found))
        tips = np.repeat(centres[:, -1:], 2, axis=1)
        assert np.isinf(ask(tips, TIP)).all() == all(
            ("tool", ball.name) in left_out for ball in balls
        )


def test_a_tool_passes_where_its_link_may_touch() -> None:
    """The slab is 40 mm above the path: room for the tool alone, all that is held."""
    slab = Box("slab", np.array([3.3, 0.0, 0.14]), np.eye(3), np.array([0.3, 0.3, 0.1]))
    arm = replace(ARM, tool=Tool(0.15, 0.01), ignore_pairs=(("link 8", "slab"),))
    points = np.array([[3.126, 0.0, 0.0], [3.126, 0.1, 0.0]])
    path = DesiredPath(np.array([3.126, 0.0, -0.2]), points, False)
    task = PlanningProblem(arm, Scene((slab,)), path, 0.0035, name="slab")
    plan = plan_fewest(task, link_clearance(task), 0.0)
    assert plan.undrawn == ()
    axes = arm.axes(plan.centres)
    below = 0.04 - np.maximum(axes[:, -2, 2], axes[:, -1, 2]) - 0.01
    assert below[plan.trajectory.on_path].min() > task.required_clearance


def test_what_is_ignored_proves_nothing() -> None:
    """The path ends in a ball: no way there, unless the last link may touch it."""
    ball = Sphere("ball", POINTS[1], 0.05)
    tip = np.array([3.126, 0.0, 0.0])
    path = DesiredPath(tip, POINTS, False)
    task = PlanningProblem(ARM, Scene((ball,)), path, 0.0035, name="ball")
    rows = POINTS
    assert prove_tips(task, link_clearance(task), rows).undrawable.any()
    plan = plan_fewest(task, link_clearance(task), 0.0)
    assert any("proved" in words for words in plan.undrawn)
    task = replace(task, manipulator=replace(ARM, ignore_pairs=(("ball", "link 8"),)))
    assert held_from(task).scene.obstacles == ()
    assert plan_fewest(task, link_clearance(task), 0.0).undrawn == ()
