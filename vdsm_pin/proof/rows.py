"""The configurations of a block of rows, coordinates apart so that loops run over rows.

Every array has the rows last: the loops below are what a compiler turns into vector
instructions, and each writes one array only, so that it sees that nothing overlaps.
"""

from math import cos, sin
from typing import Final, NamedTuple

import numpy as np

from vdsm_pin.geometry.arm import turned_by
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.compiled import apart, compiled
from vdsm_pin.proof.terms import Motion, Rules

BLOCK: Final = 64
"""Intervals whose configurations are computed at once: they fit the cache."""

WORK: Final = 7
"""Rows of working space."""


class Rows(NamedTuple):
    """Configurations of a block of rows and what lies between them.

    Frames count from the base: frame 0 is the base, frame f + 1 that of link f.

    Args:
        frames: R_base_frame, shape (N + 1, 3, 3, BLOCK + 1); [-].
        centres: O_j in a frame, shape (N + 1, N + 1, 3, BLOCK + 1); of frame f + 1
            only the end of its link and the centres behind it; [m].
        sags: M/8, how far O_j may leave its chord with joints before f at rest, at
            [f, j], shape (N + 1, N + 1, BLOCK); [m].
        drifts: D at [f, j], only where joints may err, the same shape; [m].
        turns: |change of alpha_l| + |change of theta_l|, shape (N, BLOCK); [rad].
        work: Working space, shape (WORK, BLOCK + 1).
    """

    frames: FloatArray
    centres: FloatArray
    sags: FloatArray
    drifts: FloatArray
    turns: FloatArray
    work: FloatArray


@compiled
def new_rows(n_links: int) -> Rows:
    """Fresh working space; its base frame is set."""
    n = n_links + 1
    frames = np.zeros((n, 3, 3, BLOCK + 1))
    for c in range(3):
        frames[0, c, c] = 1.0
    return Rows(
        frames,
        np.zeros((n, n, 3, BLOCK + 1)),
        np.zeros((n, n, BLOCK)),
        np.zeros((n, n, BLOCK)),
        np.zeros((n_links, BLOCK)),
        np.zeros((WORK, BLOCK + 1)),
    )


@compiled
def _blend(
    x: FloatArray,
    y: FloatArray,
    z: FloatArray,
    a: FloatArray,
    b: FloatArray,
    c: FloatArray,
    out: FloatArray,
) -> None:
    """Out = a x + b y + c z, row by row."""
    for r in range(out.size):
        out[r] = a[r] * x[r] + b[r] * y[r] + c[r] * z[r]


@compiled
def _turn_link(motion: Motion, rows: Rows, first: int, n: int, link: int) -> None:
    """Frame of a link from the one before: Rz(alpha) Ry(theta)."""
    apart()
    cos_a, sin_a = rows.work[0, :n], rows.work[1, :n]
    cos_t, sin_t = rows.work[2, :n], rows.work[3, :n]
    across, last = rows.work[4, :n], motion.x0.size - 1
    for r in range(n):
        k = min(first + r, last)
        alpha, theta = motion.alpha[k, link], motion.theta[k, link]
        cos_a[r], sin_a[r] = cos(alpha), sin(alpha)
        cos_t[r], sin_t[r] = cos(theta), sin(theta)
    for c in range(3):
        x = rows.frames[link, c, 0, :n]
        y, z = rows.frames[link, c, 1, :n], rows.frames[link, c, 2, :n]
        new_x = rows.frames[link + 1, c, 0, :n]
        new_y = rows.frames[link + 1, c, 1, :n]
        new_z = rows.frames[link + 1, c, 2, :n]
        for r in range(n):
            across[r] = cos_a[r] * x[r] + sin_a[r] * y[r]
        for r in range(n):
            new_x[r] = cos_t[r] * across[r] - sin_t[r] * z[r]
        for r in range(n):
            new_y[r] = cos_a[r] * y[r] - sin_a[r] * x[r]
        for r in range(n):
            new_z[r] = sin_t[r] * across[r] + cos_t[r] * z[r]


