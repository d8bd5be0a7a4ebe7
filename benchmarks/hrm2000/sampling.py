"""A motion looked at row by row and densely in between, without the package's geometry.

Forward kinematics by rotation matrices, distances by closed forms from points of the
links' axes; those to meshes by Coal. Nothing here proves that a motion is good, but
whatever is found wrong is wrong.
"""

import itertools
from dataclasses import dataclass
from functools import singledispatch
from typing import Final

import coal
import numpy as np
import shapely

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry import solids
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem import scene
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.tolerances import TOLERANCES

STEP: Final = 1e-3
"""Way of a joint centre from sample to sample; lengths of the arm."""

MOST: Final = 6_000
"""Samples of one motion at most."""

POINTS: Final = 4
"""Points of a link's axis per body radius."""

NEAR: Final = 0.5
"""Gap up to which a distance from a mesh is measured; body radii."""


@dataclass(frozen=True)
class Sampled:
    """What was seen of a motion.

    Args:
        n_samples: How many configurations.
        clearance: The least one seen; [m].
        faults: What is wrong, one sentence each.
    """

    n_samples: int
    clearance: float
    faults: tuple[str, ...]


def sample(problem: PlanningProblem, motion: Trajectory) -> Sampled:
    """Look at a motion densely.

    Args:
        problem: What is asked.
        motion: The rows.
    """
    arm = problem.manipulator
    joints, moments = _dense(arm, motion)
    centres = chain(arm, joints)
    least = np.inf
    for obstacle in problem.scene.obstacles:
        least = min(least, float(clearance(obstacle, arm, centres)))
    faults = [*_limits(arm, motion), *_tip(problem, motion, centres, moments)]
    faults += _looks(problem, motion, centres, moments)
    # What Coal's distances and those of points are good for.
    if not least >= problem.required_clearance - TOLERANCES.coal_agreement:
        faults.append(f"clearance {1e3 * least:.4f} mm")
    return Sampled(len(joints), least, tuple(faults))


def _dense(arm: Manipulator, motion: Trajectory) -> tuple[FloatArray, FloatArray]:
    """Joint values and the moments they belong to, in rows."""
    rows = motion.joints
    way = np.linalg.norm(np.diff(chain(arm, rows), axis=0), axis=2).max(axis=1)
    step = max(STEP * arm.total_length, float(way.sum()) / MOST)
    parts = [np.arange(n) / n for n in np.maximum(1, np.ceil(way / step)).astype(int)]
    moments = np.concatenate([*(k + p for k, p in enumerate(parts)), [len(rows) - 1.0]])
    before = np.minimum(moments.astype(int), max(0, len(rows) - 2))
    share = (moments - before)[:, None]
    after = np.minimum(before + 1, len(rows) - 1)
    return rows[before] + share * (rows[after] - rows[before]), moments


def chain(arm: Manipulator, joints: FloatArray) -> FloatArray:
    """Joint centres by rotation matrices, shape (n, N + 1, 3); [m].

    Args:
        arm: The arm.
        joints: q = (x0, alpha1, theta1, ..), shape (n, 1 + 2N); [m], [rad].
    """
    turned = np.broadcast_to(np.eye(3), (len(joints), 3, 3))
    here = np.zeros((len(joints), 3))
    here[:, 0] = joints[:, 0]
    centres = [here]
    for i, length in enumerate(arm.link_lengths):
        yaw, pitch = joints[:, 1 + 2 * i], joints[:, 2 + 2 * i]
        zero, one = np.zeros_like(yaw), np.ones_like(yaw)
        (c, s), (u, v) = (np.cos(yaw), np.sin(yaw)), (np.cos(pitch), np.sin(pitch))
        about_z = np.array([[c, -s, zero], [s, c, zero], [zero, zero, one]])
        about_y = np.array([[u, zero, v], [zero, one, zero], [-v, zero, u]])
        turned = turned @ about_z.transpose(2, 0, 1) @ about_y.transpose(2, 0, 1)
        here = here + length * turned[:, :, 0]
        centres.append(here)
    return np.stack(centres, axis=1)


def clearance(obstacle: scene.Obstacle, arm: Manipulator, centres: FloatArray) -> float:
    """From the links' surfaces to an obstacle, over all samples; [m]."""
    if isinstance(obstacle, solids.Mesh):
        return _to_mesh(obstacle, arm, centres)
    least = np.inf
    for i, length in enumerate(arm.link_lengths):
        count = max(2, int(np.ceil(POINTS * length / arm.link_radius)) + 1)
        share = np.linspace(0.0, 1.0, count)[:, None]
        begins, ends = centres[:, i, None], centres[:, i + 1, None]
        points = (begins + share * (ends - begins)).reshape(-1, 3)
        least = min(least, float(outside(obstacle, points).min()))
    return least - arm.link_radius


