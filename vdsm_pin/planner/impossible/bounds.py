"""What can be proved about a problem: tips no arm reaches, angles no plan can spare.

Every proof here rests on a necessary condition. A tip beyond the curled reach or within
an obstacle's margin cannot be drawn (`cut_off.py` finds those no way leads to,
`last_link.py` those where the last link has no room). An arm without a changed link
angle lies along the rail, and an arm with one lies along it up to that joint, but for a
deviation that is bounded: N postures for each tip, and where none of them comes near
being clear a second angle must change.

How far may an arm stand from its ideal while its angles count as unchanged? Unchanged
means at most `TOLERANCES.changed_angle`, not 0. Let joint k alone be changed
(joints counted from 0, e the threshold, L_l the links, R the length from joint k on).

* Links before k lean at most (l + 1) e: joint k is at most a = sum_{l<k} L_l (l + 1) e
  off the rail, and its distance from the base falls short by at most
  b = sum_{l<k} L_l ((l + 1) e)^2 / 2.
* Links after k lean at most (l - k) e from link k. A point of them, at whatever arc
  length, is at most s = sum_{l>k} L_l (l - k) e from its place on the chord between
  joint k and tip. That chord is at least R - c long, where
  c = sum_{l>k} L_l ((l - k) e)^2 / 2.
* No link leans more than w = limit + N e from the rail. So the tip's distance t from
  the rail is at most R sin(w) + a, and tip and joint k are R cos(w) apart along it.

The ideal arm draws the same tip, lies on the rail up to joint k and runs straight from
there: sqrt(R^2 - t^2) along the rail. With the chord squared less what it is across,
joint k of both differs along the rail by at most

    d = (2 R c + (2 t + a) a) / (R cos(w) + sqrt(R^2 - t^2)) .

So within a + b + s + d of every point of the ideal axis lies one of the arm's axis, and
the bases differ by less than that.
"""

from dataclasses import dataclass, fields

import numpy as np

from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import BoolArray, FloatArray, IntArray
from vdsm_pin.planner.feasibility import curled_reach, rail_distance
from vdsm_pin.planner.one_knee import pose_shapes
from vdsm_pin.planner.records import LinkClearance
from vdsm_pin.planner.upper_clearance import upper_clearance
from vdsm_pin.problem.held import TIP
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.tolerances import TOLERANCES


@dataclass(frozen=True)
class Deviation:
    """What sub-threshold angles can add to an arm with one changed angle.

    Args:
        straight: Largest distance of the tip from the rail with none changed; [m].
        bend: Largest angle of the ideal arm's bend at each joint, shape (N,), NaN where
            there is no ideal arm for some reachable tips; [rad].
        body: Distance of the ideal axis from the arm's, shape (n, N), NaN where the
            ideal arm does not reach the tip; [m].
    """

    straight: float
    bend: FloatArray
    body: FloatArray


def deviation(manipulator: Manipulator, off: FloatArray) -> Deviation:
    """The bounds above.

    Args:
        manipulator: The arm.
        off: Distance of tips from the rail, shape (n,); [m].
    """
    count, lengths = manipulator.n_links, manipulator.link_lengths
    small = TOLERANCES.changed_angle
    link = np.arange(count)
    before = np.where(link[None] < link[:, None], link + 1, 0) * small
    after = np.maximum(link[None] - link[:, None], 0) * small
    aside, ahead = before @ lengths, (before**2 / 2.0) @ lengths
    chord, short = after @ lengths, (after**2 / 2.0) @ lengths
    rest = manipulator.total_length - manipulator.stations[:-1]
    lean = manipulator.max_link_angle + TOLERANCES.joint_limit + count * small
    if lean < np.pi / 2.0:
        sine = np.sin(lean) + aside / rest
        bend = np.arcsin(np.where(sine < 1.0, sine, np.nan))
    else:
        bend = np.full(count, np.nan)
    square = rest**2 - off[:, None] ** 2
    along = np.sqrt(np.where(square > 0.0, square, np.nan))
    shift = 2.0 * rest * short + (2.0 * off[:, None] + aside) * aside
    shift = shift / (rest * np.cos(lean) + along)
    body = aside + ahead + chord + shift
    return Deviation(float(lengths @ ((link + 1) * small)), bend, body)