@compiled
def _place(motion: Motion, rules: Rules, rows: Rows, first: int, n: int) -> None:
    """Link frames, and joint centres in the base frame."""
    apart()
    last = motion.x0.size - 1
    for r in range(n):
        rows.centres[0, 0, 0, r] = motion.x0[min(first + r, last)]
    for link in range(rules.lengths.size):
        _turn_link(motion, rows, first, n, link)
        length = rules.lengths[link]
        for c in range(3):
            start, axis = rows.centres[0, link, c, :n], rows.frames[link + 1, c, 0, :n]
            end = rows.centres[0, link + 1, c, :n]
            for r in range(n):
                end[r] = start[r] + length * axis[r]


@compiled
def _localise(rules: Rules, rows: Rows, n: int) -> None:
    """Joint centres in the frames of the links before them."""
    apart()
    n_links = rows.frames.shape[0] - 1
    for f in range(1, n_links):
        rows.centres[f, f, 0, :n] = rules.lengths[f - 1]
        for j in range(f + 1, n_links + 1):
            for c in range(3):
                o, p = rows.centres[0, f - 1, c, :n], rows.centres[0, j, c, :n]
                arm = rows.work[c, :n]
                for r in range(n):
                    arm[r] = p[r] - o[r]
            for c in range(3):
                _blend(
                    rows.work[0, :n],
                    rows.work[1, :n],
                    rows.work[2, :n],
                    rows.frames[f, 0, c, :n],
                    rows.frames[f, 1, c, :n],
                    rows.frames[f, 2, c, :n],
                    rows.centres[f, j, c, :n],
                )


@compiled
def _bend(motion: Motion, rules: Rules, rows: Rows, first: int, count: int) -> None:
    """How far from linear the intervals are: sags, and drifts where joints may err."""
    apart()
    n_links, last = rules.lengths.size, motion.x0.size - 1
    for r in range(count):
        k, after_k = min(first + r, last), min(first + r + 1, last)
        for link in range(n_links):
            yaw = abs(motion.alpha[after_k, link] - motion.alpha[k, link])
            pitch = abs(motion.theta[after_k, link] - motion.theta[k, link])
            rows.turns[link, r] = yaw + pitch
    turning = rows.work[0, :count]
    for f in range(n_links):
        turning[:] = 0.0
        for link in range(f, n_links):
            length = rules.lengths[link]
            turn = rows.turns[link, :count]
            for r in range(count):
                turning[r] += turn[r]
            before, after = rows.sags[f, link, :count], rows.sags[f, link + 1, :count]
            for r in range(count):
                after[r] = before[r] + 0.125 * length * turning[r] * turning[r]
            if rules.joints_err:
                error = turned_by(rules.joint_errors, f, link)
                before = rows.drifts[f, link, :count]
                after = rows.drifts[f, link + 1, :count]
                for r in range(count):
                    after[r] = before[r] + error * length * turning[r]


@compiled
def fill_rows(motion: Motion, rules: Rules, rows: Rows, first: int, count: int) -> None:
    """Configurations of rows first .. first + count; the last row may repeat."""
    apart()
    _place(motion, rules, rows, first, count + 1)
    _localise(rules, rows, count + 1)
    _bend(motion, rules, rows, first, count)


@compiled
def turning_of(rows: Rows, f: int, link: int, count: int, out: FloatArray) -> None:
    """W of a link with joints below f at rest, shape (>= count,); [rad]."""
    out[:count] = 0.0
    for k in range(f, link + 1):
        turn = rows.turns[k]
        for r in range(count):
            out[r] += turn[r]


@compiled
def place_corner(
    rows: Rows, link: int, at: FloatArray, count: int, out: FloatArray
) -> None:
    """A point of a link's frame in the base frame, shape (3, >= count); [m]."""
    x, y, z = at[0], at[1], at[2]
    for c in range(3):
        o, f = rows.centres[0, link, c], rows.frames[link + 1, c]
        fx, fy, fz, place = f[0], f[1], f[2], out[c]
        for r in range(count):
            place[r] = o[r] + (x * fx[r] + y * fy[r] + z * fz[r])


