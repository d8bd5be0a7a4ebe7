"""Proofs about changed angles, against arms that use what counts as unchanged."""

import numpy as np
import pytest
from scenes_for_fewest import problem, straight_arm

from vdsm_pin.arm.kinematics import joint_centres, link_angles
from vdsm_pin.arm.manipulator import built_in
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.solids import Cylinder, Sphere
from vdsm_pin.planner.impossible.bounds import deviation, least_changed
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES
from vdsm_pin.verification.link_clearance import link_clearance

ARM = built_in("hrm8")
PILLAR = Cylinder(
    "pillar", np.array([1.563, 0.7, 0.6]), np.array([1.0, 0, 0]), 4.5, 0.2
)


def test_two_changed_angles_are_proved_needed_only_where_no_single_one_does() -> None:
    task = problem(PILLAR)
    clearance = link_clearance(task)
    tips = task.path.at(np.arange(0.0, 6.0, 0.05))
    least = least_changed(task, clearance, tips)
    straight = clearance(straight_arm(task, tips)).min(axis=1)
    assert (least[straight >= task.required_clearance] == 1).all()
    assert set(least.tolist()) == {1, 2}
    # The oracle: every single bend on a fine grid of what "one angle" can mean.
    lost = 0
    for tip, bound in zip(tips, least, strict=True):
        reachable = []
        for joint in range(8):
            rest = ARM.total_length - ARM.stations[joint]
            sine = np.hypot(*tip[1:]) / rest
            if sine > np.sin(ARM.max_link_angle):
                continue
            planar = np.zeros((9, 2))
            share = (ARM.stations[joint:] - ARM.stations[joint]) / rest
            planar[joint:] = share[:, None] * tip[1:]
            x = np.where(
                np.arange(9) >= joint,
                tip[0] - np.sqrt(1 - sine**2) * (ARM.total_length - ARM.stations),
                tip[0] - np.sqrt(1 - sine**2) * rest
                - (ARM.stations[joint] - ARM.stations),
            )  # fmt: skip
            centres = np.column_stack([x, planar])[None]
            reachable.append(clearance(centres).min() >= task.required_clearance)
        assert not (any(reachable) and bound == 2)
        lost += bound == 1 and not any(reachable)
    # What the deviation of unchanged angles costs: proofs at a few tips, not at most.
    assert lost < 0.15 * (least == 2).sum()


def leaning(
    rng: np.random.Generator, joint: int | None, *, worst: bool
) -> tuple[FloatArray, FloatArray]:
    """An arm with at most one changed angle, the others below their threshold.

    Returns:
        Joint centres, shape (N + 1, 3) [m]; link angles, (N,) [rad].
    """
    small = TOLERANCES.changed_angle * (1.0 - 1e-9)
    size = np.full(8, small) if worst else rng.uniform(0.0, small, 8)
    turn = np.full(8, rng.uniform(0, 2 * np.pi))
    if not worst:
        turn = rng.uniform(0.0, 2 * np.pi, 8)
    if joint is not None:
        size[joint] = rng.uniform(0.02, ARM.max_link_angle)
    theta = np.arcsin(np.sin(size) * np.sin(turn))
    alpha = np.arctan2(np.sin(size) * np.cos(turn), np.cos(size))
    centres = joint_centres(ARM, np.array([0.3]), alpha[None], theta[None])[0]
    return centres, link_angles(alpha[None], theta[None])[0]


def ideal(tip: FloatArray, joint: int) -> FloatArray | None:
    """The arm on the rail up to a joint and straight from there, densely sampled."""
    rest = ARM.total_length - ARM.stations[joint]
    square = rest**2 - tip[1] ** 2 - tip[2] ** 2
    if not square > 0.0:
        return None
    foot = np.array([tip[0] - np.sqrt(square), 0.0, 0.0])
    base = foot - np.array([ARM.stations[joint], 0.0, 0.0])
    t = np.linspace(0.0, 1.0, 200)[:, None]
    return np.vstack([base + t * (foot - base), foot + t * (tip - foot)])


