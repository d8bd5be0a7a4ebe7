"""Oracle: joint centres of motions drawn from the slice and the error box."""

import numpy as np
import pytest

from vdsm_pin.geometry.arm import bends_and_drifts, place, place_between
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import Body, body_reach, body_support, new_body
from vdsm_pin.manipulator import built_in
from vdsm_pin.problem import DesiredPath, PlanningProblem
from vdsm_pin.proof.swept_bodies import (
    Ends,
    load_body,
    local_point,
    new_ends,
    place_point,
    room_of,
)
from vdsm_pin.proof.terms import BASE, Mover, Rules, Task, mover_of
from vdsm_pin.scene import Scene, Sphere
from vdsm_pin.verification.records import ErrorBox
from vdsm_pin.verification.task import make_task

ARM = built_in("hrm8")
LENGTHS, N = np.array(ARM.link_lengths), ARM.n_links
FRAMES = (BASE, 0, 3)
LINK = 6


def task_of(box: ErrorBox) -> Task:
    """An arm with an obstacle, so that every frame has a pair with the link."""
    tip = np.array([ARM.total_length, 0.0, 0.0])
    scene = Scene((Sphere("ball", 9.0 * np.ones(3), 0.1),))
    path = DesiredPath(tip, tip[None])
    return make_task(PlanningProblem("p", ARM, scene, path, 0.0, np.eye(4)), box)


def mover(task: Task, frame: int) -> Mover:
    """The link as it moves against what rests in a frame."""
    pairs = task.pairs
    of_link = (pairs.link == LINK) & (pairs.frame == frame)
    return mover_of(task, int(np.flatnonzero(of_link)[0]))


def local_points(ends: Ends, frame: int, points: FloatArray) -> None:
    """Both ends of the link in a frame."""
    for k, x in enumerate((0.0, LENGTHS[LINK])):
        args = ends.centres[0], ends.frames[0]
        place_point(*args, LINK, np.array([x, 0.0, 0.0]), points[k])
        local_point(*args, frame, points[k])


def motion(rng: np.random.Generator, size: float) -> tuple[FloatArray, ...]:
    """Two rows of x0, alpha, theta."""
    start = rng.uniform(-0.5, 0.5, (2, 1, N))
    step = size * rng.uniform(-1.0, 1.0, (2, 1, N))
    alpha, theta = (
        np.concatenate([a, a + d]) for a, d in zip(start, step, strict=True)
    )
    return rng.uniform(-0.1, 0.1, 2), alpha, theta


def swept(rows: tuple[FloatArray, ...], task: Task, frame: int, h: float) -> Body:
    """The link over the part [0, h] of an interval."""
    ends, body = new_ends(N), new_body(4, 2, room_of(N))
    for k, t in enumerate((0.0, h)):
        place_between(t, *rows, LENGTHS, ends.centres[k], ends.frames[k])
    errors, between = task.rules.joint_errors, (ends.bends, ends.drifts, ends.rates)
    bends_and_drifts(rows[1], rows[2], LENGTHS, errors, *between)
    load_body(task.rules, mover(task, frame), ends, body, h)
    return body


def erring(
    rng: np.random.Generator, rows: tuple[FloatArray, ...], rules: Rules, t: float
) -> Ends:
    """A configuration of the motion with errors in a corner of the box."""
    x0, alpha, theta = (values[0] + t * (values[1] - values[0]) for values in rows)
    off = rules.joint_errors * rng.choice([-1.0, 1.0], (N, 2))
    ends = new_ends(N)
    joints = float(x0), alpha + off[:, 0], theta + off[:, 1]
    place(*joints, LENGTHS, ends.centres[0], ends.frames[0])
    turn_base(rng, rules.base_turn, ends)
    return ends


def turn_base(rng: np.random.Generator, angle: float, ends: Ends) -> None:
    """Rotate everything about the origin of the base, about any axis."""
    x, y, z = (axis := rng.normal(size=3)) / np.linalg.norm(axis)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    ends.centres[0] = ends.centres[0] @ turn.T
    ends.frames[0] = turn @ ends.frames[0]


@pytest.mark.parametrize("frame", FRAMES)
def test_no_motion_of_the_box_leaves_the_body(frame: int) -> None:
    rng = np.random.default_rng(frame + 5)
    for _ in range(60):
        size, h = rng.choice([0.0, 1e-3, 0.2]), rng.choice([0.0, 0.3, 1.0])
        box = ErrorBox(rng.choice([0, 1e-4, 0.03]), base_turn=rng.choice([0, 0.01]))
        task, rows = task_of(box), motion(rng, size)
        body = swept(rows, task, frame, h)
        normals = rng.normal(size=(20, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        reach = np.array([body_reach(body, *n) for n in normals])
        points = np.zeros((2, 3))
        for _ in range(40):
            ends = erring(rng, rows, task.rules, h * rng.uniform())
            local_points(ends, frame, points)
            assert ((normals @ points.T).max(axis=1) <= reach + 1e-12).all()


@pytest.mark.parametrize("frame", FRAMES)
def test_the_body_is_as_small_as_the_first_order_allows(frame: int) -> None:
    """Errors along the gradient, found by differences, come near its support."""
    rng = np.random.default_rng(frame + 9)
    joint, step, points = 1e-5, 1e-6, np.zeros((2, 3))
    for _ in range(10):
        task, rows = task_of(ErrorBox(joint)), motion(rng, 0.0)
        body, n = swept(rows, task, frame, 0.0), rng.normal(size=3)
        n /= np.linalg.norm(n)

        def reach(angles: FloatArray, n: FloatArray = n) -> FloatArray:
            ends = new_ends(N)
            args = 0.0, angles[0], angles[1], LENGTHS
            place(*args, ends.centres[0], ends.frames[0])
            local_points(ends, frame, points)
            return points @ n

        angles = np.array([rows[1][0], rows[2][0]])
        unit = step * np.eye(2 * N).reshape(2 * N, 2, N)
        slopes = np.array([reach(angles + u) - reach(angles - u) for u in unit])
        # Errors of the frame's own joints do not move what is seen from it.
        grown = np.abs(slopes / (2.0 * step)).sum(axis=0) * joint
        best = (reach(angles) + grown).max()
        shift = rows[0][0] * n[0] if frame == BASE else 0.0
        assert body_reach(body, *n) == pytest.approx(best + shift, abs=5e-8)


def test_the_support_is_taken_at_a_point_of_the_body() -> None:
    """Against all corners of both zonotopes."""
    rng, point = np.random.default_rng(3), np.zeros(3)
    for _ in range(100):
        body = new_body(4, 2, 5)
        body.points[:], body.swings[:] = (
            rng.normal(size=(4, 3)),
            rng.normal(size=(2, 5, 3)),
        )
        body.sizes[:], body.balls[:] = rng.integers(1, 6, 2), rng.uniform(0.0, 0.5, 2)
        n = rng.normal(size=3)
        n /= np.linalg.norm(n)
        found = body_support(body, *n, point)
        assert found == pytest.approx(body_reach(body, *n), abs=1e-12)
        assert found == pytest.approx(n @ point, abs=1e-12)
        best = -np.inf
        for k in range(4):
            size = body.sizes[k % 2]
            sides = np.array(np.meshgrid(*[[-1.0, 1.0]] * size)).reshape(size, -1)
            corners = body.points[k] + sides.T @ body.swings[k % 2, :size]
            best = max(best, float((corners @ n).max()) + body.balls[k % 2])
        assert found == pytest.approx(best, abs=1e-12)