@compiled
def turn_axis(
    rows: Rows, f: int, link: int, axis: FloatArray, count: int, out: FloatArray
) -> None:
    """A direction of a link's frame in frame f, shape (3, >= count)."""
    x, y, z = axis[0], axis[1], axis[2]
    for c in range(3):
        g = rows.frames[link + 1, c]
        gx, gy, gz, turned = g[0], g[1], g[2], out[c]
        for r in range(count):
            turned[r] = x * gx[r] + y * gy[r] + z * gz[r]
    if f > 0:
        _turn_back(rows, f, count, out)


@compiled
def _turn_back(rows: Rows, f: int, count: int, out: FloatArray) -> None:
    """Directions of the base frame in frame f, shape (3, >= count)."""
    work = rows.work
    for c in range(3):
        for r in range(count):
            work[c, r] = out[c, r]
    for c in range(3):
        _blend(
            work[0, :count],
            work[1, :count],
            work[2, :count],
            rows.frames[f, 0, c, :count],
            rows.frames[f, 1, c, :count],
            rows.frames[f, 2, c, :count],
            out[c, :count],
        )


@compiled
def to_frame(
    rows: Rows, f: int, count: int, based: FloatArray, out: FloatArray
) -> None:
    """Points of the base frame in frame f, shape (3, >= count); [m]."""
    for c in range(3):
        if f == 0:
            out[c, :count] = based[c, :count]
            continue
        o = rows.centres[0, f - 1, c]
        for r in range(count):
            out[c, r] = based[c, r] - o[r]
    if f > 0:
        _turn_back(rows, f, count, out)


@compiled
def _swing(
    rules: Rules, rows: Rows, f: int, link: int, based: FloatArray, first: int, end: int
) -> None:
    """G of a point along the directions in work[3:6], to work[6], rows [first, end).

    The sum over the angles of joints f to `link` of error |n . (axis x arm)|: yaw turns
    about z of the frame before, pitch about y of the joint's own; [m].
    """
    apart()
    nx, ny = rows.work[3, first:end], rows.work[4, first:end]
    nz = rows.work[5, first:end]
    swing = rows.work[6, first:end]
    swing[:] = 0.0
    for joint in range(f, link + 1):
        for c in range(3):
            o = rows.centres[0, joint, c, first:end]
            p, arm = based[c, first:end], rows.work[c, first:end]
            for r in range(arm.size):
                arm[r] = p[r] - o[r]
        ax, ay = rows.work[0, first:end], rows.work[1, first:end]
        az = rows.work[2, first:end]
        for turn in range(2):
            frame, axis = joint + turn, 2 - turn
            error = rules.joint_errors[joint, turn]
            ux = rows.frames[frame, 0, axis, first:end]
            uy = rows.frames[frame, 1, axis, first:end]
            uz = rows.frames[frame, 2, axis, first:end]
            for r in range(swing.size):
                x = uy[r] * az[r] - uz[r] * ay[r]
                y = uz[r] * ax[r] - ux[r] * az[r]
                z = ux[r] * ay[r] - uy[r] * ax[r]
                swing[r] += error * abs(nx[r] * x + ny[r] * y + nz[r] * z)


@compiled
def add_errors(
    rules: Rules,
    rows: Rows,
    f: int,
    link: int,
    based: FloatArray,
    n: FloatArray,
    first: int,
    last: int,
    out: FloatArray,
) -> None:
    """Add half of G of a point at both ends of intervals, along n given in frame f.

    Args:
        rules: The error box.
        rows: The block.
        f: Frame of the partner: joints from f on err.
        link: The link that the point rides on.
        based: The point in the base frame, shape (3, BLOCK + 1); [m].
        n: Unit vector, shape (3,); [-].
        first: First interval.
        last: One past the last interval.
        out: Added to at [first, last), shape (BLOCK,); [m].
    """
    apart()
    end = last + 1
    for c in range(3):
        x, y = rows.frames[f, c, 0, first:end], rows.frames[f, c, 1, first:end]
        z, turned = rows.frames[f, c, 2, first:end], rows.work[3 + c, first:end]
        for r in range(turned.size):
            turned[r] = n[0] * x[r] + n[1] * y[r] + n[2] * z[r]
    _swing(rules, rows, f, link, based, first, end)
    swing = rows.work[6]
    for r in range(first, last):
        out[r] += 0.5 * (swing[r] + swing[r + 1])
