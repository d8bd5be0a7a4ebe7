"""What a page shows of a snake arm: its links, the desired path, its joints' plots."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from vdsm_pin.arm.cables import cable_lengths
from vdsm_pin.arm.kinematics import joint_centres, link_angles, link_frames
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.pointing import angles_between
from vdsm_pin.problem.scene import Obstacle
from vdsm_pin.problem.trajectory import Trajectory
from vdsm_pin.report.charts import chart, packed, series
from vdsm_pin.report.drawing import (
    DrawnPart,
    Silhouette,
    obstacle_data,
    row_data,
    solid_data,
    subdivided,
)
from vdsm_pin.report.motion_facts import changed_angles
from vdsm_pin.report.palette import link_colours
from vdsm_pin.report.solids import FINE, surface
from vdsm_pin.report.thinning import Thinned, thinned
from vdsm_pin.units import MM_PER_M, signed

_DASHES: Final = ("", "7 3", "2 3")
_INK: Final = "currentColor"
_DARK: Final = "#3b4048"
_PARTS: Final = 8
"""Of a smooth piece."""

_MOST_BETWEEN: Final = 4_000
"""Rows that a smooth motion is drawn with, where it has not more itself."""


@dataclass(frozen=True)
class ArmDrawing:
    """How the motion of a snake arm is drawn."""

    problem: PlanningProblem
    trajectory: Trajectory

    @property
    def extent(self) -> float:
        """How far obstacles without an end are drawn; [m]."""
        return self.problem.manipulator.total_length

    @property
    def path(self) -> FloatArray:
        """Corners of the desired path, shape (m, 3), none where none is asked; [m]."""
        path = self.problem.tip_path
        return np.zeros((0, 3)) if path is None else path.corners

    @property
    def names(self) -> list[str]:
        """Names of the links, in the order of the brackets."""
        return [f"link {i + 1}" for i in range(self.problem.manipulator.n_links)]

    @property
    def not_drawn(self) -> list[str]:
        """Nothing: the arm is drawn as it is judged."""
        return []

    def scene(self, obstacles: Sequence[Obstacle]) -> dict[str, Any]:
        """The arm, some obstacles and the desired path; base frame, [m]."""
        problem, arm = self.problem, self.problem.manipulator
        return {
            **obstacle_data(problem, obstacles, self.trajectory, self.extent),
            "lengths": arm.link_lengths.tolist(),
            "radius": arm.link_radius,
            "axes": [
                [min(k + 1, arm.n_links) - 1, *span, radius]
                for k, (span, radius) in enumerate(
                    zip(arm.axis_spans.tolist(), arm.axis_radii.tolist(), strict=True)
                )
            ],
            "colours": list(link_colours(arm.n_links)),
            "carried": [
                {"link": link, **solid_data(solid, self.extent, FINE)}
                for link, solid in arm.carried
            ],
            "path": packed(self.path),
        }

    def motion(self, shown: Thinned) -> dict[str, Any]:
        """The joint values of the rows shown; the page computes the poses from them."""
        trajectory, rows = self.trajectory, shown.rows
        on_path = () if self.problem.tip_path is None else trajectory.on_path[rows]
        return {
            **row_data(trajectory, shown),
            **({"smooth": _smooth(trajectory)} if trajectory.is_smooth else {}),
            "onPath": packed(on_path, "u1"),
            "pathM": packed(trajectory.path_m[rows]),
            "x0": packed(trajectory.x0[rows]),
            "alpha": packed(trajectory.alpha[rows]),
            "theta": packed(trajectory.theta[rows]),
        }

    def charts(
        self, shown: Thinned, clearances: list[dict[str, Any]]
    ) -> list[dict[str, Any]]:
        """Every plot in order; angles in degrees, lengths in mm."""
        arm, rows = self.problem.manipulator, self.trajectory
        alpha, theta = rows.alpha[shown.rows], rows.theta[shown.rows]
        psi, x0 = link_angles(alpha, theta), rows.x0[shown.rows] * MM_PER_M
        cone, box = (np.degrees(a) for a in (arm.max_link_angle, arm.max_joint_angle))
        low, high = (v * MM_PER_M for v in arm.base_range)
        ends = " to ".join(signed(f"{value:g}") for value in (low, high))
        changed = changed_angles(psi).astype(np.float64)
        either = (f"+{box:g}°", box), (f"−{box:g}°", -box)
        return [
            chart("Link angles ψ", "ψ [°]", _per_joint("ψ", psi),
                  "Angle between neighbouring links at each joint.",
                  [(f"cone {cone:g}°", cone)], id="psi", floor=0.0),
            chart("Base position x₀", "x₀ [mm]", [series("x₀", _INK, x0)],
                  f"Along the rail, from {ends} mm.",
                  [("rail end", low), ("rail end", high)], id="x0", far_limits=True),
            *self._looking(shown),
            *clearances,
            chart("Changed link angles", "count",
                  [series("changed", _INK, changed, step=True)],
                  "Number of link angles above 0.05°; fewer are easier to drive.",
                  id="changed", floor=0.0, whole=True),
            chart("Pitch angles θ", "θ [°]", _per_joint("θ", theta),
                  "The pitch of each universal joint.", either,
                  id="theta", far_limits=True),
            chart("Yaw angles α", "α [°]", _per_joint("α", alpha),
                  "The yaw of each universal joint.", either,
                  id="alpha", far_limits=True),
            chart("Cable lengths", "change [mm]", _changes(arm, alpha, theta),
                  "Change against the straight arm; cables a, b, c of each link.",
                  id="cables"),
        ]  # fmt: skip

    def _looking(self, shown: Thinned) -> list[dict[str, Any]]:
        """The angle between the last link and where it shall look, of a path that says.

        Errors are left out; nothing is shown where the tip is off the path.
        """
        path = self.problem.tip_path
        if path is None or path.pointing is None:
            return []
        rows, trajectory = shown.rows, self.trajectory
        columns = (trajectory.x0[rows], trajectory.alpha[rows], trajectory.theta[rows])
        centres = joint_centres(self.problem.manipulator, *columns)
        aims = path.aims(centres[:, -1], trajectory.path_m[rows])
        angles = np.degrees(angles_between(centres[:, -1] - centres[:, -2], aims))
        shown_angles = np.where(trajectory.on_path[rows], angles, np.nan)
        cone = float(np.degrees(path.pointing.cone))
        return [
            chart("Where the last link looks", "angle [°]",
                  [series("off", _INK, shown_angles)],
                  "Angle between its axis and where it shall look on the path.",
                  [(f"cone {cone:g}°", cone)], id="looking", floor=0.0)
        ]  # fmt: skip

    def stance(self, q: FloatArray) -> dict[str, Any]:
        """The joints' centres at x0, alpha1, theta1, .., shape (1 + 2N,)."""
        columns = q[:1], q[None, 1::2], q[None, 2::2]
        return {
            "centres": joint_centres(self.problem.manipulator, *columns)[0].tolist()
        }

    def silhouette(self, moment: float) -> Silhouette:
        """The links' axes at a moment in waypoints."""
        arm, centres = self.problem.manipulator, self.points(np.array([moment]))[0]
        links = [centres[i : i + 2] for i in range(arm.n_links)]
        return Silhouette(links, arm.link_radius)

    def told_moments(self) -> FloatArray:
        """The rows that a page shows; of a smooth motion moments between them."""
        rows = np.arange(float(self.trajectory.n_samples))
        if self.trajectory.is_smooth:
            return subdivided(rows, np.full(len(rows) - 1, _PARTS))
        return rows[thinned(self.trajectory, np.zeros(0, dtype=np.int64)).rows]

    def points(self, moments: FloatArray) -> FloatArray:
        """The joints' centres at moments in waypoints, shape (n, N + 1, 3); [m]."""
        rows = self.trajectory.at(moments)
        return joint_centres(self.problem.manipulator, rows.x0, rows.alpha, rows.theta)

    def parts(self, moments: FloatArray) -> list[DrawnPart]:
        """The links with tool and feed, and what they carry, at moments."""
        arm, rows = self.problem.manipulator, self.trajectory.at(moments)
        centres, turns = self.points(moments), link_frames(rows.alpha, rows.theta)
        colours = [*link_colours(arm.n_links), _DARK]
        solids = [(one, colours[k]) for k, one in enumerate(arm.rods)]
        solids += [(one, _DARK) for one in arm.carried]
        still = np.broadcast_to(np.eye(3), (len(moments), 3, 3))
        return [
            DrawnPart(
                solid.name,
                surface(solid, 1.0, FINE),
                colour,
                centres[:, max(0, link - 1)],
                turns[:, link - 1] if link else still,
            )
            for (link, solid), colour in solids
        ]