def _to_mesh(mesh: solids.Mesh, arm: Manipulator, centres: FloatArray) -> float:
    """By Coal, link by link; a body inside a mesh is not seen."""
    surface = coal.BVHModelOBBRSS()
    surface.beginModel(len(mesh.triangles), len(mesh.vertices))
    surface.addVertices(np.array(mesh.vertices))
    surface.addTriangles(np.array(mesh.triangles))
    surface.endModel()
    request, still, least = coal.DistanceRequest(), coal.Transform3s(), np.inf
    request.gjk_tolerance = TOLERANCES.coal_gjk
    for i, length in enumerate(arm.link_lengths):
        body = coal.Capsule(arm.link_radius, float(length))
        begins, ends = centres[:, i], centres[:, i + 1]
        bound = _between_boxes(mesh, begins, ends) - arm.link_radius
        near = bound <= NEAR * arm.link_radius
        least = min(least, float(bound[~near].min(initial=np.inf)))
        for begin, end in zip(begins[near], ends[near], strict=True):
            z = (end - begin) / length
            x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
            x /= np.linalg.norm(x)
            turn = np.column_stack([x, np.cross(z, x), z])
            place = coal.Transform3s(turn, (begin + end) / 2.0)
            result = coal.DistanceResult()
            gap = coal.distance(body, place, surface, still, request, result)
            least = min(least, float(gap))
    return least


