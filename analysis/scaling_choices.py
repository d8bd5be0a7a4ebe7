"""The paper's future work measured: another scaling centre, ratios that vary.

    python analysis/scaling_choices.py --out reports/paper

At positions along each desired path, is there an arm within the limits that keeps the
clearance? Four ways to place the joints' projections P_i for a tip T are compared:

* constant: P_i = k_i T, the paper's scaling about Y = Z = 0; the arm is straight.
* varying ratios: P_i = k'_i T, one joint's ratio free, the others in proportion; the
  arm bends in the plane through rail and tip.
* another centre: P_i = C + k'_i (T - C) from one joint on, with C anywhere.

For each the smallest largest psi is told too. Every choice but the first changes one
link angle more.

Then `ratios` of the problem file, which hold for a whole path: on a lattice of scaling
centres, of one ratio and of cylinders, how many draw all of it, and with which angles.
"""

import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from result_files import output_folder, table_lines, write_table

from benchmarks.hrm1000.generate import generate
from vdsm_pin.arm.kinematics import joint_angles, link_angles
from vdsm_pin.arm.manipulator import Manipulator
from vdsm_pin.errors import Infeasible
from vdsm_pin.geometry.arrays import FloatArray
from vdsm_pin.io.problem_file import read_problem
from vdsm_pin.planner.paper.pipeline import plan_paper
from vdsm_pin.problem.planning_problem import PlanningProblem
from vdsm_pin.problem.scaling import (
    OtherRatios,
    ProjectionCylinder,
    Scaling,
    ScalingCentre,
)
from vdsm_pin.verification.link_clearance import link_clearance

PAPER = ("obs1", "obs2", "obs2-small", "obs3")
WHOLE = ("free", *PAPER)
FAMILIES = ("prismatic_x", "crossing", "clutter", "wall", "narrow")
PER_FAMILY = 3
"""Problems of each family."""
SPACING = 0.15
"""Distance of the tip positions; [m]."""
LATTICE = 0.06
"""Step of the slopes P / s that are tried; [-]."""
CYLINDERS = {
    "cylinder, R 1.31 to 2 m": (1.31, 1.4, 1.6, 1.8, 2.0),
    "cylinder, R 3 to 100 m": (3.0, 5.0, 10.0, 100.0),
}
NAMES = ("constant", "varying ratios", "another centre")


def bent(arm: Manipulator, tip: FloatArray, joint: int, at: FloatArray) -> FloatArray:
    """Joint centres with joint `joint` (from 0) projected to `at` and no other bend.

    Args:
        arm: The arm.
        tip: Shape (3,); [m].
        joint: 1..N - 1.
        at: Shape (n, 2); [m].

    Returns:
        Shape (m, N + 1, 3), without those whose links would be too short; [m].
    """
    s, total = arm.stations, arm.total_length
    ahead = np.minimum(s / s[joint], 1.0)
    after = np.maximum((s - s[joint]) / (total - s[joint]), 0.0)
    planar = ahead[:, None] * at[:, None] + after[:, None] * (tip[1:] - at)[:, None]
    gaps = np.linalg.norm(np.diff(planar, axis=1), axis=2)
    planar = planar[(gaps < arm.link_lengths).all(axis=1)]
    gaps = np.linalg.norm(np.diff(planar, axis=1), axis=2)
    rises = np.sqrt(arm.link_lengths**2 - gaps**2)
    back = np.cumsum(rises[:, ::-1], axis=1)[:, ::-1]
    x = np.column_stack([tip[0] - back, np.full(len(planar), tip[0])])
    return np.concatenate([x[..., None], planar], axis=2)


def candidates(arm: Manipulator, tip: FloatArray, name: str) -> FloatArray:
    """Every configuration that a choice allows at a tip, on a lattice."""
    ray = tip[1:] / arm.total_length
    if name == "constant":
        return bent(arm, tip, 1, arm.stations[1] * ray[None])
    limit = np.sin(arm.max_link_angle)
    found = []
    for joint in range(1, arm.n_links):
        if name == "varying ratios":
            length = max(float(np.linalg.norm(ray)), 1e-9)
            part = np.arange(-limit, limit, LATTICE / 4.0) / length
            slopes = part[:, None] * ray
        else:
            side = np.arange(-limit, limit, LATTICE)
            slopes = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
            slopes = slopes[np.hypot(*slopes.T) <= limit]
        found.append(bent(arm, tip, joint, arm.stations[joint] * slopes))
    return np.concatenate(found)


def least_angle(problem: PlanningProblem, tip: FloatArray, name: str) -> float:
    """Smallest largest psi of the clear configurations, inf without any; [rad]."""
    arm = problem.manipulator
    centres = candidates(arm, tip, name)
    alpha, theta = joint_angles(arm, centres)
    psi = link_angles(alpha, theta).max(axis=1)
    box = np.maximum(np.abs(alpha), np.abs(theta)).max(axis=1)
    low, high = arm.base_range
    fine = (psi <= arm.max_link_angle) & (box <= arm.max_joint_angle)
    fine &= (centres[:, 0, 0] >= low) & (centres[:, 0, 0] <= high)
    centres, psi = centres[fine], psi[fine]
    if not len(centres):
        return np.inf
    room = link_clearance(problem)(np.ascontiguousarray(centres)).min(axis=1)
    return float(psi[room >= problem.required_clearance].min(initial=np.inf))


def measured(problem: PlanningProblem) -> FloatArray:
    """Least angle of each choice at each tip position, shape (k, 3); [rad]."""
    path = problem.path
    tips = path.at(np.arange(0.0, path.length, SPACING))
    angles = np.array([[least_angle(problem, tip, n) for n in NAMES] for tip in tips])
    # One ratio that varies is a centre on the ray to the tip, tried on a finer lattice.
    angles[:, 2] = np.minimum(angles[:, 1], angles[:, 2])
    return angles


