"""How near bodies of one arm come, against sampled points and the closed form."""

from dataclasses import replace

import numpy as np
import pytest

from vdsm_pin.arm.kinematics import joint_centres, link_angles, link_frames
from vdsm_pin.arm.manipulator import Manipulator, built_in
from vdsm_pin.arm.mounted import Feed, LinkBody
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.row_bounds import link_gaps
from vdsm_pin.geometry.solids import Box, Cylinder
from vdsm_pin.planner.fewest.levels import THOROUGH
from vdsm_pin.problem.error_boxes import ErrorBox
from vdsm_pin.problem.own_pairs import PART, RESERVE, WIDTH
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scene import Scene

HRM8 = built_in("hrm8")
CAMERA = Box(
    "camera", np.array([0.42, 0.1, 0.02]), np.eye(3), np.array([0.06, 0.03, 0.02])
)
CUFF = Cylinder("cuff", np.array([0.37, 0.0, 0.0]), np.eye(3)[0], 0.03, 0.09)
THICK = replace(HRM8, link_radius=0.15, feed=Feed(0.8, 0.15))
ARMS = {
    "plain": HRM8,
    "thick, with a feed": THICK,
    "with a box": replace(HRM8, bodies=(LinkBody(3, CAMERA),)),
    "with a cylinder": replace(HRM8, bodies=(LinkBody(4, CUFF),)),
}


def problem(arm: Manipulator, **kept: object) -> PlanningProblem:
    return replace(PlanningProblem(arm, Scene(()), None, 0.003, name="own"), **kept)


def postures(count: int, seed: int = 3, curl: float = 0.0) -> tuple[FloatArray, ...]:
    rng = np.random.default_rng(seed)
    alpha, theta = rng.uniform(-0.5, 0.5, (2, count, 8)) * (0.4 if curl else 1.0)
    alpha += rng.choice([-curl, curl], (count, 1))
    most = np.maximum(link_angles(alpha, theta) / HRM8.max_link_angle, 1.0)
    return alpha / most, theta / most