def from_axis(points: FloatArray, centres: FloatArray) -> FloatArray:
    """Distance of points from the polyline through joint centres, shape (n,)."""
    a, b = centres[:-1], centres[1:]
    side = b - a
    t = ((points[:, None] - a) * side).sum(axis=2) / (side * side).sum(axis=1)
    foot = a + np.clip(t, 0.0, 1.0)[..., None] * side
    return np.asarray(np.linalg.norm(points[:, None] - foot, axis=2).min(axis=1))


@pytest.mark.parametrize("worst", [True, False])
@pytest.mark.parametrize("joint", [None, *range(8)])
def test_the_deviation_bound_holds_and_is_not_far_above_what_happens(
    joint: int | None, worst: bool
) -> None:
    rng = np.random.default_rng([77, 9 if joint is None else joint])
    seen = 0.0
    for _ in range(60):
        centres, angles = leaning(rng, joint, worst=worst)
        tip = centres[-1]
        off = np.array([np.hypot(tip[1], tip[2])])
        bound = deviation(ARM, off)
        if joint is None:
            assert off[0] <= bound.straight
            seen = max(seen, off[0] / bound.straight)
            continue
        assert angles[joint] > TOLERANCES.changed_angle
        points = ideal(tip, joint)
        assert points is not None
        bend = np.arcsin(off[0] / (ARM.total_length - ARM.stations[joint]))
        assert bend <= bound.bend[joint]
        body = bound.body[0, joint]
        assert abs(points[0, 0] - centres[0, 0]) <= body
        gap = from_axis(points, centres).max()
        assert gap <= body
        seen = max(seen, gap / body)
    if worst:
        assert seen > 0.2


@pytest.mark.parametrize("joint", [None, *range(8)])
def test_no_proof_denies_an_arm_that_uses_what_counts_as_unchanged(
    joint: int | None,
) -> None:
    """A ball against every ideal arm, each just clear of the arm that leans."""
    rng = np.random.default_rng([78, 9 if joint is None else joint])
    blocked = 0
    for _ in range(12):
        centres, angles = leaning(rng, joint, worst=True)
        changed = int((angles > TOLERANCES.changed_angle).sum())
        balls, tip = [], centres[-1]
        for k in range(8):
            points = ideal(tip, k)
            if points is None:
                continue
            gap = from_axis(points, centres)
            at = int(np.argmax(gap))
            aside = points[at] - nearest(points[at], centres)
            if not gap[at] > 1e-6:
                continue
            away = 0.02 + ARM.link_radius + 0.0035 + 1e-7
            centre = nearest(points[at], centres) + away * aside / gap[at]
            if from_axis(centre[None], centres)[0] >= away - 1e-8:
                balls.append(Sphere(f"b{k}", centre, 0.02))
        task = problem(*balls)
        clearance = link_clearance(task)
        assert clearance(centres[None]).min() >= task.required_clearance
        least = int(least_changed(task, clearance, tip[None])[0])
        assert least <= changed
        blocked += denied_at_zero(task, tip)
    # The scenes do tell: with unchanged angles taken for 0 there is no arm in them.
    assert blocked or joint in (None, 0)


def nearest(point: FloatArray, centres: FloatArray) -> FloatArray:
    """The point of a polyline nearest to a point."""
    t = np.linspace(0.0, 1.0, 2001)[:, None, None]
    line = (centres[:-1] + t * np.diff(centres, axis=0)).reshape(-1, 3)
    return np.asarray(line[np.argmin(np.linalg.norm(line - point, axis=1))])


def denied_at_zero(task: PlanningProblem, tip: FloatArray) -> bool:
    """Whether every ideal arm within the limits breaks the clearance."""
    clearance = link_clearance(task)
    for k in range(8):
        points = ideal(tip, k)
        rest = ARM.total_length - ARM.stations[k]
        sine = np.hypot(tip[1], tip[2]) / rest
        if points is None or sine > np.sin(ARM.max_link_angle):
            continue
        pieces = np.stack([points[:-1], points[1:]], axis=1)
        if clearance(pieces).min() >= task.required_clearance:
            return False
    return True