def row(name: str, angles: FloatArray) -> dict[str, object]:
    """Shares of positions with a clear arm, and angles where all three have one."""
    clear = np.isfinite(angles)
    blocked = ~clear[:, 0]
    both = clear[:, 1] & clear[:, 2] & blocked
    return {
        "scene": name,
        "positions": len(angles),
        "clear": clear.mean(axis=0).round(4).tolist(),
        "blocked": int(blocked.sum()),
        "of_blocked": clear[blocked].sum(axis=0).tolist(),
        "psi_deg": _medians(angles[both]),
    }


def _medians(angles: FloatArray) -> list[float | None]:
    """Medians of each choice, None where the choice has no clear arm; [deg]."""
    if not len(angles):
        return [None] * len(NAMES)
    values = np.rad2deg(np.median(angles, axis=0)).tolist()
    return [round(value, 1) if np.isfinite(value) else None for value in values]


def settings(arm: Manipulator) -> Iterator[tuple[str, Scaling | None]]:
    """Every setting of `ratios` that is tried, by the name of its kind."""
    yield "constant", None
    for joint in range(2, arm.n_links + 1):
        for factor in np.arange(0.5, 1.51, 0.05):
            knots = [0.0, arm.ratios[joint - 1], 1.0]
            ratios = np.interp(arm.ratios, knots, [0.0, factor * knots[1], 1.0])
            yield "one ratio times 0.5 to 1.5", OtherRatios(ratios[1:-1])
        for y in np.arange(-0.5, 0.51, 0.05):
            for z in np.arange(-0.5, 0.51, 0.05):
                yield "another centre", ScalingCentre(np.array([y, z]), joint)
    for kind, radii in CYLINDERS.items():
        for radius in radii:
            for axis in ("y", "z"):
                yield kind, ProjectionCylinder(radius, axis)


def whole(problem: PlanningProblem) -> list[dict[str, object]]:
    """What the settings of each kind do for a whole path, kind by kind."""
    found: dict[str, list[list[float]]] = {}
    asked: dict[str, int] = {}
    for kind, scaling in settings(problem.manipulator):
        asked[kind] = asked.get(kind, 0) + 1
        found.setdefault(kind, [])
        own = replace(problem, scaling=scaling)
        try:
            plan = plan_paper(own, link_clearance(own), 0.0)
        except Infeasible:
            continue
        if len(plan.undrawn):
            continue
        motion = plan.trajectory
        psi = link_angles(motion.alpha, motion.theta)
        changed = float((psi > np.deg2rad(0.01)).sum(axis=1)[motion.on_path].mean())
        best = [np.rad2deg(psi.max()), float(np.ptp(motion.x0)), changed]
        found[kind].append(best)
    return [
        {
            "scene": f"paper/{problem.name}",
            "ratios": kind,
            "tried": count,
            "drawn": len(found[kind]),
            "best": np.round(min(found[kind], default=[]), 3).tolist(),
        }
        for kind, count in asked.items()
    ]


def whole_table(rows: list[dict[str, object]]) -> str:
    """What holds for a whole path, as Markdown."""
    lines = [
        "",
        "## Held along a whole path",
        "",
        "The `ratios` of the problem file. Constant ratios go round obstacles by",
        "Step 5, the others do not. Angles and stroke are those of the setting that",
        "draws the whole path with the least psi; where none does, there is no row.",
        "",
    ]
    head = ("scene", "ratios", "tried", "draw it all", "largest psi [deg]",
            "stroke of x0 [mm]", "changed link angles, mean")  # fmt: skip
    cells = []
    for one in (one for one in rows if one["drawn"]):
        psi, stroke, changed = one["best"]  # type: ignore[misc]
        best = f"{psi:.2f}", f"{1e3 * stroke:.0f}", f"{changed:.2f}"
        cells.append([one["scene"], one["ratios"], one["tried"], one["drawn"], *best])
    return "\n".join([*lines, *table_lines(head, cells), ""])


def table(rows: list[dict[str, object]]) -> str:
    """The rows as Markdown."""
    head = ("scene", "tip positions", "straight arm blocked",
            "of those clear with varying ratios", "with another centre",
            "median largest psi there, ratios / centre [deg]")  # fmt: skip
    cells = []
    for one in rows:
        _, ratios, centre = one["of_blocked"]  # type: ignore[misc]
        _, psi_r, psi_c = one["psi_deg"]  # type: ignore[misc]
        psi = "-" if psi_r is None else f"{psi_r} / {psi_c}"
        place = one["scene"], one["positions"], one["blocked"]
        cells.append([*place, ratios, centre, psi])
    return "\n".join(["# Other ways of scaling", "", *table_lines(head, cells), ""])


def main() -> None:
    """Measure, print, save."""
    folder, rows = output_folder(__doc__), []
    for name in PAPER:
        problem = read_problem(f"paper/{name}")
        rows.append(row(f"paper/{name}", measured(problem)))
        print(rows[-1], flush=True)
    for family in FAMILIES:
        found = []
        for number in range(PER_FAMILY):
            with tempfile.TemporaryDirectory() as work:
                path = generate(Path(work), family, number)
                found.append(measured(read_problem(path)))
        rows.append(row(f"{PER_FAMILY} of {family}", np.concatenate(found)))
        print(rows[-1], flush=True)
    held = [one for name in WHOLE for one in whole(read_problem(f"paper/{name}"))]
    text = table(rows) + whole_table(held)
    write_table(folder, "scaling_choices", [*rows, *held], text)


if __name__ == "__main__":
    main()
