"""Rows of a snake arm's motion pushed up the slopes of clearances, the tip held."""

from collections.abc import Iterator
from typing import Final

import numpy as np

from vdsm_pin.arm.kinematics import joint_centres, link_angles, tip_jacobian
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.proof.paths import Path
from vdsm_pin.repair.causes import AT_LIMIT, Limit, Place, end_limits
from vdsm_pin.verification.pair_slopes import pair_slopes
from vdsm_pin.verification.task import arm_assembly

PUSHES: Final = 40
"""Most steps of one row up the slopes."""

LONGEST: Final = 0.05
"""Longest such step of a joint; [rad], of x0 in arm lengths."""

INSIDE: Final = 1.0 - 1e-9
"""Rows stay so far inside the limits that rounding cannot lead beyond them."""

TIP: Final = 1e-3
"""Part of the tip's tolerance that is left of a tip's error; [-]."""

DAMPING: Final = 1e-9
"""Of the least squares, in parts of the trace of J J^T; [-]."""

CORRECTIONS: Final = 8
"""Most steps that lead a tip back."""


def joint_scale(arm: Manipulator) -> FloatArray:
    """Makes x0 comparable with angles: arm lengths, shape (1 + 2N,); [1/m], [-]."""
    scale = np.ones(1 + 2 * arm.n_links)
    scale[0] = 1.0 / arm.total_length
    return scale