def _smooth(trajectory: Trajectory) -> dict[str, Any]:
    """Joint values between the rows of a smooth motion, for the picture alone."""
    count = trajectory.n_samples - 1
    parts = max(1, min(32, _MOST_BETWEEN // count))
    fine = trajectory.refined(parts)
    return {
        "moments": packed(np.arange(fine.n_samples) / parts, "<f8"),
        "x0": packed(fine.x0),
        "alpha": packed(fine.alpha),
        "theta": packed(fine.theta),
    }


def _per_joint(symbol: str, values: FloatArray) -> list[dict[str, Any]]:
    colours = link_colours(values.shape[1])
    return [
        series(f"{symbol}{i + 1}", colours[i], np.degrees(values[:, i]))
        for i in range(values.shape[1])
    ]


def _changes(
    arm: Manipulator, alpha: FloatArray, theta: FloatArray
) -> list[dict[str, Any]]:
    """Lengths of all cables less those of the straight arm."""
    zero = np.zeros((1, arm.n_links))
    lengths = cable_lengths(arm, alpha, theta)
    change = (lengths - cable_lengths(arm, zero, zero)) * MM_PER_M
    return [
        series(f"l{i + 1}{hole}", colour, change[:, i, j], dash=_DASHES[j])
        for i, colour in enumerate(link_colours(arm.n_links))
        for j, hole in enumerate("abc")
    ]