def points_of(solid: Box | Cylinder) -> FloatArray:
    """Points in a solid, a hundredth of it or so apart, shape (n, 3)."""
    grid = np.linspace(-1.0, 1.0, 31)
    unit = np.stack(np.meshgrid(grid, grid, grid, indexing="ij"), -1).reshape(-1, 3)
    if isinstance(solid, Box):
        return np.asarray(solid.centre + unit * solid.half_size)
    angle, size = np.pi * unit[:, 1], solid.radius * (unit[:, 2] + 1.0) / 2.0
    circle = size[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return solid.centre + np.column_stack([unit[:, 0] * solid.half_length, circle])


def test_links_are_as_far_apart_as_the_closed_form_says() -> None:
    arm = THICK
    alpha, theta = postures(300, curl=0.7)
    own = problem(arm).own_pairs
    spare = own.spare(alpha, theta)
    centres = joint_centres(arm, np.zeros(300), alpha, theta)
    gaps = link_gaps(centres, arm.axis_radii)
    numbered = [b.link - 1 if b.name != "feed" else -1 for b in arm.convex_bodies]
    compared = 0
    for p, (one, other) in enumerate(own.pairs.both.tolist()):
        near, far = numbered[one], numbered[other]
        if near < 0:
            continue
        true = gaps[:, near, far]
        apart = true > 0.0
        assert (spare[apart, p] <= true[apart] + 1e-9).all()
        assert ((spare[:, p] > 0.0) <= apart).all()
        close = apart & (true < 0.2)
        low = (1.0 - PART) * true[close] - 2.0 * WIDTH
        far_enough = spare[close, p] >= np.minimum(low, 0.1)
        assert far_enough.all()
        compared += int(close.sum())
    assert compared > 20


@pytest.mark.parametrize("name", ["with a box", "with a cylinder"])
def test_no_point_of_a_body_is_nearer_to_a_link(name: str) -> None:
    arm = ARMS[name]
    alpha, theta = postures(40)
    own, solid = problem(arm).own_pairs, arm.bodies[0].solid
    spare, frames = own.spare(alpha, theta), link_frames(alpha, theta)
    centres = joint_centres(arm, np.zeros(40), alpha, theta)
    points, link = points_of(solid), arm.bodies[0].link - 1
    body = len(arm.axis_names)
    met = 0
    for p, pair in enumerate(own.pairs.both.tolist()):
        if body not in pair:
            continue
        other = pair[0] if pair[1] == body else pair[1]
        for k in range(40):
            placed = points @ frames[k, link].T + centres[k, link]
            begin, end = centres[k, other], centres[k, other + 1]
            way = end - begin
            share = ((placed - begin) @ way / (way @ way)).clip(0.0, 1.0)
            away = np.linalg.norm(placed - begin - share[:, None] * way, axis=1)
            sampled = float(away.min()) - arm.axis_radii[other]
            assert spare[k, p] <= sampled + 1e-9
            if 0.0 < sampled < 0.1:
                assert spare[k, p] >= (1.0 - PART) * sampled - 0.01
                met += 1
    assert met > 3


@pytest.mark.parametrize("name", ARMS)
def test_an_arm_that_turns_less_has_its_bodies_apart(name: str) -> None:
    arm = ARMS[name]
    asked = problem(arm, required_self_clearance=0.02)
    own = asked.own_pairs
    everything = arm.self_pairs.held
    assert len(own.pairs.both) < len(everything)
    alpha, theta = postures(400, curl=0.7)
    turn = link_angles(alpha, theta).sum(axis=1)
    less = 0.999 * np.minimum(1.0, own.turn / turn)[:, None]
    if own.turn > 0.0:
        assert (own.spare(less * alpha, less * theta) > 0.0).all()


def test_what_errors_take_is_kept() -> None:
    arm = ARMS["with a box"]
    box = arm.convex_bodies[8]
    plain, off = problem(arm).own_pairs, problem(arm, errors=ErrorBox(0.01)).own_pairs
    pair = [3 - 1, 8], [8, 3]
    of = [own.pairs.both.tolist().index(pair[1]) for own in (plain, off)]
    lost = off.kept[of[1]] - plain.kept[of[0]]
    # Link 4 alone turns against the camera on link 3: its end goes farthest.
    far = arm.link_lengths[3] + arm.link_radius
    assert box.link == 3
    assert lost == pytest.approx(np.sqrt(2.0) * 0.01 * far, rel=1e-12)


def test_plain_arms_are_looked_at_only_where_they_curl() -> None:
    own = problem(HRM8).own_pairs
    assert own.turn > np.pi / 2.0


def test_a_pair_that_just_comes_too_near_at_the_limit_is_looked_at() -> None:
    """Boxes whose edges meet at 42.1 deg between their links, of 42.5 that are allowed.

    They were taken to stay apart up to 43 deg, the first whole degree at which not.
    """
    d = 0.2 * np.tan(np.deg2rad(42.1) / 2.0) + 2e-4
    half = np.array([0.02, 0.2, 0.004])
    ahead = HRM8.link_lengths[2] - d - half[0]
    arm = replace(
        HRM8,
        link_radius=0.005,
        bodies=(
            LinkBody(3, Box("cuff", np.array([ahead, 0.0, 0.0]), np.eye(3), half)),
            LinkBody(4, Box("ring", np.array([d + half[0], 0, 0]), np.eye(3), half)),
        ),
    )
    own = problem(arm, required_self_clearance=0.0).own_pairs
    names = [body.name for body in arm.convex_bodies]
    pairs = [{names[one], names[other]} for one, other in own.pairs.both.tolist()]
    alpha, none = np.zeros((1, 8)), np.zeros((1, 8))
    alpha[0, 3] = np.deg2rad(42.49)
    assert own.spare(alpha, none)[0, pairs.index({"cuff", "ring"})] < 0.0
    assert own.turn <= alpha[0, 3]


def test_what_is_not_looked_at_keeps_what_planners_keep_for_moves_between_rows() -> (
    None
):
    assert RESERVE >= max(level.slack for level in THOROUGH)