class Slopes:
    """How much room pairs have beyond what is required, and where it grows."""

    def __init__(self, problem: PlanningProblem) -> None:
        self.problem, self._arm = problem, problem.manipulator
        asked = arm_assembly(problem)
        self.names = [str(pair) for pair in asked.pairs]
        still = Path(np.zeros((1, asked.tree.n_columns)))
        self._task = asked.question.about(still).task
        self._required = self._task.pairs.required
        self._scale = joint_scale(self._arm)
        self._goal = TIP * problem.tip_tolerance

    def asked(
        self, margins: dict[int, float]
    ) -> tuple[FloatArray, FloatArray, list[str]]:
        """Margins of pairs and what is required of them, (n_pairs,) [m], and names."""
        pairs = [*margins]
        names = [self.names[k] for k in pairs]
        return np.array([*margins.values()]), self._required[pairs], names

    def room(
        self, q: FloatArray, margins: dict[int, float]
    ) -> tuple[FloatArray, FloatArray]:
        """Room of pairs at rows of q, (m, n_pairs), and its slopes (n_pairs, m, n)."""
        q = np.ascontiguousarray(q)
        found = [pair_slopes(self._task, k, q) for k in margins]
        gaps = [
            gap - self._required[k] - margin
            for (gap, _), (k, margin) in zip(found, margins.items(), strict=True)
        ]
        return np.stack(gaps, axis=1), np.stack([slope for _, slope in found])

    def up(
        self, q: FloatArray, tips: FloatArray, margins: dict[int, float]
    ) -> FloatArray:
        """Rows of q that have room, or the best that steps along slopes lead to."""
        q = self.led_back(q, tips)
        best, most = q.copy(), np.full(len(q), -np.inf)
        left = np.arange(len(q))
        for _ in range(PUSHES):
            room, slopes = self.room(q[left], margins)
            worst = np.argmin(room, axis=1)
            least = room[np.arange(left.size), worst]
            off = np.linalg.norm(tips[left] - self._tip(q[left]), axis=1)
            better = (least > most[left]) & ~(off > self._goal)  # of NaN none is off
            best[left[better]], most[left[better]] = q[left[better]], least[better]
            under = least < 0.0
            left, least, worst = left[under], least[under], worst[under]
            if not left.size:
                break
            slope = slopes[:, under][worst, np.arange(left.size)]
            q[left] = self._stepped(q[left], slope, -least, tips[left])
        return best

    def at(self, row: FloatArray, margins: dict[int, float], drawing: bool) -> Place:
        """What pairs have of their margins at a row of q, shape (1, n), and why; [m].

        Args:
            row: The row.
            margins: Of the pairs; [m].
            drawing: Whether the tip is to stay where it is.
        """
        width, arm = self._scale.size, self._arm
        room, slopes = self.room(row, margins)
        J = self._jacobian(row)[0] / self._scale

        def held(slope: FloatArray) -> FloatArray:
            along = _least_step(J[None], (J @ slope)[None, :, None])[0]
            return np.asarray(slope - along)

        each = slopes[:, 0, :width] / self._scale
        names = [self.names[k] for k in margins]
        limits = [*end_limits(row[0, :1], np.array([arm.base_range]), ["the base"])]
        limits = [Limit(one.name, np.eye(width)[0] * one.outwards) for one in limits]
        limits += self._bent(row[0, 1:width].reshape(-1, 2))
        return Place(names, room[0], each, limits, held if drawing else None)

    def _bent(self, angles: FloatArray) -> Iterator[Limit]:
        """Joints at a limit of theirs, angles of shape (N, 2)."""
        arm, none = self._arm, np.zeros(self._scale.size)
        psi = link_angles(angles[None, :, 0], angles[None, :, 1])[0]
        for k, (pair, bend) in enumerate(zip(angles, psi, strict=True)):
            at_end = np.abs(pair) >= arm.max_joint_angle - AT_LIMIT
            if bend >= arm.max_link_angle - AT_LIMIT or at_end.all():
                outwards = pair / np.linalg.norm(pair)
            elif at_end.any():
                outwards = np.where(at_end, np.sign(pair), 0.0)
            else:
                continue
            beyond = none.copy()
            beyond[1 + 2 * k : 3 + 2 * k] = outwards
            yield Limit(f"joint {k + 1}", beyond)

    def _stepped(
        self, q: FloatArray, slope: FloatArray, missing: FloatArray, tips: FloatArray
    ) -> FloatArray:
        """A step up the slopes that should gain what is missing, within the limits."""
        width = self._scale.size
        slope = slope[:, :width] / self._scale
        held = np.isfinite(tips[:, 0])
        J = self._jacobian(q[held]) / self._scale
        slope[held] -= _least_step(J, J @ slope[held, :, None])
        squared = (slope * slope).sum(axis=1)
        gain = np.where(squared > 1e-12, 1.02 * missing / np.maximum(squared, 1e-12), 0)
        step = gain[:, None] * slope
        longest = np.abs(step).max(axis=1, initial=0.0)
        step *= np.minimum(1.0, LONGEST / np.maximum(longest, 1e-300))[:, None]
        q = q.copy()
        q[:, :width] += step / self._scale
        return self.led_back(q, tips)

    def led_back(self, q: FloatArray, tips: FloatArray) -> FloatArray:
        """The nearest rows within the limits whose tips are where they have to be.

        A joint that was led back into its limits moves no more.
        """
        width, wanted = self._scale.size, q
        q = self._limited(q)
        weight = np.where(q == wanted, 1.0, 0.0)[:, :width] / self._scale
        for _ in range(CORRECTIONS):
            off = tips - self._tip(q)
            # No tip is far from NaN.
            far = np.flatnonzero(np.linalg.norm(off, axis=1) > self._goal)
            if not far.size:
                break
            J = self._jacobian(q[far]) * weight[far, None]
            wanted = q.copy()
            wanted[far, :width] += _least_step(J, off[far, :, None]) * weight[far]
            q = self._limited(wanted)
            weight[(q != wanted)[:, :width]] = 0.0
        return q

    def _limited(self, q: FloatArray) -> FloatArray:
        """Rows with every joint led back into its limits."""
        arm, width = self._arm, self._scale.size
        q = q.copy()
        q[:, 0] = np.clip(q[:, 0], *arm.base_range)
        angles = q[:, 1:width]
        angles = np.clip(angles, -arm.max_joint_angle, arm.max_joint_angle)
        psi = link_angles(angles[:, ::2], angles[:, 1::2])
        limit = INSIDE * arm.max_link_angle
        share = np.where(psi > limit, limit / np.maximum(psi, limit), 1.0)
        q[:, 1:width] = angles * np.repeat(share, 2, axis=1)
        return q

    def _tip(self, q: FloatArray) -> FloatArray:
        """The tips, shape (m, 3); [m]."""
        width = self._scale.size
        x0, alpha, theta = q[:, 0], q[:, 1:width:2], q[:, 2:width:2]
        return joint_centres(self._arm, x0, alpha, theta)[:, -1]

    def _jacobian(self, q: FloatArray) -> FloatArray:
        """Of the tip, shape (m, 3, 1 + 2N); [-], [m/rad]."""
        width = self._scale.size
        return tip_jacobian(self._arm, q[:, 1:width:2], q[:, 2:width:2])


def _least_step(J: FloatArray, off: FloatArray) -> FloatArray:
    """The least step (m, n) with J step = off; damped where J (m, 3, n) is singular."""
    square = J @ np.swapaxes(J, 1, 2)
    size = np.trace(square, axis1=1, axis2=2)[:, None, None]
    damped = square + (DAMPING * size + 1e-300) * np.eye(3)
    return np.asarray((np.swapaxes(J, 1, 2) @ np.linalg.solve(damped, off))[:, :, 0])