def _between_boxes(
    mesh: solids.Mesh, begins: FloatArray, ends: FloatArray
) -> FloatArray:
    """Gaps between the boxes about links' axes and a mesh, shape (n,); [m]."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    ahead, behind = np.minimum(begins, ends) - high, low - np.maximum(begins, ends)
    return _beyond(np.maximum(ahead, behind))


@singledispatch
def outside(obstacle: object, points: FloatArray) -> FloatArray:
    """Distance of points from a solid; 0 or less in it, shape (n,); [m]."""
    raise NotImplementedError(type(obstacle))


@outside.register
def _(ball: solids.Sphere, points: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(points - ball.centre, axis=1) - ball.radius)


@outside.register
def _(rod: solids.Capsule, points: FloatArray) -> FloatArray:
    off = points - rod.centre
    along = np.clip(off @ rod.axis, -rod.half_length, rod.half_length)
    return np.asarray(np.linalg.norm(off - np.outer(along, rod.axis), axis=1)
                      - rod.radius)  # fmt: skip


@outside.register
def _(pipe: solids.Cylinder, points: FloatArray) -> FloatArray:
    off = points - pipe.centre
    along = off @ pipe.axis
    aside = np.linalg.norm(off - np.outer(along, pipe.axis), axis=1) - pipe.radius
    return _beyond(np.stack([aside, np.abs(along) - pipe.half_length], axis=1))


@outside.register
def _(box: solids.Box, points: FloatArray) -> FloatArray:
    return _beyond(np.abs((points - box.centre) @ box.rotation) - box.half_size)


@outside.register
def _(half: solids.HalfSpace, points: FloatArray) -> FloatArray:
    return np.asarray((points - half.point) @ half.normal)


@outside.register
def _(prism: solids.Prism, points: FloatArray) -> FloatArray:
    local = (points - prism.origin) @ prism.rotation
    section = shapely.Polygon(prism.polygon)
    flat = shapely.points(local[:, :2])
    aside = np.asarray(shapely.distance(flat, section))
    low, high = prism.span
    along = np.maximum(low - local[:, 2], local[:, 2] - high)
    return _beyond(np.stack([aside, along], axis=1))


def _beyond(excess: FloatArray) -> FloatArray:
    """Length of the positive parts of each row."""
    return np.asarray(np.linalg.norm(np.maximum(excess, 0.0), axis=1))


def _limits(arm: Manipulator, motion: Trajectory) -> list[str]:
    """Box, cone and rail; their extremes lie at rows."""
    alpha, theta, slack = motion.alpha, motion.theta, TOLERANCES.joint_limit
    psi = np.arccos(np.minimum(1.0, np.cos(alpha) * np.cos(theta)))
    box = max(np.abs(alpha).max(), np.abs(theta).max())
    low, high = arm.base_range
    beyond = max(low - motion.x0.min(), motion.x0.max() - high)
    faults = []
    # An arc cosine is good to 1e-8.
    if not psi.max() <= arm.max_link_angle + 1e-7:
        faults.append(f"link angle {np.rad2deg(psi.max()):.6f} deg")
    if not box <= arm.max_joint_angle + slack:
        faults.append(f"joint angle {np.rad2deg(box):.6f} deg")
    if not beyond <= TOLERANCES.base_limit:
        faults.append(f"base {1e3 * beyond:.6f} mm off its rail")
    return faults


def _tip(
    problem: PlanningProblem,
    motion: Trajectory,
    centres: FloatArray,
    moments: FloatArray,
) -> list[str]:
    """Start, rows on the path, and whether every place of it is drawn as asked."""
    path, tips = problem.path, centres[:, -1]
    faults = []
    if not np.linalg.norm(tips[0] - path.start) <= TOLERANCES.tip_on_path:
        faults.append("the tip does not begin at its start")
    corners = np.vstack([path.points, path.points[:1]]) if path.closed else path.points
    on = motion.on_path
    row = moments == np.round(moments)
    at_rows = row & on[np.minimum(np.round(moments).astype(int), on.size - 1)]
    off = _to_line(corners, tips[at_rows]).max(initial=0.0)
    if not off <= 2.0 * TOLERANCES.tip_on_path:
        faults.append(f"tip {1e3 * off:.6f} mm off the path at a row")
    before = np.minimum(moments.astype(int), on.size - 1)
    after = np.minimum(np.ceil(moments).astype(int), on.size - 1)
    drawn = tips[on[before] & on[after]]
    if problem.path.required_coverage < 1.0:
        return faults
    places = _along(corners, path.spacing / 2.0)
    if not len(drawn):
        return [*faults, "nothing is drawn"]
    missed = np.array([np.linalg.norm(drawn - p, axis=1).min() for p in places])
    if not missed.max() <= 1.5 * path.spacing:
        faults.append(f"a place of the path is missed by {1e3 * missed.max():.2f} mm")
    return faults


def _looks(
    problem: PlanningProblem,
    motion: Trajectory,
    centres: FloatArray,
    moments: FloatArray,
) -> list[str]:
    """Whether the last link looks where it shall wherever the tip draws."""
    wish, on = problem.path.pointing, motion.on_path
    if wish is None:
        return []
    before = np.minimum(moments.astype(int), on.size - 1)
    after = np.minimum(np.ceil(moments).astype(int), on.size - 1)
    drawn = on[before] & on[after]
    station = np.interp(moments, np.arange(on.size), motion.path_m)[drawn]
    tips, last = centres[drawn, -1], centres[drawn, -1] - centres[drawn, -2]
    if wish.target is not None:
        aims = wish.target - tips
    elif wish.directions is not None and len(wish.directions) == 1:
        aims = np.repeat(wish.directions, len(tips), axis=0)
    else:
        aims = problem.path.aims(tips, station)
    cosine = (last * aims).sum(axis=1)
    cosine /= np.linalg.norm(last, axis=1) * np.linalg.norm(aims, axis=1)
    off = float(np.arccos(np.clip(cosine, -1.0, 1.0)).max(initial=0.0))
    # An arc cosine near 1 is good to 1e-8.
    if off <= wish.cone + 1e-6:
        return []
    return [f"the last link looks {np.rad2deg(off):.4f} deg past its aim"]


def _along(corners: FloatArray, step: float) -> FloatArray:
    """Places of a polyline, no farther apart than a step, shape (k, 3); [m]."""
    parts = [corners[:1]]
    for begin, end in itertools.pairwise(corners):
        count = int(np.ceil(np.linalg.norm(end - begin) / step)) + 1
        parts.append(np.linspace(begin, end, count)[1:])
    return np.concatenate(parts)


def _to_line(corners: FloatArray, points: FloatArray) -> FloatArray:
    """Distance of points from a polyline, shape (n,); [m]."""
    least = np.linalg.norm(points - corners[0], axis=1)
    for begin, end in itertools.pairwise(corners):
        way = end - begin
        length = float(way @ way)
        share = (points - begin) @ way / (length if length > 0.0 else 1.0)
        foot = begin + np.clip(share, 0.0, 1.0)[:, None] * way
        least = np.minimum(least, np.linalg.norm(points - foot, axis=1))
    return np.asarray(least)
