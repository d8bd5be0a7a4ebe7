"""Oracle: joint centres of motions drawn from the slice and the error box."""

import numpy as np
import pytest

from vdsm_pin.geometry.arm import bends_and_drifts, place, place_between
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import Body, body_reach, body_support, new_body
from vdsm_pin.manipulator import built_in
from vdsm_pin.proof.swept_links import (
    Ends,
    load_link,
    local_points,
    new_ends,
    room_of,
)
from vdsm_pin.proof.terms import BASE, Rules

ARM = built_in("hrm8")
LENGTHS, N = np.array(ARM.link_lengths), ARM.n_links
FRAMES = (BASE, 0, 3)
LINK = 6


def rules_of(joint: float, base: float) -> Rules:
    pads = 1e-11, 1e-9, 1e-6, 0.02
    return Rules(LENGTHS, ARM.link_radius, joint, base, 0.0, *pads, np.inf)


def motion(rng: np.random.Generator, size: float) -> tuple[FloatArray, ...]:
    """Two rows of x0, alpha, theta."""
    start = rng.uniform(-0.5, 0.5, (2, 1, N))
    step = size * rng.uniform(-1.0, 1.0, (2, 1, N))
    alpha, theta = (
        np.concatenate([a, a + d]) for a, d in zip(start, step, strict=True)
    )
    return rng.uniform(-0.1, 0.1, 2), alpha, theta


def swept(rows: tuple[FloatArray, ...], rules: Rules, frame: int, h: float) -> Body:
    """The link over the part [0, h] of an interval."""
    ends, body = new_ends(N), new_body(4, room_of(N))
    for k, t in enumerate((0.0, h)):
        place_between(t, *rows, LENGTHS, ends.centres[k], ends.frames[k])
    bends_and_drifts(rows[1], rows[2], LENGTHS, ends.bends, ends.drifts)
    load_link(rules, ends, body, LINK, frame, h)
    return body


def erring(
    rng: np.random.Generator, rows: tuple[FloatArray, ...], rules: Rules, t: float
) -> Ends:
    """A configuration of the motion with errors in a corner of the box."""
    x0, alpha, theta = (values[0] + t * (values[1] - values[0]) for values in rows)
    x0 += rules.base_error * rng.choice([-1.0, 1.0])
    alpha, theta = (
        a + rules.joint_error * rng.choice([-1.0, 1.0], N) for a in (alpha, theta)
    )
    ends = new_ends(N)
    place(float(x0), alpha, theta, LENGTHS, ends.centres[0], ends.frames[0])
    return ends


@pytest.mark.parametrize("frame", FRAMES)
def test_no_motion_of_the_box_leaves_the_body(frame: int) -> None:
    rng = np.random.default_rng(frame + 5)
    for _ in range(60):
        size, h = rng.choice([0.0, 1e-3, 0.2]), rng.choice([0.0, 0.3, 1.0])
        rules = rules_of(rng.choice([0.0, 1e-4, 0.03]), rng.choice([0.0, 0.002]))
        rows = motion(rng, size)
        body = swept(rows, rules, frame, h)
        normals = rng.normal(size=(20, 3))
        normals /= np.linalg.norm(normals, axis=1)[:, None]
        reach = np.array([body_reach(body, *n) for n in normals])
        points = np.zeros((2, 3))
        for _ in range(40):
            ends = erring(rng, rows, rules, h * rng.uniform())
            local_points(ends.centres[0], ends.frames[0], LINK, frame, points)
            assert ((normals @ points.T).max(axis=1) <= reach + 1e-12).all()


@pytest.mark.parametrize("frame", FRAMES)
def test_the_body_is_as_small_as_the_first_order_allows(frame: int) -> None:
    """Errors along the gradient, found by differences, come near its support."""
    rng = np.random.default_rng(frame + 9)
    joint, step, points = 1e-5, 1e-6, np.zeros((2, 3))
    for _ in range(10):
        rules, rows = rules_of(joint, 0.0), motion(rng, 0.0)
        body, n = swept(rows, rules, frame, 0.0), rng.normal(size=3)
        n /= np.linalg.norm(n)

        def reach(angles: FloatArray, n: FloatArray = n) -> FloatArray:
            ends = new_ends(N)
            args = 0.0, angles[0], angles[1], LENGTHS
            place(*args, ends.centres[0], ends.frames[0])
            local_points(ends.centres[0], ends.frames[0], LINK, frame, points)
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
        body = new_body(4, 5)
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
