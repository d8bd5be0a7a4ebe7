"""What an error box adds to the corners of a body over a block of rows, compiled.

To first order an error of a joint moves a point by error (axis x arm), whichever way
round the joint stands between the partner and the point; turns of placements have any
axis. Shifts cost every plane the same and are not added here.
"""

from math import sqrt

from vdsm_pin.compiled import compiled
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.geometry.bodies import RADIUS
from vdsm_pin.proof.packed_tree import PRISMATIC, PackedTree
from vdsm_pin.proof.rows import Rows, blend, carry
from vdsm_pin.proof.terms import WORLD, Mover, Task
from vdsm_pin.proof.ways import WayErrors


@compiled
def second_order(errors: WayErrors, way: int, lever: float) -> float:
    """Second order of turns in a point, so far from its frame's origin; [m]."""
    turned = errors.turned[way]
    return float(errors.second[way] + 0.5 * lever * turned * turned)


@compiled
def crude_growth(errors: WayErrors, way: int, lever: float) -> float:
    """What errors add to n.x of a point for any n and any configuration; [m].

    What an interval's own motion adds, half its drift, comes on top.
    """
    first = errors.crude[way] + errors.swing[way] * lever
    return float(first + second_order(errors, way, lever))


@compiled
def set_direction(
    rows: Rows, rest: int, n: FloatArray, first: int, end: int, out: FloatArray
) -> None:
    """A direction given in a frame, in the world's, rows [first, end) of (3, ..)."""
    frame = rows.frames[rest]
    for c in range(3):
        turned = out[c, first:end]
        if rest == WORLD:
            turned[:] = n[c]
        else:
            f = frame[c]
            x, y, z = f[0, first:end], f[1, first:end], f[2, first:end]
            blend(x, y, z, n, turned)


@compiled
def _set_arm(
    tree: PackedTree, rows: Rows, joint: int, based: FloatArray, end: int
) -> None:
    """From a joint's placement to a point, to work[:3], rows below `end`."""
    origin = rows.origins[joint + 1]
    if tree.kind[joint] == PRISMATIC:
        parent, origin = tree.parent[joint], rows.work[:3]
        shift = tree.shift[joint]
        carry(rows.origins[parent], rows.frames[parent], shift, end, origin)
    for c in range(3):
        arm, point, o = rows.work[c], based[c], origin[c]
        for r in range(end):
            arm[r] = point[r] - o[r]


@compiled
def _cross(rows: Rows, toward: FloatArray, first: int, end: int) -> None:
    """work[3:6] = work[:3] x toward, rows [first, end)."""
    work = rows.work
    for c in range(3):
        d, e = (c + 1) % 3, (c + 2) % 3
        p, q, out = work[d, first:end], work[e, first:end], work[3 + c, first:end]
        u, v = toward[d, first:end], toward[e, first:end]
        for r in range(out.size):
            out[r] = p[r] * v[r] - q[r] * u[r]


@compiled(inline=False)
def _add_turn(
    tree: PackedTree, rows: Rows, joint: int, error: float, first: int, end: int
) -> None:
    """Add error |axis . (arm x n)| to work[6], rows [first, end)."""
    frame, axis = rows.frames[joint + 1], tree.axis[joint]
    work, swing = rows.work, rows.work[6, first:end]
    x, y, z = work[3, first:end], work[4, first:end], work[5, first:end]
    along = tree.along[joint]
    if along < 3:
        u, v = frame[0, along, first:end], frame[1, along, first:end]
        w = frame[2, along, first:end]
        for r in range(swing.size):
            swing[r] += error * abs(u[r] * x[r] + v[r] * y[r] + w[r] * z[r])
        return
    for c in range(3):
        f, part = frame[c], work[3 + c, first:end]
        for r in range(part.size):
            k = first + r
            turned = axis[0] * f[0, k] + axis[1] * f[1, k] + axis[2] * f[2, k]
            part[r] *= turned
    for r in range(swing.size):
        swing[r] += error * abs(x[r] + y[r] + z[r])


@compiled
def _add_tilt(rows: Rows, tilt: float, first: int, end: int) -> None:
    """Add what a turn about any axis may move the point by, work[:3] away from it."""
    work = rows.work
    for r in range(first, end):
        x, y, z = work[0, r], work[1, r], work[2, r]
        work[7, r] += tilt * sqrt(x * x + y * y + z * z)


@compiled(inline=False)
def _swing(
    task: Task, rows: Rows, way: int, based: FloatArray, toward: FloatArray, first: int
) -> None:
    """G of a point along a direction, to work[6], and what tilts do, to work[7]; [m].

    From row `first` on. Joints that meet in one origin share their arm.
    """
    tree, ways, errors = task.tree, task.ways, task.errors
    end, ready = toward.shape[1], -1
    rows.work[6:, first:end] = 0.0
    while ways.before[way] >= 0:
        joint = ways.joint[way]
        error, tilt = errors.turn[joint], errors.tilt[joint]
        if error > 0.0 or tilt > 0.0:
            if ready != joint:
                _set_arm(tree, rows, joint, based, end)
                _cross(rows, toward, first, end)
            if tilt > 0.0:
                _add_tilt(rows, tilt, first, end)
            if error > 0.0:
                _add_turn(tree, rows, joint, error, first, end)
        ready = -1
        met = tree.lever[joint] == 0.0 and tree.kind[joint] != PRISMATIC
        if error > 0.0 and tree.along[joint] < 3 and met and not ways.up[way]:
            ready = tree.parent[joint] - 1
            # The origin of a prismatic joint's placement is not that of its frame.
            if ready >= 0 and tree.kind[ready] == PRISMATIC:
                ready = -1
        way = ways.before[way]


@compiled(inline=False)
def grow_corners(
    task: Task,
    mover: Mover,
    rows: Rows,
    toward: FloatArray,
    first: int,
    crudely: bool,
    growth: FloatArray,
) -> None:
    """What errors that turn add to n.x of a body's corners over a block.

    Args:
        task: The tree and the error box.
        mover: The body.
        rows: The block.
        toward: n in the world's frame at its rows, shape (3, last + 1); [-].
        first: The first interval of the block that is asked about; the last one ends at
            the last row of `toward`.
        crudely: Whether a bound for any n will do.
        growth: Written at [first, last), shape (corners, BLOCK); [m].
    """
    errors, places, last = task.errors, task.places, toward.shape[1] - 1
    beyond = mover.disc[RADIUS] * errors.turned[mover.way]
    for k in range(mover.slots.size):
        place, out = mover.slots[k], growth[k]
        way, lever = places.way[place], places.lever[place]
        least = second_order(errors, way, lever) + beyond
        crude = crude_growth(errors, way, lever)
        least = crude if crudely else least
        drift = rows.tracks.drifts[place]
        for r in range(first, last):
            out[r] = least + 0.5 * drift[r]
        if not crudely:
            based = rows.tracks.places[places.point[place]]
            _swing(task, rows, way, based, toward, first)
            swing, tilted = rows.work[6], rows.work[7]
            for r in range(first, last):
                out[r] += 0.5 * (swing[r] + swing[r + 1])
            # The arm of a turn, a length, is convex but for the sag.
            tilt, sag = errors.turned[way] - errors.erring[way], rows.tracks.sags[place]
            if tilt > 0.0:
                for r in range(first, last):
                    out[r] += max(tilted[r], tilted[r + 1]) + tilt * sag[r]