@dataclass(frozen=True)
class TipProof:
    """Which tips nobody can reach.

    Args:
        far: Beyond the reach of the curled arm, or of the straight one from the ends
            of its rail, shape (n,).
        buried: Within the margin of an obstacle, shape (n,).
        cut_off: No way leads there from the start, shape (n,).
        hemmed_in: The last link has no room there, shape (n,).
    """

    far: BoolArray
    buried: BoolArray
    cut_off: BoolArray
    hemmed_in: BoolArray

    def take(self, rows: IntArray) -> "TipProof":
        """What is known of some of the tips, shape (k,)."""
        return TipProof(*(getattr(self, one.name)[rows] for one in fields(self)))

    @property
    def undrawable(self) -> BoolArray:
        """Any of them, shape (n,)."""
        return self.far | self.buried | self.cut_off | self.hemmed_in


def prove_tips(
    problem: PlanningProblem, clearance: LinkClearance, tips: FloatArray
) -> TipProof:
    """Tips that no configuration reaches with the required clearance.

    Args:
        problem: Arm, scene, required clearance.
        clearance: Lower bounds, which tell where a proof is worth trying.
        tips: Shape (n, 3); [m].
    """
    reach = curled_reach(problem.manipulator)
    far = np.hypot(tips[:, 1], tips[:, 2]) > reach + problem.tip_tolerance
    length = problem.manipulator.total_length + TOLERANCES.joint_centre
    far |= rail_distance(problem.manipulator, tips) > length + problem.tip_tolerance
    points = np.stack([tips, tips], axis=1)
    buried = clearance(points, TIP)[:, 0] < problem.required_clearance
    near = np.flatnonzero(buried)
    upper = upper_clearance(problem, points[near]).min(axis=1, initial=np.inf)
    # The tip may be a little beside its place, and nearer by as much.
    reserve = TOLERANCES.bracket_gap + problem.tip_tolerance
    buried[near] = upper < problem.required_clearance - reserve
    none = np.zeros(len(tips), dtype=np.bool_)
    return TipProof(far, buried, none, none)


def least_changed(
    problem: PlanningProblem, clearance: LinkClearance, tips: FloatArray
) -> IntArray:
    """Proved lower bounds of the number of changed link angles, shape (n,).

    Args:
        problem: Arm, scene, required clearance.
        clearance: Lower bounds, which tell where a proof is worth trying.
        tips: Shape (n, 3); [m].

    Returns:
        0 where the tip is within the deviation of unchanged angles of the rail, 1
        elsewhere, and 2 where every posture with one changed angle breaks a limit or
        the clearance whatever the unchanged ones do below their threshold.
    """
    arm = problem.manipulator
    n_links = arm.n_links
    off = np.hypot(tips[:, 1], tips[:, 2])
    slack = deviation(arm, off)
    least = np.where(off > slack.straight, 1, 0)
    if np.isnan(slack.bend).any():
        return least
    reserve = float(np.nanmax(slack.body, initial=0.0))
    low, high = arm.base_range
    knees = np.arange(n_links)
    everywhere, straight = np.ones(len(tips), dtype=np.bool_), np.zeros((n_links, 2))
    node, ends, bends = pose_shapes(
        np.ascontiguousarray(tips), everywhere, knees, straight, arm.stations,
        float(slack.bend.max()), (low - reserve, high + reserve),
    )  # fmt: skip
    possible = bends.max(axis=1, initial=0.0) <= slack.bend[node % n_links]
    node, ends = node[possible], ends[possible]
    tip, joint = node // n_links, node % n_links
    required = problem.required_clearance - TOLERANCES.bracket_gap
    free = np.zeros(len(tips), dtype=np.bool_)
    clearances = clearance(ends)
    free[tip[clearances.min(axis=1) >= required]] = True
    doubtful = ~free[tip]
    for part in (0, 1):
        near = np.flatnonzero(doubtful & (clearances[:, part] < required))
        segments = ends[near, part : part + 2]
        upper = upper_clearance(problem, segments).min(axis=1, initial=np.inf)
        upper = upper + slack.body[tip[near], joint[near]]
        doubtful[near] = ~(upper < required)
    free[tip[doubtful]] = True
    return np.asarray(np.where(free | (least == 0), least, 2))
